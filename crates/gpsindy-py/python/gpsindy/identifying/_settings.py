"""Settings of an estimator as scikit-learn reads and changes them."""

from __future__ import annotations

import inspect
from typing import Any, TypeVar

import numpy as np

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


def _same(one: Any, other: Any) -> bool:
    return type(one) is type(other) and bool(np.all(one == other))
