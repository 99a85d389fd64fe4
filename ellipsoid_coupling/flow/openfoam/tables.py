"""The dictionaries of a plane laminar case: their entries, and the values that each may have."""

from __future__ import annotations

from dataclasses import replace

from ellipsoid_coupling.files.limits import MOST_FLOW_STEPS
from ellipsoid_coupling.flow.openfoam.dictionary import Number, Section, Units, Word
from ellipsoid_coupling.flow.openfoam.rules import (
    HEADER,
    Rule,
    Rules,
    braces,
    choice,
    dropped,
    entries,
    figure,
    items_of,
    real,
    real_of,
    require_units,
    subsection,
    switch,
    whole,
    words,
    words_of,
)

SOLVERS = ("icoFoam",)
_LONGEST_TIME = 1e9
_FEWEST_DIGITS = 6
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
_NUMBERS: Rules = dict.fromkeys(("p", "U", "Phi", "k", "epsilon", "omega", "R", "nuTilda"), dropped)
# Entries that icoFoam ignores are known and left out, so that cases for several solvers pass.
_UNUSED: Rules = dict.fromkeys(
    (
        "nNonOrthogonalCorrectors", "nCorrectors", "nOuterCorrectors", "momentumPredictor",
        "consistent", "pRefCell", "pRefValue", "PhiRefCell", "PhiRefValue", "pRefPoint", "correctPhi",
        "turbOnFinalIterOnly",
    ),
    dropped,
) | {"residualControl": _NUMBERS}  # fmt: skip
_RELAXATION: Rules = {"fields": _NUMBERS, "equations": _NUMBERS, **_NUMBERS}
SOLUTION: Rules = {
    "FoamFile": HEADER,
    "solvers": dict.fromkeys(("p", "pFinal", "U", "UFinal", "Phi"), _LINEAR),
    "PISO": {
        "nCorrectors": whole(0, 1000),
        "nNonOrthogonalCorrectors": whole(0, 1000),
        "pRefCell": whole(0, 10**9),
        "pRefValue": real(-1e18, 1e18),
        "momentumPredictor": switch,
    },
    "SIMPLE": _UNUSED,
    "PIMPLE": _UNUSED,
    "potentialFlow": _UNUSED,
    "relaxationFactors": _RELAXATION,
}

# The package's own function object: it writes and ends the run as soon as a time step finds U changed
# by less than `value`. No other is taken.
_REST: Rules = {
    "type": choice("runTimeControl"),
    "libs": words("utilityFunctionObjects"),
    "satisfiedAction": choice("end"),
    "conditions": {
        "velocity": {
            "type": choice("equationInitialResidual"),
            "fields": words("U"),
            "value": real(0.0, 1.0),
            "mode": choice("minimum"),
        }
    },
}
CONTROL: Rules = {
    "FoamFile": HEADER,
    "application": choice(*SOLVERS),
    "startFrom": choice("startTime", "firstTime", "latestTime"),
    "startTime": real(0.0, 0.0),
    "stopAt": choice("endTime"),
    "endTime": real(1e-30, _LONGEST_TIME),
    "deltaT": real(1e-30, _LONGEST_TIME),
    # Nothing but the state at rest is written, whatever the case would write on the way.
    "writeControl": dropped,
    "writeInterval": dropped,
    "purgeWrite": dropped,
    "writeFormat": choice("ascii", "binary"),
    # Fewer digits would be another flow: steps show in it.
    "writePrecision": whole(_FEWEST_DIGITS, 17),
    "writeCompression": choice(
        "on", "off", "yes", "no", "true", "false", "compressed", "uncompressed"
    ),
    "timeFormat": choice("general", "fixed", "scientific"),
    "timePrecision": whole(1, 17),
    # OpenFOAM would read the files again while it runs.
    "runTimeModifiable": dropped,
    "adjustTimeStep": dropped,
    "maxCo": dropped,
    "maxDeltaT": dropped,
    "graphFormat": dropped,
    "functions": {"rest": _REST},
}


def control(section: Section, at_rest: float) -> tuple[list[str], float]:
    """system/controlDict as lines, with the function object that ends the run, and its end time."""
    for needed in ("application", "endTime", "deltaT"):
        items_of(section, needed)
    own = section.entries.get("functions")
    has_own = isinstance(own, Section) and bool(own.entries)
    rest = {key: value for key, value in section.entries.items() if value is not own or has_own}
    lines = entries(replace(section, entries=rest), CONTROL)
    end = real_of(section, "endTime", 1e-30, _LONGEST_TIME)
    step = real_of(section, "deltaT", 1e-30, _LONGEST_TIME)
    if end > step * MOST_FLOW_STEPS:
        raise section.error(
            items_of(section, "deltaT")[0].at, f"at most {MOST_FLOW_STEPS} steps to endTime {end:g}",
            f"deltaT {step:g}, which makes {end / step:.3g}",
        )  # fmt: skip
    lines += ["runTimeModifiable no;", "writeControl runTime;", f"writeInterval {figure(end)};"]
    lines += [] if has_own else braces("functions", braces("rest", _end_at(at_rest)))
    return lines, end


def _end_at(at_rest: float) -> list[str]:
    condition = [
        "type equationInitialResidual;", "fields (U);", f"value {figure(at_rest)};", "mode minimum;"
    ]  # fmt: skip
    return [
        "type runTimeControl;", "libs (utilityFunctionObjects);", "satisfiedAction end;",
        *braces("conditions", braces("velocity", condition)),
    ]  # fmt: skip


def solution(section: Section) -> list[str]:
    """system/fvSolution as lines; InputError if it lacks a solver for a field of icoFoam."""
    solvers = subsection(section, "solvers")
    for needed in ("p", "pFinal", "U"):
        subsection(solvers, needed)
    return entries(section, SOLUTION)


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
        "FoamFile": HEADER, "transportModel": choice("Newtonian"), "nu": nu, "rho": dropped,
        "viscosityModel": _dropped_if("constant"),
    }  # fmt: skip
    items_of(section, "nu")
    return entries(section, rules)
