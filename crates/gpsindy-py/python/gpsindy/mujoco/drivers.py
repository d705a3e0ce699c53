"""Motor drivers around the engine: a PD loop that turns a wanted position into the torque of a ``motor``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gpsindy.data._tables import Array
from gpsindy.mujoco._engine import mujoco
from gpsindy.mujoco.settings import Setting


class Drivers:
    """PD loops around some of a model's motors.

    ``ctrl = kp (u - q) - kd dq/dt`` at every physics step, with the position q and speed of the motor's joint and the
    column u, the wanted position. The motor's own ``ctrlrange`` limits it.

    Parameters
    ----------
    model : MjModel
    actuators : sequence of str
        Names of all actuators.
    given : mapping of str to (float, float)
        Gains kp and kd of the drivers, by actuator.
    first : int
        How many numbers of the engine come before those of the drivers.

    Raises
    ------
    ValueError
        An unknown actuator, one that is no motor on a hinge or slide, a gain that is not finite or below 0.
    """

    def __init__(
        self, model: Any, actuators: Sequence[str], given: Mapping[str, tuple[float, float]], first: int
    ) -> None:
        self._places: list[tuple[int, int, int]] = []
        self._joints = int(model.njnt)
        self.settings: list[Setting] = []
        on_joint = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}
        for name, gains in given.items():
            if name not in actuators:
                raise ValueError(f"drivers: the model has no actuator {name!r}; found {', '.join(actuators)}")
            a = actuators.index(name)
            plain = model.actuator_biastype[a] == mujoco.mjtBias.mjBIAS_NONE and model.actuator_gaintype[a] == mujoco.mjtGain.mjGAIN_FIXED
            if not plain or int(model.actuator_trntype[a]) not in on_joint:
                raise ValueError(f"drivers: actuator {name!r} is no motor on a joint; a driver's loop goes around a <motor>")
            kp, kd = _gains(name, gains)
            self._places.append((a, int(model.actuator_trnid[a, 0]), first + len(self.settings)))
            self.settings.append(Setting(f"{name}.kp", kp, "", name, "kp", a, kp or 1.0, driver=True))
            self.settings.append(Setting(f"{name}.kd", kd, "", name, "kd", a, kd or 0.01 * kp or 1.0, driver=True))

    def commands(self, x: Array, u: Array, parameters: Array) -> Array:
        """What reaches the engine: ``u`` (n, n_actuators) with the columns of the motors in place of their wanted positions."""
        if not self._places:
            return u
        found = np.array(u)
        for a, joint, at in self._places:
            kp, kd = parameters[:, at], parameters[:, at + 1]
            found[:, a] = kp * (u[:, a] - x[:, joint]) - kd * x[:, self._joints + joint]
        return found


def _gains(name: str, gains: tuple[float, float]) -> tuple[float, float]:
    try:
        kp, kd = (float(gain) for gain in gains)
    except (TypeError, ValueError):
        raise ValueError(f"drivers: actuator {name!r}: expected its gains (kp, kd), found {gains!r}") from None
    if not (0.0 <= kp < float("inf") and 0.0 <= kd < float("inf")):
        raise ValueError(f"drivers: actuator {name!r}: gains must be finite and at least 0, found {gains!r}")
    return kp, kd
