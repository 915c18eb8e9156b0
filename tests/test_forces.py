"""A damper, a cubic spring and forces on the belt, against closed forms, published numbers and other integrators."""

from math import asin, cos, pi, sin, sqrt

import numpy as np
import pytest
from belts import by_scipy, on_belt, outcome
from refusals import refused
from scipy.optimize import brentq
from scipy.special import ellipj, ellipk
from solutions import cell_of
from tiers import mostly_slow

import ringsweep
from ringsweep.models.belt.mode import Mode
from ringsweep.models.interface import audit, implicit
from ringsweep.physics import drives
from ringsweep.physics.forces import Forced
from ringsweep.physics.friction.velocity import BAND, KINETIC


def forced(law="stiction", *, friction=0.0, load=0.0, v_b=0.0, span=10.0, force=None, k=1.0, cubic=0.0, c=0.0, x=0.0,
           v=None):  # fmt: skip
    """Scene with mass, stiffness and weight in units of 1; `friction` is F_s = F_k, `load` is added to F_s.

    A part that is not given has the coefficient 0, so that all scenes of a law have one kernel.
    """
    of_law = {"bengisu-akay": {"v0": 1e-6, "alpha": 10.0}, "karnopp": {"dead_band": 0.05}}.get(law, {})
    friction = {"law": law, "mu_s": friction + load, "mu_k": friction, **of_law}
    start = x, v_b if v is None else v
    scene = on_belt(friction, k, cubic=cubic, damping=c, velocity=v_b, gravity=1.0, start=start, span=span)
    return scene | {"force": {"amplitude": 0.0, "frequency": 0.0, "phase": 0.0, "constant": 0.0} | (force or {})}


def end(scene, solver="auto"):
    """Displacement and velocity at the end of a certified run."""
    run = ringsweep.simulate(scene, solver=solver, samples=50)
    assert run.certified == 1 or "certify" in solver
    return float(run.x_end), float(run.velocity_end)


def breakaway(run):
    """Time and index of the first sample at which a body slips."""
    slips = np.flatnonzero(run["mode"].values)[0]
    return float(run.time[slips]), slips


class TestClosedForms:
    """Without friction each part has a known motion."""

    @pytest.mark.parametrize("c", [0.1, 1.9, 5.0])
    def test_free_damped_vibration_decays_as_the_roots_of_its_polynomial_say(self, c):
        run = ringsweep.simulate(forced(c=c, x=0.7, v=-0.4, span=12.0), samples=100)
        roots = np.roots([1.0, c, 1.0])
        weights = np.linalg.solve([[1.0, 1.0], roots], [0.7, -0.4])
        t, x, velocity = run.time.values, run.x.values, run.velocity.values
        modes = weights[:, None] * np.exp(np.outer(roots, t))
        np.testing.assert_allclose(x, modes.sum(axis=0).real, atol=1e-10)
        np.testing.assert_allclose(velocity, (roots[:, None] * modes).sum(axis=0).real, atol=1e-10)
        assert run.certified == 1

    @pytest.mark.parametrize(("frequency", "c"), [(0.05, 0.3), (0.4, 0.0), (3.0, 0.1)])
    def test_forced_vibration_is_the_transient_and_the_response_to_the_force(self, frequency, c):
        force = {"amplitude": 2.5, "frequency": frequency, "phase": "40 deg", "constant": -0.6}
        run = ringsweep.simulate(forced(c=c, x=0.3, v=0.2, span=30.0, force=force), samples=200)
        rate = 2.0 * pi * frequency
        gain = 2.5 * np.exp(1j * np.radians(40.0)) / (1.0 - rate**2 + 1j * c * rate)
        roots = np.roots([1.0, c, 1.0])
        weights = np.linalg.solve([[1, 1], roots], [0.9 - gain.imag, 0.2 - (1j * rate * gain).imag])
        t, x = run.time.values, run.x.values
        transient = (weights[:, None] * np.exp(np.outer(roots, t))).sum(0).real
        expected = (gain * np.exp(1j * rate * t)).imag - 0.6 + transient
        np.testing.assert_allclose(x, expected, atol=2e-9 * abs(expected).max())
        assert run.certified == 1

    @pytest.mark.parametrize(("k", "cubic", "amplitude"), [(1.0, 0.5, 2.0), (0.0, 1.0, 0.4), (1.0, -0.2, 1.9)])
    def test_cubic_spring_swings_as_an_elliptic_function_and_keeps_its_energy(self, k, cubic, amplitude):
        """The Duffing oscillator, hardening, without a linear part, and softening."""
        rate = sqrt(k + cubic * amplitude**2 if cubic > 0.0 else k + 0.5 * cubic * amplitude**2)
        modulus = 0.5 * abs(cubic) * amplitude**2 / rate**2
        quarter = ellipk(modulus) / rate
        run = ringsweep.simulate(forced(k=k, cubic=cubic, x=amplitude, span=13.0 * quarter), samples=100)
        t, x, velocity = run.time.values, run.x.values, run.velocity.values
        cosine, sine = ellipj(rate * t, modulus)[1], ellipj(rate * (t + quarter), modulus)[0]
        np.testing.assert_allclose(x, amplitude * (cosine if cubic > 0.0 else sine), atol=2e-9 * amplitude)
        energy = 0.5 * velocity**2 + 0.5 * k * x**2 + 0.25 * cubic * x**4
        np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
        # On a belt at rest the body turns at an event, here after three periods.
        assert abs(t - 12.0 * quarter).min() == pytest.approx(0.0, abs=1e-8 * quarter)
        assert run.certified == 1

    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_resting_body_without_friction_follows_a_force_that_begins_to_act(self, side):
        """Force and sliding velocity are zero at first: the rate of the force decides where the body goes."""
        rate = 0.2 * pi
        scene = forced(span=6.0, force={"amplitude": side, "frequency": 0.1})
        expected = side / (1.0 - rate**2) * (sin(rate * 6.0) - rate * sin(6.0))
        assert end(scene)[0] == pytest.approx(expected, rel=1e-9)

    def test_softening_spring_without_equilibrium_fails_and_the_sweep_goes_on(self):
        found = ringsweep.sweep(forced(cubic=-1.0, span=50.0), {"initial.x": [0.5, 2.0]}, progress=False)
        assert ringsweep.words(found.regime).values[1] == "failed"
        assert found.certified.values.tolist() == [1, 0]


class TestStick:
    """A stuck body breaks away when the sum of the other forces reaches the breakaway force."""

    def test_harmonic_force_breaks_the_body_loose_at_the_arcsine(self):
        run = ringsweep.simulate(forced(friction=1.0, load=0.5, force={"amplitude": 2.0, "frequency": 0.1}))
        time, slips = breakaway(run)
        assert time == pytest.approx(asin(1.5 / 2.0) / (0.2 * pi), rel=1e-12)
        assert (run.x.values[:slips] == 0.0).all()
        # While it sticks, friction balances the force.
        np.testing.assert_allclose(run.friction_force[:slips], 2.0 * np.sin(0.2 * pi * run.time[:slips]), atol=1e-12)

    def test_stuck_body_waits_for_a_force_that_first_falls(self):
        """More than half a period passes, which no single series spans."""
        force = {"amplitude": 1.0, "frequency": 2.0, "phase": pi, "constant": 1.0}
        run = ringsweep.simulate(forced(friction=1.0, load=0.5, force=force))
        assert breakaway(run)[0] == pytest.approx(7.0 / 24.0, rel=1e-11)

    def test_body_breaks_loose_where_spring_and_damper_pull_with_all_friction(self):
        run = ringsweep.simulate(forced(friction=1.0, load=0.5, v_b=0.3, c=0.8, cubic=2.0, force={"constant": 0.25}))
        place = brentq(lambda x: x + 2.0 * x**3 + 0.8 * 0.3 - 0.25 - 1.5, 0.0, 2.0, xtol=1e-15)
        assert breakaway(run)[0] == pytest.approx(place / 0.3, rel=1e-12)

    @pytest.mark.slow
    def test_cubic_spring_on_a_rocking_belt_breaks_loose_where_its_force_does(self):
        """The third power oscillates three times as fast as the belt, and the series of the guard with it."""
        scene = forced(friction=0.5, k=0.0, cubic=8.0)
        del scene["belt"], scene["initial"], scene["damper"], scene["force"]
        scene["drive"] = {"law": "sinusoidal", "amplitude": 0.5, "frequency": 0.05}
        run = ringsweep.simulate(scene)
        rate = 0.1 * pi

        def pull(t):
            return -8.0 * (0.5 * sin(rate * t)) ** 3 + 0.5 * rate**2 * sin(rate * t) + 0.5

        assert breakaway(run)[0] == pytest.approx(brentq(pull, 0.0, 5.0, xtol=1e-14), rel=1e-11)

    @pytest.mark.slow
    def test_body_in_a_dead_band_is_held_while_friction_can_balance_the_force(self):
        """Karnopp's law: the body leaves the dead band when the excess of the force has made it fast enough."""
        rate = 0.2 * pi
        force = {"amplitude": 2.0, "frequency": 0.1}
        run = ringsweep.simulate(forced("karnopp", friction=1.0, load=0.5, k=0.0, force=force))
        loose = asin(1.5 / 2.0) / rate

        def speed(t):
            return 2.0 / rate * (cos(rate * loose) - cos(rate * t)) - 1.5 * (t - loose)

        time, slips = breakaway(run)
        leaves = brentq(lambda t: speed(t) - 0.05, loose + 1e-3, loose + 2.0, xtol=1e-14)
        assert time == pytest.approx(leaves, rel=1e-11)
        assert float(run.velocity[slips]) == pytest.approx(0.05, rel=1e-10)


def inclined(angle, **parts):
    """A scene on a belt that rises towards growing x by this angle."""
    scene = forced(**parts)
    return scene | {"belt": scene["belt"] | {"incline": angle}}


class TestIncline:
    """Gravity pulls a body down the belt, and presses it less."""

    def test_angle_at_which_a_block_slides_has_the_tangent_mu_s(self):
        block = inclined("0 deg", friction=0.3, load=0.2, k=0.0)
        found = ringsweep.threshold(block, "belt.incline", "riding", ("0 deg", "45 deg"), 1e-9, scan=5)
        assert abs(found.belt_incline.item() - np.arctan(0.5)) <= found.error.item() <= 1e-9

    def test_block_slides_down_as_galilei_says(self):
        steep = np.radians([-89.9, -30.0, 30.0, 89.9])
        block = inclined("0 deg", friction=0.3, load=0.2, k=0.0, span=2.0)
        found = ringsweep.sweep(block, {"belt.incline": steep}, progress=False)
        expected = -2.0 * np.sign(steep) * (abs(np.sin(steep)) - 0.3 * np.cos(steep))
        np.testing.assert_allclose(found.x_end, expected, rtol=1e-10)
        assert (found.certified == 1).all()

    @pytest.mark.parametrize("v_b", [-2.0, 2.0])
    def test_spring_balances_gravity_and_friction_in_the_end(self, v_b):
        angle = np.radians(20.0)
        x, velocity = end(inclined("20 deg", friction=0.1, c=1.0, v_b=v_b, span=60.0))
        assert x == pytest.approx(0.1 * np.sign(v_b) * np.cos(angle) - np.sin(angle), rel=1e-9)
        assert velocity == pytest.approx(0.0, abs=1e-9)

    @pytest.mark.parametrize("angle", ["90 deg", "-90 deg", "2 rad"])
    def test_belt_that_is_upright_or_overhangs_is_refused(self, angle):
        refused(r"belt\.incline.*greater than -1\.5708 and less than 1\.5708", ringsweep.simulate, inclined(angle))


class TestPublished:
    """Numbers that others published."""

    @pytest.mark.parametrize(("r", "beta"), [(0.6, 0.2), (0.8, 0.5), (1.25, 0.5), (1.5, 0.4), (2.0, 0.3), (3.0, 0.3)])
    def test_forced_coulomb_oscillator_has_the_steady_amplitude_of_den_hartog(self, r, beta):
        """J. P. Den Hartog, Trans. ASME 53 (1931): motions without stops."""
        V, U = 1.0 / (1.0 - r**2), sin(pi / r) / (r * (1.0 + cos(pi / r)))
        period = 2.0 * pi / r
        force = {"amplitude": 1.0, "frequency": 1.0 / period}
        run = ringsweep.simulate(forced(friction=beta, span=100.0 * period, force=force), solver="event", samples=10)
        x = run.x.values[run.time.values > 97.0 * period]
        for turn in (x.max(), -x.min()):
            assert turn == pytest.approx(sqrt(V**2 - beta**2 * U**2), abs=1e-9)
        assert run.certified == 1

    def test_friction_oscillator_of_siconos_rests_at_the_known_place_and_time(self):
        run = ringsweep.simulate(forced(friction=1.0, x=12.0, v=6.0, span=30.0), solver="event")
        rests = np.flatnonzero(run["mode"].values == 0)[0]
        assert float(run.time[rests]) == pytest.approx(22.42355635, abs=1e-9)
        assert float(run.x_end) == pytest.approx(0.6821789367, abs=1e-9)


def everything(rng, law="stiction", *, table=False):
    """Random scene with all parts together."""
    constant = rng.uniform(-0.5, 0.5)
    if table:
        times = np.linspace(0.0, 6.0, 13).tolist()
        force = {"time": times, "force": rng.normal(size=13).tolist(), "amplitude": 2.0, "constant": constant}
    else:
        frequency, phase = rng.uniform(0.1, 1.0), rng.uniform(0.0, 6.0)
        force = {"amplitude": rng.uniform(1.0, 4.0), "frequency": frequency, "phase": phase, "constant": constant}
    scene = forced(
        law,
        friction=rng.uniform(0.1, 0.5),
        load=rng.uniform(0.0, 0.3),
        v_b=rng.choice([-0.3, 0.0, 0.2]),
        span=6.0,
        **{"k": rng.uniform(0.5, 4.0), "cubic": rng.uniform(0.5, 8.0), "c": rng.uniform(0.02, 0.5)},
        **{"x": rng.uniform(-0.5, 0.5), "v": rng.uniform(-0.5, 0.5)},
    )
    return scene | {"force": force}


class TestMethods:
    """All parts together, by SciPy."""

    @pytest.mark.parametrize("table", mostly_slow([False, True], [False]), ids=["harmonic", "table"])
    def test_event_agrees_with_an_independent_integration(self, table):
        rng = np.random.default_rng(17)
        for _ in range(4):
            scene = everything(rng, table=table)
            (last, _) = by_scipy(scene, max_step=0.05)[-1]
            exact = last.y[:, -1] + np.array([0.0, scene["belt"]["velocity"]])
            np.testing.assert_allclose(end(scene), exact, atol=1e-9)

    @pytest.mark.slow
    def test_step_of_a_table_moves_the_body_as_its_ramps_do(self):
        """Each change r of the rate of the force moves a frictionless body by r(s - sin s) after the time s."""
        times, samples = [0.0, 0.5, 0.51, 1.0, 1.01, 6.0], [0.0, 0.0, 3.0, 3.0, 0.0, 0.0]
        force = {"time": times, "force": samples, "interpolate": "linear"}
        run = ringsweep.simulate(forced(span=6.0) | {"force": force})
        rates = np.diff(samples, prepend=0.0) / np.diff(times, prepend=-1.0)
        after = np.maximum(run.time.values[:, None] - times[:-1], 0.0)
        x = ((after - np.sin(after)) * np.diff(rates[1:], prepend=0.0)).sum(axis=1)
        np.testing.assert_allclose(run.x, x, atol=1e-9)
        np.testing.assert_allclose(run.force, np.interp(run.time, times, samples), atol=1e-12)
        assert run.certified.item() == 1

    @pytest.mark.slow
    @pytest.mark.parametrize(("part", "expected"), [({"c": 50.0}, 50.0), ({"cubic": 600.0, "x": 1.0}, sqrt(1801.0))])
    def test_rk4_counts_damper_and_cubic_spring_in_the_stiffness(self, part, expected):
        """Eigenvalues are about c/m, and sqrt((k + 3 cubic x^2)/m). The belt is faster than the body."""
        found = outcome(forced(v_b=100.0, **part, v=0.0), {"method": "rk4", "steps": 1000})
        assert float(found.stiffness) == pytest.approx(expected * 0.01, rel=0.01)


class TestLinearisation:
    """Implicit steps need the derivatives of the rates by state and time."""

    @pytest.mark.parametrize("law", ["bengisu-akay", "lugre"])
    def test_derivatives_equal_differences_of_the_rates(self, law):
        scene = forced(law, friction=0.3, load=0.2, cubic=2.0, c=0.7, force={"amplitude": 1.5, "frequency": 0.3})
        del scene["belt"]
        scene["drive"] = {"law": "sinusoidal", "amplitude": 0.4, "frequency": 0.2}
        of_law = {"v0": 0.1} if law == "bengisu-akay" else {"sigma0": 30.0, "sigma1": 2.0, "sigma2": 0.1, "v_s": 0.1}
        scene["friction"] |= of_law
        cell = cell_of(scene)
        mode = Mode(1, BAND if law == "bengisu-akay" else KINETIC, -1, (), ())
        t, x = 0.6, (0.4, 0.05, 0.003)[: 2 if law == "bengisu-akay" else 3]

        def rates(t, x):
            return np.array(implicit.rates(cell, mode, (), drives.turn(cell.drive, t), tuple(x)))

        def difference(k):
            step = 1e-6 * np.eye(len(x))[k]
            return (rates(t, x + step) - rates(t, x - step)) / 2e-6

        linear = implicit.linearise(cell, mode, (), t, drives.turn(cell.drive, t), x)
        found, jacobian, by_time = linear
        np.testing.assert_allclose(found, rates(t, x), rtol=1e-12)
        for k, column in enumerate(np.transpose(jacobian)):
            np.testing.assert_allclose(difference(k), column, rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose((rates(t + 1e-6, x) - rates(t - 1e-6, x)) / 2e-6, by_time, rtol=1e-6, atol=1e-8)


class TestAudit:
    """The audit knows the forces from the scene, not from the solver."""

    def cell(self, **changes):
        scene = forced(friction=0.4, v_b=0.1, c=0.5, cubic=2.0, force={"amplitude": 1.5, "frequency": 0.3}, **changes)
        return cell_of(scene)

    def violation(self, scene, t, error=0.0):
        """Violation of a state in slip whose acceleration belongs to a force that is wrong by `error`."""
        forcing = drives.turn(scene.drive, t)
        x, v = 0.3, 0.7
        push = 1.5 * sin(0.6 * pi * t) + error
        rate = -x - 2.0 * x**3 - 0.5 * (v + 0.1) + push - 0.4
        mode = Mode(1, KINETIC, -1, (), ())
        found, power = audit.violation(scene, mode, forcing, (x, v), (v + 0.1, rate), 0.1, 1e-10)
        assert power == pytest.approx((v + 0.1) * (push - error - 0.4 - 0.5 * (v + 0.1)), rel=1e-12)
        return found

    def test_wrong_force_is_a_violation(self):
        scene = self.cell()
        for t in (0.0, 0.7, 3.1):
            assert self.violation(scene, t) < 1e-3
            assert self.violation(scene, t, 1e-3) > 1e3


class TestParts:
    """A scene has the parts that it names, or that a sweep gives."""

    def plain(self, **sections):
        scene = forced(friction=0.4, load=0.1)
        del scene["force"], scene["damper"], scene["spring"]["cubic"]
        return scene | sections

    def test_parts_without_effect_change_nothing(self):
        plain, zero = self.plain(), forced(friction=0.4, load=0.1)
        for scene in (plain, zero):
            scene |= {"belt": {"velocity": 0.3}, "initial": {"x": 0.2, "velocity": 1.0}}
        np.testing.assert_allclose(end(plain), end(zero), rtol=0.0, atol=1e-12)

    def test_period_of_the_forcing_is_the_common_one_of_belt_and_force(self):
        def period(belt, force):
            motion = drives.Sinusoidal(0.1, belt, 0.0) if belt else drives.Constant(0.1)
            return drives.period(Forced(motion, drives.Sinusoidal(1.0, force, 0.0), 0.0, 1.0))

        assert drives.period(drives.Constant(0.1)) == 0.0
        assert period(None, 0.5) == 2.0
        assert period(0.5, 0.5) == 2.0
        assert period(0.25, 1.5) == pytest.approx(4.0)
        assert period(0.2, 0.3) == pytest.approx(10.0)
        assert period(1.0, sqrt(2.0)) == np.inf
        assert period(0.4, 0.0) == 2.5
