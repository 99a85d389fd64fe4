"""`plot` of results and flows: one figure, whatever the layout, drawn from the numbers asked for."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from matplotlib.patches import StepPatch

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.output.figures.canvas import ShownFigure
from tests.small_runs import small_runs


@pytest.mark.parametrize("model", ["microscopic", "rho_mono_kinetic", "q_mono_kinetic"])
def test_a_result_of_each_layout_is_drawn(model: str, tmp_path: Path) -> None:
    """The picture holds the density of that time, and the steps the angle distribution."""
    _, result = next(iter(small_runs([model])))
    figure = result.plot(path=tmp_path / "result.png")
    picture, angles = figure.axes[0].images[0], figure.axes[1].patches[0]
    assert isinstance(angles, StepPatch)
    assert isinstance(figure, ShownFigure)
    shown = np.asarray(picture.get_array())
    wanted = result.density(60) if result.layout == "particles" else result.cell_density()
    assert np.array_equal(shown, wanted[-1])
    assert np.array_equal(angles.get_data()[0], result.angle_distribution(60)[-1])
    assert matplotlib.image.imread(tmp_path / "result.png")[..., :3].std() > 0.01
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_a_time_that_was_not_saved_is_refused() -> None:
    _, result = next(iter(small_runs(["rho_mono_kinetic"])))
    with pytest.raises(InputError, match="one of the 1 saved times, from -1 to 0, found 3"):
        result.plot(3)


def test_a_flow_is_drawn_in_its_rectangle_or_where_it_is_asked_for(
    rotation_flow: ec.FlowField, tmp_path: Path
) -> None:
    field = ec.FlowField.from_function(lambda x, y: (y, -x), ((0.0, 2.0), (0.0, 1.0)), cells=4)
    for figure, limits in (
        (field.plot(path=tmp_path / "flow.png"), (0.0, 2.0, 0.0, 1.0)),
        (field.plot(((0.5, 1.0), (0.0, 0.5))), (0.5, 1.0, 0.0, 0.5)),
        (rotation_flow.plot(), (-1.0, 1.0, -1.0, 1.0)),
    ):
        axes = figure.axes[0]
        assert (*axes.get_xlim(), *axes.get_ylim()) == limits
    assert matplotlib.image.imread(tmp_path / "flow.png")[..., :3].std() > 0.01


def test_a_flow_and_a_result_are_shown_in_one_line_and_as_a_table() -> None:
    field = ec.FlowField.from_function(lambda x, y: (y, -x), ((0.0, 2.0), (0.0, 1.0)), cells=4)
    assert repr(field).startswith("<FlowField: a formula, ")
    assert "in [0.0, 2.0] x [0.0, 1.0], on 4 x 4 cells" in repr(field)
    _, result = next(iter(small_runs(["rho_mono_kinetic"])))
    assert repr(result).startswith("<Result of rho_mono_kinetic on stationary: completed, scheme ")
    for one in (field, result):
        assert one._repr_html_().startswith("<table><caption>")
        assert repr(one).isprintable()
