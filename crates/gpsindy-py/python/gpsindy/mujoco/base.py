"""Free bases: a body without a place of its own in the joints, moved as the logs or a stand say."""

from __future__ import annotations

from typing import Any

from gpsindy.mujoco._engine import mujoco

#: Inertia of a base whose motion is prescribed, as a multiple of the model's own: its legs then move it by less than a millionth.
FIRM = 1e6

#: How a base may move, and the columns that say it beside each other.
ORIENTATION = (("base_qw", ""), ("base_qx", ""), ("base_qy", ""), ("base_qz", ""))
RATES = (*((f"base_w{axis}", "rad/s") for axis in "xyz"), *((f"base_dw{axis}", "rad/s^2") for axis in "xyz"))
PLACE = (*((f"base_{axis}", "m") for axis in "xyz"), *((f"base_v{axis}", "m/s") for axis in "xyz"), *((f"base_a{axis}", "m/s^2") for axis in "xyz"))
COLUMNS: dict[str, tuple[tuple[str, str], ...]] = {
    "fixed": (),
    "imu": (*ORIENTATION, *RATES),
    "pose": (*ORIENTATION, *RATES, *PLACE),
}


class Base:
    """A free joint whose motion is given.

    Orientation is a quaternion of the base in the world; rates and their derivatives are in the frame of the base, as a gyroscope has them;
    position, velocity and acceleration (without gravity) are in the world. The base is made so heavy that what moves on it does not move it.
    Without its acceleration, joints would be dragged along where a real leg lags: it can't be left out.

    Parameters
    ----------
    model : MjModel
        Changed: the base becomes heavy.
    how : {"fixed", "imu", "pose"} or None
        On a stand, as the file places it; orientation, rates and their derivatives from the logs; position, velocity and acceleration besides.
        None: the model has no free base.

    Raises
    ------
    ValueError
        A free joint and no word on how it moves, several of them, one below another joint, and a floor whose distance no log tells.
    """

    def __init__(self, model: Any, how: str | None) -> None:
        if how is not None and how not in COLUMNS:
            raise ValueError(f"base: expected 'fixed', 'imu' or 'pose', found {how!r}")
        free = [j for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE]
        #: Numbers of the joints that have a position of one number.
        self.joints = [j for j in range(model.njnt) if j not in free]
        #: Columns of the logs, with units.
        self.columns: tuple[tuple[str, str], ...] = COLUMNS[how] if how is not None and free else ()
        #: What the compiled part moves it by; None without a free base.
        self.plan: dict[str, Any] | None = None
        if not free:
            if how is not None:
                raise ValueError(f"base: the model has no free joint, so its base is fixed; leave base={how!r} out")
            return
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, free[0]) or f"joint_{free[0]}"
        if len(free) > 1:
            raise ValueError(f"the model has {len(free)} free joints; only one base can move freely, take the other bodies out")
        if how is None:
            raise ValueError(
                f"joint {name!r} is a free joint: say how the base moves, by base='fixed' (on a stand, as the file places it), 'imu' "
                "(orientation and rates are logged) or 'pose' (position, too); --base on the command line"
            )
        if how == "imu" and _may_touch_the_world(model):
            raise ValueError(
                "base='imu': the model has a floor or another fixed shape that the robot may touch, and orientation and rates do not say "
                "how far away it is; log its position, too (base='pose'), or take the fixed shapes out of the file"
            )
        position, velocity = int(model.jnt_qposadr[free[0]]), int(model.jnt_dofadr[free[0]])
        inertia = firm(model)
        self.plan = {
            "position": position,
            "velocity": velocity,
            "pose": [float(q) for q in model.qpos0[position : position + 7]],
            "inertia": inertia,
            "columns": len(self.columns),
        }
        model.dof_armature[velocity : velocity + 6] = inertia
        mujoco.mj_setConst(model, mujoco.MjData(model))


def firm(model: Any) -> float:
    """An inertia that nothing in the model moves, in its own units."""
    return FIRM * float(model.body_mass.sum() + model.body_inertia.sum())


def _may_touch_the_world(m: Any) -> bool:
    """Whether a shape that moves may touch one that is fixed."""
    fixed = [g for g in range(m.ngeom) if m.body_weldid[m.geom_bodyid[g]] == 0]
    moving = [g for g in range(m.ngeom) if m.body_weldid[m.geom_bodyid[g]] != 0]

    def meet(a: int, b: int) -> bool:
        return bool(m.geom_contype[a] & m.geom_conaffinity[b] or m.geom_contype[b] & m.geom_conaffinity[a])

    return any(meet(a, b) for a in fixed for b in moving)
