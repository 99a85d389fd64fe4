"""`report` and `movie` on run folders: their files, and what they say of other paths."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from ellipsoid_coupling.commands.movie import frames_per_second
from ellipsoid_coupling.errors import InputError
from tests.command_line import FLOW, SMALL, status_of


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of particles."""
    folder = tmp_path_factory.mktemp("runs") / "microscopic"
    tokens = ["run", "cavity_free", "--model", "microscopic", *FLOW, *SMALL]
    assert status_of(*tokens, "--out", str(folder)) == 0
    return folder


def test_report_leaves_one_page(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert status_of("report", str(run), str(run / "result.nc"), "--out", str(out)) == 0
    told = capsys.readouterr()
    assert told.out == f"{out / 'report.html'}\n"
    assert "report: 0 %" in told.err
    assert [path.name for path in out.iterdir()] == ["report.html"]
    text = (out / "report.html").read_text("utf-8")
    assert f"ellipsoid run {run}/run.toml --out NEW_FOLDER" in text
    assert status_of("report", str(run), "--out", str(out)) == 2
    assert "--force" in capsys.readouterr().err
    assert status_of("report", str(run), "--out", str(out), "--force") == 0


def test_no_solver_is_started_for_a_report(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def started(*_: object, **__: object) -> None:
        raise AssertionError("something is solved or simulated")

    monkeypatch.setattr("ellipsoid_coupling.simulation.simulate", started)
    monkeypatch.setattr("ellipsoid_coupling.flow.provide.obtain_flow", started)
    monkeypatch.setattr("ellipsoid_coupling.flow.provide.solve_case", started)
    assert status_of("report", str(run), "--out", str(tmp_path)) == 0


def test_movie_goes_into_the_run_folder(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A GIF where there is no ffmpeg."""
    monkeypatch.setattr("ellipsoid_coupling.output.figures.film.find_ffmpeg", lambda: None)
    assert status_of("movie", str(run), "--fps", "4") == 0
    told = capsys.readouterr()
    lines = told.out.splitlines()
    assert lines[-1] == str(run / "movie.gif")
    assert lines[0].startswith("2 frames, 0.5 s.")
    assert "times=" in lines[0]
    assert "film: 100 %" in told.err
    assert (run / "movie.gif").read_bytes()[:6] == b"GIF89a"
    assert status_of("movie", str(run)) == 2
    assert "--force" in capsys.readouterr().err
    (run / "movie.gif").unlink()


def test_frames_per_second() -> None:
    assert frames_per_second(100, None, None) == 10.0
    assert frames_per_second(3, None, None) == 2.0
    assert frames_per_second(10_000, None, None) == 25.0
    assert frames_per_second(3, 0.5, None) == 0.5
    assert frames_per_second(30, None, 5.0) == 6.0
    with pytest.raises(InputError, match=r"0\.06 to 60 s for 3 frames"):
        frames_per_second(3, None, 0.01)


WRONG: list[tuple[list[str], str]] = [
    (["movie", "RUN", "--fps", "0"], "--fps"),
    (["movie", "RUN", "--fps", "nan"], "--fps"),
    (["movie", "RUN", "--seconds", "-1"], "--seconds"),
    (["movie", "RUN", "--seconds", "2", "--fps", "5"], "both"),
    (["movie", "RUN", "--out", "EMPTY/a.avi"], "ends in"),
    (["movie", "EMPTY"], "a folder without one"),
    (["movie", "KILLED"], "--resume"),
    (["movie", "COMPARED"], "the folder of a comparison"),
    (["figures", "COMPARED"], "`ellipsoid report`"),
    (["movie"], "RUN"),
    (["report"], "RUNS"),
    (["report", "nowhere"], "nowhere"),
    (["report", "RUN", "EMPTY"], "a folder without one"),
    (["report", "KILLED"], "has not ended"),
    (["report", "SWEEP"], "folder of a sweep"),
    (["report", "COMPARED"], "no rows"),
    (["report", "RUN", "--out", "RUN/run.toml"], "a file"),
]


@pytest.mark.parametrize(
    ("tokens", "told"), WRONG, ids=lambda v: v if isinstance(v, str) else " ".join(v)
)
def test_what_is_no_finished_run_gets_one_message(
    tokens: list[str],
    told: str,
    run: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folders = {"RUN": run}
    files = {"EMPTY": "", "KILLED": "run.toml", "COMPARED": "errors.csv", "SWEEP": "sweep.toml"}
    for name, file in files.items():
        folders[name] = tmp_path / name
        folders[name].mkdir()
        if file:
            (folders[name] / file).touch()
    for name, folder in folders.items():
        tokens = [token.replace(name, str(folder)) for token in tokens]
    assert status_of(*tokens) == 2
    out, err = capsys.readouterr()
    assert told in err
    assert "Traceback" not in err + out
    assert len([line for line in err.splitlines() if line.startswith("ellipsoid:")]) == 1


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
@pytest.mark.parametrize("command", ["report", "movie"])
def test_a_folder_that_cannot_be_written(
    command: str, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    out = closed / ("a.gif" if command == "movie" else "out")
    assert status_of(command, str(run), "--out", str(out)) == 2
    assert "no permission" in capsys.readouterr().err
