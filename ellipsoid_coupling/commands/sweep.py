"""`ellipsoid sweep`: a scene at all combinations of lists of values."""

from __future__ import annotations

from ellipsoid_coupling.options import FlowChoice, Settings, SweepLists, SweepPlace, print_lines
from ellipsoid_coupling.output.progress import ProgressReporter

_FLOW, _LISTS, _PLACE = FlowChoice(), SweepLists(), SweepPlace()


def sweep(
    scene: str | None = None,
    /,
    *,
    model: str | None = None,
    scheme: str | None = None,
    set_: Settings = None,
    lists: SweepLists = _LISTS,
    flow: FlowChoice = _FLOW,
    place: SweepPlace = _PLACE,
) -> None:
    """Run a scene at all combinations of lists of values; without --out into results/....

    Parameters
    ----------
    scene
        A built-in scene, a TOML file, or the sweep.toml of an earlier sweep; with --resume and --collect
        that of --out if left out.
    model
        One, or several with commas between them, as microscopic,rho_mono_kinetic; of microscopic,
        mckean_vlasov, q_maxwellian, q_mono_kinetic, rho_mono_kinetic, diffusive and stationary_state.
    scheme
        paper (the paper's numerics) or accurate, which is taken if left out.
    set_
        Lists of values: key=a,b,c ...; commas in brackets belong to a value.
    """
    from ellipsoid_coupling.models import scheme_named
    from ellipsoid_coupling.scenes import load_scene
    from ellipsoid_coupling.sweeps import (
        Where,
        described,
        require_completed,
        run_sweep,
        run_task,
        statuses_of,
    )

    place.check()
    numerics = None if scheme is None else scheme_named(scheme).name
    told = lists.table() | {"models": model, "scheme": numerics} | flow.table()
    what = described(scene, told, set_ or [], place.out)
    given = flow.of_earlier_run(scene, load_scene(what.scene))
    with place.folder(f"sweep-{what.name}") as folder, ProgressReporter("sweep") as report:
        if place.task is not None:
            statuses = run_task(
                what, folder, place.task, resume=place.resume, flow=given, report=report
            )
        else:
            where = Where(place.workers, place.scheduler, place.collect)
            data = run_sweep(what, folder, where, resume=place.resume, flow=given, report=report)
            statuses = statuses_of(data)
    print_lines(str(folder))
    require_completed(statuses)
