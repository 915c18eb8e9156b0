"""Smooth laws, against brute force, converged references and limits."""

import numpy as np
import pytest
from solutions import solve, trail

from ringsweep.quantities.flags import JAMMED, OSCILLATORY, RESTING, REVOLVING, SEPARATING
from ringsweep.solvers.event import Event, Implicit
from ringsweep.solvers.rk4 import RK4

EXACT = Implicit(rtol=1e-11, certify=False)
LIMIT = Event(rtol=1e-14, certify=False)


class TestFigures:
    """Figures with the law of the paper, v0 = 2e-6 m/s: the same results as Runge-Kutta 4 with steps of 0.2 us."""

    @pytest.mark.parametrize(
        ("number", "motion", "t", "phi"),
        [
            (29, OSCILLATORY, (3.58236, 1e-5), (1.24458, 2e-5)),
            (30, OSCILLATORY, (1.28477, 1e-5), (1.29125, 3e-5)),
            (31, RESTING, (0.14977, 1e-5), (2.04373, 1e-5)),
            (33, REVOLVING, (0.1727, 5e-5), (8.554, 5e-4)),
        ],
    )
    def test_contact_2_separates_at_the_known_instant(self, setting, number, motion, t, phi):
        found, exact = solve(Implicit(), setting(number)), solve(EXACT, setting(number))
        for run in (found, exact):
            assert (run.regime, run.motion, run.separating_contact) == (SEPARATING, motion, 2)
            assert run.t_separation == pytest.approx(t[0], abs=t[1])
            assert run.phi_end == pytest.approx(phi[0], abs=phi[1])
        assert found.certified
        assert found.t_separation == pytest.approx(exact.t_separation, abs=1e-6)

    @pytest.mark.parametrize(("number", "phi_max"), [(28, 0.69946), (32, 0.82937)])
    def test_no_contact_separates_in_figures_28_and_32(self, setting, number, phi_max):
        found, exact = solve(Implicit(), setting(number)), solve(EXACT, setting(number))
        assert found.regime == found.motion == OSCILLATORY
        assert found.certified
        assert found.phi_max == pytest.approx(phi_max, abs=2e-5)
        assert found.phi_max == pytest.approx(exact.phi_max, abs=1e-7)
        assert found.phi_end == pytest.approx(exact.phi_end, abs=1e-6)

    @pytest.mark.slow
    @pytest.mark.parametrize("number", [25, 27])
    def test_figures_with_a_wide_band_agree_with_rk4(self, setting, number):
        """At v0 = 0.2 m/s nothing is stiff, and a small step converges."""
        batch = setting(number)
        found, other = solve(EXACT, batch), solve(RK4(2_000_000, certify=False), batch)
        assert found.regime == other.regime == OSCILLATORY
        assert found.reversals == other.reversals
        assert found.phi_end == pytest.approx(other.phi_end, abs=1e-8)
        assert found.phi_max == pytest.approx(other.phi_max, abs=1e-8)
        assert solve(Implicit(), batch).phi_end == pytest.approx(other.phi_end, abs=1e-6)

    def test_error_of_implicit_falls_with_the_tolerance(self, setting):
        """The error falls over six decades, down to rounding."""
        batch = setting(30)
        exact = solve(Implicit(rtol=1e-12, certify=False), batch).t_end
        tolerances = 10.0 ** -np.arange(4, 11)
        errors = np.array([abs(solve(Implicit(rtol, certify=False), batch).t_end - exact)[0] for rtol in tolerances])
        assert (np.diff(errors) < 0).all()
        assert (errors < tolerances).all()
        assert errors[-1] < 1e-12


class TestLimit:
    """As v0 tends to zero the law becomes set-valued and keeps its tail."""

    V0 = 2.0 * 10.0 ** -np.arange(5, 10)

    @pytest.mark.parametrize("number", [29, 30])
    @pytest.mark.parametrize(
        ("quantity", "limit", "alpha", "power"),
        [
            # Both the creep of a stuck contact and its velocity at the end of the band are proportional to v0.
            ("t_separation", "tustin", 10.0, 1.0),
            # The law is flat at its top: ``v0 x' = -(c t + x^2)`` has the time scale v0^(2/3).
            ("stick_time", "tustin", 10.0, 2 / 3),
            ("stick_time", "tustin", 1e5, 2 / 3),
            # With a tail much shorter than the band, separation is as late as breakaway.
            ("t_separation", "stiction", 1e12, 2 / 3),
        ],
    )
    def test_smooth_law_is_off_its_limit_by_a_known_power_of_v0(self, setting, number, quantity, limit, alpha, power):
        exact = solve(LIMIT, setting(number, limit, **({"friction__alpha": alpha} if limit == "tustin" else {})))
        found = solve(EXACT, setting(number, friction__alpha=alpha, friction__v0=self.V0))
        late = getattr(found, quantity) - getattr(exact, quantity)
        assert (late > 0).all() or quantity == "t_separation"
        assert np.polyfit(np.log(self.V0), np.log(abs(late)), 1)[0] == pytest.approx(power, abs=0.03)
        assert power < 1.0 or abs(late[-1]) < 1e-8

    def test_law_is_not_replaced_by_its_limit_of_small_v0(self, setting):
        """A band of 2e-6 m/s changes the instant of separation by a small but known amount."""
        exact = solve(LIMIT, setting(29, "tustin"))
        found = solve(Implicit(), setting(29))
        assert found.t_separation - exact.t_separation == pytest.approx(5.9e-5, rel=0.05)


class TestCreep:
    """A stuck contact creeps slowly, in the direction of the load."""

    def test_creep_velocity_is_the_same_fraction_of_v0_for_any_v0(self, setting):
        """The load needs the same friction for any v0, and so the same fraction of the band."""
        fractions = []
        for v0 in (1e-4, 1e-6, 1e-8):
            run = trail(Implicit(), setting(29, friction__v0=v0, time__span=0.5), 1e-2)
            assert (run.mode == 0).all()
            v = 0.043378 * (run.omega - run.ring_omega)
            fractions.append(v[-1] / v0)
            assert (v[1:] < 0).all()
        assert np.ptp(fractions) < 1e-3
        assert -0.9 < fractions[0] < -0.1

    def test_slow_creep_takes_as_few_steps_in_a_wide_band(self, setting):
        """The motion decides how long steps are, not the time in which friction relaxes."""
        v0 = np.array([2e-6, 2e-4, 2e-3, 2e-2])
        found = solve(Implicit(certify=False), setting(29, drive__amplitude=0.03, friction__v0=v0))
        assert found.stick_time == pytest.approx(10.0)
        assert found.steps.max() < 1.5 * found.steps.min()

    def test_body_at_rest_on_a_ring_at_rest_does_not_move(self, setting):
        found = solve(Implicit(max_steps=2000), setting(29, drive__amplitude=0.0))
        assert found.regime == RESTING
        assert found.certified
        assert found.phi_end == found.omega_end == 0.0
        assert found.stick_time == 10.0


JAM_PATHS = (
    "drive.amplitude", "zone.center", "zone.half_angle", "friction.rough.mu_s", "friction.rough.mu_k",
    "friction.rest.mu_s", "friction.rest.mu_k", "friction.alpha", "friction.v0", "initial.omega", "time.span",
)  # fmt: skip

#: Scenes that jam or nearly jam; values in the order of `JAM_PATHS`.
JAMS = {
    "tail of 1e-6 m/s": "0.196958 -0.674266 0.690522 1.8017 0.694367 1.04223 0.819171 1293490 7.22657e-8 -8.15013 2",
    "tail of 2e-7 m/s": "-9.808 0 0.888738 0.979616 0.944569 1.85271 1.19351 5207650 0.0864945 -24.9425 1",
    "top of the band": "0.119525 -2.37554 2.50495 1.42968 0.283686 1.74709 1.05556 19.7123 1.28436e-4 -96.8931 1",
    "ice": "-5.14749 1.5474 2.7933 0.0459787 0.0268141 0.0200699 0.00798642 834491 0.00131495 0 0.5",
    "alpha of 1e5": "4.11348 -2.61388 0.252879 0.308912 0.127823 0.359504 0.115791 128008 0.00588388 0 0.5",
    "alpha of 2e6": "0.127277 -1.08592 3.05932 0.557637 0.254864 0.365293 0.222557 2175370 3.45722e-5 0 0.5",
    "rough": "5.66773 1.65058 0.789601 1.60676 0.894608 1.44183 0.363937 101456 0.0164613 0 0.2",
}


class TestJam:
    """A body may jam where friction rises as it slows down. The references are from LSODA with tolerance 1e-12."""

    @staticmethod
    def changes(name):
        return dict(zip(JAM_PATHS, map(float, JAMS[name].split()), strict=True))

    @pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-9])
    @pytest.mark.parametrize(
        ("name", "t"),
        [("tail of 1e-6 m/s", 0.015409496), ("tail of 2e-7 m/s", 0.012403025), ("top of the band", 0.175363621)],
    )
    def test_jam_is_not_taken_for_separation(self, cells, name, t, rtol):
        """Both reactions grow without bound as the effective inertia vanishes, and no contact separates."""
        found = solve(Implicit(rtol, max_steps=20_000), cells(self.changes(name), drive="arctan"))
        assert found.regime == JAMMED
        assert found.separating_contact == 0
        assert found.t_end == pytest.approx(t, abs=1e-7)

    @pytest.mark.parametrize("rtol", [1e-4, 3e-6, 1e-6, 1e-9])
    @pytest.mark.parametrize(
        ("name", "exponent"),
        [("ice", 1.24144), ("alpha of 1e5", 1.13513), ("alpha of 2e6", 1.2062), ("rough", 1.10451)],
    )
    def test_start_with_infinite_acceleration_is_not_taken_for_a_jam(self, cells, name, exponent, rtol):
        """The body passes the tail of the law within 1e-12 s, far from a jam."""
        changes = self.changes(name) | {"drive.exponent": exponent}
        found = solve(Implicit(rtol), cells(changes, drive="power"))
        assert found.t_end == changes["time.span"]
        assert found.regime in (RESTING, OSCILLATORY)
