"""The dictionaries of a plane laminar case: their entries, and the values that each may have."""

from __future__ import annotations

from dataclasses import replace

from ellipsoid_coupling.flow.openfoam.applications import Application
from ellipsoid_coupling.flow.openfoam.dictionary import Number, Section, Units, Word
from ellipsoid_coupling.flow.openfoam.rules import (
    HEADER,
    Rule,
    Rules,
    choice,
    dropped,
    entries,
    figure,
    items_of,
    real,
    require_units,
    subsection,
    switch,
    whole,
    without_patterns,
    words_of,
)

_LARGEST_NU = 1e18
_SCHEMES = words_of(
    frozenset((
        "Euler", "backward", "CrankNicolson", "steadyState", "localEuler", "bounded", "Gauss",
        "linear", "upwind", "linearUpwind", "linearUpwindV", "limitedLinear", "limitedLinearV",
        "vanLeer", "vanLeerV", "vanAlbada", "Minmod", "MUSCL", "QUICK", "QUICKV", "SuperBee",
        "SFCD", "Gamma", "GammaV", "cubic", "midPoint", "reverseLinear", "harmonic", "fourth",
        "leastSquares", "pointCellsLeastSquares", "pointLinear", "cellLimited", "cellMDLimited",
        "faceLimited", "faceMDLimited", "corrected", "uncorrected", "orthogonal", "limited",
        "none", "default", "grad(U)", "grad(p)", "yes", "no", "meshWave",
    )),
    "a scheme",
)  # fmt: skip
# Names of terms; those of other solvers are often left in a case, and never looked up.
_TERMS: Rules = dict.fromkeys(
    (
        "default", "ddt(U)", "grad(p)", "grad(U)", "grad(Phi)", "div(phi,U)", "div(U)", "div(R)",
        "div((nuEff*dev2(T(grad(U)))))", "div((nuEff*dev(T(grad(U)))))", "div(phi,k)",
        "div(phi,epsilon)", "div(phi,omega)", "div(phi,R)", "div(phi,nuTilda)", "div(nonlinearStress)",
        "laplacian(nu,U)", "laplacian(nuEff,U)", "laplacian((1|A(U)),p)", "laplacian(1|A(U),p)",
        "laplacian(rAU,p)", "laplacian(1,p)", "laplacian(1,Phi)", "interpolate(U)",
        "interpolate(HbyA)", "snGrad(p)", "snGrad(U)", "p", "U", "Phi", "pcorr", "method",
        "laplacian(DkEff,k)", "laplacian(DepsilonEff,epsilon)", "laplacian(DREff,R)",
        "laplacian(DnuTildaEff,nuTilda)",
    ),
    _SCHEMES,
)  # fmt: skip
SCHEMES: Rules = {
    "FoamFile": HEADER,
    **dict.fromkeys(
        (
            "ddtSchemes", "gradSchemes", "divSchemes", "laplacianSchemes", "interpolationSchemes",
            "snGradSchemes", "wallDist",
        ),
        _TERMS,
    ),
    # Names alone, such as p; the solvers do not need it.
    "fluxRequired": dict.fromkeys(("default", "p", "U", "Phi", "pcorr"), dropped),
}  # fmt: skip

_SMOOTHERS = choice(
    "GaussSeidel", "symGaussSeidel", "DIC", "DICGaussSeidel", "FDIC", "DILU", "DILUGaussSeidel",
    "nonBlockingGaussSeidel",
)  # fmt: skip
_LINEAR: Rules = {
    "solver": choice(
        "PCG", "PBiCG", "PBiCGStab", "PPCG", "PPCR", "GAMG", "smoothSolver", "diagonal"
    ),
    "preconditioner": choice("DIC", "FDIC", "DILU", "diagonal", "GAMG", "none"),
    "smoother": _SMOOTHERS,
    "tolerance": real(0.0, 1.0),
    "relTol": real(0.0, 1.0),
    "minIter": whole(0, 10**6),
    "maxIter": whole(0, 10**6),
    "nSweeps": whole(1, 1000),
    "nPreSweeps": whole(0, 1000),
    "nPostSweeps": whole(0, 1000),
    "nFinestSweeps": whole(0, 1000),
    "nVcycles": whole(1, 1000),
    "nCellsInCoarsestLevel": whole(1, 10**6),
    "mergeLevels": whole(1, 100),
    "cacheAgglomeration": switch,
    "directSolveCoarsest": switch,
    "scaleCorrection": switch,
    "interpolateCorrection": switch,
    "agglomerator": choice("faceAreaPair", "algebraicPair"),
}
_FIELDS = ("p", "pFinal", "U", "UFinal", "Phi", "k", "epsilon", "omega", "R", "nuTilda")
_NUMBERS: Rules = dict.fromkeys(_FIELDS, dropped)
_FACTORS: Rules = dict.fromkeys(_FIELDS, real(1e-6, 1.0))
_CORRECTORS: Rules = {
    "nCorrectors": whole(0, 1000),
    "nNonOrthogonalCorrectors": whole(0, 1000),
    "momentumPredictor": switch,
    "pRefCell": whole(0, 10**9),
    "pRefValue": real(-1e18, 1e18),
}
# What the solvers read of their own dictionary; entries of the others are known, and left out.
BLOCKS: dict[str, Rules] = {
    "PISO": _CORRECTORS,
    "SIMPLE": {
        **_CORRECTORS,
        "consistent": switch,
        "residualControl": dict.fromkeys(_FIELDS, real(0.0, 1.0)),
    },
    "PIMPLE": {
        **_CORRECTORS,
        "nOuterCorrectors": whole(1, 1000),
        "consistent": switch,
        "turbOnFinalIterOnly": dropped,
    },
    "potentialFlow": {
        "nNonOrthogonalCorrectors": whole(0, 1000),
        "PhiRefCell": whole(0, 10**9),
        "PhiRefValue": real(-1e18, 1e18),
        "pRefCell": dropped,
        "pRefValue": dropped,
    },
}
_UNUSED: Rules = {
    **dict.fromkeys({key for rules in BLOCKS.values() for key in rules}, dropped),
    **dict.fromkeys(("correctPhi", "pRefPoint"), dropped),
    "residualControl": _NUMBERS,
}


def solution(section: Section, application: Application) -> list[str]:
    """system/fvSolution as lines; InputError if it lacks a solver for a field of the application."""
    section = without_patterns(section, _FIELDS)
    solvers = subsection(section, "solvers")
    for needed in application.solved:
        subsection(solvers, needed)
    blocks = dict.fromkeys(BLOCKS, _UNUSED) | {application.block: BLOCKS[application.block]}
    factors = _FACTORS if application.relaxed else _NUMBERS
    rules: Rules = {
        "FoamFile": HEADER,
        "solvers": dict.fromkeys(_FIELDS, _LINEAR),
        **blocks,
        "relaxationFactors": {"fields": factors, "equations": factors, **factors},
    }
    return entries(section, rules)


def require_block(section: Section, application: Application, *, fixed: bool) -> None:
    """InputError if system/fvSolution lacks the application's own block, and it would end for that.

    fixed : whether a condition fixes p; else the block has to name pRefCell
    """
    if application.needs_block or not fixed:
        subsection(section, application.block)


def _dropped_if(word: str) -> Rule:
    """One word alone, which goes without saying."""

    def rule(section: Section, key: str) -> None:
        choice(word)(section, key)

    return rule


def transport(section: Section) -> list[str]:
    """constant/transportProperties as lines: nu, with or without its name and dimensions."""

    def nu(part: Section, key: str) -> str:
        value = items_of(part, key)
        *front, last = value
        for item in front:
            if isinstance(item, Units):
                require_units(part, item, (0, 2, -1))
            elif not (isinstance(item, Word) and item.text == key):
                raise part.error(item.at, f"{key} [0 2 -1 0 0 0 0] VALUE", "another value")
        if not isinstance(last, Number) or not 1e-30 <= last.value <= _LARGEST_NU:
            raise part.error(last.at, f"a number {key} above 0", "another value")
        return figure(last.value)

    rules: Rules = {
        "FoamFile": HEADER, "transportModel": _dropped_if("Newtonian"), "nu": nu, "rho": dropped,
        "viscosityModel": _dropped_if("constant"),
    }  # fmt: skip
    items_of(section, "nu")
    # icoFoam does not ask for the model, other solvers do.
    return ["transportModel Newtonian;", *entries(section, rules)]


_STOKES = choice("Stokes")
_TURBULENCE: Rules = {
    "FoamFile": HEADER,
    "simulationType": choice("laminar"),
    # Any other model, such as Maxwell's, would be another fluid.
    "laminar": {
        "model": _STOKES,
        "laminarModel": _STOKES,
        "StokesCoeffs": {},
        **dict.fromkeys(("turbulence", "printCoeffs"), switch),
    },
    **dict.fromkeys(("turbulence", "printCoeffs"), switch),
    **dict.fromkeys(("RASModel", "LESModel"), dropped),
}
# OpenFOAM looks into these for another simulationType only.
_OTHER_TYPES = frozenset(("RAS", "LES"))


def turbulence(section: Section) -> list[str]:
    """constant/turbulenceProperties as lines; InputError unless the flow is laminar and Newtonian."""
    items_of(section, "simulationType")
    read = {key: value for key, value in section.entries.items() if key not in _OTHER_TYPES}
    entries(replace(section, entries=read), _TURBULENCE)
    return ["simulationType laminar;"]
