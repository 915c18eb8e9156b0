"""Friction that is not the same in both directions of sliding."""

import numpy as np
import pytest
import xarray as xr
from belts import on_belt, outcome
from scipy.optimize import brentq

import ringsweep
from ringsweep.physics.friction.laws import Definition, define
from ringsweep.physics.friction.speeds import hidden_fields
from ringsweep.physics.friction.velocity import EXPRESSIONS

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


def test_setting_one_way_of_a_number_leaves_the_other_way_as_it_is():
    number, pair = ({"law": "stiction", "mu_s": mu_s, "mu_k": 0.2} for mu_s in (0.3, {"forward": 0.5, "backward": 0.3}))
    run = ringsweep.simulate(conveyor(number), set={"friction.mu_s.forward": 0.5})
    assert run.x_end.item() == ringsweep.simulate(conveyor(pair)).x_end.item()


def test_an_axis_over_one_way_of_a_number_leaves_the_other_way_as_it_is():
    number, pair = ({"law": "stiction", "mu_s": mu_s, "mu_k": 0.2} for mu_s in (0.3, {"backward": 0.3}))
    axis = {"friction.mu_s.forward": [0.4, 0.5]}
    runs = [ringsweep.sweep(conveyor(friction), axis, progress=False)[[*NAMES]] for friction in (number, pair)]
    xr.testing.assert_identical(*(run.drop_attrs() for run in runs))


def on_ring(model, friction, **rest):
    """A body at the bottom of a ring, which has a zone if the friction has a rough one."""
    body = {"inertia": 4.47e-5, "half_distance": 0.025, "ball_radius": 0.01} if model == "ring" else {}
    zone = {"zone": {"half_angle": 0.5}} if "rough" in friction else {}
    scene = {"model": model, "body": {"mass": 0.076, **body}, "ring": {"radius": 0.05}, "friction": friction, **zone}
    return scene | {"time": {"span": 2.0}} | rest


@pytest.mark.slow
def test_a_ring_lifts_a_body_up_to_the_static_friction_of_the_way():
    # A ring that turns forwards leaves the body behind: it slides backwards.
    mu = {"mu_s": {"forward": 0.4, "backward": 0.25}, "mu_k": {"forward": 0.3, "backward": 0.2}}
    for omega, mu_s in ((1.0, 0.25), (-1.0, 0.4)):
        motion = {"drive": {"law": "constant", "amplitude": omega}, "initial": {"omega": omega}}
        run = ringsweep.simulate(on_ring("ring-single-contact", {"law": "stiction", "elsewhere": mu}, **motion))
        excess = lambda phi: 9.81 * (np.sin(phi) - mu_s * np.cos(phi)) - mu_s * 0.05  # noqa: B023, E731
        assert run.event_time[0].item() == pytest.approx(brentq(excess, 0.0, 1.0, xtol=1e-15), rel=1e-9)
        assert run.certified.item() == 1


@pytest.mark.slow
def test_two_contacts_share_a_pull_as_the_friction_of_its_way_does():
    """Contact 1 stands in a zone; the pull on the stuck body turns twice in a period."""
    in_zone, beside = {"forward": 0.5, "backward": 0.2}, {"forward": 0.1, "backward": 0.3}
    friction = {"law": "coulomb", "rough": {"mu_k": in_zone}, "elsewhere": {"mu_k": beside}}
    drive = {"law": "sinusoidal", "amplitude": 0.02, "frequency": 1.0}
    zone = {"half_angle": 0.5, "center": -0.6}
    run = ringsweep.simulate(on_ring("ring", friction, drive=drive, zone=zone, initial={"omega": 0.04 * np.pi}))
    assert (run["mode"] == 0).all()
    assert run.certified.item() == 1
    mass, inertia, radius, reach, half = 0.076, 4.47e-5, 0.05, 0.04, 0.025
    xi, sine, cosine = (reach**2 - half**2) ** 0.5, half / reach, (1.0 - (half / reach) ** 2) ** 0.5
    # Both friction forces from the balance about the axis and from the radial one.
    both = ((inertia + mass * xi**2) * run.epsilon + mass * 9.81 * xi * np.sin(run.phi)) / radius
    load = mass * (9.81 * np.cos(run.phi) + xi * run.omega**2)
    apart = ((run.normal_1 + run.normal_2) * cosine - load) / sine
    ways = np.where(both < 0.0, "forward", "backward")
    mu_1, mu_2 = (np.array([mu[way] for way in ways]) for mu in (in_zone, beside))
    assert {*ways} == {"forward", "backward"}
    assert abs((both + apart) * mu_2 * run.normal_2 - (both - apart) * mu_1 * run.normal_1).max() < 1e-10


def by_formula(mu, **rest):
    """Friction by formula that holds a body at rest up to ``mu_s``."""
    return {"law": "formula", "mu": mu, "at_rest": "mu_s", **rest}


@pytest.mark.slow
@pytest.mark.parametrize("method", [{"method": "auto"}, {"method": "rk4", "steps": 3000}])
@pytest.mark.parametrize("model", ["ring", "ring-single-contact"])
def test_direction_in_a_formula_is_friction_typed_each_way_on_a_ring(model, method):
    static, places = {"forward": 0.3, "backward": 0.6}, {"rough": 1.0, "elsewhere": 0.5}
    scaled = lambda share, numbers: {way: share * mu for way, mu in numbers.items()}  # noqa: E731
    typed = {place: {"mu_s": scaled(k, static), "mu_k": scaled(0.8 * k, static)} for place, k in places.items()}
    formula = {place: {"mu_s": scaled(k, static), "mu_k": 0.24 * k} for place, k in places.items()}
    runs = [
        ringsweep.sweep(
            on_ring(model, friction, drive={"law": "sinusoidal", "frequency": 1.0}, initial={"omega": 2.0}),
            {"drive.amplitude": np.linspace(0.1, 3.0, 8)},
            solver=method,
            progress=False,
        )
        for friction in ({"law": "stiction", **typed}, by_formula("mu_k*piecewise(direction > 0, 1, 2)", **formula))
    ]
    for name in ("regime", "t_end", "phi_end", "omega_end", "stick_time", "normal_min_1", "reversals"):
        np.testing.assert_allclose(*(run[name] for run in runs), rtol=1e-12, atol=1e-12)
    assert method["method"] == "rk4" or all((run.certified == 1).all() for run in runs)


@pytest.mark.slow
def test_rk4_and_events_agree_under_a_formula_of_the_signed_velocity():
    mu = "mu_k*tanh(v/(w*(1 + g*direction))) + c*max(direction*v - v1, 0)"
    friction = {"law": "formula", "mu": mu, "mu_k": 0.3, "w": 0.02, "g": 0.4, "c": 0.2, "v1": 0.1}
    scene = conveyor(friction, stiffness=8.0, velocity=0.2, force=(12.0, 0.4), start=(0.1, 0.3), span=6.0)
    run, coarse = outcome(scene), outcome(scene, method="rk4", steps=60000)
    assert run.x_end.item() == pytest.approx(coarse.x_end.item(), abs=1e-6)
    assert run.certified.item() == 1


def test_a_formula_switches_each_way_at_the_speed_of_that_way():
    mu = "mu_k + c*max(v - v1*(2 - direction), 0)"
    found = define(Definition(mu, "mu_k"))
    columns = {"c": np.array([0.1]), "v1": np.array([0.5])}
    surfaces = [(np.array([0.3]), np.array([0.3]))] * 2
    fields = hidden_fields(EXPRESSIONS[found], columns, surfaces)
    assert fields["edges"][0, :3].tolist() == pytest.approx([0.5, 1.5, np.inf])


def test_a_formula_may_end_in_one_direction_only():
    """Backwards friction turns negative at 2 m/s; forwards it never does."""
    found = define(Definition("mu_k*(1 + direction*v/w)", "mu_k"))
    surfaces = [(np.array([0.3]), np.array([0.3]))] * 2
    fields = hidden_fields(EXPRESSIONS[found], {"w": np.array([2.0])}, surfaces)
    assert np.isinf(fields["thresholds"]).all()
    assert fields["thresholds_back"].min() == pytest.approx(2.0)
