"""Sections of a scene that come in kinds: `kind = "harmonic"` and that kind's own numbers.

A kind is a NamedTuple, whose fields are the keys of the section. Its formulas are registered with it by
`ellipsoid_coupling.physics`, which this package, being data, does not import before a scene asks.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any, Literal, NamedTuple, get_type_hints

from pydantic import ConfigDict, GetCoreSchemaHandler, create_model
from pydantic_core import CoreSchema, core_schema

from ellipsoid_coupling.scenes.values import Number, Part

# The numbers of a kind; a NamedTuple.
Record = tuple[float, ...]


class _AnyKeys(Part):
    model_config = ConfigDict(extra="ignore")


class Kind(NamedTuple):
    """A record, the keys of its section with their bounds, and how it reads, its keys in braces."""

    record: type[NamedTuple]
    keys: type[Part]
    text: str


@cache
def _choice(section: str, default: str, known: tuple[str, ...]) -> type[Part]:
    """What reads the kind of a section; made once, which takes a millisecond."""
    kind: Any = (Literal[known], default)
    made: type[Part] = create_model(section, __base__=_AnyKeys, kind=kind)
    return made


class Kinds:
    """The kinds of one section; stands in a type annotation as ``Annotated[Record, kinds]``.

    Parameters
    ----------
    section : str
        Its name in scene files.
    default : str
        The kind of a section that names none.
    home : str
        The module that registers the package's own kinds.
    """

    def __init__(self, section: str, default: str, home: str) -> None:
        self.section = section
        self._default, self._home = default, home
        self._kinds: dict[str, Kind] = {}

    def register(self, name: str, record: type[NamedTuple], text: str) -> None:
        """Make `name` a kind of this section.

        Parameters
        ----------
        record : a NamedTuple of numbers
            A field annotated `float` takes any number in range; the types of `scenes.values`
            (`Positive`, `NotNegative`, ...) bound it. A default makes its key optional.
        text : str
            Its formula for ``ellipsoid plan``, such as "V1 = {stiffness:g} r^2/2".

        Raises
        ------
        ValueError
            For a name that is taken, or a field that is called `kind`.
        """
        hints = get_type_hints(record, include_extras=True)
        if name in self._kinds or "kind" in hints:
            raise ValueError(f"[{self.section}] has a kind {name}, or a key `kind`, already")
        defaults: dict[str, float] = record._field_defaults
        fields: dict[str, Any] = {
            key: (Number if hint is float else hint, defaults.get(key, ...))
            for key, hint in hints.items()
        }
        keys: type[Part] = create_model(record.__name__, __base__=Part, **fields)
        self._kinds[name] = Kind(record, keys, text)

    def known(self) -> dict[str, Kind]:
        """All kinds by name, the package's own first."""
        import_module(self._home)
        return self._kinds

    def keys(self, table: dict[str, object]) -> list[str]:
        """The keys that the section `table` may have."""
        name = table.get("kind", self._default)
        kind = self.known().get(name) if isinstance(name, str) else None
        return ["kind", *(sorted(kind.keys.model_fields) if kind else ())]

    def describe(self, record: Record) -> str:
        """The kind's formula with its numbers."""
        kind = self.known()[self._name(record)]
        return kind.text.format(**self._write(record))

    def _name(self, record: Record) -> str:
        return next(n for n, kind in self.known().items() if type(record) is kind.record)

    def _read(self, table: dict[str, object]) -> Record:
        """The record of a section; pydantic's ValidationError, with its key, for what is none."""
        known = self.known()
        choice = _choice(self.section, self._default, tuple(known))
        kind = known[choice.model_validate(table).model_dump()["kind"]]
        numbers = kind.keys.model_validate({k: v for k, v in table.items() if k != "kind"})
        return kind.record._make(numbers.model_dump().values())

    def _write(self, record: Record) -> dict[str, object]:
        """The section of a record, as `_read` takes it."""
        name = self._name(record)
        return {"kind": name} | dict(zip(self.known()[name].keys.model_fields, record, strict=True))

    def __get_pydantic_core_schema__(
        self, _source: object, _handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """How pydantic reads and writes a field that is annotated with these kinds."""
        return core_schema.no_info_plain_validator_function(
            self._read, serialization=core_schema.plain_serializer_function_ser_schema(self._write)
        )


OUTER_POTENTIALS = Kinds("outer_potential", "harmonic", "ellipsoid_coupling.physics.outer")
ANGULAR_POTENTIALS = Kinds("angular_potential", "sine", "ellipsoid_coupling.physics.angular")
