"""What every outer potential V1(r) has: its value and minus its gradient, and how one is added.

    class Ring(NamedTuple):
        radius: Positive

    outer.register("ring", Ring, energy=..., force=..., text="V1 = (r - {radius:g})^2/2")

makes ``[outer_potential] kind = "ring"``, ``radius = 2.0`` a potential of all models.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ellipsoid_coupling.compiled.dispatch import chosen_by_type, register_formula
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.scenes.kinds import OUTER_POTENTIALS, Record

Force = tuple[float, float]


@chosen_by_type
def outer_energy(potential: Record | None, x: float, y: float) -> float:
    """V1 at a place, per mass; 0 without a potential."""
    raise NotImplementedError


@chosen_by_type
def outer_force(potential: Record | None, x: float, y: float) -> Force:
    """-grad V1 at a place, an acceleration; 0 without a potential."""
    raise NotImplementedError


@inline_kernel
def _no_energy(potential: None, x: float, y: float) -> float:  # noqa: ARG001
    return 0.0


@inline_kernel
def _no_force(potential: None, x: float, y: float) -> Force:  # noqa: ARG001
    return 0.0, 0.0


register_formula(outer_energy, type(None), _no_energy)
register_formula(outer_force, type(None), _no_force)


def register(
    kind: str,
    record: type[NamedTuple],
    *,
    energy: Callable[..., float],
    force: Callable[..., Force],
    text: str,
) -> None:
    """Add a kind of outer potential, for scene files and for all models.

    Parameters
    ----------
    kind : str
        Its name in `[outer_potential]`.
    record : a NamedTuple of numbers
        The other keys of the section; see `scenes.kinds.Kinds.register` for their bounds.
    energy, force : formulas that numba can compile, or inline kernels
        (potential, x, y) -> V1 and -> (-dV1/dx, -dV1/dy), per mass.
    text : str
        The formula for ``ellipsoid plan``, keys in braces: "V1 = {stiffness:g} r^2/2".

    Raises
    ------
    ValueError
        For a kind or record that is registered already.
    TypeError
        For a formula with another number of arguments.
    """
    # The kind last: where a formula is refused, scenes do not know it.
    register_formula(outer_energy, record, energy)
    register_formula(outer_force, record, force)
    OUTER_POTENTIALS.register(kind, record, text)
