"""Static friction that ages: closed forms, the published limit of stick-slip, and cycles at the speed of a plate."""

from math import asinh, copysign, exp, log, pi, sqrt

import numpy as np
import pytest
from belts import on_belt, outcome
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from tiers import mostly_slow

import ringsweep
from ringsweep.physics.friction import LAWS
from ringsweep.physics.friction.presliding import bristle
from ringsweep.physics.friction.velocity import KINETIC

MU_0, A, B, D_C, V_0 = 0.6, 0.010, 0.015, 1e-5, 1e-6
NAMES = "dieterich", "ruina"
#: The kernel of Dieterich's law is the one that is compiled by default.
laws = pytest.mark.parametrize("law", mostly_slow(NAMES, NAMES[:1]))
#: Stiffness of a spring below which slow sliding under a weight of 1 N is unstable (Ruina 1983), N/m.
CRITICAL = (B - A) / D_C
TIGHT = {"method": "implicit", "rtol": 1e-10}


def steady(speed):
    """Friction coefficient of steady sliding."""
    return MU_0 + (A - B) * log(speed / V_0)


def dragged(law, speed, stiffness, mass=1.0, **more):
    """Scene of a body that weighs 1 N, dragged at a speed; by default it slides steadily at the start."""
    friction = {"law": law, "mu0": MU_0, "a": A, "b": B, "critical_distance": D_C, "reference_velocity": V_0}
    scene = on_belt(friction, stiffness, mass=mass, velocity=speed, gravity=1.0 / mass)
    start = {"x": steady(speed) / stiffness, "velocity": 0.0} if speed > 0.0 else {}
    return scene | {"initial": start | more.pop("initial", {}), "time": {"span": more["span"]}}


# ---- the laws ----------------------------------------------------------------------------------

speeds, states = st.floats(-12.0, 0.0).map(lambda x: 10.0**x), st.floats(-10.0, 20.0)


@pytest.mark.parametrize("name", NAMES)
class TestLaw:
    @given(speeds)
    def test_steady_friction_changes_with_the_logarithm_of_the_speed(self, name, speed):
        law = LAWS[name](A, B, D_C, V_0)
        rate, _, _, mu, _, _ = bristle(law, MU_0, MU_0, -speed, log(V_0 / speed), -1.0, KINETIC)
        assert abs(rate) <= 1e-12 * speed / D_C
        assert mu == pytest.approx(-steady(speed), rel=1e-13)

    @given(speeds, states)
    def test_friction_jumps_with_the_speed_by_a_times_its_logarithm(self, name, speed, z):
        law = LAWS[name](A, B, D_C, V_0)
        slow, fast = (bristle(law, MU_0, MU_0, v, z, 1.0, KINETIC)[3] for v in (speed, 10.0 * speed))
        assert fast - slow == pytest.approx(A * log(10.0), rel=1e-12)

    @given(st.floats(-60.0, 0.0).map(lambda x: 10.0**x), states, st.sampled_from([-1.0, 1.0]))
    def test_derivatives_are_finite_differences(self, name, speed, z, sign):
        law, v, small = LAWS[name](A, B, D_C, V_0), sign * speed, 1e-5
        rate, rate_v, rate_z, _, by_v, by_z = bristle(law, MU_0, MU_0, v, z, sign, KINETIC)
        ahead, behind = (bristle(law, MU_0, MU_0, v * (1 + s), z, sign, KINETIC) for s in (small, -small))
        above, below = (bristle(law, MU_0, MU_0, v, z + s, sign, KINETIC) for s in (small, -small))
        size = max(abs(rate), speed / D_C, 1e-12 * V_0 / D_C)
        assert rate_v * v == pytest.approx((ahead[0] - behind[0]) / (2 * small), abs=1e-5 * size)
        assert rate_z == pytest.approx((above[0] - below[0]) / (2 * small), abs=1e-5 * size)
        assert by_v * v == pytest.approx((ahead[3] - behind[3]) / (2 * small), abs=1e-8)
        assert by_z == pytest.approx((above[3] - below[3]) / (2 * small), abs=1e-8)

    def test_friction_vanishes_at_rest(self, name):
        law = LAWS[name](A, B, D_C, V_0)
        assert bristle(law, MU_0, MU_0, 0.0, 12.0, 1.0, KINETIC)[3] == 0.0


# ---- runs ----------------------------------------------------------------------------------------


@laws
def test_contacts_at_rest_age_with_time_under_dieterichs_law_only(law):
    found = outcome(dragged(law, 0.0, 1.0, span=1e6, initial={"contact_age": 100.0}))
    assert float(found.contact_age_end) == pytest.approx(1e6 + 100.0 if law == "dieterich" else 100.0, rel=1e-9)


@laws
def test_a_step_of_the_speed_raises_friction_before_it_falls(law):
    """A stiff spring holds the body back; its contacts have the age of slower sliding."""
    slow, fast = 1e-6, 1e-4
    scene = dragged(law, fast, 50.0 * CRITICAL, 1e-3, span=20.0 * D_C / fast, initial={"contact_age": D_C / slow})
    friction = -ringsweep.simulate(scene, solver=TIGHT).friction_force.values
    assert friction[0] == pytest.approx(steady(slow) + A * log(fast / slow), rel=1e-12)
    assert friction[-1] == pytest.approx(steady(fast), rel=1e-6)
    assert friction[-1] < steady(slow) < friction[0]


def largest_growth(stiffness, speed, mass):
    """Growth rate of a disturbance of steady sliding, 1/s, from the equations linearised by hand."""
    by_speed, by_state = A / speed, B
    matrix = [
        [0.0, 1.0, 0.0],
        [-stiffness / mass, -by_speed / mass, by_state / mass],
        [0.0, 1.0 / D_C, -speed / D_C],
    ]
    return np.linalg.eigvals(matrix).real.max()


@laws
@pytest.mark.parametrize(("speed", "mass"), [(1e-6, 0.1), (1e-3, 0.1)])
def test_steady_sliding_is_stable_above_the_critical_stiffness(law, speed, mass):
    """Rice and Ruina (1983), with inertia; at 1 mm/s this doubles the limit."""
    critical = CRITICAL * (1.0 + mass * speed**2 / (A * D_C))
    assert largest_growth(critical, speed, mass) == pytest.approx(0.0, abs=1e-9 * sqrt(critical / mass))
    for share in (0.9, 1.1):
        stiffness, cycles = share * critical, 40.0
        pace = sqrt(stiffness / mass) if mass * speed**2 > 0.1 * A * D_C else speed / D_C * sqrt(B / A - 1.0)
        scene = dragged(law, speed, stiffness, mass, span=cycles * 2.0 * pi / pace)
        scene["initial"]["x"] *= 1.0 + 1e-6
        run, span = ringsweep.simulate(scene, solver=TIGHT), scene["time"]["span"]
        away = abs(run.x - steady(speed) / stiffness)
        first, last = float(away[run.time < 0.25 * span].max()), float(away[run.time > 0.75 * span].max())
        assert (last > 2.0 * first) == (share < 1.0)


def by_scipy(scene):
    """End of a run by SciPy: displacement, sliding velocity, age; and the fastest slip.

    The variables are displacement, friction coefficient, and logarithm of the age. The clock begins anew at each decade
    of the speed, where it would run out of digits.
    """
    mass, stiffness, speed = scene["body"]["mass"], scene["spring"]["stiffness"], scene["belt"]["velocity"]
    ages = scene["friction"]["law"] == "dieterich"

    def velocity(y):
        by_age = (MU_0 + B * (y[2] + log(V_0 / D_C))) / A
        return V_0 * (exp(y[1] / A - by_age) - exp(-y[1] / A - by_age))

    def rates(t, y):
        v, by_age = velocity(y), (MU_0 + B * (y[2] + log(V_0 / D_C))) / A
        share = abs(v) * exp(y[2]) / D_C
        ageing = (1.0 - share) * exp(-y[2]) if ages else -abs(v) / D_C * log(max(share, 1e-300))
        by_mu = V_0 * (exp(y[1] / A - by_age) + exp(-y[1] / A - by_age))
        return [v + speed, (A * (-stiffness * y[0] - y[1]) / mass + B * v * ageing) / by_mu, ageing]

    def at(decade):
        def event(t, y):
            return log(max(abs(velocity(y)), 1e-300)) - decade * log(10.0)

        event.terminal = True
        return event

    v = scene["initial"]["velocity"] - speed
    age = scene["initial"].get("contact_age", D_C / abs(v))
    mu = copysign(A * asinh(abs(v) / (2.0 * V_0) * exp((MU_0 + B * log(V_0 * age / D_C)) / A)), v)
    y, left, fastest, step = np.array([scene["initial"]["x"], mu, log(age)]), scene["time"]["span"], 0.0, 1e-9
    while left > 0.0:
        decades = [k for k in range(-20, 3) if abs(k * log(10.0) - log(abs(velocity(y)))) > 1.0]
        options = {"method": "Radau", "rtol": 1e-10, "atol": [1e-14, 1e-13, 1e-10], "first_step": min(step, left)}
        run = solve_ivp(rates, (0.0, left), y, events=[at(k) for k in decades], **options)
        assert run.success, run.message
        fastest = max(fastest, *(abs(velocity(state)) for state in run.y.T))
        y, left, step = run.y[:, -1], left - run.t[-1] if run.status else 0.0, 0.3 * (run.t[-1] - run.t[-2])
    return y[0], velocity(y), exp(y[2]), fastest


@laws
@pytest.mark.slow
def test_cycle_at_the_speed_of_a_plate_agrees_with_scipy(law):
    """Years of creep at 1 nm/s, and a slip of 50 mm/s."""
    scene = dragged(law, 1e-9, 0.1 * CRITICAL, span=9e6, initial={"velocity": -1e-9})
    x, v, age, fastest = by_scipy(scene)
    found = outcome(scene, TIGHT)
    assert fastest > 1e-2
    assert int(found.certified) == 1
    assert float(found.x_end) == pytest.approx(x, abs=1e-8 * float(found.x_max))
    assert float(found.velocity_end) == pytest.approx(v + 1e-9, abs=1e-8 * fastest)
    assert float(found.contact_age_end) == pytest.approx(age, rel=1e-8)


@laws
@pytest.mark.parametrize("solver", [{"method": "auto"}, TIGHT])
def test_slips_of_milliseconds_after_centuries_do_not_stall(law, solver):
    """Times near 1e10 s have a rounding of a microsecond, and the slowest creep is 1e-40 m/s."""
    scene = dragged(law, 1e-12, 10.0, 1e-5, span=4e10, initial={"velocity": -1e-12})
    found = outcome(scene, solver)
    assert int(found.certified) == 1
    assert float(found.t_end) == 4e10
    assert float(found.slips) >= 1


def test_a_loose_tolerance_does_not_chatter_where_a_contact_stops():
    """There an error of friction is a factor of the speed."""
    friction = {"law": "dieterich", "mu0": 0.54, "a": 0.0038, "b": 0.0157}
    scene = on_belt(
        friction | {"critical_distance": 5.5e-5, "reference_velocity": 4.2e-4}, 28.1, mass=0.33, velocity=0.036,
        force=(-1.72, 0.777, 0.0), start=(0.0, -0.26), span=2.4,
    )  # fmt: skip
    scene["initial"]["contact_age"] = 0.43
    loose, tight = outcome(scene, {"method": "implicit", "rtol": 9e-5, "certify": False}), outcome(scene, TIGHT)
    assert float(loose.x_end) == pytest.approx(float(tight.x_end), rel=1e-4)
    assert int(loose.steps) < 10_000
