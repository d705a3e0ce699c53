"""Runs the part of Julia that the package writes, from the syntax tree of tree-sitter's grammar of the whole language.

Numbers are doubles, indices begin with 1, dotted operators act element by element, vectors are shared until copied.
"""

from __future__ import annotations

import bisect
import math

import elementary
import numpy as np
import tree_sitter
import tree_sitter_julia

PARSER = tree_sitter.Parser(tree_sitter.Language(tree_sitter_julia.language()))


class Return(Exception):
    def __init__(self, value):
        super().__init__()
        self.value = value


class Program:
    """The names of a program; `program["simulate"](record)` calls a function of it."""

    def __init__(self, text: str):
        tree = PARSER.parse(text.encode())
        assert not tree.root_node.has_error, f"not Julia: {tree.root_node}"
        self.names = {
            **elementary.CALLS,
            "pi": math.pi,
            "nothing": None,
            "atan": lambda y, x=1.0: math.atan2(y, x),
            "copy": lambda x: x.copy() if isinstance(x, np.ndarray) else list(x),
            "zero": np.zeros_like,
            "length": len,
            "push!": lambda x, value: x.append(value),
            "searchsortedlast": lambda x, value: bisect.bisect_right(list(x), value),
        }
        for name in ("clamp", "dead_zone", "step"):
            del self.names[name]  # They are not Julia's, or not with this meaning.
        self.block(tree.root_node.named_children, self.names)

    def __getitem__(self, name):
        return self.names[name]

    def block(self, nodes, names):
        for node in nodes:
            self.run(node, names)

    def define(self, call, body, names):
        name, listed = call.named_children
        parameters = [(a, None) if a.type == "identifier" else a.named_children[::2] for a in listed.named_children]

        def function(*values):
            assert len(values) <= len(parameters), name.text
            local = dict(names)
            for (parameter, default), value in zip(parameters, [*values, *[None] * len(parameters)]):
                local[text(parameter)] = self.value(default, local) if value is None and default is not None else value
            # Functions see those that are written below them.
            local = Names(local, self.names)
            if isinstance(body, list):
                try:
                    self.block(body, local)
                except Return as done:
                    return done.value
                return None
            return self.value(body, local)

        names[text(name)] = function

    def run(self, node, names):
        parts = node.named_children
        match node.type:
            case "line_comment" | "string_literal":
                pass
            case "const_statement":
                self.block(parts, names)
            case "struct_definition":
                fields = [text(field.named_children[0]) for field in parts[1:]]
                names[text(parts[0])] = lambda *values: dict(zip(fields, values, strict=True))
            case "function_definition":
                self.define(parts[0].named_children[0], parts[1:], names)
            case "assignment" if parts[0].type == "call_expression":
                self.define(parts[0], parts[2], names)
            case "assignment":
                value = self.value(parts[2], names)
                if parts[0].type == "index_expression":
                    self.value(parts[0].named_children[0], names)[self.index(parts[0], names)] = value
                else:
                    names[text(parts[0])] = value
            case "compound_assignment_expression":
                assert text(parts[1]) == ".+="
                target = self.value(parts[0], names)
                target += self.value(parts[2], names)
            case "for_statement":
                variable, _, over = parts[0].named_children
                for value in self.value(over, names):
                    if variable.type == "tuple_expression":
                        names.update({text(v): x for v, x in zip(variable.named_children, value, strict=True)})
                    else:
                        names[text(variable)] = value
                    self.block(parts[1:], names)
            case "return_statement":
                raise Return(self.value(parts[0], names))
            case _:
                self.value(node, names)

    def index(self, node, names):
        (place,) = node.named_children[1].named_children
        place = self.value(place, names)
        assert place >= 1, text(node)
        return place - 1

    def value(self, node, names):
        parts = node.named_children
        match node.type:
            case "identifier":
                return names[text(node)]
            case "float_literal":
                return float(text(node))
            case "integer_literal":
                return int(text(node))
            case "parenthesized_expression":
                return self.value(parts[0], names)
            case "unary_expression":
                assert text(parts[0]) == "-"
                return -self.value(parts[1], names)
            case "binary_expression":
                left, sign, right = parts
                return elementary.BINARY[text(sign).lstrip(".")](self.value(left, names), self.value(right, names))
            case "juxtaposition_expression" if text(parts[1]).startswith("^("):
                # Julia reads 2.0^(-x) as a power, this grammar as a number before a call of `^`.
                (exponent,) = parts[1].named_children[1].named_children
                return elementary.power(self.value(parts[0], names), self.value(exponent, names))
            case "range_expression":
                low, high = (self.value(part, names) for part in parts)
                return range(low, high + 1)
            case "ternary_expression":
                condition, then, otherwise = parts
                return self.value(then if self.value(condition, names) else otherwise, names)
            case "tuple_expression":
                return tuple(self.value(part, names) for part in parts)
            case "vector_expression":
                values = [self.value(part, names) for part in parts]
                return np.array(values, dtype=float) if not values or np.isscalar(values[0]) else values
            case "index_expression":
                return self.value(parts[0], names)[self.index(node, names)]
            case "field_expression":
                return self.value(parts[0], names)[text(parts[1])]
            case "call_expression":
                return names[text(parts[0])](*(self.value(part, names) for part in parts[1].named_children))
        raise AssertionError(f"not a part of Julia that is known here: {node.type} {text(node)}")


class Names(dict):
    """Names of a function above those of the program."""

    def __init__(self, local, program):
        super().__init__(local)
        self.program = program

    def __missing__(self, name):
        return self.program[name]


def text(node) -> str:
    return node.text.decode()
