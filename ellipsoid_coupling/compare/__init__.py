"""Distances between results, their cost, and the stability of the schemes."""

from ellipsoid_coupling.compare.cheapest import Choice, choose, pareto_front
from ellipsoid_coupling.compare.distances import Errors, errors_against, sampling_errors
from ellipsoid_coupling.compare.error_budget import Parts
from ellipsoid_coupling.compare.exact_solution import exact_reference, has_exact_reference
from ellipsoid_coupling.compare.frontier import (
    Frontier,
    FrontierRow,
    run_frontier,
)
from ellipsoid_coupling.compare.quick_comparison import compare_runs, short_frontier, short_runs
from ellipsoid_coupling.compare.table import write_table

__all__ = [
    "Choice",
    "Errors",
    "Frontier",
    "FrontierRow",
    "Parts",
    "choose",
    "compare_runs",
    "errors_against",
    "exact_reference",
    "has_exact_reference",
    "pareto_front",
    "run_frontier",
    "sampling_errors",
    "short_frontier",
    "short_runs",
    "write_table",
]
