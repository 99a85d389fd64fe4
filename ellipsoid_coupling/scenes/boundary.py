"""One boundary of a scene file, [boundaries.NAME]: its kind, and the kind's parameters."""

from __future__ import annotations

from typing import Self

from pydantic import ConfigDict, Field, field_validator, model_validator

from ellipsoid_coupling.scenes.sides import AtSide, keys_of, known_kinds
from ellipsoid_coupling.scenes.values import Line, Number, Part


class BoundaryPart(Part):
    """One boundary: its kind, and the kind's parameters, numbers by name."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Number] = Field(init=False)

    kind: Line

    @field_validator("kind")
    @classmethod
    def _known(cls, kind: str) -> str:
        if kind not in known_kinds():
            raise ValueError(f"one of {', '.join(known_kinds())}")
        return kind

    @model_validator(mode="after")
    def _check(self) -> Self:
        _, _, required, optional = keys_of(self.kind)
        given, known = set(self.parameters), {*required, *optional}
        if not set(required) <= given <= known:
            keys = ", ".join([*required, *(f"{key} (optional)" for key in optional)]) or "none"
            found = ", ".join(sorted(given)) or "none"
            raise ValueError(f"beside kind the keys of {self.kind} ({keys}), not {found}")
        return self

    @property
    def parameters(self) -> dict[str, float]:
        """The kind's parameters."""
        return dict(self.__pydantic_extra__ or {})

    @property
    def particles(self) -> AtSide:
        """What a particle does there."""
        return keys_of(self.kind).particles
