"""The points of a sweep and its file, without a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.sweeps.command import described
from ellipsoid_coupling.sweeps.description import MOST_POINTS, Sweep
from ellipsoid_coupling.sweeps.points import (
    coordinate,
    parsed,
    run_name,
    split_values,
    value_text,
)
from tests.sweeps.small import MODEL, ON_COMMAND_LINE, small_sweep

PLAIN = st.none() | st.booleans() | st.integers(-(10**9), 10**9) | st.text(max_size=5)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
VALUES = PLAIN | NUMBERS | st.lists(NUMBERS, max_size=3)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("a.b=1,2.5,x", ("1", "2.5", "x")),
        ("a=[1, 2],[3, 4]", ("[1, 2]", "[3, 4]")),
        ("a={s = 1, t = 2}, none", ("{s = 1, t = 2}", "none")),
        ("a='x,y',\"z,\"", ("'x,y'", '"z,"')),
        ("a=b=c", ("b=c",)),
    ],
)
def test_values_are_split_at_commas_outside_of_brackets_and_quotes(
    text: str, values: tuple[str, ...]
) -> None:
    assert split_values(text)[1] == values


@pytest.mark.parametrize("text", ["a", "=1,2", "a=", "a=1,,2", "a=1,"])
def test_a_list_with_a_hole_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="key=value,value"):
        split_values(text)


@given(VALUES)
@settings(max_examples=200)
def test_a_value_is_read_back_from_its_text(value: object) -> None:
    """Texts and numbers from Python are those that the command line would give, to the bit."""
    found = parsed("a", value_text(value))
    assert found == value
    assert type(found) is type(value)


def test_numpy_values_and_tables_have_texts() -> None:
    assert parsed("a", value_text(np.float64(0.1))) == 0.1
    assert parsed("a", value_text(np.arange(3))) == [0, 1, 2]
    assert parsed("a", value_text({"b": 1, "c d": [0.5]})) == {"b": 1, "c d": [0.5]}


def test_an_axis_has_numbers_where_all_values_are() -> None:
    assert coordinate("a", ["1", "2"]) == [1, 2]
    assert coordinate("a", ["1", "0.5"]) == [1, 0.5]
    assert coordinate("a", ["none", "[1, 2]", "x", "true"]) == ["none", "[1, 2]", "x", "true"]


def test_points_are_the_product_in_the_order_of_the_axes() -> None:
    sweep = small_sweep(
        {"noise.noise": ["0", "1"], "particles.number": ["5", "6", "7"]}, seeds=[3, 9]
    )
    points = list(sweep.points())
    assert sweep.dimensions == {"model": 1, "noise.noise": 2, "particles.number": 3, "seed": 2}
    assert [point.number for point in points] == list(range(12)) == list(range(sweep.count))
    assert [point.place for point in points] == list(np.ndindex(1, 2, 3, 2))
    assert points[5].settings == {"noise.noise": 0, "particles.number": 7}
    assert points[5].seed == 9
    assert sweep.scene_of(points[5]).particles.number == 7
    assert len({point.name for point in points}) == 12


def test_zipped_lists_are_taken_in_pairs() -> None:
    sweep = small_sweep({"noise.noise": ["0", "1"], "particles.number": ["5", "6"]}, zipped=True)
    assert sweep.dimensions == {"model": 1, "point": 2}
    assert [p.settings["particles.number"] for p in sweep.points()] == [5, 6]
    assert sweep.coordinates["noise.noise"] == ("point", [0, 1])


def test_realisations_are_split_within_each_place() -> None:
    sweep = small_sweep({"noise.noise": ["0", "1"]}, realisations=[4, 11, 3])
    points = list(sweep.points())
    assert sweep.count == 6 == len(points)
    assert [point.numbers for point in points[:3]] == [range(4, 7), range(7, 10), range(10, 11)]
    assert [point.place for point in points] == [(0, 0)] * 3 + [(0, 1)] * 3


@pytest.mark.parametrize(
    ("lists", "part"),
    [
        ({"keys": ["a"], "values": [["1"], ["2"]]}, "lists"),
        ({"keys": ["a", "a"], "values": [["1"], ["2"]]}, "once"),
        ({"keys": ["times"], "values": [["1"], ]}, "same times"),
        ({"keys": ["a", "b"], "values": [["1"], ["1", "2"]], "zipped": True}, "lengths"),
        ({"zipped": True}, "--zip"),
        ({"models": [MODEL, MODEL]}, "each one once"),
        ({"seeds": [1, 1]}, "each one once"),
        ({"seeds": [-1]}, "seeds.0"),
        ({"seeds": []}, "seeds"),
        ({"realisations": [3, 3, 1]}, "A:B"),
        ({"keys": ["a"], "values": [[]]}, "values.0"),
        ({"unknown": 1}, "unknown"),
    ],
)  # fmt: skip
def test_lists_that_do_not_fit_are_refused(lists: dict[str, Any], part: str) -> None:
    with pytest.raises(InputError, match=part):
        small_sweep(**lists)


def test_a_sweep_has_a_bounded_number_of_points() -> None:
    """Counted, not made: of the lists' lengths."""
    with pytest.raises(InputError, match="points"):
        small_sweep(seeds=list(range(1001)), realisations=[0, 1000, 1])
    assert MOST_POINTS == 10**6


def test_run_names_are_short_plain_and_sorted() -> None:
    labels = [("particles.number", "5"), ("flow.field", "a/b c"), ("seed", "3")]
    assert run_name(7, 1000, MODEL, labels) == f"007-{MODEL}-number=5-field=a_b_c-seed=3"
    assert run_name(7, 10, MODEL, [("a", "x" * 100)]) == f"7-{MODEL}"


def test_sweep_toml_repeats_the_sweep(tmp_path: Path) -> None:
    sweep = small_sweep(
        {"noise.noise": ["0", "0.5"], "start.x": ["[1.5, 2.0]", "[1.5, 3.0]"]},
        seeds=[1, 2],
        realisations=[0, 4, 2],
    )
    file = tmp_path / "sweep.toml"
    sweep.save(file)
    again = Sweep.load(file)
    assert again.text() == sweep.text() == file.read_text()
    assert list(again.points()) == list(sweep.points())


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("[sweep]\nmodels = []", "sections"),
        ("[sweep]\nmodels = []\n[versions]\n[scene]", "models"),
        ('[sweep]\nmodels = ["a"]\nkeys = 3\n[versions]\n[scene]', "keys"),
        ('[sweep]\nmodels = ["a"]\nzipped = 1\n[versions]\n[scene]', "zipped"),
        ('[sweep]\nmodels = ["a"]\nx = 1\n[versions]\n[scene]', "x"),
        ("sweep = 1\nversions = 1\nscene = 1", "sections"),
        ("[sweep", "TOML"),
    ],
)
def test_another_file_is_refused_with_the_key_at_fault(
    text: str, part: str, tmp_path: Path
) -> None:
    file = tmp_path / "sweep.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=part) as error:
        Sweep.load(file)
    assert str(file) in error.value.where


def test_the_command_line_tells_lists_from_settings(tmp_path: Path) -> None:
    """A key with one value changes the scene of all points; times may be set so."""
    lists = {"models": MODEL, "seeds": (0, 1), "zipped": None}
    sweep = described("stationary", lists, [*ON_COMMAND_LINE, "noise.noise=0,1"], None)
    assert sweep.lists.keys == ("noise.noise",)
    assert sweep.text() == small_sweep({"noise.noise": ["0", "1"]}, seeds=[0, 1]).text()
    sweep.save(tmp_path / "sweep.toml")
    for name in (None, str(tmp_path / "sweep.toml")):
        assert described(name, {"models": None}, [], tmp_path).text() == sweep.text()
    with pytest.raises(InputError, match="as it stands"):
        described(None, {"models": MODEL}, [], tmp_path)
    with pytest.raises(InputError, match="a scene"):
        described(None, {}, [], tmp_path / "nothing")
    with pytest.raises(InputError, match="--model"):
        described("stationary", {"models": None}, [], None)
