"""What a sweep is: a scene, lists of values, models and seeds; and its file, sweep.toml."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, Strict, ValidationError

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_COUNT, MOST_SCENE_BYTES, MOST_SEED
from ellipsoid_coupling.files.reading import is_ordinary, read_text
from ellipsoid_coupling.files.versions import version
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.models import ADAPTIVE_SCHEME
from ellipsoid_coupling.scenes import Scene, load_scene, parse_toml
from ellipsoid_coupling.scenes.files import table_to_toml
from ellipsoid_coupling.scenes.values import Line, Part, PathText
from ellipsoid_coupling.sweeps.points import Point, coordinate, parsed, run_name

# A run folder each: file systems and people give up before.
MOST_POINTS = 1_000_000
_PARTS = {"sweep", "versions", "scene"}
# Along one axis of results.nc.
_COMMON = {
    "times": "one list, as all points are saved at the same times",
    "name": "one name for all points",
}

Seed = Annotated[int, Field(ge=0, le=MOST_SEED)]
Number = Annotated[int, Field(ge=0, le=MOST_COUNT)]
Text = Annotated[str, Field(max_length=MOST_SCENE_BYTES)]
Texts = Annotated[tuple[Text, ...], Strict(False), Field(min_length=1)]


class Lists(Part):
    """The [sweep] part of sweep.toml.

    `values` has a list for each of `keys`, each value as the command line takes it. `zipped` takes the
    lists in pairs, else their product is run. `realisations` is (first, end, how many a point) where
    those of one large run are split among points. `flow` is a path that replaces the scene's own flow.
    """

    models: Annotated[tuple[Line, ...], Strict(False), Field(min_length=1)]
    scheme: Line = ADAPTIVE_SCHEME
    keys: Annotated[tuple[Line, ...], Strict(False)] = ()
    values: Annotated[tuple[Texts, ...], Strict(False)] = ()
    zipped: bool = False
    seeds: Annotated[tuple[Seed, ...], Strict(False), Field(min_length=1)] | None = None
    realisations: Annotated[tuple[Number, Number, Number], Strict(False)] | None = None
    flow: PathText | None = None
    allow_misfit: bool = False


class Sweep:
    """A sweep: lists of values and the scene that they change.

    Parameters
    ----------
    lists : Lists
    scene : dict
        The scene's table as its file holds it.

    Raises
    ------
    InputError
        For lists that do not fit together.
    """

    def __init__(self, lists: Lists, scene: dict[str, Any]) -> None:
        self.lists, self.scene = lists, scene
        _check(lists)
        if self.count > MOST_POINTS:
            found = f"{self.count:.3g}"
            raise InputError("sweep", f"at most {MOST_POINTS:g} points", found, "Shorten a list.")

    @cached_property
    def dimensions(self) -> dict[str, int]:
        """The dimensions of results.nc before those of its variables, with their sizes."""
        lists = self.lists
        sizes = {"model": len(lists.models)}
        if lists.zipped:
            sizes["point"] = len(lists.values[0])
        else:
            sizes |= {key: len(texts) for key, texts in zip(lists.keys, lists.values, strict=True)}
        return sizes | ({"seed": len(lists.seeds)} if lists.seeds else {})

    @cached_property
    def coordinates(self) -> dict[str, tuple[str, list[Any]]]:
        """The dimension and the values of each coordinate that is a parameter."""
        lists = self.lists
        named: dict[str, tuple[str, list[Any]]] = {"model": ("model", list(lists.models))}
        for key, texts in zip(lists.keys, lists.values, strict=True):
            named[key] = "point" if lists.zipped else key, list(coordinate(key, texts))
        return named | ({"seed": ("seed", list(lists.seeds))} if lists.seeds else {})

    @cached_property
    def pieces(self) -> list[range | None]:
        """The realisations of the points that share a place."""
        if self.lists.realisations is None:
            return [None]
        first, end, size = self.lists.realisations
        return [range(k, min(k + size, end)) for k in range(first, end, size)]

    @property
    def count(self) -> int:
        """How many points there are."""
        size = 1
        if self.lists.realisations is not None:
            first, end, step = self.lists.realisations
            size = math.ceil((end - first) / step)
        return math.prod(self.dimensions.values()) * size

    @property
    def name(self) -> str:
        """Of the scene."""
        return str(self.scene.get("name", "sweep"))

    def points(self) -> Iterator[Point]:
        """All points, in the order of results.nc, the first dimension slowest."""
        places = itertools.product(*map(range, self.dimensions.values()))
        for index, (place, piece) in enumerate(itertools.product(places, self.pieces)):
            yield self._point(index, place, piece)

    def _point(self, index: int, place: tuple[int, ...], piece: range | None) -> Point:
        lists = self.lists
        at = dict(zip(self.dimensions, place, strict=True))
        chosen = [
            (key, texts[at["point" if lists.zipped else key]])
            for key, texts in zip(lists.keys, lists.values, strict=True)
        ]
        labels, seed = list(chosen), 0
        if lists.seeds:
            seed = lists.seeds[at["seed"]]
            labels.append(("seed", str(seed)))
        if piece is not None:
            labels.append(("realisations", f"{piece.start}-{piece.stop - 1}"))
        model = lists.models[at["model"]]
        name = run_name(index, self.count, model, labels)
        settings = {key: parsed(key, text) for key, text in chosen}
        return Point(index, name, place, model, settings, seed, piece)

    def scene_of(self, point: Point) -> Scene:
        """The scene of one point; InputError where a value does not fit."""
        return load_scene(self.scene, point.settings)

    def text(self) -> str:
        """The contents of sweep.toml."""
        lists = self.lists.model_dump(mode="json", exclude_none=True)
        versions = {"ellipsoid_coupling": version("ellipsoid_coupling")}
        return table_to_toml({"sweep": lists, "versions": versions, "scene": self.scene})

    def save(self, path: Path) -> None:
        """Write sweep.toml, whole or not at all."""
        with whole_file(path) as file:
            file.write_text(self.text(), encoding="utf-8")

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read a sweep.toml.

        Raises
        ------
        InputError
            For any other file, unknown keys, or values of the wrong type or range.
        """
        where = str(path)
        table = parse_toml(read_text(path, "the sweep.toml of a sweep", MOST_SCENE_BYTES), where)
        if set(table) != _PARTS or not all(isinstance(part, dict) for part in table.values()):
            found = ", ".join(sorted(table)) or "nothing"
            expected = f"the sections {', '.join(sorted(_PARTS))}"
            raise InputError(where, expected, found, "Take the sweep.toml of a sweep.")
        return cls(checked_lists(table["sweep"], f"{where}, [sweep]"), table["scene"])


def is_sweep_file(name: str) -> bool:
    """Whether a file is called, and divided, like a sweep.toml."""
    path = Path(name)
    if path.suffix != ".toml" or not is_ordinary(path):
        return False
    text = read_text(path, "a scene file (TOML)", MOST_SCENE_BYTES)
    return set(parse_toml(text, name)) == _PARTS


def checked_lists(table: Mapping[str, Any], where: str) -> Lists:
    """The [sweep] part of a table; InputError names the key at fault."""
    try:
        return Lists.model_validate(table)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(map(str, first["loc"]))
        raise InputError(
            f"{where} {key}", first["msg"], repr(first["input"]), "Change the value."
        ) from None


def _check(lists: Lists) -> None:
    """InputError for lists that do not fit together."""
    sizes = [len(texts) for texts in lists.values]
    if len(sizes) != len(lists.keys):
        expected = f"a list of values for each of {len(lists.keys)} keys"
        raise InputError("sweep", expected, f"{len(sizes)} lists", "Change it.")
    for key in lists.keys:
        if key in _COMMON or lists.keys.count(key) > 1 or key in ("model", "seed", "point"):
            expected = _COMMON.get(key, "a key of the scene, once")
            raise InputError(f"--set {key}", expected, "several", "Take it out of the sweep.")
    if lists.zipped and len(set(sizes)) != 1:
        raise InputError(
            "--zip", "lists of one length", f"lengths {sizes}", "Give each --set as many values."
        )
    for what, entries in (("--model", lists.models), ("--seeds", lists.seeds or ())):
        if len(set(entries)) < len(entries):
            raise InputError(what, "each one once", ", ".join(map(str, entries)), "Change it.")
    if lists.realisations is not None:
        first, end, step = lists.realisations
        if not (first < end and step >= 1):
            found = f"{first}:{end}:{step}"
            raise InputError("--realisations", "A:B or A:B:SIZE, 0 <= A < B", found, "Change it.")
