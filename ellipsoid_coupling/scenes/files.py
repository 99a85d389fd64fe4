"""Scene files: TOML in, a validated `Scene` out; every mistake names the file and the key."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.scenes.scene import Scene

Table = dict[str, Any]


def builtin_scenes() -> list[str]:
    """The names of the scenes that the package ships, sorted."""
    folder = resources.files("ellipsoid_coupling.scenes")
    return sorted(file.name[:-5] for file in folder.iterdir() if file.name.endswith(".toml"))


def load_scene(scene: str | Path, settings: Mapping[str, Any] | None = None) -> Scene:
    """Read a built-in scene by its name, or a TOML file.

    Parameters
    ----------
    scene : str or Path
        A name of `builtin_scenes`, or the path of a TOML file.
    settings : mapping, optional
        Values that replace the file's, by dotted key: ``{"particles.number": 100}``; the value None
        takes a whole part out: ``{"interaction": None}``.

    Raises
    ------
    InputError
        For a missing or unreadable file, an unknown key, a value of the wrong type or range.
    """
    table, where = _read_table(scene)
    if set(table) == {"run", "versions", "scene"}:  # the run.toml of an earlier run
        table = table["scene"]
    for key, value in (settings or {}).items():
        _apply(table, key, value)
    return scene_from_table(table, where)


def scene_from_table(table: Table, where: str) -> Scene:
    """Validate a table as it stands in a scene file; `where` names its source in messages."""
    try:
        return Scene.model_validate(table)
    except ValidationError as error:
        raise _input_error(error, where) from None


def parse_setting(text: str) -> tuple[str, Any]:
    """Split ``key=value``; the value is TOML (a bare word is a string, ``none`` takes a part out)."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise InputError("--set", "key=value", repr(text), "Example: --set particles.number=100.")
    if value.strip().lower() == "none":
        return key.strip(), None
    try:
        return key.strip(), tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key.strip(), value.strip()


def scene_to_toml(scene: Scene) -> str:
    """The scene as TOML that `load_scene` reads back to an equal scene."""
    return table_to_toml(scene.model_dump(mode="json", exclude_none=True))


def table_to_toml(table: Mapping[str, Any], prefix: str = "") -> str:
    """Plain values first, then one section per nested table (strings, numbers, booleans, lists)."""
    plain = [f"{k} = {_toml_value(v)}" for k, v in table.items() if not isinstance(v, dict)]
    sections = [
        f"\n[{prefix}{key}]\n{table_to_toml(value, f'{prefix}{key}.')}"
        for key, value in table.items()
        if isinstance(value, dict)
    ]
    return "\n".join(plain) + ("\n" if plain else "") + "".join(sections)


def _toml_value(value: object) -> str:
    # A JSON string, number, boolean or list of them is a TOML value as well.
    return json.dumps(value, allow_nan=False)


def _read_table(scene: str | Path) -> tuple[Table, str]:
    name = str(scene)
    if name in builtin_scenes():
        text = resources.files("ellipsoid_coupling.scenes").joinpath(f"{name}.toml").read_text()
        return tomllib.loads(text), f"scene {name}"
    path = Path(scene)
    if not path.is_file():
        known = ", ".join(builtin_scenes())
        remedy = "Give one of these names or the path of a scene file."
        raise InputError(
            f"scene {name}", f"a built-in scene ({known}) or a file", "neither", remedy
        )
    try:
        return tomllib.loads(path.read_text(encoding="utf-8")), str(path)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(str(path), "a TOML file", str(error), "Mend the line named.") from None


def _apply(table: Table, key: str, value: object) -> None:
    *sections, last = key.split(".")
    for section in sections:
        table = table.setdefault(section, {})
        if not isinstance(table, dict):
            raise InputError(
                f"--set {key}", "section.key", f"{section} is a value", "Check the key."
            )
    if value is None:
        table.pop(last, None)
    else:
        table[last] = value


def _input_error(error: ValidationError, where: str) -> InputError:
    """The first mistake of `error` in words; a user mends one at a time."""
    first = error.errors(include_url=False)[0]
    key = ".".join(str(part) for part in first["loc"]) or "the scene"
    place, found = f"{where}, key {key}", repr(first["input"])
    if first["type"] == "extra_forbidden":
        known = ", ".join(_known_keys([str(part) for part in first["loc"][:-1]]))
        return InputError(place, f"one of {known}", "an unknown key", "Remove or rename it.")
    if first["type"] == "missing":
        return InputError(place, "a value", "none", "Add the key.")
    if isinstance(first["input"], dict):
        found = "these values together"
    expected = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    return InputError(place, expected, found, "Change the value.")


def _known_keys(sections: list[str]) -> list[str]:
    model: Any = Scene
    for section in sections:
        annotation = model.model_fields[section].annotation
        options = getattr(annotation, "__args__", (annotation,))
        model = next(option for option in options if hasattr(option, "model_fields"))
    return sorted(model.model_fields)
