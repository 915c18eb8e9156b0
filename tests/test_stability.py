"""Extreme scenes: `auto` certifies no wrong run, `rk4` certifies no run beyond its limit, energy is conserved."""

from math import pi, sqrt

import numpy as np
import pytest
from solutions import solve

from ringsweep.compile import take
from ringsweep.models import MODELS
from ringsweep.models.ring.record import Outcome
from ringsweep.physics.ring import acceleration, free_determinant
from ringsweep.quantities.flags import JAMMED, OSCILLATORY, RESTING, SEPARATING
from ringsweep.solvers.certificate import with_errors
from ringsweep.solvers.event import Auto, Event, Implicit
from ringsweep.solvers.rk4 import RK4, STABILITY_LIMIT

FRICTIONLESS = {f"friction.{place}.mu_{kind}": 0.0 for place in ("rough", "rest") for kind in "sk"}
XI = sqrt((0.043378 - 0.010) ** 2 - 0.025**2)
OWN = sqrt(0.076 * XI / (4.47e-5 + 0.076 * XI**2))
"""Frequency of small swings without friction, divided by the root of gravity."""


def draw(count, seed):
    """Random extreme scenes by path, over many decades of v0, alpha, masses and inertias."""
    rng = np.random.default_rng(seed)

    def often(usual, low, high):
        return np.where(rng.random(count) < 0.3, 10.0 ** rng.uniform(low, high, count), usual)

    columns = {"friction.alpha": 10.0 ** rng.uniform(-1, 9, count), "friction.v0": 10.0 ** rng.uniform(-12, 3, count)}
    for place in ("rough", "rest"):
        mu_k = 10.0 ** rng.uniform(-3, 0.3, count)
        columns |= {
            f"friction.{place}.mu_k": mu_k,
            f"friction.{place}.mu_s": mu_k * rng.choice([1.0, 1.5, 4.0], count),
        }
    return columns | {
        "body.mass": often(0.076, -9, 6),
        "body.inertia": often(4.47e-5, -9, 6),
        "zone.half_angle": rng.choice([0.0, 1e-15, 1e-6, 0.3, pi], count),
        "zone.center": rng.choice([0.0, 1.0, -2.0], count),
        "initial.phi": rng.choice([0.0, 0.5, pi], count, p=[0.5, 0.4, 0.1]),
        "initial.omega": rng.choice([0.0, 1e-6, 20.0, -1e4], count),
        "drive.amplitude": rng.choice([0.0, 1e-12, 2.0, -20.0], count),
        "time.span": 10.0 ** rng.uniform(-3, 0.3, count),
        "gravity": often(9.81, -6, 4),
    }


@pytest.mark.parametrize(("law", "fine"), [("bengisu-akay", Implicit(1e-10)), ("tustin", Event(1e-13))])
def test_auto_certifies_no_wrong_run_in_extreme_scenes(cells, law, fine):
    columns = draw(600, seed=17)
    if law == "tustin":
        del columns["friction.v0"]
    batch = cells(columns, law=law, drive="arctan")
    found, exact = solve(Auto(max_steps=30_000), batch), solve(fine, batch)
    settled = (found.certified & exact.certified).astype(bool)
    assert settled.mean() > 0.97
    for name in ("regime", "motion", "separating_contact"):
        np.testing.assert_array_equal(getattr(found, name)[settled], getattr(exact, name)[settled])
    np.testing.assert_allclose(found.t_end[settled], exact.t_end[settled], atol=1e-3)
    np.testing.assert_allclose(found.phi_end[settled], exact.phi_end[settled], rtol=1e-3, atol=1e-3)
    assert len(set(found.regime)) >= 4


@pytest.mark.parametrize("law", ["bengisu-akay", "tustin"])
def test_body_with_very_large_inertia_keeps_its_contacts(cells, law):
    """Friction hardly moves the body, but it still loads the contacts: too long a step would see false reactions."""
    changes = {"body.inertia": 1e6, "drive.amplitude": 2.0, "friction.alpha": 1e5}
    changes |= {"friction.v0": np.geomspace(1e-9, 1e-3, 7)} if law == "bengisu-akay" else {}
    found = solve(Auto(), cells(changes, law=law, drive="arctan"))
    assert (found.regime == RESTING).all()
    assert found.certified.all()


@pytest.mark.parametrize("law", ["bengisu-akay", "stiction"])
def test_arc_all_round_the_ring_has_no_gap(cells, law):
    """Rounding leaves a very narrow rest of the ring, on which this body would jam."""
    changes = {"zone.half_angle": pi, "zone.center": np.linspace(-3.0, 3.0, 9), "initial.omega": 60.0}
    changes |= {"friction.rough.mu_s": 0.1, "friction.rough.mu_k": 0.1}
    jammed = {"friction.rest.mu_s": 3.0, "friction.rest.mu_k": 3.0}
    smooth = {"friction.rest.mu_s": 0.1, "friction.rest.mu_k": 0.1}
    seamed, seamless = (solve(Auto(), cells(changes | rest, law=law, drive="arctan")) for rest in (jammed, smooth))
    np.testing.assert_array_equal(seamed.regime, SEPARATING)
    np.testing.assert_allclose(seamed.t_separation, seamless.t_separation, rtol=1e-12)


def test_run_that_approaches_a_jam_is_jammed_and_not_separating(cells):
    """Both reactions grow without bound near the jam, and their power series come to a singularity."""
    changes = {
        "gravity": 1658.5181940544094,
        "friction.alpha": 398303945.4118323,
        "friction.rest.mu_k": 0.003533855927459637,
        "friction.rest.mu_s": 0.007921801333855385,
        "friction.rough.mu_k": 0.6056357754034847,
        "friction.rough.mu_s": 1.8311381410867449,
        "zone.half_angle": pi,
        "initial.phi": -0.6955526718682674,
        "initial.omega": 333.2476631309329,
        "drive.amplitude": 17.604301653296005,
        "time.span": 0.006601531514513469,
    }
    batch = cells(changes, law="tustin", drive="arctan")
    found = solve(Event(), batch)
    assert found.regime == JAMMED
    assert found.normal_min_1 > 1.0
    assert found.t_end == pytest.approx(0.0037337271, abs=1e-9)


def test_before_a_jam_the_velocity_has_a_limit_and_reactions_have_none(cells):
    """The determinant vanishes there. The run ends before, and the velocity nears it like the root of the time left."""
    static, kinetic = 1.8, 0.3
    changes = {"friction.rough.mu_s": static, "friction.rough.mu_k": kinetic, "zone.half_angle": pi}
    changes |= {"initial.omega": np.linspace(10.0, 40.0, 20), "drive.amplitude": 0.0, "friction.alpha": 5.0}
    batch = cells(changes, law="tustin", drive="arctan")
    found = solve(Auto(), batch)
    jams = (found.regime == JAMMED) & found.certified
    assert jams.sum() > 5
    assert np.isinf(found.normal_max_1[jams]).all()
    assert np.isinf(found.normal_max_2[jams]).all()
    assert (found.errors[jams, with_errors(Outcome._fields).index("normal_min_1")] < 1e-5).all()
    body = take(batch, 0).body
    speed = body.radius * found.omega_end[jams]
    mu = kinetic + (static - kinetic) * np.exp(-5.0 * abs(speed))
    with np.errstate(divide="ignore"):
        determinant = np.array([acceleration(body, -x, -x, (0.0, 1.0, 0.0))[1] for x in mu * np.sign(speed)])
    assert (abs(determinant) < 1e-12 * free_determinant(body)).all()


@pytest.mark.parametrize("rtol", [1e-3, 1e-4])
def test_loose_tolerance_causes_no_false_separation(cells, rtol):
    """An inaccurate power series of a reaction has roots that the reaction does not have."""
    static = {f"friction.{place}.mu_s": np.linspace(1.0, 5.0, 19) * mu for place, mu in (("rough", 0.3), ("rest", 0.1))}
    batch = cells(
        static | {"drive.amplitude": 2.0, "time.span": 10.0, "friction.alpha": 1e5}, law="tustin", drive="arctan"
    )
    found, exact = solve(Event(rtol), batch), solve(Event(1e-14), batch)
    np.testing.assert_array_equal(found.regime, exact.regime)
    assert set(exact.regime) == {OSCILLATORY, SEPARATING}


class TestRungeKutta:
    """`rk4` certifies no run beyond its limit of stability, whatever makes the system fast."""

    @staticmethod
    def run(batch, steps):
        result = RK4(steps).run(batch, MODELS["ring"].outcomes)
        return result, dict(zip(Outcome._fields, result.rows.T, strict=True))

    def test_rk4_does_not_certify_a_swing_too_fast_for_its_step(self, cells):
        """Without friction the eigenvalue is that of a pendulum, on the imaginary axis."""
        gravity = np.array([1e3, 1e5, 7e5, 9e5, 1e6, 1.2e6, 2e6])
        changes = {"gravity": gravity, "initial.phi": 1e-3, "time.span": 10.0}
        batch = cells(FRICTIONLESS | changes, drive="arctan")
        result, _ = self.run(batch, 15_000)
        true = OWN * np.sqrt(gravity) * 10.0 / 15_000
        np.testing.assert_allclose(result.stiffness[:4], true[:4], rtol=1e-2)
        assert not result.certified[true > STABILITY_LIMIT].any()
        # The second swing is stable too, but halving the step changes its speed by more than a hundredth.
        assert result.certified[0]

    def test_rk4_does_not_certify_a_launch_too_fast_for_its_step(self, cells):
        """Friction grows with the square of the speed, so the speed decays at a rate proportional to itself."""
        result, _ = self.run(cells({"initial.omega": np.array([1e2, 1e5]), "time.span": 0.02}, drive="arctan"), 20)
        slow, fast = result.stiffness
        assert 0.0 < slow < STABILITY_LIMIT < fast
        assert not result.certified[1]
