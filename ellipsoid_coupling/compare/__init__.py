"""How far results are apart, what they cost, and where the schemes stay stable."""

from ellipsoid_coupling.compare.errors import Errors, errors_against, sampling_errors
from ellipsoid_coupling.compare.frontier import FrontierRow, frontier_cases, run_frontier
from ellipsoid_coupling.compare.reference import exact_reference, has_exact_reference

__all__ = [
    "Errors",
    "FrontierRow",
    "errors_against",
    "exact_reference",
    "frontier_cases",
    "has_exact_reference",
    "run_frontier",
    "sampling_errors",
]
