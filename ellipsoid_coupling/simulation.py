"""The only time loop: build a model on a scene, step it to each save time, and keep its snapshots."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, SupportsIndex

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.compile_events import CompileTimer
from ellipsoid_coupling.compiled.threading_layer import taking_turns
from ellipsoid_coupling.errors import InputError, Interrupted, RunError
from ellipsoid_coupling.files.limits import LONGEST_RUN, MOST_COUNT, MOST_SEED
from ellipsoid_coupling.files.signals import Interruption, noticed
from ellipsoid_coupling.files.versions import version
from ellipsoid_coupling.files.writing import Arrays
from ellipsoid_coupling.flow import (
    FlowField,
    FlowSeries,
    Wanted,
    found_flow,
    names_flow,
    open_window,
    require_covered,
)
from ellipsoid_coupling.models import (
    ADAPTIVE_SCHEME,
    Model,
    ModelKind,
    SchemeName,
    Setup,
    build_model,
    kind_named,
    model_terms,
    require_fit,
    resolution_text,
    scheme_named,
)
from ellipsoid_coupling.models.flow_fit import require_fitting
from ellipsoid_coupling.monitors import Monitors, Pace
from ellipsoid_coupling.result import MARKS, VARIABLES, Result, further_text
from ellipsoid_coupling.scenes import Scene, load_scene
from ellipsoid_coupling.scenes.start import KEPT_START
from ellipsoid_coupling.storage import checkpoint
from ellipsoid_coupling.storage.checkpoint import Progress
from ellipsoid_coupling.storage.run_flow import run_flow
from ellipsoid_coupling.storage.run_folder import CHECKPOINT_FILE, Keeper, RunFolder
from ellipsoid_coupling.storage.start_file import earlier_state, keep_start

Report = Callable[[str, float], None]


def scene_flow(
    scene: Scene,
    given: FlowField | Wanted | str | Path | None = None,
    report: Report | None = None,
) -> FlowField | None:
    """The flow that a scene names, or the one `given`; None for a scene without a fluid.

    Raises
    ------
    InputError
        For an unknown flow, or a path that is no solved case; a flow given to a scene without [flow]; or
        one that does not cover the scene's times.
    """
    if scene.flow is None:
        if names_flow(given):
            raise InputError(
                f"scene {scene.name}", "a scene with a [flow] section, for the drag", "none",
                "Leave out --flow (flow=...), or add "
                'flow = {source = "given", drag = 1.0, angular_drag = 1.0}.',
            )  # fmt: skip
        return None
    if isinstance(given, str | Path):
        given = Wanted(Path(given))
    if isinstance(given, FlowField):
        flow = given
    else:
        flow = found_flow(scene, scene.flow, given or Wanted(), report)
    if isinstance(flow, FlowSeries):
        require_covered(f"scene {scene.name}, key times", flow.covers, scene.times[-1])
    return flow


def simulate(
    scene: Scene | str | Path | Mapping[str, Any],
    model: str,
    scheme: SchemeName = ADAPTIVE_SCHEME,
    *,
    flow: FlowField | Wanted | str | Path | None = None,
    seed: SupportsIndex = 0,
    realisations: SupportsIndex | range | None = None,
    folder: RunFolder | str | Path | None = None,
    report: Report | None = None,
) -> Result:
    """Run one model on one scene to its last save time.

    Parameters
    ----------
    scene : Scene, name, path or table
        As `load_scene` takes it.
    model : str
        A name of `ellipsoid_coupling.models.model_names`.
    scheme : "paper" or "accurate"
    flow : FlowField, FlowSeries, Wanted, path or None
        Replaces the scene's own flow. A run that is resumed has its flow from its folder.
    seed : int
        Fixes start positions and noise; the same call gives the same bits.
    realisations : int or range, optional
        Instead of the scene's number; a range gives the numbers of the realisations, so that a part of a
        large run has the bits that it has in the whole.
    folder : RunFolder or path, optional
        run.toml, checkpoints and result.nc go there; see `RunFolder` for resuming and overwriting.
    report : callable, optional
        Called with the stage and its finished part, between 0 and 1.

    Raises
    ------
    InputError
        For a scene, model or flow that do not fit together, or a folder that may not be used;
        nothing has been written then.
    RunError
        If the run failed; with a folder, the save times that it reached are in result.nc with the status
        "failed: ...".
    Interrupted
        With a folder only: after SIGTERM or SIGINT, or if the run would take too long; its checkpoint has
        been written.
    """
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    kept_in = RunFolder(Path(folder)) if isinstance(folder, str | Path) else folder
    setup = checked_setup(scene, model, scheme, seed, realisations)
    setup = replace(setup, earlier=earlier_state(scene, kept_in))
    if kept_in is not None:
        kept_in.check()
        kept_in.check_same(*identity(model, setup))
    if not names_flow(flow) and kept_in is not None and kept_in.keeps_flow:
        field = run_flow(kept_in.path, scene)
    else:
        field = scene_flow(scene, flow, report)
    require_fitting(scene, field)
    return _Run(model, setup, field, kept_in, report).go()


def checked_setup(
    scene: Scene,
    model: str,
    scheme: str,
    seed: SupportsIndex,
    realisations: SupportsIndex | range | None,
) -> Setup:
    """The setup, still without its flow; InputError for everything that can be refused without one."""
    count, first = _numbers(scene, model, realisations)
    setup = Setup(
        scene=scene,
        terms=model_terms(scene, model),
        scheme=scheme_named(scheme).name,
        flow=None,
        seed=_whole("seed", seed, 0, MOST_SEED),
        realisations=count,
        first_realisation=first,
    )
    require_fit(model, setup)
    return setup


def _numbers(
    scene: Scene, model: str, realisations: SupportsIndex | range | None
) -> tuple[int, int]:
    """How many realisations, and the number of the first."""
    if realisations is None:
        return scene.particles.realisations, 0
    if not isinstance(realisations, range):
        return _whole("realisations", realisations, 1, MOST_COUNT), 0
    # len() of a range fails beyond 64 bits; where the step is 1, this is the same.
    first, count = realisations.start, realisations.stop - realisations.start
    if first < 0 or realisations.step != 1 or not 1 <= count <= realisations.stop <= MOST_COUNT:
        found = f"{first}:{realisations.stop}:{realisations.step}"
        raise InputError(
            "--realisations", f"A:B with 0 <= A < B <= {MOST_COUNT:g}", found, "Change it."
        )
    if first and not kind_named(model).independent_realisations:
        raise InputError(
            "--realisations", f"all of them, as {model} is one density of all", f"those from {first} on",
            "Choose a model whose realisations are independent.",
        )  # fmt: skip
    return count, first


def _whole(name: str, value: SupportsIndex, least: int, most: int) -> int:
    """`value`, if it is a whole number within its bounds, Python's or numpy's; True is none."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or not least <= int(value) <= most:
        expected = f"a whole number from {least} to {most:g}"
        raise InputError(f"--{name}", expected, repr(value), "Change it.")
    return int(value)


def identity(name: str, setup: Setup) -> tuple[dict[str, object], dict[str, object]]:
    """The [run] and [scene] of run.toml: all that a repetition needs."""
    flow = setup.flow
    run = {
        "model": name,
        "scheme": setup.scheme,
        "seed": setup.seed,
        "realisations": setup.realisations,
        "flow": flow.origin if flow else "none",
        "flow_digest": flow.digest if flow else "none",
    }
    if setup.first_realisation:
        run["first_realisation"] = setup.first_realisation
    parts = setup.scene.model_dump(mode="json", exclude_none=True)
    if setup.earlier is not None:
        run["start_digest"], parts["start"]["file"] = setup.earlier.digest, KEPT_START
    return run, parts


@dataclass
class _Run:
    """One run from start, or from its checkpoint, to its end."""

    name: str
    setup: Setup
    flow: FlowField | None
    folder: RunFolder | None
    report: Report | None

    def go(self) -> Result:
        self.started = time.perf_counter()
        self.snapshots: list[Arrays] = []
        self.earlier = np.zeros(2)  # wall and compile seconds of the runs before this one
        self.asked = Interruption()
        with taking_turns(), CompileTimer() as self.compiling, ExitStack() as claim:
            self.window = claim.enter_context(open_window(self.flow))
            self.setup = replace(self.setup, flow=self.window.field)
            self.model: Model = build_model(self.name, self.setup)
            _require_declared(kind_named(self.name), self.model.snapshot())
            self.monitors = Monitors(self.name, self.setup, self.model)
            if self.folder is not None:
                parts = identity(self.name, self.setup)
                claim.enter_context(self.folder.claimed(*parts, self.flow))
                keep_start(self.setup.scene, self.folder)
                if self.folder.resume and (finished := _finished(self.folder)) is not None:
                    return finished
                self._load_checkpoint(self.folder)
                self.keeper = Keeper(self.folder.checkpoint_seconds)
                self.asked = claim.enter_context(noticed())
            try:
                self._loop()
            except RunError as error:
                self._finish(f"failed: {error}")
                raise
            return self._finish("completed")

    def _loop(self) -> None:
        times = self.setup.scene.times
        pace = Pace(times[-1], self.folder.longest if self.folder else LONGEST_RUN)
        for until in times[len(self.snapshots) :]:
            while self.model.time < until:
                self.model.advance(min(until, self.window.until))
                self.window.move_to(self.model.time)
                self.monitors.look(self.model)
                self._tell(self.model.time / times[-1])
                self._keep(pace.look(self.model, lambda: float(self._seconds()[0])))
            self.snapshots.append(self.model.snapshot())

    def _tell(self, part: float) -> None:
        if self.report is not None:
            scene, scheme = self.setup.scene.name, self.setup.scheme
            self.report(f"{scene}: {self.name}, {scheme}", part)

    def _spent(self) -> float:
        return time.perf_counter() - self.started

    def _seconds(self) -> NDArray[np.float64]:
        """Wall seconds without compiling, and compiling seconds, earlier parts included."""
        compiling = self.compiling.seconds
        return np.asarray(self.earlier + np.array([self._spent() - compiling, compiling]))

    def _keep(self, slow: str | None) -> None:
        """Write a checkpoint if one is due or the run must end here."""
        if self.folder is None:
            if slow:
                raise RunError(f"{self._where()}: {slow}.")
            return
        why = self._why_to_leave(self.folder, slow)
        if not (self.keeper.due or why):
            return
        begun = time.perf_counter()
        progress = Progress(self.snapshots, self._seconds(), self.monitors.forces)
        self.folder.save(checkpoint.pack(self.model, progress))
        self.keeper.written(begun)
        if why:
            path = self.folder.path
            raise Interrupted(
                self.asked.signal,
                f"{self._where()}: {why}. Its checkpoint is in {path}; "
                f"continue with --resume --out {path}.",
            )

    def _where(self) -> str:
        return f"{self.setup.scene.name}, {self.name}, t = {self.model.time:.6g}"

    def _why_to_leave(self, folder: RunFolder, slow: str | None) -> str | None:
        late = folder.stop_after is not None and self._spent() > folder.stop_after
        if self.asked.signal:
            return f"stopped by {signal.Signals(self.asked.signal).name}"
        if late:
            return "stopped by --stop-after"
        return slow

    def _load_checkpoint(self, folder: RunFolder) -> None:
        arrays = folder.load()
        if arrays is None:
            return  # the run ended before its first checkpoint, and starts again
        where = str(folder.path / CHECKPOINT_FILE)
        times = self.setup.scene.times
        progress = checkpoint.unpack(arrays, self.model, times, where)
        if self.window.move_to(self.model.time):
            # Once more, in the flow of that time, from which a part of the state may follow.
            self.model.restore(checkpoint.state_of(arrays))
        self.snapshots, self.earlier, self.monitors.forces = progress
        try:
            self.monitors.look(self.model)
        except RunError as error:
            raise InputError(
                where, "the state of a sound run", str(error), "Remove it to start again."
            ) from None

    def _finish(self, status: str) -> Result:
        wall, compiling = self._seconds()
        setup, kind = self.setup, kind_named(self.name)
        result = Result(
            scene=setup.scene,
            model=self.name,
            scheme=setup.scheme,
            layout=kind.layout,
            times=np.array(setup.scene.times[: len(self.snapshots)]),
            variables=_stack(self.snapshots or [self.model.snapshot()], len(self.snapshots)),
            coordinates=self.model.coordinates(),
            attributes={
                "status": status,
                "seed": setup.seed,
                **_first(setup.first_realisation),
                "resolution": resolution_text(
                    self.name, setup.scheme, setup.scene, setup.realisations
                ),
                "flow": setup.flow.origin if setup.flow else "none",
                "flow_digest": setup.flow.digest if setup.flow else "none",
                "package_version": version("ellipsoid_coupling"),
                **self.model.counts(),
                **further_text(kind.variables),
                "wall_seconds": float(wall),
                "compile_seconds": float(compiling),
            },
        )
        if self.folder is not None:
            self.folder.require_ours()
            result.save(self.folder.result)
            self.folder.clear()
        return result


def _first(realisation: int) -> dict[str, int]:
    """The number of the first realisation of a part of a large run."""
    return {"first_realisation": realisation} if realisation else {}


def _require_declared(kind: ModelKind, snapshot: Arrays) -> None:
    """TypeError unless a snapshot has the layout's variables and those that the kind declares."""
    declared = {*VARIABLES[kind.layout], *(one.name for one in kind.variables)}
    wrong = (set(snapshot) - {*MARKS[kind.layout]}) ^ declared
    if wrong:
        raise TypeError(
            f"model {kind.name}: expected snapshots of {', '.join(sorted(declared))}, found "
            f"{', '.join(sorted(snapshot))}. Declare the others in ModelKind.variables."
        )


def _finished(folder: RunFolder) -> Result | None:
    """The result of a completed run; None without a result, or for a failed run."""
    if not folder.result.exists():
        return None
    result = Result.load(folder.path)
    return result if result.status == "completed" else None


def _stack(snapshots: list[Arrays], count: int) -> dict[str, Any]:
    """The variables of all snapshots, which are emptied to save memory."""
    names = tuple(snapshots[0])
    if len(snapshots) == 1:
        # No copy: copying large fields takes as long as a step.
        return {name: snapshots[0][name][None][:count] for name in names}
    return {name: np.stack([s.pop(name) for s in snapshots])[:count] for name in names}
