"""The command line: ``ellipsoid`` and ``python -m ellipsoid_coupling``."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

from cyclopts import App, CycloptsError, Parameter, Token

from ellipsoid_coupling.errors import EllipsoidError, InputError, refusal, shown
from ellipsoid_coupling.inputs import exists
from ellipsoid_coupling.limits import LONGEST_RUN
from ellipsoid_coupling.output.tables import print_table
from ellipsoid_coupling.progress import ProgressReporter

if TYPE_CHECKING:
    from ellipsoid_coupling.run_folder import RunFolder
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
Names = Annotated[list[str], Parameter(negative="")]


def _whole(_kind: object, tokens: Sequence[Token]) -> int:
    """A whole number as it stands; cyclopts' own reading of 1.5 is 2."""
    text = tokens[0].value
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"expected a whole number, found {text!r}") from None


Whole = Annotated[int, Parameter(converter=_whole)]
OptionalWhole = Annotated[int | None, Parameter(converter=_whole)]


def _print(*lines: str) -> None:
    for line in lines:
        sys.stdout.write(shown(line) + "\n")


@Parameter(name="*")
@dataclass(frozen=True)
class Output:
    """The folder that a command leaves its results in."""

    out: Annotated[Path | None, Parameter(help="Folder of the results.")] = None
    force: Annotated[
        bool, Parameter(negative="", help="Write into --out even if it holds something already.")
    ] = False

    def check(self) -> None:
        """Refuse, before anything is computed, a folder that holds something."""
        from ellipsoid_coupling.run_folder import require_free

        if self.out is not None:
            require_free(self.out, force=self.force)

    def folder(self, name: str) -> Path:
        """`out`, or results/`name` with the first free number behind it."""
        if self.out is not None:
            return self.out
        folder, count = Path("results") / name, 1
        while folder.exists():
            count += 1
            folder = Path("results") / f"{name}-{count}"
        return folder


@Parameter(name="*")
@dataclass(frozen=True)
class Keeping(Output):
    """How a run keeps what it has computed."""

    resume: Annotated[
        bool, Parameter(negative="", help="Continue the interrupted run in --out, bit for bit.")
    ] = False
    checkpoint_seconds: Annotated[
        float, Parameter(help="Seconds between checkpoints: what a kill loses at most.")
    ] = 15.0
    stop_after: Annotated[
        float | None,
        Parameter(help="Write a checkpoint and stop (status 1) after so many seconds."),
    ] = None
    longest: Annotated[
        float,
        Parameter(help="Stop likewise if the run would take more seconds in all at its pace."),
    ] = LONGEST_RUN

    def check(self) -> None:
        """Refuse numbers and folders that cannot be meant."""
        if self.resume and self.out is None:
            raise InputError("--resume", "--out with the run's folder", "none", "Add --out.")
        if not 0.0 <= self.checkpoint_seconds < math.inf:
            found = f"{self.checkpoint_seconds:g}"
            raise InputError("--checkpoint-seconds", "seconds, 0 or more", found, "Change it.")
        if self.stop_after is not None and not 0.0 < self.stop_after < math.inf:
            found = f"{self.stop_after:g}"
            raise InputError("--stop-after", "seconds above 0", found, "Change it.")

        if not self.longest > 0.0:
            raise InputError("--longest", "seconds above 0", f"{self.longest:g}", "Change it.")

    def place(self, name: str) -> RunFolder:
        """The run folder, which the run itself looks at and claims."""
        from ellipsoid_coupling.run_folder import RunFolder

        limits = self.checkpoint_seconds, self.stop_after, self.longest
        return RunFolder(self.folder(name), self.resume, self.force, *limits)


_OUTPUT, _KEEPING = Output(), Keeping()


def _scene(name: str, settings: list[str] | None) -> Scene:
    from ellipsoid_coupling.scenes import load_scene, parse_setting

    if settings == []:
        raise InputError("--set", "key=value", "nothing", "Example: --set particles.number=100.")
    return load_scene(name, dict(parse_setting(text) for text in settings or []))


@app.command
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

    Without --out the solved case goes into the cache.

    Parameters
    ----------
    case
        A case of foam_cases/ or the path of a case folder with the same layout.
    cells
        Cells a side; the case's own number if left out.
    processes
        Processes of icoFoam (decomposePar, mpirun).
    trust
        Run the case even if something in it can run code: you have read it, or made it.
    """
    from ellipsoid_coupling.flow.openfoam import solve_case

    output.check()
    with ProgressReporter() as report:
        folder = solve_case(
            case, cells=cells, processes=processes, out=output.out, report=report, trust=trust
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
    seed: OptionalWhole = None,
    realisations: OptionalWhole = None,
    keeping: Keeping = _KEEPING,
) -> None:
    """Run one model on one scene; without --out into results/....

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
    """
    from ellipsoid_coupling.models import scheme_named
    from ellipsoid_coupling.run_flow import repeated_flow
    from ellipsoid_coupling.scenes import load_run_part
    from ellipsoid_coupling.simulation import simulate

    before = load_run_part(scene)
    chosen = _scene(scene, set_)
    name = model or before.model
    if name is None:
        raise InputError("run", "--model", "none", "Example: --model microscopic.")
    keeping.check()
    kind = scheme_named(scheme or before.scheme)
    given = flow or repeated_flow(scene, chosen)
    folder = keeping.place(f"{chosen.name}-{name}-{kind}")
    with ProgressReporter() as report:
        result = simulate(
            chosen,
            name,
            kind,
            flow=given,
            seed=seed if seed is not None else before.seed,
            realisations=realisations if realisations is not None else before.realisations,
            folder=folder,
            report=report,
        )
    shown = ["status", "warnings", "resolution", "flow", "steps", "rejected_steps", "step_limits"]
    shown += ["mass_start", "mass_end", "particles_outside_flow"]
    known = [key for key in shown if key in result.attributes]
    rows = [(key, f"{result.attributes[key]}".removesuffix(".0")) for key in known]
    timed = [k for k in ("wall_seconds", "compile_seconds") if k in result.attributes]
    rows += [(k, f"{result.attributes[k]:.2f}") for k in timed]
    print_table(f"{chosen.name}: {name}, {kind}", ("", ""), rows)
    _print(str(folder.path))


@app.command
def compare(
    what: Names,
    /,
    *,
    flow: Path | None = None,
    set_: Settings = None,
    longest: float = 60.0,
    output: Output = _OUTPUT,
) -> None:
    """Errors against run time, split into their parts, as tables and figures.

    Without --out into results/....

    Parameters
    ----------
    what
        One scene (every model that fits it is run with both schemes, coarse to fine), or finished
        run folders.
    flow
        As in `run`; finished runs have their own.
    longest
        Seconds that one run may take; finer levels are left out, and told.
    """
    from ellipsoid_coupling.compare import compare_runs, run_frontier
    from ellipsoid_coupling.output.frontier_report import report_frontiers
    from ellipsoid_coupling.output.labels import print_warnings
    from ellipsoid_coupling.run_flow import load_runs, repeated_flow
    from ellipsoid_coupling.simulation import scene_flow

    if not 0.0 < longest < math.inf:
        raise InputError("--longest", "finite seconds above 0", f"{longest:g}", "Change it.")
    output.check()
    with ProgressReporter() as report:
        if len(what) == 1 and not exists(Path(what[0]) / "result.nc"):
            scene = _scene(what[0], set_)
            field = scene_flow(scene, flow or repeated_flow(what[0], scene), report)
            frontier = run_frontier(scene, field, longest=longest, report=report)
        else:
            if flow is not None or set_ is not None:
                found = "--flow or --set with runs, which have their own scene and flow"
                raise InputError("compare", "runs alone", found, "Leave it out.")
            results, flows = load_runs(what)
            scene = results[0].scene
            frontier = compare_runs(results, flows)
            print_warnings(results)
    folder = output.folder(f"compare-{scene.name}")
    report_frontiers([frontier], folder)
    _print(str(folder))


@app.command
def stability(*, quick: bool = False, output: Output = _OUTPUT) -> None:
    """Run stiff and extreme cases with every model and scheme, and map what stays stable.

    Leaves a table, a picture and the page that explains it; without --out in results/....

    Parameters
    ----------
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
    output.check()
    with ProgressReporter() as report:
        fields = map_stability(cases, report=report)
    folder = output.folder("stability")
    report_stability(fields, cases, folder)
    print_table(f"Stability, {len(cases)} cases", SUMMARY_COLUMNS, summary_rows(fields))
    _print(str(folder))


@app.command
def export(run: Path, /, *, force: Annotated[bool, Parameter(negative="")] = False) -> None:
    """Write ParaView files into a run folder.

    Parameters
    ----------
    run
        A finished run folder.
    force
        Overwrite files that an earlier export left.
    """
    from ellipsoid_coupling.output.paraview import export as write
    from ellipsoid_coupling.run_flow import load_runs
    from ellipsoid_coupling.run_folder import require_free

    (result,), (field,) = load_runs([run])
    folder = (run if run.is_dir() else run.parent) / "paraview"
    require_free(folder, force=force, option="")
    write(result, folder, flow=field)
    _print(str(folder))


@app.command
def figures(runs: Names, /, *, output: Output = _OUTPUT) -> None:
    """Draw the paper's pictures of finished runs; without --out into results/....

    Parameters
    ----------
    runs
        Run folders; those of one scene are drawn together.
    """
    from ellipsoid_coupling.output.figures import draw_all
    from ellipsoid_coupling.output.labels import print_warnings
    from ellipsoid_coupling.run_flow import load_runs

    output.check()
    results, flows = load_runs(runs)
    folder = output.folder("figures")
    folder.mkdir(parents=True, exist_ok=True)
    draw_all(results, folder, flows)
    print_warnings(results)
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
        sys.stderr.write(f"ellipsoid: {shown(str(error))}\nSee ellipsoid --help.\n")
        sys.exit(InputError.exit_status)
    except (MemoryError, OSError) as error:
        if isinstance(error, BrokenPipeError):
            _leave_quietly()
        sys.stderr.write(f"ellipsoid: {refusal(error)}\n")
        sys.exit(1)
    except KeyboardInterrupt:
        sys.stderr.write("ellipsoid: interrupted\n")
        sys.exit(130)
