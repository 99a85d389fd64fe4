r"""Quoted keys of dictionaries, "inlet.*" or "(left|right)Wall": which names they stand for.

    alternatives := sequence ("|" sequence)*
    sequence     := (atom ("*" | "+" | "?" | nothing))*
    atom         := a character, \ and a character, ".", [a-z_], [^0-9], "(" alternatives ")"

That is the part of POSIX's extended expressions which OpenFOAM's cases use. All ends that a match can
have are followed at once, so no pattern, however nested, takes longer than (its length) x (the name's)^2.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from ellipsoid_coupling.files.limits import MOST_NAME

# From the places where a part may start in a name to those where it may end.
Part = Callable[[str, frozenset[int]], frozenset[int]]
# Parentheses within one another: each may go through the name once more.
_MOST_DEPTH = 3
_CLASS = re.compile(r"\[(\^?)((?:\w-\w|[\w.:+=~@%&-])+)\]", re.ASCII)


def matches(pattern: str, name: str) -> bool:
    """Whether a pattern stands for the whole of `name`; ValueError for one of another kind."""
    if max(len(pattern), len(name)) > MOST_NAME:
        raise ValueError(f"more than {MOST_NAME} characters")
    part, end = _alternatives(pattern, 0, 0)
    if end < len(pattern):
        raise ValueError(f"{pattern[end]!r} out of place")
    return len(name) in part(name, frozenset((0,)))


def _alternatives(pattern: str, at: int, depth: int) -> tuple[Part, int]:
    """The part that begins at `at`, up to ')' or the end, and the place behind it."""
    if depth > _MOST_DEPTH:
        raise ValueError(f"more than {_MOST_DEPTH} parentheses within one another")
    part, at = _sequence(pattern, at, depth)
    while pattern[at : at + 1] == "|":
        other, at = _sequence(pattern, at + 1, depth)
        part = _either(part, other)
    return part, at


def _sequence(pattern: str, at: int, depth: int) -> tuple[Part, int]:
    part: Part = _nothing
    while at < len(pattern) and pattern[at] not in "|)":
        atom, at = _atom(pattern, at, depth)
        if pattern[at : at + 1] in ("*", "+", "?"):
            atom, at = _repeated(atom, pattern[at]), at + 1
        part = _one_after_another(part, atom)
    return part, at


def _atom(pattern: str, at: int, depth: int) -> tuple[Part, int]:
    first = pattern[at]
    if first == "(":
        part, end = _alternatives(pattern, at + 1, depth + 1)
        if pattern[end : end + 1] != ")":
            raise ValueError("'(' that is not closed")
        return part, end + 1
    match = _CLASS.match(pattern, at)
    if match is not None:
        return _character(re.compile(match[0], re.ASCII)), match.end()
    if first == "\\" and at + 1 < len(pattern) and not pattern[at + 1].isalnum():
        return _character(re.compile(re.escape(pattern[at + 1]))), at + 2
    if first in "*+?[]{}^$\\":
        raise ValueError(f"{first!r} out of place, or not read here")
    return _character(re.compile("." if first == "." else re.escape(first))), at + 1


def _nothing(_name: str, starts: frozenset[int]) -> frozenset[int]:
    return starts


def _character(kind: re.Pattern[str]) -> Part:
    return lambda name, starts: frozenset(k + 1 for k in starts if kind.fullmatch(name[k : k + 1]))


def _either(one: Part, other: Part) -> Part:
    return lambda name, starts: one(name, starts) | other(name, starts)


def _one_after_another(one: Part, other: Part) -> Part:
    return lambda name, starts: other(name, one(name, starts))


def _repeated(part: Part, how: str) -> Part:
    def repeated(name: str, starts: frozenset[int]) -> frozenset[int]:
        ends = starts if how in "*?" else frozenset[int]()
        new = starts
        while new := part(name, new) - ends:
            ends |= new
            if how == "?":
                break
        return ends

    return repeated
