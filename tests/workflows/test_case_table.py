"""The table of cases, without runs: what is read is told with its misfit, what is not with the reason."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from ellipsoid_coupling.errors import RunError
from tests.workflows.test_workflows import WORKFLOWS, workflow

DATA = Path(__file__).parents[1] / "data"


@pytest.fixture(autouse=True)
def _beside(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workflows import one another by name."""
    monkeypatch.syspath_prepend(str(WORKFLOWS))


def test_a_row_tells_what_a_user_would_see(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    nothing = tmp_path / "no case"
    nothing.mkdir()
    assert workflow("case_table").main([str(DATA / "cylinder_8"), str(nothing), "--models"]) == 0
    head, _, cylinder, other = capsys.readouterr().out.splitlines()
    assert head == "| case | read | slip | rms |"
    assert cylinder.startswith("| cylinder_8 | yes | ")
    assert cylinder.count("%") == 2
    assert "refused: no case: expected" in other
    assert "no system/controlDict in it" in other
    assert str(tmp_path) not in other


def test_models_that_do_not_run_are_named() -> None:
    """All others in one word; nothing of a case that is refused."""
    rows = [
        ("case", "read", "slip", "rms", "a", "b"), ("x", "yes", "0", "1 %", "runs", "runs"),
        ("y", "yes", "0", "1 %", "runs", "fails: why"), ("z", "refused: so", "", "", "", ""),
        ("w", "yes", "0", "1 %", "fails: why", "fails: why"),
    ]  # fmt: skip
    found = workflow("case_table").narrow(rows)
    assert found[0] == ("case", "read", "slip", "rms", "a, b")
    assert [row[-1] for row in found[1:]] == [
        "all run", "b fails: why; the others run", "", "all fails: why",
    ]  # fmt: skip


def test_a_tutorial_is_copied_ready_to_be_solved(tmp_path: Path) -> None:
    """Dictionaries unpacked, 0 from 0.orig; its name tells the solver."""
    tutorials = workflow("solved_tutorials")
    source = tmp_path / "examples" / "basic" / "potentialFoam" / "pitzDaily"
    for folder in ("0.orig", "system"):
        (source / folder).mkdir(parents=True)
    (source / "system" / "blockMeshDict.gz").write_bytes(gzip.compress(b"vertices ();"))
    (source / "0.orig" / "U").write_text("uniform")
    (one,) = (t for t in tutorials.TUTORIALS if t.path == "basic/potentialFoam/pitzDaily")
    assert one.name == "potentialFoam_pitzDaily"
    tutorials.copy_tutorial(one, tmp_path / "case", tmp_path / "examples")
    assert (tmp_path / "case" / "system" / "blockMeshDict").read_text() == "vertices ();"
    assert (tmp_path / "case" / "0" / "U").read_text() == "uniform"
    assert len({t.name for t in tutorials.TUTORIALS}) == len(tutorials.TUTORIALS)


def test_missing_examples_are_told_with_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"apt-get install .* openfoam-examples"):
        workflow("solved_tutorials").require_examples(tmp_path / "nothing")
