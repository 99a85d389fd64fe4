"""Every example of the gallery, as it stands: small enough for a test."""

from __future__ import annotations

import runpy
from pathlib import Path

import matplotlib as mpl
import matplotlib.image
import matplotlib.pyplot as plt
import pytest

GALLERY = Path(__file__).parents[2] / "workflows" / "gallery"
EXAMPLES = sorted(path.stem for path in GALLERY.glob("*.py"))


def test_there_are_ten_examples_at_least() -> None:
    assert len(EXAMPLES) >= 10


@pytest.mark.filterwarnings("ignore:FigureCanvasAgg is non-interactive")
@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_runs_and_leaves_a_picture(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a script, in an empty folder; each figure, shown or written, has more than one colour."""
    mpl.use("agg")
    monkeypatch.chdir(tmp_path)
    try:
        runpy.run_path(str(GALLERY / f"{name}.py"), run_name="__main__")
        for number in plt.get_fignums():
            plt.figure(number).savefig(f"figure_{number}.png")
    finally:
        plt.close("all")
    pictures = list(tmp_path.glob("*.png"))
    assert pictures
    for picture in pictures:
        assert matplotlib.image.imread(picture)[..., :3].std() > 0.01
