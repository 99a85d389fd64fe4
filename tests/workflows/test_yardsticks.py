"""Yardsticks are made as the workflow says, at sizes that mean nothing."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from ellipsoid_coupling.compare.yardsticks import load_yardstick

sys.path.append(str(Path(__file__).parents[2] / "workflows"))
import yardsticks


def test_a_combined_one_and_one_of_several_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both kinds leave a file that loads, with errors above 0 and a line of origin."""
    recipes = yardsticks.RECIPES
    few = {"rotation": recipes["rotation"], "stationary": recipes["stationary"]._replace(runs=2)}
    monkeypatch.setattr(yardsticks, "RECIPES", few)
    files = yardsticks.main(["--quick", "--out", str(tmp_path)])
    printed = capsys.readouterr().out
    assert [path.name.split("-")[0] for path in files] == ["rotation", "stationary"]
    for path, groups in zip(files, (1, 2), strict=True):
        found = load_yardstick(path)
        assert len(found.bins.angle) == groups
        assert found.bins.angle.sum(axis=-1) == pytest.approx(1.0, abs=1e-5)
        assert min(errors.max() for errors in found.error) > 0.0
        assert found.origin in printed
        assert "density and angle may be off by" in found.origin
