"""The sketch: three names, a file."""

from __future__ import annotations

from pathlib import Path

from ellipsoid_coupling.output.figures import draw_sketch
from ellipsoid_coupling.output.figures.sketch import sketch_figure


def test_sketch_names_position_angle_and_velocity(tmp_path: Path) -> None:
    texts = {text.get_text() for text in sketch_figure().axes[0].texts}
    assert {r"$\theta$", "$r$", "$v$"} <= texts
    assert draw_sketch(tmp_path / "sketch.png").stat().st_size > 1000
