"""The command line: ``ellipsoid`` and ``python -m ellipsoid_coupling``."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, CycloptsError, Parameter

from ellipsoid_coupling.commands import cases, listing
from ellipsoid_coupling.commands.advise import advise
from ellipsoid_coupling.commands.movie import movie
from ellipsoid_coupling.commands.report import report as report_command
from ellipsoid_coupling.commands.sweep import sweep
from ellipsoid_coupling.commands.warm_up import warm_up
from ellipsoid_coupling.compiled.threading_layer import check_environment
from ellipsoid_coupling.errors import EllipsoidError, InputError, readable, refusal
from ellipsoid_coupling.files.reading import exists
from ellipsoid_coupling.options import (
    FlowChoice,
    Keeping,
    Names,
    OptionalWhole,
    Output,
    Settings,
    Span,
    chosen_scene,
    print_lines,
)
from ellipsoid_coupling.output.progress import ProgressReporter, Waiting
from ellipsoid_coupling.output.streams import drop, open_streams, tell, warn_in_one_line
from ellipsoid_coupling.output.tables import PipedConsole, print_table

if TYPE_CHECKING:
    from ellipsoid_coupling.scenes import Scene

app = App(
    name="ellipsoid",
    help="Ellipsoidal particles in an OpenFOAM flow: from particles to mean-field equations.",
    version_flags=["--version"],
    console=PipedConsole(),
)


_OUTPUT, _KEEPING, _FLOW = Output(), Keeping(), FlowChoice()


app.command(cases.flow)
app.command(cases.new)
app.command(listing.scenes)
app.command(listing.models)
app.command(listing.schema)


@app.command
def plan(
    scene: str,
    /,
    *,
    model: str | None = None,
    scheme: str | None = None,
    flow: FlowChoice = _FLOW,
    set_: Settings = None,
) -> None:
    """List every term of a scene, whether it runs and why; and how large the run is.

    Memory, steps and about how long; with --flow also what the flow is, its patches, and the particles'
    Stokes and Reynolds numbers.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file.
    model
        The model that it is planned for: microscopic (if left out), mckean_vlasov, q_maxwellian,
        q_mono_kinetic, rho_mono_kinetic, diffusive or stationary_state.
    scheme
        paper or accurate.
    """
    from ellipsoid_coupling.flow.openfoam.viscosity import viscosity_at
    from ellipsoid_coupling.models import (
        ADAPTIVE_SCHEME,
        kind_named,
        model_kinds,
        plan_terms,
        scheme_named,
    )
    from ellipsoid_coupling.output.plan_report import print_flow, print_numbers
    from ellipsoid_coupling.simulation import checked_setup, scene_flow

    kind = model_kinds()[0] if model is None else kind_named(model)
    numerics = scheme_named(scheme or ADAPTIVE_SCHEME).name
    chosen = chosen_scene(scene, set_)
    checked_setup(chosen, kind.name, numerics, 0, None)
    terms = plan_terms(chosen, kind.name)
    rows = [(term.name, "runs" if term.runs else "left out", term.why) for term in terms]
    field = None
    if flow.flow is not None:
        with ProgressReporter("flow") as report:
            field = scene_flow(chosen, flow.given(), report)
    print_table(f"{chosen.name}, {kind.name}", ("term", "", "why"), rows)
    print_numbers(chosen, kind.name, numerics, field)
    if field is not None and flow.flow is not None:
        print_flow(chosen, field, viscosity_at(flow.flow))


@app.command
def run(
    scene: str,
    /,
    *,
    model: str | None = None,
    scheme: str | None = None,
    flow: FlowChoice = _FLOW,
    set_: Settings = None,
    seed: OptionalWhole = None,
    realisations: Span = None,
    keeping: Keeping = _KEEPING,
) -> None:
    """Run one model on one scene; without --out into results/....

    Parameters
    ----------
    scene
        A built-in scene, a TOML file, or the run.toml of an earlier run to repeat it.
    model
        Required, but for a run.toml: microscopic, mckean_vlasov, q_maxwellian, q_mono_kinetic,
        rho_mono_kinetic, diffusive or stationary_state; `ellipsoid models` tells more.
    scheme
        paper (the paper's numerics) or accurate, which is taken if left out.
    seed
        Fixes start positions and noise.
    realisations
        Instead of the scene's number; A:B for those of these numbers, a part of a larger run.
    """
    from ellipsoid_coupling.models import scheme_named
    from ellipsoid_coupling.scenes import load_run_part
    from ellipsoid_coupling.simulation import simulate

    before = load_run_part(scene)
    chosen = chosen_scene(scene, set_)
    name = model or before.model
    if name is None:
        raise _no_model(chosen)
    keeping.check()
    numerics = scheme_named(scheme or before.scheme).name
    given = flow.wanted(scene, chosen)
    folder = keeping.run_folder(f"{chosen.name}-{name}-{numerics}")
    with ProgressReporter("run") as report:
        result = simulate(
            chosen,
            name,
            numerics,
            flow=given,
            seed=seed if seed is not None else before.seed,
            realisations=realisations if realisations is not None else before.numbers,
            folder=folder,
            report=report,
        )
    _print_summary(f"{chosen.name}: {name}, {numerics}", result.attributes)
    print_lines(str(folder.path))


app.command(sweep)
app.command(advise)


def _no_model(scene: Scene) -> InputError:
    """The message for a run without a model: those that fit."""
    from ellipsoid_coupling.output.fitting import fitting_models

    fit = fitting_models(scene).fit
    expected = f"--model with one that fits {scene.name}: {', '.join(fit) or 'there is none'}"
    remedy = f"Example: --model {fit[0]}. " if fit else ""
    return InputError(
        "run", expected, "none", f"{remedy}`ellipsoid models` tells what each solves."
    )


def _print_summary(title: str, attributes: Mapping[str, object]) -> None:
    """The most important attributes of a run, as a table."""
    names = ["status", "warnings", "resolution", "flow", "steps", "rejected_steps", "step_limits"]
    names += ["mass_start", "mass_end", "mass_came_in", "particles_outside_flow", "fates"]
    rows = [(k, f"{attributes[k]}".removesuffix(".0")) for k in names if k in attributes]
    timed = [k for k in ("wall_seconds", "compile_seconds") if k in attributes]
    rows += [(k, f"{attributes[k]:.2f}") for k in timed]
    print_table(title, ("", ""), rows)


@app.command
def compare(
    what: Names,
    /,
    *,
    flow: FlowChoice = _FLOW,
    set_: Settings = None,
    longest: float = 60.0,
    output: Output = _OUTPUT,
) -> None:
    """Errors against run time, split into their parts, as tables and figures.

    Without --out into results/....

    Parameters
    ----------
    what
        One scene (every model that fits it is run with both schemes, coarse to fine), or finished runs.
    longest
        Seconds that one run may take; finer levels are left out, which the table says.
    """
    from ellipsoid_coupling.compare import compare_runs, run_frontier
    from ellipsoid_coupling.output.frontier_report import report_frontiers
    from ellipsoid_coupling.simulation import scene_flow
    from ellipsoid_coupling.storage.run_flow import load_runs

    if not 0.0 < longest < math.inf:
        raise InputError("--longest", "finite seconds above 0", f"{longest:g}", "Change it.")
    output.check()
    with ProgressReporter("compare") as report:
        if len(what) == 1 and not exists(Path(what[0]) / "result.nc"):
            scene = chosen_scene(what[0], set_)
            field = scene_flow(scene, flow.wanted(what[0], scene), report)
            frontier = run_frontier(scene, field, longest=longest, report=report)
        else:
            if set_ is not None:
                raise InputError("compare", "runs alone", "--set with them", "Leave it out.")
            results, flows = load_runs(what, flow.flow)
            scene = results[0].scene
            frontier = compare_runs(results, flows)
    with output.folder(f"compare-{scene.name}") as folder:
        report_frontiers([frontier], folder)
    print_lines(str(folder))


@app.command
def stability(*, quick: bool = False, output: Output = _OUTPUT) -> None:
    """Run stiff and extreme cases with every model and scheme, and map their stability.

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
    with ProgressReporter("stability") as report:
        entries = map_stability(cases, report=report)
    with output.folder("stability") as folder:
        report_stability(entries, cases, folder)
    print_table(f"Stability, {len(cases)} cases", SUMMARY_COLUMNS, summary_rows(entries))
    print_lines(str(folder))


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
    from ellipsoid_coupling.storage.run_flow import load_runs
    from ellipsoid_coupling.storage.run_folder import require_free

    (result,), (field,) = load_runs([run])
    folder = (run if run.is_dir() else run.parent) / "paraview"
    require_free(folder, force=force, option="")
    write(result, folder, flow=field)
    print_lines(str(folder))


@app.command
def figures(
    runs: Names,
    /,
    *,
    own_scales: Annotated[bool, Parameter(negative="")] = False,
    paper_colours: Annotated[bool, Parameter(negative="")] = False,
    output: Output = _OUTPUT,
) -> None:
    """Draw densities, axes, order, flow and walls of finished runs; without --out into results/....

    Parameters
    ----------
    runs
        Run folders; those of one scene are drawn together.
    own_scales
        A colour scale of its own for the densities of each time, not one for all.
    paper_colours
        Densities in the paper's colours (jet).
    """
    from ellipsoid_coupling.output.figures import PAPER_COLOURS, Look, draw_all
    from ellipsoid_coupling.output.labels import print_warnings
    from ellipsoid_coupling.storage.run_flow import load_runs

    output.check()
    results, flows = load_runs(runs)
    look = Look()
    if own_scales:
        look = look._replace(scale="time")
    if paper_colours:
        look = look._replace(colours=PAPER_COLOURS)
    with output.folder("figures") as folder, ProgressReporter("figures") as report:
        folder.mkdir(parents=True, exist_ok=True)
        draw_all(results, folder, flows, look, report)
    print_warnings(results)
    print_lines(str(folder))


app.command(report_command, name="report")
app.command(movie)
app.command(warm_up)
app.register_install_completion_command(
    help="Let the shell (bash, zsh, fish) complete commands and options by the tab key."
)


def main(tokens: Sequence[str] | None = None) -> None:
    """Run the command line; exit status 0, 1 (failed run) or 2 (bad input)."""
    open_streams()
    with warnings.catch_warnings(), Waiting():
        warnings.showwarning = warn_in_one_line
        status = _status_of(tokens)
    if status:
        sys.exit(status)


def _status_of(tokens: Sequence[str] | None) -> int:
    """Run a command and return its exit status; errors are written as one message."""
    try:
        check_environment()
        app(tokens, exit_on_error=False, print_error=False)
        sys.stdout.flush()
    except EllipsoidError as error:
        tell(f"ellipsoid: {error}\n")
        return error.exit_status
    except CycloptsError as error:
        tell(f"ellipsoid: {readable(str(error))}\nSee ellipsoid --help.\n")
        return InputError.exit_status
    except BrokenPipeError:
        # The reader of the output (head, less) has closed it: no failure of the command.
        drop(sys.stdout)
    except (MemoryError, OSError) as error:
        tell(f"ellipsoid: {refusal(error)}\n")
        drop(sys.stdout)
        return 1
    except KeyboardInterrupt:
        tell("ellipsoid: interrupted\n")
        return 130
    return 0
