"""A flow at several times: its file, its intervals, how it repeats, and what is refused."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow import FlowField, FlowSeries, load_flow, require_covered
from ellipsoid_coupling.flow import series as module
from ellipsoid_coupling.flow.outline import polygon_outline
from tests.flow.known import spline

BASE = spline(8)


def scaled(factor: float) -> FlowField:
    arrays = BASE.arrays._replace(coefficients=factor * BASE.arrays.coefficients)
    return FlowField(arrays, f"{factor:g} times the known one")


def series(repeat: bool = False) -> FlowSeries:
    return FlowSeries.of_fields(
        (0.0, 0.5, 0.75, 2.0), map(scaled, (1.0, 3.0, -1.0, 1.0)), "four flows", repeat=repeat
    )


def factor(flow: FlowField) -> float:
    """What the known flow is multiplied by."""
    return float(flow.arrays.coefficients[4, 4] / BASE.arrays.coefficients[4, 4])


@pytest.mark.parametrize(
    ("t", "expected"),
    [(-1.0, 1.0), (0.0, 1.0), (0.25, 2.0), (0.5, 3.0), (0.625, 1.0), (0.75, -1.0), (1.375, 0.0), (2.0, 1.0),
     (7.0, 1.0)],
)  # fmt: skip
def test_it_is_linear_between_its_times(t: float, expected: float) -> None:
    """To rounding; from outside it is that of the nearest end."""
    assert factor(series().at(t)) == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("t", [-0.3, 0.0, 0.3, 0.75, 1.9, 2.0])
def test_it_repeats_with_its_period(t: float) -> None:
    flow = series(repeat=True)
    for rounds in (-2, 1, 5):
        there = flow.at(t + 2.0 * rounds)
        np.testing.assert_allclose(
            there.arrays.coefficients, flow.at(t).arrays.coefficients, atol=1e-13
        )
    assert flow.covers == (0.0, np.inf)
    assert flow.origin == "four flows, repeated every 2"


def test_intervals_are_numbered_on_and_on() -> None:
    """Each contains its start and not its end, whatever rounding makes of the period."""
    flow = FlowSeries.of_fields(
        (0.1, 0.2, 0.3, 0.4), map(scaled, (1.0, 3.0, -1.0, 1.0)), repeat=True
    )
    for number in range(-7, 200):
        start, end = flow.time_of(number), flow.time_of(number + 1)
        assert start < end
        assert flow.interval_at(start) == number
        assert flow.interval_at(np.nextafter(end, -1.0)) == number
    once = series()
    assert [once.interval_at(t) for t in (-1.0, 0.0, 0.5, 1.0, 2.0, 9.0)] == [0, 0, 1, 2, 2, 2]


def test_a_saved_series_is_the_same_series(tmp_path: Path) -> None:
    """Bits, digest, outline and origin; and two saved ones are equal files."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    outline = polygon_outline([("lid", "wall", square, True)])
    flows = [
        FlowField(scaled(k).arrays, "x", outline._replace(outflow=np.full(4, k)))
        for k in (1.0, 2.0)
    ]
    flow = FlowSeries.of_fields((0.0, 1.0), flows, "two")
    for name in ("a.npz", "b.npz"):
        flow.save(tmp_path / name)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    again = load_flow(tmp_path / "a.npz")
    assert isinstance(again, FlowSeries)
    assert (again.digest, again.origin, again.repeat) == (flow.digest, "two", False)
    assert again.outline is not None
    assert again.outline.names == ("lid",)
    assert np.array_equal(again.outline.outflow, np.full(4, 1.5))
    for t in (0.0, 0.3, 1.0):
        assert np.array_equal(again.at(t).arrays.coefficients, flow.at(t).arrays.coefficients)
    assert [factor(field) for field in again.steady_fields()] == [1.0, 2.0]


def test_the_digest_covers_all() -> None:
    """Every time's field, the times, and whether they repeat."""

    def digest(times: tuple[float, ...] = (0.0, 1.0, 2.0), last: float = 1.0, **how: bool) -> str:
        return FlowSeries.of_fields(times, map(scaled, (1.0, 3.0, last)), **how).digest  # type: ignore[arg-type]

    others = [digest(last=1.0 + 1e-15), digest((0.0, 1.1, 2.0)), digest(repeat=True)]
    assert digest() not in others
    assert len(set(others)) == 3
    assert digest() == digest()


def test_no_more_than_three_fields_are_held_while_it_is_written() -> None:
    """The first one, the present one and the one before."""
    alive: set[int] = set()
    most = 0

    class Counted(FlowField):
        def __del__(self) -> None:
            alive.discard(id(self))

    def fields() -> object:
        nonlocal most
        for k in range(30):
            field = Counted(scaled(1.0 + k).arrays, "x")
            alive.add(id(field))
            most = max(most, len(alive))
            yield field

    FlowSeries.of_fields(range(30), fields())  # type: ignore[arg-type]
    assert most <= 3


def test_the_file_goes_with_the_last_one_that_uses_it() -> None:
    flow = series()
    from dataclasses import replace

    other, path = replace(flow, origin="told"), flow.path
    del flow
    assert factor(other.at(0.5)) == pytest.approx(3.0)
    del other
    assert not path.parent.exists()


@pytest.mark.parametrize(
    ("times", "factors", "message"),
    [
        ((0.0,), (1.0,), "from two to"),
        ((0.0, 0.0), (1.0, 2.0), "ascending times"),
        ((0.0, 2.0, 1.0), (1.0, 2.0, 1.0), "ascending times"),
        ((0.0, float("nan")), (1.0, 2.0), "ascending times"),
    ],
)
def test_times_that_are_none_are_refused(
    times: tuple[float, ...], factors: tuple[float, ...], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        FlowSeries.of_fields(times, map(scaled, factors))


def test_another_mesh_is_refused_with_its_time() -> None:
    with pytest.raises(InputError, match=r"time 0\.5: expected the mesh of the first time"):
        FlowSeries.of_fields((0.0, 0.5), (scaled(1.0), spline(9)))


def test_a_period_that_is_none_is_refused_unless_allowed() -> None:
    """U that is 10 % off after it; 4 % are told."""
    with pytest.raises(
        InputError, match=r"after its period 2, to 5%, found U that differs by 9\.1 %"
    ):
        FlowSeries.of_fields((0.0, 1.0, 2.0), map(scaled, (1.0, 3.0, 1.1)), repeat=True)
    for last, jump in ((1.1, "9.1 %"), (1.04, "3.8 %")):
        flow = FlowSeries.of_fields(
            (0.0, 1.0, 2.0), map(scaled, (1.0, 3.0, last)), repeat=True, allow_jump=last > 1.05
        )
        assert f"repeated every 2 (its U then is {jump} off)" in flow.origin
        # The last field is the first one then: no jump, whatever it was.
        assert factor(flow.at(np.nextafter(2.0, 0.0))) == pytest.approx(1.0, abs=1e-14)


def test_times_beyond_it_are_refused_with_both_intervals() -> None:
    require_covered("here", (0.0, 2.0), 2.0)
    require_covered("here", (-1.0, np.inf), 1e9)
    for covers in ((0.0, 1.9), (0.1, 3.0)):
        with pytest.raises(InputError, match=r"scene's times \[0, 2\], found one at \["):
            require_covered("here", covers, 2.0)


def test_it_has_no_velocity_without_a_time() -> None:
    for ask in (lambda: series().evaluate(0.5, 0.5), lambda: series().in_time):
        with pytest.raises(RunError, match=r"without a time"):
            ask()


def rewritten(path: Path, name: str, change: object) -> None:
    """The archive with one array changed, or left out."""
    with zipfile.ZipFile(path) as old:
        members = {one: old.read(one) for one in old.namelist()}
    if change is None:
        del members[f"{name}.npy"]
    else:
        with zipfile.ZipFile(path, "w") as new, new.open(f"{name}.npy", "w") as file:
            np.lib.format.write_array(file, np.asarray(change), allow_pickle=False)
        with zipfile.ZipFile(path) as new:
            members[f"{name}.npy"] = new.read(f"{name}.npy")
    with zipfile.ZipFile(path, "w") as new:
        for one, data in members.items():
            new.writestr(one, data)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("times", np.array([0.0, 1.0, 1.0, 2.0]), "ascending"),
        ("times", np.array([0.0, 1.0]), "from two times on"),
        ("times", np.array([0.0, np.nan, 1.0, 2.0]), "ascending"),
        ("times", np.array(["a"]), "times"),
        ("digests", None, "digests"),
        ("repeat", np.array([1.0]), "repeat"),
        ("coefficients_00002", None, "from two times on"),
        ("coefficients_00007", np.zeros((11, 11)), "from two times on"),
        ("mask", np.full((8, 8), 2, np.uint8), "mask"),
        ("numbers", np.zeros(8), "rectangle"),
    ],
)
def test_a_damaged_index_is_refused_when_it_is_loaded(
    name: str, change: object, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "flow.npz"
    series().save(path)
    rewritten(path, name, change)
    with pytest.raises(InputError, match=message):
        FlowSeries.load(path)


@pytest.mark.parametrize(
    "change", [np.zeros((11, 11)), np.full((11, 11), np.nan), np.zeros(3), np.array(["a"])]
)
def test_another_field_is_refused_with_its_time_when_it_is_read(
    change: object, tmp_path: Path
) -> None:
    path = tmp_path / "flow.npz"
    series().save(path)
    rewritten(path, "coefficients_00001", change)
    flow = FlowSeries.load(path)
    with pytest.raises(InputError, match=r"flow\.npz, time 0\.5: expected the flow that was saved"):
        flow.at(0.6)


@pytest.mark.parametrize("cut", [0, 10, 500, -30])
def test_a_cut_file_is_refused(cut: int, tmp_path: Path) -> None:
    path = tmp_path / "flow.npz"
    series().save(path)
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(InputError, match=r"flow\.npz"):
        load_flow(path)


def test_too_much_is_refused_before_it_is_written(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_SERIES_BYTES", 3 * 11 * 11 * 8)
    with pytest.raises(InputError, match="4 times with"):
        series()
