"""How accurate the flow is: icoFoam's order over three meshes, the spline's on a known function.

python workflows/flow_order.py --out results/flow_order [--cells 25 50 100]
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow import FlowField, FlowSample, WallVelocity, obtain_flow
from ellipsoid_coupling.flow.openfoam.programs import require_openfoam

Array = NDArray[np.float64]


class Row(NamedTuple):
    """One line of a table: errors in the root mean square and at worst, and their orders."""

    what: str
    rms: float
    worst: float
    rms_order: float
    worst_order: float


def probes(number: int = 200) -> tuple[Array, Array]:
    """Points (number^2,) of the unit square, none of them on a mesh line or a wall."""
    at = (np.arange(number) + 0.5) / number
    x, y = np.meshgrid(at, at)
    return x.ravel(), y.ravel()


def difference(one: FlowSample, other: FlowSample) -> tuple[float, float]:
    """Root mean square and largest length of the difference of two velocities."""
    length = np.hypot(one.velocity_x - other.velocity_x, one.velocity_y - other.velocity_y)
    return float(np.sqrt(np.mean(length**2))), float(length.max())


def with_orders(names: Sequence[str], errors: Sequence[tuple[float, float]]) -> list[Row]:
    """Table rows for errors on meshes that halve their width from row to row."""
    rows = []
    for k, (name, error) in enumerate(zip(names, errors, strict=True)):
        before = errors[k - 1] if k else (math.nan, math.nan)
        rows.append(
            Row(name, *error, *(math.log2(b / e) for b, e in zip(before, error, strict=True)))
        )
    return rows


def solver_rows(cells: Sequence[int]) -> list[Row]:
    """The cavity by icoFoam on meshes that double: each against the next finer one."""
    require_openfoam()  # the shipped field would stand in for every mesh
    x, y = probes()
    samples = [obtain_flow("cavity", number, allow_misfit=True).evaluate(x, y) for number in cells]
    names = [f"{a} against {b} cells" for a, b in pairwise(cells)]
    return with_orders(names, [difference(one, other) for one, other in pairwise(samples)])


def manufactured(cells: int) -> tuple[FlowField, FlowSample]:
    """The spline of psi = sin^2(pi x) e^x y^2 (1 - y) e^y, walls given, and the exact velocity.

    psi vanishes on all walls; only the lid, y = 1, moves along itself.
    """
    nodes = np.linspace(0.0, 1.0, cells + 1)

    def exact(x: Array, y: Array) -> tuple[Array, Array, Array]:
        wave, ramp = np.sin(np.pi * x) ** 2, y**2 * (1.0 - y)
        growth = np.exp(x + y)
        slope_x = (np.pi * np.sin(2.0 * np.pi * x) + wave) * ramp * growth
        slope_y = wave * (2.0 * y - 3.0 * y**2 + ramp) * growth
        return wave * ramp * growth, slope_y, -slope_x

    psi = exact(*np.meshgrid(nodes, nodes))[0]
    psi[0], psi[-1], psi[:, 0], psi[:, -1] = 0.0, 0.0, 0.0, 0.0
    still = np.zeros(cells + 1)
    lid = exact(nodes, np.ones(cells + 1))[1]
    walls = WallVelocity(still, still, still, lid)
    field = FlowField.from_stream_function(psi, nodes, nodes, "manufactured", walls)
    x, y = probes()
    _, ux, uy = exact(x, y)
    return field, field.evaluate(x, y)._replace(velocity_x=ux, velocity_y=uy)


def interpolation_rows(cells: Sequence[int]) -> list[Row]:
    """The spline's velocity error on the manufactured stream function."""
    errors = []
    for number in cells:
        field, exact = manufactured(number)
        errors.append(difference(field.evaluate(*probes()), exact))
    return with_orders([f"{number} cells" for number in cells], errors)


def markdown(title: str, rows: Sequence[Row]) -> str:
    """One table."""
    lines = [
        f"## {title}",
        "",
        "| mesh | rms | worst | order, rms | order, worst |",
        "|---|---|---|---|---|",
    ]
    for row in rows:
        orders = ("" if math.isnan(o) else f"{o:.2f}" for o in (row.rms_order, row.worst_order))
        lines.append(
            "| " + " | ".join((row.what, f"{row.rms:.2e}", f"{row.worst:.2e}", *orders)) + " |"
        )
    return "\n".join([*lines, ""])


def main(arguments: Sequence[str] | None = None) -> Path:
    """Measure, print and write flow_order.md and flow_order.json; the folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--cells", type=int, nargs="+", default=[25, 50, 100])
    parser.add_argument("--spline-cells", type=int, nargs="+", default=[16, 32, 64, 128])
    options = parser.parse_args(arguments)
    tables = {
        "icoFoam, cavity: velocity difference between meshes": solver_rows(options.cells),
        "Spline: velocity error on a known stream function": interpolation_rows(
            options.spline_cells
        ),
    }
    text = "\n".join(markdown(title, rows) for title, rows in tables.items())
    options.out.mkdir(parents=True, exist_ok=True)
    out = Path(options.out)
    (out / "flow_order.md").write_text(text, encoding="utf-8")
    # JSON knows no NaN: the first row of a table has no order.
    plain = {
        title: [{k: v for k, v in row._asdict().items() if v == v} for row in rows]
        for title, rows in tables.items()
    }
    (out / "flow_order.json").write_text(json.dumps(plain, indent=2), encoding="utf-8")
    print(text)
    return out


if __name__ == "__main__":
    main()
