"""The package ``mujoco``, or an error that says how to get it."""

from __future__ import annotations

try:
    import mujoco
    from mujoco import batch
except ImportError as missing:
    raise ImportError("gpsindy.mujoco needs the package mujoco, 4 or newer: pip install 'gpsindy[mujoco]'") from missing

__all__ = ["batch", "mujoco"]
