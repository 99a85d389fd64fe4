"""Arithmetic as OpenFOAM's ``#eval`` and ``exprFixedValue`` have it, read by a grammar of its own.

    sum     = product { ("+" | "-") product }
    product = signed { ("*" | "/") signed }
    signed  = { "+" | "-" } value
    value   = number | $name | name "(" [ sum { "," sum } ] ")" | "pos().x()" | "(" sum ")"

The text is read into a tree, which is either evaluated here (`evaluate`) or written anew for the solver
(`written`). Nothing else of the text is kept.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass

from ellipsoid_coupling.files.limits import MOST_NESTING

# By the number of arguments; each means the same in OpenFOAM's #eval and on a patch.
_ONE: dict[str, Callable[[float], float]] = {
    "sqr": lambda x: x * x, "sqrt": math.sqrt, "exp": math.exp, "log": math.log,
    "log10": math.log10, "sin": math.sin, "cos": math.cos, "tan": math.tan, "asin": math.asin,
    "acos": math.acos, "atan": math.atan, "sinh": math.sinh, "cosh": math.cosh, "tanh": math.tanh,
    "mag": abs,
}  # fmt: skip
_TWO: dict[str, Callable[[float, float], float]] = {"pow": math.pow, "min": min, "max": max}
_SIGNS: dict[str, Callable[[float, float], float]] = {
    "+": lambda a, b: a + b, "-": lambda a, b: a - b, "*": lambda a, b: a * b, "/": lambda a, b: a / b,
}  # fmt: skip
_ARGUMENTS = {**dict.fromkeys(_ONE, 1), **dict.fromkeys(_TWO, 2), "pi": 0, "vector": 3}
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)|(?P<place>pos\(\)\.[xyz]\(\))"
    r"|\$(?P<variable>[A-Za-z]\w*)|(?P<name>[A-Za-z]\w*)|(?P<sign>[-+*/(),]))",
    re.ASCII,
)
_LONGEST = 1_000
# A tree is worked out by recursion: each sign may be one level of it.
_MOST_SIGNS = 200


class ExpressionError(ValueError):
    """A fault in an expression, with its message."""


@dataclass(frozen=True)
class Tree:
    """A number (no parts), a place pos().x(), or a function or sign `what` of its `parts`."""

    what: str
    parts: tuple[Tree, ...] = ()
    number: float = 0.0


Variables = Callable[[str], float | None]


def no_variables(_name: str) -> float | None:
    """For expressions in which ``$name`` means nothing."""
    return None


def parse(text: str, variables: Variables = no_variables) -> Tree:
    """The tree of an expression; `variables` gives the number that a ``$name`` means, if any.

    Raises ExpressionError for anything that the grammar above does not have.
    """
    if len(text) > _LONGEST:
        raise ExpressionError(f"an expression of more than {_LONGEST} characters")
    tokens: list[tuple[str, str]] = []
    at, end = 0, len(text.rstrip())
    while at < end:
        match = _TOKEN.match(text, at)
        if match is None or match.lastgroup is None:
            raise ExpressionError(f"{text[at:].strip()[:20]!r} in an expression")
        tokens.append((match.lastgroup, match[match.lastgroup]))
        at = match.end()
    if sum(text in _SIGNS for _, text in tokens) > _MOST_SIGNS:
        raise ExpressionError(f"an expression of more than {_MOST_SIGNS} signs")
    return _Reading([*tokens, ("end", "its end")], variables).whole()


class _Reading:
    """Reads the tokens from the left; each method reads one rule of the grammar."""

    def __init__(self, tokens: list[tuple[str, str]], variables: Variables) -> None:
        self._tokens, self._variables, self._at, self._depth = tokens, variables, 0, 0

    def whole(self) -> Tree:
        tree = self._sum()
        if self._tokens[self._at][0] != "end":
            raise self._odd()
        return tree

    def _odd(self) -> ExpressionError:
        return ExpressionError(f"{self._tokens[self._at][1]!r} out of place in an expression")

    def _taken(self, *texts: str) -> str | None:
        """The next token if it is one of these signs, which then is read."""
        kind, text = self._tokens[self._at]
        if kind != "sign" or text not in texts:
            return None
        self._at += 1
        return text

    def _need(self, text: str) -> None:
        if self._taken(text) is None:
            raise self._odd()

    def _sum(self) -> Tree:
        self._depth += 1
        if self._depth > MOST_NESTING:
            raise ExpressionError(f"parts nested more than {MOST_NESTING} deep")
        tree = self._product()
        while (sign := self._taken("+", "-")) is not None:
            tree = Tree(sign, (tree, self._product()))
        self._depth -= 1
        return tree

    def _product(self) -> Tree:
        tree = self._signed()
        while (sign := self._taken("*", "/")) is not None:
            tree = Tree(sign, (tree, self._signed()))
        return tree

    def _signed(self) -> Tree:
        negative = False
        while (sign := self._taken("+", "-")) is not None:
            negative ^= sign == "-"
        value = self._value()
        return Tree("-", (Tree("number"), value)) if negative else value

    def _value(self) -> Tree:
        if self._taken("("):
            tree = self._sum()
            self._need(")")
            return tree
        kind, text = self._tokens[self._at]
        self._at += 1
        if kind == "number":
            if not math.isfinite(float(text)):
                raise ExpressionError(f"the number {text[:20]}, which is out of range")
            return Tree("number", number=float(text))
        if kind == "place":
            return Tree(text)
        if kind == "variable":
            known = self._variables(text)
            if known is None:
                raise ExpressionError(f"${text}, where no number {text} stands before")
            return Tree("number", number=known)
        if kind == "name" and text in _ARGUMENTS:
            return self._call(text)
        self._at -= 1
        raise self._odd()

    def _call(self, name: str) -> Tree:
        self._need("(")
        parts: list[Tree] = []
        while len(parts) < _ARGUMENTS[name]:
            if parts:
                self._need(",")
            parts.append(self._sum())
        self._need(")")
        return Tree(name, tuple(parts))


def evaluate(tree: Tree) -> float:
    """The number that a tree of numbers is; ExpressionError where it is none, or not finite."""
    try:
        value = _value_of(tree)
    except (ValueError, OverflowError, ZeroDivisionError) as error:
        raise ExpressionError(f"an expression that is no number ({error})") from None
    if not math.isfinite(value):
        raise ExpressionError("an expression that is not finite")
    return value


def _value_of(tree: Tree) -> float:
    parts = [_value_of(part) for part in tree.parts]
    if tree.what == "number":
        return tree.number
    if tree.what == "pi":
        return math.pi
    if len(parts) == 1:
        return _ONE[tree.what](*parts)
    two = _SIGNS.get(tree.what) or _TWO.get(tree.what)
    if two is None:
        raise ExpressionError(f"{tree.what}, which is no number")
    return two(*parts)


def written(tree: Tree) -> str:
    """A tree as text for the solver: ``vector(-pos().y(),0,0)`` is vector((0-pos().y()),0,0)."""
    if tree.what == "number":
        return repr(tree.number) if tree.number % 1 else f"{tree.number:.17g}"
    parts = [written(part) for part in tree.parts]
    if tree.what in _SIGNS:
        return f"({parts[0]}{tree.what}{parts[1]})"
    return f"{tree.what}({','.join(parts)})" if tree.what in _ARGUMENTS else tree.what


def is_vector(tree: Tree) -> bool:
    """Whether a tree is vector(a, b, c) of three numbers that may depend on the place."""

    def scalar(part: Tree) -> bool:
        return part.what != "vector" and all(scalar(inner) for inner in part.parts)

    return tree.what == "vector" and all(scalar(part) for part in tree.parts)
