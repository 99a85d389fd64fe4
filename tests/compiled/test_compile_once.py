"""Of processes that need the same kernels, one compiles them."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

import pytest

from ellipsoid_coupling.compiled import compile_once
from ellipsoid_coupling.compiled.compile_once import compiled_once


def is_held(folder: Path) -> bool:
    """Whether somebody compiles: another file handle cannot get the lock."""
    (file,) = folder.glob("*.lock")
    handle = os.open(file, os.O_RDWR)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(handle)
    return False


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(compile_once, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(compile_once, "_known", set())
    return tmp_path


def test_the_lock_is_held_until_the_kernels_are_there(folder: Path) -> None:
    with compiled_once("a") as ready:
        assert is_held(folder)
        ready()
        assert not is_held(folder)
        ready()
    with compiled_once("a") as ready:
        assert not is_held(folder)
        ready()


def test_another_process_finds_that_they_are_there(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with compiled_once("a") as ready:
        ready()
    monkeypatch.setattr(compile_once, "_known", set())
    with compiled_once("a"):
        assert not is_held(folder)


def test_who_fails_leaves_it_to_the_next(folder: Path) -> None:
    with pytest.raises(ZeroDivisionError), compiled_once("a"):
        raise ZeroDivisionError
    assert not is_held(folder)
    with compiled_once("a"):
        assert is_held(folder)
