"""The Fig. 29 ring for SciPy's `solve_ivp`: slopes, Jacobian and events of one smooth piece, and the restarts between.

Within a piece the segments under the contacts, the branch of the friction law and, in slip, the sign of the sliding
velocity are held: SciPy's solvers then see a smooth right-hand side, which is the best that one can offer them.
The state is (rho, its rate): angle and velocity relative to the ring, so that a creep far below the ring's own velocity
is resolved. The formulas are written out from the balance of momentum and share no code with the package.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan, cos, exp, log1p, pi, sin
from typing import Any, NamedTuple

import numba
import numpy as np
from _common import ALPHA, BODY, GRAVITY, RADIUS, REST, ROUGH, SPAN, V0, Cell
from scipy.integrate import solve_ivp

_M, _J, _A, _BALL = BODY["mass"], BODY["inertia"], BODY["half_distance"], BODY["ball_radius"]
_SB = _A / (RADIUS - _BALL)
_CB = (1.0 - _SB * _SB) ** 0.5
_S2B, _C2B = 2.0 * _SB * _CB, _CB * _CB - _SB * _SB
_BETA = np.arcsin(_SB)
_XI = (RADIUS - _BALL) * _CB
_IO = _J + _M * _XI * _XI
_LIMIT = 10_000


class Piece(NamedTuple):
    """What is held between two restarts; `side` is the sign of the sliding velocity in slip and 0 in the band."""

    amplitude: float
    side: float
    mu_s1: float
    mu_k1: float
    mu_s2: float
    mu_k2: float
    lower: float
    upper: float


class Run(NamedTuple):
    """Where a run ended, and after how many steps and restarts."""

    separated: bool
    t: float
    phi: float
    steps: int
    restarts: int


def _build(compiled: Callable[[Callable[..., Any]], Callable[..., Any]]) -> tuple[Callable[..., Any], ...]:
    """Right-hand side, Jacobian and events, each passed through `compiled`."""

    @compiled
    def friction(slide, side, mu_s1, mu_k1, mu_s2, mu_k2):
        v = slide * RADIUS
        if side == 0.0:
            rest = 1.0 - abs(v) / V0
            w_s, w_k = 1.0 - rest * rest, 0.0
            sign = 1.0 if v > 0.0 else -1.0
        else:
            # Trial states can lie far on the other side of the branch.
            w_s = exp(min(-ALPHA * (side * v - V0), 1.0))
            w_k = 1.0 - w_s
            sign = side
        return -sign * (w_s * mu_s1 + w_k * mu_k1), -sign * (w_s * mu_s2 + w_k * mu_k2)

    @compiled
    def acceleration(phi, omega, K1, K2):
        D = (K1 - K2) * _C2B + (1.0 + K1 * K2) * _S2B
        T = (K1 - K2) * _CB + 2.0 * K1 * K2 * _SB
        weight, lift = GRAVITY * sin(phi), (GRAVITY * cos(phi) + _XI * omega * omega) * _SB
        moment = weight * (RADIUS * _M * T - _M * _XI * D) + RADIUS * _M * lift * (K1 + K2)
        return moment / (_IO * D - RADIUS * _M * _XI * T), D

    @compiled
    def ring(t, amplitude):
        rate = atan(t)
        return amplitude * (t * rate - 0.5 * log1p(t * t)), amplitude * rate, amplitude / (1.0 + t * t)

    @compiled
    def slopes(t, y, amplitude, side, mu_s1, mu_k1, mu_s2, mu_k2, lower, upper):
        rho, slide = float(y[0]), float(y[1])
        theta, rate, epsilon = ring(t, amplitude)
        K1, K2 = friction(slide, side, mu_s1, mu_k1, mu_s2, mu_k2)
        return slide, acceleration(rho + theta, slide + rate, K1, K2)[0] - epsilon

    @compiled
    def jacobian(t, y, amplitude, side, mu_s1, mu_k1, mu_s2, mu_k2, lower, upper):
        # Differences whose lengths know the width of the band, which SciPy's own could only guess.
        rho, slide = float(y[0]), float(y[1])
        theta, rate, _ = ring(t, amplitude)
        short = 1e-4 * V0 / RADIUS
        K1, K2 = friction(slide, side, mu_s1, mu_k1, mu_s2, mu_k2)
        L1, L2 = friction(slide + short, side, mu_s1, mu_k1, mu_s2, mu_k2)
        here = acceleration(rho + theta, slide + rate, K1, K2)[0]
        by_rho = (acceleration(rho + theta + 1e-6, slide + rate, K1, K2)[0] - here) / 1e-6
        by_slide = (acceleration(rho + theta, slide + short + rate, L1, L2)[0] - here) / short
        return np.array(((0.0, 1.0), (by_rho, by_slide)))

    @compiled
    def normal_1(t, y, amplitude, side, mu_s1, mu_k1, mu_s2, mu_k2, lower, upper):
        theta, rate, _ = ring(t, amplitude)
        phi, omega = float(y[0]) + theta, float(y[1]) + rate
        K1, K2 = friction(float(y[1]), side, mu_s1, mu_k1, mu_s2, mu_k2)
        epsilon, D = acceleration(phi, omega, K1, K2)
        radial, tangential = GRAVITY * cos(phi) + _XI * omega * omega, GRAVITY * sin(phi) + _XI * epsilon
        return _M * (radial * (_SB - K2 * _CB) + tangential * (_CB + K2 * _SB)) / D

    @compiled
    def normal_2(t, y, amplitude, side, mu_s1, mu_k1, mu_s2, mu_k2, lower, upper):
        theta, rate, _ = ring(t, amplitude)
        phi, omega = float(y[0]) + theta, float(y[1]) + rate
        K1, K2 = friction(float(y[1]), side, mu_s1, mu_k1, mu_s2, mu_k2)
        epsilon, D = acceleration(phi, omega, K1, K2)
        radial, tangential = GRAVITY * cos(phi) + _XI * omega * omega, GRAVITY * sin(phi) + _XI * epsilon
        return _M * (radial * (_SB + K1 * _CB) - tangential * (_CB - K1 * _SB)) / D

    @compiled
    def edge(t, y, amplitude, side, mu_s1, mu_k1, mu_s2, mu_k2, lower, upper):
        return min(float(y[0]) - lower, upper - float(y[0]))

    @compiled
    def branch(t, y, amplitude, side, mu_s1, mu_k1, mu_s2, mu_k2, lower, upper):
        v = float(y[1]) * RADIUS
        return V0 - abs(v) if side == 0.0 else side * v - V0

    return slopes, jacobian, normal_1, normal_2, edge, branch


def _event(function: Callable[..., Any]) -> Callable[..., Any]:
    def event(*arguments: Any) -> Any:
        return function(*arguments)

    event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    return event


class ScipyRing:
    """Runs of the family by `solve_ivp`; the functions that it calls are interpreted or compiled."""

    def __init__(self, compiled: bool) -> None:
        self._slopes, self._jacobian, *guards = _build(numba.njit if compiled else lambda f: f)
        self._events = [_event(guard) for guard in guards]

    def run(self, cell: Cell, method: str, rtol: float) -> Run:
        """Run one cell to separation or to the end of the span."""
        amplitude = cell[0]
        t, y, side, steps = 0.0, np.zeros(2), 0.0, 0
        piece = self._place(cell, 0.0, 0.0, side)
        atol = (rtol, rtol * V0 / RADIUS)
        for restarts in range(_LIMIT):
            found = solve_ivp(
                self._slopes, (t, SPAN), y, method, args=piece, jac=self._jacobian, rtol=rtol, atol=atol,
                events=self._events,
            )  # fmt: skip
            steps += len(found.t) - 1
            t, y = float(found.t[-1]), found.y[:, -1]
            phi = float(y[0]) + amplitude * (t * atan(t) - 0.5 * log1p(t * t))
            separated_1, separated_2, at_edge, at_branch = (len(times) > 0 for times in found.t_events)
            separated = separated_1 or separated_2
            if found.status != 1 or separated:
                return Run(separated, t, phi, steps, restarts)
            way = 1.0 if y[1] > 0.0 else -1.0
            if at_branch:
                side = way if side == 0.0 else 0.0
            piece = self._place(cell, y[0], way if at_edge else 0.0, side)
        return Run(False, t, phi, steps, _LIMIT)

    @staticmethod
    def _place(cell: Cell, rho: float, crossing: float, side: float) -> Piece:
        """Piece that holds at `rho`, beyond the edge there if it is being crossed in the direction `crossing`."""
        amplitude, half_angle = cell
        rho += 1e-9 * crossing
        near = 2.0 * pi * round(rho / (2.0 * pi))
        edges = [near + 2.0 * pi * k + i * half_angle + j * _BETA for k in (-1, 0, 1) for i in (-1, 1) for j in (-1, 1)]
        under = [
            ROUGH if abs((rho + j * _BETA + pi) % (2.0 * pi) - pi) < half_angle else REST for j in (-1, 1)
        ]  # contact 1 trails, contact 2 leads
        return Piece(
            amplitude, side, under[0]["mu_s"], under[0]["mu_k"], under[1]["mu_s"], under[1]["mu_k"],
            max(e for e in edges if e <= rho), min(e for e in edges if e > rho),
        )  # fmt: skip
