"""What a saved flow (.npz) must hold to be one; see `FlowField.save`."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError, readable
from ellipsoid_coupling.files.limits import (
    LARGEST_NUMBER,
    MOST_FLOW_ARRAYS,
    MOST_FLOW_BYTES,
    MOST_PATCHES,
)
from ellipsoid_coupling.files.reading import Arrays, read_arrays
from ellipsoid_coupling.flow.case_plane import FLAT, CasePlane
from ellipsoid_coupling.flow.misfit import Misfit
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.flow.slopes import Chi

EXPECTED = "a flow saved by FlowField.save"
_REMEDY = "Name a saved flow (.npz) or a solved OpenFOAM case folder."
_KINDS = {"coefficients": "<f8", "mask": "|u1", "numbers": "<f8"}
_OUTLINE_KINDS = {"outline_ends": "<f8", "outline_patch": "<i8", "outline_outflow": "<f8"}
_OUTLINE_TEXTS = ("outline_names", "outline_types")
# Limits are the nodes' rectangle up to its rim.
_SAME_PLACE = 1e-6


class SavedFlow(NamedTuple):
    """coefficients (ny+3, nx+3); mask (ny, nx); x0, y0, cells per length, limits (8,); and texts.

    chi : where the coefficients of chi begin, whose rows stand below those of psi, if there are any
    """

    coefficients: NDArray[np.float64]
    mask: NDArray[np.uint8]
    numbers: list[float]
    origin: str
    outline: Outline | None
    chi: Chi | None
    misfit: Misfit | None
    plane: CasePlane


def read_saved(path: Path) -> SavedFlow:
    """A saved flow, checked; InputError where the file is missing, broken or something else."""
    return checked_flow(path, read_arrays(path, EXPECTED, MOST_FLOW_BYTES, MOST_FLOW_ARRAYS))


def checked_flow(path: Path, file: Arrays) -> SavedFlow:
    """The arrays of a saved flow, checked; InputError, with `path` for their file, where they are none."""
    kinds = {name: array.dtype.str for name, array in file.items()}
    if kinds | _KINDS != kinds or not kinds.get("origin", "").startswith("<U"):
        found = ", ".join(f"{name} ({kind})" for name, kind in kinds.items()) or "nothing"
        raise InputError(str(path), f"{EXPECTED}: {', '.join(_KINDS)}, origin", found, _REMEDY)
    coefficients, mask, numbers = (file[name] for name in _KINDS)
    ny, nx = mask.shape if mask.ndim == 2 else (0, 0)
    shapes = (ny + 3, nx + 3), (2 * (ny + 3), nx + 3)
    if min(ny, nx) < 1 or coefficients.shape not in shapes or numbers.shape != (8,):
        found = f"shapes {coefficients.shape}, {mask.shape} and {numbers.shape}"
        expected = "coefficients (ny+3, nx+3), or two of these, a mask (ny, nx) and 8 numbers"
        raise InputError(str(path), expected, found, _REMEDY)
    bad = np.argwhere(~(np.abs(coefficients) <= LARGEST_NUMBER))
    if bad.size or mask.max() > 1:
        where = f"coefficients[{bad[0][0]}, {bad[0][1]}]" if bad.size else "mask"
        raise InputError(f"{path}, {where}", "finite coefficients and a mask of 0 and 1",
                         "NaN, infinite or huge values" if bad.size else "others", _REMEDY)  # fmt: skip
    if not _fits(numbers, ny, nx):
        expected = "a rectangle that its limits bound"
        raise InputError(f"{path}, numbers", expected, str(numbers.tolist()), _REMEDY)
    try:
        origin = readable(str(file["origin"]))
    except ValueError as error:
        raise InputError(f"{path}, origin", "one line of text", str(error), _REMEDY) from None
    chi = Chi(ny + 3) if coefficients.shape == shapes[1] else None
    told = origin, _outline(path, file), chi, _misfit(path, file), _plane(path, file)
    return SavedFlow(coefficients, mask, numbers.tolist(), *told)


def _misfit(path: Path, file: Arrays) -> Misfit | None:
    """The misfit in a file's arrays, checked; None where the file has none."""
    if "misfit" not in file:
        return None
    found = file["misfit"]
    fits = found.dtype.str == "<f8" and found.shape == (len(Misfit._fields),)
    if not fits or not np.all((found >= 0.0) & (found <= LARGEST_NUMBER)):
        expected = f"{len(Misfit._fields)} finite numbers from 0 on"
        raise InputError(f"{path}, misfit", expected, "others", _REMEDY)
    return Misfit(*found.tolist())


def _plane(path: Path, file: Arrays) -> CasePlane:
    """The case's plane in a file's arrays, checked; z = 0 where the file has none."""
    if "plane" not in file:
        return FLAT
    found = file["plane"]
    fits = found.dtype.str == "<f8" and found.shape == (len(CasePlane._fields),)
    if not fits or found[0] not in range(3) or not abs(found[1]) <= LARGEST_NUMBER:
        expected = "an axis, 0, 1 or 2, and a finite place on it"
        raise InputError(f"{path}, plane", expected, "others", _REMEDY)
    return CasePlane(int(found[0]), float(found[1]))


def outline_arrays(outline: Outline) -> Arrays:
    """An outline as the arrays of an .npz."""
    texts = (np.array(text, dtype=np.str_) for text in outline[3:])
    numbers = dict(zip(_OUTLINE_KINDS, outline[:3], strict=True))
    return {**numbers, **dict(zip(_OUTLINE_TEXTS, texts, strict=True))}


def _outline(path: Path, file: Arrays) -> Outline | None:
    """The outline in a file's arrays, checked; None where the file has none."""
    given = [name for name in (*_OUTLINE_KINDS, *_OUTLINE_TEXTS) if name in file]
    if not given:
        return None
    expected = "an outline: ends (E, 2, 2), patch (E,), outflow (E,), names and types of patches"
    kinds = {name: file[name].dtype.str for name in given}
    texts = [kinds.pop(name, "") for name in _OUTLINE_TEXTS]
    if kinds != _OUTLINE_KINDS or not all(text.startswith("<U") for text in texts):
        raise InputError(f"{path}, outline", expected, "others", _REMEDY)
    ends, patch, outflow, names, types = (file[name] for name in given)
    edges = len(patch) if patch.ndim == 1 else -1
    shapes = ends.shape == (edges, 2, 2), outflow.shape == (edges,), names.ndim == 1
    if not all(shapes) or names.shape != types.shape or not 0 < names.size <= MOST_PATCHES:
        raise InputError(f"{path}, outline", expected, "arrays of other shapes", _REMEDY)
    numbers = np.concatenate((ends.ravel(), outflow))
    if (
        not np.all(np.abs(numbers) <= LARGEST_NUMBER)
        or patch.min() < 0
        or patch.max() >= names.size
    ):
        raise InputError(f"{path}, outline", "finite numbers", "NaN, huge or no patch's", _REMEDY)
    if not np.all(np.any(ends[:, 0] != ends[:, 1], axis=1)):
        raise InputError(f"{path}, outline", "edges with a length", "one without", _REMEDY)
    words = [tuple(str(word) for word in text) for text in (names, types)]
    for word in (*words[0], *words[1]):
        if readable(word) != word:
            raise InputError(f"{path}, outline", "names of patches", readable(word), _REMEDY)
    return Outline(ends, patch, outflow, words[0], words[1])


def _fits(numbers: NDArray[np.float64], ny: int, nx: int) -> bool:
    """Whether x_low ... y_high are the rectangle of x0, y0 and the cells, or everywhere."""
    x0, y0, per_x, per_y = numbers[:4].tolist()
    least, most = 1.0 / LARGEST_NUMBER, LARGEST_NUMBER
    if not (abs(x0) < most and abs(y0) < most and least < per_x < most and least < per_y < most):
        return False
    width, height = nx / per_x, ny / per_y
    bounds = np.array([x0, x0 + width, y0, y0 + height])
    everywhere = np.array([-np.inf, np.inf, -np.inf, np.inf])
    if np.array_equal(numbers[4:], everywhere):
        return True
    off = np.abs(numbers[4:] - bounds) / np.array([width, width, height, height])
    return bool(np.all(off < _SAME_PLACE))
