"""One walk over the text of an OpenFOAM dictionary: blanks, comments, words, numbers and strings.

OpenFOAM's own grammar is much larger. Everything else is refused with file and line.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import NamedTuple, NoReturn

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_NAME

TRUST = "Write it plainly; or, if you trust the case, solve it with: ellipsoid flow CASE --trust."

# None of these can match in two ways, so no search goes back over text.
_SPACE = re.compile(r"[ \t\r\n\v\f]*")
_WORD = re.compile(r"[A-Za-z_][\w.,:*|<>+=%~@&!?^()-]*", re.ASCII)
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_WHOLE = re.compile(r"[+-]?[0-9]{1,15}")
_DIRECTIVE = re.compile(r"#\w*", re.ASCII)
_PLAIN = re.compile(r"[ !#-\[\]-~]*")  # neither quotes nor backslashes
_BEHIND_A_TOKEN = frozenset(" \t\r\n\v\f;{}()[]")
_LONGEST_NUMBER = 40
_LONGEST_STRING = 1_000


class Source(NamedTuple):
    """A dictionary: where it is, for messages, and its text, a character a byte."""

    path: Path
    text: str

    def error(self, at: int, expected: str, found: str, remedy: str = TRUST) -> InputError:
        """An error at character `at`."""
        line = self.text.count("\n", 0, at) + 1
        return InputError(f"{self.path}, line {line}", expected, found, remedy)


class Scanner:
    """Goes over a text once; each method reads one kind of thing from `at` on."""

    def __init__(self, source: Source) -> None:
        self.source, self.text, self.at = source, source.text, 0

    def skip(self) -> int:
        """Go past blanks and comments."""
        start = self.at
        while True:
            match = _SPACE.match(self.text, self.at)
            self.at = match.end() if match else self.at
            opening = self.text[self.at : self.at + 2]
            if opening not in ("//", "/*"):
                return self.at
            # Within a name OpenFOAM may take a slash for a part of it.
            if self.at == start and start and self.text[start - 1] not in ";{}()[]":
                self.refuse(start, "a comment that touches what is before it")
            closing = "\n" if opening == "//" else "*/"
            end = self.text.find(closing, self.at + 2)
            if end < 0 and opening == "/*":
                self.refuse(self.at, "a comment without an end")
            self.at = len(self.text) if end < 0 else end + len(closing)

    def peek(self) -> str:
        """The next character that counts, empty at the end."""
        at = self.skip()
        return self.text[at : at + 1]

    def refuse(self, at: int, found: str) -> NoReturn:
        """InputError at character `at`."""
        raise self.source.error(at, "plain words, numbers, lists and dictionaries", found)

    def odd(self) -> NoReturn:
        """Refuse the text at this byte, under the name that its reader gives it."""
        rest = self.text[self.at : self.at + 40]
        directive = _DIRECTIVE.match(rest)
        if not rest:
            self.refuse(self.at, "the end of the file")
        if directive:
            self.refuse(self.at, f"the directive {directive[0]}")
        if rest[0] == "$":
            self.refuse(self.at, f"an expansion that is not a plain $name, {rest.split()[0]}")
        if rest[0] == '"':
            self.refuse(self.at, "a string or pattern in quotes")
        self.refuse(self.at, f"text out of place, {rest.splitlines()[0]!r}")

    def taken(self, mark: str) -> bool:
        """Whether the mark is next; it then is read."""
        if self.peek() != mark:
            return False
        self.at += 1
        return True

    def need(self, mark: str) -> None:
        """Read the mark, which must be next."""
        if not self.taken(mark):
            self.odd()

    def token(self, pattern: re.Pattern[str]) -> str:
        """The text that the pattern matches here, refused unless a blank or a mark is behind it."""
        match = pattern.match(self.text, self.at)
        if match is None or not match[0]:
            self.odd()
        self._bounded(match.end())
        self.at = match.end()
        return match[0]

    def _bounded(self, end: int) -> None:
        behind = self.text[end : end + 1]
        if behind and behind not in _BEHIND_A_TOKEN:
            self.odd()

    def word(self) -> tuple[str, int]:
        """A word up to a blank or a mark, or to the parenthesis that closes a list around it."""
        start = self.skip()
        # No further than a word may go: for each word of a list without blanks, all of it would match.
        match = _WORD.match(self.text, start, start + MOST_NAME + 1)
        if match is None:
            self.odd()
        depth, end = 0, match.end()
        for at in range(start, match.end()):
            depth += (self.text[at] == "(") - (self.text[at] == ")")
            if depth < 0:
                depth, end = 0, at
                break
        if end - start > MOST_NAME:
            self.refuse(start, f"a word of more than {MOST_NAME} characters")
        if depth > 0:
            self.refuse(start, f"a word without its last parenthesis, {match[0][:40]!r}")
        self._bounded(end)
        self.at = end
        return self.text[start:end], start

    def number(self) -> int | float:
        """A finite number."""
        start, text = self.at, self.token(_NUMBER)
        if len(text) > _LONGEST_NUMBER or not math.isfinite(float(text)):
            self.refuse(start, f"a number out of range, {text[:_LONGEST_NUMBER]}")
        return int(text) if _WHOLE.fullmatch(text) else float(text)

    def string(self) -> str:
        """One line of plain characters between double quotes."""
        start = self.at
        match = _PLAIN.match(self.text, start + 1)
        end = match.end() if match else start
        if self.text[end : end + 1] != '"' or end - start > _LONGEST_STRING:
            self.refuse(start, "a string that is not one line of plain characters")
        self.at = end + 1
        return self.text[start + 1 : end]
