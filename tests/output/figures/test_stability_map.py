"""The stability map in groups: what one entry says of several cases."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pytest

from ellipsoid_coupling.output.figures.stability import look_of, look_of_group, stability_figure


@dataclass(frozen=True)
class Entry:
    family: str
    case: str
    model: str
    scheme: str
    outcome: str = "completed"
    error: float = math.nan
    needed_step: float = math.nan


def entries(*outcomes: tuple[str, float]) -> list[Entry]:
    return [
        Entry("drag", f"drag {k}", "microscopic", "paper", outcome, error)
        for k, (outcome, error) in enumerate(outcomes)
    ]


@pytest.mark.parametrize(
    ("outcomes", "words"),
    [
        ([("completed", 0.02), ("completed", 0.3), ("completed", math.nan)], "0.3"),
        ([("completed", 0.02), ("stopped", math.nan), ("not applicable", math.nan)], "1 of 2"),
        ([("not applicable", math.nan)] * 2, "-"),
        ([("refused", math.nan)], "bad in."),
        ([("completed", math.nan)], "?"),
        ([("refused", math.nan), ("completed", 2e-3)], "2e-3"),
    ],
)
def test_a_group_shows_its_largest_error_or_how_many_failed(
    outcomes: list[tuple[str, float]], words: str
) -> None:
    assert look_of_group(entries(*outcomes)).words == words


def test_what_is_broken_is_not_called_stopped() -> None:
    look = look_of_group(entries(("stopped", math.nan), ("broken", 0.1), ("completed", 0.1)))
    assert look.words == "2 of 3"
    assert look.fill == look_of(entries(("broken", 0.1))[0]).fill


def test_a_row_a_group_and_the_definition_below() -> None:
    """Nothing of it lies outside of the figure."""
    several = entries(("completed", 0.02), ("completed", 0.3))
    several.append(Entry("as it is", "as it is", "microscopic", "accurate", error=1e-5))
    figure = stability_figure(several, grouped=True)
    labels = [tick.get_text() for tick in figure.axes[0].get_yticklabels()]
    assert labels == ["drag (2)", "as it is"]
    assert [text.get_text() for text in figure.axes[0].texts[:2]] == ["0.3", "1e-5"]
    (definition,) = [text for text in figure.texts if "Error" in text.get_text()]
    assert "widths of the domain" in definition.get_text()
    assert len(stability_figure(several).axes[0].get_yticklabels()) == 3


def test_the_print_of_a_whole_map_stays_inside() -> None:
    """With all models there are."""
    models = ["microscopic", "mckean_vlasov", "q_maxwellian", "q_mono_kinetic"]
    models += ["rho_mono_kinetic", "diffusive", "stationary_state"]
    whole = [
        Entry("drag", f"drag {k}", m, s, error=0.1)
        for k in range(3)
        for m in models
        for s in ("paper", "accurate")
    ]
    figure = stability_figure(whole, grouped=True)
    boxes = [text.get_window_extent() for text in (*figure.texts, *figure.axes[0].texts)]
    boxes += [tick.get_window_extent() for tick in figure.axes[0].get_yticklabels()]
    boxes.append(figure.legends[0].get_window_extent())
    assert all(box.x0 >= 0.0 and box.x1 <= figure.bbox.x1 for box in boxes)
    assert all(box.y0 >= 0.0 and box.y1 <= figure.bbox.y1 for box in boxes)
    legend, (definition, *_) = figure.legends[0].get_window_extent(), figure.texts
    assert definition.get_window_extent().y1 <= legend.y0
