"""Copies of one MuJoCo model that are stepped together."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from gpsindy.data._tables import Array
from gpsindy.mujoco._engine import batch
from gpsindy.mujoco.base import Base
from gpsindy.mujoco.drivers import Drivers
from gpsindy.mujoco.settings import OF_A_DOF, Setting, first

#: Work of a call, s, from which on threads share it: measured with models of 2 and of 8 us a step, from 200 and 32 copies on.
WORTH_THREADS = 4e-4

#: Steps by which a model's cost is measured.
TRIAL = 50


def seconds_a_step(model: Any) -> float:
    """What one step of one copy takes."""
    one = batch.Batch(model, 1, nthread=1)
    quiet(one)
    begun = time.perf_counter()
    for _ in range(TRIAL):
        one.step()
    return (time.perf_counter() - begun) / TRIAL


def quiet(copies: Any) -> None:
    """The engine prints a warning when it is the first of its kind and leaves a file. Trial parameters that diverge are
    part of a search, and the rows show them."""
    copies.warning[:, :, 1] = 1


class Copies:
    """A number of copies of one model, each with parameters of its own."""

    def __init__(
        self, model: Any, settings: Sequence[Setting], drivers: Drivers, base: Base, size: int, threads: int
    ) -> None:
        self.batch = batch.Batch(model, size, nthread=threads)
        quiet(self.batch)
        self.settings = settings
        self.drivers = drivers
        self.base = base
        self.position = _places(model.jnt_qposadr[base.joints])
        self.velocity = _places(model.jnt_dofadr[base.joints])
        self.joints = len(base.joints)
        self.dof = model.jnt_dofadr.copy()
        bind = self.batch.bind
        self.qpos, self.qvel, self.force = bind("qpos"), bind("qvel"), bind("qfrc_applied")
        self.ctrl = bind("ctrl") if model.nu else np.zeros((size, 0))
        self.act = bind("act") if model.na else np.zeros((size, 0))
        self.timestep = self.batch.expand("opt.timestep")
        self.dt = float(model.opt.timestep)
        self.parameters = np.tile([s.value for s in settings], (size, 1))
        #: The rows of parameters of the last call.
        self.last = b""
        self.fields: dict[str, Any] = {}
        self.mass, self.inertia = model.body_mass.copy(), model.body_inertia.copy()
        self.ids = np.arange(size, dtype=np.int32)

    def step(self, x: Array, u: Array, force: Array, parameters: Array, dt: float | Array, count: int = 1) -> Array:
        """States (n, n_states) after ``count`` steps of ``dt`` s, of all copies or of each (n,), commands and forces held."""
        rows, joints = len(x), self.joints
        given = parameters.tobytes()
        if given != self.last:
            self._set(parameters)
            self.last = given
        if isinstance(dt, np.ndarray):
            self.timestep[:rows] = dt.reshape(rows, *self.timestep.shape[1:])
            self.dt = np.nan
        elif dt != self.dt:
            self.timestep[:] = dt
            self.dt = dt
        qpos, qvel, act, applied = self.qpos[:rows], self.qvel[:rows], self.act[:rows], self.force[:rows]
        qpos[:, self.position] = x[:, :joints]
        qvel[:, self.velocity] = x[:, joints : 2 * joints]
        act[:] = x[:, 2 * joints :]
        applied[:, self.velocity] = force
        commands = self.ctrl.shape[1]
        ctrl, columns, ids = self.ctrl[:rows], u[:, commands:], self.ids[:rows]
        # A base is placed and a driver's loop closed anew at every step.
        together = count if self.base.is_still and not self.drivers.around else 1
        failed: Any = ()
        for _ in range(0, count, together):
            self.base.place(columns, qpos, qvel, applied)
            ctrl[:] = self.drivers.commands(qpos[:, self.position], qvel[:, self.velocity], u[:, :commands], parameters)
            try:
                self.batch.step(ids=ids, nstep=together)
            except batch.SimulationError as error:
                failed = [*failed, *error.ids]
        found = np.empty_like(x)
        found[:, :joints] = qpos[:, self.position]
        found[:, joints : 2 * joints] = qvel[:, self.velocity]
        found[:, 2 * joints :] = act
        if len(failed):
            found[failed] = np.nan
        return found

    def _set(self, parameters: Array) -> None:
        rows = len(parameters)
        constants = False
        for column, setting in enumerate(self.settings):
            if setting.driver:
                continue
            values = parameters[:, column]
            if np.array_equal(values, self.parameters[:rows, column]):
                continue
            self.parameters[:rows, column] = values
            constants |= self._write(setting, values)
        if constants:
            self.batch.set_const()

    def _field(self, name: str) -> Any:
        if name not in self.fields:
            self.fields[name] = self.batch.expand(name)
        return self.fields[name]

    def _write(self, setting: Setting, values: Array) -> bool:
        """Sets one number of every copy; whether constants of the model depend on it."""
        rows, i, attribute = len(values), setting.index, setting.attribute
        if attribute in OF_A_DOF:
            first(self._field(f"dof_{attribute}"))[:rows, self.dof[i]] = values
            return attribute == "armature"
        if attribute == "stiffness":
            first(self._field("jnt_stiffness"))[:rows, i] = values
            return False
        if attribute == "mass":
            share = values / self.mass[i]
            self._field("body_mass")[:rows, i] = values
            self._field("body_inertia")[:rows, i, :] = share[:, None] * self.inertia[i]
            return True
        place = 1 if attribute == "kp" else 2
        if setting.scale is None:
            self._field("actuator_gainprm")[:rows, i, 0] = values
        self._field("actuator_biasprm")[:rows, i, place] = -values
        return False


def _places(places: Array) -> Any:
    """A slice where the places follow each other, which numpy reads and writes in half the time."""
    first = int(places[0]) if len(places) else 0
    return slice(first, first + len(places)) if np.array_equal(places, first + np.arange(len(places))) else places
