"""The cache of everything that can be made again: compiled kernels and solved flows."""

from __future__ import annotations

import atexit
import functools
import os
import shutil
import tempfile
import warnings
from contextlib import suppress
from pathlib import Path

from ellipsoid_coupling.errors import InputError

_REMEDY = "Let ELLIPSOID_CACHE name a folder that can be written"


class CacheWarning(UserWarning):
    """The cache cannot be used; everything works, but is made again in each process."""


def cache_home() -> Path:
    """The folder for everything that can be made again: compiled kernels and solved flows.

    ``ELLIPSOID_CACHE`` where set (a ``~`` that no shell has replaced is the home), else
    ``XDG_CACHE_HOME``/ellipsoid_coupling, else the same below ``~/.cache``. Whether it can be written
    is another question.
    """
    named = os.environ.get("ELLIPSOID_CACHE")
    if named:
        return Path(os.path.expanduser(named)).absolute()  # noqa: PTH111
    base = os.environ.get("XDG_CACHE_HOME")
    if base:
        return Path(base).absolute() / "ellipsoid_coupling"
    try:
        home = Path.home()
    except RuntimeError:  # a user without a home: below a device nothing can be made, nor found
        home = Path(os.devnull)
    return home / ".cache" / "ellipsoid_coupling"


@functools.cache
def kernel_folder(name: str) -> Path:
    """The folder for kernels compiled from the sources called `name`; it can be written.

    Where the cache cannot, this is a temporary one of this process alone, which holds a copy of what
    the cache has and is removed at the end; a `CacheWarning` says so.

    Raises
    ------
    InputError
        If there is no place for temporary files either.
    """
    wanted = cache_home() / "kernels" / name
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            return wanted
    except OSError as error:
        why = error.strerror or str(error)
    try:
        private = Path(tempfile.mkdtemp(prefix="ellipsoid-kernels-"))
    except OSError as error:
        raise InputError(
            str(wanted), "a folder for compiled kernels that can be written",
            f"{why}; and none for temporary files: {error.strerror or error}", f"{_REMEDY}.",
        ) from None  # fmt: skip
    atexit.register(_remove, private, os.getpid())
    with suppress(OSError, shutil.Error):
        shutil.copytree(wanted, private, dirs_exist_ok=True)
    warnings.warn(
        f"{wanted} cannot be written ({why}): kernels are compiled anew in each process. {_REMEDY}.",
        CacheWarning,
        stacklevel=2,
    )
    return private


def _remove(folder: Path, owner: int) -> None:
    """Remove a temporary folder at the end of the process that made it, not of one forked from it."""
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)
