"""The estimator: equations from logs, with the conventions of scikit-learn and the words of PySINDy."""

from __future__ import annotations

import html
import importlib
import re
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from gpsindy import _gpsindy
from gpsindy.data._layout import Layout, chosen, lay_out, runs_of
from gpsindy.data._tables import Array, is_list_of_runs, names_of, readonly, tables
from gpsindy.data.dataset import Dataset
from gpsindy.errors import NotFittedError
from gpsindy.identifying._settings import Settings, count, free_numbers, number, sensor_ranges
from gpsindy.model import Hold, Model, Progress, rounded
from gpsindy.scoring import score

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Kernel = Literal["auto", "se", "matern12", "matern32", "matern52", "periodic", "rq"]
DerivativeMethod = Literal["weak", "given", "difference", "gp-time", "gp-state", "gp-control"]
Regressor = Literal["subset", "lasso", "sqrt-lasso", "stlsq", "ssr-coefficient", "ssr-residual", "least-squares"]

_EQUATION = re.compile(r"\s*(\w+)\s*'\s*=(.*)", re.DOTALL)
_NAME = re.compile(r"[A-Za-z]\w*")


class GPSINDy(Settings):
    """Sparse equations of motion from noisy logs.

    Gaussian processes smooth the states, sparse regression over a library of terms picks the equations, and a refinement
    through the integrator settles coefficients and terms on the raw samples.

    Parameters
    ----------
    degree : int
        Highest degree of the polynomials of the library, 0 to 9.
    library : {"auto", "given"}, optional
        "auto": where the terms named here leave more than the noise, more are tried: sines and cosines and their products,
        ``sign(v)`` and ``v*abs(v)`` of what changes its sign, logarithm, root and reciprocal of what stays positive,
        and rates that saturate, ``x/(h + x)`` and ``x^2/(h^2 + x^2)``, with h estimated (``numbers_``). "given": no other terms.
        Default: "auto", unless ``trig``, ``products`` or ``terms`` names terms.
    trig : bool
        Sine and cosine of every variable.
    products : bool
        Polynomials of degree 1 and 2 times sine and cosine; implies ``trig``.
    terms : sequence of str
        Further terms, such as ``"v*abs(v)"``.
    free : sequence of str, or mapping of str to float, (float, float) or None
        Numbers in ``terms`` and ``fix`` that are estimated, such as ``h`` in ``"x/(h + x)"``: their names, or name to the value that the
        search begins at, to the lowest and highest value that it may have, or to None. Each is in the unit that its place asks for. Left open, it is
        looked for where the logs can show it, by what it is compared with: h in ``"x/(h + x)"`` between a hundredth of the spread of x and a
        hundred times the largest x. Where that is nothing logged, the search begins between 0.01 and 100 and may end anywhere.
    ranges : mapping of str to (float or None, float or None), optional
        Lowest and highest value that the sensor of a state can show, in its unit, None where there is no end. At an end the state is there
        or beyond.
    control_terms : bool
        Whether controls are variables of the library.
    fix : sequence of str
        Equations taken as given, such as ``"x' = v"``. Where no column is called ``v``, its samples are the slope of the
        smoothed ``x``. Numbers to be estimated are named in ``free``.
    hidden : sequence of str
        States that no column carries, each in a given equation of a state that one does: ``h`` in ``"y' = sqrt(h) - b*sqrt(y)"``. Its
        own equation is found, or given, too; where it is given, or the other one is just ``"x' = v"``, the state need not be named here.
    forbid : sequence of str
        Terms that stay out, ``"STATE:TERM"``; the state ``*`` is every state.
    keep : sequence of str
        Terms that are in for certain, such as ``"v:u"``; their coefficients are learnt.
    sign : sequence of str
        Signs of coefficients, ``"STATE:TERM=+"`` or ``"STATE:TERM=-"``.
    smoother : {"gp", None}
        None takes the samples as they are.
    kernel : str
        ``auto``, or as in :func:`gpsindy.smooth`.
    derivative_method : {"weak", "given", "difference", "gp-time", "gp-state", "gp-control"}
        What the regression compares: integrals of the terms with the states, or derivatives found in one of these ways.
        Derivatives handed to ``fit`` are used by ``weak`` and ``given``.
    regressor : {"subset", "lasso", "sqrt-lasso", "stlsq", "ssr-coefficient", "ssr-residual", "least-squares"}
        The sparse regression.
    lam : float or "auto"
        Its tuning value (weight of the 1-norm, threshold or number of terms); ``auto``: chosen by ``select``.
    select : {"cv", "cv-best", "bic", "rollout"}
        How the tuning value is chosen: cross-validation with or without the rule of one standard error, the Bayesian
        information criterion, or the error of rollouts.
    delays : mapping of str to float or "auto", optional
        Delay of a control in s, or ``"auto"`` to estimate it.
    max_delay : float, optional
        Largest delay that ``"auto"`` considers, s. Default: chosen from the sampling and the length of the runs.
    hold : {"zero", "linear"}, optional
        How controls behave between samples. Default: whichever explains the logs better.
    standardize : bool
        Scale columns and target to unit size before the regression.
    train_fraction : float
        Train on this first fraction of each run.
    ensemble : int
        Above 0: inclusion probabilities, from the evidence or, without ``refine``, from so many bootstraps of the regression.
    refine : bool
        Refine coefficients and terms by simulation.
    window : float, optional
        Length of the rollouts, s. Default: as long as they follow the logs.
    consensus : bool
        Where long rollouts leave the logs of a controlled motion: several sets of equations, and of them those that stay nearest
        to the logs and agree best with the others. About four times as long; without effect where ``window`` is given. Default True.
    random_state : int, optional
        Seed of the bootstraps. Default 0; the same seed gives the same result.

    Attributes
    ----------
    model_ : Model
        The equations as a model.
    coef_, standard_errors_ : ndarray of shape (n_states, n_terms)
        Coefficients, and how sure they are.
    inclusion_probabilities_ : ndarray of shape (n_states, n_terms) or None
        How sure it is that a term is in, where ``ensemble`` asks for it.
    n_features_in_, n_control_features_ : int
        Numbers of states and controls.
    feature_names_in_ : ndarray of str
        Names of the states.
    control_names_in_ : ndarray of str
        Names of the controls.
    lam_ : ndarray of shape (n_states,)
        Tuning values of the sparse regression.
    noise_ : ndarray of shape (n_states,)
        Noise of every state's column, in its unit.
    delays_ : dict of str to (float, float)
        Delay of a control and its standard error, s.
    numbers_ : dict of str to (float, float)
        Value of a free number that the equations have, and its standard error.
    hold_ : {"zero", "linear"}
        What the controls were taken to do between samples; simulations and scores do the same.
    report_ : tuple of dict
        How the equation of each state was identified.
    notes_ : tuple of str
        Remarks on the result.
    poor_ : bool
        Whether rollouts predict the logs no better than the mean of each column or a constant state, or, with coefficients fitted to the
        first three quarters, miss the rest by more than its mean; ``fit`` then warns.
    exchangeable_ : tuple of (str, str, str)
        State, a term of its equation, and a term that could stand there as well.

    Examples
    --------
    >>> import numpy as np
    >>> import gpsindy
    >>> t = np.linspace(0, 8, 161)
    >>> x = np.column_stack([np.cos(2 * t), -2 * np.sin(2 * t)])
    >>> x = x + 0.01 * np.random.default_rng(1).standard_normal(x.shape)
    >>> found = gpsindy.GPSINDy(degree=2, fix=["x' = v"]).fit(x, t, feature_names=["x", "v"])
    >>> found.print(precision=2)
    (x)' = v
    (v)' = -4*x

    A rate that saturates, 1.5 x/(0.8 + x) per second, and the number in it:

    >>> t = np.linspace(0, 6, 121)
    >>> x = np.empty(121)
    >>> x[0], step = 3.0, 0.005
    >>> for i in range(120):
    ...     x[i + 1] = x[i]
    ...     for _ in range(10):
    ...         x[i + 1] -= step * 1.5 * x[i + 1] / (0.8 + x[i + 1])
    >>> found = gpsindy.GPSINDy(degree=1, terms=["x/(h + x)"], free={"h": (0.01, 10)}).fit(x[:, None], t, feature_names=["x"])
    >>> value, error = found.numbers_["h"]
    >>> print(f"{value:.1f}")
    0.8
    """

    def __init__(
        self,
        *,
        degree: int = 3,
        library: Literal["auto", "given"] | None = None,
        trig: bool = False,
        products: bool = False,
        terms: Sequence[str] = (),
        free: Sequence[str] | Mapping[str, float | tuple[float, float] | None] = (),
        ranges: Mapping[str, tuple[float | None, float | None]] | None = None,
        control_terms: bool = True,
        fix: Sequence[str] = (),
        hidden: Sequence[str] = (),
        forbid: Sequence[str] = (),
        keep: Sequence[str] = (),
        sign: Sequence[str] = (),
        smoother: Literal["gp"] | None = "gp",
        kernel: Kernel | str = "auto",
        derivative_method: DerivativeMethod = "weak",
        regressor: Regressor = "subset",
        lam: float | Literal["auto"] = "auto",
        select: Literal["cv", "cv-best", "bic", "rollout"] = "cv",
        delays: Mapping[str, float | Literal["auto"]] | None = None,
        max_delay: float | None = None,
        hold: Hold | None = None,
        standardize: bool = False,
        train_fraction: float = 1.0,
        ensemble: int = 0,
        refine: bool = True,
        window: float | None = None,
        consensus: bool = True,
        random_state: int | None = None,
    ) -> None:
        self.degree = degree
        self.library = library
        self.trig = trig
        self.products = products
        self.terms = terms
        self.free = free
        self.ranges = ranges
        self.control_terms = control_terms
        self.fix = fix
        self.hidden = hidden
        self.forbid = forbid
        self.keep = keep
        self.sign = sign
        self.smoother = smoother
        self.kernel = kernel
        self.derivative_method = derivative_method
        self.regressor = regressor
        self.lam = lam
        self.select = select
        self.delays = delays
        self.max_delay = max_delay
        self.hold = hold
        self.standardize = standardize
        self.train_fraction = train_fraction
        self.ensemble = ensemble
        self.refine = refine
        self.window = window
        self.consensus = consensus
        self.random_state = random_state

    @classmethod
    def paper(cls, **params: Any) -> GPSINDy:
        """The paper's Algorithm 1, done right: a second Gaussian process from smoothed states to derivatives, then LASSO.

        No refinement through the integrator. ``params`` change further settings.
        """
        preset = {"derivative_method": "gp-state", "regressor": "lasso", "select": "cv-best", "refine": False}
        return cls(**{**preset, **params})

    def fit(
        self,
        x: Any,
        t: Any = None,
        x_dot: Any = None,
        u: Any = None,
        feature_names: Sequence[str] | None = None,
        *,
        progress: Progress | None = None,
    ) -> GPSINDy:
        """Learns the equations.

        Parameters
        ----------
        x : array, frame, Dataset, paths of CSV files or list of arrays or frames
            States, shape (n_samples, n_states); a list is a list of runs. NaN is a missing value.
        t : float, array or list of arrays, optional
            Times in seconds, or the step between samples. Left out, frames bring a column ``t`` or ``time``.
        x_dot : array or list of arrays, mapping of str to str, optional
            Logged derivatives, laid out like ``x``; or state to the column of ``x`` that carries its derivative.
        u : array or list of arrays, str or sequence of str, optional
            Controls, shape (n_samples, n_controls), a list where ``x`` is one; or the columns of ``x`` that are controls.
        feature_names : sequence of str, optional
            Names of the states, or of the states and then the controls. Default: those of the frame, else ``x0``, ``x1``, ...
            and ``u0``, ...
        progress : callable, optional
            Called with (stage, done, total).

        Returns
        -------
        GPSINDy
            The estimator itself.
        """
        runs, layout = lay_out(x, t, x_dot, u, feature_names)
        model, report = _gpsindy.identify(runs, self._settings(layout), progress)
        self.model_ = Model._of(model)
        record = self.model_.identification
        assert record is not None
        self.coef_ = record.coefficients
        self.standard_errors_ = record.standard_errors
        self.inclusion_probabilities_ = record.inclusion_probabilities
        self.lam_ = record.lam
        self.n_features_in_ = len(layout.states)
        self.n_control_features_ = len(layout.controls)
        self.feature_names_in_ = readonly(np.array(layout.states, dtype=object))
        self.control_names_in_ = readonly(np.array(layout.controls, dtype=object))
        self.noise_ = readonly(np.array([state["noise"] for state in report["states"]]))
        self.delays_ = {control: (delay, error) for control, delay, error in report["delays"]}
        parameters = self.model_.parameters
        self.numbers_ = {one.name: (one.value, np.nan if one.tolerance is None else abs(one.tolerance * one.value)) for one in parameters}
        self.window_ = report["window"]
        self.hold_: Hold = report["hold"]
        self.report_ = tuple(report["states"])
        self.notes_ = tuple(report["notes"])
        self.poor_: bool = report["poor"]
        self.exchangeable_ = tuple(report["exchangeable"])
        if self.poor_:
            warnings.warn(
                "the model predicts its training logs, or the last quarter of them when fitted to the rest, "
                "no better than their mean or a constant state does; "
                "see notes_ and report_, and try other terms or a known equation (fix)",
                stacklevel=2,
            )
        self._terms = record.terms
        return self

    def _unlogged(self, layout: Layout) -> list[str]:
        """States that no column carries: those named so, velocities, and what has a given equation and stands in another one."""
        equations = [match.groups() for match in map(_EQUATION.fullmatch, names_of(self.fix)) if match]
        velocities = [right.strip() for _, right in equations if _NAME.fullmatch(right.strip())]
        both = [left for left, _ in equations if any(left in _NAME.findall(right) for other, right in equations if other != left)]
        numbers = [text.split("=")[0].strip() for text in free_numbers(self.free)]
        taken = {*layout.states, *layout.controls, *numbers}
        return [name for name in dict.fromkeys([*velocities, *both, *names_of(self.hidden)]) if name not in taken]

    def _may_grow(self) -> bool:
        if self.library not in (None, "auto", "given"):
            raise ValueError(f'library: expected "auto", "given" or None, found {self.library!r}')
        names_terms = bool(self.trig or self.products or names_of(self.terms))
        return self.library == "auto" or (self.library is None and not names_terms)

    def _settings(self, layout: Layout) -> dict[str, Any]:
        seed = 0 if self.random_state is None else self.random_state
        if not isinstance(seed, (int, np.integer)) or seed < 0:
            raise ValueError(f"random_state: expected None or an integer of at least 0, found {self.random_state!r}")
        delays = [(name, None if value == "auto" else float(value)) for name, value in dict(self.delays or {}).items()]
        return {
            "states": [*layout.states, *self._unlogged(layout)],
            "controls": layout.controls,
            "derivatives": layout.derivatives,
            "degree": count(self.degree, "degree"),
            "trig": bool(self.trig),
            "grow": self._may_grow(),
            "products": bool(self.products),
            "terms": names_of(self.terms),
            "free": free_numbers(self.free),
            "ranges": sensor_ranges(self.ranges),
            "control_terms": bool(self.control_terms),
            "fix": names_of(self.fix),
            "forbid": names_of(self.forbid),
            "keep": names_of(self.keep),
            "sign": names_of(self.sign),
            "smoother": self.smoother,
            "kernel": self.kernel,
            "derivative_method": self.derivative_method,
            "regressor": self.regressor,
            "lambda_": None if isinstance(self.lam, str) and self.lam == "auto" else number(self.lam, "lam"),
            "select": self.select,
            "delays": delays,
            "max_delay": None if self.max_delay is None else number(self.max_delay, "max_delay"),
            "hold": self.hold,
            "standardize": bool(self.standardize),
            "train_fraction": float(self.train_fraction),
            "ensemble": count(self.ensemble, "ensemble"),
            "refine": bool(self.refine),
            "window": None if self.window is None else float(self.window),
            "consensus": bool(self.consensus),
            "seed": int(seed),
        }

    def coefficients(self) -> Array:
        """Coefficients, shape (n_states, n_terms)."""
        self._check_fitted("coefficients")
        return self.coef_

    def get_feature_names_out(self, input_features: Any = None) -> Array:
        """Names of the terms, as scikit-learn asks for them; ``input_features`` is not used."""
        self._check_fitted("get_feature_names_out")
        return np.array(self._terms, dtype=object)

    def get_feature_names(self) -> list[str]:
        """Names of the terms, in the order of the columns of ``coef_``."""
        self._check_fitted("get_feature_names")
        return list(self._terms)

    def equations(self, precision: int = 3) -> list[str]:
        """Right sides of the equations, numbers with this many significant digits."""
        self._check_fitted("equations")
        return [rounded(state.equation, precision) for state in self.model_.states]

    def print(self, lhs: Sequence[str] | None = None, precision: int = 3) -> None:
        """Prints the equations; ``lhs`` replaces the left sides."""
        right = self.equations(precision)
        left = [f"({state.name})'" for state in self.model_.states] if lhs is None else list(lhs)
        if len(left) != len(right):
            raise ValueError(f"lhs: expected {len(right)} left sides, found {len(left)}")
        for one, other in zip(left, right):
            print(f"{one} = {other}")

    @property
    def complexity(self) -> int:
        """Number of terms in all equations."""
        self._check_fitted("complexity")
        return int(np.count_nonzero(self.coef_))

    def predict(self, x: Any, u: Any = None) -> Any:
        """Rates of the states at every sample; a list for a list of runs.

        A delayed control is read as it is in its row.
        """
        self._check_fitted("predict")
        states, controls = self._features(x, u)
        rates = [self.model_.derivative(rows, inputs) for rows, inputs in zip(states, controls)]
        return rates if isinstance(x, Dataset) or is_list_of_runs(x) else rates[0]

    def simulate(self, x0: Any, t: Any, u: Any = None) -> Array:
        """States at the times ``t`` from ``x0`` at ``t[0]``, shape (n_samples, n_states); see :meth:`Model.simulate`."""
        self._check_fitted("simulate")
        return self.model_.simulate(x0, t, u, hold=self.hold_).x

    def score(
        self,
        x: Any,
        t: Any = None,
        u: Any = None,
        *,
        kind: Literal["rollout", "windowed", "one_step"] = "windowed",
        window: float | None = None,
    ) -> float:
        """Share of the variance that predictions explain: 1 is perfect, 0 as good as the mean, below 0 worse.

        Parameters
        ----------
        x, t, u
            As in :meth:`fit`.
        kind : {"rollout", "windowed", "one_step"}
            Predictions over whole runs, over windows each started from the log, or to the next sample.
        window : float, optional
            Length of the windows, s. Default: a tenth of each run.
        """
        self._check_fitted("score")
        if kind not in ("rollout", "windowed", "one_step"):
            raise ValueError(f"kind: expected 'rollout', 'windowed' or 'one_step', found {kind!r}")
        found = score(self.model_, self._logs(x, t, u), window=window, hold=self.hold_)
        return 1.0 - float(getattr(found, kind).pooled) ** 2

    def plot(self, x: Any, t: Any = None, u: Any = None, **options: Any) -> Figure:
        """Rollouts and logs; see :func:`gpsindy.plot.rollouts`. Needs matplotlib."""
        self._check_fitted("plot")
        return self.model_.plot(self._logs(x, t, u), **{"hold": self.hold_, **options})

    def _logs(self, x: Any, t: Any, u: Any) -> Dataset:
        names = None
        if runs_of(x)[0].names is None:
            names = [*self.feature_names_in_, *self.control_names_in_]
        if u is None and names is None and len(self.control_names_in_):
            u = list(self.control_names_in_)
        runs, _ = lay_out(x, t, None, u, names)
        return Dataset._of(runs)

    def _features(self, x: Any, u: Any) -> tuple[list[Array], list[Array | None]]:
        found = runs_of(x)
        wanted = [state.name for state in self.model_.states]
        states = [chosen(table, wanted, "x") for table in found]
        names = list(self.control_names_in_)
        if not names:
            return states, [None] * len(found)
        if u is None or isinstance(u, str) or (isinstance(u, (list, tuple)) and all(isinstance(n, str) for n in u)):
            if any(table.names is None for table in found):
                raise ValueError(f"u: the model has the controls {', '.join(names)}; hand in their samples")
            return states, [chosen(table, names, "x") for table in found]
        inputs = [chosen(table, names, "u") for table in tables(u, "u")]
        if len(inputs) != len(states):
            raise ValueError(f"u: expected {len(states)} runs as in x, found {len(inputs)}")
        return states, list(inputs)

    def _check_fitted(self, what: str) -> None:
        if not hasattr(self, "model_"):
            raise NotFittedError(f"{what} needs a fitted estimator; call fit first")

    def __sklearn_tags__(self) -> Any:
        # Asked by scikit-learn alone, so it is there.
        utils = importlib.import_module("sklearn.utils")
        return utils.Tags(estimator_type=None, target_tags=utils.TargetTags(required=False))

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "model_")

    def _repr_html_(self) -> str:
        """The settings and, once fitted, the equations, as a notebook shows them."""
        head = f"<code>{html.escape(repr(self))}</code>"
        return head + self.model_._repr_html_() if hasattr(self, "model_") else head

    def _repr_latex_(self) -> str | None:
        """The equations, once fitted."""
        return self.model_._repr_latex_() if hasattr(self, "model_") else None
