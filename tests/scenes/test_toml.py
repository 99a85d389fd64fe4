"""What is written as TOML is read back as it was: any text, any path."""

from __future__ import annotations

import string
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.scenes import load_run_part, load_scene, parse_toml, scene_to_toml
from ellipsoid_coupling.scenes.files import table_to_toml
from tests.robustness.conftest import within_limits

KEYS = st.text(string.ascii_lowercase + "_", min_size=1, max_size=8)
# Letters of every plane, control characters, quotes; no halves of letters, which no file can hold.
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=40)
VALUES = st.one_of(
    TEXTS, st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False,
    allow_infinity=False), st.lists(TEXTS, max_size=3), st.lists(st.lists(st.floats(-1e9, 1e9))),
)  # fmt: skip
TABLES = st.recursive(
    st.dictionaries(KEYS, VALUES, max_size=4),
    lambda inner: st.dictionaries(KEYS, st.one_of(VALUES, inner), max_size=4),
    max_leaves=5,
)
NAMES = [
    "\U0001f600",
    'quote" and \\',
    "tab\t, line\nend",
    "del \x7f \x80",
    "\x1b[2J",
    "caf\u00e9 \U0001d4b3",
]


@settings(max_examples=300, derandomize=True, deadline=None, database=None)
@given(table=TABLES)
def test_every_table_survives(table: dict[str, object]) -> None:
    assert parse_toml(table_to_toml(table), "here") == table


@settings(max_examples=100, derandomize=True, deadline=None, database=None)
@given(title=st.text(max_size=300), path=st.text(max_size=60))
def test_titles_and_paths_survive_or_are_refused(
    title: str, path: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Each accepted scene gives a file that reads back as the same scene."""
    scene, told = None, ""
    try:
        scene = load_scene("cavity", {"title": title, "flow.field": path})
    except InputError as error:
        told = str(error)
    if scene is None:
        assert told.isprintable()
        return
    assert parse_toml(scene_to_toml(scene), "here")["title"] == title
    file = tmp_path_factory.getbasetemp() / "scene.toml"
    file.write_text(scene_to_toml(scene), encoding="utf-8")
    assert load_scene(file) == scene


@pytest.mark.parametrize("name", NAMES)
def test_a_case_folder_of_any_name_can_be_repeated_from_run_toml(name: str, tmp_path: Path) -> None:
    scene = load_scene("cavity", {"flow.field": f"/cases/{name}"})
    run = {"model": "microscopic", "flow": f"OpenFOAM case {name} \udcff", "flow_digest": "0"}
    table = {"run": run, "versions": {}, "scene": scene.model_dump(mode="json", exclude_none=True)}
    file = tmp_path / "run.toml"
    file.write_text(table_to_toml(table), encoding="utf-8")
    assert load_scene(file) == scene
    assert load_run_part(file).flow == f"OpenFOAM case {name} \\udcff"


def test_joined_letters_make_a_title_and_control_characters_do_not() -> None:
    family = "\U0001f468\u200d\U0001f469\u200d\U0001f467"
    assert load_scene("cavity", {"title": family}).title == family
    for title in ("\x1b[31m", "two\nlines", "\u202eleft", "long " * 100):
        with pytest.raises(InputError, match="title"):
            load_scene("cavity", {"title": title})


DEEP = ".".join(["a"] * 300_000) + " = 1\n"


@pytest.mark.parametrize(
    "before",
    [
        "", "[x]\n", "x = '''a'''''\n", 'x = """a"""""\n', 'x = """\\""""\n', 'x = "\\\\"\n',
        '"k".\'l\' = "v" # \'\n', "x = '\\'\n", "x = {", "[",
    ],
)  # fmt: skip
def test_a_key_of_very_many_parts_is_refused_before_it_is_read(before: str) -> None:
    """It took tomllib 1.5 GB for one of 20 000 parts, and grows with the square."""
    with within_limits(), pytest.raises(InputError, match="nested more than 50 deep"):
        parse_toml(before + DEEP + "y = 'b'\nz = \"c\"\n", "here")


def test_dots_that_divide_no_key_are_kept() -> None:
    text = 'a = "' + "." * 100 + '"\nb = [' + "1.5, " * 100 + "]\nc = '''\n...''' # " + "." * 60
    table = parse_toml(text, "here")
    assert table == {"a": "." * 100, "b": [1.5] * 100, "c": "..."}
