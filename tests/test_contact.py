"""The contact problem: the mode against the balances of a rigid body that may leave either contact."""

from math import cos, sin

import numpy as np
import pytest
from solutions import balances, ball, contact_accelerations, gap_response, rod

from ringsweep.physics import contact
from ringsweep.physics.contact import BACKWARD, CLOSED, FORWARD, IMPOSSIBLE, OPEN_1, OPEN_2, OPEN_BOTH, STICK


def draw(rng):
    """Random body at rest on the ring, static and kinetic friction, angle, angular velocity and acceleration."""
    beta, radius = np.radians(rng.uniform(5, 85)), rng.uniform(0.03, 0.1)
    centre = radius * rng.uniform(0.5, 0.95)
    body = rod(
        mass=rng.uniform(0.02, 0.5),
        inertia=1e-4 * 10 ** rng.uniform(-2, 1),
        radius=radius,
        xi=centre * cos(beta),
        sin_beta=sin(beta),
        cos_beta=cos(beta),
        gravity=9.81,
    )
    kinetic = rng.uniform(0.0, rng.choice([0.8, 2.5]), 2)
    static = kinetic + rng.choice([0.0, 1.0]) * rng.uniform(0.0, 0.8, 2)
    return body, tuple(static), tuple(kinetic), rng.uniform(-np.pi, np.pi), rng.uniform(-10, 10), rng.normal(0, 60)


def admissible(body, static, kinetic, phi, omega, epsilon):
    """Set of all admissible modes, and the least margin of any inequality."""
    free, units = balances(body, phi)
    scale = body.mass * (body.gravity + body.radius * (omega**2 + abs(epsilon)))
    found, margins = set(), []

    def enter(mode, *values):
        margins.append(min(values))
        if min(values) > 0:
            found.add(mode)

    def response(columns):
        """Accelerations at the contacts as affine functions of the factors of some combinations of forces."""
        base = contact_accelerations(body, free, omega)
        parts = [
            np.array(contact_accelerations(body, free + units @ np.asarray(c), omega)) - np.array(base) for c in columns
        ]
        return np.array(base), parts

    # Both contacts slip, forwards or backwards.
    for mode, sign in ((FORWARD, 1), (BACKWARD, -1)):
        columns = [(1, -sign * kinetic[0], 0, 0), (0, 0, 1, -sign * kinetic[1])]
        base, parts = response(columns)
        normals = np.linalg.solve(np.array([p[:, 0] for p in parts]).T, -base[:, 0])
        places = base[:, 1] + sum(n * p[:, 1] for n, p in zip(normals, parts, strict=True))
        enter(mode, *normals / scale, sign * (places.mean() - body.radius * epsilon) * body.mass / scale)
    # Both contacts stick with one saturation, which is searched between its bounds.
    kappas = np.linspace(-1, 1, 2001)
    base, (n1, f1, n2, f2) = response(np.eye(4))
    one, two = (n - np.multiply.outer(kappas, mu * f) for n, f, mu in ((n1, f1, static[0]), (n2, f2, static[1])))
    matrices = np.stack([one[:, :, 0], two[:, :, 0]], axis=-1)
    normals = np.linalg.solve(matrices, np.broadcast_to(-base[:, :1], (len(kappas), 2, 1)))[:, :, 0]
    places = base[:, 1] + normals[:, :1] * one[:, :, 1] + normals[:, 1:] * two[:, :, 1]
    away = places.mean(axis=1) - body.radius * epsilon
    turns = np.flatnonzero((away[:-1] * away[1:] <= 0) & (np.abs(np.diff(away)) < scale / body.mass))
    for k in turns:
        enter(STICK, *normals[k : k + 2].min(axis=0) / scale, 1 - abs(kappas[k]) + 1e-3)
    # One contact opens, the other one sticks or slips.
    for mode, own, other in ((OPEN_1, 1, 0), (OPEN_2, 0, 1)):
        base, (normal, friction) = response(np.eye(4)[[2 * own, 2 * own + 1]])
        matrix = np.array([normal[own], friction[own]]).T
        load, pull = np.linalg.solve(matrix, [-base[own, 0], body.radius * epsilon - base[own, 1]])
        gap = base[other, 0] + load * normal[other, 0] + pull * friction[other, 0]
        enter(mode, load / scale, (static[own] * load - abs(pull)) / scale, gap * body.mass / scale)
        for sign in (-1, 1):
            part = normal - sign * kinetic[own] * friction
            load = -base[own, 0] / part[own, 0]
            place, gap = base[own, 1] + load * part[own, 1], base[other, 0] + load * part[other, 0]
            slides = sign * (place - body.radius * epsilon)
            enter(mode, load / scale, slides * body.mass / scale, gap * body.mass / scale, part[own, 0] * body.mass)
    enter(OPEN_BOTH, *np.array(contact_accelerations(body, free, omega))[:, 0] * body.mass / scale)
    return found, np.abs(margins).min()


def chosen(found):
    """Mode by the rule of priority: stick, then a single slip, then open contacts."""
    slips, opens = found & {FORWARD, BACKWARD}, found & {OPEN_1, OPEN_2, OPEN_BOTH}
    if STICK in found:
        return STICK
    if slips:
        return slips.pop() if len(slips) == 1 else IMPOSSIBLE
    if len(opens) > 1:
        return OPEN_BOTH
    return opens.pop() if opens else IMPOSSIBLE


@pytest.fixture(scope="module")
def problems():
    rng = np.random.default_rng(14)
    return [draw(rng) for _ in range(1000)]


class TestAtRest:
    @staticmethod
    def mode(body, static, kinetic, phi, omega, epsilon):
        return contact.at_rest(body, static, kinetic, kinetic, (sin(phi), cos(phi), omega), epsilon, 0)

    def test_mode_at_rest_is_the_admissible_one(self, problems):
        seen = set()
        for problem in problems:
            found, margin = admissible(*problem)
            if margin > 2e-3:
                assert self.mode(*problem) == chosen(found), problem
                seen.add(self.mode(*problem))
        assert seen == {STICK, FORWARD, BACKWARD, OPEN_1, OPEN_2, OPEN_BOTH}

    def test_state_without_an_admissible_mode_is_impossible(self):
        """A rare state: too little friction to stick, too much friction to slip, and no gap opens."""
        beta = np.radians(75.9)
        body = rod(0.0806, 7.78e-4, 0.0379, 0.0266 * cos(beta), sin(beta), cos(beta), 9.81)
        problem = body, (0.98, 0.68), (0.54, 0.66), -0.08, -9.31, -85.5
        assert admissible(*problem)[0] == set()
        assert self.mode(*problem) == IMPOSSIBLE


@pytest.fixture(scope="module")
def states():
    """Random bodies that slide: body, friction per unit of both reactions, angle, angular velocity."""
    rng = np.random.default_rng(3)
    found = []
    for _ in range(3000):
        body, _, kinetic, phi, omega, _ = draw(rng)
        found.append((body, rng.choice([-1, 1]) * np.array(kinetic), phi, omega))
    return found


class TestSliding:
    def test_mode_is_the_admissible_one(self, states):
        seen, below = set(), 0
        for body, K, phi, omega in states:
            base, A = gap_response(body, K, phi, omega)
            scale = body.gravity + body.radius * omega**2
            normals = np.linalg.solve(A, -base) / body.mass
            lone = -base / np.diag(A) / body.mass
            gaps = base[::-1] + body.mass * lone * np.array([A[1, 0], A[0, 1]])
            alone = np.minimum(lone, gaps)
            margins = np.abs([*normals, *lone, *gaps, *base]) / scale
            if margins.min() < 1e-6:
                continue
            opens = [mode for mode, i in ((OPEN_1, 1), (OPEN_2, 0)) if alone[i] > 0.0 and A[i, i] > 0.0]
            opens += [OPEN_BOTH] if min(base) > 0.0 else []
            if min(normals) > 0.0:
                expected = CLOSED if np.linalg.det(A) > 0.0 else IMPOSSIBLE
            else:
                expected = OPEN_BOTH if len(opens) > 1 else opens[0] if opens else IMPOSSIBLE
            found = contact.sliding(body, *K, (sin(phi), cos(phi), omega))
            assert found == expected
            seen.add(found)
            D = (K[0] - K[1]) * cos(2 * body.beta) + (1 + K[0] * K[1]) * sin(2 * body.beta)
            below += D < 0.0 and found == CLOSED
        assert seen == {CLOSED, OPEN_1, OPEN_2, OPEN_BOTH, IMPOSSIBLE}
        # The determinant of two of the balances is no criterion.
        assert below > 10

    def test_frictionless_body_loses_both_contacts_at_the_top_only_if_slow(self):
        body = rod(0.076, 4.47e-5, 0.043378, 0.022, 0.75, np.sqrt(1 - 0.75**2), 9.81)
        modes = [contact.sliding(body, 0.0, 0.0, (sin(3.1), cos(3.1), omega)) for omega in (0.0, 50.0)]
        assert modes == [OPEN_BOTH, CLOSED]

    def test_body_at_rest_at_the_top_does_not_stick(self):
        # Its reactions vanish at one root of stick, but for rounding.
        body = rod(0.076, 4.47e-5, 0.043378, 0.022, 0.75, np.sqrt(1 - 0.75**2), 9.81)
        at = sin(np.pi), cos(np.pi), 0.0
        for static in ((0.2, 0.5), (0.5, 0.2), (0.0, 0.5), (0.5, 0.5)):
            kinetic = 0.6 * static[0], 0.6 * static[1]
            assert contact.at_rest(body, static, kinetic, kinetic, at, 0.0, 0) == OPEN_BOTH

    def test_body_with_one_contact_can_only_open_that_contact(self):
        body = ball(0.076, 0.043378, 9.81)
        assert contact.sliding(body, 0.1, 0.1, (sin(3.0), cos(3.0), 1.0)) == OPEN_1
        assert contact.at_rest(body, (0.5, 0.5), (0.3, 0.3), (0.3, 0.3), (sin(3.0), cos(3.0), 0.0), 0.0, 0) == OPEN_1
