"""Rodas5P: its tableau meets the conditions of its order, and its errors fall as they promise."""

from itertools import combinations_with_replacement
from math import cos, exp, prod, sin
from typing import NamedTuple

import numpy as np
import pytest

from ringsweep.models.interface import implicit
from ringsweep.solvers import rosenbrock
from ringsweep.solvers.rosenbrock import DENSE, DRIFT, GAMMA, STAGES, TIMES, A, C

#: The method in the variables of its theory: k_i = h f(y + sum alpha_ij k_j) + h J sum gamma_ij k_j.
GAMMAS = np.linalg.inv(np.eye(STAGES) / GAMMA - C)
ALPHAS = A @ GAMMAS
BETAS = ALPHAS + GAMMAS
#: Weights of the solution: the last row of A, and the last stage itself.
WEIGHTS = np.array([*A[-1, :-1], 1.0])


def trees(order):
    """Rooted trees of that order, each a tuple of its branches."""
    if order == 1:
        return [()]
    found = set()
    for sizes in partitions(order - 1):
        choices = [[]]
        for size in set(sizes):
            bundles = list(combinations_with_replacement(trees(size), sizes.count(size)))
            choices = [[*one, *bundle] for one in choices for bundle in bundles]
        found |= {tuple(sorted(choice)) for choice in choices}
    return sorted(found)


def partitions(n, most=None):
    """Ways to write n as a sum, largest term first."""
    if n == 0:
        return [()]
    return [(k, *rest) for k in range(min(n, most or n), 0, -1) for rest in partitions(n - k, k)]


def size(tree):
    return 1 + sum(map(size, tree))


def density(tree):
    return size(tree) * prod(map(density, tree))


def elementary_weights(tree):
    """What a tree contributes at each stage: one branch goes through alpha + gamma, several through alpha each."""
    if not tree:
        return np.ones(STAGES)
    matrix = BETAS if len(tree) == 1 else ALPHAS
    return np.prod([matrix @ elementary_weights(branch) for branch in tree], axis=0)


def dense_weights(fraction):
    polynomial = DENSE[0] + fraction * (DENSE[1] + fraction * DENSE[2])
    return fraction * WEIGHTS + fraction * (1 - fraction) * polynomial


class TestTableau:
    def test_there_are_as_many_trees_as_there_should_be(self):
        assert [len(trees(n)) for n in range(1, 6)] == [1, 1, 2, 4, 9]

    def test_times_and_weights_of_the_derivative_by_time_are_row_sums(self):
        np.testing.assert_allclose(ALPHAS.sum(axis=1), TIMES, rtol=0, atol=1e-13)
        np.testing.assert_allclose(GAMMAS.sum(axis=1), DRIFT, rtol=0, atol=1e-12)

    def test_stages_follow_each_other(self):
        for matrix in (A, C):
            np.testing.assert_array_equal(matrix, np.tril(matrix, -1))
        np.testing.assert_allclose(np.diag(GAMMAS), GAMMA, rtol=1e-14)

    @pytest.mark.parametrize("tree", [tree for n in range(1, 6) for tree in trees(n)], ids=str)
    def test_meets_every_condition_up_to_order_5(self, tree):
        assert WEIGHTS @ GAMMAS @ elementary_weights(tree) == pytest.approx(1 / density(tree), abs=2e-13)

    @pytest.mark.parametrize("tree", [tree for n in range(1, 5) for tree in trees(n)], ids=str)
    def test_embedded_solution_meets_them_up_to_order_4(self, tree):
        """The estimate of the error is the last stage: without it a method of order 4 is left."""
        embedded = np.array([*A[-1, :-1], 0.0])
        assert embedded @ GAMMAS @ elementary_weights(tree) == pytest.approx(1 / density(tree), abs=2e-13)

    @pytest.mark.parametrize("tree", [tree for n in range(1, 5) for tree in trees(n)], ids=str)
    def test_dense_output_meets_them_up_to_order_4(self, tree):
        for fraction in (0.0, 0.25, 0.5, 0.9, 1.0):
            found = dense_weights(fraction) @ GAMMAS @ elementary_weights(tree)
            assert found == pytest.approx(fraction ** size(tree) / density(tree), abs=1e-12)

    def test_is_l_stable(self):
        """|R| <= 1 on the imaginary axis, hence in the left half-plane, and R vanishes at infinity."""

        def R(z):
            b = WEIGHTS @ GAMMAS
            return 1 + z * b @ np.linalg.solve(np.eye(STAGES) - z * BETAS, np.ones(STAGES))

        assert max(abs(R(1j * y)) for y in np.geomspace(1e-3, 1e6, 2000)) <= 1 + 1e-12
        assert abs(R(-1e9)) < 1e-6
        assert R(-0.1) == pytest.approx(exp(-0.1), rel=1e-8)


class Kaps(NamedTuple):
    """``x' = -(1/e + 2) x + y^2/e``, ``y' = x - y - y^2``, turned in time; on the slow manifold x = y^2 = e^(-2 t)."""

    stiffness: float

    def solution(self, t):
        return exp(-2 * t) + sin(t), exp(-t)


@implicit.forcing.implements(Kaps)
def _forcing(scene, t):
    return sin(t), cos(t)


@implicit.rates.implements(Kaps)
def _rates(scene, mode, force, x):
    (lift, rate), k = force, scene.stiffness
    fast, slow = x[0] - lift, x[1]
    return -(k + 2) * fast + k * slow * slow + rate, fast - slow - slow * slow


@implicit.linearise.implements(Kaps)
def _linearise(scene, mode, t, x):
    k, slow = scene.stiffness, x[1]
    rates = _rates(scene, mode, _forcing(scene, t), x)
    return rates, (-(k + 2), 2 * k * slow, 1.0, -1 - 2 * slow), (), ((k + 2) * cos(t) - sin(t), -cos(t))


class Pursuit(NamedTuple):
    """``x' = -k (x - sin t) + cos t``, ``y' = x - sin t - y``; on the slow manifold x = sin t."""

    stiffness: float

    def solution(self, t):
        return sin(t), exp(-t)


@implicit.forcing.implements(Pursuit)
def _pursuit_forcing(scene, t):
    return sin(t), cos(t)


@implicit.rates.implements(Pursuit)
def _pursuit_rates(scene, mode, force, x):
    lag = x[0] - force[0]
    return -scene.stiffness * lag + force[1], lag - x[1]


@implicit.linearise.implements(Pursuit)
def _pursuit_linearise(scene, mode, t, x):
    k = scene.stiffness
    rates = _pursuit_rates(scene, mode, _pursuit_forcing(scene, t), x)
    return rates, (-k, 0.0, 1.0, -1.0), (), (k * cos(t) - sin(t), -cos(t))


def integrate(scene, steps, end=1.0):
    """Error at the end, largest error of the dense output within a step, largest estimate."""
    step, dense = rosenbrock.step, rosenbrock.dense
    stages = np.empty((STAGES, 2))
    h = end / steps
    state = scene.solution(0.0)
    within = estimate = 0.0
    for n in range(steps):
        t = n * h
        after, error = step(scene, None, t, state, implicit.linearise(scene, None, t, state), h, stages)
        for fraction in (0.3, 0.5, 0.8):
            found = dense(state, after, stages, fraction)
            within = max(within, distance(found, scene.solution(t + fraction * h)))
        estimate = max(estimate, abs(error[0]), abs(error[1]))
        state = after
    return distance(state, scene.solution(end)), within, estimate


def distance(one, other):
    return max(abs(a - b) for a, b in zip(one, other, strict=True))


def orders(scene, steps):
    errors = np.array([integrate(scene, n) for n in steps])
    return -np.polyfit(np.log(steps), np.log(errors), 1)[0]


class TestLinearSystem:
    """The stages solve ``(shift I - J) k = r`` with the Jacobian of a body on bristles."""

    @pytest.mark.parametrize("count", [0, 1, 2])
    def test_is_that_of_dense_algebra(self, count):
        rng = np.random.default_rng(count)
        for decay in (1.0, 1e6, 1e12):
            core, couplings = rng.normal(size=4), rng.normal(size=(count, 3))
            couplings[:, 2] = -decay * abs(couplings[:, 2])
            right, found, shift = rng.normal(size=2 + count), np.empty(2 + count), 3.0
            jacobian = np.zeros((2 + count, 2 + count))
            jacobian[:2, :2] = core.reshape(2, 2)
            jacobian[1, 2:], jacobian[2:, 1] = couplings[:, 0], couplings[:, 1]
            jacobian[range(2, 2 + count), range(2, 2 + count)] = couplings[:, 2]
            rosenbrock.solve(tuple(map(tuple, couplings)), tuple(core), shift, tuple(right), found)
            expected = np.linalg.solve(shift * np.eye(2 + count) - jacobian, right)
            np.testing.assert_allclose(found, expected, rtol=1e-11)


class TestOrder:
    def test_where_nothing_is_stiff(self):
        end, within, estimate = orders(Kaps(1.0), [8, 12, 16, 24, 32])
        assert end == pytest.approx(5.0, abs=0.2)
        assert within > 3.9
        assert estimate == pytest.approx(5.0, abs=0.4)

    @pytest.mark.parametrize("stiffness", [1e4, 1e5, 1e6])
    def test_on_a_slow_manifold(self, stiffness):
        """The problem of Prothero and Robinson: what stiffness takes of the order it gives back in size."""
        steps = [8, 12, 16, 24, 32]
        end, within, _ = orders(Pursuit(stiffness), steps)
        assert end > 2.9
        assert within == pytest.approx(4.0, abs=0.1)
        for n in steps:
            assert integrate(Pursuit(stiffness), n)[0] < 0.01 * n**-3.0 / stiffness

    @pytest.mark.parametrize("stiffness", 10.0 ** np.arange(1, 11))
    def test_no_stiffness_spoils_a_step(self, stiffness):
        end, within, _ = integrate(Kaps(stiffness), 32)
        assert end < 5e-8
        assert within < 5e-7

    def test_falls_onto_the_manifold_in_one_step(self):
        """Off it by one, a step of 1e6 relaxation times comes down to it."""
        scene = Kaps(1e8)
        stages = np.empty((STAGES, 2))
        start = (1.0 + scene.solution(0.0)[0], 1.0)
        line = implicit.linearise(scene, None, 0.0, start)
        (x, y), _ = rosenbrock.step(scene, None, 0.0, start, line, 0.01, stages)
        assert x - sin(0.01) == pytest.approx(y * y, abs=1e-4)
