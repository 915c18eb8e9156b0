"""What several models share: parameters, friction coefficients of a place, drives."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.compile import absorbed
from ringsweep.models.scene import Structure, Values, require
from ringsweep.numerics.functions import select, square_root
from ringsweep.physics import drives, friction
from ringsweep.quantities.parameters import Parameter, declared

MASS = Parameter("kg", "mass of the body", lower=0.0, open_lower=True)
GRAVITY = Parameter("m/s^2", "acceleration of gravity", lower=0.0, default=9.81)
SPAN = Parameter("s", "span of time", lower=0.0, open_lower=True)


@absorbed
def largest_eigenvalue(trace, determinant):
    """Largest magnitude of an eigenvalue of two equations whose Jacobian has this trace and determinant."""
    square = trace * trace - 4.0 * determinant
    root = square_root(select(square > 0.0, square, determinant))
    return select(square > 0.0, 0.5 * (abs(trace) + root), root)


def pair(law: type, place: str, values: Values) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Static and kinetic coefficient at a place, checked against each other."""
    mu_k = values[f"{place}.mu_k"]
    if "mu_s" not in friction.coefficients_of(law):
        return mu_k, mu_k
    mu_s = values[f"{place}.mu_s"]
    require(
        mu_s >= mu_k, f"{place}.mu_k", mu_k, "{} exceeds mu_s: kinetic friction cannot be greater than static friction"
    )
    return mu_s, mu_k


def law_of(law: type, values: Values) -> Any:
    """A friction law whose leaves have shape ``(cells, ...)``; `values` holds its parameters by path.

    Raises
    ------
    InputError
        If parameters that must ascend do not.
    """
    columns = {name: values[f"friction.{name}"] for name in declared(law)}
    if ascending := friction.TRAITS[law].ascending:
        low, high = ascending
        unit = declared(law)[high].unit
        problem = f"{{}} {unit} is not greater than friction.{low}"
        require(columns[high] > columns[low], f"friction.{high}", columns[high], problem)
    if "seed" in columns:
        require(columns["seed"] % 1.0 == 0.0, "friction.seed", columns["seed"], "{} is not a whole number")
    made: Any = getattr(law, "of", law)
    return made(**columns)


def drive_of(structure: Structure, values: Values) -> Any:
    """A drive whose leaves have shape ``(cells, ...)``.

    Raises
    ------
    InputError
        If a table ends before the span of time does.
    """
    law = drives.DRIVES[structure.drive]
    columns: dict[str, Any] = {field: values[f"drive.{field}"] for field in declared(law)}
    if structure.table is None:
        return law(**columns)
    times, angles = structure.table
    cells = len(values["time.span"])
    require(
        values["time.span"] <= times[-1],
        "time.span",
        values["time.span"],
        f"{{}} s is longer than the table of the drive, which ends at {times[-1]:.6g} s",
    )
    # Few drives are tables, and this import takes longer than a small sweep.
    from scipy.interpolate import CubicSpline

    # A spline of third degree is the smoothest that a few noisy samples bear, and is C2.
    pieces = np.ascontiguousarray(CubicSpline(times, angles).c.T)
    return drives.Table(
        **columns,
        knots=np.broadcast_to(times, (cells, *times.shape)),
        coefficients=np.broadcast_to(pieces, (cells, *pieces.shape)),
    )
