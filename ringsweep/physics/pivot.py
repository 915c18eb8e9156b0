"""The balances of a pivot, and what follows from them.

A pivot is a body on one contact, which slides or sticks while the body swings about it. Symbols: alpha is the angle of
the ball that touches, psi that of the body, rho that of the centre of the ball from the axis. The vector from there to
the centre of mass is u outwards and w along the race. N is the normal reaction, and F the friction along the race.
Momentum, radial and tangential, and moment of momentum about the centre of mass:

.. math::

    M (-\\rho \\dot\\alpha^2 - w \\ddot\\psi - u \\dot\\psi^2) &= M g \\cos\\alpha - N \\\\
    M (\\rho \\ddot\\alpha + u \\ddot\\psi - w \\dot\\psi^2) &= -M g \\sin\\alpha + F \\\\
    J \\ddot\\psi &= -w N + (r - u) F

and a fourth equation: ``F = K N`` in slip; ``\\rho \\ddot\\alpha + r \\ddot\\psi = R \\ddot\\theta`` in stick. They are
linear in the unknowns: both accelerations, N and F. So their derivatives along a change of the motion, and the
coefficients of their power series, are the same equations with other right sides.

`f` is the :class:`Frame`. A solution is a tuple in the order of UNKNOWNS; a change of the motion one in the order of
MOTION.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from ringsweep.compile import function_from_lines, inlined
from ringsweep.numerics.balances import ONE, Polynomial, Source, read, solve, symbol


class Frame(NamedTuple):
    """A pivot at an instant: numbers of the body, place and rates; kg, m, s and rad.

    Attributes
    ----------
    mass, inertia, gravity : float
        Mass, moment of inertia about the centre of mass, and acceleration of gravity.
    radius, reach : float
        Radius r of the balls, and distance rho of their centres from the axis.
    alpha, sin_alpha, cos_alpha : float
        Angle of the ball that touches, from the downward vertical; its sine and cosine.
    u, w : float
        Distance of the centre of mass from the centre of this ball, outwards and along the race.
    psi_dot, alpha_dot, psi_square, alpha_square : float
        Rates of psi and alpha, and their squares.
    """

    mass: float
    inertia: float
    gravity: float
    radius: float
    reach: float
    alpha: float
    sin_alpha: float
    cos_alpha: float
    u: float
    w: float
    psi_dot: float
    alpha_dot: float
    psi_square: float
    alpha_square: float


#: What the balances have of the motion. Its change is a tuple in this order.
MOTION = "sin_alpha", "cos_alpha", "u", "w", "psi_square", "alpha_square"
#: Unknowns. A solution is a tuple in this order.
UNKNOWNS = "psi_dd", "alpha_dd", "N", "F"
#: A solution without accelerations and forces.
NOTHING = 0.0, 0.0, 0.0, 0.0


def _read_balance(text: str) -> Polynomial:
    """Polynomial of the numbers of a :class:`Frame`, of the unknowns, and of ``K`` and ``carried``."""
    return read(text, (*Frame._fields, *UNKNOWNS, "K", "carried"))


_BALANCES = [
    _read_balance("mass*(-reach*alpha_square - w*psi_dd - u*psi_square) = mass*gravity*cos_alpha - N"),
    _read_balance("mass*(reach*alpha_dd + u*psi_dd - w*psi_square) = -mass*gravity*sin_alpha + F"),
    _read_balance("inertia*psi_dd = -w*N + (radius - u)*F"),
]
# The right side less the left one is ``K N - F``, and the sliding acceleration.
_SLIP, _STICK = _read_balance("F = K*N"), _read_balance("carried = reach*alpha_dd + radius*psi_dd")

# Products of two numbers that change.
_PRODUCTS = sorted({key for p in _BALANCES for key in p.parts((*MOTION, *UNKNOWNS)) if len(key) == 2})

#: What the products add to the derivative along a change: nothing.
NO_PRODUCTS = (0.0,) * len(_PRODUCTS)

_CHANGE, _INNER = {name: f"d_{name}" for name in MOTION}, [f"inner_{i}" for i in range(len(_PRODUCTS))]
_REST = "rest_0", "rest_1", "rest_2", "rest_3"


def _function(found: Sequence[Polynomial], whole: Polynomial = ONE, **arguments: Iterable[str]) -> Any:
    """Make a function of a frame and of `arguments`, numbers or tuples, that returns `found`, each over `whole`."""
    source = Source(Frame._fields, ("K",))
    source.begin(plain=True)
    values = ", ".join(source.quotient(p, whole) for p in found)
    lines = [f"{', '.join(names)} = {argument}" for argument, names in arguments.items()]
    names = ", ".join(("body", *arguments))
    return inlined(function_from_lines(names, [*lines, *source.lines, f"return {values}"], {}))


def _solution(law: Polynomial) -> tuple[list[Polynomial], Polynomial]:
    """Numerators and denominator of the unknowns."""
    nothing, equations = dict.fromkeys(UNKNOWNS, 0.0), zip((*_BALANCES, law), _REST, strict=True)
    return solve([p - p.substitute(nothing) + symbol(rest) for p, rest in equations], UNKNOWNS)


def _change(p: Polynomial) -> Polynomial:
    """Change of a balance at constant unknowns, and what is left of its products."""
    parts = p.parts((*MOTION, *UNKNOWNS))
    left = [parts[product] * symbol(name) for product, name in zip(_PRODUCTS, _INNER, strict=True) if product in parts]
    return sum(left, p.rate({name: symbol(change) for name, change in _CHANGE.items()}))


#: Left and right factors of the products, from a frame, a change of the motion, and that of the solution.
left_factors, right_factors = (
    _function([symbol(_CHANGE.get(p[i][0], p[i][0])) for p in _PRODUCTS], change=_CHANGE.values(), solution=UNKNOWNS)
    for i in (0, 1)
)

#: Right sides of the balances less the left ones, N, N and N m, from a frame and a solution.
imbalance = _function(_BALANCES, solution=UNKNOWNS)

#: Their change with the motion at constant unknowns, from a frame, a solution, the change of the motion, and what is to
#: be added to the change of each product.
imbalance_of_change = _function(
    [_change(p) for p in _BALANCES], solution=UNKNOWNS, change=_CHANGE.values(), inner=_INNER
)

#: Solution in slip, from a frame, K, and what stands for the terms without unknowns: in the balances, N, N and N m, and
#: for ``F - K N``, N.
solved_in_slip = _function(*_solution(_SLIP), K="K", rest=_REST)

#: Solution in stick, from a frame and what stands for the terms without unknowns: in the balances, and in the sliding
#: acceleration, m/s^2.
solved_in_stick = _function(*_solution(_STICK), rest=_REST)

#: Determinant of the equations in slip, kg m^2, from a frame and K: M J times the acceleration that a reaction of 1 N
#: would give to the gap. Where it is not positive, the contact jams.
determinant = _function([_solution(_SLIP)[1].over(-symbol("mass") * symbol("reach"))], K="K")

#: Sliding acceleration, m/s^2, from a frame, a solution, and the acceleration of the race.
sliding_acceleration = _function([_STICK], solution=UNKNOWNS, carried=["carried"])


@inlined
def load(f):
    """Normal reaction that the radial balance needs if psi is not accelerated, N; positive if the contact presses."""
    return imbalance(f, NOTHING)[0]


@inlined
def size(f):
    """Size of the terms in the balances per unit of mass, m/s^2."""
    return f.gravity + f.reach * f.alpha_square + (abs(f.u) + abs(f.w)) * f.psi_square + 1e-300


@inlined
def in_slip(f, K):
    """Accelerations of psi and alpha (rad/s^2), normal reaction and friction (N) in slip with friction K."""
    return solved_in_slip(f, K, (*imbalance(f, NOTHING), 0.0))


@inlined
def in_stick(f, carried):
    """Accelerations of psi and alpha (rad/s^2), normal reaction and friction (N) in stick; `carried` in m/s^2."""
    return solved_in_stick(f, (*imbalance(f, NOTHING), -carried))
