"""The table of cases, without runs: what is read is told with its misfit, what is not with the reason."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.workflows.test_workflows import workflow

DATA = Path(__file__).parents[1] / "data"


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
    assert "refused: " in other
    assert "no system/controlDict in it" in other
