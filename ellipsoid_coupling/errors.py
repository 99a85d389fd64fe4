"""The ways in which a command can end early, and the exit status of each."""

from __future__ import annotations

import sys
from collections.abc import Callable


class EllipsoidError(Exception):
    """Any failure that the package reports in words rather than by a traceback.

    Its text may quote file names, logs and files from anywhere, so it is made `shown` here, once for
    all failures.
    """

    exit_status = 1

    def __init__(self, message: str) -> None:
        super().__init__(shown(message))


class InputError(EllipsoidError):
    """What a user gave does not fit: one message with place, expectation, finding and remedy.

    Each part is one line of a readable length, see `readable`.

    Parameters
    ----------
    where : str
        The file, option or argument at fault.
    expected, found, remedy : str
        What would have been right, what was there, what to do about it.
    """

    exit_status = 2

    def __init__(self, where: str, expected: str, found: str, remedy: str) -> None:
        self.where, self.expected, self.found, self.remedy = map(
            readable, (where, expected, found, remedy)
        )
        super().__init__(
            f"{self.where}: expected {self.expected}, found {self.found}. {self.remedy}"
        )


_LONGEST = 500


def shown(text: str) -> str:
    """`text` for a terminal, a log or a file: what is not printable stands there as its escape.

    Control characters, escape sequences, marks that turn the direction of writing, and surrogates
    (bytes that are no UTF-8) become \\x1b, \\u202e, \\udcff; line ends stay.
    """
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)


def readable(text: str) -> str:
    """`text` in one line, `shown`, its middle left out where it is long."""
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 4 :]}"
    return shown(text.replace("\n", " "))


def refusal(error: BaseException) -> str:
    """What no check before a run could know, in words: a full disk, a file removed meanwhile."""
    found = readable(str(error)) or type(error).__name__
    if not isinstance(error, OSError) or error.filename is not None:
        return f"the system refused: {found}."
    return (
        f"the system refused: {found}, without naming a file. Look after the folder of the results "
        "and after the cache of kernels and flows (ELLIPSOID_CACHE puts it elsewhere)."
    )


class RunError(EllipsoidError):
    """A program or a solver failed: time, place, the term at fault and the remedy are in the text."""


class WriteError(EllipsoidError):
    """A file could not be written; what was there before is as it was."""


class Interrupted(EllipsoidError):
    """A run left off before its end, after a checkpoint; a signal's status is 128 + its number."""

    def __init__(self, number: int, message: str) -> None:
        if number:
            self.exit_status = 128 + number
        super().__init__(message)


def run_in_words(main: Callable[[], object]) -> None:
    """Run a script; what the package reports goes to standard error, with its exit status."""
    try:
        main()
    except EllipsoidError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(error.exit_status)
