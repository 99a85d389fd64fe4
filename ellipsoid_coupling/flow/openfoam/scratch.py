"""Folders that a solver works in, beside the target of their contents, and removed in any case.

A folder's name is random, so that two processes, or two containers with one cache and equal process ids,
never work in the same one. Its owner holds a lock on a file beside it. If nobody holds that lock, the owner
was killed, and the next process removes folder and file.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import secrets
import shutil
import signal
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from ellipsoid_coupling.errors import InputError

# OpenFOAM drops blanks and quotes from the path of its case, and then does not find it.
_PLAIN = re.compile(r"[\w./+@=,-]*", re.ASCII)
_LOCK = re.compile(r"\.[^/]+\.[0-9a-f]{16}\.lock")
_ENDING = (signal.SIGTERM, signal.SIGHUP)


def is_plain(path: Path) -> bool:
    """Whether OpenFOAM can work at this path."""
    return bool(_PLAIN.fullmatch(str(path.resolve())))


@contextmanager
def scratch_folder(target: Path) -> Iterator[Path]:
    """A new empty folder, beside `target` where OpenFOAM can work there, else among temporary files.

    It is removed on leaving unless it has been moved. Folders of killed owners are removed first.

    Raises OSError where none can be made, InputError where no path is plain enough.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    with _claimed(_workplace(target.parent), target.name) as folder:
        yield folder


def move_to(folder: Path, target: Path) -> None:
    """Move a scratch folder to its target, completely or not at all; a folder already there stays."""
    with contextlib.suppress(OSError):
        folder.rename(target)
        return
    if target.exists():
        return
    # From another file system: copied beside its place first.
    with _claimed(target.parent, target.name) as beside:
        shutil.copytree(folder, beside, dirs_exist_ok=True)
        with contextlib.suppress(OSError):
            beside.rename(target)


def _workplace(parent: Path) -> Path:
    for place in (parent, Path(tempfile.gettempdir()), Path("/tmp"), Path("/var/tmp")):
        if is_plain(place) and os.access(place, os.W_OK | os.X_OK):
            return place.resolve()
    raise InputError(
        str(parent), "a path of letters, digits and ./+@=,_-, or one such for temporary files",
        "neither", "OpenFOAM cannot work at other paths: set TMPDIR to a plain one.",
    )  # fmt: skip


@contextmanager
def _claimed(place: Path, name: str) -> Iterator[Path]:
    """A new folder in `place` with its lock, both removed on leaving."""
    _sweep(place)
    folder, lock, handle = _claim(place, re.sub(r"[^\w+@=,.-]", "_", name, flags=re.ASCII)[:100])
    try:
        folder.mkdir()
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        lock.unlink(missing_ok=True)
        os.close(handle)


def _claim(place: Path, name: str) -> tuple[Path, Path, int]:
    """A name for a folder, its lock file, and the handle that holds it."""
    while True:
        folder = place / f".{name}.{secrets.token_hex(8)}"
        lock = folder.with_name(f"{folder.name}.lock")
        handle = os.open(lock, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o600)
        with contextlib.suppress(OSError):  # a file system without locks: nothing is removed
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.fstat(handle).st_nlink:
            return folder, lock, handle
        # Somebody swept it before it was locked.
        os.close(handle)


def _sweep(place: Path) -> None:
    """Remove the folders in `place` whose owners are no more, with their locks."""
    for lock in place.glob(".*.lock"):
        if not _LOCK.fullmatch(lock.name):
            continue
        try:
            handle = os.open(lock, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
        except OSError:  # gone, or somebody else's
            continue
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.fstat(handle).st_uid == os.geteuid():
                shutil.rmtree(lock.with_suffix(""), ignore_errors=True)
                lock.unlink(missing_ok=True)
        except OSError:  # its owner lives
            continue
        finally:
            os.close(handle)


class _Ended(BaseException):
    """A signal that asks this process to end."""


@contextmanager
def cleaned_up() -> Iterator[None]:
    """Inside, SIGTERM and SIGHUP first unwind what runs, and then end the process as they would have.

    Only where they would end it: in the main thread, and where nobody handles or ignores them.
    """
    asked: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        if not asked:
            asked.append(number)
            raise _Ended

    here = threading.current_thread() is threading.main_thread()
    caught = [n for n in _ENDING if here and signal.getsignal(n) == signal.SIG_DFL]
    try:
        for number in caught:
            signal.signal(number, note)
        yield
    except _Ended:
        pass
    finally:
        for number in caught:
            signal.signal(number, signal.SIG_DFL)
        if asked:
            os.kill(os.getpid(), asked[0])
