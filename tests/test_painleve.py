"""The determinant at which the body jams, from the equations of a body that is free to leave the race.

The gap accelerations are A N + b under the reactions N with their friction. No formula of the package is used. A body
on springs, which needs no criterion at all, confirms the ends of brute force in test_brute_force.
"""

import numpy as np
import pytest
import xarray as xr
from rings import course, rubs, shape
from solutions import gap_response, rod

import ringsweep
from ringsweep.physics import contact, ring
from ringsweep.quantities.flags import SEPARATING


def test_determinant_of_the_balances_is_that_of_the_gap_accelerations():
    """Of bodies from a narrow stance to a wide one, with friction up to 2 in both directions of slip."""
    rng, signs = np.random.default_rng(27), set()
    for _ in range(200):
        M, R, beta = rng.uniform(0.02, 0.5), rng.uniform(0.03, 0.1), np.radians(rng.uniform(5.0, 85.0))
        reach = R * rng.uniform(0.6, 0.9)
        inertia = M * (reach * np.sin(beta) * rng.uniform(0.4, 1.3)) ** 2
        body = rod(M, inertia, R, reach * np.cos(beta), np.sin(beta), np.cos(beta), 9.81)
        K1, K2 = rng.choice([-1.0, 1.0]) * rng.uniform(0.0, 2.0, 2)
        phi, omega = rng.uniform(-3.0, 3.0, 2)
        _, A = gap_response(body, (K1, K2), phi, omega)
        determinant = ring.acceleration(body, K1, K2, (np.sin(phi), np.cos(phi), omega))[1]
        of_balances = determinant * np.sin(2.0 * body.beta) / (body.mass**2 * body.inertia)
        assert of_balances == pytest.approx(np.linalg.det(A), abs=1e-10 * abs(A).max() ** 2)
        signs.add(bool(determinant > 0.0))
    assert signs == {True, False}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("angle", "offset", "inertia", "mu_s", "tilt"),
    [(0.118, 0.84, 0.753, (2.222, 0.174), 0.51), (0.116, 0.724, 0.626, (2.48, 0.488), 0.59)],
)
def test_body_sticks_on_where_the_determinant_vanishes(angle, offset, inertia, mu_s, tilt):
    """A narrow body is tilted until a contact opens; det A vanishes on the way."""
    M, R, g, frequency = 0.1, 0.05, 9.81, 0.05
    xi = offset * R * np.cos(angle)
    body = rod(M, inertia * M * R**2, R, xi, np.sin(angle), np.cos(angle), g)
    w = 2.0 * np.pi * frequency
    scene = (
        shape(M, inertia * M * R**2, R * np.sin(angle), 0.0, R, offset=xi - R * np.cos(angle), zone=(0.6, -0.6))
        | rubs("stiction", rest=(mu_s[1], mu_s[1]), rough=(mu_s[0], mu_s[0]))
        | course("sinusoidal", -tilt, frequency, omega=-tilt * w, span=4.9)
    )
    found = ringsweep.sweep(scene, {"drive.amplitude": [-tilt]}, progress=False)
    phi = found.phi_end.item()
    assert found.certified == 1
    assert found.separating_contact == 1
    assert found.stick_time.item() == pytest.approx(found.t_end.item(), rel=1e-14)
    determinants = []
    for share in (0.4, 0.9):
        at = np.sin(share * phi), np.cos(share * phi), 0.0
        kappa = contact.stick(body, *mu_s, at, 0.0)[0]
        determinants.append(ring.acceleration(body, -kappa * mu_s[0], -kappa * mu_s[1], at)[1])
    assert determinants[0] > 0.0 > determinants[1]
    # It ends where friction is exhausted, or contact 1 bears nothing.
    kappa, _, N1, _ = contact.stick(body, *mu_s, (np.sin(0.999 * phi), np.cos(0.999 * phi), 0.0), 0.0)
    assert 0.0 < min(1.0 - abs(kappa), N1 / (M * g)) < 0.01


@pytest.mark.slow
def test_wedged_body_follows_a_ring_that_starts_with_infinite_acceleration():
    """Its contacts are nearly opposite: the more the ring pulls, the more both press. Stick goes before slip.

    The time is that of ``benchmarks.reference``.
    """
    scene = (
        shape(0.0722696, 5.11858e-4, 0.0668469, 0.0247363, 0.0922752, zone=(2.07136, np.pi))
        | rubs("stiction", rest=(0.221905, 0.221905), rough=(0.588606, 0.424211))
        | course("power", -1.86835, 1.1375, phi=0.659025, omega=0.0, span=2.75782)
    )
    found = ringsweep.sweep(scene, {"drive.exponent": [1.1375]}, progress=False)
    t = found.t_separation.item()
    assert t == pytest.approx(1.1534711829171995, rel=1e-12)
    assert found.stick_time.item() == pytest.approx(t, rel=1e-12)
    assert found.phi_end.item() == pytest.approx(0.659025 - 1.86835 * t**1.1375, rel=1e-12)


@pytest.mark.slow
def test_infinite_acceleration_of_the_ring_is_the_limit_of_great_ones():
    """It slides under the body, takes it along or pushes it off its contacts, as one of 1e9 rad/s^2 does."""
    rng, count = np.random.default_rng(29), 400
    radius = rng.uniform(0.03, 0.1, count)
    ball = radius * rng.uniform(0.1, 0.45, count)
    half_distance = (radius - ball) * np.sin(rng.uniform(0.05, 1.5, count))
    mu_s = rng.uniform(0.3, 1.2, (2, count))
    points = {
        "ring.radius": radius,
        "body.ball_radius": ball,
        "body.half_distance": half_distance,
        "body.inertia": 0.1 * half_distance**2 * 10 ** rng.uniform(-2.0, 0.5, count),
        "friction.rest.mu_s": mu_s[0],
        "friction.rest.mu_k": mu_s[0] * rng.uniform(0.4, 1.0, count),
        "friction.rough.mu_s": mu_s[1],
        "friction.rough.mu_k": mu_s[1] * rng.uniform(0.4, 1.0, count),
        "initial.phi": rng.uniform(-1.5, 1.5, count),
    }
    direction = rng.choice([-1.0, 1.0], count)
    scene = {
        "model": "ring",
        "body": {"mass": 0.1},
        "friction": {"law": "stiction"},
        "zone": {"half_angle": 2.07136, "center": np.pi},
        "drive": {"law": "power"},
        "time": {"span": 1e-6},
    }
    ends = []
    for amplitude, exponent in ((1.0, 1.5), (0.5e9, 2.0)):
        columns = points | {"drive.amplitude": amplitude * direction, "drive.exponent": np.full(count, exponent)}
        table = {path: xr.DataArray(values, dims="run") for path, values in columns.items()}
        found = ringsweep.sweep(scene, table, progress=False)
        at_once = found.t_end.values < 1e-10
        ends.append(np.where(at_once, 10 * found.regime.values + found.separating_contact.values, 0))
        if exponent < 2.0:
            # A body that is pushed off is at rest, while the ring moves.
            pushed_off = at_once & (found.regime.values == SEPARATING)
            assert np.abs(found.omega_end.values[pushed_off]).max() < 1e-12
    assert np.array_equal(*ends)
    assert {0, 31, 32, 33} <= set(ends[0])
