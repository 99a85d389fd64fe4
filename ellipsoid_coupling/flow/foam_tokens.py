"""The tokens of an OpenFOAM dictionary, one after another, each with its place in the file.

    cells  $n ;  // comment      ->   word cells, variable $n, mark ;
    valueExpr "vector(x,0,0)";   ->   word valueExpr, string "vector(x,0,0)", mark ;
    code #{ int i; #};           ->   word code, verbatim #{ int i; #}, mark ;
    #include "parameters"        ->   directive #include, string "parameters"

Parentheses are marks of their own, also where OpenFOAM takes them into a word: div(phi,U). What no
dictionary has (a lone quote, a zero byte, an end within a string) is the token `odd`, the last one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Literal, NamedTuple, cast

Kind = Literal["word", "variable", "string", "verbatim", "directive", "mark", "odd"]


class Token(NamedTuple):
    """One token: its kind, its text byte by byte, its first byte and the one after its last."""

    kind: Kind
    text: str
    start: int
    end: int


_SPACE = rb"(?:\s++|//[^\n]*+|/\*(?s:.*?)\*/)*+"
# Possessive throughout: no text, however odd, makes the search go back.
_TOKEN = re.compile(
    rb"""(?P<mark>[{}()\[\];])
    |(?P<string>"(?:[^"\\]|\\(?s:.))*+")
    |(?P<verbatim>\#\{(?s:.*?)\#\})
    |(?P<directive>\#[A-Za-z]\w*+)
    |(?P<variable>\$(?:\{[^{}\s"';]*+\}|[^\s{}()\[\]"'/;#\\\x00-\x20])*+)
    |(?P<word>[^\s{}()\[\]"'/;#$\\\x00-\x20][^\s{}()\[\]"'/;#\\\x00-\x20]*+)
    |(?P<odd>(?s:.))""",
    re.VERBOSE,
)
_BLANK = re.compile(_SPACE)


def token_at(data: bytes, start: int) -> Token | None:
    """The first token of `data` from byte `start` on; None at the end."""
    found = _TOKEN.match(data, after_space(data, start))
    if found is None:
        return None
    kind = cast(Kind, found.lastgroup)
    return Token(kind, found[0].decode("latin-1"), found.start(), found.end())


def tokens(data: bytes) -> Iterator[Token]:
    """All tokens of `data`."""
    token = token_at(data, 0)
    while token is not None:
        yield token
        token = None if token.kind == "odd" else token_at(data, token.end)


def after_space(data: bytes, start: int) -> int:
    """The first byte from `start` on that is neither blank nor in a comment."""
    found = _BLANK.match(data, start)
    return start if found is None else found.end()


def line_of(data: bytes, at: int) -> int:
    """The line, from 1, of byte `at`."""
    return data.count(b"\n", 0, at) + 1
