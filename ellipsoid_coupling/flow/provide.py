"""Which flow a scene gets: the named one, else the cache's, else a new run, else the shipped."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.analytic import closed_form_flow
from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.kept_fields import kept_field
from ellipsoid_coupling.flow.misfit import require_near
from ellipsoid_coupling.flow.openfoam.programs import INSTALL, openfoam_available
from ellipsoid_coupling.flow.openfoam.solve import Report, solve_case
from ellipsoid_coupling.flow.openfoam.solved_cases import (
    case_folder,
    is_solved,
    kept_folders,
    solved_folder,
)
from ellipsoid_coupling.flow.series import load_flow
from ellipsoid_coupling.flow.when import LATEST, Divergence, When
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.scenes.scene import Domain, Flow

SHIPPED = Path(__file__).parent / "shipped"


class Wanted(NamedTuple):
    """Which flow a user asks for.

    path : of a solved case, or of what `flow_at` reads; None for the scene's own
    allow_misfit : take a field that is far off the solver's U, see `reader.read_case`
    solve : run the solver of the case at `path`, as its controlDict says; the solution is kept in the cache
    """

    path: Path | None = None
    allow_misfit: bool = False
    solve: bool = False


def wanted_path(wanted: Wanted, report: Report | None = None) -> Path | None:
    """Where the flow that is wanted lies; the case there is solved first, if that is asked for.

    The solution goes into the cache, and is taken from there when it is asked for again.

    Raises
    ------
    InputError
        For a case that `solve_case` refuses, or none to be solved.
    RunError
        As `solve_case`.
    """
    if not wanted.solve:
        return wanted.path
    if wanted.path is None:
        raise InputError("--solve", "--flow CASE, the case to be solved", "none", "Add it.")
    return solve_case(wanted.path, report=report, to_rest=False)


def found_flow(scene: Scene, part: Flow, wanted: Wanted, report: Report | None = None) -> FlowField:
    """The flow at the path that is `wanted`, else the one that `part`, the scene's [flow], names."""
    path = wanted_path(wanted, report)
    if path is None and part.source == "closed_form":
        return closed_form_flow(part, scene.domain)
    if path is None and part.source == "given":
        raise InputError(
            f"scene {scene.name}, key flow.source", "the flow that it says is given", "none",
            "Give one: --flow CASE, or flow=... in Python.",
        )  # fmt: skip
    if path is None and part.case is not None:
        path = Path(part.case)
    named = part.name, part.cells, path
    when = When(part.time, part.repeat, scene.times[-1], part.divergence)
    return obtain_flow(*named, report=report, allow_misfit=wanted.allow_misfit, when=when)


def names_flow(given: FlowField | Wanted | str | Path | None) -> bool:
    """Whether a flow is given, and not only how to take the scene's own."""
    return given.path is not None if isinstance(given, Wanted) else given is not None


def obtain_flow(
    case: str,
    cells: int,
    path: Path | None = None,
    processes: int = 2,
    report: Report | None = None,
    *,
    allow_misfit: bool = False,
    when: When = LATEST,
) -> FlowField:
    """The flow of a case; `origin` says in one line which of the four sources it came from.

    Parameters
    ----------
    case : built-in name or folder, see `solve_case`
    cells, processes : for the run, if there is one
    path : a solved case folder, a foamToVTK folder or a saved .npz, which then is the flow
    report : called with stage and fraction while OpenFOAM runs, or many times are read
    allow_misfit : take a field that is far off the solver's U, see `reader.read_case`
    when : what of the case: its times, and whether its sources; a saved .npz has its own

    Raises InputError for a path or case that does not fit, and where OpenFOAM is missing and no
    field is shipped for the case; RunError if the run fails.
    """
    latest = partial(flow_at, allow_misfit=allow_misfit, divergence=when.divergence)
    read = partial(_at_times, when=when, allow_misfit=allow_misfit, report=report)
    if path is not None:
        if when.is_latest or path.suffix == ".npz":
            return _from("given", latest(path))
        return _from("given", read(path))
    if openfoam_available():
        solved, source = solved_folder(case, cells), "cache"
        if not is_solved(solved):
            # A case that can run code is refused here; `ellipsoid flow CASE --trust` puts it there.
            solved = solve_case(case, cells, min(processes, os.cpu_count() or 1), report=report)
            source = "new icoFoam run"
        if when.is_latest:
            return _from(source, latest(solved))
        return _from(source, read(solved))
    if not when.is_latest:
        raise InputError(
            "flow.time", "OpenFOAM, or a solved case (flow.case or --flow)",
            "a shipped field of one time", 'Set flow.time = "latest", or give a case.',
        )  # fmt: skip
    if case not in {path.stem for path in SHIPPED.glob("*.npz")}:
        case_folder(case)
        raise InputError(
            "OpenFOAM", f"icoFoam, to solve {case}", "no such program and no shipped field",
            f"Install it: {INSTALL}; or give a solved case with --flow.",
        )  # fmt: skip
    return _from("shipped, as OpenFOAM is not installed", FlowField.load(SHIPPED / f"{case}.npz"))


def known_flow(part: Flow, domain: Domain) -> FlowField | None:
    """A scene's flow, if that takes no solver and no case: its formula, or the shipped field.

    For what is told of a flow before a run; a run may solve the case on other cells. None elsewhere.
    """
    if part.source == "closed_form":
        return closed_form_flow(part, domain)
    shipped = SHIPPED / f"{part.field}.npz"
    return FlowField.load(shipped) if part.field and shipped.is_file() else None


def find_flow(case: str, cells: int, digest: str) -> FlowField | None:
    """The shipped field, or the cache's, of a case with this digest; None where there is none.

    No program of OpenFOAM's is started, not even to ask for its version: every solution of that name
    in the cache is looked at. For what was computed once and must not be computed anew.
    """
    shipped = [path for path in SHIPPED.glob("*.npz") if path.stem == case]
    for path in shipped:
        if (field := FlowField.load(path)).digest == digest:
            return field
    for kept in kept_folders(Path(case).name, cells):
        # One that cannot be read is not the one that is looked for.
        with suppress(InputError):
            if (field := kept_field(kept, allow_misfit=True)).digest == digest:
                return field
    return None


def _at_times(case: Path, when: When, allow_misfit: bool, report: Report | None) -> FlowField:
    from ellipsoid_coupling.flow.openfoam.case_series import read_times

    return read_times(case, when, allow_misfit=allow_misfit, report=report)


def flow_at(path: Path, *, allow_misfit: bool = False, divergence: bool = False) -> FlowField:
    """The flow at a path: a saved .npz, a folder of foamToVTK's, or a solved case at its last time.

    Parameters
    ----------
    path : Path
    allow_misfit : bool
        Take a field that is far off the solver's U, see `reader.read_case`; a saved .npz tells how far.
    divergence : bool
        Keep the flow's sources as grad chi, where its fluxes phi do not close; a saved .npz has its own.

    Raises
    ------
    InputError
        As `reader.read_case`.
    """
    if path.suffix == ".npz":
        field = load_flow(path)
        if field.misfit is not None and not allow_misfit:
            require_near(str(path), field.misfit)
        return field
    kept = Divergence.WHERE_OPEN if divergence else Divergence.NONE
    return kept_field(path, allow_misfit=allow_misfit, divergence=kept)


def _from(source: str, field: FlowField) -> FlowField:
    """The field with its source in front of its origin."""
    return replace(field, origin=f"{source}: {field.origin}")
