"""The operators and functions of the expression language, written once more from the contract."""

from __future__ import annotations

import math
import operator


def sign(z):
    return float(z > 0) - float(z < 0)


def clamp(z, low, high):
    return min(max(z, low), high)


def dead_zone(z, width):
    return z - clamp(z, -width, width)


def power(a, b):
    return math.pow(a, b)


CALLS = {
    **{name: getattr(math, name) for name in "sin cos tan asin acos atan sinh cosh tanh exp log sqrt atan2".split()},
    **{"abs": abs, "min": min, "max": max, "sign": sign, "clamp": clamp, "dead_zone": dead_zone},
    "step": lambda z: 1.0 if z > 0 else 0.0,
}
BINARY = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "^": power,
    ">": operator.gt,
    "<": operator.lt,
}
