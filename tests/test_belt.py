"""The mass on a spring on a belt, against closed forms and known limits."""

from math import atan, cos, pi, sin, sqrt
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
import xarray as xr
from belts import on_belt, outcome, with_all_parts
from refusals import refused
from tiers import mostly_slow

import ringsweep
from ringsweep.quantities.flags import REGIMES
from ringsweep.solvers.rk4 import STABILITY_LIMIT

CONFIGS = Path(__file__).parents[1] / "configs"
G = 9.81


def belt(law="stiction", *, m=1.0, k=2.0, v_b=0.1, mu_s=0.15, mu_k=0.1, span=60.0, start=None, **of_law):
    """Scene of the belt in the paper, launched at the velocity of the belt unless `start` is given."""
    friction = {"law": law, "mu_s": mu_s, "mu_k": mu_k, **of_law}
    if law in ("coulomb", "threlfall", "dahl", "bristle"):
        del friction["mu_s"]
    scene = on_belt(friction, k, mass=m, velocity=v_b, span=span, start=(0.0, v_b if start is None else start))
    # The kernels of these laws for a belt with all parts are compiled in any case, for forces on the body.
    return with_all_parts(scene) if law in ("karnopp", "bengisu-akay") else scene


class TestStickSlipCycle:
    """Stick 2 dF/(k v), slip (2/w)(pi - atan(dF w/(k v))), greatest velocity v + sqrt(v^2 + (dF w/k)^2)."""

    @pytest.mark.parametrize(
        ("m", "k", "v_b", "mu_s", "mu_k"),
        [(1, 2, 0.1, 0.15, 0.1), (0.3, 50, 0.02, 0.6, 0.25), (12, 900, 0.5, 0.3, 0.29), (1e-6, 1e-3, 0.01, 0.4, 0.1)],
    )
    def test_stick_slip_cycle_agrees_with_theory(self, m, k, v_b, mu_s, mu_k):
        omega, drop = sqrt(k / m), (mu_s - mu_k) * m * G
        stick, slip = 2 * drop / (k * v_b), 2 / omega * (pi - atan(drop * omega / (k * v_b)))
        first = mu_s * m * G / (k * v_b)
        cycles = 6.3
        found = outcome(belt(m=m, k=k, v_b=v_b, mu_s=mu_s, mu_k=mu_k, span=first + cycles * (stick + slip)))
        assert REGIMES[int(found.regime)] == "stick-slip"
        assert found.certified == 1
        assert float(found.first_slip) == pytest.approx(first, rel=1e-10)
        assert float(found.period) == pytest.approx(stick + slip, rel=1e-10)
        assert float(found.velocity_max) == pytest.approx(v_b, rel=1e-10)
        assert float(found.slips) == 7
        assert float(found.force_max) == pytest.approx(mu_s * m * G, rel=1e-12)
        assert float(found.x_max) == pytest.approx(
            mu_k * m * G / k + sqrt((drop / k) ** 2 + (v_b / omega) ** 2), rel=1e-10
        )

    def test_body_launched_at_rest_slides_before_it_sticks(self):
        """From rest on a moving belt the body slips until it has the belt's speed, then sticks."""
        omega, mu = sqrt(2.0), 0.981 / 2
        t = atan(0.1 / omega / mu / sqrt(1 - (0.1 / omega / mu) ** 2)) / omega
        x = mu * (1 - cos(omega * t))
        assert mu * omega * sin(omega * t) == pytest.approx(0.1)
        found = outcome(belt(start=0.0))
        assert float(found.first_slip) == pytest.approx(t + (0.73575 - x) / 0.1, rel=1e-10)


class TestCoulomb:
    def test_coulomb_friction_gives_an_undamped_harmonic_oscillation(self):
        found = outcome(belt("coulomb", span=40.0))
        assert REGIMES[int(found.regime)] == "oscillatory"
        assert float(found.period) == pytest.approx(2 * pi / sqrt(2.0), rel=1e-10)
        assert float(found.x_max) == pytest.approx(0.4905 + 0.1 / sqrt(2.0), rel=1e-10)

    def test_oscillation_on_a_belt_at_rest_decays_by_equal_steps_to_rest(self):
        """The amplitude falls by 4 F_c/k in each cycle."""
        scene = belt("coulomb", v_b=0.0, k=1.0, mu_k=0.4 / G, span=30.0) | {"initial": {"x": 3.0, "velocity": 0.0}}
        run, found = ringsweep.simulate(scene), outcome(scene)
        turning_points = run.x.values[np.flatnonzero(np.abs(run.velocity.values) < 1e-12)]
        for expected in (3.0, -2.2, 1.4, -0.6):
            assert np.abs(turning_points - expected).min() < 1e-10
        assert float(found.x_end) == pytest.approx(-0.2, abs=1e-10)
        assert float(found.velocity_end) == 0.0


class TestLaunch:
    @pytest.mark.slow
    def test_launch_without_initial_values_is_at_rest_on_the_belt(self):
        scene = belt("tustin", alpha=10.0, span=10.0)
        del scene["initial"]
        assert float(outcome(scene).first_slip) == pytest.approx(7.3575, rel=1e-12)
        del scene["belt"]
        scene["drive"] = {"law": "sinusoidal", "amplitude": 0.1, "frequency": 0.5}
        assert float(ringsweep.simulate(scene).velocity[0]) == pytest.approx(0.1 * pi, rel=1e-12)


@pytest.mark.slow
class TestViscous:
    """Under stiction and viscous friction c, slip is a damped oscillation about (F_c + c v_b)/k."""

    def test_steady_sliding_is_at_the_place_where_forces_balance(self):
        found = outcome(with_all_parts(belt("coulomb", viscous=0.5, span=200.0)))
        assert REGIMES[int(found.regime)] == "sliding"
        assert found.settled == 1
        assert float(found.x_end) == pytest.approx((0.981 + 0.5 * 0.1) / 2, rel=1e-10)

    def test_stick_slip_ends_at_the_belt_velocity_of_theory(self):
        """Stick-slip lasts while the body reaches the velocity of the belt again after breakaway."""
        m, k, c, mu_k = 1.0, 2.0, 0.2, 0.1
        speeds, mu_s = np.geomspace(0.02, 2.0, 15), np.linspace(0.11, 0.2, 12)
        maps = ringsweep.sweep(
            with_all_parts(belt(viscous=c, span=250.0, start=0.0)),
            {"belt.velocity": speeds, "friction.mu_s": mu_s},
            progress=False,
        )
        decay = c / (2 * m)
        omega = sqrt(k / m - decay**2)
        t = np.linspace(0, 4 * pi / omega, 40_001)

        def returns(v_b, drop):
            velocity = np.exp(-decay * t) * (
                v_b * np.cos(omega * t) + (decay * v_b - drop * G) / omega * np.sin(omega * t)
            )
            behind = np.argmin(velocity)
            return velocity[behind:].max() / v_b

        ratio = np.array([[returns(v, s - mu_k) for s in mu_s] for v in speeds])
        sticks = maps.regime.values == REGIMES.index("stick-slip")
        clear = abs(ratio - 1) > 1e-6
        assert clear.mean() > 0.99
        np.testing.assert_array_equal(sticks[clear], (ratio > 1)[clear])
        assert 0.3 < sticks.mean() < 0.7
        # For light damping the critical velocity is (F_s - F_c)/sqrt(4 pi zeta k m).
        zeta = decay / sqrt(k / m)
        critical = (mu_s - mu_k) * m * G / sqrt(4 * pi * zeta * k * m)
        last = np.array([speeds[column].max(initial=0.0) for column in sticks.T])
        assert (last[4:] < 1.3 * critical[4:]).all()
        assert (last[4:] > 0.5 * critical[4:]).all()


@pytest.mark.slow
class TestKarnopp:
    """Within the dead band D_v the body does not slide; it keeps its momentum, and slides on with it."""

    @pytest.mark.parametrize("dead_band", [1e-6, 1e-3, 0.02])
    def test_karnopp_cycle_rides_with_the_belt_and_slips_from_the_band_edge(self, dead_band):
        found = outcome(belt("karnopp", dead_band=dead_band, span=100.0, start=0.1 - dead_band))
        v, drop, omega = 0.1 - dead_band, 0.05 * G, sqrt(2.0)
        expected = drop / 0.1 + 2 / omega * (pi - atan(drop * omega / (2 * v)))
        assert REGIMES[int(found.regime)] == "stick-slip"
        assert float(found.period) == pytest.approx(expected, rel=1e-10)

    @pytest.mark.parametrize("dead_band", [1e-6, 1e-3, 0.02])
    def test_first_slip_begins_when_the_body_leaves_the_dead_band(self, dead_band):
        found = outcome(belt("karnopp", dead_band=dead_band, span=20.0))
        # Until then the belt carries it at 0.1 m/s, and the excess of the spring's pull is its momentum.
        assert float(found.first_slip) == pytest.approx(7.3575 + sqrt(dead_band / 0.1), rel=1e-10)

    def test_shift_of_time_is_a_multiplier_of_one_despite_a_jump_of_velocity(self):
        scene = belt("karnopp", dead_band=0.01, span=200.0, start=0.09)
        found = ringsweep.run({"scene": scene, "record": {"exponent": True}}, progress=False)
        assert found.multiplier_1.item() == pytest.approx(1.0, abs=1e-9)
        assert found.multiplier_2.item() == 0.0

    def test_body_leaving_the_band_at_equal_friction_swings_about_the_balance(self):
        """Its momentum is that of the edge, and no force accelerates it there. Runs of such scenes had failed."""
        found = outcome(belt("karnopp", mu_s=0.1, mu_k=0.1, dead_band=0.01, span=60.0, start=0.09))
        assert found.certified == 1
        assert float(found.x_max) == pytest.approx(0.1 * G / 2.0 + 0.09 / sqrt(2.0), rel=1e-10)

    @pytest.mark.parametrize("method", ["event", "rk4"])
    def test_body_without_a_spring_stops_at_the_edge_of_the_dead_band_for_good(self, method):
        scene = belt("karnopp", k=0.0, v_b=0.0, mu_s=0.2, dead_band=0.01, span=1000.0, start=1.0)
        found = outcome(scene, method=method, **({"steps": 1_000_000, "certify": False} if method == "rk4" else {}))
        assert found.x_end.item() == pytest.approx(
            (1.0 - 0.01**2) / (2.0 * 0.1 * G), rel=1e-9 if method == "event" else 1e-4
        )
        assert found.velocity_end.item() == 0.0
        assert found.x_end.item() == found.x_max.item()


TIGHT = {"method": "implicit", "rtol": 1e-9, "certify": False}

#: A law, parameters that grow together, their values; the law to which it tends and the number that differs from it;
#: other parameters; the power with which it does, and its error. Where a law is flat at its top, passage over such a
#: fold takes a time proportional to the power 2/3.
LIMITS = [
    ("threlfall", {"v0": 1}, [1e-3, 1e-4, 1e-5], belt("coulomb"), "x_max", {}, 1.0, 0.01),
    # The body breaks away at once at the corner of the law, so that only the creep before delays the slip.
    ("piecewise-linear", {"v0": 1, "v1": 2}, [1e-4, 1e-5, 1e-6], belt(), "first_slip", {}, 1.0, 0.01),
    ("piecewise-cubic", {"v0": 1, "v1": 2}, [1e-4, 1e-5, 1e-6], belt(), "x_max", {}, 2 / 3, 0.02),
    ("karnopp", {"dead_band": 1}, [1e-4, 1e-5, 1e-6], belt(), "x_max", {}, 0.5, 0.01),
    ("dahl", {"sigma0": 1}, [1e4, 1e5, 1e6], belt("coulomb"), "x_max", {}, -2 / 3, 0.01),
    ("reset-integrator", {"sigma0": 1}, [1e4, 1e5, 1e6], belt(), "period", {"sigma1": 300.0}, -1.0, 0.01),
    ("lugre", {"v_s": 1}, [3e-3, 1e-3, 3e-4], belt(), "x_max", {"sigma0": 1e9, "sigma1": 300.0}, 2 / 3, 0.04),
    # The velocity of creep in stick is proportional to the width of the band.
    ("bengisu-akay", {"v0": 1}, [1e-4, 1e-5, 1e-6], belt("tustin", alpha=1e3), "period", {"alpha": 1e3}, 1.0, 0.35),
    ("tustin", {"alpha": 1}, [1e4, 1e5, 1e6], belt(), "period", {}, -1.0, 0.2),
]


@pytest.mark.parametrize(
    ("law", "of", "values", "limit", "quantity", "fixed", "power", "within"), mostly_slow(LIMITS, LIMITS[6::2])
)
def test_law_tends_to_its_limit_with_the_power_of_theory(law, of, values, limit, quantity, fixed, power, within):
    axes = {f"friction.{name}": xr.DataArray(factor * np.array(values), dims="cell") for name, factor in of.items()}
    solver = "auto" if law in ("karnopp", "tustin") else TIGHT
    found = ringsweep.sweep(belt(law, **fixed), axes, solver=solver, progress=False)[quantity].values
    errors = np.abs(found - float(outcome(limit)[quantity]))
    assert errors[-1] < 0.3 * errors[0]
    np.testing.assert_allclose(np.diff(np.log(errors)) / np.diff(np.log(values)), power, atol=within)


class TestMethods:
    """What each method can resolve."""

    def test_error_of_lugre_falls_with_the_tolerance(self):
        """This holds also where the body begins to stick, and the Stribeck curve rises within 1/1000 of a step."""
        scene = belt("lugre", sigma0=1e5, sigma1=sqrt(1e5), sigma2=0.1, v_s=0.001)
        speeds = np.geomspace(0.05, 0.4, 8)

        def periods(rtol):
            solver = {"method": "implicit", "rtol": rtol, "certify": False}
            return ringsweep.sweep(scene, {"belt.velocity": speeds}, solver=solver, progress=False).period.values

        exact = periods(1e-11)
        for rtol in (1e-5, 1e-6, 1e-7):
            assert (abs(periods(rtol) - exact) < 20 * rtol * exact).all()

    @pytest.mark.slow
    def test_rk4_step_too_long_for_bristles_has_no_certificate(self):
        """LuGre with steps of 5e-4 s: the trajectory is wrong, but finite."""
        scene = with_all_parts(belt("lugre", span=20.0, sigma0=1e5, sigma1=sqrt(1e5), sigma2=0.1, v_s=0.001))
        fixed, found = outcome(scene, method="rk4", steps=40_000), outcome(scene)
        assert fixed.stiffness > STABILITY_LIMIT
        assert fixed.certified == 0
        assert found.certified == 1

    def test_rk4_refuses_the_law_whose_bonds_snap(self):
        with pytest.raises(ringsweep.InputError, match="rk4 does not take friction law bristle"):
            outcome(belt("bristle", sigma0=1e3), method="rk4", steps=1000)


class TestPaper:
    """Statements of the paper about Figs. 9-12 and their four laws."""

    @pytest.fixture(scope="class")
    @staticmethod
    def runs():
        found = ringsweep.simulate(CONFIGS / "paper" / "fig09-12.yaml")
        return found.interp(time=np.linspace(0.0, 20.0, 20_001))

    @pytest.mark.slow
    def test_motion_under_coulomb_is_near_dahl_and_under_stiction_near_lugre(self, runs):
        def distance(one, other):
            return float(np.sqrt(((runs.x.sel(friction_law=one) - runs.x.sel(friction_law=other)) ** 2).mean()))

        assert distance("coulomb", "dahl") < 0.01 * distance("coulomb", "stiction")
        assert distance("stiction", "lugre") < 0.5 * min(distance("coulomb", "stiction"), distance("coulomb", "lugre"))
        assert [REGIMES[int(regime)] for regime in runs.regime] == ["oscillatory", "stick-slip"] * 2

    @pytest.mark.slow
    def test_forces_of_the_four_laws_differ_most_just_after_the_start(self, runs):
        spread = runs.friction_force.max("friction_law") - runs.friction_force.min("friction_law")
        assert float(spread.idxmax()) < 0.001
        # The bristles are not deflected yet: their force is (sigma1 + sigma2) v.
        assert float(spread.max()) == pytest.approx(0.1 * 316.2278 + 0.1 * 0.1, rel=1e-3)
        assert float(spread.sel(time=slice(0.2, None)).max()) < 1.0


class TestExtremes:
    SMALL: ClassVar = {
        "stiction": {},
        "karnopp": {"dead_band": 1e-6},
        "bengisu-akay": {"v0": 1e-6, "alpha": 1e4},
        "piecewise-cubic": {"v0": 1e-6, "v1": 2e-6},
        "dahl": {"sigma0": 1e5},
        "lugre": {"sigma0": 1e5, "sigma1": 300.0, "v_s": 1e-3},
        "elasto-plastic": {"sigma0": 1e5, "sigma1": 300.0, "v_s": 1e-3},
        "reset-integrator": {"sigma0": 1e5, "sigma1": 300.0},
    }
    CASES: ClassVar = [
        {"belt.velocity": 0.0},
        {"belt.velocity": 1e-9},
        {"friction.mu_s": 0.1},
        {"body.mass": 1e-6},
        {"spring.stiffness": 0.0},
        {"friction.sigma0": 1e9},
        {"friction.sigma1": 0.0},
        {"belt.velocity": 0.0, "spring.stiffness": 0.0},
        {"initial.x": 50.0, "initial.velocity": -20.0},
    ]

    @pytest.mark.parametrize("law", mostly_slow(SMALL, ("stiction", "lugre")))
    def test_extreme_parameters_give_finite_outcomes(self, law):
        scene = belt(law, span=20.0, start=0.0, **self.SMALL[law])
        usual = {
            "belt.velocity": 0.1,
            "body.mass": 1.0,
            "spring.stiffness": 2.0,
            "initial.x": 0.0,
            "initial.velocity": 0.0,
        }
        usual |= {f"friction.{name}": value for name, value in scene["friction"].items() if name != "law"}
        cases = [usual | {path: value for path, value in case.items() if path in usual} for case in self.CASES]
        axes = {path: xr.DataArray([case[path] for case in cases], dims="case") for path in usual}
        found = ringsweep.sweep(scene, axes, progress=False)
        failed = found.regime.values == REGIMES.index("failed")
        assert not failed.any(), np.array(self.CASES)[failed]
        for name in ("t_end", "x_end", "velocity_end", "x_min", "x_max", "force_max", "stick_time"):
            assert np.isfinite(found[name]).all(), name
        at_rest = found.isel(case=0)
        assert REGIMES[int(at_rest.regime)] == "riding"
        assert abs(float(at_rest.x_end)) < 1e-9

    def test_largest_force_of_stiff_bristles_is_the_breakaway_force(self):
        for sigma_0 in (1e7, 1e9):
            of_law = {"sigma0": sigma_0, "sigma1": sqrt(sigma_0), "sigma2": 0.1, "v_s": 1e-3}
            assert float(outcome(belt("lugre", span=20.0, **of_law)).force_max) == pytest.approx(1.4715, rel=2e-2)

    def test_body_without_spring_ends_at_the_velocity_of_the_belt(self):
        found = outcome(belt(k=0.0, start=0.0))
        assert float(found.velocity_end) == pytest.approx(0.1, rel=1e-12)
        assert float(found.x_end) == pytest.approx(0.1 * 60 - 0.5 * 0.1**2 / 0.981, rel=1e-10)
        assert REGIMES[int(found.regime)] == "sticking"


class TestRegimes:
    """The word says what the motion settles to."""

    @pytest.mark.parametrize("law", mostly_slow(["stiction", "bengisu-akay", "lugre", "dahl"], ("stiction", "lugre")))
    def test_body_that_sticks_to_the_end_is_sticking(self, law):
        of_law = TestExtremes.SMALL[law]
        without_spring = belt(law, k=0.0, start=-1.0, span=60.0, **of_law)
        still = belt(law, v_b=0.0, span=60.0, **of_law) | {"initial": {"x": 1.0, "velocity": 0.0}}
        for scene in (without_spring, still):
            assert REGIMES[int(outcome(scene).regime)] == "sticking"

    @pytest.mark.parametrize("law", mostly_slow(["reset-integrator", "lugre"], ("lugre",)))
    def test_vibration_of_bristles_during_stick_does_not_count_as_slip(self, law):
        """On a slow belt the vibration of the bristles changes the sign of the velocity many times in one stick."""
        bristles = {"sigma0": 1000.0, "sigma1": 5.0} | ({"v_s": 0.001} if law == "lugre" else {})
        scene = belt(law, v_b=0.01, mu_s=0.2, start=0.01, **bristles)
        found = ringsweep.sweep(scene, {"time.span": [300.0, 710.0, 1000.0]}, progress=False)
        assert (found.regime == REGIMES.index("stick-slip")).all()
        # The period is nearly 2 (F_s - F_c)/(k v_b), for any span.
        assert float(found.period[2]) == pytest.approx(98.1, rel=0.25)
        np.testing.assert_allclose(found.period[1], found.period[2], rtol=1e-4)
        np.testing.assert_allclose(found.slips, (found.time_span - found.first_slip) // found.period[2] + 1, atol=1)


class TestInput:
    def test_dead_band_with_too_much_viscous_friction_is_refused(self):
        refused(r"friction\.viscous.*dead band", outcome, belt("karnopp", dead_band=0.01, viscous=100.0))

    @pytest.mark.slow
    def test_belt_needs_either_a_velocity_or_a_drive(self):
        scene = belt()
        del scene["belt"]
        refused("velocity: missing", ringsweep.simulate, scene)
        scene["spring"]["cubic"] = 0.0
        rocking = scene | {"drive": {"law": "sinusoidal", "amplitude": "0.2 m", "frequency": 1.0}}
        assert REGIMES[int(ringsweep.simulate(rocking | {"time": {"span": 5}}).regime)] != "failed"
        refused("given together with drive", ringsweep.simulate, rocking | {"belt": {"velocity": 0.1}})
