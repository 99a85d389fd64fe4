"""Files are whole or not there."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from ellipsoid_coupling.errors import refusal
from ellipsoid_coupling.files.writing import halves, not_forced, whole_file


def test_file_appears_only_when_finished(tmp_path: Path) -> None:
    path = tmp_path / "new" / "a.txt"
    with whole_file(path) as beside:
        beside.write_text("half")
        assert beside.suffix == ".txt"
        assert not path.exists()
    assert path.read_text() == "half"
    assert list(path.parent.iterdir()) == [path]


def test_two_writers_with_one_process_id_do_not_meet(tmp_path: Path) -> None:
    """In two containers ids are equal, and a name that is known beforehand could be a link elsewhere."""
    path = tmp_path / "a.txt"
    with whole_file(path) as one, whole_file(path) as other:
        assert one != other
        one.write_text("one")
        other.write_text("other")
        assert sorted(halves(tmp_path, ["a.txt"])) == sorted((one, other))
    assert path.read_text() == "one"
    assert list(tmp_path.iterdir()) == [path]


def test_what_is_written_follows_no_link(tmp_path: Path) -> None:
    """A folder from elsewhere may hold links of the names that are written to."""
    (tmp_path / "kept.txt").write_text("kept")
    (tmp_path / "a.txt").symlink_to("kept.txt")
    with whole_file(tmp_path / "a.txt") as beside:
        beside.write_text("new")
    assert (tmp_path / "kept.txt").read_text() == "kept"
    assert (tmp_path / "a.txt").read_text() == "new"
    assert not (tmp_path / "a.txt").is_symlink()


def test_an_error_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fail_half_way() -> None:
        with whole_file(path) as beside:
            beside.write_text("new")
            raise ValueError("stop")

    with pytest.raises(ValueError, match="stop"):
        fail_half_way()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_files_are_forced_to_the_disk_unless_they_can_be_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file and its folder; inside `not_forced` neither, and afterwards both again."""
    forced = list[int]()
    monkeypatch.setattr(os, "fsync", forced.append)

    def write() -> int:
        with whole_file(tmp_path / "a.txt") as beside:
            beside.write_text("new")
        return len(forced)

    assert write() == 2
    with not_forced():
        assert write() == 2
    assert write() == 4


def test_what_the_system_refuses_is_told_with_the_places_to_look_at() -> None:
    """A write that fails names no file: a full disk under the cache of kernels, for one."""
    named = refusal(FileNotFoundError(2, "No such file or directory", "run/a"))
    assert named.endswith("No such file or directory: 'run/a'.")
    assert "ELLIPSOID_CACHE" in refusal(OSError(28, "No space left on device"))
    assert refusal(MemoryError()) == "the system refused: MemoryError."
