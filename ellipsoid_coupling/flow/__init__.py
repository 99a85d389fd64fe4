"""The fluid: a `FlowField`, made by OpenFOAM, read from a case or given by a formula.

pyvista and meshio are imported when a case is read (`flow.reader`), not by this package.
"""

from ellipsoid_coupling.flow.analytic import (
    LINEAR_FLOWS,
    LinearFlow,
    analytic_flow,
    closed_form_flow,
    linear_flow,
    register_flow,
)
from ellipsoid_coupling.flow.field import FlowArrays, FlowField, FlowSample, sample_flow
from ellipsoid_coupling.flow.openfoam.programs import openfoam_available
from ellipsoid_coupling.flow.openfoam.solve import solve_case
from ellipsoid_coupling.flow.provide import (
    Wanted,
    find_flow,
    flow_at,
    found_flow,
    known_flow,
    names_flow,
    obtain_flow,
    wanted_path,
)
from ellipsoid_coupling.flow.series import FlowSeries, load_flow, require_covered
from ellipsoid_coupling.flow.spline import WallVelocity
from ellipsoid_coupling.flow.when import When
from ellipsoid_coupling.flow.window import Window, open_window

__all__ = [
    "LINEAR_FLOWS",
    "FlowArrays",
    "FlowField",
    "FlowSample",
    "FlowSeries",
    "LinearFlow",
    "WallVelocity",
    "Wanted",
    "When",
    "Window",
    "analytic_flow",
    "closed_form_flow",
    "find_flow",
    "flow_at",
    "found_flow",
    "known_flow",
    "linear_flow",
    "load_flow",
    "names_flow",
    "obtain_flow",
    "open_window",
    "openfoam_available",
    "register_flow",
    "require_covered",
    "sample_flow",
    "solve_case",
    "wanted_path",
]
