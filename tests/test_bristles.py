"""Friction laws of bristles: the properties that the literature reports."""

from itertools import pairwise
from math import cos, log, pi, sqrt, tanh

import numpy as np
import pytest
import xarray as xr
from belts import on_belt
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import ringsweep
from ringsweep.compile import take
from ringsweep.physics.friction import LAWS, TRAITS, Dynamic
from ringsweep.physics.friction.bristles import (
    BONDS,
    Bristles,
    Dahl,
    ElastoPlastic,
    LuGre,
    ResetIntegrator,
    after_yield,
    bristle,
    initial_deflection,
    region_guard,
    steady_deflection,
)
from ringsweep.physics.friction.velocity import BAND, KINETIC

MU_S, MU_K = 0.6, 0.4
SIGMA_0, V_S = 1e3, 1e-2
#: Largest deflection that sliding can produce, m.
LONGEST = MU_S / SIGMA_0


def random_bonds(seed=0.0, sigma0=SIGMA_0):
    """Law of random bonds with memory of its own, at the launch."""
    law = take(Bristles.of(np.array([sigma0]), np.array([seed])), 0)
    assert initial_deflection(law, MU_K, MU_K) == 0.0
    return law


DAHL = Dahl(SIGMA_0)
LUGRE = LuGre(SIGMA_0, V_S, 2.0, 0.5)
ELASTO_PLASTIC = ElastoPlastic(SIGMA_0, V_S, 2.0, 0.5, 0.7)
RESET = ResetIntegrator(SIGMA_0, 2.0)
EVERY = {"dahl": DAHL, "lugre": LUGRE, "elasto-plastic": ELASTO_PLASTIC, "reset": RESET, "bonds": random_bonds()}
#: Laws whose bristles creep in stick.
CREEPING = {name: EVERY[name] for name in ("dahl", "lugre", "elasto-plastic")}

velocities = st.floats(-5.0, 5.0).map(lambda x: x * V_S)
deflections = st.floats(-1.5, 1.5).map(lambda x: x * LONGEST)
signs = st.sampled_from([-1.0, 1.0])
regions = st.sampled_from([BAND, KINETIC])


def static(law):
    """Static coefficient that a model passes to the law: mu_k if the law has no static coefficient."""
    return MU_K if isinstance(law, Dahl | Bristles) else MU_S


def stribeck(v):
    """Friction coefficient of steady sliding of LuGre bristles."""
    return MU_K + (MU_S - MU_K) * np.exp(-((v / V_S) ** 2))


def deflections_along(law, path, z=0.0, mu_s=MU_S, mu_k=MU_K, speed=1.0):
    """Deflection at the turning points of a path, for a body that moves along it at a constant speed, m."""
    found = [z]
    for start, end in pairwise(path):
        v = speed * float(np.sign(end - start))
        sign = float(np.sign(v))

        def rates(x, z, v=v, sign=sign):
            rate, *_ = bristle(law, mu_s, mu_k, v, float(z[0]), sign, BAND)
            return [rate / v]

        found.append(solve_ivp(rates, (start, end), found[-1:], rtol=1e-10, atol=1e-12 * LONGEST).y[0, -1])
    return np.array(found)


def traction(law, v, z, mu_s=MU_S, mu_k=MU_K):
    """Traction of a law in stick."""
    return bristle(law, mu_s, mu_k, v, z, 1.0 if v >= 0.0 else -1.0, BAND)[3]


def test_every_law_of_bristles_is_tested():
    named = {law for law in LAWS.values() if (TRAITS[law].family, TRAITS[law].state) == (Dynamic, "deflection")}
    assert {type(law) for law in EVERY.values()} == named


@pytest.mark.parametrize("law", EVERY.values(), ids=EVERY)
class TestEveryLaw:
    @given(velocities, deflections, signs, regions)
    def test_derivatives_of_rate_and_traction_are_finite_differences(self, law, v, z, sign, region):
        """By the velocity and by the deflection; also at velocities of the other sign."""
        small_v, small_z = 1e-6 * V_S, 1e-6 * LONGEST
        _, rate_v, rate_z, _, by_v, by_z = bristle(law, MU_S, MU_K, v, z, sign, region)

        def difference(small_v, small_z):
            ahead = bristle(law, MU_S, MU_K, v + small_v, z + small_z, sign, region)
            behind = bristle(law, MU_S, MU_K, v - small_v, z - small_z, sign, region)
            return (ahead[0] - behind[0]) / 2, (ahead[3] - behind[3]) / 2

        # The second derivative of the elasto-plastic law has kinks, hence the tolerance.
        by_velocity, by_deflection = difference(small_v, 0.0), difference(0.0, small_z)
        assert rate_v == pytest.approx(by_velocity[0] / small_v, abs=1e-4)
        assert rate_z == pytest.approx(by_deflection[0] / small_z, abs=1e-4 * V_S / LONGEST)
        assert by_v == pytest.approx(by_velocity[1] / small_v, abs=1e-4 * 2.0)
        assert by_z == pytest.approx(by_deflection[1] / small_z, abs=1e-4 * SIGMA_0)

    def test_bristles_are_a_spring_of_stiffness_sigma0_in_presliding(self, law):
        """Creep takes at most the share x sigma0/mu_k of a displacement x."""
        for x in (1e-2 * LONGEST, 1e-4 * LONGEST):
            for towards in (x, -x):
                (_, z), mu_s = deflections_along(law, (0.0, towards)), static(law)
                assert 0.0 <= (towards - z) / towards + 1e-9 < x * SIGMA_0 / MU_K
                assert region_guard(law, mu_s, MU_K, 0.0, z, np.sign(towards), BAND) > 0.0
                assert traction(law, 0.0, z) == SIGMA_0 * z

    def test_bristles_are_undeflected_and_stuck_at_the_launch(self, law):
        z = initial_deflection(law, static(law), MU_K)
        assert (z, traction(law, 0.0, z)) == (0.0, 0.0)
        assert region_guard(law, static(law), MU_K, 0.0, z, 1.0, BAND) > 0.0


@pytest.mark.parametrize("law", CREEPING.values(), ids=CREEPING)
class TestLawsThatCreep:
    @given(velocities)
    def test_traction_in_steady_sliding_is_the_steady_friction_curve(self, law, v):
        """It is mu_k in Dahl's law; in the others the Stribeck curve plus viscous friction."""
        z = steady_deflection(law, MU_S, MU_K, v)
        rate, _, rate_z, mu, _, _ = bristle(law, MU_S, MU_K, v, z, 1.0 if v >= 0.0 else -1.0, BAND)
        assert rate == pytest.approx(0.0, abs=1e-15 * V_S)
        viscous = 0.5 * v if hasattr(law, "sigma2") else 0.0
        expected = (MU_K if isinstance(law, Dahl) else stribeck(v)) * np.sign(v) + viscous
        assert mu == pytest.approx(expected, rel=1e-13, abs=1e-13)
        assert rate_z <= 0.0

    @pytest.mark.parametrize("speed", [1e-2 * V_S, V_S, 10 * V_S])
    @pytest.mark.parametrize("start", [-1.0, 0.0, 1.2])
    def test_deflection_converges_to_that_of_steady_sliding(self, law, speed, start):
        _, z = deflections_along(law, (0.0, 40 * LONGEST), start * LONGEST, speed=speed)
        assert z == pytest.approx(steady_deflection(law, MU_S, MU_K, speed), rel=1e-8)

    @given(velocities, deflections)
    def test_bristles_without_damping_are_passive(self, law, v, z):
        """They store at most the work that is done on them."""
        z = float(np.clip(z, -steady_deflection(law, MU_S, MU_K, 1e-9), steady_deflection(law, MU_S, MU_K, 1e-9)))
        rate, *_ = bristle(law, MU_S, MU_K, v, z, 1.0 if v >= 0.0 else -1.0, BAND)
        assert SIGMA_0 * z * rate <= SIGMA_0 * z * v + 1e-18


class TestHysteresis:
    """Dahl's loop under a triangular displacement of amplitude a, u = sigma0 a/mu_k.

    Forwards d mu/dx = sigma0 (1 - mu/mu_k), backwards d mu/dx = sigma0 (1 + mu/mu_k). The loop has the extremes
    -mu_k tanh u and mu_k tanh u, and the area 4 mu_k^2/sigma0 (u - tanh u).
    """

    @staticmethod
    def area(amplitude, speed=1.0, points=64):
        """Area of the loop after some periods; its lowest and highest traction; and the lowest again."""
        corners = [0.0, *(8 if amplitude * SIGMA_0 / MU_K > 0.3 else 0) * [amplitude, -amplitude]]
        u = amplitude * SIGMA_0 / MU_K
        z = deflections_along(DAHL, corners, speed=speed)[-1] if len(corners) > 1 else -MU_K * tanh(u) / SIGMA_0
        x, weights = np.polynomial.legendre.leggauss(points)
        there = amplitude * np.array([-1.0, *x, 1.0])
        up = deflections_along(DAHL, there, z, speed=speed)
        down = deflections_along(DAHL, -there, up[-1], speed=speed)
        work = amplitude * SIGMA_0 * (weights @ up[1:-1] - weights @ down[1:-1])
        return work, SIGMA_0 * up[[0, -1]], SIGMA_0 * down[-1]

    @pytest.mark.parametrize("u", [0.01, 0.1, 1.0, 5.0, 20.0])
    def test_loop_of_dahl_closes_with_the_area_of_theory(self, u):
        work, (low, high), again = self.area(u * MU_K / SIGMA_0)
        assert (low, high) == pytest.approx((-MU_K * tanh(u), MU_K * tanh(u)), rel=1e-6)
        assert again == pytest.approx(low, rel=1e-6)
        assert work == pytest.approx(4 * MU_K**2 / SIGMA_0 * (u - tanh(u)), rel=1e-4)

    def test_loop_of_dahl_does_not_depend_on_the_speed(self):
        one, other = (self.area(MU_K / SIGMA_0, speed)[0] for speed in (1e-4, 10.0))
        assert one == pytest.approx(other, rel=1e-9)


class TestResetIntegrator:
    def test_reset_integrator_yields_at_mu_s_and_slips_at_mu_k(self):
        assert region_guard(RESET, MU_S, MU_K, 0.0, 0.999 * LONGEST, 1.0, BAND) > 0.0
        assert region_guard(RESET, MU_S, MU_K, 0.0, LONGEST, 1.0, BAND) == pytest.approx(0.0, abs=1e-15)
        for sign in (1.0, -1.0):
            z, region = after_yield(RESET, MU_S, MU_K, sign * LONGEST, sign, BAND)
            assert (z, region) == (sign * LONGEST, KINETIC)
            rate, *_ = bristle(RESET, MU_S, MU_K, sign * V_S, z, sign, KINETIC)
            assert rate == 0.0
            assert bristle(RESET, MU_S, MU_K, sign * V_S, z, sign, KINETIC)[3] == sign * MU_K
            assert region_guard(RESET, MU_S, MU_K, sign * V_S, z, sign, KINETIC) > 0.0


def slide(law, snaps, sign=1.0, z=0.0, region=BAND):
    """Slide until a number of bonds have snapped.

    Returns displacement, mean traction and final deflection between every two snaps, and the final region.
    """
    found = np.empty((snaps, 3))
    snapping = 24 / 11 * MU_K / law.sigma0
    for k in range(snaps):
        # Between two snaps all bonds stretch equally.
        way = region_guard(law, MU_K, MU_K, sign, z, sign, region) * snapping
        z += sign * way
        _, _, _, mu, _, _ = bristle(law, MU_K, MU_K, sign, z, sign, region)
        assert region_guard(law, MU_K, MU_K, sign, z, sign, region) == pytest.approx(0.0, abs=1e-12)
        z, region = after_yield(law, MU_K, MU_K, z, sign, region)
        found[k] = way, mu - sign * 0.5 * law.sigma0 * way, z
    return found, region


class TestRandomBonds:
    def test_mean_friction_of_random_bonds_is_mu_k(self):
        """Within the statistical error, estimated from the means of 40 parts of the run."""
        run, _ = slide(random_bonds(7.0), 20_000)
        parts = run[400:].reshape(40, -1, 3)
        means = (parts[..., 0] * parts[..., 1]).sum(axis=1) / parts[..., 0].sum(axis=1)
        error = means.std(ddof=1) / sqrt(len(means))
        assert error < 3e-3 * MU_K
        assert means.mean() == pytest.approx(MU_K, abs=4 * error)

    def test_friction_of_random_bonds_varies_within_bounds(self):
        """The standard deviation is about that of one bond divided by the root of their number."""
        run, _ = slide(random_bonds(3.0), 4000)
        assert 0.03 < run[200:, 1].std() / MU_K < 0.3
        assert (np.abs(SIGMA_0 * run[:, 2]) < 24 / 11 * MU_K).all()

    def test_friction_of_random_bonds_does_not_depend_on_the_speed(self):
        for v in (1e-9, 1.0):
            assert bristle(random_bonds(), MU_K, MU_K, v, 1e-4, 1.0, BAND)[::3] == (v, SIGMA_0 * 1e-4)

    def test_first_bond_snaps_after_about_half_the_snapping_deflection(self):
        """Bonds start at most at half of it, apart from their mean, which is subtracted: traction starts at zero."""
        for seed in range(30):
            run, _ = slide(random_bonds(float(seed)), 1)
            assert 0.35 < run[0, 0] / (24 / 11 * MU_K / SIGMA_0) < 0.8

    @pytest.mark.parametrize("sign", [1.0, -1.0])
    def test_contact_counts_as_slipping_after_as_many_snaps_as_bonds(self, sign):
        law = random_bonds(5.0)
        run, region = slide(law, BONDS - 1, sign)
        assert region == BAND
        run, region = slide(law, 1, sign, run[-1, 2])
        assert region == KINETIC
        run, region = slide(law, 1, sign, run[-1, 2], KINETIC)
        assert region == KINETIC
        _, region = slide(law, BONDS - 1, -sign, run[-1, 2])
        assert region == BAND

    def test_equal_seeds_give_equal_runs_and_others_do_not(self):
        one, again, other = (slide(random_bonds(seed), 500)[0] for seed in (1.0, 1.0, 2.0))
        np.testing.assert_array_equal(one, again)
        assert (one != other).any(axis=1).all()

    def test_initial_deflection_resets_the_memory_of_bonds(self):
        law = random_bonds(1.0)
        one, _ = slide(law, 100)
        assert initial_deflection(law, MU_K, MU_K) == 0.0
        np.testing.assert_array_equal(slide(law, 100)[0], one)


# ---- a body on bristles ----------------------------------------------------------------------

#: Static and kinetic coefficient, and parameters, of Canudas de Wit et al. 1995, for a body of 1 kg.
G = 9.81
STATIC, KINETIC_1995 = 1.5 / G, 1.0 / G
OF_1995 = {"sigma0": 1e5, "sigma1": sqrt(1e5), "sigma2": 0.4, "v_s": 1e-3}


def pushed(law, push, span, mu_s=STATIC, mu_k=KINETIC_1995, start=(0.0, 0.0, 0.0), times=None):
    """Displacement, velocity and deflection of a body of 1 kg under a force `push`, N, by SciPy's LSODA."""

    def rates(t, y):
        _, v, z = map(float, y)
        rate, _, _, mu, _, _ = bristle(law, mu_s, mu_k, v, z, 1.0 if v >= 0.0 else -1.0, BAND)
        return v, push(t, y[0]) - G * mu, rate

    found = solve_ivp(rates, (0.0, span), start, "LSODA", times, rtol=1e-8, atol=1e-12, max_step=0.05)
    assert found.success
    return found


def of_1995(kind, *more):
    """Law with the parameters of 1995, per unit of the load of 1 kg."""
    return kind(OF_1995["sigma0"] / G, OF_1995["v_s"], OF_1995["sigma1"] / G, OF_1995["sigma2"] / G, *more)


#: Rates of the load, N/s, and stiffness of the spring that loads the body, N/m: 1 % of the bristles' stiffness.
RATES, STIFFNESS = np.array([1.0, 2.0, 5.0, 10.0, 20.0, 50.0]), 1000.0


@pytest.fixture(scope="module")
def breakaways():
    """Largest friction force on a body that a belt pulls against its spring, at each of the rates, N.

    The span ends soon after the body begins to slip, so that the viscous force stays small.
    """
    scene = on_belt({"law": "lugre", "mu_s": STATIC, "mu_k": KINETIC_1995, **OF_1995}, STIFFNESS, span=1.0)
    axes = {
        "belt.velocity": xr.DataArray(RATES / STIFFNESS, dims="rate"),
        "time.span": xr.DataArray(1.5 / RATES + 0.1, dims="rate"),
    }
    found = ringsweep.sweep(scene, axes, solver={"method": "implicit", "rtol": 1e-8, "certify": False}, progress=False)
    assert (ringsweep.words(found.regime) != "riding").all()
    return found.force_max.values


class TestBreakaway:
    """The faster the load grows, the smaller is the breakaway force (Canudas de Wit et al. 1995, Fig. 4)."""

    @pytest.mark.slow
    def test_breakaway_force_falls_with_the_rate_of_the_load(self, breakaways):
        assert (np.diff(breakaways) < 0.0).all()
        assert (breakaways < 1.5).all()
        assert breakaways[0] > 1.4
        assert 1.0 < breakaways[-1] < 1.25

    def test_breakaway_force_agrees_with_scipy(self, breakaways):
        law = of_1995(LuGre)
        for rate, force in zip(RATES[3:], breakaways[3:], strict=True):
            t = np.linspace(0.0, 1.5 / rate + 0.1, 4001)
            found = pushed(law, lambda t, x, rate=rate: -STIFFNESS * (x + rate / STIFFNESS * t), t[-1], times=t)
            felt = [G * traction(law, v, z, STATIC, KINETIC_1995) for _, v, z in found.y.T]
            assert force == pytest.approx(np.abs(felt).max(), rel=1e-4)


#: Extremes of a load that oscillates with 1 Hz, N.
LOW, HIGH = 0.1, 0.5


def drift(law, low=LOW, high=HIGH, periods=4):
    """Displacement in each period of the load, m, except the first, in which the bristles settle."""
    middle, half = (high + low) / 2, (high - low) / 2
    start = (low / 1e5, 0.0, low / 1e5)
    run = pushed(
        law,
        lambda t, x: middle - half * cos(2 * pi * t),
        float(periods),
        start=start,
        times=np.arange(1.0, periods + 1),
    )
    return np.diff(run.y[0])


class TestDrift:
    """Drift under a load that oscillates below breakaway (Dupont et al. 2002)."""

    @pytest.mark.parametrize(("low", "high"), [(LOW, HIGH), (0.1, 1.0), (-0.2, 0.6)])
    def test_drift_of_lugre_agrees_with_theory(self, low, high):
        """The integral of dF/sigma0 (1/(1 - F/F_s) - 1/(1 + F/F_s)) from the least to the largest load F."""
        expected = 1.5e-5 * log((1 - (low / 1.5) ** 2) / (1 - (high / 1.5) ** 2))
        np.testing.assert_allclose(drift(of_1995(LuGre), low, high), expected, rtol=0.01)

    def test_drift_of_dahl_agrees_with_theory_for_the_kinetic_coefficient(self):
        expected = 1e-5 * log((1 - LOW**2) / (1 - HIGH**2))
        np.testing.assert_allclose(drift(Dahl(1e5 / G)), expected, rtol=0.01)

    def test_drift_of_elasto_plastic_is_zero_in_its_elastic_range(self):
        """The elastic range ends at 0.7 F_c; under a load above it the contact drifts."""
        law = of_1995(ElastoPlastic, 0.7)
        assert np.abs(drift(law)).max() < 1e-10
        assert np.abs(drift(law, high=0.69)).max() < 1e-10
        assert drift(law, high=1.0).min() > 1e-8
