"""MuJoCo models as simulators: MJCF, URDF or an ``MjModel``, stepped in batches on all cores.

Needs the package ``mujoco``, 4 or newer: ``pip install gpsindy[mujoco]``.
"""

from __future__ import annotations

import difflib
import os
import pathlib
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gpsindy import _gpsindy
from gpsindy.data._tables import unknown
from gpsindy.data.dataset import Path
from gpsindy.following import mjcf
from gpsindy.model import Model
from gpsindy.mujoco._engine import mujoco
from gpsindy.mujoco.base import Base
from gpsindy.mujoco.copies import copies, refuse_callbacks
from gpsindy.mujoco.corrections import Corrections
from gpsindy.mujoco.drivers import Driver, Drivers
from gpsindy.mujoco.loading import load
from gpsindy.mujoco.locks import Locks
from gpsindy.mujoco.settings import AXES, OF_AN_ACTUATOR, Setting, is_servo, joint_of, name_of, settings_of
from gpsindy.stepper import stepping_model

__all__ = ["Driver", "Setting", "Simulator"]

_Part = tuple[str, str, list[str], list[str], list[str], list[str]]


class Simulator:
    """A MuJoCo model in place of equations.

    States are position and velocity of every hinge and slide joint and then the activations of the actuators that have one,
    controls the actuators, ports the generalised forces of the joints. Rollouts are MuJoCo's own steps, contacts and limits
    included; the log's period is walked in the model's ``timestep``, and where it is no whole number of steps the last one is
    shortened. The engine's warm start is off, and a command that the model lets act late waits outside of the engine, so that
    a step depends on the state alone: the parameter ``ACTUATOR.delay``, in s, acts in whole steps, and before a log begins
    its first command is held.

    Parameters
    ----------
    model : path, str or MjModel
        MJCF or URDF file, XML text, or a compiled model.
    joints : mapping of str to str or (str, str), optional
        Columns of a joint's position and velocity in the logs. Default: the joint's own name, and that with ``_vel``. The
        velocity's column may be missing.
    actuators : mapping of str to str, optional
        Columns of the commands. Default: the actuator's own name, with ``_ctrl`` where a joint has it too.
    sensors : mapping of str to str, optional
        What a column reads, as an expression of the states, where it is not the state itself: ``{"hip": "hip + 0.1"}``.
    drivers : mapping of str to Driver or (float, float), optional
        Motors that the machine's driver moves to a position: its PD loop, or the gains kp and kd of it, by actuator. ``*`` in a name stands
        for any characters: ``{"*": (40.0, 1.0)}``. The column of such an actuator is the wanted position, and the torque is
        ``kp (u - q) - kd dq/dt``, anew at every physics step. Gains and delay are parameters, ``ACTUATOR.kp``, ``ACTUATOR.kd`` and
        ``ACTUATOR.delay``.
    base : {"fixed", "imu", "pose"}, optional
        How a free base moves: not at all (on a stand, as the file places it), as the columns ``base_qw``, ``qx``, ``qy``, ``qz``
        (quaternion), ``base_wx``, ``wy``, ``wz`` (gyroscope) and ``base_dwx``, ``dwy``, ``dwz`` (its derivative) say, or as these and
        ``base_x``, ``base_vx``, ``base_ax`` and so on (position, velocity, acceleration in the world) say. What moves on the base does not
        move it; contacts are the engine's.
    locked : str, iterable of str, or mapping of str to float or None, optional
        Joints that do not move while others are tested, where ``*`` in a name stands for any characters, and the position at which each is
        held; without one, where the file places it. Neither they nor their actuators need a column.
    threads : int
        Threads of the engine; 0: all cores.

    Raises
    ------
    ValueError
        A ball joint, a free joint without ``base``, an actuator that interpolates a late command, a name that the model lacks, and a
        callback of the engine that is a Python function.

    Examples
    --------
    >>> import gpsindy.mujoco  # doctest: +SKIP
    >>> arm = gpsindy.mujoco.Simulator("arm.xml")  # doctest: +SKIP
    >>> gpsindy.diagnose(arm, ["run_1.csv", "run_2.csv"]).save("report")  # doctest: +SKIP
    """

    def __init__(
        self,
        model: Any,
        joints: Mapping[str, str | tuple[str, str]] | None = None,
        actuators: Mapping[str, str] | None = None,
        sensors: Mapping[str, str] | None = None,
        *,
        drivers: Mapping[str, Driver | tuple[float, ...]] | None = None,
        base: str | None = None,
        locked: str | Iterable[str] | Mapping[str, float | None] = (),
        threads: int = 0,
    ) -> None:
        refuse_callbacks()
        loaded = load(model)
        self._mj, self._text, self._source, self._late = loaded.model, loaded.text, loaded.source, loaded.late
        self._mj.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_WARMSTART | mujoco.mjtDisableBit.mjDSBL_AUTORESET
        self._base = Base(self._mj, base)
        self._locks = Locks(self._mj, self._base.joints, locked)
        self._ids = self._locks.joints
        self._joints = [name_of(self._mj, mujoco.mjtObj.mjOBJ_JOINT, j) for j in self._ids]
        self._actuators = [name_of(self._mj, mujoco.mjtObj.mjOBJ_ACTUATOR, a) for a in range(self._mj.nu)]
        self._positions, self._velocities = self._columns(joints or {})
        self._commands = self._command_columns(actuators or {})
        self._activations = self._activation_columns()
        #: Numbers of the actuators whose commands are columns.
        self._driven = [a for a in range(self._mj.nu) if a not in self._locks.actuators]
        self._settings = self._free(settings_of(self._mj, dict(zip(self._ids, self._joints)), self._actuators))
        self._drivers = Drivers(self._mj, self._actuators, self._ids, drivers or {}, len(self._settings), self._locks.actuators)
        self._settings += self._drivers.settings
        for a, driver in self._drivers.around.items():
            if self._late[a] > 0.0:
                raise ValueError(f"actuator {self._actuators[a]!r} has a delay in the file and a driver; give the delay to the driver")
            self._late[a] = driver.delay
        self._period = float(self._mj.opt.timestep)
        #: Force, inertia and unit by the column of a joint's velocity.
        self._inertia = self._inertias()
        driving = {a: joint for a in range(self._mj.nu) if (joint := joint_of(self._mj, a)) is not None}
        place = {j: joint for j, joint in zip(self._ids, self._joints)}
        on = {a: place.get(joint) for a, joint in driving.items()}
        self._drives = {self._actuators[a]: joint for a, joint in on.items() if joint is not None}
        self._acting = dict(zip(self._commands, self._actuators))
        self._gears = {self._actuators[a]: float(self._mj.actuator_gear[a, 0]) for a in driving}
        self._copies = copies(self._mj, self._settings, self._drivers, (self._base, self._locks), self._driven, threads)
        self._model = self._made(dict(sensors or {}))
        inputs = self._model._inner.simulator_inputs()
        self._nominal = {name: expression for kind, name, expression, _ in inputs if kind == "command"}

    @property
    def model(self) -> Model:
        """The simulator as a model: names, rollouts, scores."""
        return self._model

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Numbers of the engine's model that the logs may correct."""
        return tuple(self._settings)

    def _as_model(self) -> Model:
        return self._model

    def _save_corrected(self, model: Model, path: Path) -> None:
        self.save(model, path)

    def _columns(self, given: Mapping[str, str | tuple[str, str]]) -> tuple[list[str], list[str]]:
        _known("joints", given, self._joints)
        positions, velocities = [], []
        for joint in self._joints:
            columns = given.get(joint, _plain(joint))
            position, velocity = (columns, f"{columns}_vel") if isinstance(columns, str) else columns
            positions.append(position)
            velocities.append(velocity)
        return positions, velocities

    def _command_columns(self, given: Mapping[str, str]) -> list[str]:
        _known("actuators", given, self._actuators)
        taken = {*self._positions, *self._velocities}
        columns = []
        for actuator in self._actuators:
            own = _plain(actuator)
            columns.append(given.get(actuator, f"{own}_ctrl" if own in taken else own))
        return columns

    def _activation_columns(self) -> list[str]:
        """One name an activation; no log need have such a column."""
        columns = []
        for a, actuator in enumerate(self._actuators):
            count = int(self._mj.actuator_actnum[a])
            columns += [f"{_plain(actuator)}_act" + (f"_{i}" if count > 1 else "") for i in range(count)]
        return columns

    def _parts(self) -> list[_Part]:
        """Joints, with the actuators that drive them and the mass of their own bodies, and actuators: kind, name, and what of the model
        belongs to each, as names of states, controls, ports and parameters."""
        late = {f"{name}.delay" for name, seconds in zip(self._actuators, self._late) if seconds > 0.0}
        of = {name: [s.name for s in self._settings if s.element == name] for name in {s.element for s in self._settings}}
        # Elements of different kinds may have one name.
        gains = {*OF_AN_ACTUATOR, "kd"}
        actuators: list[_Part] = []
        for a in self._driven:
            actuator = self._actuators[a]
            acts = int(self._mj.actuator_actadr[a])
            own = self._activations[acts : acts + int(self._mj.actuator_actnum[a])] if acts >= 0 else []
            numbers = [name for name in of.get(actuator, []) if name.rpartition(".")[2] in gains]
            numbers += [name for name in [f"{actuator}.delay"] if name in late]
            actuators.append(("actuator", actuator, own, [self._commands[a]], [], numbers))
        joints: list[_Part] = []
        ports = {port.variable: port.name for port in self._model.ports}
        for j, (number, joint) in enumerate(zip(self._ids, self._joints)):
            body = int(self._mj.jnt_bodyid[number])
            drives = [part for part in actuators if self._drives.get(part[1]) == joint]
            own = [name for name in of.get(joint, []) if name.rpartition(".")[2] not in gains | {"mass"}]
            masses = [s.name for s in self._settings if s.attribute == "mass" and self._moved_by(s.index) == body]
            velocity = self._velocities[j]
            joints.append(
                (
                    "joint",
                    joint,
                    [self._positions[j], velocity, *(state for part in drives for state in part[2])],
                    [command for part in drives for command in part[3]],
                    [ports[velocity]] if velocity in ports else [],
                    [*own, *(name for part in drives for name in part[5]), *masses],
                )
            )
        return joints + actuators

    def _moved_by(self, body: int) -> int:
        """The nearest body above, or itself, that has a joint which is a state; the world's where there is none."""
        moving = {int(self._mj.jnt_bodyid[j]) for j in self._ids}
        while body and body not in moving:
            body = int(self._mj.body_parentid[body])
        return body

    def _free(self, settings: Sequence[Setting]) -> list[Setting]:
        """Numbers that matter where some joints are locked: neither gains of their actuators nor masses that nothing else moves."""
        places = self._locks.places
        gains = [s.attribute in OF_AN_ACTUATOR and s.index in self._locks.actuators for s in settings]
        still = [bool(places) and s.attribute == "mass" and self._moved_by(s.index) == 0 for s in settings]
        # Which way is down is in the logs of a base whose orientation is logged.
        logged = [s.attribute in AXES and bool(self._base.columns) for s in settings]
        return [s for s, *known in zip(settings, gains, still, logged) if not any(known)]

    def _inertias(self) -> dict[str, tuple[str, float, str]]:
        masses = {setting.element: setting.scale or 0.0 for setting in self._settings if setting.attribute == "armature"}
        found = {}
        for j, joint, velocity in zip(self._ids, self._joints, self._velocities):
            hinge = self._mj.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE
            found[velocity] = (joint, masses[joint], "N m" if hinge else "N")
        return found

    def _unit_of_command(self, actuator: int) -> str:
        """That of the joint for the target of a servo or of a driver's loop; none for other commands, and behind a gear."""
        is_target = is_servo(self._mj, actuator) or actuator in self._drivers.around
        if not is_target or self._actuators[actuator] not in self._drives or abs(self._mj.actuator_gear[actuator, 0]) != 1.0:
            return ""
        is_hinge = self._mj.jnt_type[self._mj.actuator_trnid[actuator, 0]] == mujoco.mjtJoint.mjJNT_HINGE
        return "rad" if is_hinge else "m"

    def _made(self, sensors: dict[str, str]) -> Model:
        m = self._mj
        step = float(m.opt.timestep)
        hinges = [m.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE for j in self._ids]
        units = ["rad" if hinge else "m" for hinge in hinges]
        ports = []
        taken = {*self._positions, *self._velocities, *self._activations, *self._commands}
        known = {setting.name for setting in self._settings}
        #: Numbers of the engine that carry an effect, by the effect and its port.
        self._carried: dict[tuple[str, str], str] = {}
        for joint, position, velocity, hinge in zip(self._joints, self._positions, self._velocities, hinges):
            carried = [
                ("coulomb_friction", f"{joint}.frictionloss"),
                ("viscous_friction", f"{joint}.damping"),
                ("linear_stiffness", f"{joint}.stiffness"),
                ("inertia", f"{joint}.armature"),
            ]
            carried = [(effect, name) for effect, name in carried if name in known]
            port = f"{position}_torque" if hinge else f"{position}_force"
            # An actuator may have that name.
            port = port if port not in taken else f"{position}_joint_{'torque' if hinge else 'force'}"
            # An inertia is reported as a share of the row's own.
            self._carried.update({(effect, port): name for effect, name in carried if effect != "inertia"})
            ports.append((port, velocity, "N m" if hinge else "N", position, carried))
        top = (0.0, float("inf"))
        start = [float(m.qpos0[m.jnt_qposadr[j]]) for j in self._ids]
        return stepping_model(
            self._copies.step,
            _plain(self._source.stem) if self._source else "mujoco",
            step,
            states=[
                *zip(self._positions, units),
                *((v, f"{unit}/s") for v, unit in zip(self._velocities, units)),
                *((column, "") for column in self._activations),
            ],
            controls=[*((self._commands[a], self._unit_of_command(a)) for a in self._driven), *self._base.columns],
            kinematic=list(zip(self._positions, self._velocities)),
            ports=ports,
            parameters=[(s.name, s.value, s.unit, s.tolerance, top, s.scale) for s in self._settings],
            delays=[
                (self._commands[a], f"{self._actuators[a]}.delay", self._late[a], step, self._drivers.tolerance(a, "delay"))
                for a in self._driven
                if self._late[a] > 0.0
            ],
            initial=[*zip(self._positions, start), *((name, 0.0) for name in [*self._velocities, *self._activations])],
            measured=list(sensors.items()),
            source=self,
            several=True,
            copies=self._copies,
        )

    def corrected(self, model: Model) -> str:
        """The MJCF text with the corrections of an augmented model in it.

        Numbers of joints, actuators and bodies are set in place, a delay of a command in whole physics steps. The
        text is compiled, and what its model has otherwise, like what MJCF cannot express, is in a comment at the top.

        Raises
        ------
        ValueError
            The simulator was made from a compiled model, so there is no MJCF text.
        """
        if self._text is None:
            raise ValueError("there is no MJCF text to correct; make the simulator from an MJCF file or text")
        home = None if self._source is None else self._source.parent
        said = Corrections(self._text, home, self._mj, self._settings, self._base.joints)
        values: dict[str, float] = {}
        for kind, name, expression, value in model._inner.simulator_inputs():
            if kind == "parameter" and value is None:
                said.missing.append(f"{name} is {expression}")
            elif kind == "parameter" and value is not None:
                values[name] = value
            elif kind == "force" and expression != "0":
                said.missing.append(f"a force acts at {name}: {expression}")
            elif kind == "command" and name in self._commands:
                a = self._commands.index(name)
                if a in self._drivers.around and expression != name:
                    said.missing.append(f"the wanted position {name}, of the driver, becomes {expression}")
                elif expression != self._nominal[name]:
                    said.command(name, self._actuators[a], a, expression)
        said.numbers(values)
        own = len(self._model.states)
        for (name, _, _, measured), nominal in zip(model._inner.states[:own], self._model.states):
            if measured is not None and measured != nominal.measured:
                said.missing.append(f"the column {name} reads {measured}")
        for name, _, equation, _ in model._inner.states[own:]:
            said.missing.append(f"{name} is a state of its own: {name}' = {equation}")
        title = self._source.name if self._source else "the model"
        return said.commented(f"gpsindy: {title} as a diagnosis corrected it")

    def _corrected_file(self, inner: Any, folder: Path) -> tuple[str, str, list[str]]:
        """Name, text and changed lines of the corrected file, for ``folder``."""
        text = self.corrected(Model._of(inner, self))
        lines = difflib.unified_diff((self._text or "").splitlines(), text.splitlines(), "nominal", "corrected", "", "", 1, "")
        difference = list(lines)
        if self._source is not None:
            text = mjcf.moved(text, self._source.parent, pathlib.Path(os.fspath(folder)))
        return ("augmented.xml", text, difference)

    def save(self, model: Model, path: Path) -> None:
        """Writes :meth:`corrected`; whole or not at all. In another folder it names meshes and included files from there."""
        file = pathlib.Path(os.fspath(path))
        _gpsindy.write_whole(os.fspath(path), self._corrected_file(model._inner, file.parent)[1])

    def __repr__(self) -> str:
        return f"gpsindy.mujoco.Simulator of {', '.join(self._joints)}"

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError("a MuJoCo simulator can't be pickled; make it anew from its file")


def _plain(name: str) -> str:
    """A name as expressions take it."""
    found = re.sub(r"\W", "_", name)
    return found if found[:1].isalpha() or found[:1] == "_" else f"_{found}"


def _known(what: str, given: Mapping[str, Any], known: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            raise unknown(f"{what}: the model has no", name, known)
