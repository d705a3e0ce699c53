"""Motor drivers around the engine: a PD loop that turns a wanted position into the torque of a ``motor``."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gpsindy.mujoco._engine import mujoco
from gpsindy.mujoco.settings import Setting, by_name, joint_of

#: Standard deviation of a gain or delay that is a guess, as a share of it.
GUESSED = 0.5


@dataclass(frozen=True)
class Driver:
    """The PD loop of a motor's driver: ``kp (u - q) - kd dq/dt``, on a wanted position u that arrives late.

    Attributes
    ----------
    kp, kd : float
        Gains, in N m/rad and N m s/rad (N/m and N s/m of a slide).
    delay : float, default 0
        How late the wanted position acts, s, in whole physics steps.
    find : sequence of str, optional
        What of ``kp``, ``kd`` and ``delay`` is a guess: every fit corrects it by up to about its own size. The other numbers are exact, yet
        suspects like every parameter.
    """

    kp: float
    kd: float
    delay: float = 0.0
    find: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("kp", "kd", "delay"):
            try:
                value = float(getattr(self, name))
            except (TypeError, ValueError):
                raise ValueError(f"driver: {name} must be a number, found {getattr(self, name)!r}") from None
            if not 0.0 <= value < float("inf"):
                raise ValueError(f"driver: {name} must be finite and at least 0, found {value!r}")
            object.__setattr__(self, name, value)
        object.__setattr__(self, "find", tuple(self.find))
        for name in self.find:
            if name not in ("kp", "kd", "delay"):
                raise ValueError(f"driver: find: expected names among kp, kd and delay, found {name!r}")
            if getattr(self, name) == 0.0:
                raise ValueError(f"driver: {name} = 0 is no guess that a fit can scale; give its likely size")

    def tolerance(self, name: str) -> float | None:
        """Relative standard deviation of a guess."""
        return GUESSED if name in self.find else None


class Drivers:
    """PD loops around some of a model's motors.

    ``ctrl = kp (u - q) - kd dq/dt`` at every physics step, with the position q and speed of the motor's joint and the
    column u, the wanted position. The motor's own ``ctrlrange`` limits it.

    Parameters
    ----------
    model : MjModel
    actuators : sequence of str
        Names of all actuators.
    joints : sequence of int
        Numbers of the joints that are states, in their order.
    given : mapping of str to Driver or (float, float) or (float, float, float)
        Drivers, or gains kp and kd and a delay, by actuator; ``*`` and ``?`` in a name stand for any characters and any one.
    first : int
        How many numbers of the engine come before those of the drivers.
    locked : collection of int
        Numbers of actuators whose joints are locked, so that they need no driver.

    Raises
    ------
    ValueError
        An unknown actuator, one that is no motor on a hinge or slide, a number that is not finite or below 0.
    """

    def __init__(
        self, model: Any, actuators: Sequence[str], joints: Sequence[int], given: Mapping[str, Any], first: int, locked: Collection[int] = ()
    ) -> None:
        #: Actuator, joint among the states, and kp among all numbers; kd comes after it.
        self.places: list[tuple[int, int, int]] = []
        self.settings: list[Setting] = []
        #: By number of the actuator.
        self.around: dict[int, Driver] = {}
        drivers = {pattern: _driver(pattern, driver) for pattern, driver in given.items()}
        for name, driver in by_name(drivers, actuators, "drivers: the model has no actuator").items():
            a = actuators.index(name)
            if a in locked:
                continue
            plain = model.actuator_biastype[a] == mujoco.mjtBias.mjBIAS_NONE and model.actuator_gaintype[a] == mujoco.mjtGain.mjGAIN_FIXED
            joint = joint_of(model, a)
            if not plain or joint is None or joint not in joints:
                raise ValueError(f"drivers: actuator {name!r} is no motor on a joint; a driver's loop goes around a <motor>")
            self.around[a] = driver
            self.places.append((a, joints.index(joint), first + len(self.settings)))
            for gain, value, scale in (("kp", driver.kp, driver.kp or 1.0), ("kd", driver.kd, driver.kd or 0.01 * driver.kp or 1.0)):
                self.settings.append(
                    Setting(f"{name}.{gain}", value, "", name, gain, a, scale, driver=True, tolerance=driver.tolerance(gain))
                )

    def tolerance(self, actuator: int, name: str) -> float | None:
        """Of a number of the driver around an actuator."""
        return self.around[actuator].tolerance(name) if actuator in self.around else None


def _driver(name: str, given: Any) -> Driver:
    if isinstance(given, Driver):
        return given
    try:
        numbers = tuple(given)
    except TypeError:
        numbers = ()
    if len(numbers) not in (2, 3):
        raise ValueError(f"drivers: actuator {name!r}: expected its gains (kp, kd) or (kp, kd, delay), found {given!r}")
    try:
        return Driver(*numbers)
    except ValueError as error:
        raise ValueError(f"drivers: actuator {name!r}: {error}") from None
