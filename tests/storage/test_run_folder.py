"""Run folders: what is refused, what is kept, and what a full disk or a vanished folder leaves."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import textwrap
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError, WriteError
from ellipsoid_coupling.storage import run_folder
from ellipsoid_coupling.storage.run_folder import (
    CHECKPOINT_FILE,
    RESULT_FILE,
    RUN_FILE,
    RunFolder,
    numbered_folder,
)
from tests.storage.stopped_runs import Stop, contents, interrupted, run, scene


def test_a_folder_that_holds_something_is_refused_and_untouched(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(InputError, match=r"holds thesis\.tex.*--force"):
        run(tmp_path)
    assert contents(tmp_path) == {"thesis.tex": b"mine"}
    run(RunFolder(tmp_path, force=True))
    assert set(contents(tmp_path)) == {"thesis.tex", RUN_FILE, RESULT_FILE}


def test_force_leaves_nothing_of_the_earlier_run(tmp_path: Path) -> None:
    interrupted(tmp_path)
    run(RunFolder(tmp_path, force=True), seed=5)
    assert set(contents(tmp_path)) == {RUN_FILE, RESULT_FILE}
    assert ec.Result.load(tmp_path).attributes["seed"] == 5


def test_bad_input_leaves_no_folder(tmp_path: Path) -> None:
    """What only building the model finds out comes before the folder as well."""
    folder = tmp_path / "new"
    with pytest.raises(InputError, match="divides the domain"):
        ec.simulate(
            ec.load_scene("stationary", {"numerics.cell": 0.7}), "q_mono_kinetic", folder=folder
        )
    assert not folder.exists()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"seed": 1}, r"\[run\] seed.*expected the run that was started, 0, found 1"),
        ({"scheme": "accurate"}, r"\[run\] scheme"),
        ({"scene": scene(times=[0.3])}, r"\[scene\] times"),
        ({"realisations": 3}, r"\[run\] realisations"),
    ],
)
def test_resuming_another_run_is_refused(change: dict[str, Any], told: str, tmp_path: Path) -> None:
    place = interrupted(tmp_path)
    before = contents(tmp_path)
    call: dict[str, Any] = {"scene": scene(), "model": "microscopic", "scheme": "paper"} | change
    with pytest.raises(InputError, match=told):
        ec.simulate(**call, folder=place)
    assert contents(tmp_path) == before


def test_resuming_with_other_versions_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = interrupted(tmp_path)
    monkeypatch.setattr(run_folder, "version", lambda _name: "99.0")
    with pytest.raises(InputError, match="same bits"):
        run(place)


def test_another_flow_of_the_same_name_is_refused(tmp_path: Path) -> None:
    """A case may be solved anew between start and resumption: its numbers count, not its name."""
    from dataclasses import replace

    from ellipsoid_coupling.flow import analytic_flow

    small = ec.load_scene(
        "rotation", {"particles.number": 5, "times": [0.1, 0.2], "interaction": None}
    )
    flow = analytic_flow("rotation")

    def stop(_stage: str, _part: float) -> None:
        raise Stop

    with pytest.raises(Stop):
        ec.simulate(small, "microscopic", flow=flow, folder=tmp_path, report=stop)
    other = replace(flow, arrays=flow.arrays._replace(coefficients=2.0 * flow.arrays.coefficients))
    with pytest.raises(InputError, match="flow_digest"):
        ec.simulate(small, "microscopic", flow=other, folder=RunFolder(tmp_path, resume=True))


def test_a_second_run_in_the_same_folder_is_refused(tmp_path: Path) -> None:
    """Another process asks while the first run is under way; the first is not disturbed."""
    code = f"""
        import ellipsoid_coupling as ec
        from pathlib import Path
        for options in ({{"resume": True}}, {{"force": True}}):
            try:
                with ec.RunFolder(Path({str(tmp_path)!r}), **options).claimed({{}}, {{}}):
                    print("claimed")
            except ec.InputError as error:
                print(error)
    """
    told: list[str] = []

    def ask(_stage: str, _part: float) -> None:
        if not told:
            command = [sys.executable, "-c", textwrap.dedent(code)]
            done = subprocess.run(command, capture_output=True, text=True, check=True)
            told.append(done.stdout)

    first = run(tmp_path, report=ask)
    assert told[0].count("in use by a running process") == 2
    assert first.status == "completed"
    assert set(contents(tmp_path)) == {RUN_FILE, RESULT_FILE}


@pytest.mark.parametrize("text", ["run = 1", 'run = "x"', "run = []", "scene = 1.5", "extra = 1"])
def test_a_run_file_without_its_sections_is_refused(text: str, tmp_path: Path) -> None:
    place = interrupted(tmp_path)
    (tmp_path / RUN_FILE).write_text(text)
    with pytest.raises(InputError, match=r"run\.toml, \w+: expected a section"):
        run(place)


def test_resuming_never_begins_in_a_folder_that_holds_something_else(tmp_path: Path) -> None:
    """Without its run.toml a run cannot be told from another: its checkpoint and result stay."""
    place = interrupted(tmp_path)
    (tmp_path / RUN_FILE).rename(tmp_path / "mine.toml")
    before = contents(tmp_path)
    with pytest.raises(InputError, match=r"with a run\.toml, found one that holds checkpoint\.npz"):
        run(place)
    assert contents(tmp_path) == before


def test_what_a_killed_process_was_writing_is_removed(tmp_path: Path) -> None:
    """Before run.toml was whole there is nothing to go on from; other hidden files are not ours."""
    halves = (".run.12.toml", ".checkpoint.345.npz", ".result.6.nc")
    for name in (*halves, ".run.toml", ".result.x.nc"):
        (tmp_path / name).write_text("half")
    with pytest.raises(InputError, match=r"with a run\.toml"):
        run(RunFolder(tmp_path, resume=True))
    for name in (".run.toml", ".result.x.nc"):
        (tmp_path / name).rename(tmp_path.parent / name)
    run(RunFolder(tmp_path, resume=True))
    assert set(contents(tmp_path)) == {RUN_FILE, RESULT_FILE}


@pytest.mark.parametrize("name", [RUN_FILE, RESULT_FILE, CHECKPOINT_FILE])
def test_folders_in_the_place_of_a_runs_files_are_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / name).mkdir()
    for options in ({"force": True}, {"resume": True}):
        with pytest.raises(InputError, match=rf"{name}: expected a file or nothing, found a fold"):
            run(RunFolder(tmp_path, **options))
    assert (tmp_path / name).is_dir()


@contextmanager
def full_disk(size: int) -> Iterator[None]:
    """No file may grow beyond `size` bytes: what a full disk looks like to a program."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def test_a_full_disk_leaves_the_last_checkpoint(tmp_path: Path) -> None:
    """Full for a checkpoint, then for the result; when there is room again the run goes on."""
    whole = run(tmp_path / "whole")
    place = interrupted(tmp_path / "run")
    before = contents(place.path)
    for interval in (0.0, 3600.0):
        small = RunFolder(place.path, resume=True, checkpoint_seconds=interval)
        with (
            full_disk(1000),
            pytest.raises(WriteError, match="could not be written: File too large"),
        ):
            run(small)
        assert contents(place.path) == before
    assert np.array_equal(run(place).variables["x"], whole.variables["x"])


def test_a_folder_removed_in_mid_run_is_one_message(tmp_path: Path) -> None:
    folder = tmp_path / "run"

    def remove(_stage: str, part: float) -> None:
        if part > 0.5 and folder.is_dir():
            for file in folder.iterdir():
                file.unlink()
            folder.rmdir()
            folder.write_text("in the way")

    with pytest.raises(WriteError, match=r"could not be written"):
        run(folder, report=remove)
    assert folder.read_text() == "in the way"


@pytest.mark.skipif(os.geteuid() != 0, reason="changes its user, which only root may")
def test_a_folder_without_permission_is_refused_at_once() -> None:
    # Its own folder: pytest's lie below folders that only their owner may enter.
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        code = f"""
            import os
            import ellipsoid_coupling.storage.run_folder as module
            from pathlib import Path
            os.seteuid(65534)
            try:
                module.RunFolder(Path({name!r}) / "run").check()
            except module.InputError as error:
                print(error)
        """
        command = [sys.executable, "-c", textwrap.dedent(code)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "expected a folder that can be written" in done.stdout


@pytest.mark.parametrize("name", ["file", "file/below", "nul\0l"])
def test_paths_that_are_no_folders_are_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"--out|zero|folder"):
        run(tmp_path / name)


def removed_half_way(folder: Path, then: Any) -> None:
    """Run in a folder that disappears under the run, which writes a checkpoint at every step."""
    done: list[bool] = []

    def remove(_stage: str, part: float) -> None:
        if part > 0.3 and not done:
            done.append(True)
            shutil.rmtree(folder)
            then()

    with pytest.raises(WriteError) as told:
        run(RunFolder(folder, checkpoint_seconds=0.0), report=remove)
    assert str(folder) in str(told.value)


def test_a_folder_removed_under_a_run_does_not_come_back(tmp_path: Path) -> None:
    removed_half_way(tmp_path / "run", lambda: None)
    assert not (tmp_path / "run").exists()


def test_what_another_run_has_put_in_its_place_stays(tmp_path: Path) -> None:
    """The other one runs to its end meanwhile: its result and its run.toml are of one run."""
    removed_half_way(tmp_path / "run", lambda: run(tmp_path / "run", seed=2))
    assert set(contents(tmp_path / "run")) == {RUN_FILE, RESULT_FILE}
    assert ec.Result.load(tmp_path / "run").attributes["seed"] == 2
    assert run_folder.read_run_file(tmp_path / "run" / RUN_FILE)["run"]["seed"] == 2


def test_a_result_is_not_written_into_a_folder_of_somebody_else(tmp_path: Path) -> None:
    """Removed after the last checkpoint, and empty again: nothing comes into it."""

    def remove(_stage: str, part: float) -> None:
        if part == 1.0:
            shutil.rmtree(tmp_path / "run")
            (tmp_path / "run").mkdir()

    with pytest.raises(WriteError, match="could not be written: it is no longer the folder"):
        run(RunFolder(tmp_path / "run", checkpoint_seconds=1e6), report=remove)
    assert contents(tmp_path / "run") == {}


def test_names_are_numbered_and_taken_at_once(tmp_path: Path) -> None:
    """Eight ask at the same time: eight folders, each its own; what stays empty is removed."""
    both = threading.Barrier(8)
    found: list[Path] = []

    def take() -> None:
        both.wait()
        with numbered_folder(tmp_path / "results" / "name") as folder:
            both.wait()
            found.append(folder)
            if not folder.name.endswith("-5"):
                (folder / "file").touch()

    threads = [threading.Thread(target=take) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    names = {"name", *(f"name-{k}" for k in range(2, 9))}
    assert {folder.name for folder in found} == names
    assert {path.name for path in (tmp_path / "results").iterdir()} == names - {"name-5"}


def test_commands_at_once_without_out_all_run(tmp_path: Path) -> None:
    """Three processes, as of a job array: three results, each with its own seed."""
    command = [
        sys.executable,
        "-m",
        "ellipsoid_coupling",
        "run",
        "rotation",
        "--model",
        "microscopic",
    ]
    settings = ["particles.number=10", "interaction=none", "times=0.1", "particles.realisations=2"]
    processes = [
        subprocess.Popen(
            [*command, "--set", *settings, "--seed", str(seed)],
            cwd=tmp_path,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        for seed in range(3)
    ]
    for process in processes:
        told = process.communicate()[1]
        assert process.returncode == 0, told
    folders = sorted((tmp_path / "results").iterdir())
    name = "rotation-microscopic-accurate"
    assert [folder.name for folder in folders] == [name, f"{name}-2", f"{name}-3"]
    assert {ec.Result.load(folder).attributes["seed"] for folder in folders} == {0, 1, 2}
