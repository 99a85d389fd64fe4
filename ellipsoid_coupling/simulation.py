"""The only time loop: build a model on a scene, take it to each save time, keep what it was."""

from __future__ import annotations

import os
import time
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow import FlowField, analytic_flow, obtain_flow
from ellipsoid_coupling.kernels import CompileTimer
from ellipsoid_coupling.models import Arrays, Model, SchemeName, Setup, build_model, scheme_named
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, terms_of
from ellipsoid_coupling.scenes.files import table_to_toml

Report = Callable[[str, float], None]

# A kill loses at most about this much work.
CHECKPOINT_SECONDS = 15.0

_PACKAGES = ("ellipsoid_coupling", "numpy", "numba", "scipy")


def scene_flow(
    scene: Scene, path: str | Path | None = None, report: Report | None = None
) -> FlowField | None:
    """The flow that a scene names, or the one at `path`; None for a scene without a fluid.

    Raises
    ------
    InputError
        For an unknown flow, or a `path` that is no solved case; or a path given to a scene without
        [flow].
    """
    if scene.flow is None:
        if path is not None:
            raise InputError(
                f"scene {scene.name}", "a scene with a [flow] section", "none", "Leave out --flow."
            )
        return None
    if path is None and scene.flow.source == "closed_form":
        return analytic_flow(scene.flow.field)
    given = Path(path) if path is not None else None
    return obtain_flow(scene.flow.field, scene.flow.cells, given, report=report)


def simulate(
    scene: Scene,
    model: str,
    scheme: SchemeName = "accurate",
    *,
    flow: FlowField | str | Path | None = None,
    seed: int = 0,
    realisations: int | None = None,
    folder: Path | None = None,
    resume: bool = False,
    report: Report | None = None,
) -> Result:
    """Run one model on one scene to its last save time.

    Parameters
    ----------
    scene : Scene
    model : str
        A name of `ellipsoid_coupling.models.model_names`.
    scheme : "paper" or "accurate"
    flow : FlowField, path or None
        Replaces the scene's own flow.
    seed : int
        Fixes start positions and noise; the same call gives the same bits.
    realisations : int, optional
        Instead of the scene's number.
    folder : Path, optional
        The run folder: run.toml, checkpoints and result.nc go there.
    resume : bool
        Continue from the checkpoint in `folder`, bit for bit as if never stopped.
    report : callable, optional
        Called with the stage and its finished part, between 0 and 1.

    Raises
    ------
    InputError
        For a scene, model or flow that do not fit together.
    RunError
        If the run failed; with a folder, what was reached stands in its result.nc with the status
        "failed: ...".
    """
    scheme_named(scheme)
    field = flow if isinstance(flow, FlowField) else scene_flow(scene, flow, report)
    setup = Setup(
        scene=scene,
        terms=terms_of(scene, model),
        scheme=scheme,
        flow=field,
        seed=seed,
        realisations=realisations or scene.particles.realisations,
    )
    return _Run(model, setup, folder, report).go(resume)


@dataclass
class _Run:
    """One run from start, or from its checkpoint, to its end."""

    name: str
    setup: Setup
    folder: Path | None
    report: Report | None

    def go(self, resume: bool) -> Result:
        started = time.perf_counter()
        self.snapshots: list[Arrays] = []
        self.earlier = np.zeros(2)  # wall and compile seconds of the runs before this one
        with CompileTimer() as self.compiling:
            # Before anything is written: it refuses what does not fit.
            self.model: Model = build_model(self.name, self.setup)
            if self.folder is not None:
                self.folder.mkdir(parents=True, exist_ok=True)
                _write_run_file(self.folder, self.name, self.setup, resume)
            if resume:
                self._load_checkpoint()
            self.started = self.saved = started
            try:
                self._loop()
            except RunError as error:
                self._finish(f"failed: {error}")
                raise
            return self._finish("completed")

    def _loop(self) -> None:
        times = self.setup.scene.times
        for until in times[len(self.snapshots) :]:
            while self.model.time < until:
                self.model.advance(until)
                self._tell(self.model.time / times[-1])
                self._checkpoint_if_due()
            self.snapshots.append(self.model.snapshot())

    def _tell(self, part: float) -> None:
        if self.report is not None:
            scene, scheme = self.setup.scene.name, self.setup.scheme
            self.report(f"{scene}: {self.name}, {scheme}", part)

    def _seconds(self) -> NDArray[np.float64]:
        """Wall seconds without compiling, and compiling seconds, earlier parts included."""
        compiling = self.compiling.seconds
        running = time.perf_counter() - self.started - compiling
        return np.asarray(self.earlier + np.array([running, compiling]))

    def _checkpoint_if_due(self) -> None:
        if self.folder is None or time.perf_counter() - self.saved < CHECKPOINT_SECONDS:
            return
        self.saved = time.perf_counter()
        arrays = {f"state.{k}": v for k, v in self.model.state().items()}
        for i, snapshot in enumerate(self.snapshots):
            arrays |= {f"snapshot.{i}.{k}": v for k, v in snapshot.items()}
        beside = self.folder / f".checkpoint.{os.getpid()}.npz"
        np.savez(beside, allow_pickle=False, seconds=self._seconds(), **arrays)
        beside.replace(self.folder / "checkpoint.npz")

    def _load_checkpoint(self) -> None:
        file = self.folder / "checkpoint.npz" if self.folder else None
        if file is None or not file.is_file():
            return  # killed before the first checkpoint: nothing to continue from but the start
        with np.load(file, allow_pickle=False) as data:
            self.earlier = data["seconds"]
            prefix = "state."
            state = {k.removeprefix(prefix): data[k] for k in data.files if k.startswith(prefix)}
            self.model.restore(state)
            for name in data.files:
                if name.startswith("snapshot."):
                    _, i, variable = name.split(".")
                    while len(self.snapshots) <= int(i):
                        self.snapshots.append({})
                    self.snapshots[int(i)][variable] = data[name]

    def _finish(self, status: str) -> Result:
        wall, compiling = self._seconds()
        result = Result(
            scene=self.setup.scene,
            model=self.name,
            scheme=self.setup.scheme,
            layout=self.model.layout,
            times=np.array(self.setup.scene.times[: len(self.snapshots)]),
            variables=_stack(self.snapshots or [self.model.snapshot()], len(self.snapshots)),
            coordinates=self.model.coordinates(),
            attributes={
                "status": status,
                "seed": self.setup.seed,
                "resolution": _resolution(self.model.layout, self.setup),
                "flow": self.setup.flow.origin if self.setup.flow else "none",
                "package_version": version("ellipsoid_coupling"),
                **self.model.counts(),
                "wall_seconds": float(wall),
                "compile_seconds": float(compiling),
            },
        )
        if self.folder is not None:
            result.save(self.folder / "result.nc")
            (self.folder / "checkpoint.npz").unlink(missing_ok=True)
        return result


def _stack(snapshots: list[Arrays], count: int) -> dict[str, Any]:
    names = snapshots[0].keys()
    return {name: np.stack([s[name] for s in snapshots])[:count] for name in names}


def _resolution(layout: str, setup: Setup) -> str:
    numerics = setup.scene.numerics
    if layout == "particles":
        step = (
            f"dt = {numerics.time_step:g}"
            if setup.scheme == "paper"
            else f"tolerance = {numerics.tolerance:g}"
        )
        return f"{setup.scene.particles.number} x {setup.realisations} particles, {step}"
    angle = f", {numerics.angle_cells} angles" if layout == "q" else ""
    return f"h = {numerics.cell:g}{angle}"


def _write_run_file(folder: Path, model: str, setup: Setup, resume: bool) -> None:
    """run.toml: all that a repetition needs. A resumed run must be the one that was started."""
    table = {
        "run": {
            "model": model,
            "scheme": setup.scheme,
            "seed": setup.seed,
            "realisations": setup.realisations,
            "flow": setup.flow.origin if setup.flow else "none",
        },
        "versions": {name: version(name) for name in _PACKAGES},
        "scene": setup.scene.model_dump(mode="json", exclude_none=True),
    }
    file = folder / "run.toml"
    if resume and file.is_file():
        before = tomllib.loads(file.read_text(encoding="utf-8"))
        for part in ("run", "scene"):
            if before.get(part) != tomllib.loads(table_to_toml(table))[part]:
                raise InputError(
                    str(file), "the run that was started", f"another [{part}]", "Use another --out."
                )
    beside = folder / f".run.toml.{os.getpid()}"
    beside.write_text(table_to_toml(table), encoding="utf-8")
    beside.replace(file)
