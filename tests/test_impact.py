"""What follows a lost contact: closed forms, symmetry, energy, and what is refused."""

from itertools import pairwise
from math import cos, pi, sin, sqrt

import numpy as np
import pytest
import xarray as xr

import ringsweep
from ringsweep.errors import InputError

G, RADIUS = 9.81, 0.2

PARTICLE = {
    "model": "ring-single-contact",
    "body": {"mass": 0.1},
    "ring": {"radius": RADIUS},
    "friction": {"law": "stiction", "rest": {"mu_s": 0.3, "mu_k": 0.1}},
    "initial": {"omega": "12 rad/s"},
    "time": {"span": "1.2 s"},
    "impact": {"restitution": 0},
}
BODY = {
    "model": "ring",
    "body": {"mass": 0.076, "inertia": 4.2e-5, "half_distance": 0.0315, "ball_radius": 0.008},
    "ring": {"radius": 0.043378},
    "zone": {"half_angle": "15 deg"},
    "friction": {"law": "stiction", "rough": {"mu_s": 0.5, "mu_k": 0.3}, "rest": {"mu_s": 0.2, "mu_k": 0.1}},
    "drive": {"law": "arctan", "amplitude": 3},
    "time": {"span": "5 s"},
    "impact": {"restitution": 0.5},
}
AMPLITUDES = np.geomspace(1.5, 12, 12)


@pytest.fixture(scope="module")
def drums():
    return ringsweep.sweep(BODY, {"drive.amplitude": AMPLITUDES}, progress=False)


class TestParticle:
    def test_particle_that_leaves_smoothly_lands_at_minus_three_times_the_angle(self):
        """It leaves at phi and lands 4 sqrt(R/g) sin(d) sqrt(cos d) later, with d = pi - |phi|, at -3 phi."""
        launches = np.linspace(10.5, 15.0, 20)
        found = ringsweep.sweep(PARTICLE, {"initial.omega": launches}, progress=False)
        landed = 0
        for i, omega in enumerate(launches):
            cell = found.isel(initial_omega=i)
            if int(cell.impacts) == 0:
                continue
            run = ringsweep.simulate(PARTICLE | {"initial": {"omega": float(omega)}}, samples=50)
            t_lost, phi = float(cell.t_separation), float(run.phi.values[np.searchsorted(run.time, cell.t_separation)])
            d = pi - abs(phi)
            assert float(run.impact_time[0]) - t_lost == pytest.approx(4 * sqrt(RADIUS / G) * sin(d) * sqrt(cos(d)))
            speed = 8 * sqrt(G * RADIUS) * sin(d) ** 3 * cos(d) ** 1.5
            assert float(run.impact_speed[0]) == pytest.approx(speed, rel=1e-8)
            at = int(np.searchsorted(run.time, run.impact_time[0]))
            place = np.arctan2(run.x.values[at], -run.y.values[at])
            assert (place + 3 * phi + pi) % (2 * pi) - pi == pytest.approx(0.0, abs=1e-8)
            landed += 1
        assert landed >= 5

    def test_unending_rebounds_last_as_long_as_their_geometric_sum(self):
        """A particle falls from rest beside the race: each rebound lasts e times the one before, on a flat floor.

        The race is curved, so that the law holds in the limit of small heights only: for a drum of 1 km.
        """
        scene = PARTICLE | {"ring": {"radius": 1000.0}, "impact": {"restitution": 0.5}, "time": {"span": "60 s"}}
        # It leaves a short way below the top, where gravity is along the race.
        run = ringsweep.simulate(scene | {"initial": {"omega": 0.19}}, samples=50)
        times = run.impact_time.values
        assert len(times) > 5
        lengths = np.diff(times)
        np.testing.assert_allclose(lengths[4:8] / lengths[3:7], 0.5, rtol=0.05)


class TestBody:
    def test_no_impact_gains_energy_and_only_a_lost_contact_lifts(self, drums):
        assert (drums.impact_loss >= 0.0).all()
        lost = drums.separations > 0
        assert lost.any()
        assert (drums.aftermath.values == 0).tolist() == (~lost).values.tolist()
        assert (drums.open_time >= drums.flight_time).all()
        assert (drums.gap_max.where(lost, 1.0) > 0.0).all()

    def test_mirror_image_has_the_mirrored_run(self, drums):
        mirrored = ringsweep.sweep(BODY, {"drive.amplitude": -AMPLITUDES}, progress=False)
        sure = (drums.certified.values == 1) & (mirrored.certified.values == 1)
        assert sure.sum() >= 8
        for name in ("open_time", "gap_max", "impact_speed_max", "impacts", "tumbles", "aftermath", "regime"):
            np.testing.assert_allclose(mirrored[name].values[sure], drums[name].values[sure], rtol=1e-6, err_msg=name)
        np.testing.assert_allclose(mirrored.phi_end.values[sure], -drums.phi_end.values[sure], rtol=1e-6)

    @pytest.mark.parametrize("law", ["stiction", "bengisu-akay"])
    def test_run_up_to_the_first_loss_is_the_run_without_impact_bit_for_bit(self, law):
        """Regime, motion, contact and time of separation are numbers of that part. Tolerances are alike: no retries."""
        rng, count = np.random.default_rng(31), 400
        smooth = law == "bengisu-akay"
        of_law = {"alpha": 1e4, "v0": 1e-4} if smooth else {}
        scene = BODY | {"friction": BODY["friction"] | {"law": law} | of_law}
        values = {
            "drive.amplitude": rng.choice([-1, 1], count) * 10 ** rng.uniform(-0.5, 1.3, count),
            "zone.half_angle": rng.uniform(0.05, 2.0, count),
            "zone.center": rng.uniform(-np.pi, np.pi, count),
            "initial.phi": rng.uniform(-1.0, 1.0, count),
            "initial.omega": rng.choice([0.0, 1.0], count) * rng.uniform(-100, 100, count),
            "friction.rest.mu_k": rng.uniform(0.02, 0.2, count),
        }
        axes = {path: xr.DataArray(column, dims="cell") for path, column in values.items()}
        ended, gone_on = (
            ringsweep.sweep(given, axes, solver={"method": "auto", "certify": False}, progress=False)
            for given in ({name: part for name, part in scene.items() if name != "impact"}, scene)
        )
        assert "aftermath" not in ended
        lost = ended.separating_contact.values > 0
        assert 0.2 < lost.mean() < 0.98
        assert len(np.unique(ended.motion.values[lost])) == 3, "each motion comes before a loss"
        assert (gone_on.reversals.values > ended.reversals.values).any()
        for name in ("regime", "motion", "separating_contact", "t_separation"):
            np.testing.assert_array_equal(gone_on[name], ended[name], err_msg=name)

    def test_gap_is_never_negative_and_an_open_contact_bears_nothing(self):
        run = ringsweep.simulate(BODY | {"drive": {"law": "arctan", "amplitude": 3.67}}, samples=4000)
        for contact in (1, 2):
            gap, reaction = run[f"gap_{contact}"].values, run[f"normal_{contact}"].values
            assert gap.min() > -1e-12
            assert reaction.min() > -1e-12
            assert (reaction[gap > 1e-9] == 0.0).all()

    def test_energy_is_kept_in_flight(self):
        run = ringsweep.simulate(BODY | {"drive": {"law": "arctan", "amplitude": 9}}, samples=60_000)
        flies = (run.normal_1.values == 0.0) & (run.normal_2.values == 0.0)
        checked = 0
        # A flight ends where a contact holds, and at each rebound, whose instant stands twice.
        cuts = np.flatnonzero((np.diff(run.time) == 0.0) | (np.diff(flies.astype(int)) != 0)) + 1
        for start, stop in pairwise(cuts):
            if not flies[start + 1 : stop - 1].all():
                continue
            if stop - start > 12:
                part = run.isel(time=slice(start + 1, stop - 1))
                x_dot, y_dot = (np.gradient(part[name].values, part.time.values, edge_order=2) for name in ("x", "y"))
                energy = 0.5 * 0.076 * (x_dot**2 + y_dot**2) + 0.076 * G * part.y.values
                assert np.ptp(energy) < 1e-6 * 0.076 * G * RADIUS
                assert np.ptp(part.omega.values) == pytest.approx(0.0, abs=1e-12)
                checked += 1
        assert checked

    def test_ball_that_rolls_onto_a_smooth_zone_begins_to_slip(self):
        """Without slip a ball on which the body pivots still rolls over the ring, onto the edge of a zone.

        There it slides against the direction in which it rolls. Word and numbers are those of ``benchmarks.reference``.
        """
        scene = BODY | {
            "body": {"mass": 0.267278, "inertia": 0.000496468, "half_distance": 0.0440407, "ball_radius": 0.0191723},
            "ring": {"radius": 0.0741464},
            "zone": {"half_angle": 2.86196, "center": pi},
            "friction": {
                "law": "stiction",
                "rough": {"mu_s": 0.0175763, "mu_k": 0.00977993},
                "rest": {"mu_s": 0.576639, "mu_k": 0.327377},
            },
            "drive": {"law": "arctan", "amplitude": 0.533024},
            "initial": {"omega": -20.1769},
            "time": {"span": 2.08644},
        }
        found = ringsweep.sweep(scene, {"impact.restitution": [0.599883]}, progress=False)
        assert ringsweep.words(found.aftermath).item() == "tumbled"
        assert found.t_end.item() == 2.08644
        assert found.t_recovered.item() == pytest.approx(1.106471579, abs=1e-5)
        assert found.phi_end.item() == pytest.approx(-3.365267361, rel=1e-6)

    def test_restitution_is_an_axis_and_the_greatest_gap_has_a_bound(self):
        found = ringsweep.sweep(BODY, {"impact.restitution": [0.0, 0.3, 0.9]}, progress=False)
        assert (found.gap_max <= 2 * (0.043378 - 0.008 - 0.0315) + 1e-9).all()
        assert isinstance(found, xr.Dataset)

    def test_bounds_cover_the_errors_of_what_follows_a_loss(self):
        """Impacts magnify errors, and a small gap has the error of the place. Checked by runs at rtol 1e-14."""
        rng = np.random.default_rng(29)
        points = {
            "drive.amplitude": xr.DataArray(rng.uniform(2.0, 12.0, 150), dims="run"),
            "impact.restitution": xr.DataArray(rng.uniform(0.0, 0.8, 150), dims="run"),
        }
        found, exact = (
            ringsweep.sweep(BODY, points, solver={"method": "event", "rtol": rtol}, progress=False)
            for rtol in (1e-10, 1e-14)
        )
        covered = {}
        for name in ("omega_end", "gap_max", "impact_speed_max", "impulse_max", "impact_loss", "t_recovered"):
            error, stated = abs(found[name] - exact[name]).values, found[f"{name}_error"].values
            known = np.isfinite(stated) & (found.impacts == exact.impacts).values & (found.impacts > 0).values
            covered[name] = (stated >= error - 4.0 * np.spacing(abs(exact[name].values)))[known]
        assert min(len(each) for each in covered.values()) > 60
        assert np.concatenate(list(covered.values())).mean() > 0.99
        assert min(each.mean() for each in covered.values()) > 0.97


class TestRefused:
    @pytest.mark.parametrize(
        ("change", "solver", "problem"),
        [
            ({}, {"method": "rk4", "steps": 100}, "rk4 does not go on after a contact is lost"),
            ({"friction": {"law": "dahl", "sigma0": 1e5} | {k: BODY["friction"][k] for k in ("rough", "rest")}}, "auto",
             "bristles, which have no state in an impact"),
            ({"impact": {"restitution": 1.5}}, "auto", "must be at least 0 and at most 1"),
            ({"impact": {}}, "auto", "restitution: missing"),
            ({"body": BODY["body"] | {"inertia": 0}}, "auto", "cannot turn on one contact"),
        ],
    )  # fmt: skip
    def test_what_has_no_impact_is_refused_with_its_place(self, change, solver, problem):
        with pytest.raises(InputError, match=problem):
            ringsweep.sweep(BODY | change, {"drive.amplitude": [1.0]}, solver=solver, progress=False)
