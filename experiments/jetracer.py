"""The logs of the small car as the paper's authors prepared them, and the errors of a rollout.

Controls 6 samples later (0.12 s, found by the authors by eye), every so-manieth row, nothing before 1 s, white noise of one
standard deviation on all four states (m, m, m/s, rad); the first 70 % of each run to learn from, the rest is one rollout.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STATES = ["x", "y", "v", "heading"]
CONTROLS = ["throttle", "steering"]
RATES = [5, 10, 25]
SIGMAS = [round(0.01 * k, 2) for k in range(11)]
SHIFT = 6
CUT = 1.0
TRAIN = 0.7
FULL_RATE = 50


@dataclass(frozen=True)
class Run:
    """One prepared log; `clean` is what motion capture saw, `x` what the methods see."""

    t: Array
    clean: Array
    x: Array
    u: Array
    n_train: int

    @property
    def test(self) -> slice:
        """The rows of the test; the first is the last that was learnt from, as in the authors' split."""
        return slice(self.n_train - 1, len(self.t))


def names(folder: Path) -> list[str]:
    """The logs of the folder, sorted."""
    return sorted(path.stem for path in folder.glob("rollout_*.csv"))


@cache
def _raw(path: Path) -> Array:
    table = np.genfromtxt(path, delimiter=",", skip_header=1)
    table[:, 4] = np.unwrap(table[:, 4])
    return table


def prepare(folder: Path | str, name: str, rate: int, sigma: float, seed: int) -> Run:
    """The log `name` at `rate` Hz with noise `sigma`."""
    table = _raw(Path(folder) / f"{name}.csv")
    rows = np.arange(SHIFT, len(table), FULL_RATE // rate)
    rows = rows[table[rows, 0] > CUT]
    clean = table[rows, 1:5]
    number = int(name.rsplit("_", 1)[1])
    random = np.random.default_rng([seed, number, rate, round(1000 * sigma)])
    noisy = clean + sigma * random.standard_normal(clean.shape)
    return Run(table[rows, 0], clean, noisy, table[rows - SHIFT, 5:7], int(np.floor(TRAIN * len(rows) + 0.5)))


def errors(run: Run, predicted: Array) -> dict[str, object]:
    """Errors of a rollout over the test: the authors' number, and honest ones against the clean log.

    `author`: Frobenius norm against the noisy log, units mixed, so that it grows with the number of samples.
    `rmse`: of each state in its unit, the heading without whole turns. `position`: root mean square distance, m.
    `diverged`: not finite, or further away than ten times the spread of the log.
    """
    clean, noisy = run.clean[run.test], run.x[run.test]
    spread = run.clean.max(axis=0) - run.clean.min(axis=0)
    with np.errstate(all="ignore"):
        finite = bool(np.isfinite(predicted).all())
        diverged = not finite or bool((np.abs(predicted - clean) > 10.0 * spread).any())
        author = float(np.linalg.norm(predicted - noisy)) if finite else float("inf")
        off = predicted - clean
        off[:, 3] = (off[:, 3] + np.pi) % (2.0 * np.pi) - np.pi
        rmse = np.sqrt(np.mean(off**2, axis=0)).tolist()
        position = float(np.sqrt(np.mean(off[:, 0] ** 2 + off[:, 1] ** 2)))
    return json.loads(json.dumps({"author": author, "rmse": rmse, "position": position, "diverged": diverged}))
