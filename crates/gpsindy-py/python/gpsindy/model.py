"""Models: named ordinary differential equations from files, from text, or around a Python simulator."""

from __future__ import annotations

import html
import os
import re
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from gpsindy import _gpsindy
from gpsindy.data._tables import Array, contiguous, floats, frame, matrix, readonly
from gpsindy.data.dataset import Path
from gpsindy.parts import Control, Identification, Parameter, Port, State
from gpsindy.scoring import Score, score
from gpsindy.simulation import Rollout

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Hold = Literal["zero", "linear"]
Target = Literal["latex", "sympy", "python", "c", "rust", "julia", "modelica"]
Method = Literal["auto", "rosenbrock", "rk4", "euler"]
Simulator = Callable[[float, Array, Array], Any]
Progress = Callable[[str, int, int], object]

_NUMBER = re.compile(r"(?<![A-Za-z_0-9.])(\d+\.?\d*(?:[eE][-+]?\d+)?)")


class Model:
    """Ordinary differential equations with named states, controls and parameters.

    Made by :meth:`load`, :meth:`from_toml`, :meth:`from_callable`, or learnt by :class:`GPSINDy`.

    Examples
    --------
    >>> import gpsindy
    >>> cart = gpsindy.Model.from_toml('''
    ... schema = "gpsindy.model/1"
    ... name = "cart"
    ... [[state]]
    ... name = "v"
    ... equation = "(u - b*v)/1.5"
    ... [[control]]
    ... name = "u"
    ... [[parameter]]
    ... name = "b"
    ... value = 0.3
    ... ''')
    >>> cart
    Model 'cart': v' = (u - b*v)/1.5
    >>> run = cart.simulate({"v": 0.0}, [0.0, 1.0, 2.0], u=[3.0, 3.0, 3.0])
    >>> run["v"].round(4)
    array([0.    , 1.8127, 3.2968])
    """

    __slots__ = ("_inner", "_source")
    _inner: _gpsindy.Model
    _source: Any

    def __init__(self) -> None:
        raise TypeError("a model is made by Model.load, Model.from_toml, Model.from_json or Model.from_callable")

    @classmethod
    def _of(cls, inner: _gpsindy.Model, source: Any = None) -> Model:
        model = cls.__new__(cls)
        model._inner = inner
        model._source = source
        return model

    @classmethod
    def load(cls, path: Path) -> Model:
        """Reads a model file (TOML, or JSON where the name ends in ``.json``)."""
        return cls._of(_gpsindy.Model.read(os.fspath(path)))

    @classmethod
    def from_toml(cls, text: str) -> Model:
        """Reads the text of a model file."""
        return cls._of(_gpsindy.Model.parse("model.toml", text))

    @classmethod
    def from_json(cls, text: str) -> Model:
        """Reads the text of a model file in JSON."""
        return cls._of(_gpsindy.Model.parse("model.json", text))

    @classmethod
    def from_callable(
        cls,
        simulator: Simulator,
        states: Sequence[str],
        controls: Sequence[str] = (),
        *,
        kinematic: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        initial: Mapping[str, float] | None = None,
        vectorized: bool = False,
        name: str = "simulator",
    ) -> Model:
        """A model whose rates come from Python code.

        Parameters
        ----------
        simulator : callable
            ``f(t, x, u)`` returns the rates of the states (n,) at time ``t`` in s, states ``x`` (n,) and controls ``u`` (m,).
            It is called by one thread at a time. What it raises is passed on unchanged.
        states, controls : sequence of str
            Names, in the order of ``x`` and ``u``.
        kinematic : mapping of str to str, optional
            ``{"x": "v"}`` says that state ``v`` is the time derivative of state ``x``. With it, ``v`` may be missing in logs.
        units : mapping of str to str, optional
            Units of states and controls.
        initial : mapping of str to float, optional
            Default initial state.
        vectorized : bool
            The callable takes many samples at once: ``t`` (n,), ``x`` (n, n_states), ``u`` (n, n_controls) to rates
            (n, n_states). Several times faster where it is numpy code.
        name : str, optional

        Examples
        --------
        >>> import gpsindy
        >>> model = gpsindy.Model.from_callable(lambda t, x, u: [-2 * x[0]], ["x"])
        >>> model.simulate([1.0], [0.0, 1.0]).x[-1].round(4)
        array([0.1353])
        """
        if not callable(simulator):
            raise ValueError(f"simulator: expected a callable f(t, x, u), found {type(simulator).__name__}")
        unit = dict(units or {})
        return cls._of(
            _gpsindy.Model.from_callable(
                simulator,
                name,
                [(state, unit.get(state, "")) for state in states],
                [(control, unit.get(control, "")) for control in controls],
                list((kinematic or {}).items()),
                [(state, float(value)) for state, value in (initial or {}).items()],
                bool(vectorized),
            )
        )

    @property
    def name(self) -> str:
        """The model's name."""
        return self._inner.name

    @property
    def states(self) -> tuple[State, ...]:
        """The states, in order."""
        return tuple(State(*entry) for entry in self._inner.states)

    @property
    def controls(self) -> tuple[Control, ...]:
        """The controls, in order."""
        return tuple(Control(*entry) for entry in self._inner.controls)

    @property
    def ports(self) -> tuple[Port, ...]:
        """The ports, in order."""
        return tuple(Port(*entry) for entry in self._inner.ports)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters, in order."""
        return tuple(Parameter(*entry) for entry in self._inner.parameters)

    @property
    def initial(self) -> dict[str, float]:
        """Default initial state, by name."""
        return dict(self._inner.initial)

    @property
    def hold(self) -> Hold:
        """What controls do between samples by default: what the model was identified with, else "zero"."""
        return "linear" if self._inner.hold == "linear" else "zero"

    @property
    def identification(self) -> Identification | None:
        """How the model was learnt, where it was."""
        record = self._inner.identification
        if record is None:
            return None
        terms, coefficients, errors, inclusion, lam = record
        return Identification(
            tuple(terms), coefficients, errors, inclusion if len(inclusion) else None, readonly(np.array(lam))
        )

    def with_parameters(self, **values: float) -> Model:
        """The same model with other values of some parameters."""
        pairs = [(name, float(value)) for name, value in values.items()]
        return Model._of(self._inner.with_parameters(pairs), self._source)

    def to_toml(self) -> str:
        """The text of a model file."""
        return self._inner.to_toml()

    def to_json(self) -> str:
        """The text of a model file in JSON."""
        return self._inner.to_json()

    def save(self, path: Path) -> None:
        """Writes a model file, as JSON where the name ends in ``.json``, else as TOML; whole or not at all.

        A model around a simulator with a file of its own is written in that format, corrections included:
        ``diagnosis.augmented.save("augmented.xml")``.
        """
        if self._source is not None:
            self._source._save_corrected(self, path)
            return
        self._inner.write(os.fspath(path))

    def export(self, to: Target, *, full_digits: bool = False) -> str:
        """The equations as source.

        Parameters
        ----------
        to : {"latex", "sympy", "python", "c", "rust", "julia", "modelica"}
        full_digits : bool, default False
            In LaTeX, numbers with all their digits; without it six. Programs always have all.

        Examples
        --------
        >>> import gpsindy
        >>> model = gpsindy.Model.from_json('{"state": [{"name": "x", "equation": "-2*x"}]}')
        >>> "dot{x}" in model.export("latex")
        True
        """
        return self._inner.export(to, full_digits)

    def derivative(self, x: Any, u: Any = None, t: Any = 0.0) -> Array:
        """Rates of the states, row by row; ``delay`` and ``play`` read the control as it is in that row.

        Parameters
        ----------
        x : array of shape (n_samples, n_states)
        u : array of shape (n_samples, n_controls), optional
        t : float or array of shape (n_samples,), optional
            Time, s.

        Returns
        -------
        ndarray of shape (n_samples, n_states)
        """
        rows = self._columns(x, [state.name for state in self.states], "x")
        controls = self._controls(u, len(rows))
        time = np.ascontiguousarray(np.broadcast_to(floats(t, "t"), (len(rows),)))
        return self._inner.derivative(time, rows, controls)

    def simulate(
        self,
        x0: Any,
        t: Any,
        u: Any = None,
        *,
        hold: Hold | None = None,
        method: Method = "auto",
        tolerance: float = 1e-8,
    ) -> Rollout:
        """A rollout from ``x0`` at ``t[0]``.

        Parameters
        ----------
        x0 : sequence of float, mapping of str to float, or None
            Initial state; states that a mapping lacks start from the model's own ``initial``.
        t : array of shape (n_samples,)
            Increasing times, s.
        u : array of shape (n_samples, n_controls), mapping or frame, optional
            Controls at the times ``t``.
        hold : {"zero", "linear"}, optional
            What controls do between samples. Default: what the model was identified with, else "zero".
        method : {"auto", "rosenbrock", "rk4", "euler"}
            ``auto`` has step control and goes over to an implicit method where the model is stiff; the last two make one step
            between samples.
        tolerance : float
            Error allowed in a step, relative to the size of the state.

        Raises
        ------
        NumericalError
            The trajectory diverges, or steps become too small.
        """
        time = _increasing(t)
        initial = self._initial(x0)
        controls = self._controls(u, len(time))
        x, y = self._inner.simulate(initial, time, controls, (hold or self.hold, method, tolerance))
        return Rollout(self.name, readonly(time), x, y, tuple(state.name for state in self.states))

    def score(
        self, logs: Any, *, window: float | None = None, hold: Hold | None = None, progress: Progress | None = None
    ) -> Score:
        """Errors of predictions on logs; see :func:`gpsindy.score`."""
        return score(self, logs, window=window, hold=hold, progress=progress)

    def plot(self, logs: Any, **options: Any) -> Figure:
        """Rollouts and logs; see :func:`gpsindy.plot.rollouts`. Needs matplotlib."""
        from gpsindy import plot

        return plot.rollouts(self, logs, **options)

    def _initial(self, x0: Any) -> list[float]:
        names = [state.name for state in self.states]
        if x0 is not None and not isinstance(x0, Mapping):
            values = floats(x0, "x0")
            if values.shape != (len(names),):
                raise ValueError(f"x0: expected {len(names)} values ({', '.join(names)}), found shape {values.shape}")
            return [float(value) for value in values]
        known = {**self.initial, **dict(x0 or {})}
        for name in known:
            if name not in names:
                raise ValueError(f"x0: no state {name!r}; found {', '.join(names)}")
        missing = [name for name in names if name not in known]
        if missing:
            raise ValueError(f"x0: no value for {', '.join(missing)}; hand in one a state")
        return [float(known[name]) for name in names]

    def _controls(self, u: Any, n_samples: int) -> Array:
        names = [control.name for control in self.controls]
        if u is None:
            if names:
                raise ValueError(f"u: the model has the controls {', '.join(names)}; hand in their samples")
            return np.zeros((n_samples, 0))
        values = self._columns(u, names, "u")
        if len(values) != n_samples:
            raise ValueError(f"u: expected {n_samples} samples, found {len(values)}")
        return values

    @staticmethod
    def _columns(data: Any, names: list[str], what: str) -> Array:
        columns = frame(data)
        if columns is not None:
            for name in names:
                if name not in columns.headers:
                    raise ValueError(f"{what}: no column {name!r}; found {', '.join(columns.headers)}")
            return contiguous(np.column_stack([columns.numbers(name) for name in names]))
        values = matrix(data, what)
        if values.shape[1] != len(names):
            raise ValueError(f"{what}: expected {len(names)} columns ({', '.join(names)}), found {values.shape[1]}")
        return contiguous(values)

    def __reduce__(self) -> tuple[Any, ...]:
        return (Model.from_json, (self.to_json(),))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Model):
            return NotImplemented
        if self._inner.calls_simulator or other._inner.calls_simulator:
            return self._inner is other._inner
        return self.to_json() == other.to_json()

    def __hash__(self) -> int:
        return hash((self.name, self.states, self.controls, self.parameters))

    def _repr_latex_(self) -> str:
        """The equations as a notebook shows them, with four significant digits."""
        lines = self.export("latex").splitlines()
        body = "\n".join(line for line in lines if not line.startswith(("%", "\\begin", "\\end")))
        return "$$\\begin{aligned}\n" + rounded(body, 4) + "\n\\end{aligned}$$"

    def _repr_html_(self) -> str:
        """The equations as a table for a notebook, with four significant digits."""
        cell = '<td style="text-align:left">{}</td>'.format
        rows = (
            f"<tr>{cell(html.escape(state.name) + '&prime;')}{cell('= ' + html.escape(rounded(state.equation, 4)))}"
            f"{cell(html.escape(state.unit))}</tr>"
            for state in self.states
        )
        head = f"<caption>{html.escape(self.name)}</caption>" if self.name else ""
        return f"<table>{head}{''.join(rows)}</table>"

    def __repr__(self) -> str:
        equations = "; ".join(f"{state.name}' = {rounded(state.equation, 4)}" for state in self.states)
        return f"Model {self.name!r}: {equations}" if self.name else f"Model: {equations}"


def rounded(text: str, precision: int) -> str:
    """The text with its numbers at this many significant digits."""
    return _NUMBER.sub(lambda found: f"{float(found.group()):.{max(1, precision)}g}", text)


def as_model(model: Any) -> Model:
    """A model as it is, a path as a model file, a fitted estimator as what it learnt."""
    if isinstance(model, (str, os.PathLike)):
        return Model.load(model)
    if hasattr(model, "_as_model"):
        return model._as_model()  # type: ignore[no-any-return]
    found = getattr(model, "model_", model)
    if not isinstance(found, Model):
        raise ValueError(f"model: expected a Model, a model file or a fitted estimator, found {type(model).__name__}")
    return found


def _increasing(t: Any) -> Array:
    time = np.array(floats(t, "t"), dtype=np.float64)
    if time.ndim != 1 or len(time) == 0:
        raise ValueError(f"t: expected the times of the samples, one dimension, found shape {time.shape}")
    if not bool(np.all(np.isfinite(time))) or not bool(np.all(np.diff(time) > 0)):
        raise ValueError("t: times must be finite and increase")
    return time
