"""Joints that are held in place while others are tested."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gpsindy.mujoco._engine import mujoco
from gpsindy.mujoco.base import firm
from gpsindy.mujoco.settings import by_name, joint_of, name_of


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
        wanted = {given: None} if isinstance(given, str) else given
        wanted = wanted if isinstance(wanted, Mapping) else dict.fromkeys(wanted)
        held = {names[name]: position for name, position in by_name(wanted, list(names), "locked: the model has no joint").items()}
        #: Numbers of the joints that move.
        self.joints = [j for j in joints if j not in held]
        #: Places in qpos and qvel, and the position at which the joint is held.
        self.places: list[tuple[int, int, float]] = []
        #: Numbers of the actuators that drive a locked joint.
        self.actuators = {a for a in range(model.nu) if joint_of(model, a) in held}
        if not held:
            return
        if not self.joints:
            raise ValueError("locked: every joint is locked, so nothing moves; leave the joint unlocked that the logs measure")
        inertia = firm(model)
        for j, position in held.items():
            place, dof = int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j])
            at = float(model.qpos0[place]) if position is None else float(position)
            if not math.isfinite(at):
                name = name_of(model, mujoco.mjtObj.mjOBJ_JOINT, j)
                raise ValueError(f"locked: joint {name!r}: the position must be finite, found {at!r}")
            self.places.append((place, dof, at))
            # Neither friction nor stops matter, and the engine's solver need not look at them.
            model.jnt_limited[j] = 0
            model.dof_frictionloss[dof] = 0.0
            model.dof_armature[dof] = inertia
        mujoco.mj_setConst(model, mujoco.MjData(model))
