"""`ellipsoid warm-up`: compile the kernels before they are needed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, NamedTuple

from cyclopts import Parameter

from ellipsoid_coupling.options import print_lines
from ellipsoid_coupling.output.progress import ProgressReporter

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ellipsoid_coupling.flow import FlowField
    from ellipsoid_coupling.models import SchemeName
    from ellipsoid_coupling.scenes import Scene

Several = Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")]

# With interaction, walls and fluid; with fluid alone; and with noise and potentials.
_SCENES = ("cavity", "cavity_free", "stationary")
# The end of a tiny run, as a part of the first saved time: a step or two.
_PART = 1e-3


class TinyRun(NamedTuple):
    """A run that compiles the kernels of a scene, a model and a scheme, and does little else."""

    scene: Scene
    model: str
    scheme: SchemeName
    flow: FlowField | None


def warm_up(*scenes: str, model: Several = None) -> None:
    """Compile the kernels that runs need, once per machine and version, which takes minutes.

    Each model that fits takes a step of each scene with each scheme. Kernels are compiled for the terms
    that a scene has: name your own scenes to have theirs.

    Parameters
    ----------
    scenes
        Built-in scenes or TOML files; without them cavity (with interaction), cavity_free (without) and
        stationary (noise and potentials).
    model
        Only these: microscopic, mckean_vlasov, q_maxwellian, q_mono_kinetic, rho_mono_kinetic, diffusive,
        stationary_state.
    """
    from ellipsoid_coupling.compiled.jit import cache_folder

    with ProgressReporter("warm-up") as report:
        runs = tiny_runs(scenes, model, report)
        seconds = compile_all(runs, report)
    print_lines(
        f"{len(runs)} runs, {seconds:.0f} s of compiling. The kernels are in", str(cache_folder())
    )


def tiny_runs(
    names: Sequence[str], models: Sequence[str] | None, report: Callable[[str, float], None]
) -> list[TinyRun]:
    """The runs of all scenes, of models that fit and are wanted, with all schemes.

    Their resolution is the scene's own, because methods are chosen by size.

    Raises
    ------
    InputError
        For an unknown model or scene, or if no wanted model fits any of them.
    """
    from ellipsoid_coupling.errors import InputError
    from ellipsoid_coupling.models import SCHEMES, kind_named
    from ellipsoid_coupling.output.fitting import fitting_models
    from ellipsoid_coupling.scenes import load_scene

    wanted = None if models is None else [kind_named(name).name for name in models]
    runs = []
    for name in names or _SCENES:
        scene = load_scene(name)
        fitting = [m for m in fitting_models(scene).fit if wanted is None or m in wanted]
        flow = _flow(scene, shipped=not names, report=report) if fitting else None
        tiny = load_scene(name, {"times": [_PART * scene.times[0]]})
        runs += [TinyRun(tiny, model, scheme, flow) for model in fitting for scheme in SCHEMES]
    if not runs:
        found = ", ".join(wanted or ())
        raise InputError("warm-up", "models that fit the scenes", found, "See ellipsoid scenes.")
    return runs


def _flow(scene: Scene, *, shipped: bool, report: Callable[[str, float], None]) -> FlowField | None:
    """The scene's flow; the one that the package ships where none is to be solved for this."""
    from ellipsoid_coupling.flow import FlowField
    from ellipsoid_coupling.flow.provide import SHIPPED
    from ellipsoid_coupling.simulation import scene_flow

    if shipped and scene.flow is not None:
        return FlowField.load(SHIPPED / f"{scene.flow.name}.npz")
    return scene_flow(scene, report=report)


def compile_all(runs: Sequence[TinyRun], report: Callable[[str, float], None]) -> float:
    """Run all of them, and return the seconds of compiling."""
    from ellipsoid_coupling.simulation import simulate

    seconds = 0.0
    for number, run in enumerate(runs):
        stage = f"{number + 1} of {len(runs)}: {run.scene.name}, {run.model}, {run.scheme}"
        report(stage, number / len(runs))
        result = simulate(run.scene, run.model, run.scheme, flow=run.flow)
        seconds += float(result.attributes["compile_seconds"])
    report("warm-up", 1.0)
    return seconds
