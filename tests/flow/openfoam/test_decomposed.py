"""Decomposed cases: what reconstructPar makes of the same parts, to the bit; and parts that do not fit."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowSeries, When
from ellipsoid_coupling.flow.openfoam import decomposed_mesh
from ellipsoid_coupling.flow.openfoam.case import Solution, read_solution
from ellipsoid_coupling.flow.openfoam.case_series import read_times
from ellipsoid_coupling.flow.openfoam.decomposed import whole_case
from ellipsoid_coupling.flow.openfoam.fields import Field, read_field
from ellipsoid_coupling.flow.openfoam.files import open_file
from ellipsoid_coupling.flow.openfoam.reader import read_case
from ellipsoid_coupling.flow.openfoam.times import Places, choose_time

DATA = Path(__file__).parents[2] / "data"
RECONSTRUCTED = DATA / "periodic_4"
COLLATED = DATA / "collated_4"
PARTS = 4


def copied(case: Path, target: Path, *left_out: str) -> Path:
    """A copy without the case's own times and mesh, and without the parts' folders named."""
    shutil.copytree(case, target, ignore=shutil.ignore_patterns(*left_out))
    for name in ("1", "2", "constant/polyMesh"):
        shutil.rmtree(target / name, ignore_errors=True)
    return target


@pytest.fixture
def parts(tmp_path: Path) -> Path:
    return copied(RECONSTRUCTED, tmp_path / "case")


def contents(places: Places) -> tuple[Solution, Field]:
    """Mesh and U, and phi."""
    solution = read_solution(places)
    mesh = solution.mesh
    patches = [p._replace(faces=0) if p.kind == "empty" else p for p in mesh.patches]
    file = open_file(places.time / "phi", "surfaceScalarField", most=10**6)
    return solution, read_field(file, 1, mesh.neighbour.size, patches)


def same_field(one: Field, other: Field) -> None:
    assert (one.dimensions, one.types, one.uniform) == (
        other.dimensions,
        other.types,
        other.uniform,
    )
    np.testing.assert_array_equal(one.values, other.values)
    assert one.on_patches.keys() == other.on_patches.keys()
    for name, values in one.on_patches.items():
        there = other.on_patches[name]
        if values is None or there is None or not values.size:
            assert there is None or not there.size
        else:
            np.testing.assert_array_equal(values, there)


@pytest.mark.parametrize("wanted", [None, "1"])
def test_parts_make_what_reconstruct_par_makes(parts: Path, wanted: str | None) -> None:
    """Every number of mesh, U and phi, on a mesh whose periodic patch lies between parts."""
    solution, phi = contents(choose_time(RECONSTRUCTED, wanted).places)
    with whole_case(parts, wanted) as chosen:
        put_together, fluxes = contents(chosen.places)
        assert chosen.note.endswith("in 4 parts")
    for name in ("points", "corners", "begins", "owner", "neighbour"):
        np.testing.assert_array_equal(
            getattr(put_together.mesh, name), getattr(solution.mesh, name)
        )
    assert [p[:4] for p in put_together.mesh.patches] == [p[:4] for p in solution.mesh.patches]
    same_field(put_together.velocity, solution.velocity)
    same_field(fluxes, phi)


def test_collated_parts_are_the_same(parts: Path) -> None:
    with whole_case(COLLATED, None) as chosen, whole_case(parts, None) as plain:
        for one, other in zip(contents(chosen.places), contents(plain.places), strict=True):
            if isinstance(one, Field) and isinstance(other, Field):
                same_field(one, other)
        assert (chosen.places.faces / "faces").read_bytes() == (
            plain.places.faces / "faces"
        ).read_bytes()
        assert (chosen.places.time / "U").read_bytes() == (plain.places.time / "U").read_bytes()


def test_the_field_is_that_of_the_reconstructed_case(parts: Path) -> None:
    """However the case is named: as a whole, by a part, or by a part's time."""
    field = read_case(RECONSTRUCTED, allow_misfit=True)
    for path in (parts, parts / "processor0", parts / "processor3" / "2", COLLATED / "processors4"):
        there = read_case(path, allow_misfit=True)
        np.testing.assert_array_equal(there.arrays.coefficients, field.arrays.coefficients)
        np.testing.assert_array_equal(there.arrays.mask, field.arrays.mask)
    earlier = read_case(RECONSTRUCTED / "1", allow_misfit=True).arrays.coefficients
    np.testing.assert_array_equal(
        read_case(parts / "processor1" / "1", allow_misfit=True).arrays.coefficients, earlier
    )


@pytest.mark.parametrize("case", ["one each", "collated"])
def test_a_series_of_parts_is_that_of_the_reconstructed_case(
    case: str, parts: Path, tmp_path: Path
) -> None:
    """To the bit, at each time; and one of its times alone."""
    whole = read_times(RECONSTRUCTED, When("all", until=1.0), allow_misfit=True)
    if case == "collated":
        parts = copied(COLLATED, tmp_path / "collated")
        shutil.copytree(parts / "processors4" / "2", parts / "processors4" / "4")
        whole = read_case(RECONSTRUCTED, allow_misfit=True)
    found = read_times(parts, When("all", until=1.0), allow_misfit=True)
    if case == "collated":
        # Its two times are the same one.
        assert found.digest == whole.digest
        assert found.origin.endswith("2 times from 2 to 4, of which 2 is the scene's 0, in parts, "
                                     "the same at all of them")  # fmt: skip
        return
    assert isinstance(found, FlowSeries)
    assert found.digest == whole.digest
    assert "in parts" in found.origin
    alone = read_times(parts, When(1.0, until=9.0), allow_misfit=True)
    assert alone.digest == read_case(RECONSTRUCTED / "1", allow_misfit=True).digest


def test_a_coarse_periodic_rectangle_is_the_same_at_both_ends() -> None:
    """To 1e-6 of its largest speed, 8 cells a period; a spline without the ends tied was 3 % off."""
    field = read_case(RECONSTRUCTED, allow_misfit=True)
    x_low, x_high, y_low, y_high = field.bounds
    y = np.linspace(y_low, y_high, 33)
    one, other = (field.evaluate(np.full(33, x), y) for x in (x_low, x_high))
    for name in ("velocity_x", "velocity_y", "dux_dy", "duy_dx"):
        jump = np.abs(getattr(one, name) - getattr(other, name)).max()
        assert jump < 1e-6 * max(field.largest_speed, np.abs(getattr(one, name)).max())


def test_origin_tells_the_parts_and_the_change(parts: Path) -> None:
    assert re.search(
        r"time 2, the last of 2, in 4 parts, changed by .* since time 1",
        read_case(parts, allow_misfit=True).origin,
    )


def test_a_reconstructed_case_is_taken_as_it_is(parts: Path) -> None:
    """Its own time 2 is as new as the parts': these may be broken. A newer one of the parts counts."""
    shutil.copytree(RECONSTRUCTED, parts, dirs_exist_ok=True)
    (parts / "processor2" / "2" / "U").write_text("broken")
    assert "parts" not in read_case(parts, allow_misfit=True).origin
    for k in range(PARTS):
        shutil.copytree(RECONSTRUCTED / f"processor{k}" / "1", parts / f"processor{k}" / "3")
    assert "time 3, the last of 3, in 4 parts" in read_case(parts, allow_misfit=True).origin


def test_a_time_that_a_part_lacks_is_refused_and_named(parts: Path) -> None:
    shutil.rmtree(parts / "processor2" / "2")
    with pytest.raises(InputError, match="2/U in all 4 parts, found none in processor2"):
        read_case(parts, allow_misfit=True)
    assert "time 1" in read_case(parts / "processor0" / "1", allow_misfit=True).origin


def test_a_missing_part_is_refused(parts: Path) -> None:
    shutil.rmtree(parts / "processor3")
    with pytest.raises(InputError, match=r"cells: .*found the number 59 among 48"):
        read_case(parts, allow_misfit=True)
    shutil.copytree(RECONSTRUCTED / "processor3", parts / "processor4")
    with pytest.raises(
        InputError, match="parts from processor0 on, found 4 folders, the last processor4"
    ):
        read_case(parts, allow_misfit=True)


def test_parts_of_two_decompositions_are_refused(parts: Path) -> None:
    shutil.copytree(COLLATED / "processors4", parts / "processors4")
    with pytest.raises(InputError, match=r"those of several \(processor0, processors4\)"):
        read_case(parts)
    # They do not matter where the case itself is as new.
    shutil.copytree(RECONSTRUCTED / "2", parts / "2")
    shutil.copytree(RECONSTRUCTED / "constant", parts / "constant", dirs_exist_ok=True)
    assert "parts" not in read_case(parts, allow_misfit=True).origin


def test_a_part_alone_is_refused_with_the_remedy(parts: Path, tmp_path: Path) -> None:
    alone = tmp_path / "elsewhere" / "processor0"
    shutil.copytree(parts / "processor0", alone)
    with pytest.raises(InputError, match="a part of a case: name the folder with all of them"):
        read_case(alone, allow_misfit=True)


def test_a_broken_file_is_named_where_the_user_has_it(parts: Path, tmp_path: Path) -> None:
    """No scratch folder is named; of a collated file, its part."""
    text = (parts / "processor1" / "2" / "U").read_bytes()
    (parts / "processor1" / "2" / "U").write_bytes(
        text.replace(b"List<vector>", b"List<tensor>", 1)
    )
    with pytest.raises(
        InputError, match=r"case/processor1/2/U, byte \d+: expected List<vector>"
    ) as caught:
        read_case(parts, allow_misfit=True)
    assert "ellipsoid-" not in str(caught.value)
    together = copied(COLLATED, tmp_path / "collated")
    path = together / "processors4" / "2" / "U"
    path.write_bytes(path.read_bytes().replace(b"List<vector>", b"List<tensor>", 1))
    with pytest.raises(InputError, match="collated/processor0/2/U, byte"):
        read_case(together, allow_misfit=True)


ADDRESSING = (
    "pointProcAddressing",
    "faceProcAddressing",
    "cellProcAddressing",
    "boundaryProcAddressing",
)


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.sampled_from(ADDRESSING), st.integers(0, PARTS - 1), st.integers(0, 10**6),
    st.one_of(st.integers(-300, 400), st.sampled_from([-(2**31), 2**31 - 1, 10**6])),
)  # fmt: skip
def test_wrong_addressing_is_refused_or_harmless(
    parts: Path, name: str, part: int, entry: int, value: int
) -> None:
    """One number replaced: an error in words or, where it is the right one, the same field."""
    path = parts / f"processor{part}" / "constant" / "polyMesh" / name
    kept = path.read_bytes()
    start = kept.index(b"(", kept.index(b"* //")) + 1
    end = kept.rindex(b")")
    numbers: NDArray[np.int32] = np.frombuffer(kept[start:end], "<i4").copy()
    old = int(numbers[entry % numbers.size])
    numbers[entry % numbers.size] = value
    path.write_bytes(kept[:start] + numbers.tobytes() + kept[end:])
    try:
        with whole_case(parts, None) as chosen:
            read_solution(chosen.places)
        assert value == old
    except InputError:
        assert value != old
    finally:
        path.write_bytes(kept)


def test_sizes_are_those_of_the_parts(parts: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Together no larger than a mesh may be."""
    monkeypatch.setattr(decomposed_mesh, "MOST_MESH_ENTRIES", 63)
    with pytest.raises(InputError, match="parts with at most 63 faces in all, found more"):
        read_case(parts)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            rb"// Processor1\s+\d+",
            b"// Processor1\n\n99999999",
            r"99999999 bytes of a part, found \d+",
        ),
        (rb"// Processor1\s+\d+", b"// Processor1\n\n12", "byte .*'\\)'"),
        (rb"class +decomposedBlockData", b"class volVectorField", "key class"),
        (rb"(?s)// Processor3.*", b"", "4 parts, found 3"),
    ],
)
def test_a_broken_collated_file_is_refused(
    tmp_path: Path, old: bytes, new: bytes, message: str
) -> None:
    case = copied(COLLATED, tmp_path / "collated")
    path = case / "processors4" / "2" / "U"
    text = path.read_bytes()
    changed = re.sub(old, new, text)
    assert changed != text
    path.write_bytes(changed)
    with pytest.raises(InputError, match=message):
        read_case(case, allow_misfit=True)
