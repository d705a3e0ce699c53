"""Copies of one MuJoCo model that are stepped together."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from gpsindy.data._tables import Array
from gpsindy.mujoco._engine import batch, mujoco
from gpsindy.mujoco.base import Base
from gpsindy.mujoco.drivers import Drivers
from gpsindy.mujoco.settings import OF_A_DOF, Setting, first

#: Work of a call, s, from which on threads share it: handing a part over takes 6 us, and with 40 us of work two threads need two thirds of
#: the time of one.
WORTH_THREADS = 4e-5

#: What is held within a step, in the engine's order.
HELD = int(mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED)

#: What the engine warns of where a copy diverges.
DIVERGED = [int(getattr(mujoco.mjtWarning, f"mjWARN_BAD{what}")) for what in ("QPOS", "QVEL", "QACC")]

#: Steps by which a model's cost is measured.
TRIAL = 100


def seconds_a_step(model: Any) -> float:
    """What one step of one copy takes."""
    one = batch.Batch(model, 1, nthread=1)
    quiet(one)
    begun = time.perf_counter()
    one.step(nstep=TRIAL)
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
        """States (n, samples, n_states) of samples of ``count`` steps of ``dt`` s, of all copies or of each (n,); commands (n, samples,
        n_commands) and forces are held within a sample."""
        rows, samples = u.shape[:2]
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
        self._put(x)
        # A base is placed and a driver's loop closed anew at every step.
        is_free = self.base.is_still and not self.drivers.around
        if samples > 1 and is_free:
            found = self._rollout(rows, u, force, count)
            if found is not None:
                return found
            self._put(x)
        found = np.empty((rows, samples, x.shape[1]))
        lost = np.zeros(rows, dtype=bool)
        for sample in range(samples):
            self._hold(rows, u[:, sample], force[:, sample], parameters, (1, count) if is_free else (count, 1), lost)
            self._read(found[:, sample])
            found[lost, sample] = np.nan
        return found

    def _put(self, x: Array) -> None:
        rows, joints = len(x), self.joints
        self.qpos[:rows, self.position] = x[:, :joints]
        self.qvel[:rows, self.velocity] = x[:, joints : 2 * joints]
        self.act[:rows] = x[:, 2 * joints :]

    def _read(self, into: Array) -> None:
        rows, joints = len(into), self.joints
        into[:, :joints] = self.qpos[:rows, self.position]
        into[:, joints : 2 * joints] = self.qvel[:rows, self.velocity]
        into[:, 2 * joints :] = self.act[:rows]

    def _hold(self, rows: int, u: Array, force: Array, parameters: Array, calls: tuple[int, int], lost: Array) -> None:
        """So many calls of so many steps under the same commands; which copies diverge is noted in ``lost``."""
        qpos, qvel, applied = self.qpos[:rows], self.qvel[:rows], self.force[:rows]
        applied[:, self.velocity] = force
        commands = self.ctrl.shape[1]
        ctrl, columns, ids = self.ctrl[:rows], u[:, commands:], self.ids[:rows]
        for _ in range(calls[0]):
            self.base.place(columns, qpos, qvel, applied)
            ctrl[:] = self.drivers.commands(qpos[:, self.position], qvel[:, self.velocity], u[:, :commands], parameters)
            try:
                self.batch.step(ids=ids, nstep=calls[1])
            except batch.SimulationError as error:
                lost[error.ids] = True

    def _rollout(self, rows: int, u: Array, force: Array, count: int) -> Array | None:
        """The samples in one call of the engine; none where it would stop at what single steps pass over."""
        samples, joints, commands = u.shape[1], self.joints, self.ctrl.shape[1]
        held = np.zeros((rows, samples, commands + self.force.shape[1]))
        held[:, :, :commands] = u[:, :, :commands]
        held[:, :, commands:][:, :, self.velocity] = force
        try:
            made = self.batch.rollout(
                samples * count, np.repeat(held, count, axis=1), HELD, record=("qpos", "qvel", "act"), ids=self.ids[:rows]
            )
        except batch.SimulationError:
            return None
        rose = self.batch.warning[:rows, :, 1] > 1
        quiet(self.batch)
        if np.delete(rose, DIVERGED, axis=1).any():
            return None
        found = np.empty((rows, samples, 2 * joints + self.act.shape[1]))
        found[:, :, :joints] = made["qpos"][:, count - 1 :: count, self.position]
        found[:, :, joints : 2 * joints] = made["qvel"][:, count - 1 :: count, self.velocity]
        found[:, :, 2 * joints :] = made["act"][:, count - 1 :: count]
        for lost in np.flatnonzero(rose.any(axis=1)):
            # The engine repeats what it had when it gave up.
            moves = (found[lost] != found[lost, -1]).any(axis=1)
            found[lost, np.flatnonzero(moves).max(initial=-1) + 1 :] = np.nan
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
