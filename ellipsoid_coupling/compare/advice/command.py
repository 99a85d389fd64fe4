"""The command line that runs what was advised."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.scenes import Scene, builtin_scenes, load_scene
from ellipsoid_coupling.scenes.files import toml_value


class Asked(NamedTuple):
    """How the user names the scene: its name or file, his --set (key=value each), further words.

    is_run : whether it is a run.toml, whose number of realisations --set does not change
    """

    scene: str
    settings: tuple[str, ...] = ()
    further: tuple[str, ...] = ()
    is_run: bool = False


def asked_for(scene: Scene) -> Asked:
    """The words for a scene without a name: a built-in one and what differs from it, or its file."""
    if scene.name in builtin_scenes():
        with suppress(InputError):
            changed = differences(load_scene(scene.name), scene)
            return Asked(scene.name, tuple(settings_of(changed)))
    return Asked(f"{scene.name}.toml")


def command_line(
    asked: Asked, model: str, scheme: str, values: Mapping[str, object], realisations: int
) -> str:
    """``ellipsoid run`` of a model and scheme with further values of the scene's keys.

    Values replace those that the user has set himself.
    """
    kept = [text for text in asked.settings if text.partition("=")[0].strip() not in values]
    settings = [*kept, *settings_of(values)]
    words = ["ellipsoid", "run", asked.scene, "--model", model, "--scheme", scheme]
    words += ["--realisations", str(realisations)] if asked.is_run else []
    return shlex.join([*words, *asked.further, *(["--set", *settings] if settings else [])])


def differences(old: Scene, new: Scene) -> dict[str, object]:
    """The keys in which two scenes differ, and the new one's values; None for what it does not have."""
    tables = [one.model_dump(mode="json", exclude_none=True) for one in (old, new)]
    before, after = (dict(_flat(table)) for table in tables)
    # A section that is gone is taken out as a whole.
    gone = [name for name in tables[0] if name not in tables[1]]
    kept = [key for key in before if key.partition(".")[0] not in gone]
    changed = {key: value for key, value in after.items() if before.get(key) != value}
    return dict.fromkeys([*gone, *(key for key in kept if key not in after)]) | changed


def _flat(table: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, object]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def settings_of(values: Mapping[str, object]) -> Iterator[str]:
    """Texts for --set."""
    for key, value in values.items():
        yield f"{key}={'none' if value is None else toml_value(value)}"
