"""Shocks: the largest jump of the acceleration, and the greatest normal reactions."""

import numpy as np
import pytest
from belts import on_belt
from rings import course, particle, rubs

import ringsweep
from ringsweep.models import MODELS

G, RADIUS, MASS = 9.81, 0.2, 0.1

PARTICLE = (
    particle(MASS, RADIUS, zone="20 deg")
    | rubs("stiction", rest=(0.3, 0.1), rough=(0.5, 0.4))
    | course("arctan", 0, omega="8 rad/s", span="3 s")
)
BELT = on_belt({"law": "stiction", "mu_s": 0.15, "mu_k": 0.1}, 2, velocity=0.1, span="60 s")


def one(scene, **options):
    """Outcomes of one run."""
    path = "belt.velocity" if scene["model"] == "belt" else "initial.omega"
    value = 0.1 if scene["model"] == "belt" else scene["initial"]["omega"]
    return ringsweep.sweep(scene, {path: [value]}, progress=False, **options).isel({path.replace(".", "_"): 0})


def jumps_at(phi, omega, law):
    """Magnitudes by which the acceleration of a particle may jump at this place.

    Friction K acts with the reaction m (g cos(phi) + R omega^2), so that a jump of K changes phi'' by that of
    K (g cos(phi)/R + omega^2).
    """
    load = G * np.cos(phi) / RADIUS + omega**2
    return [abs(change) * load for change in law]


@pytest.fixture(scope="module")
def found():
    return one(PARTICLE)


@pytest.fixture(scope="module")
def history():
    return ringsweep.simulate(PARTICLE, samples=4000)


class TestParticle:
    @pytest.mark.slow
    def test_largest_jump_is_that_of_friction_at_an_edge_a_stop_or_a_reversal(self, found, history):
        at = float(found.t_jump_max)
        after = int(np.searchsorted(history.time, at))
        phi, omega = float(history.phi[after]), float(history.omega[after])
        # From smooth to rough, through zero speed in the zone or outside it, and from slip to rest.
        allowed = [*jumps_at(phi, omega, (0.3, 0.8, 0.2)), abs(float(history.epsilon[after - 1]))]
        assert min(abs(float(found.jump_max) / jump - 1.0) for jump in allowed) < 1e-3

    def test_no_jump_of_the_history_is_larger(self, found, history):
        gaps, changes = np.diff(history.time), np.abs(np.diff(history.epsilon))
        assert changes[gaps == 0.0].max(initial=0.0) <= float(found.jump_max) * (1 + 1e-9)
        assert changes.max() == pytest.approx(float(found.jump_max), rel=0.05)

    @pytest.mark.slow
    def test_constant_steps_do_not_locate_jumps(self, found):
        by_steps = one(
            PARTICLE | {"friction": PARTICLE["friction"] | {"law": "bengisu-akay", "alpha": 10, "v0": 0.1}},
            solver={"method": "rk4", "steps": 3000},
        )
        assert np.isnan(by_steps.jump_max)
        assert np.isnan(by_steps.t_jump_max)
        assert float(by_steps.normal_max_1) == pytest.approx(float(found.normal_max_1), rel=1e-3)


class TestBelt:
    def test_largest_jump_is_the_drop_of_friction_at_breakaway(self):
        """At a stop the drop is that from kinetic friction to the pull of the spring, which is smaller."""
        found = one(BELT)
        assert float(found.jump_max) == pytest.approx((0.15 - 0.1) * G, rel=1e-9)
        assert found.jump_max.attrs["units"] == "m s-2"
        # The spring reaches breakaway when the belt has carried the body by mu_s m g / k.
        assert float(found.t_jump_max) == pytest.approx(0.15 * G / 2 / 0.1, rel=1e-9)

    def test_of_jumps_that_differ_by_errors_only_the_first_tells_the_time(self):
        """Each breakaway and each stop of a cycle makes the same jump."""
        velocities = np.linspace(0.05, 0.2, 40)
        found = ringsweep.sweep(BELT, {"belt.velocity": velocities}, progress=False)
        np.testing.assert_allclose(found.t_jump_max, 0.15 * G / 2 / velocities, rtol=1e-9)

    def test_friction_without_a_drop_makes_no_jump(self):
        """The body is released at the speed of the belt, and friction that does not drop lets it slide on smoothly."""
        found = one(BELT | {"friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.15}, "time": {"span": "7.5 s"}})
        assert float(found.jump_max) == 0.0
        assert np.isnan(found.t_jump_max)


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_bounds_have_the_units_of_their_numbers_and_are_absent_with_them(model):
    variables = model.variables
    assert {f"{name}_error" for name in model.absent} & variables.keys() <= model.absent
    for name in variables:
        if (bound := f"{name}_error") in variables:
            assert variables[bound].units == variables[name].units, name


def test_nothing_jumps_under_a_smooth_law_without_zones():
    law = {"law": "bengisu-akay", "mu_s": 0.15, "mu_k": 0.1, "alpha": 100, "v0": 1e-4}
    found = one(BELT | {"friction": law})
    assert found.slips > 0
    assert found.jump_max == 0.0
    assert np.isnan(found.t_jump_max)
