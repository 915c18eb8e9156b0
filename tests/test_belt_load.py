"""The belt whose normal load grows with the displacement, N = m g + k_n x, against closed forms."""

from math import acos, atan2, pi, sqrt

import numpy as np
import pytest
from belts import on_belt, outcome

import ringsweep
from ringsweep.quantities.flags import REGIMES

pytestmark = pytest.mark.slow

M, K, G = 1.3, 20.0, 9.81
SMALL_STEPS = {"method": "rk4", "steps": 40_000}


def scene(law="stiction", *, growth=8.0, v_b=0.1, start=None, span=20.0, **friction):
    """Scene on a belt; `start` is displacement and velocity, by default at rest on the belt."""
    friction = {"law": law, "mu_s": 0.4, "mu_k": 0.25, **friction}
    found = on_belt(friction, K, velocity=v_b, start=start or (0.0, v_b), span=span)
    return found | {"body": {"mass": M, "normal_stiffness": growth}}


def word(found):
    return REGIMES[int(found.regime)]


class TestStickSlip:
    @pytest.mark.parametrize("growth", [8.0, -8.0])
    def test_cycle_is_that_of_a_spring_that_friction_softens(self, growth):
        """While the belt leads, friction is mu (m g + k_n x): the spring has the stiffness k - mu k_n."""
        mu_s, mu_k, v_b = 0.4, 0.25, 0.1
        breaks, centre = (mu * M * G / (K - mu * growth) for mu in (mu_s, mu_k))
        omega = sqrt((K - mu_k * growth) / M)
        slip = 2.0 / omega * (pi - atan2((breaks - centre) * omega, v_b))
        found = outcome(scene(growth=growth, v_b=v_b, span=80.0))
        assert word(found) == "stick-slip"
        assert found.certified == 1
        assert float(found.first_slip) == pytest.approx(breaks / v_b, rel=1e-10)
        assert float(found.period) == pytest.approx(2.0 * (breaks - centre) / v_b + slip, rel=1e-9)
        assert float(found.force_max) == pytest.approx(mu_s * (M * G + growth * breaks), rel=1e-10)

    def test_map_over_the_growth_of_the_load_is_that_of_theory(self):
        """Where friction grows faster than the spring the body rides for ever; just below it slips off the belt."""
        mu_s, mu_k, v_b = 0.4, 0.25, 0.1
        growth = K / mu_s * np.array([-1.0, 0.5, 0.7, 0.9, 1.01, 2.0])
        breaks, centre = (mu * M * G / (K - mu * growth) for mu in (mu_s, mu_k))
        farthest = centre - np.hypot(breaks - centre, v_b / np.sqrt(np.abs(K - mu_k * growth) / M))
        leaves = M * G + growth * farthest < 0.0
        expected = np.where(mu_s * growth > K, "riding", np.where(leaves, "separating", "stick-slip"))
        assert set(expected) == {"riding", "separating", "stick-slip"}
        found = ringsweep.sweep(scene(span=200.0), {"body.normal_stiffness": growth}, progress=False)
        assert [REGIMES[int(regime)] for regime in found.regime] == expected.tolist()
        assert (found.certified == 1).all()

    def test_touch_of_the_bound_depends_on_the_rates_of_both(self):
        """On a belt at rest the bound does not move: a body that a spring holds with all friction stays."""
        start = (0.4 * M * G / (K - 0.4 * 8.0), 0.0)
        found = outcome(scene(v_b=0.0, start=start, span=5.0))
        assert word(found) == "riding"
        assert float(found.x_end) == start[0]


class TestSeparation:
    START = 0.3, -8.0

    def leaves(self, growth=8.0):
        """Time at which the load vanishes, and the velocity there, while the body slides against a fast belt.

        Friction is -mu (m g + k_n x): a spring of stiffness k + mu k_n about -mu m g / (k + mu k_n).
        """
        mu, (x, velocity) = 0.25, self.START
        stiffness = K + mu * growth
        omega, centre = sqrt(stiffness / M), -mu * M * G / stiffness
        size, phase = np.hypot(x - centre, velocity / omega), atan2(-velocity / omega, x - centre)
        at = acos((-M * G / growth - centre) / size)
        return (at - phase) / omega, -size * omega * np.sin(at)

    @pytest.mark.parametrize(
        ("law", "solver", "precision"),
        [
            ({"law": "stiction"}, None, 1e-11),
            ({"law": "bengisu-akay", "alpha": 1e9, "v0": 1e-6}, {"method": "implicit"}, 1e-6),
            ({"law": "bengisu-akay", "alpha": 1e9, "v0": 1e-6}, SMALL_STEPS, 1e-6),
        ],
    )
    def test_run_ends_where_the_load_vanishes(self, law, solver, precision):
        expected, velocity = self.leaves()
        found = outcome(scene(**law, v_b=-50.0, start=self.START, span=2.0), solver)
        assert word(found) == "separating"
        assert REGIMES[int(found.motion)] == "sliding"
        assert float(found.t_end) == pytest.approx(expected, rel=precision)
        assert float(found.x_end) == pytest.approx(-M * G / 8.0, rel=precision)
        assert float(found.velocity_end) == pytest.approx(velocity, rel=1e-3 if precision > 1e-9 else precision)
        if solver is None:
            assert found.certified == 1

    @pytest.mark.parametrize("start", [None, (0.0, 0.5), (0.0, 0.05)])
    @pytest.mark.parametrize(
        ("law", "growth"),
        [
            ({"law": "stiction"}, 8.0),
            ({"law": "stiction"}, 80.0),
            ({"law": "bengisu-akay", "v0": 1e-3, "alpha": 9}, 8.0),
        ],
    )
    def test_body_whose_load_grows_from_nothing_goes_on_as_one_with_a_little(self, law, growth, start):
        """Without gravity the load is k_n x: with the launch at x = 0 it begins at zero."""
        first, second = (
            outcome(scene(**law, growth=growth, start=start and (x, start[1]), span=0.5) | {"gravity": 0.0})
            for x in (0.0, 1e-9)
        )
        assert first.certified == 1
        assert word(first) == word(second) != "separating"
        for name in ("x_end", "velocity_end", "force_max", "stick_time"):
            assert float(first[name]) == pytest.approx(float(second[name]), rel=1e-6, abs=1e-9)

    @pytest.mark.parametrize(("v_b", "velocity"), [(0.1, -0.5), (-0.1, -0.1), (0.0, 0.0)])
    def test_body_whose_load_does_not_grow_from_nothing_separates_at_once(self, v_b, velocity):
        found = outcome(scene(v_b=v_b, start=(0.0, velocity)) | {"gravity": 0.0})
        assert word(found) == "separating"
        assert float(found.t_end) == 0.0

    def test_bristles_bear_a_load_that_grows_from_nothing(self):
        start = (-1.25, 0.5)
        found = scene("dahl", start=start, span=0.5) | {"gravity": 10.0, "body": {"mass": 1.0, "normal_stiffness": 8.0}}
        found["friction"] = {"law": "dahl", "mu_k": 0.25, "sigma0": 300.0}
        assert word(outcome(found)) != "separating"
        assert word(outcome(found | {"initial": {"x": -1.25, "velocity": -0.5}})) == "separating"

    def test_swing_that_nearly_leaves_the_belt_is_not_certified(self):
        """The load at the turn is smaller than what the two runs can tell apart, or the run separates there."""
        mu, growth = 0.25, 8.0
        stiffness = K + mu * growth
        centre = -mu * M * G / stiffness
        far = 2.0 * centre + M * G / growth
        held, lost = (
            outcome(scene(v_b=-50.0, start=(far + shift, 0.0), span=0.9 * 2 * pi * sqrt(M / stiffness)))
            for shift in (-1e-3, 1e-3)
        )
        assert word(held) != "separating"
        assert word(lost) == "separating"
        grazing = outcome(scene(v_b=-50.0, start=(far, 0.0), span=0.9 * 2 * pi * sqrt(M / stiffness)))
        assert (held.certified, lost.certified, grazing.certified) == (1, 1, 0)
