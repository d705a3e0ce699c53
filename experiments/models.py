"""Coefficients of any tool as a model of the package, so that all are simulated alike."""

from __future__ import annotations

import gpsindy
from library import Array


def model_of(states: list[str], controls: list[str], terms: list[str], coefficients: Array) -> gpsindy.Model:
    """`coefficients`: (n x p)."""
    text = 'schema = "gpsindy.model/1"\nname = "peer"\n'
    for name, row in zip(states, coefficients):
        kept = [f"{float(c):+.17g}*{term}" for c, term in zip(row, terms) if c != 0.0]
        text += f'[[state]]\nname = "{name}"\nequation = "0{"".join(kept)}"\n'
    for name in controls:
        text += f'[[control]]\nname = "{name}"\n'
    return gpsindy.Model.from_toml(text)
