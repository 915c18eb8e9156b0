"""Forces and motions that jump: steps, square waves and kinks, against motions in closed form."""

from fractions import Fraction
from itertools import pairwise
from math import atan2, copysign, cos, exp, floor, pi, sin, sqrt

import numpy as np
import pytest
from test_functions_of_time import belt, by, cells_of

import ringsweep
from ringsweep.compile import take
from ringsweep.numerics.clock import Instant
from ringsweep.physics import drives

G = 9.81


def moved(x, v, F, span, *, k, c, static, kinetic):
    """Place and velocity of a mass of 1 kg on a floor with friction after a time under a constant force."""
    while span > 0.0:
        if v == 0.0 and abs(F - k * x) <= static:
            return x, v
        side = copysign(1.0, v if v != 0.0 else F - k * x)
        center, decay = (F - side * kinetic) / k, 0.5 * c
        u, rate = x - center, sqrt(k - decay * decay)
        stop = atan2(v * rate, decay * v + k * u) % pi / rate if v != 0.0 else pi / rate
        s = min(stop, span)
        C, S, fallen = cos(rate * s), sin(rate * s) / rate, exp(-decay * s)
        x, v = center + fallen * (u * C + (v + decay * u) * S), fallen * (v * C - (decay * v + k * u) * S)
        v = 0.0 if s == stop else v
        span -= s
    return x, v


@pytest.mark.slow
def test_step_and_square_wave_move_a_body_as_the_closed_form_says():
    rng = np.random.default_rng(5)
    for _ in range(12):
        k, c, A, B, w, p, t1 = rng.uniform([1, 0, 0.5, -4, 1, -9, 0.5], [20, 1, 5, 4, 7, 9, 4])
        static = rng.uniform(0.05, 0.3)
        kinetic = static * rng.uniform(0.3, 1.0)
        x, v, span = rng.uniform(-0.5, 0.5), rng.uniform(-1.0, 1.0), 9.0
        force = {"formula": "A*sign(sin(w*t + p)) + piecewise(t < t1, 0, B)", "A": A, "B": B, "w": w, "p": p, "t1": t1}
        scene = belt(None, force, {"law": "stiction", "mu_s": static, "mu_k": kinetic})
        scene |= {"spring": {"stiffness": k}, "damper": {"coefficient": c}, "initial": {"x": x, "velocity": v}}
        run = ringsweep.simulate(scene | {"time": {"span": span}}, samples=2)
        turns = [(n * pi - p) / w for n in range(floor(p / pi), 40)]
        knots = [0.0, *sorted(t for t in [*turns, t1] if 0.0 < t < span), span]
        for t, end in pairwise(knots):
            middle = 0.5 * (t + end)
            F = A * copysign(1.0, sin(w * middle + p)) + (B if middle > t1 else 0.0)
            x, v = moved(x, v, F, end - t, k=k, c=c, static=static * G, kinetic=kinetic * G)
        assert run.certified == 1
        np.testing.assert_allclose([run.x_end, run.velocity_end], [x, v], atol=1e-8)


@pytest.mark.slow
def test_body_keeps_its_velocity_where_that_of_the_belt_jumps():
    drive = by("a*max(t - t1, 0)", a=0.4, t1=0.5)
    scene = belt(drive, None, {"law": "stiction", "mu_s": 0.3, "mu_k": 0.2}) | {"spring": {"stiffness": 0.0}}
    run = ringsweep.simulate(scene | {"time": {"span": 2.0}}, samples=4)
    slip = 0.4 / (0.2 * G)
    assert run.certified == 1
    assert float(run.velocity_end) == pytest.approx(0.4, abs=1e-12)
    assert float(run.x_end) == pytest.approx(0.4 * (1.5 - slip) + 0.5 * 0.2 * G * slip**2, abs=1e-10)
    # The instant of the jump has a row on either side.
    assert run["mode"].values[run.time.values == 0.5].tolist() == [0, -1]


def test_steps_of_a_table_are_the_formula_that_jumps_there():
    steps = {"time": [-1.0, 0.5, 2.0, 6.0], "force": [3.0, -1.0, 2.0, 0.0], "interpolate": "step", "amplitude": 0.7}
    by_formula = {"formula": "F*piecewise(t < T, 3, t < 4*T, -1, 2)", "F": 0.7, "T": 0.5}
    a, b = (take(cells_of(belt(None, force)), 0).drive.added for force in (steps, by_formula))
    for t in (0.0, 0.2, 0.5, 1.9, 2.0, 5.9):
        drives.pass_knot(a, Instant(t, 0.0)), drives.pass_knot(b, Instant(t, 0.0))
        assert drives.turn(a, Instant(t, 0.0)) == pytest.approx(drives.turn(b, Instant(t, 0.0)))
        assert drives.knot_after(a, Instant(t, 0.0)).t == (0.5 if t < 0.5 else 2.0 if t < 2.0 else 6.0)


#: Functions with switches, and what they are between these; d is a number between 0 and 1.
SWITCHING = {
    "A*sign(sin(w*t + p) - d)": lambda t, A, w, p, d: A * np.sign(np.sin(w * t + p) - d),
    "A*max(d, sin(w*t))": lambda t, A, w, d: A * np.maximum(d, np.sin(w * t)),
    "A*max(-d, min(d, 2*sin(w*t)))": lambda t, A, w, d: A * np.clip(2.0 * np.sin(w * t), -d, d),
    "piecewise(t/T - floor(t/T) < d, A, 0)": lambda t, A, T, d: A * (t / T % 1.0 < d),
    "A*abs(abs(t/T - floor(t/T) - 0.5) - d/2)": lambda t, A, T, d: A * abs(abs(t / T % 1.0 - 0.5) - d / 2.0),
    "A*sign(sin(w*t) + sin(3*w*t) - d)": lambda t, A, w, d: A * np.sign(np.sin(w * t) + np.sin(3.0 * w * t) - d),
    "A*max(exp(-t/T), sin(w*t))": lambda t, A, w, T: A * np.maximum(np.exp(-t / T), np.sin(w * t)),
    "A*sign(sin(w*t) + d*sin(sqrt(2)*w*t))": lambda t, A, w, d: (
        A * np.sign(np.sin(w * t) + d * np.sin(np.sqrt(2.0) * w * t))
    ),
}


@pytest.mark.parametrize("text", SWITCHING)
def test_switches_at_any_expression_are_all_found(text):
    rng = np.random.default_rng(8)
    plain = SWITCHING[text]
    for d in (0.0, 1e-9, *rng.uniform(size=3), 1.0):
        known = {"A": 1.7, "w": rng.uniform(1.0, 9.0), "T": rng.uniform(0.3, 2.0), "p": rng.uniform(-9.0, 9.0), "d": d}
        known = {name: known[name] for name in plain.__code__.co_varnames[1:]}
        drive = take(cells_of(belt(None, {"formula": text, **known})), 0).drive.added
        for t in rng.uniform(0.0, 6.0, 50):
            drives.pass_knot(drive, Instant(t, 0.0))
            assert drives.turn(drive, Instant(t, 0.0))[0] == pytest.approx(plain(t, **known), abs=1e-12)


def test_an_expression_that_touches_zero_does_not_switch():
    force = {"formula": "A*sign(sin(w*t) - d)", "A": 1.0, "w": 2.0, "d": 1.0}
    drive = take(cells_of(belt(None, force)), 0).drive.added
    assert drives.knot_after(drive, Instant(0.0, 0.0)).t == np.inf


@pytest.mark.parametrize(
    ("formula", "share"),
    [
        ({"formula": "A*sign(sin(w*t + p))", "w": 7.3, "p": 0.4}, 0.5 - 0.4 / (2.0 * pi)),
        ({"formula": "A*max(d, sin(w*t + p))", "w": 7.3, "p": 0.4, "d": 0.5}, 1.0 / 12.0 - 0.4 / (2.0 * pi)),
        ({"formula": "piecewise(t/T - floor(t/T) < d, A, 0)", "T": 0.86, "d": 0.3}, 0.3),
    ],
)
def test_billionth_knot_is_as_exact_as_the_first(formula, share):
    drive = take(cells_of(belt(None, formula | {"A": 1.0})), 0).drive.added
    turns, shares = drive.knots[-1, 0, 0], drive.knots[-1, 0, 1:]
    found = shares[abs(shares - share).argmin()]
    assert turns == (formula["w"] / (2.0 * pi) if "w" in formula else 1.0 / formula["T"])
    assert found == pytest.approx(share, abs=1e-15)
    for n in (1, 10**6, 10**9):
        exact = (n + Fraction(found)) / Fraction(turns)
        knot = drives.knot_after(drive, Instant(float(exact) - 1e-3, 0.0))
        assert abs(Fraction(knot.t) + Fraction(knot.rest) - exact) < Fraction(n, 10**29)


@pytest.mark.parametrize(
    ("text", "period"),
    [
        ("A*sign(sin(w*t))", pi),
        ("A*max(0, sin(w*t)) + A*abs(cos(3*w*t))", pi),
        ("A*sin(2*pi*floor(w*t/pi)/4)", np.inf),
        ("A*(t/T - floor(t/T))", 3.0),
        ("A*piecewise(t - T*floor(t/T) < T/2, 1, sin(w*t))", np.inf),
        ("A*max(sin(w*t) - sin(3*w*t), T/9)", pi),
        ("A*sign(t - T)", np.inf),
    ],
)
def test_switches_of_sines_have_the_period_of_these(text, period):
    known = {"A": 1.0, "w": 2.0, "T": 3.0}
    force = {"formula": text, **{name: known[name] for name in known if name in text}}
    assert np.broadcast_to(cells_of(belt(None, force)).forcing_period, 1) == pytest.approx(period)
