"""Docstrings of this package as sphinx wants them, where it reads them otherwise than people do."""

from __future__ import annotations

import inspect
import re
from itertools import groupby

# "x, y : two numbers", outside of a section with a title.
_ENTRY = re.compile(r"\w+(, \w+)* : \S")


def list_entries(
    _app: object, _what: str, _name: str, _thing: object, _options: object, lines: list[str]
) -> None:
    """Paragraphs of "name : text" that no section holds become lists; before napoleon."""
    made: list[str] = []
    for empty, group in groupby(lines, key=lambda line: not line):
        block = list(group)
        if not empty and _ENTRY.match(block[0]):
            block = [f"  {line}" if line[0] == " " else f"* {line}" for line in block]
        made += block
    lines[:] = made


def keep_properties(
    _app: object, what: str, _name: str, thing: object, _options: object, lines: list[str]
) -> None:
    """A colon in a property's first line is one; napoleon, before this, takes it for a type's end."""
    if what == "property":
        lines[:] = (inspect.getdoc(thing) or "").splitlines()
