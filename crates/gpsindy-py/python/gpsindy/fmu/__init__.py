"""FMUs as simulators: FMI 2 and 3, model exchange and co-simulation.

Needs the package ``fmpy``: ``pip install gpsindy[fmu]``.
"""

from __future__ import annotations

import os
import pathlib
import re
import shutil
import tempfile
import threading
import weakref
from collections.abc import Mapping, Sequence
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from gpsindy import _gpsindy
from gpsindy.data._tables import Array
from gpsindy.data.dataset import Path
from gpsindy.fmu.copies import Kind, copies
from gpsindy.fmu.workers import Workers, shared
from gpsindy.model import Model
from gpsindy.stepper import stepping_model

try:
    import fmpy
except ImportError as missing:
    raise ImportError("gpsindy.fmu needs the package fmpy: pip install 'gpsindy[fmu]'") from missing

__all__ = ["Kind", "Simulator"]


class Simulator:
    """An FMU in place of equations.

    States are the FMU's continuous states, controls its real inputs, parameters its real parameters. As model exchange it
    is integrated by steps of Runge-Kutta of order 4 that last ``dt``, from event to event where it has events of its states; as
    co-simulation it makes steps of ``dt`` itself, each from start values of its own. A log's period is walked in whole steps,
    the last one shortened where it must be; a co-simulation whose own steps are longer is an error.

    Parameters
    ----------
    path : path
        The ``.fmu`` file.
    dt : float, optional
        Step, s. Default: the FMU's own ``stepSize``, else 0.01.
    columns : mapping of str to str, optional
        Columns of states and inputs in the logs. Default: their own names, with ``_`` for what expressions can't take.
    kinematic : mapping of str to str, optional
        ``{"x": "v"}`` says that state ``v`` is the time derivative of state ``x``; columns, not names of the FMU. With it
        ``v`` may be missing in logs.
    forces : mapping of str to str, or to (str, str), optional
        Inputs of the FMU that no log carries: places where a force that nobody modelled may act. For each the column of
        the state that moves there, or that and its position.
    parameters : sequence of str, optional
        Parameters that may be wrong. Default: all real ones.
    kind : {"model exchange", "co-simulation"}, optional
        Default: model exchange where the FMU has it and no events, or no co-simulation.

    processes : int
        Processes that step copies side by side; 0: one a core, 1: this one alone. The numbers are the same.

    Raises
    ------
    ValueError
        No continuous state, a state that is an array or that a co-simulation does not let itself be started from, an unknown
        name. From rollouts: events at set times, a step that a co-simulation did not make.
    """

    def __init__(
        self,
        path: Path,
        *,
        dt: float | None = None,
        columns: Mapping[str, str] | None = None,
        kinematic: Mapping[str, str] | None = None,
        forces: Mapping[str, str | tuple[str, str]] | None = None,
        parameters: Sequence[str] | None = None,
        kind: Kind | None = None,
        processes: int = 0,
    ) -> None:
        self._path = pathlib.Path(os.fspath(path))
        if not self._path.exists():
            raise FileNotFoundError(f"{self._path}: no such file; hand in an .fmu file")
        self._description = fmpy.read_model_description(os.fspath(self._path))
        if self._description.fmiVersion.startswith("1"):
            raise ValueError(f"{self._path.name}: FMI 1; export it as FMI 2 or 3")
        self._kind = kind or self._choose()
        folder = tempfile.mkdtemp(prefix="gpsindy_fmu_")
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self._folder = fmpy.extract(os.fspath(self._path), unzipdir=folder)
        variables = self._description.modelVariables
        states = [unknown.variable.derivative for unknown in self._description.derivatives]
        if not states:
            raise ValueError(f"{self._path.name}: no continuous state, so there is nothing to roll out")
        for variable in [v for v in variables if v.dimensions and (v in states or v.causality == "input")]:
            raise ValueError(f"{self._path.name}: {variable.name!r} is an array, which no column carries; export its elements one by one")
        inputs = [v for v in variables if v.causality == "input" and v.type in ("Real", "Float64")]
        named = {v.name: v for v in variables}
        real = [v for v in variables if v.type in ("Real", "Float64") and not v.dimensions]
        own = [v for v in real if v.causality == "parameter"]
        if parameters is not None:
            unknown = [name for name in parameters if name not in named]
            if unknown:
                raise ValueError(f"parameters: the FMU has no {unknown[0]!r}; found {', '.join(v.name for v in own)}")
            own = [named[name] for name in parameters]
        if self._kind == "co-simulation":
            for state in states:
                if state.initial not in ("exact", "approx"):
                    raise ValueError(f"state {state.name!r} can't be given a start value; use the FMU as model exchange")
        places = dict(forces or {})
        for name in places:
            if name not in {v.name for v in inputs}:
                raise ValueError(f"forces: the FMU has no input {name!r}; found {', '.join(v.name for v in inputs)}")
        given = dict(columns or {})
        for name in given:
            if name not in named:
                raise ValueError(f"columns: the FMU has no {name!r}")
        column = {v.name: given.get(v.name, _plain(v.name)) for v in [*states, *inputs]}
        controls = [v for v in inputs if v.name not in places]
        ports = [next(v for v in inputs if v.name == name) for name in places]
        self._references = [[v.valueReference for v in part] for part in (states, controls, ports, own)]
        self._names = {_dotted(v.name): v.name for v in own}
        self._processes = processes or os.cpu_count() or 1
        made = (os.fspath(self._folder), self._kind, self._references)
        self._copies = copies(self._description, *made)
        self._workers = Workers(os.fspath(self._path.resolve()), *made, self._processes - 1)
        self._turn = threading.Lock()
        experiment = self._description.defaultExperiment
        step = float(getattr(experiment, "stepSize", None) or 0.01) if dt is None else float(dt)

        def port(variable: Any) -> tuple[str, str, str, str | None, list[tuple[str, str]]]:
            place = places[variable.name]
            motion, position = (place, None) if isinstance(place, str) else place
            return (column[variable.name], motion, variable.unit or "", position, [])

        self._model = stepping_model(
            self._step,
            self._description.modelName,
            step,
            states=[(column[v.name], v.unit or "") for v in states],
            controls=[(column[v.name], v.unit or "") for v in controls],
            kinematic=list((kinematic or {}).items()),
            ports=[port(v) for v in ports],
            parameters=[(_dotted(v.name), float(v.start or 0.0), v.unit or "", None, _range(v), None) for v in own],
            initial=[(column[v.name], float(v.start or 0.0)) for v in states],
            measured=[],
            source=self,
            several=True,
            copies=self._copies,
        )

    @property
    def model(self) -> Model:
        """The simulator as a model: names, rollouts, scores."""
        return self._model

    @property
    def kind(self) -> Kind:
        """How the FMU is used."""
        return self._kind

    def parameters(self, model: Model) -> dict[str, float]:
        """Values of the FMU's parameters in an augmented model, those that differ from its own."""
        own = {p.name: p.value for p in self._model.parameters}
        found = {name: value for kind, name, _, value in model._inner.simulator_inputs() if kind == "parameter"}
        changed = {name: value for name, value in found.items() if value is not None and value != own[name]}
        return {self._names[name]: value for name, value in changed.items()}

    def corrected(self, model: Model) -> str:
        """The corrected parameters as an SSP parameter set, which importers of FMUs read.

        What parameters cannot express is in a comment.
        """
        lines = [f"  <!-- gpsindy: parameters of {self._path.name} as a diagnosis corrected them -->"]
        for kind, name, expression, value in model._inner.simulator_inputs():
            if (kind == "command" and expression != name) or (kind == "force" and expression != "0") or value is None:
                if not (kind == "command" and expression == name):
                    lines.append(f"  <!-- gpsindy: not in this file: {name}: {re.sub('-{2,}', '- -', expression)} -->")
        lines.append("  <ssv:Parameters>")
        for name, value in self.parameters(model).items():
            lines.append(f'    <ssv:Parameter name={quoteattr(name)}><ssv:Real value="{value!r}"/></ssv:Parameter>')
        lines.append("  </ssv:Parameters>")
        head = '<ssv:ParameterSet version="1.0" name="gpsindy" '
        head += 'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">'
        return "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', head, *lines, "</ssv:ParameterSet>", ""])

    def save(self, model: Model, path: Path) -> None:
        """Writes :meth:`corrected`, best as a file ``.ssv``; whole or not at all."""
        _gpsindy.write_whole(os.fspath(path), self.corrected(model))

    def _corrected_file(self, inner: Any, folder: Path) -> tuple[str, str, list[str]]:
        """Name, text and changed lines of the corrected parameters; ``folder`` makes no difference."""
        model = Model._of(inner, self)
        own = {self._names[p.name]: p.value for p in self._model.parameters if p.name in self._names}
        changed = self.parameters(model).items()
        difference = [line for name, value in changed for line in (f"-{name} = {own[name]!r}", f"+{name} = {value!r}")]
        return ("augmented.ssv", self.corrected(model), difference)

    def _as_model(self) -> Model:
        return self._model

    def _save_corrected(self, model: Model, path: Path) -> None:
        self.save(model, path)

    def _choose(self) -> Kind:
        description = self._description
        exchange = description.modelExchange is not None
        if exchange and (not description.numberOfEventIndicators or description.coSimulation is None):
            return "model exchange"
        if description.coSimulation is None:
            raise ValueError(f"{self._path.name}: neither model exchange nor co-simulation")
        return "co-simulation"

    def _step(self, x: Array, u: Array, force: Array, parameters: Array, dt: float | Array, count: int = 1) -> Array:
        """Steps of many rows; those that are short the model makes by the copies, without coming here."""
        if self._processes == 1 or not self._copies.is_long(u.shape[0] * u.shape[1] * count):
            return self._copies.step(x, u, force, parameters, dt, count)
        own, *others = shared(len(x), self._processes)
        lengths = np.full(len(x), dt)
        # A process answers one call after the other, whichever thread asks.
        with self._turn:
            self._workers.begin([(x[one], u[one], force[one], parameters[one], lengths[one], count) for one in others])
            try:
                first = self._copies.step(x[own], u[own], force[own], parameters[own], lengths[own], count)
            finally:
                rest = self._workers.end(len(others))
        return np.concatenate([first, *rest])

    def __repr__(self) -> str:
        return f"gpsindy.fmu.Simulator of {self._description.modelName}, {self._kind}"


def _plain(name: str) -> str:
    found = re.sub(r"\W", "_", name)
    return found if found[:1].isalpha() or found[:1] == "_" else f"_{found}"


def _dotted(name: str) -> str:
    """The name of a parameter, which may have dots."""
    return ".".join(_plain(part) for part in name.split("."))


def _range(variable: Any) -> tuple[float, float] | None:
    if variable.min is None and variable.max is None:
        return None
    low, high = variable.min, variable.max
    return (float("-inf") if low is None else float(low), float("inf") if high is None else float(high))
