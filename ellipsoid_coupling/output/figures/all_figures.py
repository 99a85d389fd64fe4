"""All figures that a set of results allows."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.output.figures.angles import draw_angles
from ellipsoid_coupling.output.figures.canvas import time_title
from ellipsoid_coupling.output.figures.density import DensityRow, density_rows, draw_density
from ellipsoid_coupling.output.figures.ellipses import draw_ellipses
from ellipsoid_coupling.output.figures.flow import draw_flow
from ellipsoid_coupling.output.labels import result_labels
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes.scene import Domain


class Group(NamedTuple):
    """The results of one scene and domain, the flow of each, and the name of their files."""

    name: str
    results: list[Result]
    flows: list[FlowField | None]


def draw_all(
    results: Sequence[Result],
    folder: Path,
    flow: FlowField | Sequence[FlowField | None] | None = None,
) -> list[Path]:
    """Draw the figures that apply, scene by scene; returns the paths in that order.

    density_SCENE.png, angles_SCENE.png; ellipses_SCENE_LABEL.png for every particle result;
    flow_SCENE.png with a flow (flow_SCENE_2.png, ... where results of one scene have others), as of
    the last saved time where it changes;
    SCENE.2, SCENE.3, ... for results of a scene of the same name on other domains;
    density_A_and_B.png where two scenes share domain and times (such as the cavity with and without
    interaction), in common colours and without the bare histograms. Results without any saved time
    are left out.

    Parameters
    ----------
    results : Results
    folder : made where it is missing
    flow : that of all results, or one a result; drawn for scenes that have a fluid
    """
    flows = flow if isinstance(flow, Sequence) else [flow] * len(results)
    scenes: dict[tuple[str, Domain], Group] = {}
    for result, own in zip(results, flows, strict=True):
        if result.times.size:
            key = result.scene.name, result.scene.domain
            if key not in scenes:
                taken = {group.name for group in scenes.values()}
                scenes[key] = Group(_free_name(result.scene.name, taken), [], [])
            group = scenes[key]
            group.results.append(result)
            group.flows.append(own if result.scene.flow else None)
    paths = []
    for group in scenes.values():
        paths += _draw_scene(group, folder)
    return paths + _draw_comparisons(list(scenes.values()), folder)


def _free_name(name: str, taken: set[str]) -> str:
    """`name`, or the first of `name`.2, `name`.3, ... that is not taken."""
    names = itertools.chain([name], (f"{name}.{number}" for number in itertools.count(2)))
    return next(free for free in names if free not in taken)


def _draw_scene(group: Group, folder: Path) -> list[Path]:
    results, scene = group.results, group.results[0].scene
    title = scene.title or scene.name
    paths = _draw_flows(group, folder, title)
    rows = _with_outlines(group, density_rows(results))
    paths.append(draw_density(rows, folder / f"density_{group.name}.png", title=title))
    paths.append(draw_angles(results, folder / f"angles_{group.name}.png", title=title))
    for label, result, flow in zip(result_labels(results), results, group.flows, strict=True):
        if result.layout == "particles":
            path = folder / f"ellipses_{group.name}_{_file_name(label)}.png"
            paths.append(draw_ellipses(result, path, flow=flow, title=title))
    return paths


def _with_outlines(group: Group, rows: list[DensityRow]) -> list[DensityRow]:
    """Rows with the outline of the fluid, if it is that of all results of the group."""
    flows = {flow.digest: flow for flow in group.flows if flow is not None}
    if len(flows) != 1 or None in group.flows:
        return rows
    (flow,) = flows.values()
    return [row._replace(outline=flow.outline) for row in rows]


def _draw_flows(group: Group, folder: Path, title: str) -> list[Path]:
    """Each flow of the group once; where there are several, their titles tell them apart."""
    scene = group.results[0].scene
    extent = (*scene.domain.x, *scene.domain.y)
    flows = list({flow.digest: flow for flow in group.flows if flow is not None}.values())
    paths = []
    for number, flow in enumerate(flows, 1):
        name = f"flow_{group.name}" + (f"_{number}" if number > 1 else "")
        above = title if len(flows) == 1 else f"{title}\nflow {number}: {flow.origin}"
        time = float(group.results[0].times[-1])
        now = flow.at(time)
        if now is not flow:
            above = f"{above}\nat {time_title(time)}".strip()
        paths.append(draw_flow(now, extent, folder / f"{name}.png", title=above))
    return paths


def _file_name(label: str) -> str:
    return re.sub(r"[^a-z0-9.]+", "_", label.lower()).strip("_")


def _draw_comparisons(groups: list[Group], folder: Path) -> list[Path]:
    """One density figure for each pair of scenes on the same domain at the same times."""
    paths = []
    for i, first in enumerate(groups):
        for second in groups[i + 1 :]:
            one, other = first.results[0].scene, second.results[0].scene
            if one.domain == other.domain and one.times == other.times:
                path = folder / f"density_{one.name}_and_{other.name}.png"
                rows = _named(first.results) + _named(second.results)
                paths.append(draw_density(rows, path, power=0.5, title=f"{one.name}, {other.name}"))
    return paths


def _named(group: list[Result]) -> list[DensityRow]:
    name = group[0].scene.name
    rows = density_rows(group, histograms=False)
    return [row._replace(label=f"{name}\n{row.label}") for row in rows]
