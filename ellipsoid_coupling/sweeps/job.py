"""One point of a sweep, run into its folder: the same function wherever it runs."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path

from ellipsoid_coupling.compiled.compile_once import compiled_once
from ellipsoid_coupling.errors import EllipsoidError, InputError, Interrupted, refusal
from ellipsoid_coupling.files.reading import exists
from ellipsoid_coupling.files.versions import version
from ellipsoid_coupling.files.writing import not_forced
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import scheme_named
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, terms_of
from ellipsoid_coupling.simulation import simulate
from ellipsoid_coupling.storage.run_folder import CHECKPOINT_FILE, RESULT_FILE, RunFolder
from ellipsoid_coupling.sweeps.description import Sweep
from ellipsoid_coupling.sweeps.folder import flow_file, flow_key, run_path, wait_until_free
from ellipsoid_coupling.sweeps.points import Point
from ellipsoid_coupling.sweeps.records import Record, failed, record_of

# Called with the part of a point that is done.
Told = Callable[[float], None]
# Flows that a process keeps: a sweep over flows goes through them one by one.
_FLOWS_KEPT = 8


@dataclass(frozen=True)
class SavedFlow(FlowField):
    """A flow of which a file is kept already: a run folder gets a link to it instead of another copy."""

    file: Path = Path()

    def save(self, path: Path) -> None:
        """Link `file`; where the file system has no links, write another."""
        with suppress(OSError):
            os.link(self.file, path)
            return
        super().save(path)


def saved_flow(field: FlowField, file: Path) -> SavedFlow:
    """A flow and the file that holds it."""
    return SavedFlow(**{f.name: getattr(field, f.name) for f in fields(FlowField)}, file=file)


def load_flow(file: Path) -> SavedFlow:
    """A flow of the sweep's folder, read once a process.

    Raises
    ------
    InputError
        If it is missing or damaged.
    """
    # Another file of that name is another flow.
    told = file.stat() if exists(file) else None
    return _load_flow(file, *((told.st_ino, told.st_mtime_ns) if told else (0, 0)))


@functools.lru_cache(_FLOWS_KEPT)
def _load_flow(file: Path, _inode: int, _written: int) -> SavedFlow:
    return saved_flow(FlowField.load(file), file)


@dataclass(frozen=True)
class Job:
    """What every point of a sweep needs.

    Attributes
    ----------
    path : Path
        The sweep's folder.
    sweep : Sweep
    checkpoint_seconds : float
        Between two checkpoints of a run.
    """

    path: Path
    sweep: Sweep
    checkpoint_seconds: float = 15.0

    def run(self, point: Point, told: Told, flow: FlowField | None = None) -> Record:
        """Run a point, or go on with it, or read it where it is there; a failure is a record as well.

        Parameters
        ----------
        told : callable
            Called with the part that is done.
        flow : FlowField, optional
            Where it is here already; else it is read from the sweep's folder.

        Raises
        ------
        Interrupted
            After a signal; the run has left a checkpoint.
        """
        try:
            return record_of(self._result(point, told, flow))
        except Interrupted as error:
            number = max(error.exit_status - 128, 0)
            raise Interrupted(
                number, self.how_to_go_on(f"{point.name} has left a checkpoint")
            ) from None
        except EllipsoidError as error:
            return failed(str(error))
        except (MemoryError, OSError) as error:
            return failed(refusal(error))
        except Exception as error:  # a point that nobody foresaw must not end the others
            return failed(f"{type(error).__name__}: {error}")

    def how_to_go_on(self, what: str) -> str:
        """The message of a sweep that was stopped."""
        return f"{what}. Continue the sweep with --resume --out {self.path}."

    def _result(self, point: Point, told: Told, flow: FlowField | None) -> Result:
        run, scene = run_path(self.path, point.name), self.sweep.scene_of(point)
        wait_until_free(run)
        if (before := self.finished(point, scene)) is not None:
            return before
        if flow is None and (key := flow_key(scene)) is not None:
            flow = load_flow(flow_file(self.path, key))
        # Without a checkpoint it starts anew, whatever a power cut has left of it.
        resume = exists(run / CHECKPOINT_FILE)
        folder = RunFolder(run, resume, not resume, self.checkpoint_seconds)
        with compiled_once(_kind(point, self.sweep.lists.scheme, scene)) as ready, not_forced():

            def report(_stage: str, part: float) -> None:
                ready()
                told(part)

            return simulate(
                scene,
                point.model,
                scheme_named(self.sweep.lists.scheme).name,
                flow=flow,
                seed=point.seed,
                realisations=point.numbers,
                folder=folder,
                report=report,
            )

    def finished(self, point: Point, scene: Scene) -> Result | None:
        """The result of a point that was completed, by this version and with these settings."""
        run = run_path(self.path, point.name)
        if not exists(run / RESULT_FILE):
            return None
        try:
            result = Result.load(run)
        except InputError:  # damaged: it is computed again
            return None
        told = result.attributes
        same = (
            result.scene == scene
            and (result.model, result.scheme) == (point.model, self.sweep.lists.scheme)
            and told.get("seed") == point.seed
            and told.get("package_version") == version("ellipsoid_coupling")
        )
        # `simulate` says what differs.
        return result if same and result.status == "completed" else None


def _kind(point: Point, scheme: str, scene: Scene) -> str:
    """Points of one kind need the same kernels, as far as a scene tells."""
    sides = sorted({side.kind for side in scene.sides.values()})
    potentials = type(scene.outer_potential).__name__, type(scene.angular_potential).__name__
    return repr((point.model, scheme, terms_of(scene), sides, potentials))
