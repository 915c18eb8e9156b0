"""Certificates, on scenes where two resolutions agree and both are wrong or nearly wrong."""

from typing import ClassVar

import numpy as np
import pytest
from belts import on_belt, outcome
from relations import Kind, in_order, random_scenes
from rings import course, shape
from solutions import solve

import ringsweep
from ringsweep.compile import take
from ringsweep.models import MODELS
from ringsweep.models.interface import audit, modes
from ringsweep.physics import drives
from ringsweep.quantities.flags import JAMMED, RESTING, SEPARATING
from ringsweep.solvers import event
from ringsweep.solvers.certificate import with_errors
from ringsweep.solvers.event import Auto, Event, Implicit
from ringsweep.solvers.rk4 import RK4

NAMES = MODELS["ring"].outcomes
COEFFICIENTS = [f"friction.{place}.{name}" for place in ("rough", "rest") for name in ("mu_s", "mu_k")]

#: Random scenes with errors that two runs share: a mode that lasts for one step; a long step of a slow creep; the end
#: of the elastic range of bristles within a step; a fast slide of a slow body; and runs that are close by chance. Then
#: errors that small numbers hide: of a velocity at a turn; of a small jump; of the instant of the last event. Last, the
#: reactions of a step that both runs share; a step of bristles from where friction is level to the Stribeck speed; and
#: a creep over a distance much shorter than friction can hold the body.
BOUNDED = [
    (101, Kind("ring", "hyperbolic", "sinusoidal", arcs=1)),
    (201, Kind("ring", "tanh", "sinusoidal", arcs=1)),
    (101, Kind("belt", "elasto-plastic", force="harmonic", span=(1.0, 8.0))),
    (103, Kind("ring", "elasto-plastic", "sinusoidal", arcs=1, span=(0.2, 1.5))),
    (103, Kind("belt", "tanh", force="harmonic", span=(2.0, 20.0))),
    (307, Kind("belt", "hyperbolic", force="harmonic", span=(2.0, 20.0))),
    (411, Kind("ring", "hyperbolic", "sinusoidal", arcs=1)),
    (307, Kind("ring", "lugre", "sinusoidal", arcs=1, span=(0.2, 1.5))),
    (307, Kind("belt", "elasto-plastic", force="harmonic", span=(1.0, 8.0))),
    (307, Kind("ring", "bengisu-akay", "arctan", arcs=1)),
    (20262, Kind("ring", "andersson", "sinusoidal", arcs=1)),
    (20262, Kind("belt", "elasto-plastic", force="harmonic", span=(1.0, 8.0))),
    (904, Kind("belt", "brown-mcphee", force="harmonic", span=(2.0, 20.0))),
]


@pytest.fixture
def rocking(cells):
    """A body that creeps on an oscillating ring, whose amplitude decides whether a contact separates."""

    def build(amplitude, law="bengisu-akay"):
        values = dict.fromkeys(COEFFICIENTS, 0.5) | {
            "zone.half_angle": 0.0,
            "drive.amplitude": amplitude,
            "drive.frequency": 2.2831,
            "drive.phase": np.pi / 2,
            "time.span": 0.438,
        }
        of_law = {"friction.alpha": 0.0, "friction.v0": 1e-5} if law == "bengisu-akay" else {}
        return cells(values | of_law, law=law, drive="sinusoidal")

    return build


class TestDips:
    """A reaction that is negative only for a short time, within a step."""

    @pytest.mark.slow
    def test_dip_of_a_reaction_during_creep_is_found(self, rocking):
        found = solve(Auto(), rocking(0.6017))
        assert (found.regime, found.separating_contact, found.certified) == (SEPARATING, 1, 1)
        assert found.t_separation == pytest.approx(0.21415, abs=1e-5)

    @pytest.mark.slow
    def test_dips_under_a_smooth_law_agree_with_those_under_stiction(self, rocking):
        """The amplitudes go from values that keep the contact closed to values that open it for long."""
        amplitude = np.linspace(0.55, 0.65, 101)
        smooth, limit = (solve(Auto(), rocking(amplitude, law)) for law in ("bengisu-akay", "stiction"))
        certain = (smooth.certified == 1) & (limit.certified == 1)
        # The smooth law differs a little from its limit, so that regimes may differ at the boundary.
        differ = certain & (smooth.regime != limit.regime)
        assert certain.mean() > 0.95
        assert differ.sum() <= 1
        assert 10 < (smooth.regime == SEPARATING).sum() < 91

    def test_dip_between_two_steps_of_rk4_leaves_no_certificate(self, cells):
        """Contact 2 holds by 2e-5 N at one launch and separates at the next: rk4 cannot certify its regime."""
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
    def test_stuck_body_with_one_contact_on_a_rough_arc_is_not_jammed(self, cells):
        """Slip at mu_s of the zone would jam, but the body does not slip."""
        values = dict(zip(COEFFICIENTS, (0.55, 0.3, 0.1, 0.08), strict=True)) | {"time.span": 5.0, "ring.radius": 0.065}
        values |= {"body.inertia": 5e-6, "body.half_distance": 0.010, "body.ball_radius": 0.005}
        values |= dict.fromkeys(("zone.half_angle", "zone.center"), np.radians(30))
        found = solve(Auto(), cells(values, law="stiction", drive="arctan"))
        assert (found.regime, found.certified, found.stick_time) == (RESTING, 1, 5.0)

    def test_slip_with_a_negative_reaction_is_not_admissible(self, cells):
        """Stick is the only admissible mode: its saturation is 0.465, and both reactions are positive."""
        values = dict.fromkeys(COEFFICIENTS, 0.66) | {"body.mass": 0.15, "body.inertia": 8e-5}
        values |= {"body.half_distance": 0.036, "ring.radius": 0.050, "initial.phi": 1.34, "zone.half_angle": 0.0}
        found = solve(Auto(), cells(values | {"time.span": 2.0}, law="stiction", drive="arctan"))
        assert (found.regime, found.certified) == (RESTING, 1)
        assert found.normal_min_1 == pytest.approx(1.489, abs=1e-3)
        assert found.normal_min_2 == pytest.approx(0.139, abs=1e-3)

    @pytest.mark.parametrize("law", ["stiction", "bengisu-akay"])
    def test_both_contacts_separate_at_the_top_of_a_ring_at_rest(self, cells, law):
        """A run that is its own mirror image cannot separate at one contact alone."""
        found = solve(Auto(), cells({"initial.phi": np.array([np.pi, 2.9, -2.9])}, law=law, drive="arctan"))
        np.testing.assert_array_equal(found.regime, SEPARATING)
        assert found.separating_contact[0] == 3
        assert found.separating_contact[1] == {1: 2, 2: 1, 3: 3}[int(found.separating_contact[2])]
        assert found.normal_min_1[0] == found.normal_min_2[0] == 0.0

    def test_contact_on_an_edge_may_be_on_either_side_and_has_no_certificate(self, cells):
        """Contact 1 is on the edge of an icy zone. The rest of the ring holds it, and the mirror image likewise.

        Rounding decides which side of an edge holds a body at rest, so that there is no certificate.
        """
        edge = 0.546545997641859
        values = dict(zip(COEFFICIENTS, (0.1, 0.1, 0.8, 0.6), strict=True)) | {"zone.half_angle": 0.3}
        values |= {"initial.phi": np.array([edge, edge - 1e-12, -edge]), "drive.amplitude": np.array([2.0, 2.0, -2.0])}
        found = solve(Auto(), cells(values, law="stiction", drive="arctan"))
        np.testing.assert_array_equal(found.regime, SEPARATING)
        np.testing.assert_array_equal(found.separating_contact, [2, 2, 1])
        np.testing.assert_allclose(found.t_separation, 0.969176928911, atol=1e-10)
        assert not found.certified[[0, 2]].any()


#: A ring that rocks with an amplitude of 0.3, and its velocity at t = 0, rad/s.
ROCKING, SPEED = {"drive.frequency": 1.7, "drive.phase": 0.4}, 0.3 * 2 * np.pi * 1.7 * float(np.cos(0.4))


class TestLaunch:
    """The state at launch does not depend on the rounding of the velocities of body and ring."""

    @staticmethod
    def bristles(batch):
        _, state, _, _ = modes.begin(take(batch, 0))
        return state[2:]

    LUGRE: ClassVar = {"friction.sigma0": 1e3, "friction.v_s": 1e-3, "drive.amplitude": 0.3}

    @pytest.mark.parametrize(
        ("drive", "changes"),
        [
            ("power", {"drive.exponent": 3.0}),
            *(("sinusoidal", ROCKING | {"initial.omega": SPEED * (1.0 + off)}) for off in (-3e-16, 0.0, 3e-16)),
            # The velocity of the ring is the rounding error of a cosine.
            ("sinusoidal", {"drive.frequency": 0.9, "drive.phase": np.pi / 2}),
        ],
    )
    def test_bristles_of_a_body_at_rest_on_the_ring_are_not_deflected(self, cells, drive, changes):
        assert self.bristles(cells(self.LUGRE | changes, law="lugre", drive=drive)) == (0.0, 0.0)

    def test_only_infinite_initial_acceleration_leaves_a_body_at_rest_behind(self, cells):
        """A power law with an exponent below 2 begins with infinite acceleration."""
        for exponent in (3.0, 1.5):
            scene = take(cells({"drive.amplitude": 0.3, "drive.exponent": exponent}, law="stiction", drive="power"), 0)
            _, (_, v), _, _ = modes.begin(scene)
            assert (v < 0.0) == (exponent < 2.0)


class TestLaw:
    """A certificate asks that the run obey its law at instants that the solver did not choose."""

    def scene(self, cells, law):
        values = {"drive.amplitude": np.linspace(0.5, 8.0, 40), "time.span": 3.0}
        return cells(values, law=law, drive="arctan")

    @pytest.mark.parametrize("law", ["stiction", "bengisu-akay"])
    def test_violations_of_certified_runs_are_within_the_tolerance(self, cells, law):
        method = Event() if law == "stiction" else Implicit()
        batch = self.scene(cells, law)
        _, _, audits = method.integrate(batch, len(NAMES), audit=True)
        assert audits[:, 0].max() < 0.2 * event._MOST_VIOLATION
        assert audits[:, 1].max() < 0.2 * event._MOST_UNEXPLAINED

    @pytest.mark.parametrize("law", ["stiction", "bengisu-akay"])
    def test_mode_with_a_wrong_segment_is_a_violation(self, cells, law):
        """The audit takes the segment under the contact from the surface, not from the mode."""
        scene = take(self.scene(cells, law), 0)
        _, y, _, mode = modes.begin(scene)
        forcing = drives.turn(scene.drive, 0.0)

        def violation(mode):
            return audit.violation(scene, mode, forcing, y, (0.0, 0.0), 0.1, 1e-10)[0]

        segment, turn = mode.place_1
        assert np.isfinite(violation(mode))
        assert np.isinf(violation(mode._replace(place_1=(1 - segment, turn))))

    def test_rk4_run_that_steps_over_a_narrow_arc_has_no_certificate(self, cells):
        """The zone is 2e-3 rad wide and so rough that the body jams. No step of rk4 ends on it."""
        values = {"zone.half_angle": 1e-3, "zone.center": 2.0, "initial.omega": 60.0, "time.span": 0.5}
        values |= dict(zip(COEFFICIENTS, (2.0, 2.0, 0.1, 0.1), strict=True)) | {
            "friction.v0": 0.1,
            "friction.alpha": 0.0,
        }
        batch = cells(values, drive="arctan")
        truth, by_rk4 = solve(Auto(), batch), solve(RK4(500), batch)
        assert (truth.regime, truth.certified) == (JAMMED, 1)
        assert (by_rk4.regime, by_rk4.certified) == (SEPARATING, 0)


class TestErrors:
    """Bounds on the errors of outcomes."""

    def test_two_runs_with_the_same_steps_do_not_bound_the_error(self, cells):
        """No tolerance shortens the two steps of this run, so that a third run is needed."""
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
        ("method", "law", "drive", "median", "median_of_all"),
        [
            (Event(), "stiction", "arctan", 150, 450),
            # Most steps end at events, so that a run at a looser tolerance takes the same steps.
            (Event(rtol=1e-5), "stiction", "arctan", 100, 350),
            (Implicit(), "bengisu-akay", "arctan", 400, 600),
            (Implicit(), "bengisu-akay", "power", 900, 1300),
        ],
    )
    def test_error_bounds_cover_the_true_errors(self, cells, method, law, drive, median, median_of_all):
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
            # Below 2 the initial acceleration is infinite, and the first steps are equally short at any tolerance.
            values["drive.exponent"] = rng.uniform(1.05, 1.95, count)
        batch = cells(values, law=law, drive=drive)
        found = method.run(batch, NAMES)
        exact = solve(Event(rtol=1e-14) if law == "stiction" else Implicit(rtol=3e-10), batch)
        covered, ratios, of_motion = [], [], []
        for k, name in enumerate(with_errors(NAMES)):
            error = np.abs(found.rows[:, NAMES.index(name)] - getattr(exact, name))
            stated = found.errors[:, k]
            known = np.isfinite(error) & np.isfinite(stated) & (found.rows[:, 0] == exact.regime)
            covered.append((stated >= error)[known])
            ratios.append((stated / np.where(error > 0.0, error, np.nan))[known])
            # Most reactions and jumps are exact to rounding; their bounds are those of the few that are not.
            if not name.startswith(("normal", "jump")):
                of_motion.append(ratios[-1])
        assert np.concatenate(covered).mean() > 0.99
        assert np.nanmedian(np.concatenate(of_motion)) < median
        assert np.nanmedian(np.concatenate(ratios)) < median_of_all

    @pytest.mark.slow
    @pytest.mark.parametrize(("seed", "kind"), BOUNDED)
    def test_no_number_errs_by_more_than_three_bounds(self, seed, kind):
        """Two runs may share a step, and bend in it: their difference does not show its error."""
        run = random_scenes(kind, 300, np.random.default_rng(seed))
        tight = (
            {"method": "event", "rtol": 1e-14} if kind.law == "hyperbolic" else {"method": "implicit", "rtol": 1e-12}
        )
        first, exact = run.outcomes(), run.outcomes(solver=tight)
        alike = (first.certified == 1) & (exact.certified == 1) & (first.regime == exact.regime)
        bounded = [name for name in first if f"{name}_error" in first and first[name].dims == ("cell",)]
        bounds = [first[f"{name}_error"] + exact[f"{name}_error"] for name in bounded]
        ratios = np.stack([
            np.where(alike & (bound > 0.0), abs(first[name] - exact[name]) / bound, np.nan)
            for name, bound in zip(bounded, bounds, strict=True)
        ])  # fmt: skip
        assert np.nanmax(ratios) < 3.0
        assert (ratios > 1.0).sum() <= 0.003 * np.isfinite(ratios).sum()

    @pytest.mark.parametrize(
        ("law", "seed", "cell", "rtol"),
        [
            ("tustin", 1, 1567, 1e-14),
            # A creep from rest to rest: by symmetry the error estimate of the step is small.
            pytest.param("bengisu-akay", 1, 1963, 1e-11, marks=pytest.mark.slow),
            # The greatest friction lies within a creep of one step, whose dense output is inexact.
            pytest.param("tanh", 1, 2318, 1e-11, marks=pytest.mark.slow),
            # The greatest friction lies at the elastic limit of bristles, in the last part of a step of both runs.
            pytest.param("elasto-plastic", 1, 1497, 1e-11, marks=pytest.mark.slow),
            # In a creep the greatest friction is a small share of breakaway.
            pytest.param("tanh", 5001, 2880, 1e-11, marks=pytest.mark.slow),
        ],
    )
    def test_numbers_that_agree_by_chance_err_by_less_than_three_bounds(self, law, seed, cell, rtol):
        span = (1.0, 8.0) if law == "elasto-plastic" else (2.0, 20.0)
        kind, name = Kind("belt", law, force="harmonic", span=span), law.split("-")[0]
        run = in_order(random_scenes(kind, 4000, np.random.default_rng([seed, *name.encode()])), np.array([cell]))
        method = "event" if law == "tustin" else "implicit"
        found, exact = run.outcomes(), run.outcomes(solver={"method": method, "rtol": rtol})
        for name in ("x_end", "velocity_end", "x_min", "x_max", "force_max"):
            bound = found[f"{name}_error"] + exact[f"{name}_error"]
            assert abs(found[name] - exact[name]).item() <= 3.0 * bound.item(), name

    @pytest.mark.slow
    def test_difference_that_is_small_by_chance_does_not_make_the_bound_small(self):
        """The reference is Radau at a tolerance of 1e-12, and RK4 in 160 000 steps."""
        scene = shape(0.076, 4.47e-5, 0.025, 0.01, 0.043378, zone=1.15) | course("sinusoidal", 0.3, 0.5)
        scene["friction"] = {"law": "tanh", "v0": 0.01, "rough": {"mu_k": 0.3}, "rest": {"mu_k": 0.1}}
        found = ringsweep.sweep(scene, {"time.span": [5.0]}, progress=False)
        error = abs(found.phi_end.item() + 0.0308159679686)
        assert error <= found.phi_end_error.item() <= 2e-5

    @pytest.mark.slow
    def test_bound_covers_a_long_step_to_where_the_law_bends(self):
        """The step begins at an extreme of the velocity, so that its first terms tell little of its end."""
        friction, force = {"law": "tanh", "mu_k": 0.0403, "v0": 0.0182}, (-0.824, 0.7416, 0.0652)
        start = {"start": (0.0, -0.3197), "force": force, "velocity": -0.0224, "span": 6.3, "gravity": 9.81}
        scene = on_belt(friction, 8.286, mass=0.639, **start)
        found, exact = outcome(scene), outcome(scene, {"method": "implicit", "rtol": 1e-12})
        assert abs(found.x_end - exact.x_end) <= found.x_end_error <= 1e-6
        assert abs(found.velocity_end - exact.velocity_end) <= found.velocity_end_error <= 1e-5

    def test_bound_covers_the_instant_at_which_a_reaction_vanishes(self, cells):
        """A contact opens within the first step, which both runs share; their difference tells nothing of its end."""
        values = dict(zip(COEFFICIENTS, (0.15533, 0.11516, 0.17015, 0.020433), strict=True)) | {
            "body.mass": 0.038098,
            "body.inertia": 5.1972e-7,
            "body.half_distance": 0.0076675,
            "body.ball_radius": 0.0125275,
            "body.center_offset": -0.0010786,
            "ring.radius": 0.0352157,
            "friction.alpha": 1.814,
            "friction.v0": 0.034008,
            "zone.center": -0.06667,
            "zone.half_angle": 0.11942,
            "drive.amplitude": -7.43758,
            "initial.phi": 1.45488,
            "time.span": 1.3927,
        }
        self.covers(cells(values), "omega_min", "omega_end", "phi_end", "t_separation", share=1.0)

    @pytest.mark.slow
    def test_bound_covers_a_creep_that_errs_most_in_its_place(self, cells):
        """Both runs share the first steps, whose error is that of the place."""
        values = dict(zip(COEFFICIENTS, (0.03996, 0.03996, 0.496677, 0.496677), strict=True)) | {
            "body.mass": 0.146493,
            "body.inertia": 0.000155509,
            "body.half_distance": 0.033916,
            "body.ball_radius": 0.01351928,
            "ring.radius": 0.0513876,
            "friction.v_s": 0.0449044,
            "friction.k_t": 136.7757,
            "zone.center": -0.69954,
            "zone.half_angle": 0.0621312,
            "drive.amplitude": -0.302782,
            "initial.phi": 0.1524183,
            "initial.omega": -0.1484818,
            "time.span": 2.819076,
        }
        self.covers(cells(values, law="andersson", drive="constant"), "phi_end", "phi_min", share=3.0)

    @staticmethod
    def covers(batch, *outcomes, share):
        """Check that no error of these outcomes exceeds its bound by more than this factor."""
        found, exact = Auto().run(batch, NAMES), solve(Implicit(rtol=1e-12), batch)
        assert found.certified.all()
        for name in outcomes:
            error = abs(found.rows[0, NAMES.index(name)] - getattr(exact, name))
            assert error <= share * found.errors[0, with_errors(NAMES).index(name)]

    def test_error_bounds_link_to_variables_and_are_absent_if_uncertified(self, scene):
        axes = {"drive.amplitude": [0.1, 2.0]}
        found = ringsweep.sweep(scene, axes)
        assert found.phi_end.attrs["ancillary_variables"] == "phi_end_error"
        assert found.phi_end_error.attrs["units"] == "rad"
        assert (found.phi_end_error > 0.0).all()
        # A run that does not separate ends exactly at the span.
        np.testing.assert_array_equal(found.t_end_error > 0.0, found.regime == SEPARATING)
        without = ringsweep.sweep(scene, axes, solver={"method": "auto", "certify": False})
        assert not [name for name in without.data_vars if str(name).endswith("_error")]
        assert "ancillary_variables" not in without.phi_end.attrs


class TestChaos:
    """A mass on a cubic spring under 300 periods of a force: nearby runs diverge."""

    SCENE: ClassVar = on_belt(
        {"law": "tustin", "mu_s": 0.0180848, "mu_k": 0.0113261, "alpha": 5.77},
        0.1,
        cubic=1.0,
        damping=0.046,
        velocity=0.174811,
        span=2238.81,
        force=(4.93, 0.134),
    )

    @pytest.fixture(scope="class")
    @classmethod
    def found(cls):
        """Runs at three tolerances: of a chaotic motion, and of one that a strong damper makes periodic."""
        axes = {"damper.coefficient": [0.046, 1.0]}
        tolerances = (1e-8, 1e-10, 1e-13)
        return [ringsweep.sweep(cls.SCENE, axes, solver={"method": "event", "rtol": rtol}) for rtol in tolerances]

    @pytest.mark.slow
    def test_numbers_of_runs_that_diverge_have_no_bound(self, found):
        ends = [[float(run[name][0]) for name in ("x_end", "velocity_end")] for run in found]
        assert np.ptp(ends, axis=0).max() > 0.1
        for run in found:
            assert np.isnan([float(run[f"{name}_error"][0]) for name in ("x_end", "velocity_end", "x_max")]).all()

    def test_regime_of_a_chaotic_motion_is_certified_if_the_statistics_agree(self, found):
        assert found[0].certified[0] == 1
        assert ringsweep.words(found[0].regime).values[0] == "stick-slip"

    def test_numbers_of_runs_that_converge_have_a_bound(self, found):
        for run in found:
            assert run.certified[1] == 1
            assert abs(float(run.x_end[1] - found[-1].x_end[1])) <= float(run.x_end_error[1])
            assert float(run.x_end_error[1]) < 1e-4
