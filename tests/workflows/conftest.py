"""Shared by the tests of workflows."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _few_dots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of few dots, which are drawn faster; how many there are is no test's subject here."""
    monkeypatch.setattr("ellipsoid_coupling.output.figures.canvas.DOTS_PER_INCH", 60)
