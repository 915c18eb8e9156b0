"""Parts that models share: parameters, friction coefficients, friction laws and drives.

Nothing here runs in kernels, but for the eigenvalues, which ``rk4`` takes. The others are called as a model builds
its cells; `values` are numbers in SI units by path, of shape ``(cells,)``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.compile import absorbed
from ringsweep.errors import InputError
from ringsweep.models.scene import WAYS, Structure, Values, require
from ringsweep.numerics.functions import any_of, select, square_root
from ringsweep.physics import drives, friction, zones
from ringsweep.physics.friction.formula import FormulaError
from ringsweep.physics.friction.speeds import hidden_fields, table_fields
from ringsweep.physics.friction.velocity import EXPRESSIONS
from ringsweep.quantities.parameters import Parameter, declared
from ringsweep.quantities.units import show

MASS = Parameter("kg", "mass of the body", lower=0.0, open_lower=True)
GRAVITY = Parameter("m/s^2", "acceleration of gravity", lower=0.0, default=9.81)
SPAN = Parameter("s", "span of time", lower=0.0, open_lower=True)


@absorbed
def exceeds(most, trace, determinant):
    """Whether an eigenvalue of a 2 x 2 matrix with this trace and determinant exceeds `most` in magnitude.

    It does if one of two real eigenvalues does, so that ``most^2 - |trace| most + determinant`` is negative, or if both
    do: then their product exceeds the square of `most`.
    """
    # By more than rounding. The small number is for an infinite trace at the first step.
    square = most * (most * (1.0 + 1e-12))
    return (abs(trace) * (most + 1e-300) > square + determinant) | (determinant > square)


@absorbed
def larger_eigenvalue(most, trace, determinant):
    """`most`, or the largest magnitude of an eigenvalue of a 2 x 2 matrix where that is larger."""
    more = exceeds(most, trace, determinant)
    if any_of(more):
        square = trace * trace - 4.0 * determinant
        root = square_root(select(square > 0.0, square, determinant))
        most = select(more, max(most, select(square > 0.0, 0.5 * (abs(trace) + root), root)), most)
    return most


def friction_coefficients(
    structure: Structure, place: str, values: Values
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Static and kinetic coefficients at a path such as ``friction.elsewhere``, each of shape ``(cells,)``.

    A law with one coefficient has it in the place of both. For a law from a table the second one is the factor on the
    table.

    Raises
    ------
    InputError
        If the kinetic coefficient exceeds the static one.
    """
    names = friction.coefficients_of(structure.law_type)
    if structure.curve is not None:
        scale = values[f"{place}.scale"]
        _, mu = structure.curve
        # At rest friction holds up to its value there. A smooth law vanishes there: its greatest value counts.
        return scale * (mu[0] or mu.max()), scale
    mu_s, mu_k = (values[f"{place}.{name if name in names else next(iter(names))}"] for name in ("mu_s", "mu_k"))
    where, problem = f"{place}.mu_k", "{} exceeds mu_s: kinetic friction cannot be greater than static friction"
    where = next((path for way in WAYS if values.get(path := f"{where}.{way}") is mu_k), where)
    require(mu_s >= mu_k, where, mu_k, problem)
    return mu_s, mu_k


def zone_parameters(structure: Structure, zone: type, rest: str) -> dict[str, Parameter]:
    """Parameters of zones (:class:`zones.Arc` or :class:`zones.Stretch`), of the `rest` and of the law, by path."""
    places = {f"friction.{structure.elsewhere}": rest}
    if structure.arcs == ("zone",):
        places["friction.rough"] = "the zone"
    else:
        places |= {arc: f"zone {number}" for number, arc in enumerate(structure.arcs, start=1)}
    found = {}
    for place, where in places.items():
        for name, p in friction.coefficients_of(structure.law_type).items():
            found[f"{place}.{name}"] = replace(p, long_name=f"{p.long_name} of {where}")
    found |= {f"friction.{name}": p for name, p in declared(structure.law_type).items()}
    for arc in structure.arcs:
        for name, p in declared(zone).items():
            found[f"{arc}.{name}"] = replace(p, long_name=p.long_name.replace("the zone", places.get(arc, "the zone")))
    return found


def surface_from(structure: Structure, values: Values, zone: Any, period: Any = 2.0 * np.pi) -> tuple[Any, list[Any]]:
    """Surface with zones of a type, and pairs of friction coefficients of all parts; see :func:`zones.surface_of`.

    Without a type of zone, coefficients have no place of their own. If they or the law depend on the direction, the
    pairs of forward sliding come before those of backward sliding.
    """
    if not structure.by_direction:
        return _surface_one_way(structure, values, zone, period)
    given = [path for path in structure.two_way if f"{path}.{WAYS[0]}" in values]
    of_ways = ({path: values[f"{path}.{way}"] for path in given} for way in WAYS)
    (ahead, pairs), (back, others) = (
        _surface_one_way(structure, {**values, **of_way}, zone, period) for of_way in of_ways
    )
    return zones.two_way(ahead, back), [*pairs, *others]


def _surface_one_way(structure: Structure, values: Values, zone: Any, period: Any) -> tuple[Any, list[Any]]:
    """What :func:`surface_from` returns for one direction of sliding."""
    rough = "friction.rough" if structure.arcs == ("zone",) else None
    arcs = [
        zone(
            *(values[f"{arc}.{name}"] for name in declared(zone)),
            *friction_coefficients(structure, rough or arc, values),
        )
        for arc in structure.arcs
    ]
    rest = friction_coefficients(structure, f"friction.{structure.elsewhere}" if zone else "friction", values)
    return zones.surface_of(arcs, *rest, period), [rest, *((arc.mu_s, arc.mu_k) for arc in arcs)]


def law_of(structure: Structure, values: Values, surfaces: list[Any], speed: NDArray[np.float64]) -> Any:
    """Friction law with fields of shape ``(cells, ...)``, from the values by path.

    `surfaces` are the pairs of friction coefficients of all surfaces of the scene, `speed` is that of the motion, m/s,
    see :func:`ringsweep.physics.friction.speeds.hidden_fields`.

    Raises
    ------
    InputError
        If one parameter must exceed another and does not, or if a formula has no allowed value at rest.
    """
    law = structure.law_type
    columns = {name: values[f"friction.{name}"] for name in declared(law)}
    if ascending := friction.TRAITS[law].ascending:
        low, high = ascending
        unit = declared(law)[high].unit
        problem = f"{{}} {unit} is not greater than friction.{low}"
        require(columns[high] > columns[low], f"friction.{high}", columns[high], problem)
    make: Any = getattr(law, "of", law)
    if structure.curve is not None:
        columns |= table_fields(*structure.curve, surfaces)
    elif law in EXPRESSIONS:
        try:
            columns |= hidden_fields(EXPRESSIONS[law], columns, surfaces, speed)
        except FormulaError as error:
            own = "" if structure.law == "formula" else f"laws.{structure.law}."
            path = f"{own}at_rest" if structure.own_law is not None and error.key == "at_rest" else "law"
            raise InputError(f"scene.friction.{path}", f"friction law {structure.law}: {error}") from None
    return make(**columns)


def drive_of(structure: Structure, values: Values) -> Any:
    """Drive with fields of shape ``(cells, ...)``, from the values by path.

    Raises
    ------
    InputError
        If the table of a drive ends before the span of time, or if the formula of a drive is not smooth.
    """
    if structure.table is None:
        # Neither bristles nor impacts take a jump of the sliding velocity.
        rebounds = structure.impact and structure.model != "belt"
        smooth = rebounds or friction.family_of(structure.law_type) is friction.Dynamic
        return by_formula(structure.drive_type, "drive", structure.drive_key, values, smooth=smooth)
    columns = {field: values[f"drive.{field}"] for field in declared(structure.drive_type)}
    return table_of(*structure.table, columns["amplitude"], "drive", values)


def by_formula(law: type, section: str, key: str, values: Values, *, smooth: bool = False) -> Any:
    """Drive or force with fields of shape ``(cells, ...)``; `key` of the `section` of a scene has its formula.

    The velocity of a `smooth` drive must not jump.

    Raises
    ------
    InputError
        If the formula is not smooth.
    """
    try:
        columns = {name: values[f"{section}.{name}"] for name in declared(law)}
        return drives.made(law, columns, values["time.span"], smooth=smooth)
    except FormulaError as error:
        raise InputError(f"scene.{section}.{key}", f"{show(drives.FORMULAS[law].text)}: {error}") from None


def table_of(
    times: NDArray[np.float64],
    samples: NDArray[np.float64],
    interpolate: str,
    amplitude: NDArray[np.float64],
    what: str,
    values: Values,
) -> drives.Table | drives.Steps:
    """Drive from a table, with fields of shape ``(cells, ...)``.

    Parameters
    ----------
    times, samples : ndarray of shape ``(samples,)``
        Times, s, and the measured quantity.
    interpolate : str
        What joins the samples; see :data:`ringsweep.config.own.INTERPOLATIONS`.
    amplitude : ndarray of shape ``(cells,)``
        Factor on the measured quantity.
    what : str
        Section of the configuration that has the table.
    values : mapping of str to ndarray
        Values by path.

    Raises
    ------
    InputError
        If the table ends before the span of time.
    """
    cells = len(values["time.span"])
    require(
        values["time.span"] <= times[-1],
        "time.span",
        values["time.span"],
        f"{{}} s is longer than the table of the {what}, which ends at {times[-1]:.6g} s",
    )
    if interpolate == "step":
        return drives.steps(amplitude, times, samples)
    # Few drives are tables, and this import takes longer than a small sweep.
    from scipy.interpolate import CubicSpline, PchipInterpolator

    if interpolate == "linear":
        zero = np.zeros(len(times) - 1)
        pieces = np.stack([zero, zero, np.diff(samples) / np.diff(times), samples[:-1]], axis=1)
    else:
        # A spline of a higher degree would amplify noise in the table.
        curve = CubicSpline if interpolate == "spline" else PchipInterpolator
        pieces = np.ascontiguousarray(curve(times, samples).c.T)
    return drives.Table(
        amplitude,
        knots=np.broadcast_to(times, (cells, *times.shape)),
        coefficients=np.broadcast_to(pieces, (cells, *pieces.shape)),
    )
