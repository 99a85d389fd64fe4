"""The ways in which a command can end early, and the exit status of each."""

from __future__ import annotations


class EllipsoidError(Exception):
    """Any failure that the package reports in words rather than by a traceback."""

    exit_status = 1


class InputError(EllipsoidError):
    """What a user gave does not fit: one message with place, expectation, finding and remedy.

    Parameters
    ----------
    where : str
        The file, option or argument at fault.
    expected, found, remedy : str
        What would have been right, what was there, what to do about it.
    """

    exit_status = 2

    def __init__(self, where: str, expected: str, found: str, remedy: str) -> None:
        self.where, self.expected, self.found, self.remedy = where, expected, found, remedy
        super().__init__(f"{where}: expected {expected}, found {found}. {remedy}")


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
