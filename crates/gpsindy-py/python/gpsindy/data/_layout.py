"""States, controls and derivatives as handed to the estimator, as one dataset with their names."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from gpsindy import _gpsindy
from gpsindy.data._tables import Array, Table, names_of, tables, times
from gpsindy.data.dataset import Dataset, inner_dataset, read_csv

RATE = "_dot"


class Layout:
    """Names of the columns of a dataset, by the part that they play."""

    def __init__(self, states: list[str], controls: list[str], derivatives: list[tuple[str, str]]) -> None:
        self.states = states
        self.controls = controls
        self.derivatives = derivatives


def runs_of(x: Any) -> list[Table]:
    paths = x if isinstance(x, (list, tuple)) else [x]
    if paths and all(isinstance(path, (str, os.PathLike)) for path in paths):
        x = read_csv(paths)
    return x._tables() if isinstance(x, Dataset) else tables(x, "x")


def lay_out(
    x: Any, t: Any, x_dot: Any, u: Any, feature_names: Iterable[str] | None
) -> tuple[_gpsindy.Dataset, Layout]:
    found = runs_of(x)
    clock = times(t, found)
    columns = found[0].names
    control_columns: list[str] = []
    inputs: list[Table] = []
    if isinstance(u, str) or (isinstance(u, (list, tuple)) and u and all(isinstance(name, str) for name in u)):
        control_columns = names_of(u)
        if columns is None:
            raise ValueError("u: columns can be named where x has names; hand in arrays here")
    elif u is not None:
        inputs = tables(u, "u")
        check_like(inputs, found, "u")
    rate_columns: dict[str, str] = {}
    rates: list[Table] = []
    if isinstance(x_dot, Mapping) and all(isinstance(name, str) for name in x_dot.values()):
        rate_columns = {str(state): column for state, column in x_dot.items()}
        if columns is None:
            raise ValueError("x_dot: columns can be named where x has names; hand in arrays here")
    elif x_dot is not None:
        rates = tables(x_dot, "x_dot")
        check_like(rates, found, "x_dot")
    if columns is None:
        state_columns = [f"x{i}" for i in range(found[0].values.shape[1])]
    else:
        taken = {*control_columns, *rate_columns.values()}
        for name in sorted(taken):
            if name not in columns:
                argument = "u" if name in control_columns else "x_dot"
                raise ValueError(f"{argument}: no column {name!r} in x; found {', '.join(columns)}")
        state_columns = [name for name in columns if name not in taken]
    blocks = [chosen(table, state_columns, "x") for table in found]
    units = [unit_of(found[0], name) for name in state_columns]
    n_states = len(state_columns)
    if control_columns:
        inputs = [part(table, control_columns) for table in found]
    control_names = control_columns
    if inputs and not control_columns:
        control_names = list(inputs[0].names or (f"u{i}" for i in range(inputs[0].values.shape[1])))
    state_names = state_columns
    if feature_names is not None:
        given = names_of(feature_names)
        if len(given) not in (n_states, n_states + len(control_names)):
            raise ValueError(
                f"feature_names: expected {n_states} names of states"
                + (f" or {n_states + len(control_names)} with those of the controls" if control_names else "")
                + f", found {len(given)}"
            )
        state_names = given[:n_states]
        control_names = given[n_states:] or control_names
    renamed = dict(zip(state_columns, state_names))
    names = [*state_names, *control_names]
    if inputs:
        wanted = control_columns or list(inputs[0].names or control_names)
        units += [unit_of(inputs[0], name) for name in wanted]
        blocks = [np.column_stack([b, chosen(table, wanted, "u")]) for b, table in zip(blocks, inputs)]
    derivatives: list[tuple[str, str]] = []
    if rate_columns:
        for state in rate_columns:
            if state not in renamed:
                raise ValueError(f"x_dot: no state {state!r}; found {', '.join(state_columns)}")
        rates = [part(table, list(rate_columns.values())) for table in found]
        derivatives = [(renamed[state], renamed[state] + RATE) for state in rate_columns]
    elif rates:
        if rates[0].values.shape[1] != n_states:
            raise ValueError(f"x_dot: expected {n_states} columns as in x, found {rates[0].values.shape[1]}")
        derivatives = [(name, name + RATE) for name in state_names]
    if rates:
        blocks = [np.column_stack([b, table.values]) for b, table in zip(blocks, rates)]
        names += [column for _, column in derivatives]
        units += [""] * len(derivatives)
    stacked = [Table(tuple(names), tuple(units), b, None, table.run) for b, table in zip(blocks, found)]
    return inner_dataset(stacked, clock), Layout(list(state_names), list(control_names), derivatives)


def check_like(found: Sequence[Table], x: Sequence[Table], what: str) -> None:
    if len(found) != len(x):
        raise ValueError(f"{what}: expected {len(x)} runs as in x, found {len(found)}")
    for i, (one, other) in enumerate(zip(found, x)):
        if one.n_samples != other.n_samples:
            place = what if len(x) == 1 else f"{what}[{i}]"
            raise ValueError(f"{place}: expected {other.n_samples} samples as in x, found {one.n_samples}")


def chosen(table: Table, names: Sequence[str], what: str) -> Array:
    """The named columns; of a table without names all of them."""
    if table.names is None:
        if table.values.shape[1] != len(names):
            raise ValueError(f"{what}: expected {len(names)} columns ({', '.join(names)}), found {table.values.shape[1]}")
        return table.values
    for name in names:
        if name not in table.names:
            raise ValueError(f"{what}: no column {name!r}; found {', '.join(table.names)}")
    return table.values[:, [table.names.index(name) for name in names]]


def part(table: Table, names: Sequence[str]) -> Table:
    units = tuple(unit_of(table, name) for name in names)
    return Table(tuple(names), units, chosen(table, names, "x"), None, table.run)


def unit_of(table: Table, name: str) -> str:
    return table.units[table.names.index(name)] if table.names is not None and name in table.names else ""
