"""The solvers of OpenFOAM that are started for a case, and what each of them reads."""

from __future__ import annotations

from typing import NamedTuple


class Application(NamedTuple):
    """A solver of plane laminar flow.

    name : of the program, as system/controlDict has it
    block : its dictionary in system/fvSolution
    solved : the fields that need a linear solver there
    in_time : whether it goes from time step to time step, so that the flow may come to rest
    modelled : whether it asks constant/turbulenceProperties for a model; laminar flow has none
    relaxed : whether it takes relaxationFactors
    needs_block : whether it ends without that block even where p is fixed on a patch
    arguments : of the program; all are to write the face fluxes phi
    """

    name: str
    block: str
    solved: tuple[str, ...]
    in_time: bool = True
    modelled: bool = True
    relaxed: bool = False
    needs_block: bool = False
    arguments: tuple[str, ...] = ()


APPLICATIONS = {
    application.name: application
    for application in (
        Application(
            "icoFoam", "PISO", ("p", "pFinal", "U"), modelled=False, needs_block=True
        ),
        Application("pisoFoam", "PISO", ("p", "pFinal", "U")),
        Application("pimpleFoam", "PIMPLE", ("p", "pFinal", "U", "UFinal"), relaxed=True),
        Application("simpleFoam", "SIMPLE", ("p", "U"), in_time=False, relaxed=True),
        Application(
            "potentialFoam", "potentialFlow", ("Phi",), in_time=False, modelled=False,
            arguments=("-writephi",),
        ),
    )
}  # fmt: skip
