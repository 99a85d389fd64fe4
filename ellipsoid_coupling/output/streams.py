"""The standard streams of a command, which may be closed, full or without a reader."""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from typing import TextIO

from ellipsoid_coupling.errors import readable
from ellipsoid_coupling.files.cache import CacheWarning


def open_streams() -> None:
    """Open the standard streams that the caller has closed, before any file is opened.

    The first file opened would get the number of a closed stream, and all that is printed.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free: this one
    for name, number in (("stdout", 1), ("stderr", 2)):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w", encoding="utf-8", closefd=False))


def tell(text: str) -> None:
    """Write to standard error; a closed reader does not change the exit status."""
    with suppress(OSError):
        sys.stderr.write(text)
        sys.stderr.flush()


def drop(stream: TextIO) -> None:
    """Discard a stream's buffer, which Python would otherwise complain about at its end."""
    with suppress(OSError, ValueError):  # ValueError: a stand-in without a file
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


# How numba's warning of a variable begins.
_UNREAD = re.compile(r"Environment variable 'NUMBA_\w+' is defined but")

_python_shows: Callable[..., None] = warnings.showwarning


def warn_in_one_line(
    message: Warning | str, category: type[Warning], *place: object, **details: object
) -> None:
    """For `warnings.showwarning`: what the user can change is reported to him like an error.

    That is a cache that cannot be used, and a variable that numba cannot read, of which numba prints the
    trace as well.
    """
    text = str(message)
    if issubclass(category, CacheWarning):
        tell(f"ellipsoid: {text}\n")
    elif _UNREAD.match(text):
        told = readable(text.partition(".\n")[0])
        tell(f"ellipsoid: {told}. It is not used; change or unset it.\n")
    else:
        _python_shows(message, category, *place, **details)
