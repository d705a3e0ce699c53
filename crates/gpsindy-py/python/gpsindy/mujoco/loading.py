"""Reads a MuJoCo model, and refuses what has no number in a log."""

from __future__ import annotations

import copy
import os
import pathlib
import re
from dataclasses import dataclass
from typing import Any

from gpsindy.mujoco._engine import mujoco
from gpsindy.mujoco.settings import name_of

@dataclass(frozen=True)
class Loaded:
    """A compiled model and where it came from.

    Attributes
    ----------
    model : MjModel
        A copy of its own.
    text : str or None
        Its MJCF text, where it came from a file or text.
    source : path or None
        Its file.
    """

    model: Any
    text: str | None
    source: pathlib.Path | None


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
    return Loaded(found, text, source)


def _check(m: Any) -> None:
    kinds = {int(mujoco.mjtJoint.mjJNT_FREE): "free", int(mujoco.mjtJoint.mjJNT_BALL): "ball"}
    for j in range(m.njnt):
        kind = kinds.get(int(m.jnt_type[j]))
        if kind is not None:
            name = name_of(m, mujoco.mjtObj.mjOBJ_JOINT, j)
            raise ValueError(
                f"joint {name!r} is a {kind} joint, which has no position of one number; weld the body or "
                "replace the joint by hinges and slides"
            )
    if m.njnt == 0:
        raise ValueError("the model has no joint, so nothing moves")
    for a in range(m.nu):
        if m.actuator_delay[a] > 0.0:
            name = name_of(m, mujoco.mjtObj.mjOBJ_ACTUATOR, a)
            raise ValueError(
                f"actuator {name!r} has a delay, which the engine keeps in a buffer that is no part of its state; take it out and "
                "let the diagnosis find it"
            )


def _as_mjcf(path: pathlib.Path) -> str:
    """A URDF file in MuJoCo's own language."""
    spec = mujoco.MjSpec.from_file(os.fspath(path))
    spec.compile()
    return str(spec.to_xml())
