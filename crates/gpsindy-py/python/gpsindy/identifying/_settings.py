"""Settings of an estimator as scikit-learn reads and changes them."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np

from gpsindy.data._tables import names_of

SettingsOf = TypeVar("SettingsOf", bound="Settings")


class Settings:
    """What the arguments of ``__init__`` set, each an attribute of the same name."""

    @classmethod
    def _parameter_names(cls) -> list[str]:
        return [name for name in inspect.signature(cls.__init__).parameters if name != "self"]

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Settings by name."""
        return {name: getattr(self, name) for name in self._parameter_names()}

    def set_params(self: SettingsOf, **params: Any) -> SettingsOf:
        """Changes settings by name; returns the estimator itself."""
        known = self._parameter_names()
        for name in params:
            if name not in known:
                raise ValueError(f"invalid parameter {name!r}; valid parameters are: {', '.join(known)}")
        for name, value in params.items():
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        defaults = inspect.signature(type(self).__init__).parameters
        changed = [f"{n}={v!r}" for n, v in self.get_params().items() if not _same(v, defaults[n].default)]
        return f"{type(self).__name__}({', '.join(changed)})"


def count(value: Any, name: str) -> int:
    """A whole number of at least 0."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 0:
        raise ValueError(f"{name}: expected an integer of at least 0, found {value!r}")
    return int(value)


def number(value: Any, name: str) -> float:
    """A number, where the word ``auto`` was ruled out before."""
    try:
        return float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected a number or 'auto', found {value!r}") from None


def free_numbers(value: Any) -> list[str]:
    """Free numbers as the command line writes them, from names or from a mapping of names to starts or ranges."""
    if not isinstance(value, Mapping):
        return names_of(value)
    return [name if start is None else f"{name}={_start(name, start)}" for name, start in value.items()]


def _start(name: str, value: Any) -> str:
    if isinstance(value, (tuple, list)) and len(value) == 2:
        return ":".join(_text(end, f"free[{name!r}]") for end in value)
    return _text(value, f"free[{name!r}]")


def sensor_ranges(value: Any) -> list[str]:
    """Ranges of sensors as the command line writes them, from a mapping of states to a lowest and a highest value."""
    found = []
    for name, ends in dict(value or {}).items():
        if not isinstance(ends, (tuple, list)) or len(ends) != 2:
            raise ValueError(f"ranges[{name!r}]: expected a lowest and a highest value, None where there is no end, found {ends!r}")
        low, high = ("" if end is None else _text(end, f"ranges[{name!r}]") for end in ends)
        found.append(f"{name}={low}:{high}")
    return found


def _text(value: Any, name: str) -> str:
    try:
        return repr(float(value))
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected numbers, found {value!r}") from None


def _same(one: Any, other: Any) -> bool:
    return type(one) is type(other) and bool(np.all(one == other))
