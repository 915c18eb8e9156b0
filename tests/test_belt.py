"""The mass on a spring on a belt against what is known of it in closed form."""

from math import atan, cos, pi, sin, sqrt

import numpy as np
import pytest

import ringsweep
from ringsweep.variables import REGIMES

G = 9.81


def belt(law="stiction", *, m=1.0, k=2.0, v_b=0.1, mu_s=0.15, mu_k=0.1, span=60.0, start=None, **of_law):
    """Scene of the paper's belt, by default launched at the speed of the belt."""
    friction = {"law": law, "mu_s": mu_s, "mu_k": mu_k, **of_law}
    if law == "coulomb":
        del friction["mu_s"]
    return {
        "model": "belt",
        "body": {"mass": m},
        "spring": {"stiffness": k},
        "belt": {"velocity": v_b},
        "friction": friction,
        "initial": {"x": 0.0, "velocity": v_b if start is None else start},
        "time": {"span": span},
    }


def outcome(scene, **solver):
    return ringsweep.sweep(scene, {"time.span": [scene["time"]["span"]]}, solver={"method": "auto", **solver}).isel(
        time_span=0
    )


class TestStickSlipCycle:
    """Stick 2 dF/(k v), slip (2/w)(pi - atan(dF w/(k v))), greatest velocity v + sqrt(v^2 + (dF w/k)^2)."""

    @pytest.mark.parametrize(
        ("m", "k", "v_b", "mu_s", "mu_k"),
        [(1, 2, 0.1, 0.15, 0.1), (0.3, 50, 0.02, 0.6, 0.25), (12, 900, 0.5, 0.3, 0.29), (1e-6, 1e-3, 0.01, 0.4, 0.1)],
    )
    def test_is_that_of_theory(self, m, k, v_b, mu_s, mu_k):
        omega, drop = sqrt(k / m), (mu_s - mu_k) * m * G
        stick, slip = 2 * drop / (k * v_b), 2 / omega * (pi - atan(drop * omega / (k * v_b)))
        first = mu_s * m * G / (k * v_b)
        cycles = 6.3
        found = outcome(belt(m=m, k=k, v_b=v_b, mu_s=mu_s, mu_k=mu_k, span=first + cycles * (stick + slip)))
        assert REGIMES[int(found.regime)] == "stick-slip"
        assert found.certified == 1
        assert float(found.first_slip) == pytest.approx(first, rel=1e-10)
        assert float(found.period) == pytest.approx(stick + slip, rel=1e-10)
        greatest = v_b + sqrt(v_b**2 + (drop * omega / k) ** 2)
        # The belt's own velocity is the body's greatest: the slip is symmetric about it in v, not in x'.
        assert float(found.velocity_max) == pytest.approx(v_b, rel=1e-10)
        assert greatest > 2 * v_b
        assert float(found.slips) == 7
        assert float(found.force_max) == pytest.approx(mu_s * m * G, rel=1e-12)
        assert float(found.x_max) == pytest.approx(
            mu_k * m * G / k + sqrt((drop / k) ** 2 + (v_b / omega) ** 2), rel=1e-10
        )

    def test_of_the_paper_in_numbers(self):
        found = outcome(belt(span=100))
        assert float(found.first_slip) == pytest.approx(7.3575, rel=1e-10)
        assert float(found.period) == pytest.approx(7.523422, abs=5e-7)

    def test_sticks_again_where_theory_says(self):
        run = ringsweep.simulate(belt(span=12.0))
        end_of_slip = np.flatnonzero(np.diff(run["mode"].values) == 1)[0]
        assert float(run.x[end_of_slip]) == pytest.approx(0.24525, abs=1e-10)

    def test_from_rest_slides_first(self):
        """From rest on a moving belt the body slips until it has the belt's speed, then sticks."""
        omega, mu = sqrt(2.0), 0.981 / 2
        t = atan(0.1 / omega / mu / sqrt(1 - (0.1 / omega / mu) ** 2)) / omega
        x = mu * (1 - cos(omega * t))
        assert mu * omega * sin(omega * t) == pytest.approx(0.1)
        found = outcome(belt(start=0.0))
        assert float(found.first_slip) == pytest.approx(t + (0.73575 - x) / 0.1, rel=1e-10)


class TestCoulomb:
    def test_is_an_undamped_harmonic(self):
        found = outcome(belt("coulomb", span=40.0))
        assert REGIMES[int(found.regime)] == "oscillatory"
        assert float(found.period) == pytest.approx(2 * pi / sqrt(2.0), rel=1e-10)
        assert float(found.x_max) == pytest.approx(0.4905 + 0.1 / sqrt(2.0), rel=1e-10)

    def test_oscillation_on_a_belt_at_rest_decays_by_a_fixed_step_and_rests(self):
        """The amplitude falls by 4F/k a cycle; at 3 F_c/k and a half it comes to rest."""
        scene = belt("coulomb", v_b=0.0, k=1.0, mu_k=0.4 / G, span=30.0) | {"initial": {"x": 3.0, "velocity": 0.0}}
        run, found = ringsweep.simulate(scene), outcome(scene)
        turning = run.x.values[np.flatnonzero(np.abs(run.velocity.values) < 1e-12)]
        for expected in (3.0, -2.2, 1.4, -0.6):
            assert np.abs(turning - expected).min() < 1e-10
        assert float(found.x_end) == pytest.approx(-0.2 + 0.4, abs=0.41)
        assert abs(float(found.x_end)) <= 0.4
        assert float(found.velocity_end) == 0.0


class TestLimits:
    def test_a_regularised_law_tends_to_the_law_that_it_regularises(self):
        """Linearly in the width of the band: the creep of stick is as fast as the band is wide."""
        limit = float(outcome(belt("tustin", alpha=1e3)).period)
        widths = np.array([1e-4, 1e-5, 1e-6])
        errors = [abs(float(outcome(belt("bengisu-akay", alpha=1e3, v0=v0)).period) - limit) for v0 in widths]
        slopes = np.diff(np.log(errors)) / np.diff(np.log(widths))
        np.testing.assert_allclose(slopes, 1.0, atol=0.35)

    def test_a_steeper_tail_tends_to_stiction(self):
        limit = float(outcome(belt("stiction")).period)
        errors = [abs(float(outcome(belt("tustin", alpha=alpha)).period) - limit) for alpha in (1e4, 1e5, 1e6)]
        assert np.log(errors[0] / errors[1]) / np.log(10) == pytest.approx(1.0, abs=0.2)
        assert np.log(errors[1] / errors[2]) / np.log(10) == pytest.approx(1.0, abs=0.2)

    def test_methods_agree_where_a_constant_step_can_follow(self):
        scene = belt("bengisu-akay", v0=0.02, alpha=5.0, span=20.0)
        fine = ringsweep.sweep(scene, {"body.mass": [1.0]}, solver={"method": "rk4", "steps": 40_000})
        auto = ringsweep.sweep(scene, {"body.mass": [1.0]})
        assert float(fine.x_end[0]) == pytest.approx(float(auto.x_end[0]), abs=1e-7)
        assert float(fine.stiffness[0]) < 2.785
        assert (fine.certified == 1).all()


class TestExtremes:
    @pytest.mark.parametrize("law", ["stiction", "bengisu-akay"])
    @pytest.mark.parametrize(
        "change",
        [{"v_b": 0.0}, {"v_b": 1e-9}, {"mu_s": 0.1}, {"m": 1e-6}, {"k": 0.0}, {"mu_s": 0.0, "mu_k": 0.0}],
        ids=str,
    )
    def test_gives_numbers_or_says_that_it_has_none(self, law, change):
        of_law = {"v0": 1e-6, "alpha": 1e4} if law == "bengisu-akay" else {}
        found = outcome(belt(law, start=0.0, span=20.0, **change, **of_law))
        assert REGIMES[int(found.regime)] != "failed"
        for name in ("t_end", "x_end", "velocity_end", "x_min", "x_max", "force_max"):
            assert np.isfinite(found[name])

    def test_without_spring_the_body_ends_at_the_speed_of_the_belt(self):
        found = outcome(belt(k=0.0, start=0.0))
        assert float(found.velocity_end) == pytest.approx(0.1, rel=1e-12)
        assert float(found.x_end) == pytest.approx(0.1 * 60 - 0.5 * 0.1**2 / 0.981, rel=1e-10)
        assert REGIMES[int(found.regime)] == "resting"


class TestInput:
    def test_a_belt_has_a_velocity_or_a_drive(self):
        scene = belt()
        del scene["belt"]
        with pytest.raises(ringsweep.InputError, match="velocity: missing"):
            ringsweep.simulate(scene)
        rocking = scene | {"drive": {"law": "sinusoidal", "amplitude": "0.2 m", "frequency": 1.0}}
        assert REGIMES[int(ringsweep.simulate(rocking | {"time": {"span": 5}}).regime)] != "failed"
        with pytest.raises(ringsweep.InputError, match="given beside drive"):
            ringsweep.simulate(rocking | {"belt": {"velocity": 0.1}})
