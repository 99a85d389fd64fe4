"""Tables for people on standard output."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ellipsoid_coupling.errors import shown

_LOG_WIDTH = 150


class PipedConsole(Console):
    """A console whose command handles a closed reader."""

    def on_broken_pipe(self) -> None:
        """Raise again, because rich itself would end the program with status 1."""
        raise BrokenPipeError


def table_text(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table as plain text, columns as wide as their longest cell, for a file."""
    widths = [max(map(len, column)) for column in zip(columns, *rows, strict=True)]
    lines = [columns, ["-" * width for width in widths], *rows]
    padded = [[c.ljust(w) for c, w in zip(line, widths, strict=True)] for line in lines]
    return "\n".join("  ".join(cells).rstrip() for cells in padded) + "\n"


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table for people on standard output; in a log as wide as it needs."""
    table = Table(title=escape(shown(title)), title_justify="left")
    for column in columns:
        table.add_column(column, overflow="fold")
    for row in rows:
        table.add_row(*(escape(shown(cell)) for cell in row))
    console = PipedConsole(file=sys.stdout, width=None if sys.stdout.isatty() else _LOG_WIDTH)
    console.print(table)
