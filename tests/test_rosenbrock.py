"""Rodas5P: the tableau meets the order conditions, and errors fall with these orders."""

from math import cos, exp, sin
from typing import NamedTuple

import numpy as np
import pytest

from ringsweep.models.interface import implicit
from ringsweep.solvers import rosenbrock
from ringsweep.solvers.creep import Start
from ringsweep.solvers.rosenbrock import GAMMA, STAGES, A, C

#: Coefficients of the standard form k_i = h f(y + sum alpha_ij k_j) + h J sum gamma_ij k_j.
GAMMAS = np.linalg.inv(np.eye(STAGES) / GAMMA - C)
ALPHAS = A @ GAMMAS
BETAS = ALPHAS + GAMMAS
#: Weights of the solution: the last row of A, and 1 for the last stage.
WEIGHTS = np.array([*A[-1, :-1], 1.0])


class TestTableau:
    def test_method_is_l_stable(self):
        """|R| <= 1 on the imaginary axis, and thus in the left half plane, and R vanishes at infinity."""

        def R(z):
            b = WEIGHTS @ GAMMAS
            return 1 + z * b @ np.linalg.solve(np.eye(STAGES) - z * BETAS, np.ones(STAGES))

        assert max(abs(R(1j * y)) for y in np.geomspace(1e-3, 1e6, 2000)) <= 1 + 1e-12
        assert abs(R(-1e9)) < 1e-6
        assert R(-0.1) == pytest.approx(exp(-0.1), rel=1e-8)


class Kaps(NamedTuple):
    """Problem of Kaps: ``x' = -(k + 2) x + k y^2``, ``y' = x - y - y^2``; sin t is added to x. Exactly y = e^(-t)."""

    stiffness: float

    def solution(self, t):
        return exp(-2 * t) + sin(t), exp(-t)


def _forcing(t):
    return sin(t), cos(t)


@implicit.rates.implements(Kaps)
def _rates(scene, mode, common, forcing, x):
    (shift, rate), k = forcing, scene.stiffness
    fast, slow = x[0] - shift, x[1]
    return -(k + 2) * fast + k * slow * slow + rate, fast - slow - slow * slow


@implicit.linearise.implements(Kaps)
def _linearise(scene, mode, common, t, forcing, x):
    k, slow = scene.stiffness, x[1]
    rates = _rates(scene, mode, common, forcing, x)
    return rates, ((-(k + 2), 2 * k * slow), (1.0, -1 - 2 * slow)), ((k + 2) * cos(t) - sin(t), -cos(t))


class ProtheroRobinson(NamedTuple):
    """Problem of Prothero and Robinson: ``x' = -k (x - sin t) + cos t``, ``y' = x - sin t - y``; exactly x = sin t."""

    stiffness: float

    def solution(self, t):
        return sin(t), exp(-t)


@implicit.rates.implements(ProtheroRobinson)
def _prothero_robinson_rates(scene, mode, common, forcing, x):
    deviation = x[0] - forcing[0]
    return -scene.stiffness * deviation + forcing[1], deviation - x[1]


@implicit.linearise.implements(ProtheroRobinson)
def _prothero_robinson_linearise(scene, mode, common, t, forcing, x):
    k = scene.stiffness
    rates = _prothero_robinson_rates(scene, mode, common, forcing, x)
    return rates, ((-k, 0.0), (1.0, -1.0)), (k * cos(t) - sin(t), -cos(t))


def step(scene, t, x, h, bends):
    """One step of length `h` from the state `x` at time `t`."""
    linear = implicit.linearise(scene, None, (), t, _forcing(t), x)
    forcings = tuple(_forcing(t + fraction * h) for fraction in rosenbrock.STAGE_TIMES)
    start = Start(None, t, x, x, None, (), linear)
    return rosenbrock.step(x, scene, start, h, forcings, bends)


def integrate(scene, steps, end=1.0):
    """Error at the end, largest error of the dense output within a step, and largest error estimate."""
    dense, bends = rosenbrock.dense, np.empty((3, 2))
    h = end / steps
    state = scene.solution(0.0)
    within = estimate = 0.0
    for n in range(steps):
        t = n * h
        after, error = step(scene, t, state, h, bends)
        for fraction in (0.3, 0.5, 0.8):
            found = dense(state, after, bends, fraction)
            within = max(within, distance(found, scene.solution(t + fraction * h)))
        estimate = max(estimate, abs(error[0]), abs(error[1]))
        state = after
    return distance(state, scene.solution(end)), within, estimate


def distance(one, other):
    return max(abs(a - b) for a, b in zip(one, other, strict=True))


def orders(scene, steps):
    errors = np.array([integrate(scene, n) for n in steps])
    return -np.polyfit(np.log(steps), np.log(errors), 1)[0]


class TestOrder:
    def test_order_is_5_where_nothing_is_stiff(self):
        end, within, estimate = orders(Kaps(1.0), [8, 12, 16, 24, 32])
        assert end == pytest.approx(5.0, abs=0.2)
        assert within > 3.9
        assert estimate == pytest.approx(5.0, abs=0.4)

    @pytest.mark.parametrize("stiffness", [1e4, 1e5, 1e6])
    def test_order_on_a_slow_manifold_is_3_and_the_error_falls_with_stiffness(self, stiffness):
        """Stiffness reduces the order, but the error is divided by the stiffness."""
        steps = [8, 12, 16, 24, 32]
        end, within, _ = orders(ProtheroRobinson(stiffness), steps)
        assert end > 2.9
        assert within == pytest.approx(4.0, abs=0.1)
        for n in steps:
            assert integrate(ProtheroRobinson(stiffness), n)[0] < 0.01 * n**-3.0 / stiffness

    @pytest.mark.parametrize("stiffness", 10.0 ** np.arange(1, 11))
    def test_error_is_small_for_any_stiffness(self, stiffness):
        end, within, _ = integrate(Kaps(stiffness), 32)
        assert end < 5e-8
        assert within < 5e-7

    def test_state_off_the_slow_manifold_is_on_it_after_one_step(self):
        """The state is off the manifold by 1; the step is 1e6 relaxation times long."""
        scene = Kaps(1e8)
        start = (1.0 + scene.solution(0.0)[0], 1.0)
        (x, y), _ = step(scene, 0.0, start, 0.01, np.empty((3, 2)))
        assert x - sin(0.01) == pytest.approx(y * y, abs=1e-4)
