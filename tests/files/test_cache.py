"""The cache: where it is, and what becomes of a run where it cannot be written."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files import cache
from ellipsoid_coupling.files.cache import CacheWarning, cache_home, kernel_folder

PACKAGE = Path(cache.__file__).parent


@pytest.fixture(autouse=True)
def _asked_anew() -> Iterator[None]:
    """The answer is kept for the life of a process, not of a test."""
    kernel_folder.cache_clear()
    yield
    kernel_folder.cache_clear()


@pytest.fixture
def not_writable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache below a file: nobody can make a folder there, root neither."""
    (tmp_path / "file").touch()
    monkeypatch.setenv("ELLIPSOID_CACHE", str(tmp_path / "file" / "cache"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    return tmp_path / "file" / "cache"


def test_a_cache_that_can_be_written_is_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ELLIPSOID_CACHE", str(tmp_path / "new" / "cache"))
    assert kernel_folder("abc") == tmp_path / "new" / "cache" / "kernels" / "abc"
    assert not list(kernel_folder("abc").iterdir())


def test_a_tilde_that_no_shell_replaced_is_the_home(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As an env file or a container's settings leave it: else a folder "~" appears in each place."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("ELLIPSOID_CACHE", "~/my cache")
    assert cache_home() == tmp_path / "my cache"


def test_one_that_cannot_is_told_and_replaced(not_writable: Path) -> None:
    with pytest.warns(CacheWarning, match=r"cannot be written.*ELLIPSOID_CACHE") as told:
        folder = kernel_folder("abc")
    assert str(not_writable) in str(told[0].message)
    assert folder.is_dir()
    assert folder.stat().st_mode & 0o777 == 0o700  # kernels are code: nobody else's to write
    cache._remove(folder, os.getpid() + 1)  # a process forked from ours ends
    assert folder.is_dir()
    cache._remove(folder, os.getpid())
    assert not folder.exists()


def test_what_a_cache_that_can_only_be_read_has_is_taken_along(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever may write everywhere, as root, only plays that he may not."""
    monkeypatch.setenv("ELLIPSOID_CACHE", str(tmp_path / "shared"))
    shared = tmp_path / "shared" / "kernels" / "abc"
    shared.mkdir(parents=True)
    (shared / "kernel.nbc").write_bytes(b"compiled")

    def read_only(**_options: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.TemporaryFile", read_only)
    with pytest.warns(CacheWarning, match="Permission denied"):
        folder = kernel_folder("abc")
    assert folder != shared
    assert (folder / "kernel.nbc").read_bytes() == b"compiled"


def test_no_place_at_all_is_one_message(
    not_writable: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(**_options: object) -> str:
        raise FileNotFoundError(2, "No usable temporary directory found")

    monkeypatch.setattr("tempfile.mkdtemp", none)
    with pytest.raises(InputError, match=r"temporary.*ELLIPSOID_CACHE name a folder") as caught:
        kernel_folder("abc")
    assert str(not_writable) in str(caught.value)


def test_who_has_no_home_has_no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ELLIPSOID_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)

    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", homeless)
    with pytest.warns(CacheWarning, match="cannot be written"):
        folder = kernel_folder("abc")
    assert not str(folder).startswith(str(cache_home()))


def test_without_a_cache_a_command_says_so_in_one_line(not_writable: Path, tmp_path: Path) -> None:
    """And leaves nothing: neither in the place of temporary files nor beside the sources."""
    before = set(PACKAGE.rglob("*.nb?"))
    done = subprocess.run(
        [sys.executable, "-m", "ellipsoid_coupling", "plan", "cavity"],
        env=os.environ | {"TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    lines = [line for line in done.stderr.splitlines() if not line.endswith(" ...")]
    assert len(lines) == 1
    assert lines[0].startswith(f"ellipsoid: {not_writable}")
    assert "ELLIPSOID_CACHE" in lines[0]
    assert "interaction" in done.stdout
    assert not list(tmp_path.glob("ellipsoid-kernels-*"))
    assert set(PACKAGE.rglob("*.nb?")) == before
