"""The command line as tests call it, and settings with which a run takes a second."""

from __future__ import annotations

from ellipsoid_coupling.cli import main
from ellipsoid_coupling.flow.provide import SHIPPED

# The cavity that the package ships: nothing is solved.
FLOW = ["--flow", str(SHIPPED / "cavity.npz")]
SMALL = ["--set", "particles.number=30", "numerics.cell=0.1", "times=[0.1, 0.2]"]
SMALL += ["particles.realisations=2", "particles.length=0.1", "particles.width=0.05"]


def status_of(*tokens: str) -> int:
    """The exit status of `ellipsoid` with these words."""
    try:
        main(list(tokens))
    except SystemExit as ended:
        return int(ended.code or 0)
    return 0
