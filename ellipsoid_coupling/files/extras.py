"""Libraries that come with an extra of the package, and what to say where one is missing."""

from __future__ import annotations

from importlib.util import find_spec

from ellipsoid_coupling.errors import InputError

_EXTRAS = {"matplotlib": "plot", "pyvista": "paraview", "meshio": "paraview"}


def missing(library: str) -> InputError:
    """The message for a library that is not installed, with the command that installs it."""
    return InputError(
        f"the library {library}", f"it, from the extra {_EXTRAS[library]}", "it is not installed",
        f"Install it: pip install 'ellipsoid_coupling[{_EXTRAS[library]}]'.",
    )  # fmt: skip


def require(*libraries: str) -> None:
    """InputError for the first of these libraries that is not installed; none of them is loaded."""
    for library in libraries:
        if find_spec(library) is None:
            raise missing(library)
