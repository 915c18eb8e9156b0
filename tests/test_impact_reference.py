"""The reference of ``benchmarks.brute_force``, most of it after a lost contact; it knows nothing of the package."""

import math

import pytest
from rings import bump, course, rubs, shape

from benchmarks.reference import compliant, go_on, rattling
from benchmarks.reference.aftermath import MOST_EVENTS
from benchmarks.reference.problem import problem

pytestmark = pytest.mark.slow

#: The friction of this body rises steeply at a speed of 0.015 m/s.
BUMP = (
    shape(0.313781, 0.000143466, 0.0270851, 0.0190461, 0.0606886, zone=(0.267026, -1.78478))
    | bump(rest=(1.17574, 0.830991), rough=(0.648814, 0.597697), vb=0.0150096, w=0.00037879, h=0.337113)
    | course("power", 1.21617, 1.05325, phi=1.17837, omega=0.0)
)


#: Bodies at rest on rings whose acceleration is infinite at 0, and when a contact is lost.
AT_ONCE = [
    # Left behind, caught up after 4e-13 s, and held until the falling acceleration unloads contact 1.
    pytest.param(
        shape(0.220058, 1.29634e-06, 0.00313086, 0.00909936, 0.0313716, offset=0.00286972)
        | bump(rest=(0.628147, 0.275179), vb=0.0591481, w=0.0036196, h=-0.149709)
        | course("power", 0.118852, 1.75063, phi=-0.778751, omega=0.0),
        1.49134405e-11,
        id="caught up",
    ),
    # Left behind for good, although stick is admissible from 1e-10 s on. The time is that of SciPy's DOP853.
    pytest.param(
        shape(0.298869, 0.000687997, 0.0394439, 0.0258572, 0.0665151, zone=(0.37743, -2.53899))
        | bump(rest=(0.33283, 0.0031922), rough=(0.338215, 0.00402841), vb=0.158546, w=0.0177405, h=0.0825207)
        | course("power", -16.1635, 1.90444, phi=-0.00150168, omega=0.0),
        0.34350943534083,
        id="left behind",
    ),
    # Left behind so fast that the ring passes a bump of friction at once, which unloads contact 2.
    pytest.param(BUMP, 3.61221169e-14, id="over a bump"),
]


@pytest.mark.parametrize(("scene", "lost"), AT_ONCE)
def test_first_instant_of_a_ring_with_infinite_acceleration_is_followed(scene, lost):
    scene = {"model": "ring", "time": {"span": 0.4}, "impact": {"restitution": 0.5}} | scene
    assert go_on(scene, keep=1)[1][0][0] == pytest.approx(lost, rel=1e-6)


def test_a_contact_opens_where_it_breaks_away_into_a_slip_that_runs_away():
    """So does one on springs, which does not know that the slip has a reaction of its own, and is not stable."""
    launch = {"phi": -0.0262079, "omega": -3.209390473552501}
    scene = (
        shape(0.076, 4.47e-5, 0.025, 0.010, 0.043378, zone=(math.pi, math.pi))
        | rubs("tustin", rest=(1.0503, 0.946182), rough=(1.91715, 1.08523), alpha=26.0328)
        | course("sinusoidal", -1.62689, 0.834607, -1.18512, **launch, span=0.36, e=0.0176625)
    )
    found, log = go_on(scene, keep=5)
    assert log[:, 2].tolist() == [1, 2]
    assert found["closed"] == 0
    springs = rattling.follow(problem(scene), log[0, 0] - 1e-4, rattling.DEPTHS[-1])
    assert found["position"] == pytest.approx(springs["phi_end"], abs=2e-3)


# Hits one ball after the other in flight, then fifty times with one ball, and then with one while the other one holds.
SHARED = (
    shape(0.076, 4.47e-5, 0.025, 0.01, 0.043378, zone=(0.00960347, -2.4594))
    | rubs("bengisu-akay", rest=(0.105568, 0.105568), rough=(0.585926, 0.190734), alpha=819161.0, v0=1.00596e-05)
    | course("none", phi=0.0, omega=-103.221, span=0.72, e=0.848071)
)


def test_springs_that_hit_later_part_only_in_the_impact_of_both_contacts():
    """Springs come closer to the rigid body with their stiffness up to 0.595 s, and to another motion after it."""
    _, log = go_on(SHARED, keep=MOST_EVENTS)
    asked = []

    def rigid(until):
        asked.append(until)
        return go_on(SHARED | {"time": {"span": float(until)}})[0]

    assert rattling.why_apart(problem(SHARED), log[0, 0], rigid, log) == rattling.SHARED
    assert 0.59 < asked[-1] < 0.671


def test_springs_do_not_end_at_the_reactions_of_a_step_that_they_reject():
    """Friction of bristles turns 1e4 times as fast as the springs ring: the first step that is tried is too long."""
    mass, phi, omega = 2e5, 1.15, 94.7
    friction = rubs("lugre", rest=(0.48, 0.26), sigma0=4e3, sigma1=3e4, sigma2=0.0, v_s=0.0125)
    course_ = course("sinusoidal", 0.94, 476.0, -1.537, phi=phi, omega=omega, span=0.1)
    p = problem(shape(mass, 3.3e-4, 0.043, 0.0145, 0.065) | friction | course_ | {"gravity": 9.81})
    load, until = 23.0 * mass * p.gravity, 1e-10
    found = compliant.follow(p, (0.0, phi, omega, 0.0, 0.0, load, load, 0.0), 0.0, until, 1e18, 1.0)
    assert found["t"] == until
