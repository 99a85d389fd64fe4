"""A case of OpenFOAM's icoUncoupledKinematicParcelFoam on a solved flow: parcels instead of our particles.

Its spheres feel Stokes' drag, 18 mu/(rho d^2) (1 + Re^(2/3)/6), of which the size d is chosen so small that
the term in Re is below 1e-5, and the density rho so that the rate is the one that is asked for.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow.openfoam.programs import run_program

Floats = NDArray[np.float64]

SOLVER = "icoUncoupledKinematicParcelFoam"
DIAMETER = 1e-9

_HEAD = "FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n"
_CONTROL = """
application {solver}; startFrom startTime; startTime 0; stopAt endTime; endTime {end}; deltaT {step};
writeControl runTime; writeInterval {interval}; writeFormat ascii; writePrecision 12; writeCompression off;
timeFormat general; timePrecision 8;
"""
_SCHEMES = """
ddtSchemes {{ default none; }} gradSchemes {{ default none; }} divSchemes {{ default none; }}
laplacianSchemes {{ default none; }} interpolationSchemes {{ default linear; }}
"""
_CLOUD = """
solution
{{
    active true; coupled false; transient yes; cellValueSourceCorrection off; maxCo 0.1;
    sourceTerms {{ schemes {{}} }}
    interpolationSchemes {{ rho cell; U {interpolation}; mu cell; }}
    integrationSchemes {{ U analytical; }}
}}
constantProperties {{ rho0 {density}; }}
subModels
{{
    particleForces {{ sphereDrag; }}
    injectionModels
    {{
        starts
        {{
            type manualInjection; massTotal 0; parcelBasisType fixed; nParticle 1; SOI 0;
            positionsFile "starts"; U0 (0 0 0);
            sizeDistribution {{ type fixedValue; fixedValueDistribution {{ value {diameter}; }} }}
        }}
    }}
    dispersionModel none;
    patchInteractionModel localInteraction;
    localInteractionCoeffs
    {{
        patches
        (
            "{walls}" {{ type rebound; e 1; mu 0; }}
            "{ends}" {{ type escape; }}
        );
    }}
    heatTransferModel none; surfaceFilmModel none; collisionModel none; stochasticCollisionModel none;
}}
cloudFunctions {{}}
"""


def write_parcel_case(
    case: Path, solved: Path, starts: Floats, drag: float, viscosity: float, times: dict[str, float]
) -> None:
    """Write a case beside a solved one: parcels at `starts` (n, 2), at rest, in its flow at its last time.

    times : end, step and interval of writing
    """
    last = times_of(solved)[-1]
    shutil.copytree(solved / "constant" / "polyMesh", case / "constant" / "polyMesh")
    (case / "0").mkdir()
    for name in ("U", "phi", "p"):
        shutil.copy(last / name, case / "0" / name)
    density = 18.0 * viscosity / (drag * DIAMETER**2)
    cloud = _CLOUD.format(
        density=density, diameter=DIAMETER, interpolation="cellPoint",
        walls="cylinder|top|bottom", ends="inlet|outlet",
    )  # fmt: skip
    transport = f"transportModel Newtonian; nu {viscosity}; rhoInf 1;"
    depth = 0.05
    points = "\n".join(f"({x!r} {y!r} {depth})" for x, y in starts.tolist())
    for place, kind, text in (
        ("system/controlDict", "dictionary", _CONTROL.format(solver=SOLVER, **times)),
        ("system/fvSchemes", "dictionary", _SCHEMES.format()),
        ("system/fvSolution", "dictionary", "solvers {}"),
        ("constant/kinematicCloudProperties", "dictionary", cloud),
        ("constant/transportProperties", "dictionary", transport),
        ("constant/turbulenceProperties", "dictionary", "simulationType laminar;"),
        (
            "constant/g", "uniformDimensionedVectorField",
            "dimensions [0 1 -2 0 0 0 0]; value (0 0 0);",
        ),
        ("constant/starts", "vectorField", f"(\n{points}\n)"),
    ):  # fmt: skip
        file = case / place
        file.parent.mkdir(exist_ok=True)
        file.write_text(_HEAD.format(kind=kind, name=file.name) + text + "\n")


def times_of(case: Path) -> list[Path]:
    """The folders of a case's times, in their order."""
    folders = [path for path in case.iterdir() if re.fullmatch(r"\d+(\.\d+)?", path.name)]
    return sorted(folders, key=lambda path: float(path.name))


def run_parcels(case: Path, count: int) -> tuple[Floats, Floats]:
    """The written times (T,) and the parcels' places (T, n, 2), ordered as their starts; NaN once out."""
    run_program(case, [SOLVER])
    folders = times_of(case)[1:]
    places = np.full((len(folders), count, 2), np.nan)
    for t, folder in enumerate(folders):
        cloud = folder / "lagrangian" / "kinematicCloud"
        numbers = re.findall(
            r"^\((\S+) (\S+) \S+\) \d+$", (cloud / "positions").read_text(), re.MULTILINE
        )
        body = (cloud / "origId").read_text().partition("(")[2].partition(")")[0]
        which = np.array(body.split(), np.int64)
        places[t, which] = np.array(numbers, np.float64).reshape(-1, 2)
    return np.array([float(folder.name) for folder in folders]), places
