"""MuJoCo models as simulators: MJCF, URDF or an ``MjModel``, stepped in batches on all cores.

Needs the package ``mujoco``, 4 or newer: ``pip install gpsindy[mujoco]``.
"""

from __future__ import annotations

import copy
import difflib
import os
import pathlib
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gpsindy import _gpsindy, mjcf
from gpsindy._tables import Array
from gpsindy.dataset import Path
from gpsindy.model import Model
from gpsindy.mujoco._engine import mujoco
from gpsindy.mujoco.copies import WORTH_THREADS, Copies, seconds_a_step
from gpsindy.mujoco.settings import Setting, name_of, settings_of
from gpsindy.stepper import stepping_model

__all__ = ["Setting", "Simulator"]

class Simulator:
    """A MuJoCo model in place of equations.

    States are position and velocity of every hinge and slide joint, controls the actuators, ports the generalised forces
    of the joints. Rollouts are MuJoCo's own steps, contacts and limits included; the log's period is walked in the model's
    ``timestep``, and where it is no whole number of steps the last one is shortened. The engine's warm start is off, so
    that a step depends on the state alone.

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
    threads : int
        Threads of the engine; 0: all cores.

    Raises
    ------
    ValueError
        A free or ball joint, an actuator with an activation of its own, a name that the model lacks.

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
        threads: int = 0,
    ) -> None:
        self._source: pathlib.Path | None = None
        self._text: str | None = None
        self._mj = self._load(model)
        self._check()
        self._mj.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_WARMSTART | mujoco.mjtDisableBit.mjDSBL_AUTORESET
        self._threads = threads
        self._batches: dict[int, Copies] = {}
        self._cost = seconds_a_step(self._mj)
        self._joints = [name_of(self._mj, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(self._mj.njnt)]
        self._actuators = [name_of(self._mj, mujoco.mjtObj.mjOBJ_ACTUATOR, a) for a in range(self._mj.nu)]
        self._positions, self._velocities = self._columns(joints or {})
        self._commands = self._command_columns(actuators or {})
        self._settings = settings_of(self._mj, self._joints, self._actuators)
        self._period = float(self._mj.opt.timestep)
        #: Force, inertia and unit by the column of a joint's velocity.
        self._inertia = self._inertias()
        on_joint = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}
        driving = [a for a in range(self._mj.nu) if int(self._mj.actuator_trntype[a]) in on_joint]
        self._drives = {self._actuators[a]: self._joints[self._mj.actuator_trnid[a, 0]] for a in driving}
        self._acting = dict(zip(self._commands, self._actuators))
        self._gears = {self._actuators[a]: float(self._mj.actuator_gear[a, 0]) for a in driving}
        self._model = self._made(dict(sensors or {}))

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

    def _load(self, model: Any) -> Any:
        if isinstance(model, mujoco.MjModel):
            return copy.copy(model)
        if isinstance(model, str) and model.lstrip().startswith("<"):
            self._text = model
            return mujoco.MjModel.from_xml_string(model)
        path = pathlib.Path(os.fspath(model))
        if not path.exists():
            raise FileNotFoundError(f"{path}: no such file; hand in an MJCF or URDF file, XML text or an MjModel")
        self._source = path
        self._text = path.read_text(encoding="utf-8")
        compiled = mujoco.MjModel.from_xml_path(os.fspath(path))
        if re.search(r"<\s*robot[\s>]", self._text):
            # URDF has no place for most corrections: what is corrected is MuJoCo's own rendering of it.
            self._text = _as_mjcf(path)
        return compiled

    def _check(self) -> None:
        m = self._mj
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
            if m.actuator_actnum[a] > 0:
                name = name_of(m, mujoco.mjtObj.mjOBJ_ACTUATOR, a)
                raise ValueError(
                    f"actuator {name!r} has an activation, a state that no log carries; give it dyntype=\"none\" and let the "
                    "diagnosis find the lag"
                )

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

    def _inertias(self) -> dict[str, tuple[str, float, str]]:
        masses = {setting.element: setting.scale or 0.0 for setting in self._settings if setting.attribute == "armature"}
        found = {}
        for j, joint in enumerate(self._joints):
            hinge = self._mj.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE
            found[self._velocities[j]] = (joint, masses[joint], "N m" if hinge else "N")
        return found

    def _made(self, sensors: dict[str, str]) -> Model:
        m = self._mj
        hinges = [m.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE for j in range(m.njnt)]
        units = ["rad" if hinge else "m" for hinge in hinges]
        ports = []
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
            # An inertia is told as a share of the row's own.
            self._carried.update({(effect, port): name for effect, name in carried if effect != "inertia"})
            ports.append((port, velocity, "N m" if hinge else "N", position, carried))
        top = (0.0, float("inf"))
        start = [float(m.qpos0[m.jnt_qposadr[j]]) for j in range(m.njnt)]
        return stepping_model(
            self._step,
            _plain(self._source.stem) if self._source else "mujoco",
            float(m.opt.timestep),
            states=[*zip(self._positions, units), *((v, f"{unit}/s") for v, unit in zip(self._velocities, units))],
            controls=[(name, "") for name in self._commands],
            kinematic=list(zip(self._positions, self._velocities)),
            ports=ports,
            parameters=[(s.name, s.value, s.unit, None, top, s.scale) for s in self._settings],
            initial=[*zip(self._positions, start), *((v, 0.0) for v in self._velocities)],
            measured=list(sensors.items()),
            source=self,
        )

    def _step(self, x: Array, u: Array, force: Array, parameters: Array, dt: float) -> Array:
        size = max(16, 1 << (len(x) - 1).bit_length())
        if size not in self._batches:
            # A thread that waits for few rows costs more than it does.
            threads = self._threads if size * self._cost >= WORTH_THREADS else 1
            self._batches[size] = Copies(self._mj, self._settings, size, threads)
        return self._batches[size].step(x, u, force, parameters, dt)

    def corrected(self, model: Model) -> str:
        """The MJCF text with the corrections of an augmented model in it.

        Numbers of joints, actuators and bodies are set where they stand, a delay of a command in whole physics steps.
        What MJCF can't say stands in a comment at the top.

        Raises
        ------
        ValueError
            The simulator was made from a compiled model, so there is no MJCF text.
        """
        if self._text is None:
            raise ValueError("there is no MJCF text to correct; make the simulator from an MJCF file or text")
        text = mjcf.Text(self._text)
        notes: list[str] = []
        settings = {setting.name: setting for setting in self._settings}
        inputs = model._inner.simulator_inputs()
        for kind, name, expression, value in inputs:
            if kind == "parameter":
                setting = settings[name]
                if value is None:
                    notes.append(f"{name} is {expression}")
                elif value != setting.value and not self._correct(text, setting, value):
                    notes.append(f"{name} is {mjcf.number(value)}, in a file that is included here or an element without a name")
            elif kind == "force" and expression != "0":
                notes.append(f"a force acts at {name}: {expression}")
            elif kind == "command" and expression != name:
                self._correct_command(text, name, expression, notes)
        n = len(self._positions)
        for name, _, equation, measured in model._inner.states[: 2 * n]:
            if measured is not None:
                notes.append(f"the column {name} reads {measured}")
        for name, _, equation, _ in model._inner.states[2 * n :]:
            notes.append(f"{name} is a state of its own: {name}' = {equation}")
        name = self._source.name if self._source else "the model"
        text.comment([f"gpsindy: {name} as a diagnosis corrected it", *(f"gpsindy: not in this file: {note}" for note in notes)])
        return text.text

    def _corrected_file(self, inner: Any, folder: Path) -> tuple[str, str, list[str]]:
        """Name, text and changed lines of the corrected file, for ``folder``."""
        text = self.corrected(Model._of(inner, self))
        lines = difflib.unified_diff((self._text or "").splitlines(), text.splitlines(), "nominal", "corrected", "", "", 1, "")
        difference = list(lines)
        if self._source is not None:
            text = mjcf.moved(text, self._source.parent, pathlib.Path(os.fspath(folder)))
        return ("augmented.xml", text, difference)

    def _correct(self, text: mjcf.Text, setting: Setting, value: float) -> bool:
        kind = {"kp": "actuator", "kv": "actuator", "mass": "body"}.get(setting.attribute, "joint")
        number = setting.index - 1 if kind == "body" else setting.index
        element = text.find(kind, setting.element, number)
        if element is None:
            return False
        if setting.attribute == "mass":
            self._correct_mass(text, element, setting.index, value / setting.value)
        elif kind == "actuator" and element.tag == "general":
            place = 1 if setting.attribute == "kp" else 2
            gain = [float(v) for v in self._mj.actuator_gainprm[setting.index][:3]]
            bias = [float(v) for v in self._mj.actuator_biasprm[setting.index][:3]]
            bias[place] = -value
            gain[0] = value if setting.scale is None else gain[0]
            text.set(element, "gainprm", " ".join(map(mjcf.number, gain)))
            again = text.find(kind, setting.element, number)
            if again is not None:
                text.set(again, "biasprm", " ".join(map(mjcf.number, bias)))
        else:
            # Further numbers of a polynomial stay.
            old = element.attributes.get(setting.attribute, "").split()
            text.set(element, setting.attribute, " ".join([mjcf.number(value), *old[1:]]))
        return True

    def _correct_mass(self, text: mjcf.Text, body: mjcf.Element, index: int, share: float) -> None:
        m = self._mj

        def numbers(values: Iterable[float]) -> str:
            return " ".join(mjcf.number(v) for v in values)

        own = text.child(body, "inertial")
        if own is None:
            said = {"pos": m.body_ipos[index], "quat": m.body_iquat[index]}
            parts = [f'{name}="{numbers(values)}"' for name, values in said.items()]
            mass, inertia = share * m.body_mass[index], share * m.body_inertia[index]
            text.insert(body, f'<inertial {" ".join(parts)} mass="{mjcf.number(mass)}" diaginertia="{numbers(inertia)}"/>')
            return
        for attribute in ("diaginertia", "fullinertia", "mass"):
            if attribute in own.attributes:
                scaled = [share * float(v) for v in own.attributes[attribute].split()]
                text.set(own, attribute, numbers(scaled))

    def _correct_command(self, text: mjcf.Text, name: str, expression: str, notes: list[str]) -> None:
        a = self._commands.index(name)
        element = text.find("actuator", self._actuators[a], a)
        step = float(self._mj.opt.timestep)
        late = re.fullmatch(rf"delay\({re.escape(name)}, ([0-9.e+-]+)\)", expression)
        limited = re.fullmatch(rf"clamp\({re.escape(name)}, -([0-9.e+-]+), ([0-9.e+-]+)\)", expression)
        if element is not None and late:
            steps = max(1, round(float(late.group(1)) / step))
            text.set(element, "delay", mjcf.number(steps * step))
            again = text.find("actuator", self._actuators[a], a)
            if again is not None:
                text.set(again, "nsample", str(steps + 1))
            notes.append(f"the delay of {name} is {late.group(1)} s, here {steps} steps of {step} s")
        elif element is not None and limited and limited.group(1) == limited.group(2):
            low, high = -float(limited.group(1)), float(limited.group(2))
            if self._mj.actuator_ctrllimited[a]:
                low, high = max(low, self._mj.actuator_ctrlrange[a][0]), min(high, self._mj.actuator_ctrlrange[a][1])
            text.set(element, "ctrlrange", f"{mjcf.number(low)} {mjcf.number(high)}")
            again = text.find("actuator", self._actuators[a], a)
            if again is not None:
                text.set(again, "ctrllimited", "true")
        else:
            notes.append(f"the command {name} becomes {expression}")

    def save(self, model: Model, path: Path) -> None:
        """Writes :meth:`corrected`; whole or not at all. In another folder it names meshes and included files from there."""
        file = pathlib.Path(os.fspath(path))
        _gpsindy.write_whole(os.fspath(path), self._corrected_file(model._inner, file.parent)[1])

    def __repr__(self) -> str:
        return f"gpsindy.mujoco.Simulator of {', '.join(self._joints)}"

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError("a MuJoCo simulator can't be pickled; make it anew from its file")


def _as_mjcf(path: pathlib.Path) -> str:
    """A URDF file in MuJoCo's own language."""
    spec = mujoco.MjSpec.from_file(os.fspath(path))
    spec.compile()
    return str(spec.to_xml())


def _plain(name: str) -> str:
    """A name as expressions take it."""
    found = re.sub(r"\W", "_", name)
    return found if found[:1].isalpha() or found[:1] == "_" else f"_{found}"


def _known(what: str, given: Mapping[str, Any], known: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            raise ValueError(f"{what}: the model has no {name!r}; found {', '.join(known)}")
