"""The page of scene keys, from the models that read scene files and from `scenes.meanings`."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib import import_module
from typing import Annotated, Any, NamedTuple, get_args, get_origin

from pydantic import TypeAdapter
from pydantic.fields import FieldInfo

from ellipsoid_coupling.scenes.boundary import BoundaryPart
from ellipsoid_coupling.scenes.kinds import Kinds
from ellipsoid_coupling.scenes.meanings import MEANINGS
from ellipsoid_coupling.scenes.scene import Scene
from ellipsoid_coupling.scenes.sides import keys_of, known_kinds
from ellipsoid_coupling.scenes.values import Part

# The bounds of numbers in a JSON schema, as a reader writes them.
_BOUNDS = {
    "exclusiveMinimum": "above {:g}",
    "minimum": "at least {:g}",
    "exclusiveMaximum": "below {:g}",
    "maximum": "at most {:g}",
}
_TYPES = {
    "boolean": "true or false",
    "number": "number",
    "integer": "whole number",
    "string": "text",
}


# Makes the package's own kinds of boundary known, with their parameters.
import_module("ellipsoid_coupling.geometry.boundaries")


class Key(NamedTuple):
    """A key of a scene file: its dotted name, its default, and what it may be; both for a reader."""

    name: str
    default: str
    allowed: str


def scene_keys(part: type[Part] = Scene, above: str = "") -> Iterator[Key]:
    """All keys, in the order of the models; those of a kind stand behind its name."""
    for name, field in part.model_fields.items():
        inner = list(_inner(field.annotation))
        kinds = next((one for one in (*inner, *field.metadata) if isinstance(one, Kinds)), None)
        section = next((t for t in inner if isinstance(t, type) and issubclass(t, Part)), None)
        if kinds is not None:
            yield from _keys_of_kinds(kinds)
        elif section is BoundaryPart:
            yield Key(f"{name}.NAME.kind", "required", _listed(known_kinds()))
            for kind in known_kinds():
                optional, keys = keys_of(kind).optional, keys_of(kind).required
                for key in (*keys, *optional):
                    default = "optional" if key in optional else "required"
                    yield Key(f"{name}.NAME.{kind}.{key}", default, "number")
        elif section is not None:
            yield from scene_keys(section, f"{above}{name}.")
        else:
            yield _key(above + name, field)


def _inner(annotation: Any) -> Iterator[Any]:
    """What stands within unions, mappings and annotations, from the outside inwards."""
    yield annotation
    if get_origin(annotation) is Annotated:
        yield from annotation.__metadata__
    for part in get_args(annotation):
        yield from _inner(part)


def _keys_of_kinds(kinds: Kinds) -> Iterator[Key]:
    known = kinds.known()
    # The kind of a section that names none has the same keys.
    default = next(name for name in known if kinds.keys({"kind": name}) == kinds.keys({}))
    yield Key(f"{kinds.section}.kind", f'"{default}"', _listed(known))
    for name, kind in known.items():
        for key, field in kind.keys.model_fields.items():
            yield _key(f"{kinds.section}.{name}.{key}", field)


def _key(name: str, field: FieldInfo) -> Key:
    default = "required" if field.is_required() else _shown(field.default)
    annotation: Any = field.annotation
    for one in field.metadata:
        annotation = Annotated[annotation, one]
    schema = TypeAdapter(annotation).json_schema()
    return Key(name, default, _allowed(schema))


def _shown(value: Any) -> str:
    """A default as TOML has it; what is left out by default is a dash."""
    return "–" if value is None else json.dumps(value)


def _listed(words: Any) -> str:
    return ", ".join(f'"{word}"' for word in words)


def _allowed(schema: dict[str, Any]) -> str:
    """A JSON schema in words."""
    if "anyOf" in schema:
        return " or ".join(_allowed(one) for one in schema["anyOf"] if one.get("type") != "null")
    if "enum" in schema:
        return _listed(schema["enum"])
    if schema["type"] == "object":
        return f"name = {_allowed(schema['additionalProperties'])}, ..."
    if schema["type"] == "array":
        inner = schema.get("prefixItems") or [schema["items"]]
        words = ", ".join(_allowed(one) for one in inner)
        return f"[{words}]" if "prefixItems" in schema else f"[{words}, ...]"
    bounds = [text.format(schema[key]) for key, text in _BOUNDS.items() if key in schema]
    return ", ".join([_TYPES[schema["type"]], *bounds])


def page() -> str:
    """The page's tables, one a section, in Markdown."""
    lines: list[str] = []
    section = None
    for key in scene_keys():
        before, _, last = key.name.rpartition(".")
        if before.split(".")[0] != section:
            section = before.split(".")[0]
            shown = ".NAME" if section == "boundaries" else ""
            title = f"[{section}{shown}]" if section else "Above all sections"
            lines += ["", f"## {title}", ""]
            lines += ["| key | unit | default | allowed | meaning |", "|---|---|---|---|---|"]
        meaning = MEANINGS[key.name]
        kind = before.split(".")[1:]
        name = f"`{last}`" + (f" ({kind[-1]})" if kind and kind[-1] != "NAME" else "")
        cells = (name, meaning.unit or "–", f"`{key.default}`", key.allowed, meaning.text)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines) + "\n"
