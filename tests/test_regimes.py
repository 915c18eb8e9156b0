"""Regime and motion of synthetic runs, without a solver."""

from itertools import pairwise
from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ringsweep.models.interface.status import COMPLETE
from ringsweep.models.ring.record import outcome_of, record_after, record_at_launch
from ringsweep.quantities.flags import OSCILLATORY, RESTING, REVOLVING

EPSILON = 1e-3


def outcome(phi, omega, status=COMPLETE, normal_1=1.0, normal_2=1.0, stuck_for=0.0):
    """Outcome of a run through the states `phi` and `omega`."""
    record = record_at_launch((phi[0], omega[0], normal_1, normal_2, ()), EPSILON)
    for x, w in zip(phi[1:], omega[1:], strict=True):
        record = record_after(record, (), stuck_for, (x, w, normal_1, normal_2, ()), EPSILON)
    return outcome_of(record, status, float(len(phi) - 1), phi[-1], omega[-1])


def path(*angles, speed=1.0):
    """Angles and angular velocities of a body that moves from angle to angle at constant speed."""
    phi, omega = [angles[0]], [0.0]
    for start, end in pairwise(angles):
        leg = np.linspace(start, end, 50)[1:]
        phi.extend(leg)
        omega.extend(np.full(len(leg), speed if end > start else -speed))
    return phi, omega


class TestMotion:
    @pytest.mark.parametrize(
        ("angles", "motion", "reversals", "turns"),
        [
            ((0.0, 0.0), RESTING, 0, 0),
            ((0.0, 1.0), RESTING, 0, 0),
            ((0.0, 1.0, 0.0), OSCILLATORY, 1, 0),
            ((0.0, 1.0, -1.0, 1.0), OSCILLATORY, 2, 0),
            ((0.0, 2 * pi - 0.01), RESTING, 0, 0),
            ((0.0, 2 * pi + 0.01), REVOLVING, 0, 1),
            ((0.0, -2 * pi - 0.01), REVOLVING, 0, 1),
            ((1.0, 1.0 + 6.5 * pi), REVOLVING, 0, 3),
            # Full turns before the last reversal do not count.
            ((0.0, 8.0, 7.0), OSCILLATORY, 1, 0),
            ((0.0, 8.0, 1.0), REVOLVING, 1, 1),
            ((0.0, 3.0, -3.0, 3.0), OSCILLATORY, 2, 0),
            ((0.0, 3.0, -3.5), REVOLVING, 1, 1),
            ((0.0, -1.0, 12.0), REVOLVING, 1, 2),
        ],
    )
    def test_motion_along_a_path_is_named(self, angles, motion, reversals, turns):
        for mirror in (1, -1):
            found = outcome(*path(*(mirror * angle for angle in angles)))
            assert (found.regime, found.motion, found.reversals, found.turns) == (motion, motion, reversals, turns)

    def test_full_turn_is_measured_from_the_turning_point(self):
        """The velocity passes the threshold a little after the turning point; the turn is counted from the point."""
        phi = [0.0, 3.0, 3.1, 3.0, 3.1 - 2 * pi - 0.01]
        omega = [0.0, 1.0, 0.5 * EPSILON, -1.0, -1.0]
        assert outcome(phi, omega).motion == REVOLVING


class TestReversals:
    @given(st.lists(st.floats(-3 * EPSILON, 3 * EPSILON), min_size=1, max_size=50))
    def test_reversals_are_changes_of_sign_beyond_the_threshold(self, omega):
        signs = [np.sign(w) for w in omega if abs(w) > EPSILON]
        assert outcome(np.zeros(len(omega)), omega).reversals == sum(a != b for a, b in pairwise(signs))
