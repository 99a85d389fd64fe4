"""--set with anything: a valid scene or one line; and the terms and the memory of what is valid."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.models import SCHEMES, Setup, kind_named, model_names, model_terms
from ellipsoid_coupling.models.memory import require_memory
from ellipsoid_coupling.scenes import (
    Scene,
    builtin_scenes,
    explain_terms,
    load_scene,
    parse_setting,
)

_LONG = 1_000_000


def keys(table: dict[str, Any], before: str = "") -> Iterator[str]:
    for key, value in table.items():
        yield before + key
        if isinstance(value, dict):
            yield from keys(value, f"{before}{key}.")


KEYS = sorted(
    {key for name in builtin_scenes() for key in keys(load_scene(name).model_dump())}
    | {
        "start.points",
        "walls.sides",
        "outer_potential.stiffness",
        "noise.noise",
        "x",
        "a.b.c.d",
        "",
    }
)
# The bounds of numbers and beyond, other types, other syntax, long, nested and unprintable text.
VALUES = [
    "1e300", "-1e300", "1e100", "-1e100", "1e-100", "1e-308", "5e-324", "nan", "inf", "-inf", "0",
    "-0.0", "1", "-1", "0.5", "1e400", "9" * 400, "1e18", "1000000000000000000", "1_000", "0x10",
    "9223372036854775807", "9223372036854775808", "true", '"a"', "none", "{}", "{a=1}", "[]", "[1]",
    "[1, 2]", "[[1, 2]]", "[nan, nan]", "[0, 1e100]", "[-1e100, 1e100]", "[0.0, 1e-99]",
    "[1e-99, 1]", "[[0, 0, 1e100]]", "[[0, 0], [1, 1, 1]]", '["left"]', '["left", "left"]', "a" * _LONG,
    f'"{"b" * _LONG}"', "[" * 2000, "1979-05-27", '"\\u0000"', '"\x1b[2J"', '""', "\udcff", "\u00e9",
    '"\U0001f600"', "x = 1\ny = 2", "=", "open", "reflecting", "direct", "paper",
]  # fmt: skip
SETTINGS = st.lists(
    st.tuples(st.sampled_from(KEYS), st.sampled_from(VALUES)), min_size=1, max_size=3
)


def refusal_of(scene: Scene, model: str, scheme: Any) -> str:
    """What the model says of the scene before anything is built; "" where it could run."""
    try:
        assert explain_terms(scene)
        terms = model_terms(scene, model)
        setup = Setup(scene, terms, scheme, None, 0, scene.particles.realisations)
        require_memory(kind_named(model), setup)
    except InputError as error:
        return str(error)
    return ""


@settings(max_examples=150, derandomize=True, deadline=None, database=None)
@given(name=st.sampled_from(builtin_scenes()), chosen=SETTINGS)
def test_any_setting_is_taken_or_refused_in_one_line(
    name: str, chosen: list[tuple[str, str]]
) -> None:
    told, scene = [""], None
    try:
        scene = load_scene(name, dict(parse_setting(f"{key}={value}") for key, value in chosen))
    except InputError as error:
        told = [str(error)]
    if scene is not None:
        told = [refusal_of(scene, model, s) for model in model_names() for s in SCHEMES]
    assert all(text == "" or text.isprintable() for text in told)
    assert all(len(text) < 3000 for text in told)
