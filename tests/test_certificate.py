"""What a certificate vouches for, on scenes where two resolutions agree and both are wrong, or nearly so."""

from typing import ClassVar

import numpy as np
import pytest
from solutions import HISTORY, solve

import ringsweep
from ringsweep.compile import take
from ringsweep.models import MODELS
from ringsweep.models.interface import audit, implicit, modes
from ringsweep.quantities.variables import FAILED, JAMMED, RESTING, SEPARATING
from ringsweep.solvers import automaton, event
from ringsweep.solvers.certificate import with_errors
from ringsweep.solvers.event import Auto, Event, Implicit
from ringsweep.solvers.rk4 import RK4

NAMES = MODELS["ring"].outcomes
COEFFICIENTS = [f"friction.{place}.{name}" for place in ("rough", "rest") for name in ("mu_s", "mu_k")]


@pytest.fixture
def rocking(cells):
    """A body that creeps with a rocking ring; how far that goes decides whether a contact is lost on the way."""

    def build(amplitude, law="bengisu-akay"):
        values = dict.fromkeys(COEFFICIENTS, 0.5) | {
            "zone.half_angle": 0.0,
            "drive.amplitude": amplitude,
            "drive.frequency": 2.2831,
            "drive.phase": np.pi / 2,
            "time.span": 0.438,
        }
        own = {"friction.alpha": 0.0, "friction.v0": 1e-5} if law == "bengisu-akay" else {}
        return cells(values | own, law=law, drive="sinusoidal")

    return build


class TestDips:
    """A reaction that vanishes for a moment, between two instants at which a solver looks."""

    def test_in_a_creep_are_seen(self, rocking):
        found = solve(Auto(), rocking(0.6017))
        assert (found.regime, found.separating_contact, found.certified) == (SEPARATING, 1, 1)
        assert found.t_separation == pytest.approx(0.21415, abs=1e-5)

    def test_are_those_of_the_law_that_sticks(self, rocking):
        """From amplitudes that leave the contact closed to such as open it for long."""
        amplitude = np.linspace(0.55, 0.65, 101)
        smooth, limit = (solve(Auto(), rocking(amplitude, law)) for law in ("bengisu-akay", "stiction"))
        certain = (smooth.certified == 1) & (limit.certified == 1)
        # The rounded law is not that of the limit: just at the boundary they may differ.
        differ = certain & (smooth.regime != limit.regime)
        assert certain.mean() > 0.95
        assert differ.sum() <= 1
        assert 10 < (smooth.regime == SEPARATING).sum() < 91

    def test_between_the_steps_of_rk4_leave_it_without_a_certificate(self, cells):
        """Contact 2 holds by 2e-5 N at one launch, and is lost at the next: rk4 is not to know which."""
        values = {"drive.amplitude": 2.0, "friction.v0": 0.2, "friction.alpha": 100.0, "time.span": 3.0}
        edge = 20.516495473
        omega = edge + np.array([-1e-2, -1e-3, -1e-4, -1e-5, 1e-5, 1e-4, 1e-3, 1e-2])
        batch = cells(values | {"initial.omega": omega}, drive="arctan")
        truth = solve(Implicit(), batch)
        assert truth.certified.all()
        np.testing.assert_array_equal(truth.regime == SEPARATING, omega > edge)
        for steps in (500, 1000, 2000, 4000, 5000, 10_000, 20_000):
            found = solve(RK4(steps), batch)
            wrong = (found.regime != truth.regime) | (found.motion != truth.motion)
            assert not (found.certified[wrong] == 1).any()


class TestContactProblem:
    def test_a_body_that_simply_sticks_rests(self, cells):
        """At the bottom, with a rough arc under one contact: what it does not meet, friction at mu_s, jams nothing."""
        found = solve(
            Auto(),
            cells(
                {
                    "body.inertia": 5e-6,
                    "body.half_distance": 0.010,
                    "body.ball_radius": 0.005,
                    "ring.radius": 0.065,
                    "zone.half_angle": np.radians(30),
                    "zone.center": np.radians(30),
                    **dict(zip(COEFFICIENTS, (0.55, 0.3, 0.1, 0.08), strict=True)),
                    "time.span": 5.0,
                },
                law="stiction",
                drive="arctan",
            ),
        )
        assert (found.regime, found.certified, found.stick_time) == (RESTING, 1, 5.0)

    def test_a_slip_whose_contact_would_have_to_pull_is_not_taken(self, cells):
        """Half-way up, stick is the only mode: a saturation of 0.465, both reactions positive."""
        found = solve(
            Auto(),
            cells(
                {
                    "body.mass": 0.15,
                    "body.inertia": 8e-5,
                    "body.half_distance": 0.036,
                    "ring.radius": 0.050,
                    "initial.phi": 1.34,
                    "zone.half_angle": 0.0,
                    **dict.fromkeys(COEFFICIENTS, 0.66),
                    "time.span": 2.0,
                },
                law="stiction",
                drive="arctan",
            ),
        )
        assert (found.regime, found.certified) == (RESTING, 1)
        assert found.normal_min_1 == pytest.approx(1.489, abs=1e-3)
        assert found.normal_min_2 == pytest.approx(0.139, abs=1e-3)

    @pytest.mark.parametrize("law", ["stiction", "bengisu-akay"])
    def test_both_contacts_may_leave_at_once(self, cells, law):
        """At the top of a ring at rest: the mirror image of the run is the run."""
        found = solve(Auto(), cells({"initial.phi": np.array([np.pi, 2.9, -2.9])}, law=law, drive="arctan"))
        np.testing.assert_array_equal(found.regime, SEPARATING)
        assert found.separating_contact[0] == 3
        assert found.separating_contact[1] == {1: 2, 2: 1, 3: 3}[int(found.separating_contact[2])]
        assert found.normal_min_1[0] == found.normal_min_2[0] == 0.0

    @pytest.mark.parametrize("amplitude", [0.0, 2.0])
    def test_without_a_load_there_is_no_contact(self, cells, amplitude):
        """Nothing jams that nothing presses together."""
        found = solve(Auto(), cells({"gravity": 0.0, "drive.amplitude": amplitude}, law="stiction", drive="arctan"))
        assert (found.regime, found.separating_contact, found.t_end) == (SEPARATING, 3, 0.0)

    def test_a_contact_on_an_edge_is_on_either_side_of_it(self, cells):
        """With contact 1 just where an icy arc begins: held by the rest as it would slide there, as in the mirror.

        But which side of an edge holds a body at rest is rounding, and nothing to certify.
        """
        edge = 0.546545997641859
        values = dict(zip(COEFFICIENTS, (0.1, 0.1, 0.8, 0.6), strict=True)) | {"zone.half_angle": 0.3}
        values |= {"initial.phi": np.array([edge, edge - 1e-12, -edge]), "drive.amplitude": np.array([2.0, 2.0, -2.0])}
        found = solve(Auto(), cells(values, law="stiction", drive="arctan"))
        np.testing.assert_array_equal(found.regime, SEPARATING)
        np.testing.assert_array_equal(found.separating_contact, [2, 2, 1])
        np.testing.assert_allclose(found.t_separation, 0.969176928911, atol=1e-10)
        assert not found.certified[[0, 2]].any()


class TestLaunch:
    """What a body is at launch does not depend on how its speed, or that of the ring, is rounded."""

    @staticmethod
    def bristles(batch):
        _, state = modes.initial_state(take(batch, 0))
        return state[2:]

    LUGRE: ClassVar = {"friction.sigma0": 1e3, "friction.v_s": 1e-3, "drive.amplitude": 0.3}

    def test_bristles_of_a_body_at_rest_are_not_bent(self, cells):
        """Under a drive that has not yet begun to move, but moves an instant later."""
        batch = cells(self.LUGRE | {"drive.exponent": 3.0}, law="lugre", drive="power")
        assert self.bristles(batch) == (0.0, 0.0)

    @pytest.mark.parametrize("rounding", [-3e-16, 0.0, 3e-16])
    def test_nor_those_of_a_body_launched_at_the_speed_of_the_ring(self, cells, rounding):
        speed = 0.3 * 2 * np.pi * 1.7 * np.cos(0.4)
        rocking = {"drive.frequency": 1.7, "drive.phase": 0.4, "initial.omega": speed * (1.0 + rounding)}
        assert self.bristles(cells(self.LUGRE | rocking, law="lugre", drive="sinusoidal")) == (0.0, 0.0)

    def test_nor_those_of_a_body_at_rest_on_a_ring_that_turns_back(self, cells):
        """Its speed there is the rounding of a cosine."""
        rocking = {"drive.frequency": 0.9, "drive.phase": np.pi / 2}
        assert self.bristles(cells(self.LUGRE | rocking, law="lugre", drive="sinusoidal")) == (0.0, 0.0)

    def test_a_body_at_rest_stays_at_rest_until_the_drive_moves_it(self, cells):
        """But one whose drive begins with an infinite acceleration is left behind at once."""
        for exponent, law in ((3.0, "stiction"), (1.5, "stiction")):
            scene = take(cells({"drive.amplitude": 0.3, "drive.exponent": exponent}, law=law, drive="power"), 0)
            _, (_, v) = modes.initial_state(scene)
            assert (v < 0.0) == (exponent < 2.0)

    def test_a_drive_that_begins_with_an_infinite_acceleration_leaves_the_body_behind(self, cells):
        """No friction keeps up with it: the body lags from the first instant, though its lag is below the tolerance."""
        rng = np.random.default_rng(5)
        count = 60
        values = {
            "drive.amplitude": 10 ** rng.uniform(-2, 1, count),
            "drive.exponent": rng.uniform(1.5, 1.99, count),
            "friction.v0": 10 ** rng.uniform(-9, -2, count),
            "time.span": 0.3,
        }
        batch = cells(values, drive="power")
        omega, ring_omega = HISTORY.index("omega"), HISTORY.index("ring_omega")
        for i in range(count):
            times, rows = Implicit().history(take(batch, [i]), 50, len(HISTORY))
            early = rows[times < 1e-8]
            assert len(early) > 10
            assert (early[:, omega] < early[:, ring_omega]).all()


class TestNumbers:
    def test_without_a_number_where_one_must_be_nothing_is_certified(self, cells):
        found = solve(Auto(), cells({"gravity": np.array([8e211, 9.81])}, law="stiction", drive="arctan"))
        np.testing.assert_array_equal(found.certified, [0, 1])
        assert found.regime[0] == FAILED

    def test_the_limit_of_work_is_that_of_all_tries(self, cells):
        batch = cells({"drive.amplitude": 2.0, "time.span": 10.0}, law="stiction", drive="arctan")
        limit = 10
        found = solve(Event(max_steps=limit), batch)
        assert (found.regime, found.certified) == (FAILED, 0)
        assert found.steps <= limit


class TestLaw:
    """A certificate asks for a witness that shares nothing with the solver: the law itself, where it did not look."""

    def scene(self, cells, law):
        values = {"drive.amplitude": np.linspace(0.5, 8.0, 40), "time.span": 3.0}
        return cells(values, law=law, drive="arctan")

    @pytest.mark.parametrize("law", ["stiction", "bengisu-akay"])
    def test_is_obeyed_to_the_tolerance_by_what_is_certified(self, cells, law):
        method = Event() if law == "stiction" else Implicit()
        batch = self.scene(cells, law)
        _, _, shown = method.integrate(batch, len(NAMES), audit=True)
        assert shown[:, 0].max() < 0.2 * event._BREACH
        assert shown[:, 1].max() < 0.2 * event._ENERGY

    @pytest.mark.parametrize("law", ["stiction", "bengisu-akay"])
    def test_knows_by_itself_where_the_arcs_are(self, cells, law):
        """A mode that names another segment than the one under the contact is found out, whatever else is right."""
        scene = take(self.scene(cells, law), 0)
        t, y = modes.initial_state(scene)
        _, mode = modes.initial_mode(scene, t, y)
        force = implicit.forcing(scene, 0.0)

        def breach(mode):
            return audit.violation(scene, mode, force, y, (0.0, 0.0), 0.1, 1e-10)[0]

        segment, turn = mode.place_1
        assert np.isfinite(breach(mode))
        assert np.isinf(breach(mode._replace(place_1=(1 - segment, turn))))

    def test_two_instants_a_step_are_gauss_s(self):
        """The work of friction is integrated to third order."""
        early, late = automaton._EARLY, automaton._LATE
        for power in range(4):
            assert 0.5 * (early**power + late**power) == pytest.approx(1.0 / (power + 1))

    def test_of_an_arc_that_rk4_steps_over_is_no_certificate(self, cells):
        """A scratch a thousandth of a radian wide, so rough that it jams the body: no step of rk4 ends on it."""
        values = {"zone.half_angle": 1e-3, "zone.center": 2.0, "initial.omega": 60.0, "time.span": 0.5}
        values |= dict(zip(COEFFICIENTS, (2.0, 2.0, 0.1, 0.1), strict=True)) | {
            "friction.v0": 0.1,
            "friction.alpha": 0.0,
        }
        batch = cells(values, drive="arctan")
        truth, stepped = solve(Auto(), batch), solve(RK4(500), batch)
        assert (truth.regime, truth.certified) == (JAMMED, 1)
        assert (stepped.regime, stepped.certified) == (SEPARATING, 0)


class TestErrors:
    """Numbers come with bounds on their errors."""

    def test_of_two_runs_that_are_one_say_nothing(self, cells):
        """Two steps that no tolerance shortens: the second resolution repeats the first, and a third must tell."""
        values = dict(zip(COEFFICIENTS, (1.7, 1.5, 0.2, 0.0), strict=True)) | {
            "body.inertia": 0.01,
            "drive.amplitude": -2.0,
            "initial.omega": 20.0,
            "zone.half_angle": 0.0,
        }
        batch = cells(values, law="stiction", drive="arctan")
        found, exact = Auto().run(batch, NAMES), solve(Event(rtol=1e-14, certify=False), batch)
        error = np.abs(found.rows[:, NAMES.index("t_separation")] - exact.t_separation)
        assert found.certified.all()
        assert (found.errors[:, with_errors(NAMES).index("t_separation")] >= error).all()

    @pytest.mark.parametrize(
        ("law", "drive"), [("stiction", "arctan"), ("bengisu-akay", "arctan"), ("bengisu-akay", "power")]
    )
    def test_are_covered_by_what_is_stated(self, cells, law, drive):
        rng = np.random.default_rng(8)
        count = 400
        values = {
            "drive.amplitude": rng.choice([-1, 1], count) * 10 ** rng.uniform(-1, 1, count),
            "zone.half_angle": rng.uniform(0.05, 2.0, count),
            "initial.omega": rng.choice([0, 1], count) * rng.uniform(-30, 30, count),
            "time.span": rng.uniform(0.5, 3.0, count),
        }
        if law == "bengisu-akay":
            values |= {
                "friction.alpha": 10 ** rng.uniform(0, 5, count),
                "friction.v0": 10 ** rng.uniform(-6, -0.5, count),
            }
        if drive == "power":
            # Below 2 the acceleration is infinite at first, and the first steps are as short at any tolerance.
            values["drive.exponent"] = rng.uniform(1.05, 1.95, count)
        batch = cells(values, law=law, drive=drive)
        found = Auto().run(batch, NAMES)
        exact = solve(Event(rtol=1e-14) if law == "stiction" else Implicit(rtol=3e-10), batch)
        held, ratios = [], []
        for k, name in enumerate(with_errors(NAMES)):
            error = np.abs(found.rows[:, NAMES.index(name)] - getattr(exact, name))
            stated = found.errors[:, k]
            known = np.isfinite(error) & np.isfinite(stated) & (found.rows[:, 0] == exact.regime)
            held.append((stated >= error)[known])
            ratios.append((stated / np.where(error > 0.0, error, np.nan))[known])
        assert np.concatenate(held).mean() > (0.98 if drive == "power" else 0.99)
        assert np.nanmedian(np.concatenate(ratios)) < 100

    def test_are_linked_to_their_numbers_and_absent_without_certificates(self, scene):
        axes = {"drive.amplitude": [0.1, 2.0]}
        found = ringsweep.sweep(scene, axes)
        assert found.phi_end.attrs["ancillary_variables"] == "phi_end_error"
        assert found.phi_end_error.attrs["units"] == "rad"
        assert (found.phi_end_error > 0.0).all()
        # What separates has no exact end; what does not has one.
        np.testing.assert_array_equal(found.t_end_error > 0.0, found.regime == SEPARATING)
        without = ringsweep.sweep(scene, axes, solver={"method": "auto", "certify": False})
        assert not [name for name in without.data_vars if str(name).endswith("_error")]
        assert "ancillary_variables" not in without.phi_end.attrs
