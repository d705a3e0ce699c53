"""The corrections of a diagnosis, written into the text of an MJCF file."""

from __future__ import annotations

import os
import pathlib
import re
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gpsindy.following import mjcf
from gpsindy.mujoco._engine import mujoco
from gpsindy.mujoco.settings import AXES, LIMITS, OF_AN_ACTUATOR, Setting, settings_of
from gpsindy.stepper import seconds_late

#: Actuators whose element says a position servo's gain as ``kp``, a velocity servo's or a damping as ``kv``.
_SERVOS = frozenset({"position", "velocity", "intvelocity"})

#: Share of a number by which the file's may differ from what was written: some go through a file's own units.
_SAME = 1e-9


class Corrections:
    """An MJCF text that corrections go into.

    Attributes
    ----------
    text : mjcf.Text
        As it is now.
    missing : list of str
        What MJCF can't say.
    remarks : list of str
        What is said otherwise than in the report.
    """

    def __init__(
        self, text: str, home: pathlib.Path | None, model: Any, settings: Sequence[Setting], joints: Sequence[int]
    ) -> None:
        self.text = mjcf.Text(text)
        self.missing: list[str] = []
        self.remarks: list[str] = []
        self._home = home
        self._mj = model
        self._settings = settings
        self._joints = joints

    def numbers(self, values: Mapping[str, float]) -> None:
        """Sets numbers of joints, actuators and bodies in place, and checks that a model made from the text has them."""
        wanted = {setting.name: values.get(setting.name, setting.value) for setting in self._settings}
        for setting in self._settings:
            value = wanted[setting.name]
            if value != setting.value and not self._set(setting, value):
                where = "of the driver" if setting.driver else "in a file that is included here or an element without a name"
                self.missing.append(f"{setting.name} is {mjcf.number(value)}, {where}")
        if all(wanted[setting.name] == setting.value for setting in self._settings):
            return
        # A number may follow others as the model is compiled: a servo's kv its dampratio, masses a total.
        try:
            rest = self._otherwise(wanted)
            gains = [setting for setting, _ in rest if setting.attribute == "kv"]
            if any([self._set(setting, wanted[setting.name]) for setting in gains]):
                rest = self._otherwise(wanted)
        except ValueError as error:
            self.missing.append(f"a model, as this text does not load: {str(error).splitlines()[0]}")
            return
        stated = [note.split(" is ")[0] for note in self.missing]
        for setting, found in rest:
            if setting.name not in stated:
                made = f"from this file MuJoCo makes {mjcf.number(found)}"
                self.missing.append(f"{setting.name} is {mjcf.number(wanted[setting.name])}; {made}")

    def _otherwise(self, wanted: Mapping[str, float]) -> list[tuple[Setting, float]]:
        """Numbers that a model made from the text has otherwise."""
        model = compiled(self.text.text, self._home)
        # Places count, not names.
        numbers = {j: str(j) for j in self._joints}, [str(i) for i in range(model.nu)]
        found = {(s.attribute, s.index): s.value for s in settings_of(model, *numbers)}
        rows = [(s, found.get((s.attribute, s.index), 0.0)) for s in self._settings if not s.driver]
        return [(s, value) for s, value in rows if abs(value - wanted[s.name]) > _SAME * max(abs(value), abs(wanted[s.name]))]

    def _set(self, setting: Setting, value: float) -> bool:
        if setting.driver:
            return False
        if setting.attribute in AXES:
            self._set_gravity(setting.index, value)
            return True
        kind = "actuator" if setting.attribute in OF_AN_ACTUATOR else "body" if setting.attribute == "mass" else "joint"
        number = setting.index - 1 if kind == "body" else setting.index
        if kind == "joint" and self.text.named("freejoint"):
            number = self._joints.index(setting.index)
        element = self.text.find(kind, setting.element, number)
        if element is None:
            return False
        if setting.attribute == "mass":
            self._set_mass(element, setting, value / setting.value)
        elif setting.attribute in LIMITS:
            self._write(kind, setting, number, setting.attribute, f"{mjcf.number(-value)} {mjcf.number(value)}")
        elif element.tag == "general":
            place = 1 if setting.attribute == "kp" else 2
            gain = [float(v) for v in self._mj.actuator_gainprm[setting.index][:3]]
            bias = [float(v) for v in self._mj.actuator_biasprm[setting.index][:3]]
            own = element.attributes
            gain = [float(v) for v in own["gainprm"].split()] if "gainprm" in own else gain
            bias = [float(v) for v in own["biasprm"].split()] if "biasprm" in own else bias
            bias += [0.0] * (place + 1 - len(bias))
            bias[place] = -value
            gain[0] = value if setting.scale is None else gain[0]
            self._write(kind, setting, number, "gainprm", " ".join(map(mjcf.number, gain)))
            self._write(kind, setting, number, "biasprm", " ".join(map(mjcf.number, bias)))
        elif kind == "actuator" and element.tag not in _SERVOS:
            return False
        else:
            # Further numbers of a polynomial stay.
            old = element.attributes.get(setting.attribute, "").split()
            self._write(kind, setting, number, setting.attribute, " ".join([mjcf.number(value), *old[1:]]))
            again = self.text.find(kind, setting.element, number)
            if setting.attribute == "kv" and again is not None:
                self.text.unset(again, "dampratio")
        return True

    def _set_gravity(self, component: int, value: float) -> None:
        saying = [option for option in self.text.named("option") if "gravity" in option.attributes]
        numbers = [float(g) for g in (saying[-1].attributes["gravity"].split() if saying else self._mj.opt.gravity)]
        numbers[component] = value
        said = " ".join(map(mjcf.number, numbers))
        if saying:
            self.text.set(saying[-1], "gravity", said)
        else:
            self.text.insert(self.text.named("mujoco")[0], f'<option gravity="{said}"/>')

    def _write(self, kind: str, setting: Setting, number: int, attribute: str, value: str) -> None:
        element = self.text.find(kind, setting.element, number)
        if element is not None:
            self.text.set(element, attribute, value)

    def _set_mass(self, body: mjcf.Element, setting: Setting, share: float) -> None:
        m, index = self._mj, setting.index

        def numbers(values: Iterable[float]) -> str:
            return " ".join(mjcf.number(v) for v in values)

        if any(compiler.attributes.get("inertiafromgeom") == "true" for compiler in self.text.named("compiler")):
            self._read_inertias()
            body = self.text.find("body", setting.element, index - 1) or body
        own = self.text.child(body, "inertial")
        if own is None:
            said = {"pos": m.body_ipos[index], "quat": m.body_iquat[index]}
            parts = [f'{name}="{numbers(values)}"' for name, values in said.items()]
            mass, inertia = share * m.body_mass[index], share * m.body_inertia[index]
            self.text.insert(body, f'<inertial {" ".join(parts)} mass="{mjcf.number(mass)}" diaginertia="{numbers(inertia)}"/>')
            return
        for attribute in ("diaginertia", "fullinertia", "mass"):
            inertial = self.text.child(self.text.find("body", setting.element, index - 1) or body, "inertial") or own
            if attribute in inertial.attributes:
                scaled = [share * float(v) for v in inertial.attributes[attribute].split()]
                self.text.set(inertial, attribute, numbers(scaled))

    def _read_inertias(self) -> None:
        """Where all inertias come from geoms: lets an ``inertial`` count, and takes out those that did not."""
        for number in range(len(self.text.named("compiler"))):
            compiler = self.text.named("compiler")[number]
            if "inertiafromgeom" in compiler.attributes:
                self.text.set(compiler, "inertiafromgeom", "auto")
        while self.text.named("inertial"):
            self.text.remove(self.text.named("inertial")[0])

    def command(self, name: str, actuator: str, number: int, expression: str) -> None:
        """A command that becomes an expression of the column ``name``: a delay or a limit; else MJCF can't say it."""
        late = seconds_late(expression, name)
        limited = re.fullmatch(rf"clamp\({re.escape(name)}, ([0-9.e+-]+), ([0-9.e+-]+)\)", expression)
        element = self.text.find("actuator", actuator, number)
        if element is None or (late is None and limited is None):
            self.missing.append(f"the command {name} becomes {expression}")
        elif late is not None:
            self._set_delay(name, actuator, number, late)
        elif limited is not None:
            low, high = float(limited.group(1)), float(limited.group(2))
            if self._mj.actuator_ctrllimited[number]:
                low, high = max(low, self._mj.actuator_ctrlrange[number][0]), min(high, self._mj.actuator_ctrlrange[number][1])
            for attribute, value in (("ctrlrange", f"{mjcf.number(low)} {mjcf.number(high)}"), ("ctrllimited", "true")):
                again = self.text.find("actuator", actuator, number)
                if again is not None:
                    self.text.set(again, attribute, value)
        else:
            self.missing.append(f"the command {name} becomes {expression}")

    def _set_delay(self, name: str, actuator: str, number: int, late: float) -> None:
        step = float(self._mj.opt.timestep)
        # A command that is held from step to step is this many steps late, wherever in a step its delay ends.
        steps = round(late / step)
        # MuJoCo takes the newest command that is at least `delay` old. Half a step less than the whole steps keeps the
        # rounding of its clock out of that.
        said = {"delay": mjcf.number((steps - 0.5) * step if steps else 0.0), "nsample": str(steps)}
        for attribute, value in said.items():
            element = self.text.find("actuator", actuator, number)
            if element is not None and (steps or attribute in element.attributes):
                self.text.set(element, attribute, value)
        self.remarks.append(
            f"{name} is {mjcf.number(late)} s late, which is {steps} steps of {step} s. Before its first command MuJoCo's buffer "
            "holds 0; the report's rollouts hold the first command of the log"
        )

    def commented(self, title: str) -> str:
        """The text with a comment at the top."""
        lines = [title, *(f"gpsindy: {remark}" for remark in self.remarks)]
        self.text.comment([*lines, *(f"gpsindy: not in this file: {note}" for note in self.missing)])
        return self.text.text


def compiled(text: str, home: pathlib.Path | None) -> Any:
    """A model from the text of a file of the folder ``home``."""
    if home is None:
        return mujoco.MjModel.from_xml_string(text)
    with tempfile.TemporaryDirectory(prefix="gpsindy_mjcf_") as folder:
        file = pathlib.Path(folder) / "model.xml"
        file.write_text(mjcf.moved(text, home.resolve(), pathlib.Path(folder).resolve()), encoding="utf-8")
        return mujoco.MjModel.from_xml_path(os.fspath(file))

