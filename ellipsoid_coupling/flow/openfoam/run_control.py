"""system/controlDict: which solver runs, until when, and what it writes.

A flow that shall come to rest is ended and written as soon as it does, and nothing before. Any other run
goes to its endTime, and writes as its controlDict says.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from ellipsoid_coupling.files.limits import MOST_FLOW_STEPS, MOST_WRITTEN_TIMES
from ellipsoid_coupling.flow.openfoam.applications import APPLICATIONS, Application
from ellipsoid_coupling.flow.openfoam.dictionary import Section, Word
from ellipsoid_coupling.flow.openfoam.rules import (
    HEADER,
    Rules,
    braces,
    choice,
    dropped,
    entries,
    figure,
    items_of,
    one,
    real,
    real_of,
    switch,
    whole,
    whole_of,
    words,
)

_LONGEST_TIME = 1e9
_FEWEST_DIGITS = 6


class Run(NamedTuple):
    """How a case is run.

    at_rest : the initial residual of U that ends the run; 0 for a run to `end_time`
    """

    application: Application
    end_time: float
    at_rest: float


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
_COMMON: Rules = {
    "FoamFile": HEADER,
    "application": choice(*APPLICATIONS),
    "startFrom": choice("startTime", "firstTime", "latestTime"),
    "startTime": real(0.0, 0.0),
    "stopAt": choice("endTime"),
    "endTime": real(1e-30, _LONGEST_TIME),
    "deltaT": real(1e-30, _LONGEST_TIME),
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
    "graphFormat": dropped,
}
_IN_TIME = ("writeControl", "writeInterval", "purgeWrite", "adjustTimeStep", "maxCo", "maxDeltaT")
# Nothing but the state at rest is written, whatever the case would write on the way.
_TO_REST: Rules = {**_COMMON, **dict.fromkeys(_IN_TIME, dropped), "functions": {"rest": _REST}}
_BY_STEPS, _BY_TIME = "timeStep", ("runTime", "adjustable", "adjustableRunTime")
_AS_WRITTEN: Rules = {
    **_COMMON,
    "writeControl": choice(_BY_STEPS, *_BY_TIME),
    "writeInterval": real(1e-30, _LONGEST_TIME),
    "purgeWrite": whole(0, MOST_WRITTEN_TIMES),
    "adjustTimeStep": switch,
    "maxCo": real(1e-6, 1e6),
    "maxDeltaT": real(1e-30, _LONGEST_TIME),
    "functions": {},
}


def control(section: Section, at_rest: float) -> tuple[list[str], Run]:
    """system/controlDict as lines, and what it asks for.

    at_rest : the initial residual of U that ends a run in time; 0 to go to endTime
    """
    for needed in ("application", "endTime", "deltaT"):
        items_of(section, needed)
    choice(*APPLICATIONS)(section, "application")
    application = APPLICATIONS[one(section, "application", Word, "a solver").text]
    own = section.entries.get("functions")
    has_own = isinstance(own, Section) and bool(own.entries)
    to_rest = application.in_time and (at_rest > 0.0 or has_own)
    rest = {key: value for key, value in section.entries.items() if value is not own or has_own}
    lines = entries(replace(section, entries=rest), _TO_REST if to_rest else _AS_WRITTEN)
    end = real_of(section, "endTime", 1e-30, _LONGEST_TIME)
    step = real_of(section, "deltaT", 1e-30, _LONGEST_TIME)
    if end > step * MOST_FLOW_STEPS:
        raise section.error(
            items_of(section, "deltaT")[0].at, f"at most {MOST_FLOW_STEPS} steps to endTime {end:g}",
            f"deltaT {step:g}, which makes {end / step:.3g}",
        )  # fmt: skip
    lines += ["runTimeModifiable no;"]
    if to_rest:
        lines += ["writeControl runTime;", f"writeInterval {figure(end)};"]
        lines += [] if has_own else braces("functions", braces("rest", _end_at(at_rest)))
    else:
        lines += _writing(section, end, step)
    return lines, Run(application, end, at_rest if to_rest else 0.0)


def _writing(section: Section, end: float, step: float) -> list[str]:
    """The entries for writing that a case lacks; InputError for too many times on the disk."""
    there = {**section.included, **section.entries}
    if "writeInterval" not in there:
        lines = [f"writeInterval {figure(end)};"]
        return lines if "writeControl" in there else [*lines, "writeControl runTime;"]
    by_steps = "writeControl" not in there or (
        one(section, "writeControl", Word, "a word").text == _BY_STEPS
    )
    interval = real_of(section, "writeInterval", 1e-30, _LONGEST_TIME) * (step if by_steps else 1.0)
    purged = "purgeWrite" in there and whole_of(section, "purgeWrite", 0, MOST_WRITTEN_TIMES) > 0
    if not purged and end > interval * MOST_WRITTEN_TIMES:
        raise section.error(
            items_of(section, "writeInterval")[0].at,
            f"at most {MOST_WRITTEN_TIMES} times to be written, or purgeWrite",
            f"{end / interval:.3g}",
        )
    return []


def _end_at(at_rest: float) -> list[str]:
    condition = [
        "type equationInitialResidual;", "fields (U);", f"value {figure(at_rest)};", "mode minimum;"
    ]  # fmt: skip
    return [
        "type runTimeControl;", "libs (utilityFunctionObjects);", "satisfiedAction end;",
        *braces("conditions", braces("velocity", condition)),
    ]  # fmt: skip
