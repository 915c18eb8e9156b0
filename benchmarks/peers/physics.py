"""The scenes of the benchmarks as a user of another library would write them, without anything of ringsweep.

Floats, JAX arrays and heyoka's expressions share the formulas. A *language* is a namespace with ``sin``, ``cos``,
``exp``, ``atan`` and ``log1p`` for one kind of numbers. The state on the ring is (rho, u), angle and angular velocity
relative to the ring, which resolves creep far below the velocity of the ring. The state on the belt is (x, velocity,
z); z is the deflection of the bristles.
"""

from __future__ import annotations

from collections.abc import Callable
from math import asin, atan, cos, exp, log1p, pi, sin
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

RADIUS, GRAVITY, SPAN = 0.043378, 9.81, 10.0
MASS, INERTIA, HALF_DISTANCE, BALL = 0.076, 4.47e-5, 0.025, 0.01
ROUGH, REST = (0.5, 0.3), (0.2, 0.1)  # mu_s, mu_k

SB = HALF_DISTANCE / (RADIUS - BALL)
CB = (1.0 - SB * SB) ** 0.5
BETA = asin(SB)
S2B, C2B = 2.0 * SB * CB, CB * CB - SB * SB
XI = (RADIUS - BALL) * CB
ABOUT_AXIS = INERTIA + MASS * XI * XI

BELT_SPAN, STIFFNESS, WEIGHT = 30.0, 2.0, 9.81  # WEIGHT of 1 kg, N
SIGMA = (1e5, 1e5**0.5, 0.1)
MU_S, MU_K, V_S = 0.15, 0.1, 1e-3


class Law(NamedTuple):
    """Bengisu-Akay law; if `v0` is 0, its limit stiction."""

    alpha: float
    v0: float


#: A cell of the ring: amplitude of the drive (rad/s), half-angle of the zone (rad).
Cell = tuple[float, float]


#: The language of floats.
FLOATS = SimpleNamespace(sin=sin, cos=cos, exp=exp, atan=atan, log1p=log1p)


class Found(NamedTuple):
    """Outcomes of a peer in some cells: value at the end, and time of separation or NaN."""

    end: Any
    separation: Any


def _same(function: Callable[..., Any]) -> Callable[..., Any]:
    return function


class Formulas(NamedTuple):
    """Formulas of the ring in a language."""

    ring: Callable[..., Any]
    """(t, amplitude) -> angle (rad), angular velocity and angular acceleration of the ring."""
    band: Callable[..., Any]
    """(u, sign, mu_s, mu_k) -> K of a contact slower than v0 in the direction `sign`."""
    slip: Callable[..., Any]
    """(u, sign, mu_s, mu_k) -> K of a contact faster than v0 in the direction `sign`."""
    balance: Callable[..., Any]
    """(phi, omega, K1, K2) -> angular acceleration, both reactions times the positive D / M."""
    stuck: Callable[..., Any]
    """(phi, omega, epsilon, mu_s1, mu_s2) -> both reactions, reserves against breakaway backward and forward."""


def formulas(language: Any, law: Law, compiled: Callable[..., Any] = _same) -> Formulas:
    """Formulas of the ring in a language; `compiled` is applied to each formula."""
    sin, cos, exp, atan, log1p = language.sin, language.cos, language.exp, language.atan, language.log1p
    alpha, v0 = law

    @compiled
    def ring(t, amplitude):
        rate = atan(t)
        return amplitude * (t * rate - 0.5 * log1p(t * t)), amplitude * rate, amplitude / (1.0 + t * t)

    @compiled
    def band(u, sign, mu_s, mu_k):
        x = sign * u * (RADIUS / v0)
        return -sign * mu_s * x * (2.0 - x)

    @compiled
    def slip(u, sign, mu_s, mu_k):
        if v0 == 0.0:
            return -sign * mu_k
        return -sign * (mu_k + (mu_s - mu_k) * exp(-alpha * (sign * u * RADIUS - v0)))

    @compiled
    def balance(phi, omega, K1, K2):
        s, c = GRAVITY * sin(phi), GRAVITY * cos(phi)
        D = (K1 - K2) * C2B + (1.0 + K1 * K2) * S2B
        T = (K1 - K2) * CB + 2.0 * K1 * K2 * SB
        radial = c + XI * omega * omega
        moment = s * (RADIUS * MASS * T - MASS * XI * D) + RADIUS * MASS * radial * SB * (K1 + K2)
        epsilon = moment / (ABOUT_AXIS * D - RADIUS * MASS * XI * T)
        tangential = s + XI * epsilon
        first = radial * (SB - K2 * CB) + tangential * (CB + K2 * SB)
        second = radial * (SB + K1 * CB) - tangential * (CB - K1 * SB)
        return epsilon, first, second

    @compiled
    def stuck(phi, omega, epsilon, mu_1, mu_2):
        # The acceleration is that of the ring. So the moment gives the friction F, the tangential balance gives the
        # difference d of the reactions, and the radial balance gives a quadratic equation for their sum, because both
        # contacts share one saturation of mu_s.
        F = (ABOUT_AXIS * epsilon + MASS * GRAVITY * XI * sin(phi)) / RADIUS
        d = (MASS * XI * epsilon + MASS * GRAVITY * sin(phi) - F * CB) / SB
        Q = MASS * (GRAVITY * cos(phi) + XI * omega * omega)
        both, odd = mu_1 + mu_2, mu_1 - mu_2
        a, b, e = CB * both, CB * odd * d - Q * both - F * SB * odd, -(Q * odd + F * SB * both) * d
        total = ((b * b - 4.0 * a * e) ** 0.5 - b) / (2.0 * a)
        first, second = 0.5 * (total + d), 0.5 * (total - d)
        reserve = mu_1 * first + mu_2 * second
        return first, second, reserve - F, reserve + F

    return Formulas(ring, band, slip, balance, stuck)


def lugre(language: Any, compiled: Callable[..., Any] = _same) -> Callable[..., Any]:
    """(x, velocity, z, v_b, way) -> rates of x, velocity and z; `way` is the sign of the sliding velocity."""
    exp = language.exp

    @compiled
    def rates(x, velocity, z, v_b, way):
        v = velocity - v_b
        g = WEIGHT * (MU_K + (MU_S - MU_K) * exp(-(v * v) / (V_S * V_S)))
        rate = v - SIGMA[0] * (way * v) * z / g
        return velocity, -STIFFNESS * x - (SIGMA[0] * z + SIGMA[1] * rate + SIGMA[2] * v), rate

    return rates


# ---- a hybrid automaton around an integrator with events -----------------------------------

BAND, SLIP, STICK = range(3)

#: Guards of each kind of piece. A piece ends when one of its guards falls to zero.
GUARDS = {
    BAND: ("lost_1", "lost_2", "lower", "upper", "turns", "leaves"),
    SLIP: ("lost_1", "lost_2", "lower", "upper", "slows"),
    STICK: ("lost_1", "lost_2", "breaks_backward", "breaks_forward"),
}


class Piece(NamedTuple):
    """Parameters that are constant between two restarts, so that the right-hand side is smooth."""

    amplitude: float
    sign: float
    mu_s1: float
    mu_k1: float
    mu_s2: float
    mu_k2: float
    lower: float
    upper: float


class Smooth(NamedTuple):
    """Right-hand side and guards of a piece in a language."""

    rates: Callable[..., Any]
    """(t, rho, u, *piece) -> rates of rho and u."""
    guards: Callable[..., Any]
    """(t, rho, u, *piece) -> guards, in the order of `GUARDS`."""


def pieces(f: Formulas, law: Law, compiled: Callable[..., Any] = _same) -> dict[int, Smooth]:
    """Right-hand side and guards, by kind of piece."""
    ring, balance, stuck, limit = f.ring, f.balance, f.stuck, law.v0 / RADIUS

    def moving(friction: Callable[..., Any], reserves: Callable[..., Any]) -> Smooth:
        @compiled
        def rates(t, rho, u, amplitude, sign, mu_s1, mu_k1, mu_s2, mu_k2, lower, upper):
            theta, rate, epsilon = ring(t, amplitude)
            K1, K2 = friction(u, sign, mu_s1, mu_k1), friction(u, sign, mu_s2, mu_k2)
            return u, balance(rho + theta, u + rate, K1, K2)[0] - epsilon

        @compiled
        def guards(t, rho, u, amplitude, sign, mu_s1, mu_k1, mu_s2, mu_k2, lower, upper):
            theta, rate, _ = ring(t, amplitude)
            K1, K2 = friction(u, sign, mu_s1, mu_k1), friction(u, sign, mu_s2, mu_k2)
            _, first, second = balance(rho + theta, u + rate, K1, K2)
            return first, second, rho - lower, upper - rho, *reserves(sign * u)

        return Smooth(rates, guards)

    @compiled
    def at_rest(t, rho, u, amplitude, sign, mu_s1, mu_k1, mu_s2, mu_k2, lower, upper):
        return 0.0, 0.0

    @compiled
    def holding(t, rho, u, amplitude, sign, mu_s1, mu_k1, mu_s2, mu_k2, lower, upper):
        theta, rate, epsilon = ring(t, amplitude)
        return stuck(rho + theta, rate, epsilon, mu_s1, mu_s2)

    slipping = moving(f.slip, compiled(lambda speed: (speed - limit,)))
    if law.v0 == 0.0:
        return {SLIP: slipping, STICK: Smooth(at_rest, holding)}
    return {SLIP: slipping, BAND: moving(f.band, compiled(lambda speed: (speed, limit - speed)))}


#: (kind, piece, t, (rho, u)) -> time, state, and the guard that ended the piece, or None at the end of the span.
Advance = Callable[[int, Piece, float, Any], tuple[float, Any, str | None]]

_MOST_PIECES = 10_000


class Automaton:
    """A hybrid automaton: runs pieces one after another with an integrator that has terminal events."""

    def __init__(self, law: Law, smooth: dict[int, Smooth]) -> None:
        """`smooth` holds the pieces in floats."""
        self._law, self._smooth = law, smooth

    def run(self, cell: Cell, advance: Advance) -> tuple[float, float]:
        """Angle at the end, and time of separation or NaN; both are NaN for a run that does not end."""
        t, y = 0.0, np.zeros(2)
        kind, piece = BAND, place(cell, 0.0, 0.0, -1.0)
        if self._law.v0 == 0.0:
            kind, piece = self._stop(cell, t, 0.0)
        for _ in range(_MOST_PIECES):
            # Reactions jump with mu, and a guard that starts below zero does not fall to zero.
            reactions = self._smooth[kind].guards(t, y[0], y[1], *piece)[:2]
            if min(reactions) <= 0.0:
                event: str | None = "lost_1" if reactions[0] <= 0.0 else "lost_2"
            else:
                t, y, event = advance(kind, piece, t, y)
            if event is None or event in ("lost_1", "lost_2"):
                theta = cell[0] * (t * atan(t) - 0.5 * log1p(t * t))
                return float(y[0] + theta), t if event else np.nan
            sign = piece.sign
            if event in ("lower", "upper"):
                piece = place(cell, y[0], -1.0 if event == "lower" else 1.0, sign)
            elif event == "turns":
                piece = piece._replace(sign=-sign)
            elif event == "leaves":
                kind = SLIP
            elif event in ("breaks_backward", "breaks_forward"):
                kind, piece = SLIP, piece._replace(sign=-1.0 if event == "breaks_backward" else 1.0)
            elif self._law.v0 > 0.0:
                kind = BAND
            else:
                y = np.array([y[0], 0.0])
                kind, piece = self._stop(cell, t, y[0])
        return np.nan, np.nan

    def _stop(self, cell: Cell, t: float, rho: float) -> tuple[int, Piece]:
        """Kind and piece after sliding has stopped, under stiction."""
        piece = place(cell, rho, 0.0, 1.0)
        backward, forward = self._smooth[STICK].guards(t, rho, 0.0, *piece)[2:]
        if backward > 0.0 and forward > 0.0:
            return STICK, piece
        return SLIP, piece._replace(sign=1.0 if backward > 0.0 else -1.0)


def place(cell: Cell, rho: float, crossing: float, sign: float) -> Piece:
    """Piece at `rho`; if an edge there is crossed in the direction `crossing`, the piece beyond the edge."""
    amplitude, half_angle = cell
    rho += 1e-9 * crossing
    near = 2.0 * pi * round(rho / (2.0 * pi))
    edges = [near + 2.0 * pi * k + i * half_angle + j * BETA for k in (-1, 0, 1) for i in (-1, 1) for j in (-1, 1)]
    # Contact 1 trails, contact 2 leads.
    under = [ROUGH if abs((rho + j * BETA + pi) % (2.0 * pi) - pi) < half_angle else REST for j in (-1, 1)]
    lower, upper = max(e for e in edges if e <= rho), min(e for e in edges if e > rho)
    return Piece(amplitude, sign, *under[0], *under[1], lower, upper)
