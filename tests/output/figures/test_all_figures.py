"""All figures at once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib import rc_context

from ellipsoid_coupling.cli import main
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.output.figures import draw_all
from ellipsoid_coupling.result import Result

from ..conftest import small_scene

FIGURES = "ellipsoid_coupling.output.figures.all_figures"


def test_draws_what_applies(
    particle_result: Result, rho_result: Result, lid_flow: FlowField, tmp_path: Path
) -> None:
    paths = draw_all([particle_result, rho_result], tmp_path / "figures", lid_flow)
    assert [path.name for path in paths] == [
        "flow_cavity.png",
        "density_cavity.png",
        "angles_cavity.png",
        "directors_cavity.png",
        "axes_cavity.png",
        "order_cavity.png",
        "ellipses_cavity_microscopic.png",
    ]
    assert sorted(paths) == sorted((tmp_path / "figures").iterdir())


def test_scenes_on_one_domain_are_compared(rho_result: Result, tmp_path: Path) -> None:
    free = replace(rho_result, scene=small_scene("cavity_free"))
    names = [path.name for path in draw_all([rho_result, free], tmp_path)]
    assert names[-1] == "density_cavity_and_cavity_free.png"
    assert len(names) == 2 * 5 + 1


def test_other_domains_of_a_scene_have_pictures_of_their_own(
    rho_result: Result, tmp_path: Path
) -> None:
    """One panel grid has one pair of axes; the second domain would be drawn in the first's limits."""
    scene = rho_result.scene
    domain = scene.domain.model_copy(update={"x": (-1.0, 0.0)})
    moved = replace(rho_result, scene=scene.model_copy(update={"domain": domain}))
    named_so = replace(rho_result, scene=moved.scene.model_copy(update={"name": "cavity.2"}))
    paths = draw_all([rho_result, moved, rho_result, named_so], tmp_path)
    assert [path.name for path in paths if path.name.startswith("density")][:3] == [
        "density_cavity.png",
        "density_cavity.2.png",
        "density_cavity.2.2.png",
    ]
    assert len(set(paths)) == len(paths)


@pytest.mark.parametrize("keep", [0, 1])
def test_failed_runs_show_what_they_reached(rho_result: Result, tmp_path: Path, keep: int) -> None:
    variables = {name: values[:keep] for name, values in rho_result.variables.items()}
    short = replace(rho_result, times=rho_result.times[:keep], variables=variables)
    assert len(draw_all([short], tmp_path)) == 5 * keep
    assert np.all(np.isfinite(rho_result.times))


@pytest.mark.parametrize(
    "title", [r"$\frac{1}$", "100 $ and 200 $ \U0001f600", r"a_b^c \$ % # &", "wide " * 60]
)
def test_titles_are_drawn_as_they_stand(
    particle_result: Result, lid_flow: FlowField, title: str, tmp_path: Path
) -> None:
    """No mathematics, no TeX, no font that lacks a letter ends in an error or a warning."""
    scene = particle_result.scene.model_copy(update={"title": title})
    told = particle_result.attributes | {"resolution": title, "seed": 0}
    results = [replace(particle_result, scene=scene, attributes=told)] * 2
    with rc_context({"text.usetex": True, "font.family": ["no such font"]}):
        assert draw_all(results, tmp_path, lid_flow)


@pytest.mark.parametrize(
    ("options", "look"),
    [
        ([], ("figure", "viridis")),
        (["--own-scales"], ("time", "viridis")),
        (["--paper-colours"], ("figure", "jet")),
    ],
)
def test_the_command_takes_scales_and_colours(
    rho_result: Result,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    options: list[str],
    look: tuple[str, str],
) -> None:
    scene = rho_result.scene.model_copy(update={"flow": None})
    replace(rho_result, scene=scene).save(tmp_path / "run" / "result.nc")
    seen: list[object] = []

    def note(rows: object, path: Path, *, scale: str, title: str, colours: str) -> Path:
        del rows, title
        seen.append((scale, colours))
        return path

    monkeypatch.setattr(f"{FIGURES}.draw_density", note)
    out = ["--out", str(tmp_path / "pictures")]
    with pytest.raises(SystemExit) as ended:
        main(["figures", str(tmp_path / "run"), *out, *options])
    assert ended.value.code == 0
    assert seen == [look]
