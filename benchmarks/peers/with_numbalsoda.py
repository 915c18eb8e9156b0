"""LSODA of numbalsoda, compiled from end to end. It has no events, so samples locate the separation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from math import atan, cos, exp, log1p, sin
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np
from numba import cfunc

try:
    from numbalsoda import lsoda, lsoda_sig
except ModuleNotFoundError:  # name before release 0.2; those releases need no Fortran
    from NumbaLSODA import lsoda, lsoda_sig

from benchmarks.peers import physics
from benchmarks.peers.physics import BELT_SPAN, BETA, RADIUS, REST, ROUGH, SPAN, Cell, Found, Law

_compiled = numba.njit(error_model="numpy", nogil=True)
_LANGUAGE = SimpleNamespace(sin=sin, cos=cos, exp=exp, atan=atan, log1p=log1p)
#: Number of intervals of the span, after each of which a run can end, and number of samples of the whole span.
_STRETCHES, _SAMPLES = 5, 4000
#: Samples soon after a start: LSODA starts with short steps, and gives up after 500 steps without a sample.
_FIRST = np.geomspace(1e-4, 1.0, 20)
#: Number of samples of the interval that holds the separation, in each refinement.
_CLOSER = 100


#: True: Numba compiles at the first call.
LAZY = True


@_compiled
def _after(times):
    """Times, with more samples between the first two."""
    return np.concatenate((times[:1], times[0] + _FIRST * (times[1] - times[0]), times[2:]))


def ring(law: Law, cells: Sequence[Cell], rtol: float) -> Callable[[], Found]:
    """Function that runs cells of the ring."""
    sample = _sampler(law)
    table = np.array(cells)
    # LSODA has one absolute tolerance for angle and velocity, so the smaller scale, of the creep, decides.
    atol = rtol * min(1.0, law.v0 / RADIUS)
    return lambda: Found(*sample(table, rtol, atol).T)


@cache
def _sampler(law: Law) -> Callable[..., Any]:
    f = physics.formulas(_LANGUAGE, law, _compiled)
    band, slip, drive, balance = f.band, f.slip, f.ring, f.balance
    v0, (rough_s, rough_k), (rest_s, rest_k) = law.v0, ROUGH, REST

    @_compiled
    def friction(rho, u, half_angle):
        x = rho + half_angle
        mu_s, mu_k = (
            (rough_s, rough_k) if x - 2 * np.pi * np.floor(x / (2 * np.pi)) < 2 * half_angle else (rest_s, rest_k)
        )
        sign = 1.0 if u > 0.0 else -1.0
        return band(u, sign, mu_s, mu_k) if abs(u) * RADIUS < v0 else slip(u, sign, mu_s, mu_k)

    @_compiled
    def motion(t, rho, u, amplitude, half_angle):
        theta, rate, epsilon = drive(t, amplitude)
        K1, K2 = friction(rho - BETA, u, half_angle), friction(rho + BETA, u, half_angle)
        acceleration, first, second = balance(rho + theta, u + rate, K1, K2)
        return acceleration - epsilon, min(first, second)

    @cfunc(lsoda_sig)
    def slopes(t, y, dy, cell):
        dy[0] = y[1]
        dy[1] = motion(t, y[0], y[1], cell[0], cell[1])[0]

    address = slopes.address

    @_compiled
    def first_loss(times, states, cell):
        for k in range(len(times)):
            if not motion(times[k], states[k, 0], states[k, 1], cell[0], cell[1])[1] > 0.0:
                return k
        return len(times)

    @_compiled
    def run(cell, rtol, atol, stretches):
        y = np.zeros(2)
        for stretch in range(stretches):
            times = _after(np.linspace(stretch, stretch + 1, _SAMPLES // stretches + 1) * (SPAN / stretches))
            states, success = lsoda(address, y, times, cell, rtol, atol)
            if not success:
                return np.nan, np.nan
            k = first_loss(times, states, cell)
            if k < len(times):
                # Refine the interval before sample k, which holds the separation.
                for _ in range(3):
                    k = max(k, 1)
                    times = np.linspace(times[k - 1], times[k], _CLOSER + 1)
                    states, success = lsoda(address, states[k - 1].copy(), times, cell, rtol, atol)
                    k = min(first_loss(times, states, cell), _CLOSER)
                k = max(k, 1)
                before = motion(times[k - 1], states[k - 1, 0], states[k - 1, 1], cell[0], cell[1])[1]
                after = motion(times[k], states[k, 0], states[k, 1], cell[0], cell[1])[1]
                part = before / (before - after)
                t = times[k - 1] + part * (times[k] - times[k - 1])
                return states[k - 1, 0] + part * (states[k, 0] - states[k - 1, 0]) + drive(t, cell[0])[0], t
            y = states[-1].copy()
        return y[0] + drive(SPAN, cell[0])[0], np.nan

    @_compiled
    def sample(cells, rtol, atol):
        found = np.empty((len(cells), 2))
        for i in range(len(cells)):
            found[i, 0], found[i, 1] = run(cells[i], rtol, atol, _STRETCHES)
            if np.isnan(found[i, 0]):
                # LSODA can fail to start while a contact creeps, so try again without restarts.
                found[i, 0], found[i, 1] = run(cells[i], rtol, atol, 1)
        return found

    # Keep the callback alive: the compiled function knows only its address.
    sample.keep = slopes
    return sample


@cache
def _belt_slopes() -> Any:
    rates = physics.lugre(_LANGUAGE, _compiled)

    @cfunc(lsoda_sig)
    def slopes(t, y, dy, p):
        dy[0], dy[1], dy[2] = rates(y[0], y[1], y[2], p[0], 1.0 if y[1] > p[0] else -1.0)

    return slopes


def belt(speeds: Sequence[float], rtol: float) -> Callable[[], Found]:
    """Function that runs velocities of the belt."""
    slopes = _belt_slopes()
    # Many samples, because LSODA gives up after 500 steps without one.
    times = np.linspace(0.0, BELT_SPAN, 3001)

    def one(speed: float) -> float:
        states, success = lsoda(
            slopes.address, np.array([0.0, speed, 0.0]), times, np.array([speed]), rtol, 1e-6 * rtol
        )
        return float(states[-1, 0]) if success else np.nan

    return lambda: Found(np.array([one(speed) for speed in speeds]), np.full(len(speeds), np.nan))
