"""Checkpoints: damaged ones and those that no run has written are refused and kept."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.stepping.step_control import NEXT_STEP, PLANNED_BY, STATUS, STEPS, TIME
from ellipsoid_coupling.storage.run_folder import (
    CHECKPOINT_FILE,
    Keeper,
    RunFolder,
)
from tests.storage.stopped_runs import contents, interrupted, run


@pytest.mark.parametrize("target", ["nowhere", CHECKPOINT_FILE])
def test_a_checkpoint_that_leads_nowhere_is_refused(target: str, tmp_path: Path) -> None:
    place = interrupted(tmp_path)
    (tmp_path / CHECKPOINT_FILE).unlink()
    (tmp_path / CHECKPOINT_FILE).symlink_to(target)
    with pytest.raises(InputError, match=r"checkpoint\.npz: expected a whole checkpoint"):
        run(place)


_DAMAGES = ["cut", "flip", "empty", "text", "alien", "pickle", "bomb", "packed", "nested", "named"]


@pytest.mark.parametrize("damage", _DAMAGES)
def test_a_damaged_checkpoint_is_refused_and_kept(damage: str, tmp_path: Path) -> None:
    place = interrupted(tmp_path)
    file = tmp_path / CHECKPOINT_FILE
    data = bytearray(file.read_bytes())
    if damage == "cut":
        file.write_bytes(data[: len(data) // 2])
    elif damage == "flip":
        data[len(data) // 2] ^= 16
        file.write_bytes(data)
    elif damage == "empty":
        file.write_bytes(b"")
    elif damage == "text":
        file.write_text("not a checkpoint")
    elif damage == "alien":
        np.savez(file, meta=np.array('{"format": 1}'), other=np.zeros(3))
    elif damage == "pickle":
        np.savez(file, allow_pickle=True, meta=np.array([print, "object"], dtype=object))
    elif damage == "packed":  # 100 kB that become 100 MB
        np.savez_compressed(file, meta=np.array('{"format": 2}'), other=np.zeros(12_500_000))
    elif damage == "nested":
        np.savez(file, meta=np.array("[" * 100_000))
    elif damage == "named":
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("x\x1b[2J", b"")
    else:  # a header that promises more than any memory has
        header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
        header += b" " * (63 - (10 + len(header)) % 64) + b"\n"
        with zipfile.ZipFile(file, "w") as archive:
            lead = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little")
            archive.writestr("seconds.npy", lead + header)
    before = contents(tmp_path)
    with pytest.raises(InputError, match=CHECKPOINT_FILE) as caught:
        run(place)
    assert str(caught.value).isprintable()
    assert contents(tmp_path) == before


def write_checkpoint(folder: Path, **changed: NDArray[Any]) -> None:
    """Replace arrays of a checkpoint; what checks archives finds nothing amiss."""
    file = folder / CHECKPOINT_FILE
    with np.load(file) as archive:
        arrays = {name: archive[name] for name in archive.files}
    assert set(changed) <= set(arrays)
    np.savez(file, allow_pickle=False, **(arrays | changed))


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["state.place", "state.velocity", "state.force", "snapshot.0.x"])
def test_a_checkpoint_with_numbers_that_no_run_has_is_refused(
    name: str, value: float, tmp_path: Path
) -> None:
    """A NaN as a place would become an index into foreign memory."""
    place = interrupted(tmp_path)
    with np.load(tmp_path / CHECKPOINT_FILE) as archive:
        array = archive[name].copy()
    array.flat[array.size // 2] = value
    write_checkpoint(tmp_path, **{name: array})
    before = contents(tmp_path)
    with pytest.raises(InputError, match=rf"a finite number at [\w.]+\[.*\], found {value}"):
        run(place)
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    ("column", "value", "told"),
    [
        (PLANNED_BY, 1e9, "a reason 1e"),
        (PLANNED_BY, -1.0, "a reason -1"),
        (PLANNED_BY, 0.5, "a reason 0.5"),
        (NEXT_STEP, 0.0, "a next step of 0"),
        (TIME, 0.1, "t = 0.1 beyond"),
        (STEPS, -1.0, "a count that no run has"),
        (STATUS, 2.0, "a status"),
    ],
)
def test_a_checkpoint_with_a_clock_that_no_run_has_is_refused(
    column: int, value: float, told: str, tmp_path: Path
) -> None:
    """Kernels use the reason as an index without looking."""
    place = interrupted(tmp_path)
    with np.load(tmp_path / CHECKPOINT_FILE) as archive:
        clock = archive["state.clock"].copy()
    clock[0, column] = value
    write_checkpoint(tmp_path, **{"state.clock": clock})
    with pytest.raises(InputError, match=told):
        run(place)


def test_a_checkpoint_removed_in_mid_run_is_not_missed(tmp_path: Path) -> None:
    def remove(_stage: str, _part: float) -> None:
        (tmp_path / CHECKPOINT_FILE).unlink(missing_ok=True)

    assert run(RunFolder(tmp_path, checkpoint_seconds=0.0), report=remove).status == "completed"


def test_checkpoints_take_a_small_part_of_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A checkpoint that takes 10 s comes every 500 s, whatever the interval."""
    now = [0.0]
    monkeypatch.setattr("ellipsoid_coupling.storage.run_folder.time.perf_counter", lambda: now[0])
    keeper = Keeper(15.0)
    assert not keeper.due
    now[0] = 15.0
    assert keeper.due
    now[0] = 25.0
    keeper.written(15.0)
    now[0] = 524.0
    assert not keeper.due
    now[0] = 525.0
    assert keeper.due
