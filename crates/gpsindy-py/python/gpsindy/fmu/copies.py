"""Copies of one FMU: many rows, each with parameters and a state of its own, stepped one after the other."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

import numpy as np

from gpsindy.data._tables import Array
from gpsindy.fmu.instance import Instance, Kind

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
        self._instances: OrderedDict[bytes, Instance] = OrderedDict()

    def step(self, x: Array, inputs: Array, parameters: Array, dt: float | Array, count: int = 1) -> Array:
        """States (n, samples, n_states) of samples of ``count`` steps of ``dt`` s, of all copies or of each (n,), after ``x``; inputs (n,
        samples, n_inputs) are held within a sample."""
        rows, samples = inputs.shape[:2]
        lengths = np.broadcast_to(dt, rows).tolist()
        found = np.empty((rows, samples, x.shape[1]))
        for i in range(rows):
            instance, state = self._instance(parameters[i]), x[i]
            for sample, own in enumerate(inputs[i].tolist()):
                for _ in range(count):
                    state = instance.step(state, own, lengths[i])
                found[i, sample] = state
        return found

    def _instance(self, parameters: Array) -> Instance:
        key = parameters.tobytes()
        if key in self._instances:
            self._instances.move_to_end(key)
            return self._instances[key]
        if len(self._instances) >= _KEPT:
            self._instances.popitem(last=False)[1].free()
        self._instances[key] = Instance(*self._made, parameters)
        return self._instances[key]
