"""Online identification: every sample updates the smoothing and the model, at a cost that does not grow with the log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gpsindy import _gpsindy
from gpsindy.data._tables import Array, contiguous, floats, names_of
from gpsindy.errors import NotFittedError
from gpsindy.identifying._settings import count, number
from gpsindy.model import Hold, Model, rounded


@dataclass(frozen=True)
class Estimate:
    """Where every state is, by all samples so far.

    Attributes
    ----------
    value, value_std : ndarray of shape (n_states,)
        Values without noise and their standard deviations.
    rate, rate_std : ndarray of shape (n_states,)
        The same of their time derivatives, per second.
    """

    value: Array
    value_std: Array
    rate: Array
    rate_std: Array


class Online:
    """A model that follows a log as it grows.

    Gaussian processes smooth the newest samples; what no later sample changes is added to the regression, of which only small
    matrices are kept. While ``window`` holds the whole log, the model is the one that the whole log gives at once.

    Parameters
    ----------
    states, controls : sequence of str
        What a sample holds, in order; a name may carry a unit, ``"v [m/s]"``.
    degree, trig, products, terms, control_terms, fix, forbid, sign, regressor, lam
        As in :class:`gpsindy.GPSINDy`.
    kernel : {"auto", "matern52", "matern32"}
        Kernel of the smoothing.
    select : {"cv", "cv-best", "bic"}
        How the tuning value is chosen; by the Bayesian information criterion until there are five stretches of time.
    delays : mapping of str to float, optional
        Delay of a control, s.
    hold : {"zero", "linear"}
        What controls do between samples.
    angles : sequence of str
        States and controls that are wrapped angles, rad.
    memory : float, optional
        Time in which the weight of a sample falls by 1/e, s. Default: nothing is forgotten.
    window : int
        Samples that are kept, at least 64.

    Examples
    --------
    >>> import numpy as np
    >>> import gpsindy
    >>> online = gpsindy.Online(["x"], ["u"], degree=1)
    >>> x, random = 1.0, np.random.default_rng(0)
    >>> for i in range(400):
    ...     u = float(np.sin(0.13 * i) > 0)
    ...     _ = online.update(0.05 * i, x + 0.001 * random.standard_normal(), u)
    ...     x = u + (x - u) * np.exp(-0.1)
    >>> online.equations(precision=2)
    ['-2*x + 2*u']
    """

    def __init__(
        self,
        states: Sequence[str],
        controls: Sequence[str] = (),
        *,
        degree: int = 3,
        trig: bool = False,
        products: bool = False,
        terms: Sequence[str] = (),
        control_terms: bool = True,
        fix: Sequence[str] = (),
        forbid: Sequence[str] = (),
        sign: Sequence[str] = (),
        kernel: str = "auto",
        regressor: str = "subset",
        lam: float | Literal["auto"] = "auto",
        select: Literal["cv", "cv-best", "bic"] = "cv",
        delays: Mapping[str, float] | None = None,
        hold: Hold = "zero",
        angles: Sequence[str] = (),
        memory: float | None = None,
        window: int = 1000,
    ) -> None:
        self._states = [_gpsindy.parse_header(name) for name in names_of(states)]
        self._controls = [_gpsindy.parse_header(name) for name in names_of(controls)]
        self._core = _gpsindy.Online(
            {
                "states": self._states,
                "controls": self._controls,
                "angles": names_of(angles),
                "degree": count(degree, "degree"),
                "trig": bool(trig),
                "products": bool(products),
                "terms": names_of(terms),
                "control_terms": bool(control_terms),
                "fix": names_of(fix),
                "forbid": names_of(forbid),
                "sign": names_of(sign),
                "kernel": kernel,
                "regressor": regressor,
                "lambda_": None if isinstance(lam, str) and lam == "auto" else number(lam, "lam"),
                "select": select,
                "delays": [(name, float(value)) for name, value in dict(delays or {}).items()],
                "hold": hold,
                "memory": None if memory is None else float(memory),
                "window": count(window, "window"),
            }
        )

    def update(self, t: Any, x: Any, u: Any = None) -> bool:
        """Takes one sample, or several in order.

        Parameters
        ----------
        t : float or array of shape (n_samples,)
            Time in seconds, above that of the sample before.
        x : float or array of shape (n_states,) or (n_samples, n_states)
            States; NaN is a missing value.
        u : float or array of shape (n_controls,) or (n_samples, n_controls), optional
            Controls; NaN holds the last value.

        Returns
        -------
        bool
            Whether rows were added to the regression, so that a look at the model pays.
        """
        times = floats(t, "t")
        if times.ndim > 1:
            raise ValueError(f"t: expected a number or shape (n_samples,), found {times.shape}")
        count = None if times.ndim == 0 else len(times)
        rows = _rows(x, count, len(self._states), "x")
        inputs = _rows(() if u is None else u, count, len(self._controls), "u")
        return self._core.update(contiguous(np.atleast_1d(times)), rows, inputs)

    def begin_run(self) -> None:
        """Ends the run: the next sample may have any time and is not joined to the last one."""
        self._core.begin_run()

    @property
    def n_samples(self) -> int:
        """Samples taken so far."""
        return self._core.n_samples

    @property
    def lag(self) -> int:
        """Samples by which the regression is behind; 0 before the first fit. The model looks at the newest all the same."""
        return self._core.lag

    @property
    def model(self) -> Model:
        """The model of all samples so far; standard errors are in ``model.identification``."""
        self._check("model")
        return Model._of(self._core.identification()[0])

    def equations(self, precision: int = 3) -> list[str]:
        """Right sides of the equations, numbers with this many significant digits."""
        return [rounded(state.equation, precision) for state in self.model.states]

    def estimate(self) -> Estimate:
        """Where every state is at the newest sample."""
        self._check("estimate")
        return Estimate(*self._core.estimate())

    def __copy__(self) -> Online:
        twin = object.__new__(Online)
        twin._states, twin._controls, twin._core = self._states, self._controls, self._core.copy()
        return twin

    def __deepcopy__(self, memo: dict[int, Any]) -> Online:
        return self.__copy__()

    def _check(self, what: str) -> None:
        if self.n_samples < 16:
            raise NotFittedError(f"{what} needs at least 16 samples, found {self.n_samples}; call update first")

    def __repr__(self) -> str:
        names = ", ".join(name for name, _ in [*self._states, *self._controls])
        return f"Online({names}; {self.n_samples} samples)"


def _rows(values: Any, count: int | None, columns: int, what: str) -> Array:
    """One row a sample; one number is one column."""
    array = floats(values, what)
    expected = f"({columns},)" if count is None else f"({count}, {columns})"
    if count is None and columns == 1 and array.ndim == 0:
        array = array[None]
    if count is not None and array.ndim == 1 and (columns == 1 or array.size == 0):
        array = array.reshape(count, columns) if array.size == count * columns else array
    if array.shape != ((columns,) if count is None else (count, columns)):
        raise ValueError(f"{what}: expected shape {expected}, found {array.shape}")
    return contiguous(array[None, :] if count is None else array)
