"""The pictures of pages and README are those of today's code."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[2] / "workflows"))
import stamps

TOP = Path(__file__).parents[2]
PICTURES = TOP / "workflows" / "pictures"
AGAIN = "draw it again: bash workflows/results.sh --only PART"


def test_every_picture_has_a_stamp_and_a_module_that_draws_it() -> None:
    names = {path.name for path in PICTURES.glob("*.png")}
    assert set(stamps.read_stamps(PICTURES)) == names == set(stamps.DRAWN_BY)


@pytest.mark.parametrize("name", sorted(stamps.DRAWN_BY))
def test_a_picture_is_the_stamped_one_and_todays_code_draws_it(name: str) -> None:
    stamp = stamps.read_stamps(PICTURES)[name]
    assert stamp["picture"] == stamps.checksum(PICTURES / name), AGAIN
    assert re.match(r"Measured .*at commit [0-9a-f]{7}", stamp["made"])
    if stamp["drawn_by"] == stamps.EARLIER:
        assert name in stamps.MAY_WAIT, AGAIN
    else:
        assert stamp["drawn_by"] == stamps.drawing_digest(name), AGAIN


def test_pictures_that_pages_show_are_there() -> None:
    texts = [(TOP / "README.md").read_text("utf-8")]
    pages = TOP / "workflows" / "docs" / "pages"
    texts += [path.read_text("utf-8") for path in pages.rglob("*.md")]
    shown = {name for text in texts for name in re.findall(r"pictures/([\w.]+\.png)\)", text)}
    assert shown == set(stamps.DRAWN_BY)


def test_a_digest_follows_code_but_not_documentation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the module and of what it imports."""
    folder = tmp_path / "ellipsoid_coupling" / "output"
    (folder / "figures").mkdir(parents=True)
    flow = folder / "figures" / "flow.py"
    labels = folder / "labels.py"
    flow.write_text("from ellipsoid_coupling.output.labels import literal\n")
    labels.write_text('"""Labels."""\nA = 1\n')
    monkeypatch.setattr(stamps, "TOP", tmp_path)
    first = stamps.drawing_digest("flow.png")
    labels.write_text('"""Other words."""\n# A comment.\nA = 1\n')
    assert stamps.drawing_digest("flow.png") == first
    labels.write_text("A = 2\n")
    assert stamps.drawing_digest("flow.png") != first
