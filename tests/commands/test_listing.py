"""`scenes`, `models`, `schema` and a run without a model: what there is, told by the program."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ellipsoid_coupling.flow.provide import SHIPPED
from ellipsoid_coupling.models import SCHEMES, model_kinds
from ellipsoid_coupling.output.scene_schema import SCHEMA_FILE, SCHEMA_LINE
from ellipsoid_coupling.scenes import builtin_scenes, load_scene
from tests.command_line import status_of

# Those of the package; other tests register more.
OURS = [kind.name for kind in model_kinds() if kind.rank < 100]


def table_rows(text: str) -> dict[str, str]:
    """The rows of a printed table, by their first cell; continued lines joined."""
    rows: dict[str, str] = {}
    name = ""
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("│┃").split("│")]
        if len(cells) > 1:
            name = cells[0] or name
            rows[name] = f"{rows.get(name, '')} {' '.join(cells[1:])}"
    return rows


def test_scenes_are_listed_with_the_models_that_fit(capsys: pytest.CaptureFixture[str]) -> None:
    assert status_of("scenes") == 0
    rows = table_rows(capsys.readouterr().out)
    assert set(builtin_scenes()) <= set(rows)
    assert "Driven cavity with interaction" in rows["cavity"]
    assert "all but stationary_state" in rows["cavity"]
    assert "walls" in rows["cavity"]
    assert "walls" not in rows["cavity_free"]
    assert "none" in rows["stationary"]


def test_models_are_listed_with_what_they_solve_and_need(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert status_of("models") == 0
    rows = table_rows(capsys.readouterr().out)
    assert set(OURS) <= set(rows)
    for kind in model_kinds():
        if kind.name in OURS:
            assert kind.solves
            for scheme in SCHEMES:
                assert scheme in rows[kind.name]
    assert "[outer_potential]" in rows["stationary_state"]


def test_a_run_without_a_model_is_told_which_fit(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def touched(*_: object, **__: object) -> None:
        raise AssertionError("a run begins")

    monkeypatch.setattr("ellipsoid_coupling.simulation.simulate", touched)
    assert status_of("run", "cavity") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "microscopic, mckean_vlasov" in line
    assert "stationary_state" not in line
    assert "--model microscopic" in line
    assert status_of("run", "stationary") == 2
    assert "stationary_state" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["run", "plan", "sweep", "warm-up"])
def test_help_lists_all_models(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Written by hand: asking the models takes a second, which help does not."""
    assert status_of(command, "--help") == 0
    words = capsys.readouterr().out.replace(",", " ").replace(";", " ").replace(".", " ").split()
    assert set(OURS) <= set(words)
    if command in ("run", "sweep"):
        assert set(SCHEMES) <= set(words)


def test_help_marks_what_is_required(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("run", "plan", "figures", "report", "movie", "export", "flow", "new"):
        assert status_of(command, "--help") == 0
        assert "[required]" in capsys.readouterr().out


def test_the_schema_is_printed_or_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status_of("schema") == 0
    printed = json.loads(capsys.readouterr().out)
    file = tmp_path / SCHEMA_FILE
    assert status_of("schema", "--out", str(file)) == 0
    assert json.loads(file.read_text()) == printed
    assert capsys.readouterr().out == f"{file}\n"
    assert status_of("schema", "--out", str(file)) == 2
    assert "--force" in capsys.readouterr().err
    assert status_of("schema", "--out", str(file), "--force") == 0
    assert status_of("schema", "--out", str(tmp_path)) == 2
    assert "a folder" in capsys.readouterr().err


def test_a_new_scene_names_its_schema_where_it_is_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = str(SHIPPED / "cavity.npz")
    plain, named = tmp_path / "a.toml", tmp_path / "b.toml"
    assert status_of("new", case, "--out", str(plain)) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["a.toml"]
    assert status_of("new", case, "--out", str(named), "--schema") == 0
    assert named.read_text() == f"{SCHEMA_LINE}\n{plain.read_text()}"
    assert load_scene(named) == load_scene(plain)
    assert "properties" in json.loads((tmp_path / SCHEMA_FILE).read_text())
    # Again: the same schema is no reason to refuse.
    assert status_of("new", case, "--out", str(tmp_path / "c.toml"), "--schema") == 0
    (tmp_path / SCHEMA_FILE).write_text("mine")
    capsys.readouterr()
    assert status_of("new", case, "--out", str(tmp_path / "d.toml"), "--schema") == 2
    assert SCHEMA_FILE in capsys.readouterr().err
    assert not (tmp_path / "d.toml").exists()
    assert status_of("new", case, "--schema") == 2


def test_completion_is_made_for_a_shell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Into a home of its own; the script knows the commands."""
    monkeypatch.setenv("HOME", str(tmp_path))
    assert status_of("--install-completion", "--shell", "bash") == 0
    (script,) = [p for p in tmp_path.rglob("*") if p.is_file() and p.name != ".bashrc"]
    assert "warm-up" in script.read_text()
    assert str(script) in (tmp_path / ".bashrc").read_text()
    assert str(script) in capsys.readouterr().out
    assert status_of("--install-completion", "--shell", "abacus") == 2
