"""Copies of one FMU: many rows, each with parameters and a state of its own."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

import numpy as np

from gpsindy._gpsindy import FmuInstance
from gpsindy.data._tables import Array
from gpsindy.fmu.instance import Kind, instance

#: Instances that are kept at most, each with parameters of its own.
_KEPT = 64


class Copies:
    """Instances of an unpacked FMU, as many as there are parameters.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription
    folder : str
        Where the FMU is unpacked.
    kind : Kind
    references : list of list of int
        Value references of states, controls, ports and parameters.
    """

    def __init__(self, description: Any, folder: str, kind: Kind, references: list[list[int]]) -> None:
        self._made = (description, folder, kind, references)
        self._instances: OrderedDict[bytes, FmuInstance] = OrderedDict()

    def step(self, x: Array, inputs: Array, parameters: Array, dt: float | Array, count: int = 1) -> Array:
        """States (n, samples, n_states) of samples of ``count`` steps of ``dt`` s, of all copies or of each (n,), after ``x``; inputs (n,
        samples, n_inputs) are held within a sample."""
        lengths = np.full(len(x), dt, dtype=np.float64)
        groups = _by_parameters(parameters)
        if len(groups) == 1:
            return self._instance(parameters[0]).step(x, inputs, lengths, count)
        found = np.empty((*inputs.shape[:2], x.shape[1]))
        for rows in groups:
            found[rows] = self._instance(parameters[rows[0]]).step(x[rows], inputs[rows], lengths[rows], count)
        return found

    def _instance(self, parameters: Array) -> FmuInstance:
        key = parameters.tobytes()
        if key in self._instances:
            self._instances.move_to_end(key)
            return self._instances[key]
        kept = self._instances.popitem(last=False)[1] if len(self._instances) >= _KEPT else None
        self._instances[key] = self._changed(kept, parameters) or instance(*self._made, parameters)
        return self._instances[key]

    def _changed(self, kept: FmuInstance | None, parameters: Array) -> FmuInstance | None:
        """An instance with other parameters; a reset takes far less time than a new one."""
        if kept is None:
            return None
        try:
            kept.reset(parameters)
        except ValueError:
            # An FMU whose reset fails can still be instantiated anew; and where the parameters are at fault, that says so.
            kept.free()
            return None
        return kept


def _by_parameters(parameters: Array) -> list[list[int]]:
    """Rows of equal parameters, each in order."""
    data, rows = parameters.tobytes(), len(parameters)
    size = len(data) // max(rows, 1)
    found: dict[bytes, list[int]] = {}
    for row in range(rows):
        found.setdefault(data[row * size : (row + 1) * size], []).append(row)
    return list(found.values())
