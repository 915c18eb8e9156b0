"""What a motion on the belt settles to is decided by evidence that does not hang on the end of the span."""

import json
import re
from math import pi
from types import SimpleNamespace

import numpy as np
import pytest
from belts import by_scipy, on_belt, states_at, with_all_parts

import ringsweep
from ringsweep.config import load
from ringsweep.models import cycles
from ringsweep.physics import belt
from ringsweep.runs.warnings import warn_of_results


def scene(law, omega, amplitude, *, x=0.0, v_belt=1.0, cubic=0.0, damping=0.0, **friction):
    """A body of 1 kg on a spring of 1 N/m, g = 1 m/s^2, under a force (N) at `omega` (rad/s)."""
    return on_belt(
        {"law": law, **friction},
        cubic=cubic,
        damping=damping,
        velocity=v_belt,
        span=100.0,
        gravity=1.0,
        force=(amplitude, omega / (2.0 * pi)),
        start=(x, 0.0),
    )


def over(of, omega, periods, exponent=False):
    """Runs of a scene over these numbers of periods of the force."""
    config = {
        "scene": with_all_parts(of),
        "record": {"exponent": exponent},
        "solver": {"method": "auto", "certify": False},
        "sweep": {"grid": {"time.span": [n * 2.0 * pi / omega for n in periods]}},
    }
    return ringsweep.run(config, jobs=1, progress=False)


def words(found):
    return ringsweep.words(found.long_run).values.tolist()


#: The body of a cubic spring sticks, slips and passes the belt.
def cubic(omega, amplitude):
    friction = {"mu_s": 0.6, "mu_k": 0.2, "alpha": 3.0}
    return scene("tustin", omega, amplitude, x=0.1, cubic=1.0, damping=0.02, **friction)


def test_slow_growth_of_a_forced_motion_is_transient():
    """The damper takes less than the falling friction gives: the swing grows until the body sticks."""
    of = scene("tustin", 0.5, 0.1, x=0.5, mu_s=0.302, mu_k=0.3, alpha=1.0, damping=5e-4)
    found = over(of, 0.5, [50, 100, 300, 1000, 2000])
    # The body sticks from the 927th period on.
    assert words(found) == ["transient"] * 4 + ["periodic"]
    np.testing.assert_array_equal(found.settled, [0, 0, 0, 0, 1])
    np.testing.assert_allclose(found.period, [*[np.nan] * 4, 4.0 * pi])
    assert ringsweep.words(found.regime).values.tolist() == ["oscillatory"] * 3 + ["stick-slip"] * 2


def test_resonance_without_bound_is_unbounded():
    """Den Hartog's oscillator at r = 1, F/P = 0.5: friction takes less than the force gives, at any swing.

    In a period of large swing the energy grows by (pi P - 4 F) a, so that the amplitude a grows by pi - 2.
    """
    found = over(scene("tustin", 1.0, 1.0, v_belt=0.0, mu_s=0.5, mu_k=0.5, alpha=1.0), 1.0, [50, 300, 800, 5000])
    assert words(found) == ["transient", "unbounded", "unbounded", "unbounded"]
    np.testing.assert_allclose(found.swing[2:], [1825, 11415], rtol=1e-3)
    np.testing.assert_allclose((found.swing[3] - found.swing[2]) / 4200.0, 2.0 * (pi - 2.0), rtol=1e-3)
    np.testing.assert_array_equal(found.settled, 0)
    assert np.isnan(found.period).all()


def test_resonance_with_a_damper_is_bounded():
    of = scene("tustin", 1.0, 1.0, v_belt=0.0, mu_s=0.5, mu_k=0.5, alpha=1.0, damping=1e-3)
    found = over(of, 1.0, [300, 5000])
    assert words(found) == ["transient", "periodic"]
    # The work of the force is that of friction and damper: pi a P = 4 a F + pi c a^2.
    np.testing.assert_allclose(found.swing[1], 2.0 * (1.0 - 2.0 / pi) / 1e-3, rtol=1e-3)


def test_motion_that_does_not_return_has_no_period_in_any_span():
    spans = [*range(200, 240), 617, 1000]
    found = over(cubic(0.6, 0.8), 0.6, spans)
    assert words(found) == ["transient"] * len(spans)
    assert np.isnan(found.period).all()
    assert set(ringsweep.words(found.regime).values.tolist()) == {"stick-slip"}
    # Over the second half of the record the statistics agree.
    assert np.ptp(found.stick_share.values) < 0.01


def test_the_exponent_tells_chaos_from_motion_on_a_torus():
    chaotic, torus = over(cubic(0.8, 0.5), 0.8, [617, 1000], True), over(cubic(0.6, 0.8), 0.6, [617, 1000], True)
    assert words(chaotic) == ["chaotic"] * 2
    assert words(torus) == ["quasi-periodic"] * 2
    for found in (chaotic, torus):
        np.testing.assert_array_equal(found.settled, 1)
        assert np.isnan(found.period).all()
    assert (chaotic.lyapunov > 3.0 * chaotic.lyapunov_error).all()
    assert (abs(torus.lyapunov) < 3.0 * torus.lyapunov_error).all()


def test_span_that_the_warning_names_is_enough_to_show_a_torus(caplog):
    of, period = cubic(0.6, 0.8), 2.0 * pi / 0.6
    assert words(over(of, 0.6, [100], True)) == ["transient"]
    needed = float(re.search(r"that of a torus, takes about (\S+) s", caplog.text).group(1))
    assert 100 * period < needed < 1000 * period
    assert words(over(of, 0.6, [needed / period], True)) == ["quasi-periodic"]


def test_warning_names_no_span_that_is_shorter_than_the_one_of_the_run(caplog):
    found = over(cubic(0.6, 0.8), 0.6, [1000], True)
    found["settled"][:] = 0
    warn_of_results(found, load(json.loads(found.attrs["configuration"])))
    assert "the motion has not settled" in caplog.text
    assert "that of a torus" not in caplog.text


def test_word_does_not_change_where_the_span_passes_a_power_of_two_periods():
    spans = [1000, 1020, 1024, 1025, 1030, 1035, 1060]
    assert words(over(cubic(0.8, 0.5), 0.8, spans, True)) == ["chaotic"] * len(spans)
    assert words(over(cubic(0.6, 0.8), 0.6, spans, True)) == ["quasi-periodic"] * len(spans)


def hartog(ratio, friction, spans):
    """Den Hartog's oscillator without a damper, from rest."""
    of = scene("tustin", ratio, 1.0, v_belt=0.0, mu_s=friction, mu_k=friction, alpha=1.0)
    return over(of, ratio, [span * ratio / (2.0 * pi) for span in spans])


@pytest.mark.parametrize(("ratio", "friction"), [(0.25303, 0.05), (0.46835, 0.276), (0.48578, 0.276), (0.50321, 0.212)])
def test_stops_of_a_settled_motion_are_those_of_longer_spans(ratio, friction):
    """A stop that still comes in some of the laps is lost later, or comes in each of them."""
    found = hartog(ratio, friction, [400.0, 800.0, 1600.0, 4000.0])
    settled = found.settled.values == 1
    assert settled[-1]
    for name in ("stops_per_cycle", "period", "regime"):
        np.testing.assert_allclose(found[name].values[settled], found[name].values[-1], rtol=1e-9)
    np.testing.assert_allclose(found.stick_share.values[settled], found.stick_share.values[-1], rtol=0.01)


@pytest.mark.parametrize("amplitude", [0.303, 0.306, 0.33])
def test_swing_of_short_slips_between_stops_is_their_length(amplitude):
    """Each half of the period the body slips, in one step of the solver, from -x to x, and rests there."""
    found = over(scene("coulomb", 0.9, amplitude, x=0.5, v_belt=0.0, mu_k=0.3), 0.9, [200.0, 400.0])
    assert found.settled.values.tolist() == [1, 1]
    np.testing.assert_allclose(found.period, 2.0 * pi / 0.9, rtol=1e-9)
    np.testing.assert_allclose(found.swing, 2.0 * abs(found.x_end), rtol=1e-6)


def test_short_slips_of_one_step_obey_the_balance_of_energy():
    """The force is hardly above friction. A slip is one step from rest to rest, which two nodes do not integrate."""
    of = scene("coulomb", 0.4 * pi, 0.3, v_belt=0.0, mu_k=0.3)
    found = ringsweep.sweep(of, {"force.amplitude": [0.3015, 0.303, 0.306, 0.31]})
    assert found.certified.all()
    assert (found.slips > 10).all()


@pytest.mark.slow
def test_swing_on_bristles_does_not_depend_on_the_end_of_the_span():
    """A turn within the step in which a period ends is of the period in which it lies."""
    friction = {"law": "lugre", "mu_s": 0.45, "mu_k": 0.44, "v_s": 0.01, "sigma0": 2e4, "sigma1": 20.0, "sigma2": 0.5}
    force, start = (4.0, 3.5, 0.35), (0.003, -0.02)
    of = on_belt(friction, 210.0, mass=1.3, damping=0.8, velocity=0.12, force=force, start=start, span=8.0)
    of["belt"]["incline"], of["force"]["constant"] = 0.0523598775598, 0.5
    of["stops"] = {"low": -0.008, "high": 0.022, "restitution": 0.55}
    found = ringsweep.sweep(of, {"time.span": [7.7, 8.0, 10.0, 12.0, 15.0]})
    np.testing.assert_allclose(found.swing, 0.0150589, rtol=1e-5)


def test_period_of_three_cycles_that_becomes_one_is_not_settled():
    found = hartog(1.4967889908256882, 0.05, [800.0, 8000.0])
    assert found.settled.values.tolist() == [0, 1]
    assert found.period[1].item() == pytest.approx(2.0 * pi / 1.4967889908256882, rel=1e-9)


@pytest.mark.parametrize("friction", [0.2, 0.3])
def test_stops_that_shrink_for_ever_beside_a_continuum_do_not_settle(friction):
    """At half the natural frequency, without a damper, motions without stops lie side by side in a continuum."""
    found = hartog(0.5, friction, [500.0, 2000.0, 8000.0])
    assert words(found) == ["transient"] * 3
    assert (found.stick_share[1:].values < 0.9 * found.stick_share[:-1].values).all()


def test_drift_of_a_body_without_a_spring_under_a_force_that_vibrates():
    """It slips forward for T (1 + P0/F)/2 of each period, so that friction takes the mean force P0 away.

    With u = w t, forward from u1 to u2, the momentum gained there is (P0 - F)(u2 - u1) + P (cos u1 - cos u2) = 0.
    """
    mean, force, friction, omega = 0.05, 1.0, 0.3, 2.0
    length = pi * (1.0 + mean / friction)
    # cos u1 - cos u2 = 2 sin((u1 + u2)/2) sin(length/2); forward slip is about the maximum of the force, and later.
    middle = pi - np.arcsin((friction - mean) * length / (2.0 * force * np.sin(length / 2.0)))
    first = middle - length / 2.0

    def distance(start, stop, drag):
        """Distance in a slip that begins at rest; in units of 1/w^2."""
        u = stop - start
        return 0.5 * (mean + drag) * u**2 + force * (np.cos(start) * u + np.sin(start) - np.sin(stop))

    moved = distance(first, first + length, -friction) + distance(first + length, first + 2.0 * pi, friction)
    of = scene("tustin", omega, force, v_belt=0.0, mu_s=friction, mu_k=friction, alpha=1.0)
    of = of | {"spring": {"stiffness": 0.0}, "force": of["force"] | {"constant": mean}}
    found = over(of, omega, [0.9, 5, 50, 500], exponent=True)
    assert words(found) == ["transient", "transient", "periodic", "periodic"]
    np.testing.assert_allclose(found.drift[2:], moved / (2.0 * pi * omega), rtol=1e-8)
    np.testing.assert_array_equal(found.settled, [0, 0, 1, 1])
    np.testing.assert_allclose(found.period[2:], pi, rtol=1e-12)
    # A shift in space neither grows nor decays.
    np.testing.assert_allclose(found.multiplier_1[2:], 1.0, atol=1e-9)
    assert (found.multiplier_2[2:] < 1.0).all()


@pytest.mark.slow
def test_belt_that_vibrates_unevenly_conveys_a_body():
    """The belt moves at a w (cos u + 0.2 cos 2u), u = w t. The body is slower than the belt for half of each period.

    It gains mu g T/2 from u1 to u1 + pi, where it meets the belt: -2 a w cos u1 = mu g T/2.
    """
    a, omega, mu = 0.05, 10.0, 0.02
    start = -np.arccos(-mu * 9.81 * pi / (2.0 * a * omega**2))
    drift = a * omega * (np.cos(start) + 0.2 * np.cos(2.0 * start)) + mu * 9.81 * pi / (2.0 * omega)
    of = on_belt({"law": "stiction", "mu_s": 0.03, "mu_k": mu}, 0.0, start=(0.0, 0.0)) | {
        "drive": {"law": "formula", "theta": "a*(sin(w*t) + 0.1*sin(2*w*t))", "a": a, "w": omega}
    }
    found = ringsweep.sweep(of, {"time.span": [100.0, 1000.0]}, progress=False)
    assert words(found) == ["periodic"] * 2
    np.testing.assert_allclose(found.drift, drift, rtol=1e-7)
    assert found.certified.values.tolist() == [1, 1]


def test_drift_without_cycles_is_that_of_the_second_half_of_the_span():
    """A body that brakes on a belt at rest, without a spring."""
    of = scene("tustin", 1.0, 0.0, v_belt=0.0, mu_s=0.3, mu_k=0.3, alpha=1.0)
    of = of | {"spring": {"stiffness": 0.0}, "initial": {"x": 0.0, "velocity": 1.0}}
    found = over(of, 2.0 * pi, [1.0, 2.0, 20.0])
    np.testing.assert_allclose(found.drift, [1.0 - 0.3 * 0.75, 1.0 - 0.3 * 1.5, 0.0], atol=1e-12)


def branch(frequency, x, velocity, spans):
    """Runs that begin beside a motion that a change of the frequency has made unstable, as a followed branch does."""
    of = on_belt(
        {"law": "tustin", "mu_s": 0.4, "mu_k": 0.15, "alpha": 3.0},
        damping=0.05,
        velocity=0.3,
        gravity=1.0,
        force=(0.3, frequency),
        start=(x, velocity),
    )
    return over(of, 2.0 * pi * frequency, [int(span * frequency) for span in spans], exponent=True)


@pytest.mark.parametrize(
    ("start", "laps"),
    [
        ((0.21445378151260502, 0.16900256924577015, -0.4176918531735572), 2.0),
        ((0.24134453781512605, 0.30104565295412833, -0.3234233747048327), 2.0),
        ((0.20907563025210085, 0.1476761406794336, -0.4227321490531239), 1.0),
    ],
)
def test_slow_escape_from_an_unstable_motion_is_transient_until_periodic(start, laps):
    """Its exponent is positive for hundreds of periods, with a tiny scatter: the motion beside it is unstable.

    In the last case each cycle turns a disturbance round, and takes a hundredth of it: long before the motion returns
    after one period it does after two.
    """
    found = branch(*start, spans := [300, 600, 900, 1200, 3000, 10000])
    said = words(found)
    assert said[0] == "transient"
    assert said == ["transient"] * said.count("transient") + ["periodic"] * said.count("periodic")
    assert said[-2:] == ["periodic"] * 2
    assert len(said) == len(spans)
    periods = found.period.values * start[0]
    np.testing.assert_allclose(periods[np.isfinite(periods)], laps, rtol=1e-6)


@pytest.mark.parametrize("shrinks", [0.9, 0.99, 1.0])
def test_lap_of_four_that_becomes_one_of_two_is_no_period(shrinks):
    """A period of two with a disturbance that each lap turns round and lets shrink, as beside a second flip."""
    forced, k = SimpleNamespace(span=400.0), np.arange(400)
    orbit = (-1.0) ** k + 0.05 * shrinks ** (k // 2) * np.array([1.0, 1.0, -1.0, -1.0])[k % 4]
    found = cycles.none_yet(belt.Excited(), 1.0, cycles.Mark(0.0, orbit[0], 0.0, 0.0, 0.0))
    periods = set()
    for t, x in enumerate(orbit[1:].tolist(), 1):
        mark = cycles.Mark(float(t), x, 0.0, 0.0, 0.0)
        found = cycles.closed(forced, found, mark, float(t), True, 2.0, 2.0, 1.0)
        if cycles.returns_each_time(forced, found, True, 2.0, 0.0, (np.nan, np.nan)):
            periods.add(found.period)
    assert periods == {0.9: {2.0}, 0.99: set(), 1.0: {4.0}}[shrinks]


@pytest.mark.slow
def test_period_of_thirteen_cycles_is_found_in_each_span():
    """SciPy finds the same motion: it returns after thirteen periods of the force, and not before."""
    period = 2.0 * pi / 1.6
    found = over(cubic(1.6, 0.3), 1.6, [200, 213, 300, 617, 1000])
    assert words(found) == ["periodic"] * 5
    np.testing.assert_allclose(found.period, 13.0 * period, rtol=1e-9)

    parts = by_scipy(cubic(1.6, 0.3) | {"time": {"span": 213 * period}}, 1e-10)
    x = states_at(parts, period * np.arange(187, 213))[:, 0]
    np.testing.assert_allclose(x[13:], x[:-13], atol=1e-7)
    assert min(abs(x[-1] - x[-1 - k]) for k in range(1, 13)) > 1e-3
    stops = sum(part.t[0] > 200 * period for part, sign in parts if sign == 0.0)
    assert stops == pytest.approx(13.0 * found.stops_per_cycle[0].item())


def test_words_of_free_motions():
    """Stick-slip of three cycles erased its past; steady slip is steady; a body at rest on a belt at rest rests."""
    free = on_belt({"law": "stiction", "mu_s": 0.15, "mu_k": 0.1}, 2.0, velocity=0.1, span=30.0, start=(0.0, 0.0))
    points = {
        "belt.velocity": [0.1, 0.1, 0.1, 0.0, 0.1],
        "initial.x": [0.0, 0.45, 0.0, 1.0, 0.0],
        "damper.coefficient": [0.0, 1.0, 0.0, 0.0, 0.0],
        "initial.velocity": [0.1, 0.0, 0.1, 0.0, 0.1],
        "time.span": [30.0, 30.0, 10.0, 30.0, 5.0],
    }
    found = ringsweep.run({"scene": with_all_parts(free), "sweep": {"points": points}}, jobs=1, progress=False)
    assert words(found) == ["periodic", "steady", "transient", "rest", "transient"]
    assert found.settled.values.tolist() == [1, 1, 0, 1, 0]
