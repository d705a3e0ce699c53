"""Reads a MuJoCo model, and refuses what has no number in a log."""

from __future__ import annotations

import copy
import math
import os
import pathlib
import re
from dataclasses import dataclass
from typing import Any

from gpsindy.mujoco._engine import mujoco
from gpsindy.mujoco.settings import name_of

#: Share of a time step that rounding may make of a delay.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Loaded:
    """A compiled model and where it came from.

    Attributes
    ----------
    model : MjModel
        A copy of its own, in which no command waits in the engine.
    text : str or None
        Its MJCF text, where it came from a file or text.
    source : path or None
        Its file.
    late : list of float
        How late each actuator's command acts, s, in whole steps.
    """

    model: Any
    text: str | None
    source: pathlib.Path | None
    late: list[float]


def load(model: Any) -> Loaded:
    """From a path, XML text or an ``MjModel``.

    Raises
    ------
    ValueError, FileNotFoundError
        No such file, XML that MuJoCo refuses, or what the logs can't carry.
    """
    text, source = None, None
    if isinstance(model, mujoco.MjModel):
        found = copy.copy(model)
    elif isinstance(model, str) and model.lstrip().startswith("<"):
        text, found = model, mujoco.MjModel.from_xml_string(model)
    else:
        source = pathlib.Path(os.fspath(model))
        if not source.exists():
            raise FileNotFoundError(f"{source}: no such file; hand in an MJCF or URDF file, XML text or an MjModel")
        text = source.read_text(encoding="utf-8")
        found = mujoco.MjModel.from_xml_path(os.fspath(source))
        if re.search(r"<\s*robot[\s>]", text):
            # URDF has no place for most corrections: what is corrected is MuJoCo's own rendering of it.
            text = _as_mjcf(source)
    _check(found)
    return Loaded(found, text, source, _taken_delays(found))


def _check(m: Any) -> None:
    for j in range(m.njnt):
        if m.jnt_type[j] == mujoco.mjtJoint.mjJNT_BALL:
            name = name_of(m, mujoco.mjtObj.mjOBJ_JOINT, j)
            raise ValueError(
                f"joint {name!r} is a ball joint, which has no position of one number; weld the body or "
                "replace the joint by hinges and slides"
            )
    if m.njnt == 0:
        raise ValueError("the model has no joint, so nothing moves")


def _taken_delays(m: Any) -> list[float]:
    """Takes the delays of commands out of a compiled model: the engine keeps them in a buffer that is no part of its state, so a
    copy that is put to another state would go on with the commands of the former."""
    step = float(m.opt.timestep)
    late = []
    for a in range(m.nu):
        samples, interpolation = (int(v) for v in m.actuator_history[a])
        if m.actuator_delay[a] > 0.0 and interpolation != 0:
            name = name_of(m, mujoco.mjtObj.mjOBJ_ACTUATOR, a)
            raise ValueError(f"actuator {name!r} interpolates its late command; write interp=\"zoh\"")
        # The newest command that is at least so old, and at most the oldest that is kept.
        late.append(step * min(math.ceil(float(m.actuator_delay[a]) / step - _ROUNDING), samples))
    if m.nu:
        m.actuator_delay[:] = 0.0
        m.actuator_history[:] = 0
    return late


def _as_mjcf(path: pathlib.Path) -> str:
    """A URDF file in MuJoCo's own language."""
    spec = mujoco.MjSpec.from_file(os.fspath(path))
    spec.compile()
    return str(spec.to_xml())
