"""The next experiment: a control signal that distinguishes what a diagnosis left open."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gpsindy import _gpsindy
from gpsindy.data._tables import Array
from gpsindy.data.dataset import Path


@dataclass(frozen=True)
class Separation:
    """How far a run is expected to part two simulators.

    Attributes
    ----------
    one, other : str
        Their effects.
    nats : float
        Expected log odds in favour of the right one, whichever it is.
    seconds : float or None
        After how many seconds the right one is expected at 95 %; None: not within the run.
    """

    one: str
    other: str
    nats: float
    seconds: float | None


@dataclass(frozen=True, eq=False)
class Experiment:
    """A control signal to record next; ``print`` it for what it will show.

    Attributes
    ----------
    t : ndarray of shape (n_samples,)
        Times from zero, s.
    controls : dict of str to ndarray of shape (n_samples,)
        Each control in its unit, held between samples.
    form : str
        What it began as: ``multisine``, ``chirp``, ``steps`` or ``free form``.
    pairs : tuple of Separation
        The pairs that it distinguishes, the hardest first.
    complete : bool
        All signals were tried; False: time was up, and a longer search may find a better one.
    """

    t: Array
    controls: Mapping[str, Array]
    form: str
    pairs: tuple[Separation, ...]
    complete: bool
    _units: Mapping[str, str]

    def to_csv(self) -> str:
        """The signal as text: ``t`` and every control, a unit behind each name."""
        units = {"t": "s", **self._units}
        header = ",".join(f"{name} [{units[name]}]" if units.get(name) else name for name in ("t", *self.controls))
        table = np.column_stack([self.t, *self.controls.values()])
        return "\n".join([header, *(",".join(repr(float(v)) for v in row) for row in table), ""])

    def save(self, path: Path) -> None:
        """Writes :meth:`to_csv` to a file; whole or not at all."""
        _gpsindy.write_whole(os.fspath(path), self.to_csv())

    def __repr__(self) -> str:
        lines = [f"Experiment of {self.t[-1]:g} s, {self.form}, {len(self.t)} samples of {', '.join(self.controls)}"]
        for pair in self.pairs:
            after = "not within the run" if pair.seconds is None else f"after {pair.seconds:.3g} s"
            lines.append(f"  {pair.one} or {pair.other}: {pair.nats:.3g} nats expected, 95 % {after}")
        if not self.complete:
            lines.append("  The search ended early; a longer one may find a better run.")
        return "\n".join(lines)
