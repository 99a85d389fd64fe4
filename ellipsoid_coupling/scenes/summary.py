"""What print and notebooks show of a scene, a flow or a result: one line, or a small table."""

from __future__ import annotations

from html import escape
from typing import NamedTuple

from ellipsoid_coupling.errors import readable

# Letters of the line; a wide terminal has room for them.
_LONGEST = 140


class Summary(NamedTuple):
    """What it is, and what is worth knowing of it: (name, text) each, the most important first."""

    head: str
    rows: list[tuple[str, str]]


class Summarised:
    """Shown by `_summary`: in one line by ``repr`` and ``print``, as a table in a notebook."""

    def _summary(self) -> Summary:
        raise NotImplementedError

    def __repr__(self) -> str:
        head, rows = self._summary()
        line = readable(f"{head}: " + ", ".join(f"{name} {text}".strip() for name, text in rows))
        return f"<{line}>" if len(line) <= _LONGEST else f"<{line[:_LONGEST]} ...>"

    def __str__(self) -> str:
        return repr(self)

    def _repr_html_(self) -> str:
        head, rows = self._summary()
        lines = "".join(
            f"<tr><th>{_html(name)}</th><td>{_html(text)}</td></tr>" for name, text in rows
        )
        return f"<table><caption>{_html(head)}</caption>{lines}</table>"


def _html(text: str) -> str:
    return escape(readable(text))
