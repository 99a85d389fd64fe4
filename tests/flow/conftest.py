"""What the flow tests share: the solved cases of tests/data and a known stream function."""

from __future__ import annotations

from pathlib import Path

import pytest

DATA = Path(__file__).parents[1] / "data"


@pytest.fixture
def cavity_16() -> Path:
    """A cavity solved on 16 x 16 cells, with foamToVTK's files in VTK."""
    return DATA / "cavity_16"


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of this test's own."""
    monkeypatch.setenv("ELLIPSOID_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"
