"""The command line: ``ellipsoid`` and ``python -m ellipsoid_coupling``."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

from cyclopts import App, CycloptsError, Parameter

from ellipsoid_coupling.errors import EllipsoidError, InputError, readable
from ellipsoid_coupling.inputs import exists
from ellipsoid_coupling.output.tables import print_table
from ellipsoid_coupling.progress import ProgressReporter

if TYPE_CHECKING:
    from ellipsoid_coupling.scenes import Scene

app = App(
    name="ellipsoid",
    help="Ellipsoidal particles in an OpenFOAM flow: from particles to mean-field equations.",
    version_flags=["--version"],
)

Settings = Annotated[
    list[str] | None,
    Parameter(name="--set", consume_multiple=True, negative="", help="Scene values: key=value ..."),
]
Force = Annotated[
    bool, Parameter(negative="", help="Write into --out even if it holds something already.")
]
Names = Annotated[list[str], Parameter(negative="")]


def _print(*lines: str) -> None:
    for line in lines:
        sys.stdout.write(line + "\n")


def _new_folder(out: Path | None, name: str, force: bool = True) -> Path:
    """`out`, or results/`name` with the first free number behind it.

    Raises
    ------
    InputError
        If `out` holds something, and `force` is not given.
    """
    if out is not None:
        from ellipsoid_coupling.run_folder import require_free

        require_free(out, force=force)
        return out
    folder, count = Path("results") / name, 1
    while folder.exists():
        count += 1
        folder = Path("results") / f"{name}-{count}"
    return folder


def _scene(name: str, settings: list[str] | None) -> Scene:
    from ellipsoid_coupling.scenes import load_scene, parse_setting

    return load_scene(name, dict(parse_setting(text) for text in settings or []))


@app.command
def flow(
    case: str,
    /,
    *,
    cells: int | None = None,
    processes: int = 1,
    out: Path | None = None,
    force: Force = False,
    trust: bool = False,
) -> None:
    """Run an OpenFOAM case to rest, or reuse its solution.

    Parameters
    ----------
    case
        A case of foam_cases/ or the path of a case folder with the same layout.
    cells
        Cells a side; the case's own number if left out.
    processes
        Processes of icoFoam (decomposePar, mpirun).
    out
        Where the solved case goes; into the cache if left out.
    trust
        Run the case even if something in it can run code: you have read it, or made it.
    """
    from ellipsoid_coupling.flow.openfoam import solve_case

    if out is not None:
        _new_folder(out, "", force)
    with ProgressReporter() as report:
        folder = solve_case(
            case, cells=cells, processes=processes, out=out, report=report, trust=trust
        )
    _print(str(folder))


@app.command
def plan(
    scene: str,
    /,
    *,
    model: str = "microscopic",
    set_: Settings = None,
) -> None:
    """List every term of a scene: whether it runs, and why.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file.
    model
        The model that it is planned for.
    """
    from ellipsoid_coupling.models import model_names
    from ellipsoid_coupling.scenes import explain_terms

    if model not in model_names():
        known = ", ".join(model_names())
        raise InputError("--model", f"one of {known}", repr(model), "Choose one of these.")
    chosen = _scene(scene, set_)
    terms = explain_terms(chosen, model)
    rows = [(term.name, "runs" if term.runs else "left out", term.why) for term in terms]
    print_table(f"{chosen.name}, {model}", ("term", "", "why"), rows)


@app.command
def run(
    scene: str,
    /,
    *,
    model: str | None = None,
    scheme: str | None = None,
    flow: Path | None = None,
    set_: Settings = None,
    seed: int | None = None,
    realisations: int | None = None,
    out: Path | None = None,
    resume: bool = False,
    force: Force = False,
    checkpoint_seconds: float = 15.0,
    stop_after: float | None = None,
) -> None:
    """Run one model on one scene.

    Parameters
    ----------
    scene
        A built-in scene, a TOML file, or the run.toml of an earlier run to repeat it.
    model
        microscopic, rho_mono_kinetic, ...
    scheme
        paper (the paper's numerics) or accurate.
    flow
        Any solved 2-D OpenFOAM case folder, what foamToVTK wrote, or a saved flow (.npz).
    seed
        Fixes start positions and noise.
    realisations
        Instead of the scene's number.
    out
        The run folder; results/... if left out.
    resume
        Continue the interrupted run in --out, bit for bit; from its start if it left no checkpoint.
    checkpoint_seconds
        Seconds between checkpoints: what a kill loses at most.
    stop_after
        Write a checkpoint and stop (status 1) after so many seconds.
    """
    from ellipsoid_coupling.models import scheme_named
    from ellipsoid_coupling.run_folder import RunFolder
    from ellipsoid_coupling.scenes import load_run_part
    from ellipsoid_coupling.simulation import simulate

    before = load_run_part(scene)
    chosen = _scene(scene, set_)
    name = model or before.model
    if name is None:
        raise InputError("run", "--model", "none", "Example: --model microscopic.")
    if resume and out is None:
        raise InputError("--resume", "--out with the run's folder", "none", "Add --out.")
    if realisations is not None and realisations < 1:
        raise InputError("--realisations", "1 or more", str(realisations), "Change it.")
    if seed is not None and not 0 <= seed < 2**63:
        raise InputError("--seed", "a whole number from 0 to 2^63 - 1", str(seed), "Change it.")
    if not 0.0 <= checkpoint_seconds < math.inf:
        found = f"{checkpoint_seconds:g}"
        raise InputError("--checkpoint-seconds", "seconds, 0 or more", found, "Change it.")
    if stop_after is not None and not 0.0 < stop_after < math.inf:
        raise InputError("--stop-after", "seconds above 0", f"{stop_after:g}", "Change it.")
    kind = scheme_named(scheme or before.scheme)
    folder = _new_folder(out, f"{chosen.name}-{name}-{kind}")
    with ProgressReporter() as report:
        result = simulate(
            chosen,
            name,
            kind,
            flow=flow,
            seed=seed if seed is not None else before.seed,
            realisations=realisations or before.realisations,
            folder=RunFolder(folder, resume, force, checkpoint_seconds, stop_after),
            report=report,
        )
    shown = ["status", "resolution", "flow", "steps", "rejected_steps", "step_limits"]
    shown += ["mass_start", "mass_end"]
    known = [key for key in shown if key in result.attributes]
    rows = [(key, f"{result.attributes[key]}".removesuffix(".0")) for key in known]
    rows += [(k, f"{result.attributes[k]:.2f}") for k in ("wall_seconds", "compile_seconds")]
    print_table(f"{chosen.name}: {name}, {kind}", ("", ""), rows)
    _print(str(folder))


@app.command
def compare(
    what: Names,
    /,
    *,
    out: Path | None = None,
    flow: Path | None = None,
    set_: Settings = None,
    longest: float = 60.0,
    force: Force = False,
) -> None:
    """Errors against run time, split into their parts, as tables and figures.

    Parameters
    ----------
    what
        One scene (every model that fits it is run with both schemes, coarse to fine), or finished
        run folders.
    out
        Folder of the tables and figures; results/... if left out.
    flow
        As in `run`.
    longest
        Seconds that one run may take; finer levels are left out, and told.
    """
    from ellipsoid_coupling.compare import compare_runs, run_frontier
    from ellipsoid_coupling.output.frontier_report import report_frontiers
    from ellipsoid_coupling.result import Result
    from ellipsoid_coupling.simulation import scene_flow

    if not 0.0 < longest < math.inf:
        raise InputError("--longest", "finite seconds above 0", f"{longest:g}", "Change it.")
    if out is not None:
        _new_folder(out, "", force)
    with ProgressReporter() as report:
        if len(what) == 1 and not exists(Path(what[0]) / "result.nc"):
            scene = _scene(what[0], set_)
            field = scene_flow(scene, flow, report)
            frontier = run_frontier(scene, field, longest=longest, report=report)
        else:
            results = [Result.load(path) for path in what]
            scene = results[0].scene
            frontier = compare_runs(results, scene_flow(scene, flow, report))
    folder = _new_folder(out, f"compare-{scene.name}")
    report_frontiers([frontier], folder)
    _print(str(folder))


@app.command
def stability(*, out: Path | None = None, quick: bool = False, force: Force = False) -> None:
    """Run stiff and extreme cases with every model and scheme, and map what stays stable.

    Parameters
    ----------
    out
        Folder of the table, the picture and the page that explains it; results/... if left out.
    quick
        A third of the cases.
    """
    from ellipsoid_coupling.compare.stability import chosen_cases, map_stability
    from ellipsoid_coupling.output.stability_report import (
        SUMMARY_COLUMNS,
        report_stability,
        summary_rows,
    )

    cases = chosen_cases(quick=quick)
    if out is not None:
        _new_folder(out, "", force)
    with ProgressReporter() as report:
        fields = map_stability(cases, report=report)
    folder = _new_folder(out, "stability")
    report_stability(fields, cases, folder)
    print_table(f"Stability, {len(cases)} cases", SUMMARY_COLUMNS, summary_rows(fields))
    _print(str(folder))


@app.command
def export(run: Path, /, *, force: Force = False) -> None:
    """Write ParaView files into a run folder.

    Parameters
    ----------
    run
        A finished run folder.
    """
    from ellipsoid_coupling.output.paraview import export as write
    from ellipsoid_coupling.result import Result
    from ellipsoid_coupling.simulation import scene_flow

    result = Result.load(run)
    folder = _new_folder((run if run.is_dir() else run.parent) / "paraview", "", force)
    with ProgressReporter() as report:
        field = scene_flow(result.scene, None, report)
    write(result, folder, flow=field)
    _print(str(folder))


@app.command
def figures(runs: Names, /, *, out: Path | None = None, force: Force = False) -> None:
    """Draw the paper's pictures of finished runs.

    Parameters
    ----------
    runs
        Run folders; those of one scene are drawn together.
    out
        Folder of the pictures; results/... if left out.
    """
    from ellipsoid_coupling.output.figures import draw_all
    from ellipsoid_coupling.result import Result
    from ellipsoid_coupling.simulation import scene_flow

    if out is not None:
        _new_folder(out, "", force)
    results = [Result.load(path) for path in runs]
    folder = _new_folder(out, "figures")
    folder.mkdir(parents=True, exist_ok=True)
    with ProgressReporter() as report:
        draw_all(results, folder, flow=scene_flow(results[0].scene, None, report))
    _print(str(folder))


def _leave_quietly() -> NoReturn:
    """The reader of our output (head, less) has gone: nothing is left to say."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(1)


def main(tokens: Sequence[str] | None = None) -> None:
    """Run the command line; exit status 0, 1 (failed run) or 2 (bad input)."""
    try:
        app(tokens, exit_on_error=False, print_error=False)
    except EllipsoidError as error:
        sys.stderr.write(f"ellipsoid: {error}\n")
        sys.exit(error.exit_status)
    except CycloptsError as error:
        sys.stderr.write(f"ellipsoid: {error}\nSee ellipsoid --help.\n")
        sys.exit(InputError.exit_status)
    except (MemoryError, OSError) as error:
        if isinstance(error, BrokenPipeError):
            _leave_quietly()
        # Nothing that a check before the run could know: a full disk, a file removed meanwhile.
        found = readable(str(error)) or type(error).__name__
        sys.stderr.write(f"ellipsoid: the system refused: {found}\n")
        sys.exit(1)
    except KeyboardInterrupt:
        sys.stderr.write("ellipsoid: interrupted\n")
        sys.exit(130)
