"""Fields in the cache: read once, told apart by content, never trusted blindly."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField, kept_fields
from ellipsoid_coupling.flow.kept_fields import kept_field
from ellipsoid_coupling.flow.openfoam import reader
from ellipsoid_coupling.flow.when import Divergence

COARSE = Path(__file__).parents[1] / "data" / "l_shape"


@pytest.fixture
def case(cavity_16: Path, tmp_path: Path, own_cache: Path) -> Path:
    """A copy of the cavity, and an empty cache."""
    assert not own_cache.exists()
    return shutil.copytree(cavity_16, tmp_path / "case", ignore=shutil.ignore_patterns("VTK"))


@pytest.fixture
def readings(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Which cases have been read, and not only hashed."""
    read: list[Path] = []
    whole = reader.read_flow

    def counted(
        path: Path, *, allow_misfit: bool = False, divergence: Divergence = Divergence.NONE
    ) -> FlowField:
        read.append(path)
        return whole(path, allow_misfit=allow_misfit, divergence=divergence)

    monkeypatch.setattr(reader, "read_flow", counted)
    return read


def _entry(cache: Path) -> Path:
    (entry,) = (cache / "fields").glob("*.npz")
    return entry


def test_a_case_is_read_once(case: Path, readings: list[Path]) -> None:
    """The second field is the first one to the bit, its outline and its origin too."""
    first, second = kept_field(case), kept_field(case)
    assert len(readings) == 1
    assert second.digest == first.digest
    assert second.origin == first.origin
    kept_field(case / "any.foam")
    assert len(readings) == 1


@pytest.mark.parametrize(
    "file", ["3.95/U", "constant/polyMesh/points", "constant/polyMesh/boundary"]
)
def test_a_case_that_changes_is_read_anew(case: Path, readings: list[Path], file: str) -> None:
    kept_field(case)
    path = case / file
    old = path.read_text(encoding="utf-8")
    path.write_text(old + "\n// changed\n", encoding="utf-8")
    kept_field(case)
    path.write_text(old, encoding="utf-8")
    kept_field(case)
    assert len(readings) == 2


def test_a_copy_of_another_name_tells_its_own(case: Path, readings: list[Path]) -> None:
    kept_field(case)
    copy = shutil.copytree(case, case.with_name("copy"))
    assert kept_field(copy).origin.startswith("OpenFOAM case copy,")
    assert len(readings) == 2


@pytest.mark.parametrize("spoilt", ["broken", "empty", "of another case", "a folder"])
def test_what_is_no_field_in_the_cache_is_replaced(
    case: Path, own_cache: Path, readings: list[Path], spoilt: str
) -> None:
    own = kept_field(case)
    entry = _entry(own_cache)
    if spoilt == "broken":
        entry.write_bytes(entry.read_bytes()[:-200])
    elif spoilt == "empty":
        entry.write_bytes(b"")
    elif spoilt == "a folder":
        entry.unlink()
        entry.mkdir()
    else:
        kept_field(COARSE, allow_misfit=True).save(entry)
        readings.pop()
    again = kept_field(case)
    np.testing.assert_array_equal(again.arrays.coefficients, own.arrays.coefficients)
    assert len(readings) == 2


def test_a_field_that_was_only_allowed_is_not_for_others(own_cache: Path) -> None:
    kept_field(COARSE, allow_misfit=True)
    assert _entry(own_cache).is_file()
    with pytest.raises(InputError, match="--allow-misfit"):
        kept_field(COARSE)


def test_other_sources_of_this_package_read_anew(
    case: Path, readings: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    kept_field(case)
    monkeypatch.setattr(kept_fields, "_own_sources", lambda: "others")
    kept_field(case)
    assert len(readings) == 2


def test_only_the_latest_fields_stay(
    case: Path, own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_fields, "_MOST_KEPT", 2)
    kept_field(case)
    oldest = _entry(own_cache)
    os.utime(oldest, (1.0, 1.0))
    for name in ("second", "third"):
        kept_field(shutil.copytree(case, case.with_name(name)))
    assert not oldest.exists()
    assert len(list((own_cache / "fields").glob("*.npz"))) == 2


def test_foamtovtks_files_are_kept_too(
    cavity_16: Path, own_cache: Path, readings: list[Path]
) -> None:
    first, second = (kept_field(cavity_16 / "VTK") for _ in range(2))
    assert first.digest == second.digest
    assert len(readings) == 1
    assert _entry(own_cache).is_file()
