"""Friction that is not the same in both directions of sliding."""

import numpy as np
import pytest
import xarray as xr
from belts import on_belt, outcome
from scipy.optimize import brentq

import ringsweep

NAMES = "regime", "t_end", "x_end", "velocity_end", "x_min", "x_max", "stick_time", "first_slip", "force_max", "slips"


def two_way(forward, backward, law="stiction", **rest):
    """Friction with ``(mu_s, mu_k)`` in each direction."""
    pairs = zip(("mu_s", "mu_k"), forward, backward, strict=True)
    return {"law": law, **{name: {"forward": ahead, "backward": back} for name, ahead, back in pairs}, **rest}


def conveyor(friction, **rest):
    """A body on a floor at rest that a force shakes, without a spring unless one is given."""
    return on_belt(friction, **({"stiffness": 0.0, "velocity": 0.0, "force": (5.0, 0.5), "span": 20.0} | rest))


def test_a_body_stops_on_each_way_by_the_friction_of_that_way():
    for speed, mu in ((1.5, 0.3), (-1.5, 0.2)):
        run = outcome(conveyor(two_way((0.4, 0.3), (0.25, 0.2)), force=(0.0, 0.5), start=(0.0, speed)))
        assert run.x_end.item() == pytest.approx(np.sign(speed) * speed**2 / (2.0 * mu * 9.81), rel=1e-12)
        assert run.certified.item() == 1


def test_a_belt_drags_a_body_up_to_the_static_friction_of_the_way():
    # A belt that moves forwards leaves the body behind: it slides backwards.
    for velocity, mu in ((0.1, 0.25), (-0.1, 0.4)):
        run = outcome(conveyor(two_way((0.4, 0.3), (0.25, 0.2)), stiffness=2.0, velocity=velocity, force=(0.0, 0.5)))
        assert run.first_slip.item() == pytest.approx(mu * 9.81 / (2.0 * abs(velocity)), rel=1e-12)


def test_force_of_zero_mean_drives_a_ratchet_at_the_speed_of_closed_form():
    amplitude, frequency, mu = 5.0, 0.5, 0.2
    omega = 2.0 * np.pi * frequency
    begin = np.arcsin(mu * 9.81 / amplitude) / omega
    length = brentq(lambda s: _slide(s, begin, amplitude, omega, mu)[0], 0.1, 1.0 / frequency, xtol=1e-15)
    run = outcome(conveyor(two_way((mu, mu), (0.6, 0.6))))
    assert run.drift.item() == pytest.approx(_slide(length, begin, amplitude, omega, mu)[1] * frequency, rel=1e-10)
    assert run.certified.item() == 1


def _slide(s, begin, amplitude, omega, mu):
    """Velocity and displacement of a body of 1 kg, a time `s` after it has begun to slide forwards."""
    phase, rate = omega * begin, amplitude / omega
    velocity = rate * (np.cos(phase) - np.cos(phase + omega * s)) - mu * 9.81 * s
    place = rate * (s * np.cos(phase) - (np.sin(phase + omega * s) - np.sin(phase)) / omega)
    return velocity, place - 0.5 * mu * 9.81 * s * s


def test_a_way_without_friction_holds_nothing_and_the_other_one_does():
    # A force that begins backwards is held from the first instant on, one that begins forwards never.
    friction = two_way((0.0, 0.0), (0.6, 0.6))
    held = outcome(conveyor(friction, force=(5.0, 0.5, np.pi), span=0.9))
    assert held.stick_time.item() == pytest.approx(0.9, rel=1e-12)
    free = outcome(conveyor(friction, span=0.9))
    assert free.stick_time.item() == 0.0


def test_two_equal_numbers_are_one_number():
    one, two = ({"law": "stiction", "mu_s": 0.3, "mu_k": 0.2}, two_way((0.3, 0.2), (0.3, 0.2)))
    axes = {"force.amplitude": np.linspace(1.0, 9.0, 12)}
    runs = [ringsweep.sweep(conveyor(f, stiffness=3.0), axes, progress=False)[[*NAMES]] for f in (one, two)]
    xr.testing.assert_identical(*(run.drop_attrs() for run in runs))


@pytest.mark.slow
def test_rk4_and_events_agree_under_a_smooth_law():
    friction = two_way((0.4, 0.3), (0.25, 0.1), "bengisu-akay", alpha=10.0, v0=0.05)
    scene = conveyor(friction, stiffness=8.0, velocity=0.2, force=(3.0, 0.4), start=(0.1, 0.3), span=6.0)
    run, coarse = outcome(scene), outcome(scene, method="rk4", steps=60000)
    assert run.x_end.item() == pytest.approx(coarse.x_end.item(), abs=1e-6)
    assert run.certified.item() == 1


@pytest.mark.parametrize(
    ("friction", "words"),
    [
        ({"law": "stiction", "mu_s": {"forward": 0.3}, "mu_k": 0.1}, "scene.friction.mu_s.backward: missing"),
        ({"law": "stiction", "mu_s": {"up": 0.3}, "mu_k": 0.1}, "scene.friction.mu_s.up: unknown key"),
        (two_way((0.3, 0.2), (0.1, 0.2)), "scene.friction.mu_k: 0.2 exceeds mu_s"),
        (
            two_way((0.3, 0.2), (0.3, 0.2), "lugre", sigma0=1e4, v_s=0.1),
            "scene.friction.mu_s: not available with law lugre",
        ),
    ],
)
def test_mistakes_are_located(friction, words):
    with pytest.raises(ringsweep.InputError, match=words):
        ringsweep.sweep(conveyor(friction), {}, progress=False)
