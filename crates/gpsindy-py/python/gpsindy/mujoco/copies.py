"""Copies of one MuJoCo model that are stepped together: what of the model is a state and a parameter; the compiled part steps them."""

from __future__ import annotations

import ctypes
import operator
import pathlib
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from gpsindy._gpsindy import MujocoCopies
from gpsindy.mujoco._engine import batch, mujoco
from gpsindy.mujoco.base import Base
from gpsindy.mujoco.drivers import Drivers
from gpsindy.mujoco.locks import Locks
from gpsindy.mujoco.settings import AXES, LIMITS, OF_A_DOF, Setting

#: Components of a state, in the order in which the compiled part takes them.
COMPONENTS = ("TIME", "QPOS", "QVEL", "ACT", "CTRL", "QFRC_APPLIED")

#: Functions of the user's own that the engine calls.
CALLBACKS = ("passive", "control", "contactfilter", "sensor", "act_dyn", "act_gain", "act_bias")


def copies(
    model: Any, settings: Sequence[Setting], drivers: Drivers, given: tuple[Base, Locks], driven: Sequence[int], threads: int
) -> MujocoCopies:
    """Copies of a model, each with parameters of its own, made when they are asked for. Base and locks say what moves as given; the commands of
    the actuators in ``driven`` are handed in, the others' are 0.

    Raises
    ------
    ValueError
        A library whose numbers are of single precision.
    """
    if np.dtype(mujoco.MJTNUM_DTYPE) != np.float64:
        raise ValueError("MuJoCo was built with single precision, and derivatives need double")
    base, locks = given
    plan = {
        "components": [int(getattr(mujoco.mjtState, f"mjSTATE_{name}")) for name in COMPONENTS],
        "positions": [int(model.jnt_qposadr[j]) for j in locks.joints],
        "velocities": [int(model.jnt_dofadr[j]) for j in locks.joints],
        "activations": int(model.na),
        "commands": list(driven),
        "settings": [
            {"value": s.value, "writes": _writes(model, s), "moves_constants": s.attribute in ("armature", "mass")} for s in settings
        ],
        "drivers": [{"actuator": a, "command": driven.index(a), "joint": joint, "gain": gain} for a, joint, gain in drivers.places],
        "base": base.plan,
        "locks": [{"position": position, "velocity": velocity, "at": at} for position, velocity, at in locks.places],
        "warnings": int(mujoco.mjtWarning.mjNWARNING),
        "timestep": float(model.opt.timestep),
    }
    return MujocoCopies(model, model._address, _library(), plan, threads)


def refuse_callbacks() -> None:
    """Raises a ``ValueError`` where the engine would call a function of Python's, which several threads can't."""
    for name in CALLBACKS:
        if callable(getattr(mujoco, f"get_mjcb_{name}")()):
            raise ValueError(f"mjcb_{name} is a Python function, which the engine can't call from several threads; take it out")


def _writes(model: Any, setting: Setting) -> list[dict[str, Any]]:
    """Where a number of the model is written, and what it is at a value of the parameter, to which it is in proportion."""
    if setting.driver:
        return []

    def write(field: str, column: int = 0, at: float = 1.0, value: float = 1.0) -> dict[str, Any]:
        array = operator.attrgetter(field)(model)
        index = int(model.jnt_dofadr[setting.index]) if field.startswith("dof_") else setting.index
        # A field may be a polynomial, the leading coefficient first.
        return {"field": field, "place": index * (array.size // len(array)) + column, "at": at, "value": value}

    if setting.attribute in OF_A_DOF:
        return [write(f"dof_{setting.attribute}")]
    if setting.attribute == "stiffness":
        return [write("jnt_stiffness")]
    if setting.attribute == "mass":
        mass, inertia = float(model.body_mass[setting.index]), model.body_inertia[setting.index]
        return [write("body_mass"), *(write("body_inertia", k, mass, float(inertia[k])) for k in range(3))]
    if setting.attribute in LIMITS:
        field = LIMITS[setting.attribute]
        return [write(field, 0, value=-1.0), write(field, 1)]
    if setting.attribute in AXES:
        return [write("opt.gravity")]
    gain = [write("actuator_gainprm")] if setting.scale is None else []
    return [*gain, write("actuator_biasprm", 1 if setting.attribute == "kp" else 2, value=-1.0)]


def _library() -> Any:
    """The engine's own library, by an extension module that is linked to it; Windows looks into the library alone.

    The package's clock is taken out: the engine reads it several times a step for a profile, ``MjData.timer``, which is half of a small
    model's time. ``mujoco.set_mjcb_time(None)`` puts it back. Its log is turned off: trial parameters with which a solver does not converge
    are part of a search, and would print a line at every step and leave a file. The fields ``logto_console`` and ``logto_file`` of
    ``mujoco.MjLogConfig.get()`` turn it on again.
    """
    windows = sys.platform == "win32"
    library = ctypes.CDLL(str(pathlib.Path(mujoco.__file__).with_name("mujoco.dll")) if windows else batch._batch.__file__)
    if mujoco.get_mjcb_time() is None:
        ctypes.c_void_p.in_dll(library, "mjcb_time").value = None
    log = mujoco.MjLogConfig.get()
    log.logto_console = log.logto_file = False
    log.set()
    return library
