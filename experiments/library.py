"""Candidate terms, named and ordered as the package does, for the tools that stand beside it."""

from __future__ import annotations

from functools import cache
from itertools import combinations_with_replacement
from types import CodeType

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def terms(variables: list[str], degree: int, products: bool) -> list[str]:
    """Polynomials, sine and cosine, and polynomials up to degree 2 times sine and cosine."""
    by_degree = [[monomial(list(c)) for c in combinations_with_replacement(variables, d)] for d in range(degree + 1)]
    found = [term for level in by_degree for term in level]
    if products:
        found += [f"{wave}({name})" for wave in ("sin", "cos") for name in variables]
        for level in by_degree[1:3]:
            found += [f"{term}*{wave}({name})" for wave in ("sin", "cos") for term in level for name in variables]
    return found


def monomial(factors: list[str]) -> str:
    """`x1^2*x2` of x1, x1, x2."""
    powers = {name: factors.count(name) for name in factors}
    return "*".join(name if power == 1 else f"{name}^{power}" for name, power in powers.items()) or "1"


def evaluate(term: str, values: dict[str, Array]) -> Array:
    """The column of one term."""
    size = len(next(iter(values.values())))
    column = eval(_code(term), {"__builtins__": {}, "sin": np.sin, "cos": np.cos}, values)
    return np.broadcast_to(np.asarray(column, dtype=float), (size,))


@cache
def _code(term: str) -> CodeType:
    return compile(term.replace("^", "**"), term, "eval")
