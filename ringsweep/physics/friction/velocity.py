"""Friction laws that are functions of the sliding velocity alone.

Each law is one expression; all else is derived from it. The expression gives the friction coefficient at a sliding
speed, :math:`\\mu(|v|)`, from the coefficients ``mu_s`` and ``mu_k`` of the surface and from parameters of the law.
Derived are its slope, its power series, its form for vector lanes, and its *regions*: intervals of the sliding speed in
which the expression is analytic. Regions are numbered from slow to fast. In the regions with negative numbers, the
*stiction band*, a contact counts as stuck.

*Surfaces* are the coefficients of the surfaces under the contacts, ``(mu_s, mu_k, mu_s, mu_k, ...)``.

A function with ``@_derived`` is written with the arguments ``expression, count, lanes`` in front; callers pass only
those behind: the law, and for example a speed (m/s) and the surfaces. `count` is the length of `surfaces`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from math import inf, nan
from typing import Any

from ringsweep.compile import function_from_lines, inlined, stub
from ringsweep.numerics import writer
from ringsweep.numerics.expressions import Node, derivative, substitute, symbol
from ringsweep.numerics.functions import (
    any_of,
    arc_tangent,
    exponential,
    gather,
    hyperbolic_tangent,
    lanes_body,
    logarithm,
    raised,
    select,
    spread,
    square_root,
)
from ringsweep.numerics.lanes import LANES
from ringsweep.numerics.series import INVERSE
from ringsweep.numerics.terms import MOST_GROUPS, NUMBERS, ORDER, PRODUCTS, numbers_from, powers, terms, total
from ringsweep.physics.friction.formula import COEFFICIENTS, DIRECTION, Threshold
from ringsweep.quantities.parameters import Parameter

MU_S = Parameter("1", "static friction coefficient", lower=0.0)
MU_K = Parameter("1", "kinetic friction coefficient", lower=0.0)

SCALE = Parameter("1", "factor on the measured friction", lower=0.0, default=1.0)

#: Numbers of the regions of laws with bristles, which have two: in BAND the contact counts as stuck.
BAND, KINETIC = -1, 0


@dataclass(frozen=True, eq=False)
class Expression:
    """What defines a friction law of the sliding velocity.

    Attributes
    ----------
    mu : Node
        Friction coefficient as a function of the speed, m/s.
    thresholds : tuple of Threshold
        Speeds at which the expression switches.
    set_valued : bool
        Whether friction takes any value up to ``mu_s`` at rest.
    band : Node, optional
        Speed at which the stiction band ends, m/s. By default the first speed at which friction no longer grows; for a
        set-valued law zero.
    parameters : mapping of str to Parameter
    tabulated : bool
        Whether the law is a table of cubics: the expression holds for each of them. The symbols ``piece 0`` to
        ``piece 4`` are the lower bound of a cubic, m/s, and its coefficients from the lowest power up.
    signed : bool
        Whether the formula has the direction of sliding. Then it stands behind the coefficients of the surfaces.
    """

    mu: Node
    thresholds: tuple[Threshold, ...]
    set_valued: bool
    band: Node | None
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    tabulated: bool = False
    signed: bool = False

    @property
    def has_band(self) -> bool:
        """Whether the law has a stiction band or a dead band."""
        return self.band is not None or not self.set_valued

    @property
    def has_edges(self) -> bool:
        """Whether the law has more than one region."""
        return self.has_band or bool(self.thresholds) or self.tabulated


#: Expressions of the laws, by the type of the law.
EXPRESSIONS: dict[type, Expression] = {}


def _per_contact(expression: Expression, surfaces: int) -> list[Node]:
    """Friction coefficient at each contact, with the coefficients of its surface."""
    return [
        substitute(expression.mu, {symbol(name): symbol(f"{name} {i}") for name in COEFFICIENTS})
        for i in range(surfaces // 2)
    ]


def _source_names(expression: Expression, surfaces: int) -> dict[str, str]:
    """Source text of each symbol of an expression: of parameters, pieces, and coefficients under each surface."""
    names = {name: f"law.{name}" for name in expression.parameters}
    if expression.tabulated:
        names |= {f"piece {j}": f"piece[{j}]" for j in range(PIECE)}
    for i in range(surfaces):
        names[f"{COEFFICIENTS[i % 2]} {i // 2}"] = f"surfaces[{i}]"
    return names | ({DIRECTION.value: f"surfaces[{surfaces - 1}]"} if expression.signed else {})


#: Numbers of a cubic in a table.
PIECE = 5


@inlined
def _row_at(pieces, speed):
    """Row of the table of cubics that holds a speed, m/s."""
    low, high = 0, pieces.shape[0]
    while high - low > 1:
        middle = (low + high) // 2
        if speed < pieces[middle, 0]:
            high = middle
        else:
            low = middle
    return low


def _piece_at(pieces, speed):
    """Row of the table of cubics at a speed, m/s: the knot at which the piece begins, and four coefficients."""
    i = _row_at(pieces, speed)
    return pieces[i, 0], pieces[i, 1], pieces[i, 2], pieces[i, 3], pieces[i, 4]


@lanes_body(_piece_at)
def _piece_at_in_lanes(pieces, speed):
    """Form of :func:`_piece_at` for vector lanes: each lane halves the rows by itself."""
    low, width = spread(0.0), pieces.shape[0]
    while width > 1:
        # The row is one of `width` rows from `low` on.
        half = width // 2
        low = select(speed >= gather(pieces, low * PIECE + half * PIECE), low + half, low)
        width -= half
    place = low * PIECE
    return (
        gather(pieces, place),
        gather(pieces, place + 1.0),
        gather(pieces, place + 2.0),
        gather(pieces, place + 3.0),
        gather(pieces, place + 4.0),
    )


_SCOPE = {
    "piece_at": _piece_at,
    "any_of": any_of,
    "atan_of": arc_tangent,
    "exp_of": exponential,
    "inf": inf,
    "INVERSE": INVERSE,
    "log_of": logarithm,
    "nan": nan,
    "power_of": raised,
    "select": select,
    "spread": spread,
    "sqrt_of": square_root,
    "tanh_of": hyperbolic_tangent,
}


def _threshold(expression: Expression, count: int) -> str:
    """Source text of a threshold; ``{0}`` stands for its index."""
    ahead, back = "law.thresholds[{0}]", "law.thresholds_back[{0}]"
    return f"select(surfaces[{count - 1}] > 0.0, {ahead}, {back})" if expression.signed else ahead


def _side(expression: Expression, count: int, speed: str) -> str:
    """Condition for the lower side of a switch. In a region `speed` is its lower bound, ``low``."""
    return f"{speed} < {_threshold(expression, count)}"


def _derived(write: Callable[..., list[str]]) -> Any:
    """Make a function of a law whose body is written from the expression of the law.

    `write` takes the expression, the number of coefficients of surfaces, and whether numbers are vector lanes; then the
    names of the arguments. It returns the lines of the body.
    """
    names = [name for name in inspect.signature(write).parameters if name not in ("expression", "count", "lanes")]

    @cache
    def body(law: Any, count: int, lanes: bool) -> Any:
        expression = EXPRESSIONS.get(law)
        if expression is None:
            return None
        lines = write(expression, count, lanes, *names)
        return function_from_lines(", ".join(names), lines, _SCOPE | {"low_of": lower_bound, "row_at": _row_at})

    def count_of(arguments: Any) -> int:
        return len(arguments[names.index("surfaces")]) if "surfaces" in names else 0

    def function(*arguments: Any) -> Any:
        law: Any = type(arguments[0])
        found = body(law, count_of(arguments), False)
        if found is None:
            raise TypeError(f"{type(arguments[0]).__name__} is not a friction law of the velocity")
        return found(*arguments)

    def typed(*kinds: Any) -> Any:
        in_lanes = LANES in kinds
        return body(getattr(kinds[0], "instance_class", None), count_of(kinds), in_lanes)

    return stub(write, names, function, typed, absorb=True)


# ---- regions ----------------------------------------------------------------------------------


@_derived
def stiction_band(expression, count, lanes, law):
    """Sliding speed below which a contact counts as stuck, m/s; 0 for set-valued laws without a dead band."""
    return ["return law.band" if expression.has_band else "return 0.0"]


def _interval(expression: Expression) -> str:
    """Source text for the number of edges below a region."""
    return "region + law.in_band" if expression.has_band else "region"


def _region_prelude(expression: Expression) -> list[str]:
    """First lines of a function of the region: its lower bound, or the cubic of its piece."""
    if not expression.tabulated:
        return ["low = low_of(law, region)"]
    coefficients = "".join(f"law.pieces[i, {j}], " for j in range(PIECE))
    return [f"i = {_interval(expression)}", f"piece = ({coefficients})"]


def _speed_prelude(expression: Expression) -> list[str]:
    """First lines of a function of the speed: the cubic of the piece that holds it, if there are pieces."""
    return ["piece = piece_at(law.pieces, speed)"] if expression.tabulated else []


@_derived
def lower_bound(expression, count, lanes, law, region):
    """Lower bound of a region, m/s."""
    if expression.tabulated:
        return [f"return law.pieces[{_interval(expression)}, 0]"]
    if not expression.has_edges:
        return ["return 0.0"]
    return [f"i = {_interval(expression)}", "return law.edges[i - 1] if i > 0 else 0.0"]


@_derived
def upper_bound(expression, count, lanes, law, region):
    """Upper bound of a region, m/s."""
    if expression.tabulated:
        return [
            f"i = {_interval(expression)} + 1",
            "return law.pieces[i, 0] if i < law.pieces.shape[0] else inf",
        ]
    if not expression.has_edges:
        return ["return inf"]
    return [f"i = {_interval(expression)}", "return law.edges[i] if i < len(law.edges) else inf"]


@_derived
def region_at(expression, count, lanes, law, speed):
    """Region of a sliding speed, m/s; a bound belongs to the region above it."""
    if not expression.has_edges:
        return ["return 0"]
    back = "i - law.in_band" if expression.has_band else "i"
    if expression.tabulated:
        return ["i = row_at(law.pieces, speed)", f"return {back}"]
    lines = ["i = 0", "for edge in law.edges:", "    if speed >= edge and edge < inf:", "        i += 1"]
    return [*lines, f"return {back}"]


@inlined
def region_bounds(law, region):
    """Lower and upper bound of a region, m/s."""
    return lower_bound(law, region), upper_bound(law, region)


@_derived
def varies(expression, count, lanes, law, region):
    """Whether friction depends on the sliding speed within a region."""
    if expression.tabulated:
        # Beyond the table friction is constant.
        return [f"return {_interval(expression)} + 1 < law.pieces.shape[0]"]
    if expression.signed:
        return [f"return {expression.mu.varies}"]
    return ["low = low_of(law, region)", *writer.varies_lines(expression.mu, _side(expression, count, "low"))]


def is_varying(law: Any) -> bool:
    """Whether friction depends on the sliding speed in some region, by the type of a law or by Numba's type of it."""
    return EXPRESSIONS[getattr(law, "instance_class", law)].mu.varies


# ---- values -----------------------------------------------------------------------------------


def _names_and_values(expression: Expression, count: int) -> tuple[dict[str, str], list[Node]]:
    """Source names, and the expressions of friction under each contact, then of their slopes."""
    found = _per_contact(expression, count)
    return _source_names(expression, count), [*found, *map(derivative, found)]


@_derived
def friction_at(expression, count, lanes, law, speed, surfaces):
    """Friction coefficient at each contact, 1, then its slope at each contact, s/m; for floats and Lanes.

    Parameters
    ----------
    law : NamedTuple
    speed : float or Lanes
        Magnitude of the sliding velocity, m/s.
    surfaces : tuple
        Coefficients of the surfaces.

    Returns
    -------
    tuple
        ``(mu, ..., slope, ...)``. In lanes a set-valued law has no friction at rest, where it has no single value.
    """
    names, outputs = _names_and_values(expression, count)
    if not lanes:
        return [*_speed_prelude(expression), *writer.float_lines(names, outputs, _side(expression, count, "speed"))]
    lines = [*_speed_prelude(expression), *writer.lanes_lines(names, outputs, _threshold(expression, count))]
    if expression.has_band:
        return lines
    half = len(outputs) // 2
    lines[-1] = lines[-1].replace("return", "found =")
    coefficients = "".join(f"select(speed > 0.0, found[{i}], 0.0), " for i in range(half))
    return [*lines, f"return ({coefficients}" + "".join(f"found[{half + i}], " for i in range(half)) + ")"]


@_derived
def friction_in(expression, count, lanes, law, region, speed, surfaces):
    """What :func:`friction_at` returns, by the formula of a region, even if the speed lies outside the region."""
    side = _side(expression, count, "low")
    return [*_region_prelude(expression), *writer.float_lines(*_names_and_values(expression, count), side)]


@inlined
def steepest(law):
    """Slopes of friction where it is steepest: at rest, and outside the stiction band; s/m.

    They hold for the roughest surface. ``rk4`` takes the stiffness of a step that meets one of these speeds from them.
    """
    return law.slope_at_rest, law.slope_beyond


@inlined
def passes_band(law, before, after, ahead):
    """Whether a step meets rest, or the upper bound of the stiction band.

    Parameters
    ----------
    law : NamedTuple
    before, after, ahead : float or Lanes
        Sliding velocity at the beginning of the step, at its end, and in its stages, m/s.

    Returns
    -------
    tuple of bool
        Whether the step meets rest; whether it meets rest or the bound of the band, or leaps over a whole region, of
        which it sees nothing; whether it jumps across the whole band.
    """
    band = stiction_band(law)
    slow = min(min(abs(before), abs(after)), abs(ahead))
    fast = max(max(abs(before), abs(after)), abs(ahead))
    rest = (before * after < 0.0) | (before * ahead < 0.0)
    # A law without a band is set-valued at rest.
    rest = rest | ((band == 0.0) & (before * after == 0.0))
    meets = rest | ((slow < band) & (band <= fast)) | leaps(law, slow, fast)
    return rest, meets, rest & (slow >= band)


@_derived
def leaps(expression, count, lanes, law, slow, fast):
    """Whether a whole bounded region lies between the speeds `slow` and `fast`, m/s: a step would jump over it."""
    thresholds = len(expression.thresholds) * (2 if expression.signed else 1)
    edges = 0 if expression.tabulated else thresholds + expression.has_band
    within = [f"((slow < law.edges[{i}]) & (law.edges[{i + 1}] <= fast))" for i in range(edges - 1)]
    return ["return " + (" | ".join(within) or "slow > inf")]


# ---- power series -----------------------------------------------------------------------------


@cache
def _source_of_series(expression: Expression, count: int) -> writer.SeriesSource:
    """Source code of the power series of friction under each contact."""
    names, side = _source_names(expression, count), _side(expression, count, "low")
    return writer.series_source(names, _per_contact(expression, count), side)


#: Largest number of products in the power series of a law: tables have places for that many besides those of a model.
MOST_PRODUCTS = MOST_GROUPS * PRODUCTS - 8


def series_products(expression: Expression) -> int:
    """Number of products in the power series of friction at two contacts."""
    return _source_of_series(expression, 5 if expression.signed else 4).products


@_derived
def no_products(expression, count, lanes, law, surfaces):
    """Tuple of zeros, one for each product in the power series of friction."""
    return [f"return ({'0.0, ' * _source_of_series(expression, count).products})"]


@_derived
def begin_series(expression, count, lanes, law, region, speed, surfaces):
    """Coefficient 0 of the power series of friction.

    Parameters
    ----------
    law : NamedTuple
    region : int
    speed : float
        Coefficient 0 of the sliding speed, m/s.
    surfaces : tuple of float
        Coefficients of the surfaces.

    Returns
    -------
    tuple
        Friction coefficient at each contact; numbers for :func:`series_term`; and the sharpness of the law for
        :func:`shorten_for_decay`, s/m.
    """
    return [*_region_prelude(expression), *_source_of_series(expression, count).start]


@_derived
def series_term(expression, count, lanes, law, region, k, x, inner, begun, surfaces):
    """Coefficient `k`, 1 or more, of the power series of friction.

    Parameters
    ----------
    law : NamedTuple
    region, k : int
    x : float
        Coefficient `k` of the sliding speed.
    inner : tuple of float
        Inner products of the factors, see :func:`ringsweep.numerics.terms.inner_products`.
    begun : tuple of float
        Second result of :func:`begin_series`.
    surfaces : tuple of float
        Coefficients of the surfaces.

    Returns
    -------
    tuple of tuple of float
        Coefficient of friction at each contact; left factors and right factors of the products.
    """
    return [*_region_prelude(expression), *_source_of_series(expression, count).step]


# Largest change of the exponent of an exponential within a step, in any direction of the complex plane. The terms of
# its series grow up to the one that this number counts; at the end of the series each is half of the one before. For a
# larger change the last terms give no estimate of the error; for half as much again it is too small by a factor of 2.
_MAX_EXPONENT = ORDER / 2.0


@inlined
def shorten_for_decay(sharpness, v, h):
    """Step shortened from `h`, s, so that the series of friction converges within it.

    Parameters
    ----------
    sharpness : float
        Third result of :func:`begin_series`, s/m.
    v : ndarray of shape ``(ORDER + 1 or more,)``
        Series of the sliding velocity, m/s^(k + 1).
    h : float
        Step, s.
    """
    if sharpness == 0.0:
        return h
    while True:
        sizes = abs(terms(v)) * powers(h)
        exponent = sharpness * h * total(sizes)
        if not exponent > 1.5 * _MAX_EXPONENT:
            return h
        # The logarithm of the exponent is a convex function of that of the step: Newton's method comes from above.
        h *= (_MAX_EXPONENT / exponent) ** (exponent / (sharpness * h * total(sizes * numbers_from(NUMBERS, 0))))
