"""The tokens of an OpenFOAM dictionary, one after another, each with its place in the file.

    cells  $n ;  // comment      ->   word cells, variable $n, mark ;
    valueExpr "vector(x,0,0)";   ->   word valueExpr, string "vector(x,0,0)", mark ;
    code #{ int i; #};           ->   word code, verbatim #{ int i; #}, mark ;
    #include "parameters"        ->   directive #include, string "parameters"

Parentheses are marks of their own, also where OpenFOAM takes them into a word: div(phi,U). Text that
no dictionary has (a lone quote, a zero byte, an end within a string) is the token `odd`, the last one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Literal, NamedTuple

Kind = Literal["word", "variable", "string", "verbatim", "directive", "mark", "odd"]


class Token(NamedTuple):
    """One token: its kind, its text byte by byte, its first byte and the one after its last."""

    kind: Kind
    text: str
    start: int
    end: int


# Plain classes of bytes, each repeated by itself: no search goes back, in any version of Python.
_GAP = re.compile(rb"\s*")
_DIRECTIVE = re.compile(rb"#[A-Za-z]\w*")
_NAME_PART = re.compile(rb"[^\s{}()\[\]\"'/;#\\\x00-\x20]+")
_BRACED = re.compile(rb"\{[^{}\s\"';]*\}")
_WORD = re.compile(rb"[^\s{}()\[\]\"'/;#$\\\x00-\x20][^\s{}()\[\]\"'/;#\\\x00-\x20]*")
_IN_STRING = re.compile(rb"[\"\\]")
_OPENING = re.compile(rb"[\"/#]")
_MARKS = b"{}()[];"
# Comments become blanks, so that the rest keeps its lines and bytes.
_BLANKS = bytes(10 if byte == 10 else 32 for byte in range(256))


def token_at(data: bytes, start: int) -> Token | None:
    """The first token of `data` from byte `start` on; None at the end."""
    start = after_space(data, start)
    if start >= len(data):
        return None
    kind, end = _kind_at(data, start)
    return Token(kind, data[start:end].decode("latin-1"), start, end)


def name_at(data: bytes, start: int) -> Token | None:
    """As `token_at` where a name is expected: parentheses in it that close belong to it, in(1)."""
    token = token_at(data, start)
    if token is None or token.kind != "word":
        return token
    end, depth = token.end, 0
    while True:
        mark = data[end : end + 1]
        match = _NAME_PART.match(data, end)
        if match is not None:
            end = match.end()
        elif mark == b"(" or (mark == b")" and depth > 0):
            depth += 1 if mark == b"(" else -1
            end += 1
        else:
            break
    text = data[token.start : end].decode("latin-1")
    return token if depth else Token("word", text, token.start, end)


def tokens(data: bytes) -> Iterator[Token]:
    """All tokens of `data`."""
    token = token_at(data, 0)
    while token is not None:
        yield token
        token = None if token.kind == "odd" else token_at(data, token.end)


def after_space(data: bytes, start: int) -> int:
    """The first byte from `start` on that is neither blank nor in a comment that ends."""
    while True:
        match = _GAP.match(data, start)
        start = start if match is None else match.end()
        end = _comment_end(data, start)
        if end <= start:
            return start
        start = end


def without_comments(data: bytes) -> bytes:
    """`data` (ascii) with blanks for its comments: all places and lines stay what they are.

    Behind a string, a comment or a #{ that never ends nothing is changed.
    """
    pieces, done, at = [], 0, 0
    while match := _OPENING.search(data, at):
        start = match.start()
        end = _comment_end(data, start)
        if end > start:
            pieces += [data[done:start], data[start:end].translate(_BLANKS)]
            done = at = end
            continue
        kind, at = _kind_at(data, start)
        if kind == "odd" and data.startswith((b'"', b"/*", b"#{"), start):
            break
    return b"".join((*pieces, data[done:]))


def line_of(data: bytes, at: int) -> int:
    """The line, from 1, of byte `at`."""
    return data.count(b"\n", 0, at) + 1


def _kind_at(data: bytes, start: int) -> tuple[Kind, int]:
    """The token that begins at byte `start`, and the byte behind it."""
    first = data[start : start + 1]
    if first in _MARKS:
        return "mark", start + 1
    if first == b'"':
        end = _string_end(data, start)
        return ("odd", start + 1) if end < 0 else ("string", end)
    if data.startswith(b"#{", start):
        end = data.find(b"#}", start + 2)
        return ("odd", start + 1) if end < 0 else ("verbatim", end + 2)
    if first == b"$":
        return "variable", _variable_end(data, start)
    directive = _DIRECTIVE.match(data, start)
    if directive is not None:
        return "directive", directive.end()
    word = _WORD.match(data, start)
    return ("odd", start + 1) if word is None else ("word", word.end())


def _comment_end(data: bytes, start: int) -> int:
    """The byte behind the comment that opens at `start`; `start` if none does, or it never ends."""
    if data.startswith(b"//", start):
        end = data.find(b"\n", start)
        return len(data) if end < 0 else end
    if data.startswith(b"/*", start):
        end = data.find(b"*/", start + 2)
        return start if end < 0 else end + 2
    return start


def _string_end(data: bytes, start: int) -> int:
    """The byte behind the string that opens at `start`; -1 if it does not close."""
    at = start + 1
    while match := _IN_STRING.search(data, at):
        if match[0] == b'"':
            return match.end()
        at = match.end() + 1
    return -1


def _variable_end(data: bytes, start: int) -> int:
    """The byte behind a variable: $name, ${name}, or such parts one after another."""
    end = start + 1
    while match := _NAME_PART.match(data, end) or _BRACED.match(data, end):
        end = match.end()
    return end
