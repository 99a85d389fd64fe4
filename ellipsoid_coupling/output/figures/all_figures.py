"""All figures that a set of results allows."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.output.figures.angles import draw_angles
from ellipsoid_coupling.output.figures.canvas import time_title
from ellipsoid_coupling.output.figures.density import (
    DensityRow,
    Scale,
    density_rows,
    draw_density,
)
from ellipsoid_coupling.output.figures.directors import axis_rows, draw_directors
from ellipsoid_coupling.output.figures.ellipses import draw_ellipses
from ellipsoid_coupling.output.figures.flow import draw_flow
from ellipsoid_coupling.output.figures.order import draw_order
from ellipsoid_coupling.output.figures.style import DENSITY_COLOURS
from ellipsoid_coupling.output.labels import literal, result_labels
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes.scene import Domain

# Called with the work and the part of it that is done.
Report = Callable[[str, float], None]


class Group(NamedTuple):
    """The results of one scene and domain, the flow of each, and the name of their files."""

    name: str
    results: list[Result]
    flows: list[FlowField | None]


class Look(NamedTuple):
    """How densities are coloured: in one scale for a figure or one for each time, and which map."""

    scale: Scale = "figure"
    colours: str = DENSITY_COLOURS


_LOOK = Look()


def draw_all(
    results: Sequence[Result],
    folder: Path,
    flow: FlowField | Sequence[FlowField | None] | None = None,
    look: Look = _LOOK,
    report: Report | None = None,
) -> list[Path]:
    """Draw the figures that apply, scene by scene; returns the paths in that order.

    density_SCENE.png, angles_SCENE.png; directors_SCENE.png and axes_SCENE.png, the mean axes as lines
    and as colours; order_SCENE.png; ellipses_SCENE_LABEL.png for every particle result;
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
    look : of the densities
    report : called after each figure with what is drawn and the part that is done
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
    for number, group in enumerate(scenes.values()):
        count = _count(group)
        for drawn, path in enumerate(_draw_scene(group, folder, look), 1):
            paths.append(path)
            if report is not None:
                report(f"figures of {group.name}", (number + drawn / count) / len(scenes))
    return paths + _draw_comparisons(list(scenes.values()), folder, look)


def _free_name(name: str, taken: set[str]) -> str:
    """`name`, or the first of `name`.2, `name`.3, ... that is not taken."""
    names = itertools.chain([name], (f"{name}.{number}" for number in itertools.count(2)))
    return next(free for free in names if free not in taken)


def _count(group: Group) -> int:
    """How many figures a group has: five, one more for each flow and for each particle result."""
    flows = len(_distinct(group.flows))
    return 5 + flows + sum(result.layout == "particles" for result in group.results)


def _draw_scene(group: Group, folder: Path, look: Look) -> Iterator[Path]:
    """The figures, one after the other."""
    results, scene = group.results, group.results[0].scene
    title = scene.title or scene.name
    yield from _draw_flows(group, folder, title)

    def path(kind: str) -> Path:
        return folder / f"{kind}_{group.name}.png"

    rows = density_rows(results, flow=group.flows)
    yield draw_density(rows, path("density"), scale=look.scale, title=title, colours=look.colours)
    axes = axis_rows(results, group.flows)
    yield draw_angles(results, path("angles"), title=title)
    yield draw_directors(axes, path("directors"), title=title)
    yield draw_directors(axes, path("axes"), kind="colours", title=title)
    yield draw_order(results, path("order"), title=title)
    for label, result, flow in zip(result_labels(results), results, group.flows, strict=True):
        if result.layout == "particles":
            picture = folder / f"ellipses_{group.name}_{_file_name(label)}.png"
            yield draw_ellipses(result, picture, flow=flow, title=title)


def _draw_flows(group: Group, folder: Path, title: str) -> list[Path]:
    """Each flow of the group once; where there are several, their titles tell them apart."""
    scene = group.results[0].scene
    extent = (*scene.domain.x, *scene.domain.y)
    flows = _distinct(group.flows)
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


def _distinct(flows: Sequence[FlowField | None]) -> list[FlowField]:
    return list({flow.digest: flow for flow in flows if flow is not None}.values())


def _file_name(label: str) -> str:
    return re.sub(r"[^a-z0-9.]+", "_", label.lower()).strip("_")


def _draw_comparisons(groups: list[Group], folder: Path, look: Look) -> list[Path]:
    """One density figure for each pair of scenes on the same domain at the same times."""
    paths = []
    for i, first in enumerate(groups):
        for second in groups[i + 1 :]:
            one, other = first.results[0].scene, second.results[0].scene
            if one.domain == other.domain and one.times == other.times:
                path = folder / f"density_{one.name}_and_{other.name}.png"
                drawn = draw_density(
                    _named(first) + _named(second),
                    path,
                    scale=look.scale,
                    power=0.5,
                    title=f"{one.name}, {other.name}",
                    colours=look.colours,
                )
                paths.append(drawn)
    return paths


def _named(group: Group) -> list[DensityRow]:
    name = literal(group.results[0].scene.name)
    return [
        row._replace(label=f"{name}\n{row.label}", details=f"{name}, {row.details}")
        for row in density_rows(group.results, histograms=False, flow=group.flows)
    ]
