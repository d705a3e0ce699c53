"""Quartiles and tables as text that reads well on a screen and in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np


def quartiles(values: Iterable[float]) -> tuple[float, float, float]:
    """25 %, 50 % and 75 %; infinite values count, so that a run that diverged is not forgotten."""
    found = np.sort(np.array([np.inf if value is None or np.isnan(value) else value for value in values], dtype=float))
    if not len(found):
        return (np.nan, np.nan, np.nan)
    # Between two values, one of them infinite, the upper one: an interpolation would be NaN.
    low, middle, high = (float(np.quantile(found, q, method="higher")) for q in (0.25, 0.5, 0.75))
    with np.errstate(invalid="ignore"):
        smooth = [float(np.quantile(found, q)) for q in (0.25, 0.5, 0.75)]
    pairs = zip(smooth, (low, middle, high))
    first, second, third = (one if np.isfinite(one) else other for one, other in pairs)
    return (first, second, third)


def number(value: float) -> str:
    """Three digits that count."""
    if not np.isfinite(value):
        return "inf" if value > 0 else "-"
    return f"{value:.3g}" if 1e-3 <= abs(value) < 1e4 or value == 0 else f"{value:.1e}"


def slashed(values: Sequence[float]) -> str:
    """Quartiles in one cell."""
    return " / ".join(number(value) for value in values)


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table whose columns line up."""
    lines = [list(head), *(list(row) for row in rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(head))]
    texts = ["| " + " | ".join(cell.ljust(width) for cell, width in zip(line, widths)) + " |" for line in lines]
    texts.insert(1, "|" + "|".join("-" * (width + 2) for width in widths) + "|")
    return "\n".join(texts) + "\n"
