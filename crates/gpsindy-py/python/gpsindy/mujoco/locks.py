"""Joints that are held in place while others are tested."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gpsindy.data._tables import unknown
from gpsindy.mujoco._engine import mujoco
from gpsindy.mujoco.base import FIRM
from gpsindy.mujoco.settings import name_of


class Locks:
    """Joints that do not move: they are no states, nothing in them is a suspect, and their actuators need no column.

    They stay in the model and are made so heavy that nothing moves them; the compiled part puts them back at every sample besides.

    Parameters
    ----------
    model : MjModel
        Changed: locked joints become heavy, and lose friction and limits.
    joints : sequence of int
        Numbers of the hinges and slides.
    given : str, iterable of str, or mapping of str to float or None
        Names of joints, where ``*`` and ``?`` stand for any characters and any one, and the position at which each is held, in rad or m;
        None and names alone: where the file places it.

    Raises
    ------
    ValueError
        An unknown joint, a position that is not finite, and no joint that is left to move.
    """

    def __init__(self, model: Any, joints: Sequence[int], given: str | Iterable[str] | Mapping[str, float | None]) -> None:
        names = {name_of(model, mujoco.mjtObj.mjOBJ_JOINT, j): j for j in joints}
        held = _by_joint(given, list(names))
        #: Numbers of the joints that move.
        self.joints = [j for j in joints if j not in {names[name] for name in held}]
        if held and not self.joints:
            raise ValueError("locked: every joint is locked, so nothing moves; leave the joint unlocked that the logs measure")
        #: Places in qpos and qvel, and the position at which the joint is held.
        self.places: list[tuple[int, int, float]] = []
        for name, position in held.items():
            place = int(model.jnt_qposadr[names[name]])
            at = float(model.qpos0[place]) if position is None else float(position)
            if not math.isfinite(at):
                raise ValueError(f"locked: joint {name!r}: the position must be finite, found {at!r}")
            self.places.append((place, int(model.jnt_dofadr[names[name]]), at))
        on_joint = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}
        #: Numbers of the actuators that drive a locked joint.
        self.actuators = {
            a
            for a in range(model.nu)
            if int(model.actuator_trntype[a]) in on_joint and int(model.actuator_trnid[a, 0]) in {names[name] for name in held}
        }
        if held:
            inertia = FIRM * float(model.body_mass.sum() + model.body_inertia.sum())
            for name in held:
                # Neither friction nor stops matter, and the engine's solver need not look at them.
                model.jnt_limited[names[name]] = 0
                model.dof_frictionloss[model.jnt_dofadr[names[name]]] = 0.0
                model.dof_armature[model.jnt_dofadr[names[name]]] = inertia
            mujoco.mj_setConst(model, mujoco.MjData(model))


def _by_joint(given: str | Iterable[str] | Mapping[str, float | None], joints: Sequence[str]) -> dict[str, float | None]:
    """Positions by name of a joint, patterns resolved; a name counts more than a pattern."""
    names = [given] if isinstance(given, str) else given
    wanted = dict(names) if isinstance(names, Mapping) else dict.fromkeys(names)
    found: dict[str, float | None] = {}
    for pattern, position in sorted(wanted.items(), key=lambda item: item[0] in joints):
        matching = [pattern] if pattern in joints else fnmatch.filter(joints, pattern)
        if not matching:
            raise unknown("locked: the model has no joint", pattern, joints)
        found.update(dict.fromkeys(matching, position))
    return {name: found[name] for name in joints if name in found}
