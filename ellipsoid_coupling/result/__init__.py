"""The result of a run: densities, angles and orientation on common bins, and its file."""

from ellipsoid_coupling.result.layouts import (
    DIMENSIONS,
    END_TIME,
    FATE,
    FROZEN,
    FURTHER,
    MARKS,
    SAMPLES_ACROSS,
    VARIABLES,
    Layout,
    further_text,
    further_variables,
)
from ellipsoid_coupling.result.result import Result

__all__ = [
    "DIMENSIONS",
    "END_TIME",
    "FATE",
    "FROZEN",
    "FURTHER",
    "MARKS",
    "SAMPLES_ACROSS",
    "VARIABLES",
    "Layout",
    "Result",
    "further_text",
    "further_variables",
]
