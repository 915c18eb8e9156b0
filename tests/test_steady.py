"""Launch at steady slip: the body rests in space on a belt that slides along under it."""

from math import exp

import numpy as np
import pytest
from belts import on_belt
from solutions import cell_of

import ringsweep
from ringsweep.physics.friction.bristles import stribeck

G = 9.81
TUSTIN = {"law": "tustin", "mu_s": 0.5, "mu_k": 0.3, "alpha": 5.0}
BRISTLES = {"mu_s": 0.5, "mu_k": 0.3, "v_s": 0.1, "sigma0": 1e4, "sigma1": 10.0, "sigma2": 0.4}


def launched(law, *, v_b=0.2, growth=0.0, incline=0.0, viscous=None, push=0.0, **parts):
    """Scene of a body that is launched at steady slip."""
    scene = on_belt(law, parts.pop("k", 20.0), velocity=v_b, span=parts.pop("span", 20.0), **parts)
    scene["body"]["normal_stiffness"] = growth
    scene["belt"]["incline"] = incline
    scene["friction"] = law | ({} if viscous is None else {"viscous": viscous})
    return scene | {"force": {"constant": push}, "initial": {"steady": "slip"}}


class TestBalance:
    """What pulls the body along adds up to zero."""

    @pytest.mark.parametrize("law", ["tustin", "coulomb", "lugre"])
    def test_forces_on_the_body_balance(self, law):
        rng = np.random.default_rng(6)
        for _ in range(40):
            mu_k, m, k, c, k_3, k_n, push, incline = rng.uniform(
                (0.1, 0.3, 5.0, 0.0, 0.0, -2.0, -5.0, -0.5), (0.5, 3.0, 30.0, 1.0, 50.0, 2.0, 5.0, 0.5)
            )
            v_b, mu_s, viscous = rng.uniform(0.05, 1.0) * rng.choice([-1.0, 1.0]), 1.4 * mu_k, 0.0
            friction = {"law": law, "mu_k": mu_k}
            if law == "tustin":
                friction |= {"mu_s": mu_s, "alpha": 3.0}
                mu = mu_k + (mu_s - mu_k) * exp(-3.0 * abs(v_b))
            elif law == "lugre":
                friction |= BRISTLES | {"mu_s": mu_s, "mu_k": mu_k}
                mu = mu_k + (mu_s - mu_k) * exp(-((v_b / 0.1) ** 2))
            else:
                viscous, mu = 0.7, mu_k
            parts = {"mass": m, "k": k, "damping": c, "cubic": k_3, "growth": k_n, "push": push, "incline": incline}
            cell = cell_of(launched(friction, v_b=v_b, **parts, viscous=viscous or None))
            x, load = cell.initial_x, m * G * np.cos(incline) + k_n * cell.initial_x
            if law == "lugre":
                assert cell.initial_z == pytest.approx(-np.sign(v_b) * mu * m * G * np.cos(incline) / 1e4)
                viscous = load * 0.4 / (m * G * np.cos(incline))
            pull = np.sign(v_b) * mu * load + viscous * v_b - m * G * np.sin(incline) + push
            assert k * x + k_3 * x**3 == pytest.approx(pull, abs=1e-11 * (abs(push) + m * G))
            assert cell.initial_v == -v_b

    def test_body_on_a_softening_spring_rests_in_the_place_that_is_stable(self):
        cell = cell_of(launched({"law": "coulomb", "mu_k": 0.3}, cubic=-30.0))
        outer, inner = sorted(root for root in np.roots([-30.0, 0.0, 20.0, -0.3 * G]).real if root > 0.0)[::-1]
        assert cell.initial_x == pytest.approx(inner, rel=1e-12)
        assert inner < np.sqrt(20.0 / 90.0) < outer

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("law", "solver"),
        [(TUSTIN, "event"), (TUSTIN, {"method": "rk4", "steps": 2000}), ({"law": "lugre", **BRISTLES}, "auto")],
    )
    def test_damped_body_stays_and_is_said_to_slide(self, law, solver):
        run = ringsweep.simulate(
            launched(law, damping=8.0, cubic=5.0, growth=1.0, incline=0.2, push=1.0), solver=solver
        )
        assert np.ptp(run.x.values) < 1e-9
        assert ringsweep.words(run.regime).item() == "sliding"
        assert ringsweep.words(run.long_run).item() == "steady"
        assert run.certified == 1 or "steps" in solver


class TestHopfBifurcation:
    """Steady sliding loses its stability where the damper is weaker than friction falls: c = -N dmu/dv."""

    @staticmethod
    def found(scene, path, ends):
        config = {"scene": scene, "record": {"exponent": True}}
        return ringsweep.threshold(config, path, "steady", ends, 1e-8, scan=33)

    @pytest.mark.slow
    def test_threshold_is_where_the_damper_balances_the_slope_of_friction(self):
        for v_b in (0.05, 0.6):
            found = self.found(launched(TUSTIN, damping=0.0, v_b=v_b), "damper.coefficient", (0.0, 20.0))
            exact = G * 5.0 * (0.5 - 0.3) * exp(-5.0 * v_b)
            assert abs(found.damper_coefficient.item() - exact) <= found.error.item() + 1e-8
            assert found.begins.item() == 1
            assert ringsweep.words(found.beyond).item() == "transient"

    @pytest.mark.slow
    def test_stiff_bristles_have_the_threshold_of_their_steady_friction(self):
        """They follow the sliding velocity at once, but for a lag of the order of 1/sigma0."""
        law = {"law": "lugre", **BRISTLES, "sigma0": 1e6, "sigma1": 0.0, "sigma2": 0.0}
        found = self.found(launched(law, damping=0.0, v_b=0.1), "damper.coefficient", (0.0, 30.0))
        slope = cell_of(launched(law, v_b=0.1)).law
        assert found.damper_coefficient.item() == pytest.approx(-G * stribeck(slope, 0.5, 0.3, 0.1)[1], rel=1e-3)

    @pytest.mark.slow
    def test_critical_stiffness_of_friction_that_ages_is_the_published_one(self):
        """k_c = F_N (b - a)/D_c (1 + m v^2/(F_N a D_c))."""
        law = {"law": "dieterich", "mu0": 0.6, "a": 0.01, "b": 0.015}
        law |= {"critical_distance": 1e-4, "reference_velocity": 1e-6}
        for v_b in (1e-5, 1e-2):
            found = self.found(launched(law, v_b=v_b, span=4e-3 / v_b), "spring.stiffness", (100.0, 20000.0))
            exact = G * 0.005 / 1e-4 * (1.0 + v_b**2 / (G * 0.01 * 1e-4))
            assert found.spring_stiffness.item() == pytest.approx(exact, rel=1e-5)
