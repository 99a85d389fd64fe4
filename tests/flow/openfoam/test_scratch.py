"""Folders that are worked in: random names, swept when their owner has gone, whole at their place."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.openfoam import scratch, solve, solved_cases
from ellipsoid_coupling.flow.openfoam.scratch import cleaned_up, move_to, scratch_folder
from ellipsoid_coupling.flow.openfoam.solve import solve_case
from ellipsoid_coupling.flow.openfoam.solved_cases import case_folder, is_solved, solved_folder
from tests.flow.openfoam.installed import needs_openfoam

OWNER = """
import pathlib, sys, time
from ellipsoid_coupling.flow.openfoam.scratch import scratch_folder
with scratch_folder(pathlib.Path("target").absolute()) as folder:
    (folder / "file").write_text("1")
    print(folder, flush=True)
    time.sleep(3600)
"""


def test_folders_of_dead_owners_are_swept_and_others_are_not(tmp_path: Path) -> None:
    owners = [
        subprocess.Popen(
            [sys.executable, "-c", OWNER], cwd=tmp_path, stdout=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    try:
        folders = []
        for owner in owners:
            assert owner.stdout is not None
            folders.append(Path(owner.stdout.readline().strip()))
        owners[0].kill()
        owners[0].wait()
        with scratch_folder(tmp_path / "target") as own:
            assert [folder.is_dir() for folder in (*folders, own)] == [False, True, True]
        names = {path.name for path in tmp_path.iterdir()}
        assert names == {folders[1].name, f"{folders[1].name}.lock"}
    finally:
        for owner in owners:
            owner.kill()
            owner.communicate()


def test_what_is_moved_stays_and_whoever_was_first_stays(tmp_path: Path) -> None:
    for text in ("first", "second"):
        with scratch_folder(tmp_path / "target") as folder:
            (folder / "file").write_text(text)
            move_to(folder, tmp_path / "target")
    assert (tmp_path / "target" / "file").read_text() == "first"
    assert [path.name for path in tmp_path.iterdir()] == ["target"]


def test_odd_places_are_worked_at_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And what was made there is copied beside its place before it is moved."""
    target = tmp_path / 'it\'s a "place" of mine' / "target"
    elsewhere = tmp_path / "plain"
    elsewhere.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(elsewhere))
    with scratch_folder(target) as folder:
        assert folder.parent == elsewhere
        (folder / "file").write_text("1")
        rename = Path.rename

        def within(path: Path, other: Path) -> Path:
            if path.parent != other.parent:
                raise OSError(errno.EXDEV, "another file system")
            return rename(path, other)

        monkeypatch.setattr(Path, "rename", within)
        move_to(folder, target)
    assert (target / "file").read_text() == "1"
    assert [path.name for path in target.parent.iterdir()] == ["target"]
    assert not list(elsewhere.iterdir())
    monkeypatch.setattr(scratch, "is_plain", lambda _: False)
    with pytest.raises(InputError, match="set TMPDIR"), scratch_folder(target):
        pass


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
@pytest.mark.usefixtures("obeyed")
def test_a_signal_unwinds_and_then_ends_as_it_would_have(tmp_path: Path, number: int) -> None:
    script = (
        "import os, sys\nfrom ellipsoid_coupling.flow.openfoam.scratch import cleaned_up\n"
        "with cleaned_up():\n"
        "    try:\n"
        f"        os.kill(os.getpid(), {int(number)})\n"
        "    finally:\n"
        "        print('unwound', flush=True)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert (done.stdout, done.returncode) == ("unwound\n", -number)
    # Who handles a signal goes on doing so.
    seen: list[int] = []
    before = signal.signal(number, lambda n, _: seen.append(n))
    try:
        with cleaned_up():
            os.kill(os.getpid(), number)
    finally:
        signal.signal(number, before)
    assert seen == [number]


@pytest.mark.openfoam
@needs_openfoam
def test_blanks_and_quotes_in_the_caches_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where a coarser solution is mapped, and in the name of the case itself."""
    monkeypatch.setenv("ELLIPSOID_CACHE", str(tmp_path / 'it\'s a "cache" of mine'))
    monkeypatch.setattr(solve, "MAPPED_FROM", 16)
    own = tmp_path / 'my "own" case'
    own.symlink_to(case_folder("cavity"))
    assert is_solved(solve_case(own, 16, out=tmp_path / "not a plain name"))
    solve_case(own, 8)
    (kept,) = (tmp_path / 'it\'s a "cache" of mine' / "flows").iterdir()
    assert kept.name.startswith("my__own__case-8-")


@pytest.mark.openfoam
@needs_openfoam
def test_a_cache_that_is_only_to_be_read(
    own_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = solve_case("cavity", 8)
    monkeypatch.setattr(solved_cases, "_is_writable", lambda _: False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    assert solve_case("cavity", 8) == kept
    told: list[str] = []
    private = solve_case("cavity", 9, report=lambda stage, _: told.append(stage))
    assert private.parent == tmp_path / f"ellipsoid_coupling-{os.geteuid()}"
    assert (
        told[0] == f"flow cavity, 9 cells: {own_cache} cannot be written, so into {private.parent}"
    )
    assert [path.name for path in (own_cache / "flows").iterdir()] == [kept.name]
    assert solved_folder("cavity", 9) == private
    private.parent.chmod(0o777)
    with pytest.raises(InputError, match="this user's alone"):
        solve_case("cavity", 10)
