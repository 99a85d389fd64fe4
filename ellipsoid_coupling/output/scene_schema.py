"""The JSON schema of scene files, by which editors complete keys and mark mistakes.

Types, ranges and defaults are those of the models that read scene files, descriptions are those of
`scenes.meanings`. What a schema cannot say (that a start lies in the domain, say) is told by a run.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core.core_schema import PlainValidatorFunctionSchema

from ellipsoid_coupling.files.reading import is_ordinary, read_bytes
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.output.new_scene import require_new
from ellipsoid_coupling.scenes.kinds import ANGULAR_POTENTIALS, OUTER_POTENTIALS, Kinds
from ellipsoid_coupling.scenes.meanings import MEANINGS
from ellipsoid_coupling.scenes.scene import Scene
from ellipsoid_coupling.scenes.sides import keys_of, known_kinds

# A schema is nested tables of anything that JSON has.
Schema = dict[str, Any]

# The name of the file beside a scene, and the line in the scene that editors look for.
SCHEMA_FILE = "scene.schema.json"
SCHEMA_LINE = f"#:schema ./{SCHEMA_FILE}"

_BOUNDS = {
    "ge": "minimum",
    "gt": "exclusiveMinimum",
    "le": "maximum",
    "lt": "exclusiveMaximum",
}
# Editors for TOML know this version.
_VERSION = "http://json-schema.org/draft-07/schema#"
_SECTIONS = {
    "domain": "The rectangle that is computed",
    "particles": "The particles of one realisation, and how many realisations there are",
    "start": "Where the particles are at the start, at rest",
    "numerics": "Resolution and numerical methods; all of it has defaults but the cells",
    "boundaries": "What happens at sides of the domain and at patches of the flow's case, by name",
    "flow": "The fluid; without this section there is none, and no drag",
    "interaction": "How particles act on each other; without this section they do not",
    "walls": "Ghost particles and ghost cells at walls; without this section there are none",
    "outer_potential": "V1(r), a force on all particles; without this section V1 = 0",
    "angular_potential": "V2(theta), a torque on all particles; without this section V2 = 0",
    "noise": "Random kicks, and the damping that belongs to them; without this section there are none",
}


class _Generator(GenerateJsonSchema):
    """Sections that come in kinds are anything here; `scene_schema` fills them in."""

    def function_plain_schema(self, schema: PlainValidatorFunctionSchema) -> Schema:
        del schema
        return {}


def scene_schema() -> Schema:
    """The schema as nested dictionaries, without references, all kinds that are registered included."""
    import_module("ellipsoid_coupling.geometry.boundaries")  # makes its kinds known
    whole = _schema_of(Scene)
    keys: Schema = whole["properties"]
    for kinds in (OUTER_POTENTIALS, ANGULAR_POTENTIALS):
        keys[kinds.section] = _kinds_schema(kinds)
    keys["boundaries"] = _boundaries_schema()
    _loosen(keys)
    for name, key in keys.items():
        _describe(key, name)
    return {"$schema": _VERSION, "title": "A scene of ellipsoid_coupling", **whole}


def schema_text() -> str:
    """The schema as JSON."""
    return json.dumps(scene_schema(), indent=2, ensure_ascii=False) + "\n"


def require_place(path: Path, *, force: bool) -> None:
    """Refuse, unless forced, a path that holds anything but this very schema; InputError."""
    ours = schema_text().encode()
    size = path.stat().st_size if is_ordinary(path) else -1
    if size != len(ours) or read_bytes(path, "a schema", size) != ours:
        require_new(path, force=force)


def write_schema(path: Path) -> None:
    """Write the schema, completely or not at all."""
    with whole_file(path) as beside:
        beside.write_text(schema_text(), encoding="utf-8")


def _schema_of(model: type[BaseModel]) -> Schema:
    """A model's own schema, tidied, its references replaced by what they refer to."""
    schema = model.model_json_schema(schema_generator=_Generator)
    definitions: Schema = schema.pop("$defs", {})
    tidied: Schema = _tidied(schema, definitions)
    return tidied


def _tidied(node: Any, definitions: Schema) -> Any:
    """`node` without references, titles made of names, and null, which TOML does not have."""
    if isinstance(node, list):
        return [_tidied(one, definitions) for one in node]
    if not isinstance(node, dict):
        return node
    if "$ref" in node:
        named = definitions[node["$ref"].rpartition("/")[2]]
        rest = {key: value for key, value in node.items() if key != "$ref"}
        return _tidied(named | rest, definitions)
    kept = {
        key: value
        for key, value in node.items()
        if key not in ("title", "description") and not (key == "default" and value is None)
    }
    if "properties" in node:
        properties = node["properties"].items()
        kept["properties"] = {key: _tidied(value, definitions) for key, value in properties}
    others = {k: _tidied(v, definitions) for k, v in kept.items() if k != "properties"}
    kept |= others
    # A bound that follows a check of ours keeps pydantic's word.
    kept = {_BOUNDS.get(key, key): value for key, value in kept.items()}
    # The names of lists whose places differ, in the version of the schema that editors know.
    if "prefixItems" in kept:
        kept |= {"items": kept.pop("prefixItems"), "additionalItems": False}
    options = [one for one in kept.pop("anyOf", []) if one != {"type": "null"}]
    if len(options) == 1:
        return options[0] | kept
    return kept | {"anyOf": options} if options else kept


def _kinds_schema(kinds: Kinds) -> Schema:
    """A section that comes in kinds: one of several tables."""
    tables = []
    for name, kind in kinds.known().items():
        table = _schema_of(kind.keys)
        word: Schema = {"const": name, "description": _meaning(f"{kinds.section}.kind")}
        required = list(table.get("required", []))
        if kinds.keys({"kind": name}) == kinds.keys({}):
            word["default"] = name
        else:
            required.append("kind")
        for key, value in table["properties"].items():
            _describe(value, f"{kinds.section}.{name}.{key}")
        tables.append(
            table | {"properties": {"kind": word} | table["properties"], "required": required}
        )
    return {"type": "object", "anyOf": tables}


def _boundaries_schema() -> Schema:
    """Sections by the names of sides and patches, each of them one of several kinds."""
    tables = []
    for name in known_kinds():
        known = keys_of(name)
        numbers: Schema = {
            key: {"type": "number", "description": _meaning(f"boundaries.NAME.{name}.{key}")}
            for key in (*known.required, *known.optional)
        }
        word = {"const": name, "description": _meaning("boundaries.NAME.kind")}
        tables.append(
            {
                "type": "object",
                "properties": {"kind": word} | numbers,
                "required": ["kind", *known.required],
                "additionalProperties": False,
            }
        )
    part = {"anyOf": tables, "description": "One side (left, right, bottom, top) or patch"}
    return {"type": "object", "additionalProperties": part}


def _loosen(keys: Schema) -> None:
    """What the readers take beside what their models say: one time alone, points instead of a box."""
    times = keys["times"]
    keys["times"] = {"anyOf": [times, times["items"]]}
    start = keys["start"]
    start["anyOf"] = [{"required": start.pop("required")}, {"required": ["points"]}]
    number = keys["flow"]["properties"]["parameters"]["additionalProperties"]
    number["description"] = "a number of the formula"
    keys["flow"]["oneOf"] = [{"required": ["field"]}, {"required": ["case"]}]


def _describe(node: Schema, key: str) -> None:
    """Write the meaning of a key, and of the keys below it, into their schemas."""
    node["description"] = _SECTIONS.get(key) or _meaning(key)
    properties: Mapping[str, Schema] = node.get("properties", {})
    for name, value in properties.items():
        _describe(value, f"{key}.{name}")


def _meaning(key: str) -> str:
    """The meaning of a key with its unit; of a kind from outside no more is known than that it is one."""
    meaning = MEANINGS.get(key)
    if meaning is None:
        return "a number of this kind"
    return f"{meaning.text} ({meaning.unit})" if meaning.unit not in ("", "1") else meaning.text
