"""The default method: its certificate, and parameters at the ends of their ranges."""

from math import acos, sqrt

import numpy as np
import pytest
from conftest import RIG
from scipy.special import ellipk
from solutions import Fall, solve

from ringsweep.compile import take
from ringsweep.models.ring.record import Outcome
from ringsweep.quantities.flags import COARSE, FAILED, NO_RESULT, NOT_ASKED, OSCILLATORY, REVOLVING, SEPARATING
from ringsweep.solvers.automaton import PATIENCE
from ringsweep.solvers.certificate import with_errors
from ringsweep.solvers.event import Auto, Event, Implicit
from ringsweep.solvers.rk4 import RK4

KINDS = ("regime", "motion", "separating_contact")
COEFFICIENTS = [f"friction.{place}.{name}" for place in ("rough", "rest") for name in ("mu_s", "mu_k")]
BETA = float(np.arcsin(0.025 / 0.033378))


def kinds(found):
    return np.array([getattr(found, name) for name in KINDS])


@pytest.fixture(params=["stiction", "bengisu-akay"])
def law(request):
    return request.param


@pytest.fixture
def scenes(cells, law):
    """Batch under a set-valued or a smooth law; the ring is at rest unless it is driven."""

    def build(changes, drive="arctan", **more):
        return cells({"time.span": 3.0} | changes, law=law, drive=drive, **more)

    return build


class TestChoice:
    def test_auto_runs_each_law_by_the_method_that_takes_it(self, cells):
        changes = {"drive.amplitude": 2.0, "time.span": 3.0}
        for law, method in (("stiction", Event()), ("tustin", Event()), ("bengisu-akay", Implicit())):
            scene = cells(changes, law=law, drive="arctan")
            auto, direct = solve(Auto(), scene), solve(method, scene)
            np.testing.assert_array_equal(auto.rows, direct.rows)
            np.testing.assert_array_equal(auto.steps, direct.steps)


class TestCertificate:
    """A cell is certified if two resolutions agree on the regime; if not, it is run again at tighter tolerances."""

    def test_wrong_runs_of_rk4_that_agree_have_no_certificate(self, figure, cells):
        """Fig. 29: steps of 2 ms, 1 ms, 0.1 ms and 0.05 ms agree on the wrong regime."""
        drive, changes, _ = figure(29)
        scene = cells(changes, drive=drive)
        for steps in (5000, 100_000):
            fixed = solve(RK4(steps), scene)
            assert fixed.regime == fixed.motion == OSCILLATORY
            assert not fixed.certified
            assert fixed.because == COARSE
        found = solve(Auto(), scene)
        assert (found.regime, found.separating_contact) == (SEPARATING, 2)
        assert found.certified

    def test_no_certificate_is_given_with_certify_false(self, scenes):
        found = solve(Auto(certify=False), scenes({"drive.amplitude": np.array([2.0, 5.0])}))
        assert not found.certified.any()
        assert (found.because == NOT_ASKED).all()

    def test_run_that_reaches_max_steps_is_failed_without_certificate(self, scenes, law):
        method = Event(max_steps=10) if law == "stiction" else Implicit(max_steps=10)
        found = solve(method, scenes({"drive.amplitude": np.array([2.0, 5.0])}))
        np.testing.assert_array_equal(found.regime, FAILED)
        np.testing.assert_array_equal(found.motion, FAILED)
        # All runs of a cell together take so many.
        assert (found.steps <= 10).all()
        assert not found.certified.any()
        assert (found.because == NO_RESULT).all()

    @pytest.mark.parametrize(
        "path", ["initial.omega", "initial.phi", "drive.amplitude", "zone.half_angle", "body.mass", "time.span"]
    )
    def test_run_with_a_nan_parameter_is_failed_without_certificate(self, scenes, law, path):
        method = Event(max_steps=2000) if law == "stiction" else Implicit(max_steps=2000)
        good = {"drive.amplitude": 2.0, **{path: np.array([np.nan, 1.0])}}
        found = solve(method, scenes(good))
        np.testing.assert_array_equal(found.regime == FAILED, [True, False])
        np.testing.assert_array_equal(found.certified, [False, True])

    def test_run_with_a_launch_that_is_not_finite_fails_after_few_steps(self, scenes, law):
        method = Event(max_steps=5000) if law == "stiction" else Implicit(max_steps=5000)
        found = solve(method, scenes({"initial.omega": np.array([np.nan, np.inf, 1e200, 1e20])}))
        np.testing.assert_array_equal(found.regime, FAILED)
        assert found.steps.max() < 1000


class TestSurface:
    """Zones at the ends of their ranges."""

    @pytest.mark.parametrize("contact", [-1, 1])
    @pytest.mark.parametrize("end", [-1, 1])
    def test_contact_exactly_on_an_edge_behaves_as_on_one_of_its_sides(self, scenes, contact, end):
        """The run equals one of the runs with the edge shifted by 1e-9 rad to either side."""
        center = contact * BETA + end * RIG["zone.half_angle"]
        drives = {"drive.amplitude": np.array([2.0, -2.0, 0.0, 0.0, 0.0]), "time.span": 0.6}
        launch = {"initial.omega": np.array([0.0, 0.0, 10.0, -10.0, 0.0])}
        below, on, above = (
            solve(Auto(), scenes(drives | launch | {"zone.center": center + shift})) for shift in (-1e-9, 0.0, 1e-9)
        )
        # Rounding decides which side of an edge holds a body at rest, so that such a run has no certificate.
        assert on.certified[2:4].all()
        for i in range(5):
            assert min(abs(on.phi_end[i] - side.phi_end[i]) for side in (below, above)) < 1e-7
            assert min(abs(on.omega_end[i] - side.omega_end[i]) for side in (below, above)) < 1e-6


class TestBody:
    @pytest.mark.parametrize("half_distance", [1e-4, 1e-2, 0.0333, 0.033377])
    def test_bodies_with_extreme_distance_of_contacts_agree_with_closed_forms(self, cells, half_distance):
        """The angle beta goes from 0.2 deg to 89.6 deg."""
        omega = np.array([0.5, 5.0, -5.0, 30.0, 80.0])
        changes = {"body.half_distance": half_distance, "initial.omega": omega, "time.span": 50.0}
        scene = cells(changes | {"drive.amplitude": 0.0, "zone.center": 0.5}, law="stiction", drive="arctan")
        found = solve(Event(rtol=1e-12), scene)
        for i in range(len(omega)):
            fall = Fall(take(scene.body, i), 0.5, RIG["zone.half_angle"], (0.5, 0.3), (0.2, 0.1))
            phi, contact, _ = fall.run(0.0, omega[i])
            assert found.separating_contact[i] == contact
            assert found.phi_end[i] == pytest.approx(phi, abs=1e-9)

    def test_body_without_friction_is_a_pendulum(self, scenes, law):
        """Energy and the complete elliptic integral give amplitude and period, for any motion of the ring."""
        omega = np.array([0.5, 5.0, -8.0, 100.0])
        scene = scenes(
            dict.fromkeys(COEFFICIENTS, 0.0) | {"initial.omega": omega, "drive.amplitude": 2.0, "time.span": 10.0}
        )
        body = take(scene.body, 0)
        inertia, weight = body.inertia + body.mass * body.xi**2, body.mass * body.gravity * body.xi
        found = solve(Auto(), scene)
        for i in range(len(omega)):
            cosine = 1 - inertia * omega[i] ** 2 / (2 * weight)
            if cosine < -1:
                assert found.regime[i] == REVOLVING
                continue
            period = 4 * sqrt(inertia / weight) * ellipk((1 - cosine) / 2)
            assert found.regime[i] == OSCILLATORY
            assert found.phi_max[i] == pytest.approx(acos(cosine), abs=1e-7)
            assert found.phi_min[i] == pytest.approx(-acos(cosine), abs=1e-7)
            assert found.reversals[i] == int(10.0 / period * 2 + 0.5)
        assert found.certified.all()


class TestTime:
    def test_run_that_would_not_end_within_its_steps_is_given_up_early(self, cells):
        found = solve(Auto(), cells({"drive.amplitude": 0.7, "time.span": 1e8}, drive="arctan"))
        assert (found.regime, found.certified) == (FAILED, 0)
        assert found.steps == PATIENCE

    @pytest.mark.slow
    def test_velocity_bound_under_infinite_acceleration_is_true_and_small(self, cells):
        """Its first steps last 1e-14 s. An error of the place, divided by that time, would bound nothing."""
        exponent = np.array([1.3, 1.75, 1.95, 2.27])
        changes = {"drive.amplitude": 0.5, "drive.exponent": exponent, "time.span": 0.6}
        rough = {f"friction.{place}.mu_s": 1.2 for place in ("rough", "rest")}
        scene = cells(changes | rough, law="stiction", drive="power")
        found, exact = solve(Auto(), scene), solve(Event(rtol=1e-13, certify=False), scene)
        assert found.certified.all()
        assert (found.stick_time > 0.0).all()
        for name in ("omega_end", "omega_max"):
            stated = found.errors[:, with_errors(Outcome._fields).index(name)]
            assert (abs(getattr(found, name) - getattr(exact, name)) <= stated).all()
            assert (stated < 1e-6).all()

    def test_contact_that_rising_friction_unloads_is_lost_before_a_jam(self, cells):
        """Under infinite acceleration friction rises from 0 to its value at the first instant in no time.

        With omega = 0 and friction mu at both contacts, the reaction at contact 1 falls to 0 at mu = 0.578. The body
        could go on on contact 2 up to mu = 0.715, where more reaction no longer opens its gap. At 0.74 nothing goes on.
        """
        body = {"mass": 0.193839, "inertia": 5.70525e-06, "half_distance": 0.0126812, "ball_radius": 0.0063635}
        changes = {f"body.{name}": value for name, value in (body | {"center_offset": -0.00715644}).items()}
        changes |= {"ring.radius": 0.0427676, "friction.v0": 7.59278e-07, "initial.phi": -0.312087}
        changes |= {f"friction.{place}.{name}": 0.75479 for place in ("rough", "rest") for name in ("mu_s", "mu_k")}
        changes |= {"drive.amplitude": np.array([-0.622284]), "drive.exponent": 1.33794}
        found = solve(Auto(), cells(changes, drive="power"))
        assert (found.regime[0], found.separating_contact[0]) == (SEPARATING, 1)
        assert found.t_separation[0] < 1e-12
