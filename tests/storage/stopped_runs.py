"""Runs that were stopped half-way, for tests of what lies in their folders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.storage.run_folder import (
    RunFolder,
)

SETTINGS: dict[str, Any] = {
    "particles.number": 20,
    "particles.realisations": 1,
    "interaction": None,
    "times": [0.2, 0.4],
    "numerics.time_step": 0.001,
}


class Stop(BaseException):
    pass


def scene(**changes: Any) -> ec.Scene:
    return ec.load_scene("stationary", SETTINGS | changes)


def run(folder: RunFolder | Path, seed: int = 0, **more: Any) -> ec.Result:
    return ec.simulate(scene(), "microscopic", "paper", seed=seed, folder=folder, **more)


def interrupted(folder: Path) -> RunFolder:
    """A run that was stopped half-way, with a checkpoint."""

    def stop(_stage: str, part: float) -> None:
        if part > 0.6:
            raise Stop

    with pytest.raises(Stop):
        run(RunFolder(folder, checkpoint_seconds=0.0), report=stop)
    return RunFolder(folder, resume=True)


def contents(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in folder.iterdir()}
