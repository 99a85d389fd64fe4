"""workflows/flow_order.py at a small size."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import pytest

from ellipsoid_coupling.flow.openfoam import programs

WORKFLOWS = Path(__file__).parents[2] / "workflows"


@pytest.mark.openfoam
@pytest.mark.skipif(not programs.openfoam_available(), reason="OpenFOAM is not installed")
@pytest.mark.usefixtures("own_cache")
def test_flow_order_writes_its_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The spline is third order; icoFoam on 10 to 40 cells not yet second, but it converges."""
    main = runpy.run_path(str(WORKFLOWS / "flow_order.py"))["main"]
    main(["--out", str(tmp_path), "--cells", "10", "20", "40", "--spline-cells", "32", "64"])
    solver, spline = json.loads((tmp_path / "flow_order.json").read_text()).values()
    assert 2.9 < spline[1]["rms_order"] < 3.15
    assert solver[1]["rms_order"] > 1.0
    assert "| 32 cells |" in capsys.readouterr().out
    assert "| 32 cells |" in (tmp_path / "flow_order.md").read_text(encoding="utf-8")
