"""Tables of measurements in a configuration: two columns, in lists or in a CSV file."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.config.sections import one_of, read_values, warn_once
from ringsweep.config.yaml_text import Document
from ringsweep.errors import InputError, nearest_name, shortened
from ringsweep.quantities.parameters import Parameter

#: Columns of the tables of a measured drive, force and friction curve, by section. The first column ascends.
TABLES = {
    "drive": {
        "time": Parameter("s", "time in the table of the drive"),
        "theta": Parameter("rad", "angle of the drive"),
    },
    "force": {"time": Parameter("s", "time in the table of the force"), "force": Parameter("N", "force on the body")},
    "friction": {
        "v": Parameter("m/s", "sliding speed in the table of friction", lower=0.0),
        "mu": Parameter("1", "friction coefficient", lower=0.0),
    },
}

#: What joins the rows of a table of the time, by section; the first name is the default.
INTERPOLATIONS = {
    # A stuck body feels the acceleration of the drive, and a jump of its velocity would be an impact.
    "drive": {
        "spline": "a cubic spline: its acceleration is continuous",
        "monotone": "a cubic between each two rows that stays between them: its acceleration may jump at a row",
    },
    "force": {
        "monotone": "a cubic between each two rows that stays between them: its rate is continuous",
        "linear": "straight lines",
    },
}

# Share of the range of a table that a spline through it may leave; a sine with six rows a period leaves less.
_OVERSHOOT = 0.1

_PLURAL = {"time": "times", "theta": "angles", "force": "forces", "v": "speeds", "mu": "coefficients"}


# Factor by which numbers of a table may grow before they overflow.
_ROOM = 1e100


def read_samples(
    doc: Document, given: dict[str, Any], section: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], str]:
    """Times, samples and interpolation of a drive or a force from a table; see :func:`read_table`."""
    known, where = INTERPOLATIONS[section], f"scene.{section}.interpolate"
    problem = f"is no interpolation of a {section}"
    interpolate = one_of(given.get("interpolate", next(iter(known))), known, where, problem)
    times, samples = read_table(doc, given, section, 4 if interpolate == "spline" else 2)
    if interpolate == "spline":
        _warn_of_overshoot(times, samples, section)
    return times, samples, interpolate


def _warn_of_overshoot(times: NDArray[np.float64], samples: NDArray[np.float64], section: str) -> None:
    from scipy.interpolate import CubicSpline

    between = CubicSpline(times, samples)(times[:-1] + np.diff(times) * np.linspace(0.0, 1.0, 9)[:, None])
    beyond = max(np.max(between) - np.max(samples), np.min(samples) - np.min(between))
    if beyond > _OVERSHOOT * np.ptp(samples):
        cure = "`interpolate: monotone` stays between rows"
        warn_once(f"scene.%s: the spline leaves the range of its table by %.3g; {cure}", section, beyond)


def read_table(
    doc: Document, given: dict[str, Any], section: str, least: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Both columns of a table. If they come from a file, they replace its name in the configuration.

    Parameters
    ----------
    doc : Document
    given : dict
        The section.
    section : str
        Its name, a key of :data:`TABLES`.
    least : int
        Least number of rows.

    Raises
    ------
    InputError
        If the table is missing, is too short, begins after 0, or its first column does not ascend; or if a row is so
        far from the one before that numbers overflow.
    """
    where, columns = f"scene.{section}", TABLES[section]
    first, second = columns
    if "file" in given:
        if any(name in given for name in columns):
            raise InputError(f"{where}.file", f"give a file, or {first} and {second}, not both")
        found = doc.inline_csv(given["file"], f"{where}.file", where)
        renamed = {"time" if name == "t" else name: cells for name, cells in found.items()}
        if set(renamed) != set(columns) or len(found) != 2:
            names = ["t" if name == "time" else name for name in columns]
            missing = [name for name in names if name not in found]
            wrong = {name: nearest_name(name, missing) for name in found if name not in names}
            hints = [f"; did you mean `{near}` by {shortened(name, 40)}?" for name, near in wrong.items() if near]
            problem = f"columns {', '.join(names)} are expected; got {', '.join(found)}{''.join(hints[:1])}"
            raise InputError(f"{where}.file", problem)
        doc.locations |= {k.replace(f"{section}.t.", f"{section}.time."): v for k, v in doc.locations.items()}
        del given["file"]
        given |= renamed
    for name in columns:
        if name not in given:
            raise InputError(f"{where}.{name}", f"missing: a table needs a file, or the lists {first} and {second}")
    x, y = (read_values(given[name], parameter, f"{where}.{name}") for name, parameter in columns.items())
    if len(x) != len(y):
        raise InputError(f"{where}.{second}", f"{len(y)} {_PLURAL[second]} for {len(x)} {_PLURAL[first]}")
    if len(x) < least:
        raise InputError(f"{where}.{first}", f"{len(x)} rows are too few: a table needs at least {least}")
    unit = columns[first].unit
    for i in 1 + np.flatnonzero(np.diff(x) <= 0.0)[:1]:
        raise InputError(f"{where}.{first}.{i}", f"{x[i]:g} {unit} does not come after {x[i - 1]:g} {unit}")
    if x[0] > 0.0:
        raise InputError(f"{where}.{first}.0", f"the table begins at {x[0]:g} {unit}: it must begin at 0 {unit}")
    # The coefficients of the cubics between rows, and what is computed from them, must not overflow.
    with np.errstate(all="ignore"):
        cube = np.diff(x) ** 3
        steep = ~np.isfinite(_ROOM * np.diff(y) / cube) | ~np.isfinite(_ROOM * np.diff(y) + cube)
    for i in 1 + np.flatnonzero(steep)[:1]:
        problem = f"from {y[i - 1]:g} to {y[i]:g} over {x[i] - x[i - 1]:g} {unit} is too steep or too far"
        raise InputError(f"{where}.{second}.{i}", problem)
    return x, y
