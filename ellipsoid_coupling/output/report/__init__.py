"""Finished runs and comparisons as one HTML page that needs nothing else: ``ellipsoid report``."""

from ellipsoid_coupling.output.report.page import write_report
from ellipsoid_coupling.output.report.sources import Comparison, Run, is_comparison, load_sources

__all__ = ["Comparison", "Run", "is_comparison", "load_sources", "write_report"]
