"""The models of the hierarchy, one file each, and the registry that others find them in.

A file of this folder that names its class `MODEL` is found by itself; a model from outside of the package
is added by `register_model`. Both then run through `simulate` and the command line alike.
"""

from ellipsoid_coupling.models.base import Arrays, Counts, Health, Model, Setup
from ellipsoid_coupling.models.earlier import Earlier
from ellipsoid_coupling.models.failure_site import FailureSite
from ellipsoid_coupling.models.kind import LineStyle, ModelKind, Variable
from ellipsoid_coupling.models.plan import model_terms, plan_flow, plan_patches, plan_terms
from ellipsoid_coupling.models.plan_numbers import plan_numbers
from ellipsoid_coupling.models.registry import (
    build_model,
    find_kind,
    kind_named,
    model_kinds,
    model_names,
    register_model,
    require_fit,
)
from ellipsoid_coupling.models.resolution import resolution_text
from ellipsoid_coupling.models.schemes import (
    ADAPTIVE_SCHEME,
    BASELINE_SCHEME,
    SCHEMES,
    Scheme,
    SchemeName,
    scheme_named,
)

__all__ = [
    "ADAPTIVE_SCHEME",
    "BASELINE_SCHEME",
    "SCHEMES",
    "Arrays",
    "Counts",
    "Earlier",
    "FailureSite",
    "Health",
    "LineStyle",
    "Model",
    "ModelKind",
    "Scheme",
    "SchemeName",
    "Setup",
    "Variable",
    "build_model",
    "find_kind",
    "kind_named",
    "model_kinds",
    "model_names",
    "model_terms",
    "plan_flow",
    "plan_numbers",
    "plan_patches",
    "plan_terms",
    "register_model",
    "require_fit",
    "resolution_text",
    "scheme_named",
]
