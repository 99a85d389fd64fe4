"""`ellipsoid advise`: which model, scheme and resolution to take for an error."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from ellipsoid_coupling.options import (
    FlowChoice,
    Output,
    Settings,
    chosen_scene,
    print_lines,
)
from ellipsoid_coupling.output.progress import ProgressReporter

if TYPE_CHECKING:
    from ellipsoid_coupling.compare.advice import Asked

_FLOW, _OUTPUT = FlowChoice(), Output()


def advise(
    scene: str,
    /,
    *,
    error: float,
    quantity: Literal["density", "angle"] = "density",
    seconds: float = 60.0,
    flow: FlowChoice = _FLOW,
    set_: Settings = None,
    output: Output = _OUTPUT,
) -> None:
    """Say which model, scheme and resolution keep an error at the least cost, from short runs.

    The last line but one is the command that runs it; without --out the table goes into results/....

    Parameters
    ----------
    scene
        A built-in scene, a TOML file, or the run.toml of an earlier run.
    error
        The largest L1 distance over the saved times; 0.03 is three per cent, 2 no overlap at all.
    quantity
        Whose error: of the density (20 x 20 cells) or of the angles (60 bins).
    seconds
        What the short runs together may take; compiling is not counted.
    """
    from ellipsoid_coupling.compare.advice import advise as ask
    from ellipsoid_coupling.compare.advice import check_asked
    from ellipsoid_coupling.output.advice_report import (
        advice_lines,
        print_advice,
        write_advice,
    )
    from ellipsoid_coupling.simulation import scene_flow

    check_asked(error, quantity, seconds)
    output.check()
    chosen = chosen_scene(scene, set_)
    wanted = flow.wanted(scene, chosen)
    with ProgressReporter("advise") as report:
        advice = ask(
            chosen,
            error=error,
            quantity=quantity,
            seconds=seconds,
            flow=scene_flow(chosen, wanted, report),
            asked=_asked(scene, set_, flow),
            report=report,
        )
    with output.folder(f"advise-{chosen.name}") as folder:
        write_advice(advice, folder)
    print_advice(advice)
    print_lines(*advice_lines(advice), *([advice.command] if advice.command else []), str(folder))


def _asked(scene: str, settings: list[str] | None, flow: FlowChoice) -> Asked:
    """How the command of the answer names the scene and its flow."""
    from ellipsoid_coupling.compare.advice import Asked
    from ellipsoid_coupling.scenes import load_run_part

    further = [] if flow.flow is None else ["--flow", str(flow.flow)]
    further += ["--allow-misfit"] if flow.allow_misfit else []
    further += ["--solve"] if flow.solve else []
    is_run = load_run_part(scene).model is not None
    return Asked(scene, tuple(settings or ()), tuple(further), is_run)
