"""Entries of a case's files that are not values: dimensions, lists of words, and those passed over."""

from __future__ import annotations

import re

from ellipsoid_coupling.flow.openfoam.files import FoamFile, read_count
from ellipsoid_coupling.flow.openfoam.tokens import Token, line_of, token_at, without_comments

# The types of List<...>: sizes in the file's scalars, in its labels, and in further bytes.
_SIZES = {
    "scalar": (1, 0, 0), "vector": (3, 0, 0), "sphericalTensor": (1, 0, 0), "symmTensor": (6, 0, 0),
    "tensor": (9, 0, 0), "complex": (2, 0, 0), "label": (0, 1, 0), "bool": (0, 0, 1),
    "Tuple2<scalar,scalar>": (2, 0, 0), "Tuple2<scalar,vector>": (4, 0, 0),
}  # fmt: skip
# These are written by some versions as text, also in binary files.
_MAYBE_TEXT = ("bool", "Tuple2<scalar,scalar>", "Tuple2<scalar,vector>")
_LIST = re.compile(r"List<([\w<>,]+)>")
_UNITS = ("kg", "m", "s", "K", "mol", "A", "cd")
# Names that Foundation versions have for whole sets.
_NAMED = {"velocity": "m s^-1", "volumetricFlux": "m^3 s^-1", "massFlux": "kg s^-1"}
_UNIT = re.compile(r"([A-Za-z]+)(?:\^(?:\(\s*([-+]?[\d.]{1,9})\s*\)|([-+]?[\d.]{1,9})))?")
_MOST_DIMENSIONS = 300


def skip_entry(file: FoamFile, key: Token) -> int:
    """The byte behind the entry that begins with `key`; nothing in it is looked at."""
    if key.kind == "mark":
        raise file.error(key.start, "an entry", repr(key.text))
    if key.kind == "directive":  # it is not followed: #include "file"
        line_end = file.data.find(b"\n", key.end)
        return len(file.data) if line_end < 0 else line_end + 1
    token = file.token(key.end, f"the value of {key.text}")
    ends_with = "}" if token.text == "{" else ";"
    depth = 0
    while True:
        depth += (token.text in ("{", "(", "[")) - (token.text in ("}", ")", "]"))
        if depth < 0:
            raise file.error(token.start, f"the end of {key.text}", repr(token.text))
        if depth == 0 and token.text == ends_with:
            return token.end
        token = _following(file, _behind_list(file, token), key)


def _following(file: FoamFile, at: int, key: Token) -> Token:
    """The token at byte `at` of the entry `key`; its line is counted only for a message."""
    token = token_at(file.data, at)
    if token is None or token.kind == "odd":
        line = line_of(file.data, key.start)
        return file.token(at, f"the end of {key.text}, which begins in line {line}")
    return token


def _behind_list(file: FoamFile, token: Token) -> int:
    """The byte behind a list's bytes in a binary file; that behind the token for anything else.

    Lists of words and strings are text there, too.
    """
    match = _LIST.fullmatch(token.text) if file.binary else None
    size = _SIZES.get(match[1]) if match is not None else None
    if match is None or size is None:
        return token.end
    number, at = read_count(file, token.end, f"entries of {token.text}")
    if number == 0 or file.data[at : at + 2].strip()[:1] == b"{":
        return at
    scalars, labels, others = size
    each = scalars * file.scalar.itemsize + labels * file.label.itemsize + others
    end = file.mark(at, "(") + number * each
    if match[1] in _MAYBE_TEXT and file.data[end : end + 1] != b")":
        return at
    if end > len(file.data):
        raise file.error(at, f"{number} entries of {token.text}", "the end of the file")
    return file.mark(end, ")")


def words_of(file: FoamFile, start: int, end: int) -> tuple[str, ...]:
    """The words between the parentheses of an entry that ends at `end`: 2(wall hot);"""
    words: list[str] = []
    at, inside = start, False
    while at < end and (token := file.token(at, "words")).text not in (")", ";"):
        if inside:
            words.append(token.text.strip('"'))
        inside = inside or token.text == "("
        at = token.end
    return tuple(words)


def read_dimensions(file: FoamFile, at: int) -> tuple[tuple[float, ...], int]:
    """The exponents of kg, m, s, K, mol, A, cd and the byte behind: [0 1 -1 0 0 0 0] or [m s^-1]."""
    expected = "dimensions as in [0 1 -1 0 0 0 0]; or [m s^-1];"
    start = file.mark(at, "[")
    end = file.data.find(b"]", start, start + _MOST_DIMENSIONS)
    if end < 0:
        raise file.error(start, expected, "no ']'")
    text = without_comments(file.data[start:end]).decode("latin-1").strip()
    try:
        exponents = _exponents(_NAMED.get(text, text))
    except ValueError:
        raise file.error(start, expected, repr(text)) from None
    return exponents, file.mark(end + 1, ";")


def _exponents(text: str) -> tuple[float, ...]:
    """ValueError where `text` is neither five or seven numbers nor a product of units."""
    if not re.search("[A-Za-z]", text):
        numbers = [float(part) for part in text.split()]
        if len(numbers) not in (5, 7):
            raise ValueError(text)
        return (*numbers, 0.0, 0.0)[:7]
    exponents = dict.fromkeys(_UNITS, 0.0)
    at, sign = 0, 1.0
    for found in _UNIT.finditer(text):
        between = text[at : found.start()].strip()
        if between not in ("", "*", "/") or found[1] not in exponents:
            raise ValueError(text)
        sign = -1.0 if between == "/" else 1.0
        exponents[found[1]] += sign * float(found[2] or found[3] or 1.0)
        at = found.end()
    if text[at:].strip():
        raise ValueError(text)
    return tuple(exponents.values())
