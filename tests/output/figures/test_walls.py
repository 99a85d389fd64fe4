"""Walls in pictures: whole lines, openings seen on the frame, grey where there is no fluid."""

from __future__ import annotations

from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from PIL import Image

from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.output.figures.canvas import new_figure, show_domain
from ellipsoid_coupling.output.figures.walls import add_walls

BOX = (0.0, 2.0, 0.0, 1.0)
CORNERS = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
SIDES = {"bottom": (0, 1), "right": (1, 2), "top": (2, 3), "left": (3, 0)}


def panel(openings: tuple[str, ...], pieces: int = 1) -> Axes:
    """A box whose sides consist of so many edges each, some of them open."""
    part = np.linspace(0.0, 1.0, pieces + 1)[:, None]
    outline = polygon_outline(
        (
            name,
            "patch" if name in openings else "wall",
            (1.0 - part) * CORNERS[first] + part * CORNERS[last],
            False,
        )
        for name, (first, last) in SIDES.items()
    )
    axes = new_figure(3.0, 2.0).add_subplot()
    show_domain(axes, BOX)
    add_walls(axes, outline, BOX)
    return axes


def lines(axes: Axes) -> list[LineCollection]:
    return [c for c in axes.collections if isinstance(c, LineCollection)]


def pixels_beside(axes: Axes) -> dict[str, float]:
    """The darkest value, 0 to 255, across each side, averaged along its middle half."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.set_dpi(200.0)
    memory = BytesIO()
    figure.savefig(memory, format="png", dpi=200.0)
    with Image.open(memory) as image:
        picture = np.asarray(image.convert("L"), np.float64)
    height = picture.shape[0]
    found = {}
    for name, (first, last) in SIDES.items():
        part = np.linspace(0.25, 0.75, 101)[:, None]
        places = axes.transData.transform((1.0 - part) * CORNERS[first] + part * CORNERS[last])
        column, row = places.round().astype(int).T
        near = [
            picture[height - 1 - row + i, column + j] for i in range(-2, 3) for j in range(-2, 3)
        ]
        found[name] = float(np.min(near, axis=0).mean())
    return found


def test_a_side_of_many_edges_is_one_line() -> None:
    """One by one they would be dotted, and each would begin its dashes anew."""
    walls, blank, opening = lines(panel(("left",), pieces=40))
    assert [len(drawn.get_segments()) for drawn in (walls, blank, opening)] == [1, 1, 1]
    corners = np.asarray(walls.get_segments()[0])
    assert corners.shape == (121, 2)
    np.testing.assert_array_equal(corners[[0, -1]], [[0.0, 0.0], [0.0, 1.0]])


def test_an_opening_is_seen_on_the_frame() -> None:
    """A wall is black there, a closed frame as well; dashes of a mean grey have gaps."""
    found = pixels_beside(panel(("left", "top")))
    assert max(found["bottom"], found["right"]) < 20.0
    assert min(found["left"], found["top"]) > 100.0


def test_an_opening_beyond_the_panel_leaves_its_frame() -> None:
    """The panel shows a part of the fluid whose sides are on the same lines, and go on."""
    axes = panel(("left", "right", "top", "bottom"))
    zoomed = new_figure(3.0, 2.0).add_subplot()
    outline = polygon_outline([("far", "patch", np.array([[0.0, 3.0], [0.0, 2.0]]), False)])
    add_walls(zoomed, outline, BOX)
    assert [drawn.get_zorder() > 2.5 for drawn in lines(axes)] == [True, True]
    assert [drawn.get_zorder() > 2.5 for drawn in lines(zoomed)] == [False]
