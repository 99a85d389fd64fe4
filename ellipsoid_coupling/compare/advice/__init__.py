"""Which model, scheme and resolution to choose for an error: short runs, and what follows from them."""

from ellipsoid_coupling.compare.advice.adviser import advise, check_asked
from ellipsoid_coupling.compare.advice.answer import Advice, AdviceRow
from ellipsoid_coupling.compare.advice.command import Asked
from ellipsoid_coupling.compare.advice.expected import Interval

__all__ = ["Advice", "AdviceRow", "Asked", "Interval", "advise", "check_asked"]
