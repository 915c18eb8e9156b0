"""Numbers that others have published for oscillators with dry friction; more of them in test_forces."""

import numpy as np
import pytest
import xarray as xr
from belts import on_belt, with_all_parts
from scipy import optimize, special

import ringsweep

pytestmark = pytest.mark.slow


def oscillator(span, **changes):
    """Den Hartog's oscillator: a mass on a spring under Coulomb friction and a harmonic force; all numbers are 1."""
    return (
        on_belt({"law": "coulomb", "mu_k": 0.5}, velocity=0.0, gravity=1.0, force=(1.0, 0.2, "90 deg"), span=span)
        | changes
    )


#: F_s/(1 + delta |v|) on a belt, in a code for optimal control of systems with implicit switches (Bock, Kirches, Meyer,
#: Potschka). The last three numbers were computed with SciPy.
LEINE = {"x_max": 1.133944669704, "period": 12.0010312948, "slip": 4.2959995255, "stick_from": -0.5410063539}


@pytest.mark.parametrize("law", ["hyperbolic", "formula"])
def test_stick_slip_under_leines_hyperbola(law):
    friction = {"law": law, "mu_s": 1.0, "mu_k": 0.0, "delta": "3 s/m"}
    if law == "formula":
        friction |= {"mu": "mu_s/(1 + delta*v)", "at_rest": "mu_s"}
        del friction["mu_k"]
    scene = oscillator(100.0, belt={"velocity": 0.2}, friction=friction)
    del scene["force"]
    run = ringsweep.sweep(scene, {})
    assert run.certified == 1
    assert ringsweep.words(run.regime) == "stick-slip"
    assert float(run.x_max) == pytest.approx(LEINE["x_max"], abs=1e-8)
    assert float(run.period) == pytest.approx(LEINE["period"], abs=1e-8)
    assert float(run.period * (1 - run.stick_share)) == pytest.approx(LEINE["slip"], abs=1e-8)
    history = ringsweep.simulate(scene)
    begins = np.flatnonzero((history.mode.values[1:] == 0) & (history.mode.values[:-1] != 0)) + 1
    np.testing.assert_allclose(history.x.values[begins], LEINE["stick_from"], atol=1e-8)


#: Ratio of frequencies, and ratio of friction to force below which the motion has no stops (Den Hartog, Trans. ASME 53,
#: 1931).
LIMIT = {0.8: 0.817406, 0.9: 0.819650, 1.25: 0.698821, 1.5: 0.646579, 2.0: 0.596285, 3.0: 0.5625}


def test_den_hartogs_limit_of_motion_without_stops():
    ratios, limits = np.array(list(LIMIT)), np.array(list(LIMIT.values()))
    for shift, stops in ((-1e-5, False), (1e-5, True)):
        axes = {
            "friction.mu_k": xr.DataArray(limits + shift, dims="case"),
            "force.frequency": xr.DataArray(ratios / (2 * np.pi), dims="case"),
        }
        run = ringsweep.sweep(with_all_parts(oscillator(3000.0)), axes)
        assert (run.settled == 1).all()
        assert ((run.stops_per_cycle > 0) == stops).all()


def test_steady_motions_have_the_numbers_of_stops_that_hong_and_liu_found():
    """0, 2, 4, 6, 8, 10, 12 and 14 stops in a cycle (Hong and Liu 2000). Single stops grow shorter for ever."""
    ratios = np.array([0.035, 0.04, 0.05, 0.07, 0.1, 0.2, 0.25, 0.5, 1.2])
    axes = {"force.frequency": ratios / (2 * np.pi), "friction.mu_k": np.linspace(0.02, 0.8, 79)}
    run = ringsweep.sweep(with_all_parts(oscillator(800.0)), axes)
    stops, settled = run.stops_per_cycle.values, run.settled.values == 1
    assert {0, 2, 4, 6, 8, 10, 12, 14} <= set(stops[settled & (run.certified.values == 1)].tolist())
    assert (stops == 1).any()
    assert not settled[stops == 1].any()


def damped(damping, friction, **changes):
    """A mass on a spring and a damper under friction that falls with the speed; mass, stiffness and gravity are 1."""
    return on_belt(friction, damping=damping, gravity=1.0) | changes


#: Friction of two publications; with all parts of a belt they share a kernel.
CUBIC = {"law": "formula", "mu": "mu_s - k1*v + k3*v**3", "at_rest": "mu_s"}


class TestThomsenAndFidlinsAmplitudes:
    """Analytical approximations for stick-slip vibration amplitudes, Int. J. Non-Linear Mech. 38 (2003).

    Damping and falling friction are small of the first order: their errors are of the second.
    """

    STATIC, LEAST, SPEED, RATIO = 0.4, 0.25, 0.5, 0.05

    def branch(self, small, shares):
        """Run down from steady slip, at shares of the speed below which it is unstable; the speeds, and their limit."""
        fall, damping = (self.STATIC - self.LEAST) * small, self.RATIO * small
        k1, k3 = 1.5 * fall / self.SPEED, 0.5 * fall / self.SPEED**3
        onset = np.sqrt((k1 - 2 * damping) / (3 * k3))
        law = CUBIC | {"mu_s": self.STATIC, "k1": k1, "k3": k3}
        velocities = np.array(shares) * onset
        mapping = {
            "scene": with_all_parts(
                damped(2 * damping, law, initial={"x": 0.4, "velocity": 0.0}, time={"span": 3000.0 / small})
            ),
            "record": {"exponent": True},
            "sweep": {
                "grid": {"belt.velocity": velocities.tolist()},
                "follow": {"axis": "belt.velocity", "direction": "down"},
            },
        }
        run = ringsweep.run(mapping, jobs=1, progress=False)
        return run, velocities, onset, -0.5 * (2 * damping - k1 + 3 * k3 * velocities**2)

    def test_amplitude_of_slip_without_stick(self):
        errors = []
        for small in (1.0, 0.3):
            run, velocities, onset, rate = self.branch(small, [0.9, 0.92, 0.95, 0.98])
            assert set(ringsweep.words(run.regime).values) == {"oscillatory"}
            assert set(ringsweep.words(run.long_run).values) == {"periodic"}
            errors.append(0.5 * run.swing.values / (2 * np.sqrt(onset**2 - velocities**2)) - 1.0)
            # The cycle attracts twice as fast as steady slip repels.
            np.testing.assert_allclose(run.lyapunov, -2 * rate, rtol=0.06)
        assert (abs(errors[1]) < 2.1e-3).all()
        np.testing.assert_allclose(errors[1] / errors[0], 0.3**2, rtol=0.05)

    def test_onset_and_speed_below_which_it_sticks(self):
        run, _, _, rate = self.branch(1.0, [0.88, 0.9, 1.005, 1.02])
        assert ringsweep.words(run.regime).values.tolist() == ["stick-slip", "oscillatory", "sliding", "sliding"]
        assert 0.88 < np.sqrt(4 / 5) < 0.9
        np.testing.assert_allclose(run.lyapunov[2:], rate[2:], rtol=1e-3)


def threshold(scene, slip, radius):
    """Displacement at rest, near that of steady slip plus the radius, beyond which the motion goes to the cycle."""
    ends = sorted([slip + 0.5 * radius, slip + 1.5 * radius])
    found = ringsweep.threshold(scene, "initial.x", "stick-slip", ends, 1e-7, scan=3, jobs=1)
    assert found.begins.values.tolist() == [radius > 0.0]
    return float(found.initial_x[0])


def test_hetzlers_unstable_cycle_bounds_the_basin_of_steady_slip():
    """Hetzler, Schwarzer and Seemann, Commun. Nonlinear Sci. Numer. Simul. 12 (2007): the Hopf bifurcation under
    exponentially falling friction is subcritical. Averaging over a cycle of radius a gives
    2 I_1(alpha a)/(alpha a) = exp(alpha (v - v_hopf)), with an error of the second order in damping.
    """
    alpha, hopf, errors = 2.0, 0.5 * np.log(10.0), []
    for small in (1.0, 0.3):
        law = {"law": "tustin", "mu_s": 0.5 + 0.5 * small, "mu_k": 0.5, "alpha": alpha}
        for velocity in (1.18, 1.25):
            target = np.exp(alpha * (velocity - hopf))
            radius = optimize.brentq(lambda z, t=target: 2 * special.iv(1, z) / z - t, 1e-3, 10.0) / alpha
            slip = 0.5 + 0.5 * small * np.exp(-alpha * velocity)
            scene = with_all_parts(
                damped(
                    0.1 * small,
                    law,
                    belt={"velocity": velocity},
                    initial={"velocity": 0.0},
                    time={"span": 4000.0 / small},
                )
            )
            # Half the width: harmonics of the first order move both ends alike.
            ends = [threshold(scene, slip, side * radius) for side in (-1.0, 1.0)]
            errors.append((ends[1] - ends[0]) / (2.0 * radius) - 1.0)
    assert (abs(np.array(errors[2:])) < 2e-4).all()
    np.testing.assert_allclose(np.array(errors[2:]) / errors[:2], 0.3**2, rtol=0.1)


class TestSuddenOnsetOfChaos:
    """Oscillator of Popp and Stelter with the friction 1.5 - 1.5 v + 0.45 v^3, and a force of 0.1 cos(nu t).

    di Bernardo, Kowalczyk and Nordmark (2003): chaos begins at once at nu = 1.7077997, where the motion of period four
    grazes the speed of the belt.
    """

    def follow(self, nu, span=3000.0):
        scene = {
            "model": "belt",
            "gravity": 1.0,
            "body": {"mass": 1.0},
            "spring": {"stiffness": 1.0},
            "belt": {"velocity": 1.0},
            "friction": CUBIC | {"mu_s": 1.5, "k1": "1.5 s/m", "k3": "0.45 s^3/m^3"},
            "force": {"amplitude": 0.1, "phase": np.pi / 2.0},
            "initial": {"x": 1.0, "velocity": 1.0},
            "time": {"span": span},
        }
        grid = {"force.frequency": (np.asarray(nu) / (2.0 * np.pi)).tolist()}
        config = {"scene": with_all_parts(scene), "record": {"exponent": True}, "sweep": {"grid": grid}}
        return ringsweep.run(config, jobs=1, progress=False)

    def test_chaos_begins_where_it_has_been_published(self):
        nu = 1.7077997 + np.arange(-7, 8) * 1e-7
        ds = self.follow(nu)
        below = nu <= 1.7077997 + 1e-12
        assert set(ringsweep.words(ds.long_run).values[below]) == {"chaotic"}
        assert set(ringsweep.words(ds.long_run).values[~below]) == {"periodic"}
        np.testing.assert_allclose(ds.period.values[~below] * nu[~below] / (2.0 * np.pi), 4.0)
        assert (ds.lyapunov.values[below] > 3.0 * ds.lyapunov_error.values[below]).all()
        # The stable motion contracts by a finite factor up to the end: no multiplier announces it.
        assert (ds.multiplier_1.values[~below] < 0.85).all()

    def test_words_of_bands_below_the_tolerance_do_not_change_with_the_span(self):
        """One of four bands touches the speed of the belt, at times: the last lap may have a stop or none."""
        nu = np.linspace(1.7075, 1.7077, 9)
        for span in (3000.0, 4000.0, 15000.0):
            ds = self.follow(nu, span)
            assert set(ringsweep.words(ds.regime).values) == {"stick-slip"}
            # Shares of some hundred cycles scatter.
            np.testing.assert_allclose(ds.stops_per_cycle, 0.158, atol=0.02)
