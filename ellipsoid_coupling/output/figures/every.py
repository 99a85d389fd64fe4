"""All figures that a set of results allows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.output.figures.angles import draw_angles
from ellipsoid_coupling.output.figures.density import DensityRow, density_rows, draw_density
from ellipsoid_coupling.output.figures.ellipses import draw_ellipses
from ellipsoid_coupling.output.figures.flow import draw_flow
from ellipsoid_coupling.output.labels import result_labels
from ellipsoid_coupling.result import Result

Group = list[Result]


def draw_all(results: Sequence[Result], folder: Path, flow: FlowField | None = None) -> list[Path]:
    """Draw what applies, scene by scene; the paths in the order drawn.

    density_SCENE.png, angles_SCENE.png; ellipses_SCENE_LABEL.png for every particle result;
    flow_SCENE.png with a flow, for scenes that have a fluid; density_A_and_B.png where two scenes
    share domain and times (such as the cavity with and without interaction), in common colours and
    without the bare histograms. Results without any saved time are left out.
    """
    scenes: dict[str, Group] = {}
    for result in results:
        if result.times.size:
            scenes.setdefault(result.scene.name, []).append(result)
    paths = []
    for group in scenes.values():
        paths += _draw_scene(group, folder, flow if group[0].scene.flow else None)
    return paths + _draw_comparisons(list(scenes.values()), folder)


def _draw_scene(group: Group, folder: Path, flow: FlowField | None) -> list[Path]:
    scene = group[0].scene
    title = scene.title or scene.name
    extent = (*scene.domain.x, *scene.domain.y)
    paths = []
    if flow is not None:
        paths.append(draw_flow(flow, extent, folder / f"flow_{scene.name}.png", title=title))
    rows = density_rows(group)
    paths.append(draw_density(rows, folder / f"density_{scene.name}.png", title=title))
    paths.append(draw_angles(group, folder / f"angles_{scene.name}.png", title=title))
    for label, result in zip(result_labels(group), group, strict=True):
        if result.layout == "particles":
            path = folder / f"ellipses_{scene.name}_{_file_name(label)}.png"
            paths.append(draw_ellipses(result, path, flow=flow, title=title))
    return paths


def _file_name(label: str) -> str:
    return re.sub(r"[^a-z0-9.]+", "_", label.lower()).strip("_")


def _draw_comparisons(groups: list[Group], folder: Path) -> list[Path]:
    """One density figure for each pair of scenes on the same domain at the same times."""
    paths = []
    for i, first in enumerate(groups):
        for second in groups[i + 1 :]:
            one, other = first[0].scene, second[0].scene
            if one.domain == other.domain and one.times == other.times:
                path = folder / f"density_{one.name}_and_{other.name}.png"
                rows = _named(first) + _named(second)
                paths.append(draw_density(rows, path, power=0.5, title=f"{one.name}, {other.name}"))
    return paths


def _named(group: Group) -> list[DensityRow]:
    name = group[0].scene.name
    rows = density_rows(group, histograms=False)
    return [row._replace(label=f"{name}\n{row.label}") for row in rows]
