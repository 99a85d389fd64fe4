"""Formulas chosen by type: in Python, in kernels, and from files that change."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from ellipsoid_coupling.compiled.dispatch import chosen_by_type, register_formula
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, plain


@chosen_by_type
def value_of(curve: Any, x: float) -> float:
    """The value of a curve."""
    raise NotImplementedError


class Line(NamedTuple):
    slope: float


class Constant(NamedTuple):
    height: float


class Unknown(NamedTuple):
    height: float


@inline_kernel
def _on_line(line: Line, x: float) -> float:
    return line.slope * x


register_formula(value_of, Line, _on_line)
register_formula(value_of, Constant, lambda curve, x: curve.height)  # noqa: ARG005


@kernel
def _sum(curves: tuple[Any, ...], x: float) -> float:
    return value_of(curves[0], x) + value_of(curves[1], x)


def test_each_type_has_its_formula() -> None:
    curves = Line(2.0), Constant(5.0)
    assert _sum(curves, 3.0) == 11.0 == plain(_sum)(curves, 3.0)


def test_an_unknown_type_is_told_with_the_known_ones() -> None:
    with pytest.raises(
        TypeError, match="value_of is not known for Unknown, but for Line, Constant"
    ):
        value_of(Unknown(1.0), 2.0)


def test_a_type_has_one_formula() -> None:
    with pytest.raises(ValueError, match="already"):
        register_formula(value_of, Line, _on_line)


MODULE = """
from typing import NamedTuple
from ellipsoid_coupling.compiled.dispatch import chosen_by_type, register_formula
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel

@chosen_by_type
def value_of(curve, x):
    "."

class Line(NamedTuple):
    slope: float

@inline_kernel
def on_line(line, x):
    return FACTOR * line.slope * x

register_formula(value_of, Line, on_line)
"""
USE = """
from ellipsoid_coupling.compiled.jit import kernel
from curves import Line, value_of

@kernel
def at(curve, x):
    return value_of(curve, x)

print(at(Line(2.0), 3.0))
"""


def test_a_formula_that_has_changed_is_compiled_anew(tmp_path: Path) -> None:
    """Though the file of the kernel that calls it has not, and numba looks at that one only."""
    (tmp_path / "use.py").write_text(USE)
    for factor, expected in (("1.0", "6.0"), ("10.0", "60.0")):
        (tmp_path / "curves.py").write_text(MODULE.replace("FACTOR", factor))
        done = subprocess.run(
            [sys.executable, "use.py"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=3600,
            check=True,
        )
        assert done.stdout.strip() == expected
