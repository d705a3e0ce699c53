"""Evaluates the equations of a Modelica model, read by pymoca's parser of the whole language."""

from __future__ import annotations

import elementary
import pymoca.ast as ast
import pymoca.parser


class Reader:
    def __init__(self, text: str):
        *_, self.model = pymoca.parser.parse(text).classes.values()
        symbols = self.model.symbols
        self.parameters = {
            # `= 1.7` is kept as a modification of the symbol's value.
            name: self.value(symbol.class_modification.arguments[0].value.modifications[0], {}, None)
            for name, symbol in symbols.items()
            if "parameter" in symbol.prefixes
        }
        self.inputs = [name for name, symbol in symbols.items() if "input" in symbol.prefixes]
        self.rates, self.others = {}, {}
        for equation in self.model.equations:
            left = equation.left
            if isinstance(left, ast.Expression):
                assert left.operator == "der"
                self.rates[left.operands[0].name] = equation.right
            else:
                self.others[left.name] = equation.right

    def value(self, node, names, late):
        if isinstance(node, ast.Primary):
            return float(node.value)
        if isinstance(node, ast.ComponentRef):
            return names[node.name]
        if isinstance(node, ast.IfExpression):
            (condition,), (then, otherwise) = node.conditions, node.expressions
            return self.value(then if self.value(condition, names, late) else otherwise, names, late)
        assert isinstance(node, ast.Expression), node
        name = str(node.operator.name if isinstance(node.operator, ast.ComponentRef) else node.operator)
        if name == "delay":
            shift = self.value(node.operands[1], names, late)
            return late(lambda then: self.value(node.operands[0], then, late), shift)
        values = [self.value(operand, names, late) for operand in node.operands]
        if name == "-" and len(values) == 1:
            return -values[0]
        return elementary.BINARY[name](*values) if name in elementary.BINARY else elementary.CALLS[name](*values)
