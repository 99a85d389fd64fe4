"""Where the package's own OpenFOAM cases lie: in a checkout at its top, in a wheel inside the package."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).parents[1]


def built_in_folder(package: Path = _PACKAGE) -> Path:
    """The folder foam_cases that belongs to the package installed at `package`.

    A wheel carries it as package data (see pyproject.toml), so that folder comes first: what else lies
    beside an installed package is not ours.
    """
    shipped = package / "foam_cases"
    return shipped if shipped.is_dir() else package.parent / "foam_cases"


BUILT_IN = built_in_folder()
