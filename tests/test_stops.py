"""End stops of a belt: impacts, rebounds that are summed, and rest at a stop, against closed forms."""

from math import atan, log, pi, sqrt

import numpy as np
import pytest
from belts import on_belt, outcome, with_all_parts, with_exponent
from scipy.integrate import quad
from tiers import mostly_slow

import ringsweep

G = 9.81


KARNOPP = {"law": "karnopp", "mu_s": 0.2, "mu_k": 0.1, "dead_band": 1e-3}


def between(low=None, high=None, e=0.5, *, mu_k=0.0, mu_s=None, law="stiction", constant=0.0, **belt):
    """A belt of one kind with stops, whose kernel all tests of a law share."""
    places = {"low": low, "high": high}
    stops = {"restitution": e} | {name: place for name, place in places.items() if place is not None}
    of_law = {
        "stiction": {"mu_s": mu_s or mu_k},
        "karnopp": KARNOPP,
        "threlfall": {"v0": 1e-3},
        "dahl": {"sigma0": 1e3},
    }
    friction = of_law[law] | {"law": law, "mu_k": mu_k}
    scene = with_all_parts(on_belt(friction, **({"velocity": 0.5} | belt)))
    return scene | {"stops": stops, "force": scene["force"] | {"constant": constant}}


def states(scene, times):
    """Outcomes of runs of a scene that end at these times."""
    return ringsweep.sweep(scene, {"time.span": times}, progress=False)


class TestClosedForms:
    """Motions that are known piece by piece."""

    def test_a_motion_between_stops_that_lose_nothing_returns_each_time(self):
        found = outcome(between(-1.0, 2.0, 1.0, stiffness=0.0, start=(0.0, 1.0), span=100.0))
        assert found.regime.attrs["flag_meanings"].split()[int(found.regime)] == "oscillatory"
        assert found.period.item() == pytest.approx(6.0, rel=1e-12)
        assert found.settled == 1
        # Each impact is as fast as the one before but for 1 %.
        assert outcome(between(-1.0, 2.0, 0.99, stiffness=0.0, start=(0.0, 1.0), span=100.0)).settled == 0

    def test_a_spring_presses_rebounds_to_rest_in_the_sum_of_their_times(self):
        """Away from a stop at -s the body swings about the rest position of the spring, beyond the stop."""
        e, s, stiffness, u = 0.6, 0.3, 4.0, 0.5
        omega, speeds = sqrt(stiffness), u * 0.6 ** np.arange(12.0)
        # It is launched from the stop.
        hits = np.cumsum([2.0 / omega * atan(speed / (omega * s)) for speed in speeds])
        found = states(between(high=-s, e=e, stiffness=stiffness, start=(-s, -u)), 0.5 * (hits[1:] + hits[:-1]))
        np.testing.assert_array_equal(found.impacts, np.arange(1.0, 12.0))
        np.testing.assert_allclose(found.velocity_end, 0.0, atol=1e-9)
        lowest = -np.sqrt(s * s + (speeds[1:] / omega) ** 2)
        np.testing.assert_allclose(found.x_end, lowest, rtol=1e-12)
        rests = outcome(between(high=-s, e=e, stiffness=stiffness, start=(-s, -u), span=20.0))
        assert (rests.x_end, rests.velocity_end, rests.settled, rests.certified) == (-s, 0.0, 1, 1)
        # Rebounds are summed that move the body by less than a share of 1e-13.
        assert 0.4 * log(1e-13) / log(e) < rests.impacts < 0.6 * log(1e-13) / log(e)

    def test_on_a_belt_at_rest_friction_shortens_each_rebound_twice(self):
        e, mu, pull, u = 0.7, 0.1, 3.0, 2.0
        away, back = pull + mu * G, pull - mu * G
        ratio = sqrt(back / away)
        end = u * (1.0 / away + ratio / back) / (1.0 - e * ratio)
        scene = between(high=0.2, e=e, mu_k=mu, constant=pull, stiffness=0.0, velocity=0.0, start=(0.2, -u), span=6.0)
        found = outcome(scene)
        assert found.stick_time.item() == pytest.approx(6.0 - end, rel=1e-9)
        assert found.x_min.item() == pytest.approx(0.2 - 0.5 * u * u / away, rel=1e-12)
        assert (found.x_end, found.velocity_end, found.certified) == (0.2, 0.0, 1)

    @pytest.mark.parametrize("side", [1, -1])
    def test_a_body_at_a_stop_leaves_it_as_its_load_turns(self, side):
        """The force a sin(w t) exceeds friction from 0; it falls below it at pi/w less the angle of friction."""
        mu, a, w = 0.1, 4.0, 2.0 * pi * 0.1
        scene = between(mu_k=mu, stiffness=0.0, velocity=side * 0.5, force=(side * a, 0.1), start=(side * 0.3, 0.0))
        scene["stops"] = {"restitution": 0.5, ("high" if side > 0 else "low"): side * 0.3}
        leaves = (pi + np.arcsin(mu * G / a)) / w
        found = states(scene, [leaves - 1e-6, leaves + 1.0])
        assert (found.x_end[0], found.velocity_end[0], found.impacts[0]) == (side * 0.3, 0.0, 0)
        s = 1.0
        load, angle = mu * G, w * leaves
        gained = load * s - a / w * (np.cos(angle + w * s) - np.cos(angle))
        assert found.velocity_end[1].item() == pytest.approx(side * gained, rel=1e-9)

    @pytest.mark.parametrize("side", [1, -1])
    def test_on_a_belt_at_rest_a_stop_bears_what_friction_does_not(self, side):
        """Again and again, until a force a + b sin(w t) breaks the body loose the other way."""
        mu_s, mu_k, cells, late = 0.3, 0.1, 40, 0.03
        rng = np.random.default_rng(11)
        low, b = rng.uniform(-3.5, -0.5, cells) - mu_s * G, rng.uniform(4.0, 8.0, cells)
        a, w = low + b, 2.0 * pi * rng.uniform(0.5, 5.0, cells)
        leaves = (pi + np.arcsin((mu_s * G + a) / b)) / w
        scene = between(high=0.2, mu_s=mu_s, mu_k=mu_k, stiffness=0.0, velocity=0.0, start=(side * 0.2, 0.0), span=1.0)
        if side < 0:
            scene["stops"] = {"low": -0.2, "restitution": 0.5}
        scene["force"] |= {"amplitude": 0.0, "frequency": 1.0}
        axes = {"force.constant": side * a, "force.amplitude": side * b, "force.frequency": 0.5 * w / pi}
        axes = {path: column.tolist() for path, column in (axes | {"time.span": leaves + late / w}).items()}
        found = ringsweep.run({"scene": scene, "sweep": {"points": axes}}, progress=False)
        gained = (a + mu_k * G) * late / w + b / w * (np.cos(w * leaves) - np.cos(w * leaves + late))
        np.testing.assert_allclose(found.stick_time, leaves, rtol=1e-12)
        np.testing.assert_allclose(found.velocity_end, side * gained, rtol=1e-9)
        assert (found.impacts == 0).all()

    def test_a_stop_without_restitution_stops_the_body_at_once(self):
        found = outcome(between(high=0.1, e=0.0, mu_k=0.1, stiffness=1.0, start=(0.0, 0.8), span=9.0))
        assert (found.impacts, found.x_end, found.velocity_end) == (1, 0.1, 0.0)
        assert found.regime.attrs["flag_meanings"].split()[int(found.regime)] == "sliding"

    @pytest.mark.parametrize("e", [0.0, 0.3])
    def test_a_body_that_an_impact_stops_on_a_belt_at_rest_sticks(self, e):
        """Also soon after the impact."""
        found = outcome(between(high=0.1, e=e, mu_k=0.1, stiffness=0.0, velocity=0.0, start=(0.0, 0.8), span=0.5))
        assert found.regime.attrs["flag_meanings"].split()[int(found.regime)] == "sticking"
        assert (found.stick_share, found.settled, found.certified) == (1.0, 1, 1)

    @pytest.mark.slow
    def test_a_body_leaves_a_stop_as_the_growing_load_lets_friction_win(self):
        """Friction mu (m g + A sin(w t)) exceeds the force that presses the body to the stop, from an instant on."""
        mu, a, w, press = 0.2, 6.0, 0.5, 2.5
        scene = between(high=0.3, mu_k=mu, stiffness=0.0, velocity=-0.5, constant=press, start=(0.3, 0.0))
        scene["body"] = {"mass": 1.0, "load": {"formula": "A*sin(w*t)", "A": a, "w": w}}
        leaves = np.arcsin((press / mu - G) / a) / w
        found = states(scene, [leaves - 1e-6, leaves + 0.5])
        assert (found.x_end[0], found.velocity_end[0], found.impacts[0]) == (0.3, 0.0, 0)
        gained = (press - mu * G) * 0.5 + mu * a / w * (np.cos(w * (leaves + 0.5)) - np.cos(w * leaves))
        assert found.velocity_end[1].item() == pytest.approx(gained, rel=1e-9)
        assert (found.certified == 1).all()

    @pytest.mark.slow
    def test_a_patch_between_stops_takes_the_same_energy_in_each_passage(self):
        """On a floor without friction elsewhere: each passage takes mu g L, each impact a share 1 - e^2."""
        mu, length, e, square = 0.05, 0.2, 0.9, 4.0
        scene = between(-0.5, 0.5, e, stiffness=0.0, velocity=0.0, start=(-0.4, sqrt(square)), span=20.0)
        scene["friction"] = {"law": "stiction", "frame": "space", "elsewhere": {"mu_s": 0.0, "mu_k": 0.0}}
        scene["zones"] = [{"center": 0.0, "half_length": 0.5 * length, "mu_s": mu, "mu_k": mu}]
        impacts = 0
        while (square := square - 2.0 * mu * G * length) > 0.0:
            square, impacts = square * e * e, impacts + 1
        found = outcome(scene)
        assert (found.impacts, found.velocity_end, found.certified) == (impacts, 0.0, 1)
        # The body stops within the patch: it comes from the side of the last stop.
        rest = 0.5 * length + square / (2.0 * mu * G)
        assert found.x_end.item() == pytest.approx(-rest if impacts % 2 else rest, abs=1e-9)

    @pytest.mark.parametrize("law", mostly_slow(["stiction", "threlfall", "karnopp", "dahl"], ["stiction"]))
    def test_a_belt_that_slips_under_a_body_at_a_stop_slides_steadily(self, law):
        scene = between(high=0.2, e=0.5, mu_k=0.1, law=law, stiffness=1.0, start=(0.0, 1.0), span=30.0)
        found = outcome(scene)
        assert found.regime.attrs["flag_meanings"].split()[int(found.regime)] == "sliding"
        assert (found.x_end, found.velocity_end, found.settled, found.certified) == (0.2, 0.0, 1, 1)
        assert found.force_max == pytest.approx(0.1 * G, rel=1e-6)


def by_parabolas(x, u, belt, friction, low, high, e, span):
    """Place, velocity and impacts of a body without a spring on a moving belt: its pieces are parabolas."""
    t, hits, sticks = 0.0, 0, u == belt
    while True:
        a = 0.0 if sticks else friction * np.sign(belt - u)
        events = [(span - t, "end")] + ([] if sticks else [((belt - u) / a, "stick")])
        for place in (low, high):
            roots = np.roots([0.5 * a, u, x - place]) if a else np.array([(place - x) / u])
            later = [r.real for r in roots if abs(r.imag) < 1e-12 and r.real > 1e-9]
            events += [(r, "stop") for r in later]
        s, what = min(events)
        t, x, u = t + s, x + s * (u + 0.5 * a * s), u + a * s
        if what == "end":
            return x, u, hits
        if what == "stop":
            u, hits, sticks = -e * u, hits + 1, False
        else:
            u, sticks = belt, True


def test_random_bodies_between_stops_move_along_parabolas():
    rng, cells = np.random.default_rng(53), 60
    axes = {
        "initial.x": rng.uniform(-0.2, 0.2, cells),
        "initial.velocity": rng.uniform(-4.0, 4.0, cells),
        "belt.velocity": rng.uniform(0.3, 1.0, cells) * rng.choice([-1.0, 1.0], cells),
        "friction.mu_k": rng.uniform(0.02, 0.3, cells),
        "stops.low": rng.uniform(-0.6, -0.2, cells),
        "stops.high": rng.uniform(0.2, 0.6, cells),
        "stops.restitution": rng.uniform(0.6, 1.0, cells),
        "time.span": rng.uniform(0.1, 2.0, cells),
    }
    points = {path: column.tolist() for path, column in axes.items()} | {"friction.mu_s": [0.3] * cells}
    config = {"scene": between(-1.0, 1.0, stiffness=0.0, mu_k=0.1, span=1.0), "sweep": {"points": points}}
    found = ringsweep.run(config, progress=False)
    cells = zip(*axes.values(), strict=True)
    own = np.array([by_parabolas(x, u, v, G * mu, low, high, e, t) for x, u, v, mu, low, high, e, t in cells])
    assert own[:, 2].max() > 4
    np.testing.assert_array_equal(found.impacts, own[:, 2])
    np.testing.assert_allclose(np.array([found.x_end, found.velocity_end]).T, own[:, :2], atol=1e-10)


class TestBounds:
    """Errors of runs whose impacts magnify each difference."""

    def test_bounds_hold_where_impacts_magnify_what_both_runs_share(self):
        """Between narrow stops all steps end at impacts, whatever the tolerance."""
        axes = {"force.phase": np.random.default_rng(5).uniform(0.0, 2.0 * pi, 60)}

        def found(mass, **solver):
            rest = {"stiffness": 0.0, "velocity": 0.0, "start": (0.0, 0.0), "span": 20.0}
            scene = between(-0.02, 0.03, 0.99, mu_k=0.02, mass=mass, force=(4.0 * mass, 0.3), **rest)
            return ringsweep.sweep(scene, axes, solver={"method": "event"} | solver, progress=False)

        first = found(1.0)
        for second in found(0.37), found(1.0, rtol=1e-13):
            bound = (first.x_end_error + second.x_end_error).values
            assert np.isfinite(bound).mean() > 0.2
            assert not (abs(first.x_end - second.x_end).values > 3.0 * bound).any()


@pytest.mark.slow
class TestJumps:
    """Forces and velocities of the belt that jump while the body is between its stops, or at one."""

    @staticmethod
    def outcomes(numbers, axes, mu, start, span):
        scene = between(high=1.0, e=0.5, mu_k=mu, stiffness=0.0, start=start, span=span)
        drive = {"law": "formula", "theta": "b*max(t - t1, 0)", "t1": 1.0} | numbers
        force = {"formula": "piecewise(t < t2, B, A)", "t2": 2.0, "A": 0.0, "B": 0.0}
        return ringsweep.sweep(scene | {"belt": {}, "drive": drive, "force": force}, axes, progress=False)

    def test_a_body_flies_on_along_a_parabola_as_the_force_jumps(self):
        """It hits at 1 s and is half way back at 2 s. The cells of a batch have knots of their own."""
        pull = np.linspace(-3.0, 3.0, 20)
        found = self.outcomes({"b": 0.7}, {"force.A": pull}, 0.0, (0.0, 1.0), 2.4)
        np.testing.assert_allclose(found.x_end, 0.5 - 0.5 * 0.4 + 0.08 * pull, atol=1e-12)
        assert (found.impacts == 1).all()
        assert found.certified.all()

    def test_a_belt_that_jumps_to_a_speed_drags_a_body_off_its_stop(self):
        """It stands still, then runs away from the stop at 0.5 m/s from 1 s on; a greater force holds the body."""
        mu, s, push = 0.1, 0.2, np.linspace(0.2, 1.8, 15)
        found = self.outcomes({"b": -0.5}, {"force.B": push}, mu, (1.0, 0.0), 1.0 + s)
        gain = np.minimum(push - mu * G, 0.0)
        np.testing.assert_allclose(found.x_end, 1.0 + 0.5 * gain * s * s, atol=1e-12)
        np.testing.assert_allclose(found.velocity_end, gain * s, atol=1e-12)
        np.testing.assert_allclose(found.stick_time, 1.0, atol=1e-12)
        assert found.certified.all()


@pytest.mark.slow
@pytest.mark.parametrize("law", ["ruina", "dieterich"])
def test_a_stopped_body_slides_off_through_speeds_as_small_as_numbers_go(law):
    """Friction mu0 + a ln(v/V), which no age changes (b = 0), begins where exp(mu0/a) relaxes it within 1e-90 s."""
    mu_0, fast, pull = 0.6, 1e-4, 7.0
    friction = {"law": law, "mu0": mu_0, "b": 0.0, "critical_distance": 1e-4, "reference_velocity": fast}
    scene = on_belt(friction | {"a": 0.01}, 0.0, damping=0.0, velocity=0.0, start=(0.0, -1.0), span=1.0)
    scene |= {"force": {"constant": pull}, "stops": {"low": 0.0, "restitution": 0.0}}
    found = ringsweep.sweep(scene, {"friction.a": np.geomspace(0.003, 0.01, 10)}, progress=False)
    columns = (column.values.tolist() for column in (found.friction_a, found.velocity_end, found.x_end))
    for a, v, x in zip(*columns, strict=True):

        def pace(v, a=a):
            return 1.0 / (pull - G * (mu_0 + a * log(v / fast)))

        assert quad(pace, 0.0, v)[0] == pytest.approx(1.0, rel=1e-7)
        assert quad(lambda v, pace=pace: v * pace(v), 0.0, v)[0] == pytest.approx(x, rel=1e-7)
    assert found.certified.all()


@pytest.mark.slow
@pytest.mark.parametrize("law", ["ruina", "dieterich"])
def test_a_body_thrown_back_by_a_stop_does_not_fall_on_it_by_rounding(law):
    """Launched on the belt at a stop it runs into, it has steps about as short as the place is exact; b = 0."""
    mu_0, fast, span, pull, e = 0.3, 1e-4, 0.01, 1.3, 0.5
    friction = {"law": law, "mu0": mu_0, "b": 0.0, "critical_distance": 1e-5, "reference_velocity": fast}
    scene = on_belt(friction | {"a": 0.01}, 0.0, damping=0.0, velocity=-0.6, start=(-0.3, -0.6), span=span)
    scene |= {"force": {"constant": pull}, "stops": {"low": -0.3, "restitution": e}}
    shares, belts = np.geomspace(0.003, 0.01, 10), np.linspace(-0.8, -0.3, 5)
    points = np.array([(a, v, v) for a in shares for v in belts]).T.tolist()
    points = dict(zip(("friction.a", "belt.velocity", "initial.velocity"), points, strict=True))
    found = ringsweep.run({"scene": scene, "sweep": {"points": points}}, jobs=1, progress=False)
    moves = zip(points["friction.a"], points["belt.velocity"], found.velocity_end.values, found.x_end, strict=True)
    for a, belt, velocity, x in moves:

        def pace(v, a=a):
            return 1.0 / (pull - G * (mu_0 + a * log(v / fast)))

        ends = -(1.0 + e) * belt, velocity - belt
        assert quad(pace, *ends)[0] == pytest.approx(span, rel=1e-7)
        slip = quad(lambda v, pace=pace: v * pace(v), *ends)[0]
        assert x.item() + 0.3 == pytest.approx(slip + belt * span, rel=1e-7)
    assert (found.impacts == 1).all()
    assert found.certified.all()


@pytest.mark.slow
class TestHeldOnBristles:
    """A body that rests at a stop while the belt slides under its bristles: its state tells nothing of the forces."""

    def test_a_force_lifts_it_as_often_and_as_far_as_under_coulomb(self):
        """Bristles in steady sliding have constant friction; the belt is faster than the body at all times."""
        found = []
        for law in ("dahl", "stiction"):
            scene = between(high=0.0, e=0.0, mu_k=0.2, law=law, stiffness=2.0, velocity=3.0, start=(0.0, 0.0), span=6.0)
            scene["force"] |= {"amplitude": 2.5, "phase": "180 deg"}
            found.append(ringsweep.sweep(scene, {"force.frequency": np.geomspace(0.3, 30.0, 30)}, progress=False))
        np.testing.assert_allclose(found[0].x_min, found[1].x_min, rtol=1e-3)
        np.testing.assert_array_equal(found[0].impacts, found[1].impacts)
        assert found[0].certified.all()

    def test_it_does_not_move_with_the_error_of_the_belt(self):
        """So it is not taken to swing."""
        scene = between(high=0.1, mu_k=0.1, law="dahl", constant=3.0, start=(0.1, 0.0), span=5.0)
        drive = {"law": "formula", "velocity": "V*(1 + e*sin(w*t))", "V": 0.2, "e": 0.6}
        found = ringsweep.sweep(
            scene | {"belt": {}, "drive": drive}, {"drive.w": np.linspace(4.0, 20.0, 20)}, progress=False
        )
        assert (found.velocity_max == 0.0).all()
        assert (ringsweep.words(found.regime) == "sliding").all()
        assert found.certified.all()


class TestExponent:
    """At an impact from u to -e u disturbances jump by [[-e, 0], [(a+ + e a-)/u, -e]]."""

    @pytest.mark.parametrize(("e", "swing"), [(0.3, 0.2), (0.6, 0.12), (0.8, 0.05)])
    def test_multipliers_of_a_ball_on_a_vibrating_plate(self, e, swing):
        """It leaves the plate once a period T with e U, U = g T/(1 + e), where the plate slows down by d.

        So M = [[-e, 0], [(1 + e) (g - d)/U, -e]] [[1, T], [0, 1]], seen from the plate.
        """
        period = 0.5
        w, fast = 2.0 * pi / period, G * period / (1.0 + e)
        # The plate rises at (1 - e) U/2 as it hits the ball, at the phase whose sine is `swing`.
        amplitude = 0.5 * (1.0 - e) * fast / (w * sqrt(1.0 - swing * swing))
        slows = amplitude * w * w * swing
        scene = between(low=0.0, e=e, stiffness=0.0, constant=-G, start=(0.0, e * fast), span=60 * period)
        force = {"amplitude": amplitude * w * w, "frequency": 1.0 / period, "phase": np.arcsin(swing)}
        scene["force"] |= force
        found = with_exponent(scene, certify=True)
        flight = np.array([[1.0, period], [0.0, 1.0]])
        impact = np.array([[-e, 0.0], [(1.0 + e) * (G - slows) / fast, -e]])
        exact = np.linalg.eigvals(impact @ flight)
        turned = [(found[f"multiplier_{k}"] * np.exp(1j * found[f"multiplier_angle_{k}"])).item() for k in (1, 2)]
        np.testing.assert_allclose(np.sort_complex(turned), np.sort_complex(exact), atol=1e-8)
        assert found.certified.item() == 1

    def test_rest_at_a_stop_erases_the_past(self):
        scene = between(-0.1, 0.05, 0.4, mu_k=0.02, stiffness=2.0, velocity=0.25, force=(0.9, 0.25), span=400.0)
        found = with_exponent(scene)
        assert (found.multiplier_1, found.multiplier_2, found.lyapunov) == (0.0, 0.0, -np.inf)
