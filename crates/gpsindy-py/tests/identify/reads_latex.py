"""Reads the LaTeX that the package writes, as a typesetter's reader would: anything unknown is an error."""

from __future__ import annotations

import math
import re

import elementary

TOKEN = re.compile(r"\\left\.|\\left[(|]|\\right[)|]|\\\\|\\[a-zA-Z]+|\\[,_]|\d+(?:\.\d+)?|[a-zA-Z]|[{}^_,+&=.-]|\s+")
GREEK = set(
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi rho sigma tau upsilon phi chi psi omega"
    .split()
)
FUNCTIONS = {"sin", "cos", "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh", "exp", "min", "max", "ln"}


def tokens(text: str) -> list[str]:
    found, place = [], 0
    while place < len(text):
        match = TOKEN.match(text, place)
        assert match, f"not LaTeX that we know: {text[place:place + 20]!r}"
        place = match.end()
        if not match[0].isspace():
            found.append(match[0])
    return found


class Reader:
    """A value of one expression; `late(read, shift)` is what `read` gives that many seconds earlier."""

    def __init__(self, text, names, late):
        self.tokens, self.place, self.names, self.late = tokens(text), 0, names, late

    def next(self, wanted=None):
        token = self.tokens[self.place] if self.place < len(self.tokens) else ""
        assert wanted is None or token == wanted, f"{wanted} expected, {token!r} found"
        self.place += 1
        return token

    def sees(self, *wanted):
        return tuple(self.tokens[self.place : self.place + len(wanted)]) == wanted

    def sum(self):
        value = self.product()
        while self.sees("+") or self.sees("-"):
            value = value + self.product() if self.next() == "+" else value - self.product()
        return value

    def product(self):
        if self.sees("-"):
            self.next()
            return -self.product()
        value = self.power()
        while self.sees("\\,") or self.sees("\\cdot") or self.sees("\\times"):
            self.next()
            value *= self.power()
        return value

    def power(self):
        base = self.base()
        if self.sees("^"):
            self.next()
            return elementary.power(base, self.group())
        return base

    def group(self):
        self.next("{")
        value = self.sum()
        self.next("}")
        return value

    def list(self):
        self.next("\\left(")
        values = [self.sum()]
        while self.sees(","):
            self.next()
            values.append(self.sum())
        self.next("\\right)")
        return values

    def base(self):
        if self.sees("{"):
            return self.group()
        if self.sees("\\left("):
            (value,) = self.list()
            return value
        token = self.next()
        if token[0].isdigit():
            return float(token)
        if token == "\\left|":
            value = self.sum()
            self.next("\\right|")
            return abs(value)
        if token == "\\left.":
            return self.earlier()
        if token == "\\frac":
            return self.group() / self.group()
        if token == "\\sqrt":
            return math.sqrt(self.group())
        if token == "\\pi":
            return math.pi
        if token == "\\operatorname":
            return self.operator(self.word())
        if token[1:] in FUNCTIONS:
            return elementary.CALLS[token[1:].replace("arc", "a").replace("ln", "log")](*self.list())
        return self.name(token)

    def word(self):
        self.next("{")
        word = ""
        while not self.sees("}"):
            word += self.next().lstrip("\\")
        self.next("}")
        return word

    def operator(self, name):
        return elementary.CALLS[{"sgn": "sign"}.get(name, name)](*self.list())

    def name(self, token):
        name = self.word() if token == "\\mathrm" else token.lstrip("\\")
        assert token == "\\mathrm" or len(token) == 1 or name in GREEK, f"unknown command {token}"
        if self.sees("_"):
            self.next()
            self.next("{")
            while not self.sees("}"):
                part = self.next()
                name += self.word() if part == "\\mathrm" else part.lstrip("\\").replace(",", "")
            self.next("}")
        if self.sees("\\left(", "t", "-"):
            for token in ("\\left(", "t", "-"):
                self.next(token)
            shift = self.product()
            self.next("\\right)")
            return self.late(lambda names: names[name], shift)
        return self.names[name]

    def earlier(self):
        """`. ( expression ) |_{t - shift}`, read again among the names of then."""
        start = self.place
        self.list()
        for token in ("\\right|", "_", "{", "t", "-"):
            self.next(token)
        shift = self.product()
        self.next("}")

        def again(names):
            other = Reader("", names, self.late)
            other.tokens, other.place = self.tokens, start
            (value,) = other.list()
            return value

        return self.late(again, shift)


def lines(text: str) -> list[list[tuple[str, str]]]:
    """Left and right sides, environment by environment."""
    blocks = re.findall(r"\\begin\{align\*\}(.*?)\\end\{align\*\}", text, re.DOTALL)
    return [[tuple(side.strip() for side in line.split("&=")) for line in block.split("\\\\\n")] for block in blocks]
