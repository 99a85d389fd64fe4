"""What a compiled stepper reports instead of raising; `simulate` turns it into words."""

from __future__ import annotations

RUNNING, NOT_FINITE, STEP_TOO_SMALL = range(3)

MEANING = {
    NOT_FINITE: (
        "the solution is no longer finite",
        "Use a smaller time step, tolerance or CFL number; `accurate` bears more than `paper`.",
    ),
    STEP_TOO_SMALL: (
        "the step size fell below 1e-12 of the run's length",
        "Relax the tolerance, or weaken what makes the scene stiff.",
    ),
}
