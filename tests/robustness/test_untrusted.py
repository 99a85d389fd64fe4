"""Code in OpenFOAM cases: reading a solved one runs nothing of it; solving: tests/flow/test_trust."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from ellipsoid_coupling.flow.openfoam.reader import read_case
from tests.flow.openfoam.ways_in import CODE, TOUCH
from tests.robustness.conftest import within_limits

DATA = Path(__file__).parents[1] / "data"


def test_reading_a_solved_case_runs_nothing_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of it at once, in dictionaries, in U and in a script: the field is the same, no marker."""
    case = Path(shutil.copytree(DATA / "cavity_16", tmp_path / "case"))
    everything = "\n".join(CODE.values())
    (case / "system" / "controlDict").write_text(everything)
    (case / "system" / "functions").write_text(everything)
    (case / "Allrun").write_text("#!/bin/sh\ntouch marker\n")
    (case / "dynamicCode").mkdir()
    u = case / "3.95" / "U"
    text = u.read_text("utf-8")
    coded = (
        f"type codedFixedValue; libs (mine); code #{{ {TOUCH}; }} #}};\n"
        f"x #codeStream {{ code #{{ {TOUCH}; #}}; }};\n"
        'refValue #calc "1";\n#include "/tmp/other"\n'
    )
    assert "type            exprFixedValue;" in text
    u.write_text(text.replace("type            exprFixedValue;", coded))
    monkeypatch.chdir(case)
    before = sorted(tmp_path.rglob("*"))
    with within_limits():
        field = read_case(case)
    assert sorted(tmp_path.rglob("*")) == before
    own = read_case(DATA / "cavity_16")
    assert (field.arrays.coefficients == own.arrays.coefficients).all()
