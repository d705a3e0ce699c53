"""The pictures, like the paper's figures in kind."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

from library import Array  # noqa: E402
from tables import quartiles  # noqa: E402

Result = dict[str, Any]
plt.rcParams.update({"svg.hashsalt": "gpsindy", "axes.spines.top": False, "axes.spines.right": False, "font.size": 9})
MARKS = "osD^v<>pPX*hd8"


def save(figure: Any, path: Path) -> None:
    """Writes a picture without the date, so that the same results give the same file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None, bbox_inches="tight")
    plt.close(figure)


def curves(axes: Any, group: Sequence[Result], methods: Sequence[str], value: str) -> None:
    """Median over the noise with the quartiles as a ribbon, one curve a method; what is not finite is left open."""
    for k, method in enumerate(methods):
        rows = [entry for entry in group if entry["job"]["method"] == method]
        sigmas = sorted({entry["job"]["sigma"] for entry in rows})
        triples = [quartiles(_values((e for e in rows if e["job"]["sigma"] == s), value)) for s in sigmas]
        low, middle, high = np.array(triples).reshape(-1, 3).T  # An empty curve still stands in the legend.
        high = np.where(np.isfinite(high), high, 1e12)
        shade = plt.get_cmap("tab20")(k % 20)
        shown = np.where(np.isfinite(middle), middle, np.nan)
        axes.plot(sigmas, shown, color=shade, marker=MARKS[k % len(MARKS)], markersize=4, linewidth=1.3, label=method)
        if len(sigmas) > 1:
            axes.fill_between(sigmas, low, high, color=shade, alpha=0.12, linewidth=0)
    axes.set_yscale("log")
    axes.set_xlabel("noise, standard deviation")


def _methods(results: Sequence[Result]) -> list[str]:
    return list(dict.fromkeys(entry["job"]["method"] for entry in results))


def _values(entries: Iterable[Result], value: str) -> list[float]:
    return [np.inf if "error" in entry or entry.get("diverged") else float(entry[value]) for entry in entries]


def coefficients(results: Sequence[Result], path: Path) -> None:
    """One panel a system and regime."""
    panels = list(dict.fromkeys((e["job"]["regime"], e["job"]["system"]) for e in results))
    figure, axes = plt.subplots(1, len(panels), figsize=(3.6 * len(panels), 3.4), squeeze=False, layout="constrained")
    for one, (regime, system) in zip(axes[0], panels):
        group = [e for e in results if (e["job"]["regime"], e["job"]["system"]) == (regime, system)]
        curves(one, group, _methods(results), "mse")
        one.set_title(f"{system}, {regime}")
        values = [v for v in _values(group, "mse") if np.isfinite(v) and v > 0]
        if values:
            one.set_ylim(0.5 * min(values), min(10.0, 3.0 * max(values)))
    axes[0][0].set_ylabel("mean squared coefficient error")
    axes[0][-1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    save(figure, path)


def car(results: Sequence[Result], path: Path) -> None:
    """Above the authors' number, below the error of the position; one column a rate."""
    rates = sorted({e["job"]["rate"] for e in results})
    figure, axes = plt.subplots(
        2, len(rates), figsize=(3.4 * len(rates), 5.6), squeeze=False, sharey="row", layout="constrained"
    )
    limits = (("author", 300.0), ("position", 20.0))
    for column, rate in enumerate(rates):
        group = [e for e in results if e["job"]["rate"] == rate]
        for row, (value, _) in enumerate(limits):
            curves(axes[row][column], group, _methods(results), value)
        axes[0][column].set_title(f"{rate} Hz")
        axes[0][column].set_xlabel("")
    for row, (value, top) in enumerate(limits):
        axes[row][0].set_ylim(0.7 * min((v for v in _values(results, value) if v > 0), default=0.1), top)
    axes[0][0].set_ylabel("authors' number")
    axes[1][0].set_ylabel("position error, rms, m")
    axes[0][-1].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    save(figure, path)


def trajectories(clean: Array, paths: dict[str, Array], path: Path) -> None:
    """Positions of one rollout by several methods over the logged ones."""
    n_columns = min(3, len(paths))
    n_rows = -(-len(paths) // n_columns)
    figure, axes = plt.subplots(
        n_rows, n_columns, figsize=(3.1 * n_columns, 3.0 * n_rows), squeeze=False, layout="constrained"
    )
    reach = np.abs(clean[:, :2]).max() * 1.5
    for one in axes.flat[len(paths) :]:
        one.set_visible(False)
    for one, (name, found) in zip(axes.flat, paths.items()):
        one.plot(clean[:, 0], clean[:, 1], color="0.6", linewidth=3, label="log")
        one.plot(found[:, 0], found[:, 1], color="tab:blue", linewidth=1.2, label=name)
        one.plot(*clean[0, :2], "ko", markersize=3)
        one.set(title=name, xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes[-1][0].set_xlabel("x, m")
    axes[-1][0].set_ylabel("y, m")
    save(figure, path)
