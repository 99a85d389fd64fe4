"""Scene files: what is read, what is refused, and which terms follow."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.models import model_terms
from ellipsoid_coupling.scenes import (
    Term,
    builtin_scenes,
    explain_terms,
    load_scene,
    parse_setting,
    scene_to_toml,
    terms_of,
)


@pytest.mark.parametrize("name", builtin_scenes())
def test_a_scene_survives_being_written_and_read(name: str, tmp_path: Path) -> None:
    scene = load_scene(name)
    file = tmp_path / "scene.toml"
    file.write_text(scene_to_toml(scene))
    assert load_scene(file) == scene


def test_the_papers_five_scenes_are_there_and_six_with_patches() -> None:
    papers = {"cavity", "cavity_free", "rotation", "stationary", "top_bottom"}
    others = {"channel", "cylinder", "elbow", "ring", "step", "vortex_street"}
    assert builtin_scenes() == sorted(papers | others)
    assert {name for name in builtin_scenes() if load_scene(name).named_patches} == others


def test_the_cavity_has_the_papers_numbers() -> None:
    scene = load_scene("cavity")
    particles = scene.particles
    assert (particles.length, particles.width, particles.inertia) == (0.05, 0.025, 0.001)
    assert (particles.number, particles.realisations) == (1000, 128)
    assert (scene.times, scene.numerics.cell) == ((2.0, 3.5, 5.0), 0.005)
    assert scene.flow is not None
    assert (scene.flow.drag, scene.flow.angular_drag, scene.flow.cells) == (10.0, 10.0, 100)


BAD: list[tuple[dict[str, Any], str]] = [
    ({"particles.lenght": 1.0}, "particles.lenght"),
    ({"particles.length": "long"}, "particles.length"),
    ({"particles.length": -0.1}, "particles.length"),
    ({"particles.width": 0.2}, "particles"),
    ({"particles.number": 2.5}, "particles.number"),
    ({"particles.number": 0}, "particles.number"),
    ({"particles": None}, "particles"),
    ({"flow.drag": float("nan")}, "flow.drag"),
    ({"walls.sides": ["up"]}, "walls.sides"),
    ({"domain.boundary": "open"}, "walls"),
    ({"interaction": None}, "walls"),
    ({"times": [2.0, 1.0]}, "increasing"),
    ({"times": []}, "times"),
    ({"start.x": [0.6, 0.4]}, "start"),
    ({"start.x": [0.4, 1.4]}, "start.x"),
    ({"turbulence": 3}, "turbulence"),
    ({"start": {"points": []}}, "start.points"),
    ({"start": {"points": [[0.1]]}, "particles.number": 1}, "start.points.0"),
    ({"start": {"points": [[0.1, "a"]]}, "particles.number": 1}, "start.points.0.1"),
    ({"start": {"points": [[0.1, 0.2]]}}, "particles.number = 1"),
    ({"start": {"points": [[1.1, 0.2]]}, "particles.number": 1}, "start.x within"),
    ({"start.points": [[0.1, 0.2]], "particles.number": 1}, "points within x"),
    ({"name.first": 3}, "name"),
]


@pytest.mark.parametrize(("settings", "named"), BAD, ids=lambda value: str(value))
def test_a_mistake_names_file_and_key(settings: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match="expected") as caught:
        load_scene("cavity", settings)
    assert named in str(caught.value)
    assert caught.value.exit_status == 2


def test_missing_and_broken_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cavity_free"):
        load_scene("no_such_scene")
    broken = tmp_path / "broken.toml"
    broken.write_text("name = = 3")
    with pytest.raises(InputError, match=r"broken\.toml"):
        load_scene(broken)
    broken.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="TOML"):
        load_scene(broken)


def test_settings_are_toml_values() -> None:
    assert parse_setting("a.b=3") == ("a.b", 3)
    assert parse_setting("a=[1.0, 2]") == ("a", [1.0, 2])
    assert parse_setting("a=paper") == ("a", "paper")
    assert parse_setting("walls=none") == ("walls", None)
    with pytest.raises(InputError, match="key=value"):
        parse_setting("nonsense")


def test_terms_follow_from_the_scene() -> None:
    free = terms_of(load_scene("cavity_free"))
    assert free.flow
    left_out = (free.interaction, free.torque, free.walls, free.noise)
    assert not any(left_out)
    full = terms_of(load_scene("cavity"))
    assert full.interaction
    assert full.walls
    assert full.reflection
    circles = terms_of(load_scene("cavity", {"particles.width": 0.05}))
    assert circles.interaction
    assert not circles.torque
    still = load_scene("cavity", {"particles.width": 0.05, "flow.angular_drag": 0.0})
    assert not terms_of(still).angle


def test_noise_runs_in_particles_and_only_damps_in_closures() -> None:
    scene = load_scene("stationary")
    assert model_terms(scene, "microscopic").noise
    term = next(t for t in explain_terms(scene, random_motion=False) if t.name == "noise")
    assert not term.runs
    assert "damping" in term.why
    quiet = load_scene("stationary", {"noise.noise": 0.0})
    assert not model_terms(quiet, "microscopic").noise


def test_every_term_has_a_reason() -> None:
    for name in builtin_scenes():
        assert all(term.why for term in explain_terms(load_scene(name)))


def test_patches_that_reflect_are_told() -> None:
    """Beside the sides, which alone decide `has_sides`; patches of other kinds are not named."""

    def reflection(boundaries: dict[str, object]) -> Term:
        settings = {"domain.boundary": "open", "walls": None, "boundaries": boundaries}
        scene = load_scene("cavity", settings)
        assert not scene.has_sides("reflect")
        return next(term for term in explain_terms(scene) if term.name == "reflection")

    sides = "remove on the left, remove on the right, remove on the bottom, remove on the top"
    reflect, remove = {"kind": "reflect"}, {"kind": "remove"}
    found = reflection({"outlet": remove})
    assert (found.runs, found.why) == (False, sides)
    found = reflection({"outlet": remove, "cylinder": reflect})
    assert (found.runs, found.why) == (True, f"{sides}, reflect at the patch cylinder")
    found = reflection({"step": reflect, "lid": reflect})
    assert (found.runs, found.why) == (True, f"{sides}, reflect at the patches step and lid")


def test_points_have_a_box_and_survive_a_file(tmp_path: Path) -> None:
    points = {"points": [[0.1, 0.2], [0.3, 0.1, 2.0]], "angle": 0.5}
    scene = load_scene("cavity", {"start": points, "particles.number": 2})
    assert (scene.start.x, scene.start.y) == ((0.1, 0.3), (0.1, 0.2))
    assert scene.start.places() == [(0.1, 0.2, 0.5), (0.3, 0.1, 2.0)]
    file = tmp_path / "points.toml"
    file.write_text(scene_to_toml(scene))
    assert load_scene(file) == scene


def test_whole_turns_are_taken_off_an_angle() -> None:
    """1e9 radian: what is left is what sin and cos see, to rounding; small angles stay as given."""
    start = load_scene("cavity", {"start.angle": 1e9}).start
    assert abs(start.own_angle) <= math.pi
    assert math.sin(start.own_angle) == pytest.approx(math.sin(1e9), abs=1e-15)
    assert start.turns + start.own_angle == 1e9
    kept = load_scene("cavity", {"start.angle": 1.5}).start
    assert (kept.turns, kept.own_angle) == (0.0, 1.5)
    two = {"points": [[0.1, 0.2, 1e9], [0.1, 0.2, 1e9 + 20.0]]}
    places = load_scene("cavity", {"start": two, "particles.number": 2}).start.places()
    assert places[1][2] - places[0][2] == pytest.approx(20.0, abs=1e-12)


def test_a_byte_order_mark_is_no_part_of_a_scene(tmp_path: Path) -> None:
    """As some editors save it; the values are the file's, bit for bit."""
    path = tmp_path / "my.toml"
    path.write_bytes(b"\xef\xbb\xbf" + scene_to_toml(load_scene("rotation")).encode())
    assert load_scene(path) == load_scene("rotation")


def test_one_time_is_a_list_of_it() -> None:
    assert load_scene("rotation", {"times": 0.5}).times == (0.5,)
    assert load_scene("rotation", {"times": 2}).times == (2.0,)


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        (
            "domain.x",
            [0, 1, 2],
            r"key domain\.x: expected at most 2 in brackets, found \[0, 1, 2\]",
        ),
        ("domain.x", 3, r"key domain\.x: expected values in brackets, \[a, b\], found 3"),
        ("times", [], r"key times: expected at least 1 in brackets, found \[\]"),
        (
            "times",
            [1, 0.5],
            "scene rotation: expected increasing times, found values that do not fit",
        ),
    ],
)
def test_lists_are_refused_in_the_users_words(key: str, value: object, told: str) -> None:
    with pytest.raises(InputError, match=told):
        load_scene("rotation", {key: value})
