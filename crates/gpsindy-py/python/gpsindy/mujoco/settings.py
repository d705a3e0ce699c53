"""Numbers of a MuJoCo model that the logs may correct."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from gpsindy.data._tables import unknown
from gpsindy.mujoco._engine import mujoco


@dataclass(frozen=True)
class Setting:
    """A number of the engine's model that the logs may correct.

    Attributes
    ----------
    name : str
        ``JOINT.frictionloss``, ``JOINT.damping``, ``JOINT.armature``, ``JOINT.stiffness``, ``ACTUATOR.kp``,
        ``ACTUATOR.kv`` or ``BODY.mass`` (the inertia follows the mass in proportion); ``ACTUATOR.forcerange`` and
        ``JOINT.actuatorfrcrange``, limits alike to both sides; ``gravity.x`` and ``gravity.y``, how the base is tilted;
        ``ACTUATOR.kp`` and ``ACTUATOR.kd`` of a driver.
    value : float
        In the nominal model.
    unit : str
    element : str
        Name of the joint, actuator or body; ``gravity``.
    attribute : str
        What comes after the dot.
    index : int
        Of the element in the engine's arrays; of the component.
    scale : float or None
        A change that matters, if the value itself does not give one.
    driver : bool
        It belongs to the driver around the engine, which no MJCF describes.
    tolerance : float or None
        Relative standard deviation of what is a guess.
    """

    name: str
    value: float
    unit: str
    element: str
    attribute: str
    index: int
    scale: float | None
    driver: bool = False
    tolerance: float | None = None


def name_of(m: Any, kind: Any, index: int) -> str:
    """Name of an element; a made-up one where it has none."""
    words = {mujoco.mjtObj.mjOBJ_JOINT: "joint", mujoco.mjtObj.mjOBJ_ACTUATOR: "actuator", mujoco.mjtObj.mjOBJ_BODY: "body"}
    return mujoco.mj_id2name(m, kind, index) or f"{words[kind]}_{index}"


_Value = TypeVar("_Value")


def by_name(given: Mapping[str, _Value], names: Sequence[str], what: str) -> dict[str, _Value]:
    """Values by name in the order of ``names``; ``*`` and ``?`` in a name stand for any characters and any one, and a name counts more than a pattern.

    Raises
    ------
    ValueError
        ``what`` and the name, where no name is it.
    """
    found: dict[str, _Value] = {}
    for pattern, value in sorted(given.items(), key=lambda item: item[0] in names):
        matching = [pattern] if pattern in names else fnmatch.filter(names, pattern)
        if not matching:
            raise unknown(what, pattern, names)
        found.update(dict.fromkeys(matching, value))
    return {name: found[name] for name in names if name in found}


def joint_of(m: Any, actuator: int) -> int | None:
    """Number of the joint that an actuator drives; none where it drives something else."""
    on_joint = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    return int(m.actuator_trnid[actuator, 0]) if int(m.actuator_trntype[actuator]) in on_joint else None


def first(field: Any) -> Any:
    """The leading coefficient, where a field is a polynomial."""
    return field if field.ndim == 2 else field[..., 0]


def is_servo(m: Any, actuator: int) -> bool:
    """Whether its command is where to go: a position servo of the engine."""
    gain, bias = m.actuator_gainprm[actuator], m.actuator_biasprm[actuator]
    affine = m.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_AFFINE
    return bool(affine and bias[1] != 0 and bias[1] == -gain[0])


#: Components of gravity.
AXES = ("x", "y", "z")

#: Limits of a force, and the fields that have them.
LIMITS = {"forcerange": "actuator_forcerange", "actuatorfrcrange": "jnt_actfrcrange"}

#: Numbers of an actuator.
OF_AN_ACTUATOR = ("kp", "kv", "forcerange")

#: Numbers of a degree of freedom.
OF_A_DOF = ("frictionloss", "damping", "armature")


def settings_of(m: Any, joints: Mapping[int, str], actuators: Sequence[str]) -> list[Setting]:
    data = mujoco.MjData(m)
    mujoco.mj_forward(m, data)
    inertia = np.zeros((m.nv, m.nv))
    mujoco.mj_fullM(m, data, inertia)
    found = []
    for j, joint in joints.items():
        dof = m.jnt_dofadr[j]
        hinge = m.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE
        force = "N m" if hinge else "N"
        scale = float(inertia[dof, dof])

        def of(attribute: str, value: float, unit: str, scale: float | None) -> None:
            found.append(Setting(f"{joint}.{attribute}", value, unit, joint, attribute, j, scale or None))

        of("frictionloss", float(m.dof_frictionloss[dof]), force, scale)
        of("damping", float(first(m.dof_damping[None])[0, dof]), f"{force} s" if hinge else "N s/m", scale)
        of("armature", float(m.dof_armature[dof]), "kg m^2" if hinge else "kg", scale)
        if float(m.qpos_spring[m.jnt_qposadr[j]]) == 0.0:
            of("stiffness", float(first(m.jnt_stiffness[None])[0, j]), force if hinge else "N/m", scale)
        if m.jnt_actfrclimited[j] and (most := _alike(m.jnt_actfrcrange[j])):
            of("actuatorfrcrange", most, force, None)
    for a, actuator in enumerate(actuators):
        if m.actuator_forcelimited[a] and (most := _alike(m.actuator_forcerange[a])):
            found.append(Setting(f"{actuator}.forcerange", most, "", actuator, "forcerange", a, None))
        gain, bias = m.actuator_gainprm[a], m.actuator_biasprm[a]
        affine = m.actuator_biastype[a] == mujoco.mjtBias.mjBIAS_AFFINE
        if is_servo(m, a):
            found.append(Setting(f"{actuator}.kp", float(gain[0]), "", actuator, "kp", a, None))
        if affine and bias[2] != 0:
            # A velocity servo's gain is its damping; a position servo's damping is separate.
            own = None if bias[1] == 0 and bias[2] == -gain[0] else abs(float(bias[2]))
            found.append(Setting(f"{actuator}.kv", float(-bias[2]), "", actuator, "kv", a, own))
    for b in range(1, m.nbody):
        # Only what a joint can move, and only what weighs something.
        if m.body_weldid[b] != 0 and m.body_mass[b] > 0:
            body = name_of(m, mujoco.mjtObj.mjOBJ_BODY, b)
            found.append(Setting(f"{body}.mass", float(m.body_mass[b]), "kg", body, "mass", b, None))
    return found + _tilts(m, list(joints))


def _alike(limits: Any) -> float | None:
    """The limit to both sides, where they are alike."""
    low, high = float(limits[0]), float(limits[1])
    return high if low == -high and high > 0.0 else None


def _tilts(m: Any, joints: Sequence[int]) -> list[Setting]:
    """The components of gravity across its main one that move a joint: a base that does not stand level has others."""
    gravity = [float(g) for g in m.opt.gravity]
    size = float(np.linalg.norm(gravity))
    if not joints or m.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY or size == 0.0:
        return []
    main = int(np.argmax(np.abs(gravity)))
    across = [(axis, k) for k, axis in enumerate(AXES) if k != main and _pulls(m, joints, k, size)]
    return [Setting(f"gravity.{axis}", gravity[k], "m/s^2", "gravity", axis, k, size) for axis, k in across]


def _pulls(m: Any, joints: Sequence[int], component: int, size: float) -> bool:
    """Whether gravity along an axis pulls at a joint, somewhere."""
    data, places, dofs = mujoco.MjData(m), m.jnt_qposadr[joints], m.jnt_dofadr[joints]
    random, kept = np.random.default_rng(0), float(m.opt.gravity[component])
    forces = []
    for way in random.uniform(-1.0, 1.0, (3, len(joints))):
        data.qpos[:] = m.qpos0
        data.qpos[places] += way
        for strength in (kept, kept + size):
            m.opt.gravity[component] = strength
            mujoco.mj_forward(m, data)
            forces.append(data.qfrc_bias[dofs].copy())
    m.opt.gravity[component] = kept
    return bool(np.abs(np.diff(forces, axis=0)[::2]).max() > 1e-9 * np.abs(forces).max())
