"""Fields of solved cases, kept in the cache under a hash of all that they were made from.

A case is read once: the next time its files are only hashed. A field belongs to the content of those
files, the names that `FlowField.origin` tells, and the sources of this package that read it; so a case
that was solved again, a copy under another name or another version of this package has another one.
"""

from __future__ import annotations

import functools
import hashlib
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ellipsoid_coupling.errors import InputError, WriteError
from ellipsoid_coupling.files.cache import cache_home
from ellipsoid_coupling.files.limits import MOST_CASE_FILE_BYTES
from ellipsoid_coupling.files.reading import is_ordinary, read_bytes
from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.misfit import require_near
from ellipsoid_coupling.flow.when import Divergence

if TYPE_CHECKING:
    from ellipsoid_coupling.flow.openfoam.reader import Sources

# Fields that are kept, the latest ones: a megabyte each.
_MOST_KEPT = 200


def kept_field(
    path: Path, *, allow_misfit: bool = False, divergence: Divergence = Divergence.NONE
) -> FlowField:
    """The field of a solved case or of what foamToVTK wrote, from the cache where it is there.

    Parameters and errors as `reader.read_flow`. A file in the cache that is no saved flow, or one of
    another origin, is read anew and replaced; a cache that cannot be written serves all the same.
    """
    # The reader and the solvers that it needs take time to import, which analytic flows do not need.
    from ellipsoid_coupling.flow.openfoam.reader import read_flow, sources

    try:
        with sources(path) as made_from:
            key = _key(made_from, divergence)
    except InputError:  # the reader knows better what each file should have been
        return read_flow(path, allow_misfit=allow_misfit, divergence=divergence)
    saved = cache_home() / "fields" / f"{key}.npz"
    field = _loaded(saved, made_from)
    if field is None:
        # Whether it is too far off is asked of each who takes it.
        field = read_flow(path, allow_misfit=True, divergence=divergence)
        if _is_of(field, made_from):
            with suppress(WriteError):
                field.save(saved)
                _forget_old(saved.parent)
    if field.misfit is not None and not allow_misfit:
        require_near(made_from.where, field.misfit)
    return field


def _loaded(saved: Path, made_from: Sources) -> FlowField | None:
    """The field in the cache; None where there is none of this case."""
    if is_ordinary(saved):
        with suppress(InputError):
            field = FlowField.load(saved)
            if _is_of(field, made_from) and field.misfit is not None:
                return field
    return None


def _is_of(field: FlowField, made_from: Sources) -> bool:
    """Whether a field tells the case and the time that these files are of."""
    return field.origin.startswith(f"{made_from.origin},")


def _key(made_from: Sources, divergence: Divergence) -> str:
    digest = hashlib.sha256(f"{_own_sources()} {divergence.name} {made_from.origin}".encode())
    for file in made_from.files:
        content = read_bytes(file, "a file of a case", MOST_CASE_FILE_BYTES)
        # With the length, so that no file's content can pass for two files.
        digest.update(f"{file.name} {len(content)} ".encode() + content)
    return digest.hexdigest()[:32]


@functools.cache
def _own_sources() -> str:
    """A hash of what turns a case into a field."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()


def _forget_old(folder: Path) -> None:
    """Remove all but the latest fields."""
    with suppress(OSError):
        kept = sorted(folder.glob("*.npz"), key=lambda path: path.stat().st_mtime)
        for old in kept[:-_MOST_KEPT]:
            old.unlink(missing_ok=True)
