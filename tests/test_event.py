"""Set-valued laws with located events, against closed forms, tighter tolerances and limits."""

from math import cos, sin

import numpy as np
import pytest
from solutions import Fall, motion, solve, trail
from tiers import mostly_slow

from ringsweep.compile import take
from ringsweep.quantities.flags import JAMMED, OSCILLATORY, RESTING, REVOLVING
from ringsweep.solvers.event import Event

EXACT = Event(rtol=1e-14, certify=False)


@pytest.fixture
def stiction(cells):
    """Batch with set-valued friction; without an amplitude of the drive the ring is at rest."""

    def build(changes, drive="arctan", law="stiction", **more):
        return cells(dict(changes), law=law, drive=drive, **more)

    return build


class TestFigures:
    """Figure 30 of the paper in the limit of a vanishing stiction band."""

    def test_error_of_event_falls_with_the_tolerance(self, setting):
        batch = setting(30, "tustin")
        exact = solve(EXACT, batch).t_end
        tolerances = 10.0 ** -np.arange(6, 13)
        errors = [abs(solve(Event(rtol=rtol, certify=False), batch).t_end - exact)[0] for rtol in tolerances]
        assert np.polyfit(np.log(tolerances), np.log(errors), 1)[0] == pytest.approx(0.85, abs=0.15)
        assert errors[-1] < 1e-10


class TestClosedForms:
    """On a ring at rest the places of edges, and the orbits between them, are known in closed form."""

    @pytest.mark.parametrize("model", mostly_slow(["ring", "ring-single-contact"], ["ring"]))
    def test_launches_into_rough_arcs_agree_with_closed_forms(self, stiction, model):
        rng = np.random.default_rng(3)
        n = 60
        omega = rng.uniform(5, 60, n) * rng.choice([-1, 1], n)
        center, half_angle = rng.uniform(-3, 3, n), rng.uniform(0.05, 3, n)
        rough_k, rest_k = rng.uniform(0.0, 0.2, (2, n)) * rng.choice([0.1, 1.0], n)
        rough_s, rest_s = rough_k + rng.uniform(0, 0.1, n), rest_k + rng.uniform(0, 0.1, n)
        batch = stiction(
            {
                "initial.omega": omega,
                "zone.center": center,
                "zone.half_angle": half_angle,
                "friction.rough.mu_s": rough_s,
                "friction.rough.mu_k": rough_k,
                "friction.rest.mu_s": rest_s,
                "friction.rest.mu_k": rest_k,
                "time.span": 40.0,
            },
            model=model,
        )
        found = solve(Event(rtol=1e-12), batch)
        for i in range(n):
            rough, rest = (rough_s[i], rough_k[i]), (rest_s[i], rest_k[i])
            fall = Fall(take(batch.body, i), center[i], half_angle[i], rough, rest)
            phi, contact, t = fall.run(0.0, omega[i])
            assert found.separating_contact[i] == contact
            assert found.phi_end[i] == pytest.approx(phi, abs=1e-10)
            assert found.t_end[i] - found.stick_time[i] == pytest.approx(t, abs=1e-10)
        assert set(found.separating_contact) == ({0, 1, 2} if model == "ring" else {0, 1})
        assert {RESTING, OSCILLATORY, REVOLVING} <= set(found.motion)
        assert found.reversals.max() >= 3


class TestStick:
    """In stick the body moves with the ring, and the balances of momentum give the friction."""

    @pytest.fixture
    def run(self, setting):
        batch = setting(29, "stiction")
        return take(batch, 0), trail(Event(), batch, 1e-3)

    def test_stuck_body_moves_with_the_ring(self, run):
        _, run = run
        stuck = run.mode == 0
        assert 0.3 < stuck.mean() < 0.9
        np.testing.assert_allclose(run.omega[stuck], run.ring_omega[stuck], rtol=1e-8)
        np.testing.assert_allclose(run.epsilon[stuck], 2 / (1 + run.t[stuck] ** 2), rtol=1e-7)

    def test_friction_in_stick_stays_in_its_bounds_and_reaches_one_at_the_end(self, run):
        scene, run = run
        body = scene.body
        needed = (
            (body.inertia + body.mass * body.xi**2) * run.epsilon + body.mass * body.gravity * body.xi * np.sin(run.phi)
        ) / body.radius
        mu = np.array([0.2, 0.5])
        available = mu[run.zone_1.astype(int)] * run.normal_1 + mu[run.zone_2.astype(int)] * run.normal_2
        kappa = needed / available
        stuck = run.mode == 0
        assert (np.abs(kappa[stuck]) <= 1 + 1e-12).all()
        ends = np.flatnonzero(stuck[:-1] & ~stuck[1:])
        assert len(ends) >= 5
        np.testing.assert_allclose(np.abs(kappa[ends]), 1.0, atol=1e-9)
        # At both contacts friction is the same share of its bound.
        for k in np.flatnonzero(stuck)[::100]:
            K1, K2 = kappa[k] * mu[int(run.zone_1[k])], kappa[k] * mu[int(run.zone_2[k])]
            place = np.array([run.omega[k] ** 2, cos(run.phi[k]), sin(run.phi[k])])
            expected = motion(body, K1, K2) @ place
            np.testing.assert_allclose([run.epsilon[k], run.normal_1[k], run.normal_2[k]], expected, rtol=1e-9)


class TestEnds:
    def test_launch_jams_where_the_determinant_of_the_balances_is_not_positive(self, stiction):
        body = take(stiction({}).body, 0)
        about_axis = (body.inertia / body.mass + body.xi**2) * body.cos_beta
        limit = np.sqrt(about_axis / (body.radius * body.xi - about_axis))
        mu = limit * np.array([0.999, 1.001])
        paths = [f"friction.{place}.{name}" for place in ("rough", "rest") for name in ("mu_s", "mu_k")]
        found = solve(Event(), stiction(dict.fromkeys(paths, mu) | {"initial.omega": 10.0, "time.span": 1e-6}))
        np.testing.assert_array_equal(found.regime == JAMMED, [False, True])
        np.testing.assert_array_equal(found.t_end == 0.0, [False, True])

    def test_body_jams_where_a_contact_reaches_a_rough_arc(self, stiction):
        rough = {"friction.rough.mu_s": 3.0, "friction.rough.mu_k": 3.0}
        batch = stiction(rough | {"zone.center": 1.5, "initial.omega": 30.0})
        found = solve(Event(), batch)
        assert found.regime == JAMMED
        assert found.motion == RESTING
        assert found.phi_end == pytest.approx(1.5 - np.radians(15.0) - take(batch.body, 0).beta, abs=1e-13)
