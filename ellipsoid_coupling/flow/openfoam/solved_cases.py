"""Cases and their solutions on disk: the folder of a case, its hash, and its place in the cache."""

from __future__ import annotations

import hashlib
import os
import re
import stat
import tempfile
from pathlib import Path

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.cache import cache_home
from ellipsoid_coupling.files.limits import MOST_CASE_FILE_BYTES, MOST_CASE_FILES, MOST_SCENE_BYTES
from ellipsoid_coupling.files.reading import is_folder, is_ordinary, read_bytes
from ellipsoid_coupling.flow.cases import BUILT_IN
from ellipsoid_coupling.flow.openfoam.files import packed
from ellipsoid_coupling.flow.openfoam.programs import openfoam_version
from ellipsoid_coupling.flow.openfoam.trust import LEFT_OUT, input_folders

_LONGEST_NAME = 60
# Entries of system/parameters that are no part of a case's content.
_COUNTS = re.compile(rb"(?m)^(cells|processes)[ \t]+[0-9.]+[ \t]*;")
# The file that marks a solved case: written last, holds the hash of the case's inputs.
MARK = "case.foam"


def case_folder(case: str | Path) -> Path:
    """The folder of a built-in case, or of the case at a path; InputError if it is neither."""
    known = sorted(folder.parent.name for folder in BUILT_IN.glob("*/system"))
    folder = BUILT_IN / case if str(case) in known else Path(case)
    for name in input_folders(folder):
        if not is_folder(folder / name):
            missing = "0.orig or 0" if name == "0" else name
            raise InputError(
                str(case), f"a built-in case ({', '.join(known)}) or a folder with 0.orig (or 0), "
                "constant and system", f"no {missing} in {folder}", "Correct the name or the path.",
            )  # fmt: skip
    return folder


def inputs_hash(folder: Path, cells: int, content: str = "") -> str:
    """A hash of everything that the solution depends on; the number of processes is not in it.

    content : of the case's files, where it is known
    """
    content = content or content_hash(folder)
    return hashlib.sha256(f"{cells} {openfoam_version()} {content}".encode()).hexdigest()[:16]


def content_hash(folder: Path) -> str:
    """A hash of a case's files, but for the numbers of cells and processes."""
    digest = hashlib.sha256()
    left, makes_mesh = MOST_CASE_FILE_BYTES, packed(folder / "system" / "blockMeshDict") is not None
    for part in input_folders(folder):
        for path in _files_below(folder / part):
            name = path.relative_to(folder)
            if path.is_file() and not (makes_mesh and LEFT_OUT in name.parts):
                content = read_bytes(path, "a file of a case", left)
                left -= len(content)
                if path.name == "parameters":
                    content = _COUNTS.sub(b"", content)
                # With the length, so that no file's content can pass for two files.
                digest.update(os.fsencode(name) + b"\0%d\0" % len(content) + content)
    return digest.hexdigest()


def _files_below(folder: Path) -> list[Path]:
    """All files in a folder and below, links to other folders followed; InputError for too many."""
    paths: list[Path] = []
    for parent, folders, files in os.walk(folder, followlinks=True):
        paths += [Path(parent, name) for name in (*folders, *files)]
        if len(paths) > MOST_CASE_FILES:
            raise InputError(
                str(folder), f"at most {MOST_CASE_FILES} files", "more",
                "Name the case alone, without other data in its folders.",
            )  # fmt: skip
    return sorted(paths)


def solved_folder(case: str | Path, cells: int, content: str = "") -> Path:
    """Where the cache keeps, or would keep, the solution; RunError without OpenFOAM.

    Solutions in a cache that cannot be written are used; others go to this user's temporary files.

    content : a hash of the case's files, where it is known
    """
    source = case_folder(case)
    name = f"{_plain_name(source.name)}-{cells}-{inputs_hash(source, cells, content)}"
    cached = cache_home() / "flows" / name
    return cached if is_solved(cached) or _is_writable(cached.parent) else _private_folder() / name


def kept_folders(name: str, cells: int) -> list[Path]:
    """All solutions that the cache keeps of cases of that name; no program is started."""
    caches = [cache_home() / "flows"]
    caches += [_private_folder()] if _private_path().exists() else []
    return [
        folder for cache in caches
        for folder in sorted(cache.glob(f"{_plain_name(name)}-{cells}-*")) if is_solved(folder)
    ]  # fmt: skip


def _plain_name(name: str) -> str:
    """A case's name as part of a folder's, where OpenFOAM shall find it."""
    return re.sub(r"[^\w.+-]", "_", name, flags=re.ASCII)[:_LONGEST_NAME]


def _is_writable(folder: Path) -> bool:
    """Whether a folder can be written to, or made."""
    there = folder.absolute()
    while not there.exists() and there != there.parent:
        there = there.parent
    try:
        with tempfile.TemporaryFile(dir=there):
            return True
    except OSError:
        return False


def _private_path() -> Path:
    return Path(tempfile.gettempdir()) / f"ellipsoid_coupling-{os.geteuid()}"


def _private_folder() -> Path:
    """A folder among the temporary files that is this user's alone."""
    folder = _private_path()
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.geteuid() or status.st_mode & 0o022:
        raise InputError(
            str(folder), "a folder that is this user's alone", "another",
            "Set ELLIPSOID_CACHE to a folder that can be written.",
        )  # fmt: skip
    return folder


def is_solved(folder: Path, key: str | None = None) -> bool:
    """Whether `solve_case` made this folder, to its end (and from the inputs with this hash)."""
    mark = folder / MARK
    if not is_ordinary(mark):
        return False
    made_from = read_bytes(mark, "the mark of a solved case", MOST_SCENE_BYTES).strip()
    return key is None or made_from == key.encode()
