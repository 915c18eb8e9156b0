"""What a forced motion on the belt settles to does not depend on where the span ends."""

from math import pi

import numpy as np

import ringsweep


def scene(law, omega, amplitude, *, x=0.0, velocity=0.0, cubic=None, damping=None, **friction):
    """A body of 1 kg on a spring of 1 N/m and a belt of 1 m/s, g = 1 m/s^2, under a force (N) at `omega` (rad/s)."""
    found = {
        "model": "belt",
        "gravity": 1.0,
        "body": {"mass": 1.0},
        "spring": {"stiffness": 1.0} | ({} if cubic is None else {"cubic": cubic}),
        "belt": {"velocity": 1.0},
        "friction": {"law": law, **friction},
        "force": {"amplitude": amplitude, "frequency": omega / (2.0 * pi)},
        "initial": {"x": x, "velocity": velocity},
        "time": {"span": 100.0},
    }
    return found if damping is None else found | {"damper": {"coefficient": damping}}


def over(of, omega, periods):
    return ringsweep.sweep(of, {"time.span": [n * 2.0 * pi / omega for n in periods]}, progress=False)


def test_slow_growth_of_a_forced_motion_is_not_settled():
    """The damper takes less than the falling friction gives: the swing grows until the body sticks."""
    of = scene("tustin", 0.5, 0.1, x=0.5, mu_s=0.302, mu_k=0.3, alpha=1.0, damping=5e-4)
    found = over(of, 0.5, [50, 100, 300])
    np.testing.assert_array_equal(found.settled, 0)
    assert np.isnan(found.period).all()


def test_resonance_without_bound_is_not_settled():
    """Den Hartog's oscillator at r = 1, F/P = 0.5: friction takes less than the force gives, at any swing."""
    of = scene("coulomb", 1.0, 1.0, mu_k=0.5) | {"belt": {"velocity": 0.0}}
    found = over(of, 1.0, [300, 800])
    assert found.swing[1] > 2.0 * found.swing[0]
    np.testing.assert_array_equal(found.settled, 0)


def test_chaotic_motion_has_no_period_in_any_span():
    of = scene("tustin", 0.6, 0.8, x=0.1, mu_s=0.6, mu_k=0.2, alpha=3.0, cubic=1.0, damping=0.02)
    found = over(of, 0.6, [*range(200, 240), 617, 1000])
    np.testing.assert_array_equal(found.settled, 0)
    assert np.isnan(found.period).all()
    assert np.unique(found.regime).size == 1


def test_motion_that_returns_after_thirteen_periods_does_so_in_each_span():
    of = scene("tustin", 1.6, 0.3, x=0.1, mu_s=0.6, mu_k=0.2, alpha=3.0, cubic=1.0, damping=0.02)
    found = over(of, 1.6, [*range(200, 240), 617, 1000])
    np.testing.assert_array_equal(found.settled, 1)
    np.testing.assert_allclose(found.period, 13.0 * 2.0 * pi / 1.6, rtol=1e-9)
