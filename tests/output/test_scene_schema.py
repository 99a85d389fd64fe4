"""The JSON schema of scene files: it takes what `load_scene` takes, and every key is described.

The checker below knows the words that the schema uses, and fails for any other.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.output import scene_schema
from ellipsoid_coupling.output.scene_schema import Schema, require_place, write_schema
from ellipsoid_coupling.scenes import builtin_scenes, load_scene, scene_to_toml
from ellipsoid_coupling.scenes.meanings import MEANINGS
from ellipsoid_coupling.scenes.scene import Numerics

SCENES = Path(scene_schema.__file__).parents[1] / "scenes"
TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "boolean": (bool,),
    "integer": (int,),
    "number": (int, float),
}
TOLD = {"$schema", "title", "description", "default"}


@pytest.fixture(scope="module")
def schema() -> Schema:
    return scene_schema.scene_schema()


def fits(value: Any, schema: Schema) -> bool:
    """Whether a value of a TOML file fits; AssertionError for a word that is not known here."""
    words = sorted(set(schema) - TOLD, key=lambda word: word != "type")  # others need the type
    return all(_fits_word(value, word, schema) for word in words)


def _fits_word(value: Any, word: str, schema: Schema) -> bool:
    said = schema[word]
    match word:
        case "type":
            is_bool = isinstance(value, bool) and said != "boolean"
            return isinstance(value, TYPES[said]) and not is_bool
        case "const":
            return bool(value == said)
        case "enum":
            return value in said
        case "anyOf":
            return any(fits(value, one) for one in said)
        case "oneOf":
            return sum(fits(value, one) for one in said) == 1
        case "required":
            return set(said) <= set(value)
        case "properties":
            return all(fits(value[key], one) for key, one in said.items() if key in value)
        case "additionalProperties":
            more = [v for key, v in value.items() if key not in schema.get("properties", {})]
            return all(fits(v, said) for v in more) if isinstance(said, dict) else not more
        case "items" if isinstance(said, list):
            return all(fits(v, one) for v, one in zip(value, said, strict=False))
        case "items":
            return all(fits(v, said) for v in value)
        case "additionalItems":
            return len(value) <= len(schema["items"])
        case "minItems" | "minLength":
            return bool(len(value) >= said)
        case "maxItems" | "maxLength" | "maxProperties":
            return bool(len(value) <= said)
        case "minimum":
            return bool(value >= said)
        case "maximum":
            return bool(value <= said)
        case "exclusiveMinimum":
            return bool(value > said)
    raise AssertionError(f"an unknown word {word}")


def tables(name: str) -> Iterator[Schema]:
    """A built-in scene as its author wrote it, and as a run keeps it."""
    yield tomllib.loads((SCENES / f"{name}.toml").read_text())
    yield tomllib.loads(scene_to_toml(load_scene(name)))


@pytest.mark.parametrize("name", builtin_scenes())
def test_it_takes_every_scene_of_ours(schema: Schema, name: str) -> None:
    for table in tables(name):
        assert fits(table, schema)


WRONG: list[tuple[str, object]] = [
    ("particles.size", 3),
    ("particles.length", -1.0),
    ("particles.length", "long"),
    ("particles.number", 1.5),
    ("domain.boundary", "closed"),
    ("domain.x", [0.0, 1.0, 2.0]),
    ("numerics.cfl", 1.5),
    ("flow.case", "beside/field"),
    ("flow.drag", None),
    ("start.x", None),
    ("outer_potential", {"kind": "harmonic", "stiff": 1.0}),
    ("boundaries", {"left": {"kind": "door"}}),
    ("boundaries", {"left": {"kind": "inlet"}}),
    ("times", []),
]
RIGHT: list[tuple[str, object]] = [
    ("times", 2.5),
    ("particles.length", 1),
    ("start", {"points": [[0.5, 0.5], [0.4, 0.4, 1.0]]}),
    ("outer_potential", {"stiffness": 1.0}),
    ("angular_potential", {"kind": "axis", "amplitude": 1.0, "direction": 0.0}),
    ("boundaries", {"left": {"kind": "inlet", "density": 1.0, "angle": 0.2}}),
    ("flow.time", [0.0, 2.0]),
    ("flow.time", "all"),
]


def changed(key: str, value: object) -> Schema:
    table: Schema = tomllib.loads((SCENES / "cavity.toml").read_text())
    *sections, last = key.split(".")
    inner = table
    for section in sections:
        inner = inner[section]
    if value is None:
        del inner[last]
    else:
        inner[last] = value
    return table


@pytest.mark.parametrize(("key", "value"), WRONG)
def test_it_refuses_what_a_run_refuses(schema: Schema, key: str, value: object) -> None:
    table = changed(key, value)
    assert not fits(table, schema)
    with pytest.raises(InputError):
        load_scene(table)


@pytest.mark.parametrize(("key", "value"), RIGHT)
def test_it_takes_what_a_run_takes(schema: Schema, key: str, value: object) -> None:
    assert fits(changed(key, value), schema)


def described(node: Schema, key: str) -> Iterator[tuple[str, Schema]]:
    """Every key of the schema with its own schema, sections and the keys of kinds included."""
    for name, value in node.get("properties", {}).items():
        yield f"{key}{name}", value
        yield from described(value, f"{key}{name}.")
    for one in node.get("anyOf", []):
        yield from described(one, key)
    if isinstance(node.get("additionalProperties"), dict):
        yield f"{key}NAME", node["additionalProperties"]
        yield from described(node["additionalProperties"], f"{key}NAME.")


def test_every_key_is_described_with_its_unit(schema: Schema) -> None:
    found = list(described(schema, ""))
    assert [key for key, value in found if not value.get("description")] == []
    texts: dict[str, set[str]] = {}
    for key, value in found:
        texts.setdefault(key, set()).add(value["description"])
    for key, meaning in MEANINGS.items():
        # Keys of kinds stand behind the kind's name there, and in one of several tables here.
        plain = re.sub(r"(harmonic|axis|sine|inlet)\.", "", key)
        assert any(text.startswith(meaning.text) for text in texts[plain]), key
    drag = schema["properties"]["flow"]["properties"]["drag"]
    assert drag["description"].endswith("(1/time)")
    assert drag["minimum"] == 0


def test_defaults_are_those_of_the_code(schema: Schema) -> None:
    keys = schema["properties"]["numerics"]["properties"]
    for name, field in Numerics.model_fields.items():
        if field.default is not None and not field.is_required():
            assert keys[name]["default"] == field.default
    assert "default" not in keys["flux"]


def test_it_is_plain_json_without_references(schema: Schema) -> None:
    text = scene_schema.schema_text()
    assert json.loads(text) == schema
    assert "$ref" not in text
    assert "null" not in text


def test_an_own_file_of_that_name_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / scene_schema.SCHEMA_FILE
    require_place(path, force=False)
    write_schema(path)
    require_place(path, force=False)
    path.write_text("{}")
    with pytest.raises(InputError, match="--force"):
        require_place(path, force=False)
    require_place(path, force=True)
