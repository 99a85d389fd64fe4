"""Scene files: TOML in, a validated `Scene` out; every mistake names the file and the key."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_NESTING, MOST_SCENE_BYTES
from ellipsoid_coupling.files.reading import exists, read_text
from ellipsoid_coupling.scenes.kinds import Kinds
from ellipsoid_coupling.scenes.scene import RunPart, Scene

Table = dict[str, Any]

_OPENING = re.compile("[\"'#]")
# What keys and values are divided by; within a key parts are divided by dots.
_DIVIDER = re.compile(r"[,=\[\]{}\n]")


def builtin_scenes() -> list[str]:
    """The names of the scenes that the package ships, sorted."""
    folder = resources.files("ellipsoid_coupling.scenes")
    return sorted(file.name[:-5] for file in folder.iterdir() if file.name.endswith(".toml"))


def load_scene(
    scene: str | Path | Mapping[str, Any], settings: Mapping[str, Any] | None = None
) -> Scene:
    """Read a built-in scene by its name, a TOML file, or a table as such a file holds it.

    Parameters
    ----------
    scene : str, Path or mapping
        A name of `builtin_scenes`, the path of a TOML file, or a scene's sections by name:
        ``{"name": "mine", "times": [1.0], "domain": {"x": [0.0, 1.0], ...}, ...}``. Numbers and arrays
        may be numpy's.
    settings : mapping, optional
        Values that replace the file's, by dotted key: ``{"particles.number": 100}``; the value None
        takes a whole part out: ``{"interaction": None}``.

    Raises
    ------
    InputError
        For a missing or unreadable file, an unknown key, a value of the wrong type or range.
    """
    if isinstance(scene, Mapping):
        table, where = _plain(scene), f"scene {scene.get('name', 'without a name')}"
    else:
        table, where = _read_table(scene)
    if _is_run(table):
        table, where = table["scene"], f"{where}, [scene]"
        if not isinstance(table, dict):
            raise InputError(where, "a section", repr(table), "Take the run.toml of a run.")
        _place(table, "start", "file", Path(str(scene)))
    elif not isinstance(scene, Mapping):
        for section, key in (("flow", "case"), ("start", "file")):
            _place(table, section, key, Path(scene))
    for key, value in (settings or {}).items():
        set_key(table, key, _plain(value))
    return scene_from_table(table, where)


def _plain(value: Any) -> Any:
    """A copy as a TOML file has it: numpy's numbers and arrays become Python's, paths become text."""
    if isinstance(value, Mapping):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    # numpy itself is not loaded for this.
    as_python = getattr(value, "tolist", None)
    return value if as_python is None else as_python()


def _place(table: Table, section: str, key: str, file: Path) -> None:
    """Make a path of a section, which is relative to the scene's file, an absolute one."""
    part = table.get(section)
    if isinstance(part, dict) and isinstance(path := part.get(key), str) and path:
        part[key] = os.path.abspath(file.parent / path)  # noqa: PTH100 (links stay)


def load_run_part(scene: str | Path) -> RunPart:
    """The [run] part of an earlier run's run.toml; an empty one for a scene."""
    table, where = _read_table(scene)
    return run_part_from_table(table["run"], where) if _is_run(table) else RunPart()


def _is_run(table: Table) -> bool:
    """Whether the table is the run.toml of an earlier run."""
    return set(table) == {"run", "versions", "scene"}


def run_part_from_table(table: Any, where: str) -> RunPart:
    """Validate the [run] part of a run.toml; `where` names the file in messages."""
    try:
        return RunPart.model_validate(table)
    except ValidationError as error:
        raise _input_error(error, f"{where}, [run]", RunPart, table) from None


def scene_from_table(table: Table, where: str) -> Scene:
    """Validate a table as it stands in a scene file; `where` names its source in messages."""
    try:
        return Scene.model_validate(table)
    except ValidationError as error:
        raise _input_error(error, where, Scene, table) from None


def parse_toml(text: str, where: str) -> Table:
    """TOML text as a table; InputError for any mistake, sections nested too deeply included."""
    try:
        # tomllib takes time and memory with the square of a key's parts.
        if any(part.count(".") > MOST_NESTING for part in _DIVIDER.split(_without_strings(text))):
            raise _too_deep(where)
        # Editors of other systems put a byte order mark in front, which is no part of the text.
        table = tomllib.loads(text.removeprefix("\ufeff"))
        _check_nesting(table, where)
    except RecursionError:
        raise _too_deep(where) from None
    except ValueError as error:  # tomllib's own, and that of an integer of thousands of digits
        remedy = "Mend the line named."
        raise InputError(where, "a TOML file", str(error), remedy) from None
    return table


def _without_strings(text: str) -> str:
    """TOML less its strings and comments, and less what is behind a string without an end."""
    pieces, at = [], 0
    while found := _OPENING.search(text, at):
        pieces.append(text[at : found.start()])
        at = _string_end(text, found.start())
    return "".join((*pieces, text[at:]))


def _string_end(text: str, start: int) -> int:
    """The place behind the string or comment that opens at `start`."""
    quote = text[start]
    if quote == "#":
        end = text.find("\n", start)
        return len(text) if end < 0 else end
    mark = 3 * quote if text.startswith(3 * quote, start) else quote
    at = start + len(mark)
    ending = re.compile(mark if quote == "'" else rf"{mark}|\\")
    while (found := ending.search(text, at)) and found[0] == "\\":
        at = found.end() + 1
    if found is None:
        return len(text)
    end = found.end()
    # A string of several lines may have two quotes of its own before its last three.
    while len(mark) == 3 and end < found.end() + 2 and text.startswith(quote, end):
        end += 1
    return end


def _check_nesting(table: Table, where: str) -> None:
    level: list[Any] = [table]
    for _ in range(MOST_NESTING):
        inner = (part.values() if isinstance(part, dict) else part for part in level)
        level = [value for part in inner for value in part if isinstance(value, dict | list)]
        if not level:
            return
    raise _too_deep(where)


def _too_deep(where: str) -> InputError:
    found = f"parts nested more than {MOST_NESTING} deep"
    return InputError(where, "a scene of sections with plain values", found, "Flatten the file.")


def parse_setting(text: str) -> tuple[str, Any]:
    """Split ``key=value``; the value is TOML (a bare word is a string, ``none`` takes a part out)."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise InputError("--set", "key=value", repr(text), "Example: --set particles.number=100.")
    if value.strip().lower() == "none":
        return key.strip(), None
    try:
        # One value, not more lines of a file.
        parsed = parse_toml(f"value = {value}", f"--set {key.strip()}")
        return key.strip(), parsed["value"] if set(parsed) == {"value"} else value.strip()
    except InputError as error:
        if "nested" in error.found:
            raise
        return key.strip(), value.strip()


def scene_to_toml(scene: Scene) -> str:
    """The scene as TOML that `load_scene` reads back to an equal scene."""
    return table_to_toml(scene.model_dump(mode="json", exclude_none=True))


def table_to_toml(table: Mapping[str, Any], prefix: str = "") -> str:
    """Plain values first, then one section per nested table (strings, numbers, booleans, lists)."""
    plain = [
        f"{toml_key(k)} = {toml_value(v)}" for k, v in table.items() if not isinstance(v, dict)
    ]
    sections = [
        f"\n[{prefix}{toml_key(key)}]\n{table_to_toml(value, f'{prefix}{toml_key(key)}.')}"
        for key, value in table.items()
        if isinstance(value, dict)
    ]
    return "\n".join(plain) + ("\n" if plain else "") + "".join(sections)


def toml_key(key: str) -> str:
    """One part of a key: as it is, or in quotes where TOML wants them, as for a patch "in(1)"."""
    return key if re.fullmatch(r"[\w-]+", key, re.ASCII) else toml_value(key)


def toml_value(value: object) -> str:
    """A JSON string, number, boolean or list of them is a TOML value as well, with two exceptions.

    TOML wants an escape for 0x7f, and has none for halves of letters, which bytes of a name that are
    no UTF-8 become: these are written out.
    """
    text = json.dumps(value, allow_nan=False, ensure_ascii=False).replace("\x7f", "\\u007f")
    return re.sub("[\ud800-\udfff]", lambda half: f"\\\\u{ord(half[0]):04x}", text)


def _read_table(scene: str | Path) -> tuple[Table, str]:
    name = str(scene)
    if name in builtin_scenes():
        text = resources.files("ellipsoid_coupling.scenes").joinpath(f"{name}.toml").read_text()
        return tomllib.loads(text), f"scene {name}"
    path = Path(scene)
    if not exists(path):
        known = ", ".join(builtin_scenes())
        remedy = "Give one of these names or the path of a scene file."
        raise InputError(
            f"scene {name}", f"a built-in scene ({known}) or a file", "neither", remedy
        )
    text = read_text(path, "a scene file (TOML)", MOST_SCENE_BYTES)
    return parse_toml(text, str(path)), str(path)


def set_key(table: Table, key: str, value: object) -> None:
    """Set a dotted key such as "numerics.cell" of a scene's table, in place; None takes the key out.

    Raises
    ------
    InputError
        For a key with too many sections, or one that has a value where it names a section.
    """
    *sections, last = key.split(".")
    if len(sections) > MOST_NESTING:
        raise _too_deep(f"--set {key}")
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


def _input_error(
    error: ValidationError, where: str, model: type[BaseModel], table: Table
) -> InputError:
    """The first mistake of `error` in `table` in words; a user mends one at a time."""
    first = error.errors(include_url=False)[0]
    key = ".".join(str(part) for part in first["loc"])
    place, found = f"{where}, key {key}" if key else where, _quoted(first["input"])
    if first["type"] == "extra_forbidden":
        known = ", ".join(_known_keys(model, [str(part) for part in first["loc"][:-1]], table))
        return InputError(place, f"one of {known}", "an unknown key", "Remove or rename it.")
    if first["type"] == "missing":
        return InputError(place, "a value", "none", "Add the key.")
    if isinstance(first["input"], dict):
        found = "values that do not fit together"
    if first["type"] in ("too_long", "too_short"):
        bounds = first["ctx"]
        number = bounds.get("max_length") or bounds.get("min_length")
        way = "at most" if "max_length" in bounds else "at least"
        return InputError(place, f"{way} {number} in brackets", found, "Change the value.")
    if first["type"] == "tuple_type":
        return InputError(place, "values in brackets, [a, b]", found, "Change the value.")
    expected = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    return InputError(place, expected, found, "Change the value.")


def _quoted(value: object) -> str:
    """A value for a message; Python refuses to print integers of thousands of digits."""
    try:
        return repr(value)
    except ValueError:
        return "a number of thousands of digits"


def _known_keys(model: Any, sections: list[str], table: Table) -> list[str]:
    for section in sections:
        field, table = model.model_fields[section], table[section]
        options = get_args(field.annotation) or (field.annotation,)
        kinds = (m for o in options for m in get_args(o) if isinstance(m, Kinds))
        if (found := next(kinds, None)) is not None:
            return found.keys(table)
        model = next(option for option in options if hasattr(option, "model_fields"))
    return sorted(model.model_fields)
