"""`ellipsoid flow` and `ellipsoid new`: a case is solved, and a scene written for a solved one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.options import NewParticles, OptionalWhole, Output, Whole, print_lines
from ellipsoid_coupling.output.progress import ProgressReporter

_OUTPUT, _PARTICLES = Output(), NewParticles()


def flow(
    case: str,
    /,
    *,
    cells: OptionalWhole = None,
    processes: Whole = 1,
    trust: bool = False,
    output: Output = _OUTPUT,
) -> None:
    """Run an OpenFOAM case to rest, or reuse its solution.

    One with atRest 0 in system/parameters, or with a steady solver, is run to its endTime. Without --out
    the solved case goes into the cache.

    Parameters
    ----------
    case
        A case of foam_cases/ or the path of a folder with 0.orig (or 0), constant and system.
    cells
        Cells a side; the case's own number if left out.
    processes
        Processes of icoFoam (decomposePar, mpirun).
    trust
        Give OpenFOAM the case's own files, which can run code: you have read them, or made them.
    """
    from ellipsoid_coupling.flow.openfoam.solve import solve_case

    output.check()
    with ProgressReporter("flow") as report:
        folder = solve_case(
            case, cells=cells, processes=processes, out=output.out, report=report, trust=trust
        )
    print_lines(str(folder))


def new(
    case: Path,
    /,
    *,
    out: Path | None = None,
    force: Annotated[bool, Parameter(negative="")] = False,
    particles: NewParticles = _PARTICLES,
    allow_misfit: Annotated[bool, Parameter(negative="")] = False,
    schema: Annotated[bool, Parameter(negative="")] = False,
    divergence: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Write a scene for a solved case, ready to run and to edit; without --out to standard output.

    Parameters
    ----------
    case
        A solved OpenFOAM case (folder, time, part, .foam file), the output of foamToVTK, or a saved flow.
    out
        The scene file (.toml).
    force
        Overwrite it.
    allow_misfit
        Take a flow even if it is far off the solver's U.
    schema
        With --out: write scene.schema.json beside it as well, and the line that leads editors there.
    divergence
        Keep the flow's sources, where its face fluxes phi do not close.
    """
    from ellipsoid_coupling.output import new_scene, scene_schema
    from ellipsoid_coupling.output.scene_choices import Wishes

    if out is not None:
        new_scene.require_new(out, force=force)
        if schema:
            scene_schema.require_place(out.with_name(scene_schema.SCHEMA_FILE), force=force)
    elif schema:
        raise InputError("--schema", "--out with the scene's file", "none", "Add --out.")
    wishes = Wishes(particles.length, particles.width, particles.density)
    text = new_scene.scene_of_case(case, wishes, allow_misfit=allow_misfit, divergence=divergence)
    if out is None:
        print_lines(text.rstrip("\n"))
        return
    if schema:
        scene_schema.write_schema(out.with_name(scene_schema.SCHEMA_FILE))
        text = f"{scene_schema.SCHEMA_LINE}\n{text}"
    new_scene.write_scene(text, out)
    then = new_scene.next_commands(out, case, allow_misfit=allow_misfit)
    print_lines(f"{out} is written. Look through it, then:", *then)
