"""Runs side by side in vector lanes: functions against the C library, and runs against single runs."""

from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from solutions import made
from tiers import mostly_slow

from ringsweep.compile import kernel, take
from ringsweep.models import MODELS
from ringsweep.models.parts import exceeds, larger_eigenvalue
from ringsweep.numerics.functions import any_of, decay, floor, opposing, select, sine_cosine, sine_cosine_carried
from ringsweep.numerics.lanes import WIDTH
from ringsweep.numerics.memory import conform, read_lanes, side_by_side, write
from ringsweep.physics.friction import LAWS, Dynamic, family_of
from ringsweep.physics.friction.laws import Definition, define
from ringsweep.physics.friction.velocity import friction_at, steepest, stiction_band
from ringsweep.quantities.parameters import declared
from ringsweep.solvers.rk4 import RK4

NAMES = MODELS["ring"].outcomes


@kernel
def _functions(x, near, out):
    (a,), (b,) = read_lanes(x, 0, (0.0,)), read_lanes(near, 0, (0.0,))
    sine, cosine = sine_cosine(a)
    far = select(a > b, a, -b)
    write(out, 0, WIDTH, (sine, cosine, decay(abs(a)), floor(a), opposing(abs(a), b), far, min(a, b), max(a, b)))
    write(out, 8 * WIDTH, WIDTH, sine_cosine_carried(b, a, sine, cosine, False))
    return any_of(a > 1e5)


@kernel
def _carried(x, out):
    """Sine and cosine of each row of `x`, each from those of the row before, and at the end afresh."""
    (at,) = read_lanes(x, 0, (0.0,))
    sine, cosine = sine_cosine(at)
    rows = len(x) // WIDTH
    for row in range(1, rows):
        (to,) = read_lanes(x, row * WIDTH, (0.0,))
        sine, cosine = sine_cosine_carried(to, at, sine, cosine, row == rows - 1)
        at = to
        write(out, 2 * row * WIDTH, WIDTH, (sine, cosine))


@kernel
def _friction(batch, memory, speed, out):
    (x,), one = read_lanes(speed, 0, (0.0,)), take(batch, 0)
    for lane in range(WIDTH):
        write(memory, lane, WIDTH, one)
    found = friction_at(read_lanes(memory, 0, one), x, (0.5, 0.3, 0.2, 0.1))
    write(out, 0, WIDTH, conform(found, read_lanes(out, 0, (0.0, 0.0, 0.0, 0.0))))


class TestFunctions:
    """Mathematical functions of every lane against NumPy."""

    @pytest.mark.parametrize("scale", [1e-3, 1.0, 30.0, 1e6])
    @pytest.mark.parametrize("apart", [0.0, 1e-4, 0.03, 0.04, 1.0, 1e3])
    def test_functions_of_lanes_agree_with_numpy_to_rounding(self, scale, apart):
        rng = np.random.default_rng(4)
        out = np.empty((10, WIDTH))
        for _ in range(200):
            x = rng.uniform(-scale, scale, WIDTH)
            near = x + rng.uniform(-apart, apart, WIDTH)
            some = _functions(x, near, out.reshape(-1))
            assert some == (x > 1e5).any()
            exact = np.sin(x), np.cos(x), np.exp(-abs(x))
            np.testing.assert_allclose(out[:2], exact[:2], rtol=0, atol=6e-16)
            if scale < 700:
                np.testing.assert_allclose(out[2], exact[2], rtol=0, atol=6e-16)
            np.testing.assert_array_equal(out[3], np.floor(x))
            np.testing.assert_array_equal(out[4], np.copysign(x, -near))
            np.testing.assert_array_equal(out[5], np.where(x > near, x, -near))
            np.testing.assert_array_equal(out[6:8], [np.minimum(x, near), np.maximum(x, near)])
            np.testing.assert_allclose(out[8:], [np.sin(near), np.cos(near)], rtol=0, atol=6e-16)

    @pytest.mark.parametrize("apart", [1e-4, 0.02, 0.5])
    def test_carried_sine_and_cosine_agree_with_numpy(self, apart):
        rng = np.random.default_rng(5)
        x = np.cumsum(rng.uniform(-apart, apart, (64, WIDTH)), axis=0)
        out = np.empty((64, 2, WIDTH))
        _carried(x.reshape(-1), out.reshape(-1))
        exact = np.stack([np.sin(x), np.cos(x)], axis=1)
        np.testing.assert_allclose(out[1:], exact[1:], rtol=0, atol=4e-15)
        np.testing.assert_allclose(out[-1], exact[-1], rtol=0, atol=4e-16)

    def test_min_and_max_of_lanes_ignore_nan_in_the_second_argument(self):
        x = np.linspace(-1.0, 1.0, WIDTH)
        near = x.copy()
        near[3] = np.nan
        out = np.empty((10, WIDTH))
        _functions(x, near, out.reshape(-1))
        np.testing.assert_array_equal(out[6:8], [x, x])


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(0.0, 20.0))
def test_eigenvalue_of_a_matrix_counts_where_it_exceeds_the_largest_so_far(trace, determinant, most):
    largest = np.abs(np.roots([1.0, -trace, determinant])).max()
    if abs(largest - most) > 1e-6 * (1.0 + largest):
        assert exceeds(most, trace, determinant) == (largest > most)
        assert larger_eigenvalue(most, trace, determinant) == pytest.approx(max(most, largest), rel=1e-7)
    # The first step may jump over a discontinuity.
    assert larger_eigenvalue(0.0, inf, determinant) == inf


#: Laws as formulas, with functions and switches that no law of the package has.
FORMULAS = {
    "powers": Definition("mu_s*(1 + v/v0)**(-alpha/3)", "mu_s"),
    "logarithm": Definition("mu_k + (mu_s - mu_k)/(1 + log(1 + (alpha*v)**2))", "mu_s"),
    "arc": Definition("mu_k*2/pi*atan(v/v0)"),
    "root": Definition("mu_s*v/sqrt(v*v + v0*v0)"),
    "corners": Definition("mu_s*max(min(v/v0, 1.6 - 0.6*v/v0), 0.6*(1 - exp(-v/v0)))"),
    "bump": Definition("piecewise(v < v0, mu_s*tanh(3*v/v0), v < 3*v0, mu_k + (mu_s - mu_k)*exp(-v/v0), mu_k)"),
}


#: Names of these formulas, and of the laws that rk4 takes.
IN_LANES = [*FORMULAS, *(name for name, law in LAWS.items() if family_of(law) is not Dynamic)]


class TestFriction:
    """Friction in vector lanes, where all sides of switches are computed, against friction of floats."""

    @pytest.mark.parametrize("name", mostly_slow(IN_LANES, ("powers", "arc", "stiction", "karnopp", "bengisu-akay")))
    def test_friction_in_lanes_agrees_with_friction_of_floats(self, name):
        rng = np.random.default_rng(2)
        cls = define(FORMULAS[name]) if name in FORMULAS else LAWS[name]
        out, surfaces = np.empty((4, WIDTH)), (0.5, 0.3, 0.2, 0.1)
        for _ in range(100):
            v0, alpha = 10.0 ** rng.uniform(-4, 0), 10.0 ** rng.uniform(0, 2)
            given = {"v0": v0, "v1": v0 * rng.uniform(1.1, 10.0), "alpha": alpha, "dead_band": v0, "v_s": v0, "v_t": v0}
            given |= {"delta": alpha, "k_t": 10.0 / v0}
            law = made(cls, [(0.5, 0.3), (0.2, 0.1)], **{field: given[field] for field in declared(cls)})
            speed = 10.0 ** rng.uniform(-5, 1, WIDTH)
            batch = side_by_side(cls(*(np.array([field]) for field in law)))
            _friction(batch, np.empty(30 * WIDTH), speed, out.reshape(-1))
            exact = np.transpose([friction_at(law, float(x), surfaces) for x in speed])
            scale = 1.0 + np.abs(exact).max(axis=1, keepdims=True)
            np.testing.assert_allclose(out / scale, exact / scale, rtol=0, atol=1e-14)

    @pytest.mark.parametrize("name", ["threlfall", "piecewise-linear", "piecewise-cubic", "bengisu-akay", "andersson"])
    def test_steepest_is_the_slope_at_rest_and_the_largest_outside_the_band(self, name):
        cls = LAWS[name]
        given = {"v0": 0.1, "v1": 0.4, "alpha": 7.0, "v_s": 0.3, "k_t": 20.0}
        law = made(cls, **{key: given[key] for key in declared(cls)})
        at_rest, beyond = steepest(law)
        assert friction_at(law, 0.0, (0.5, 0.3))[1] == pytest.approx(at_rest, rel=1e-14)
        slopes = [friction_at(law, v, (0.5, 0.3))[1] for v in np.linspace(stiction_band(law), 3.0, 20001)]
        assert 0.998 * np.abs(slopes).max() <= beyond <= 1.012 * np.abs(slopes).max()


#: Each way in which a law enters a step, with parameters that are mild enough for a constant step. TestFriction has the
#: formula of each law, and `test_relations` a ring.
MILD = {
    "stiction": {},
    "karnopp": {"dead_band": 0.02},
    "bengisu-akay": {"v0": 0.2, "alpha": 100.0},
    "elasto-plastic": {"sigma0": 100.0, "sigma1": 1.0, "sigma2": 0.1, "v_s": 0.1},
    "reset-integrator": {"sigma0": 100.0, "sigma1": 1.0},
}


@pytest.mark.slow
def test_outcomes_do_not_depend_on_diagnosis(cells):
    batch = cells({"friction.v0": 0.2, "friction.alpha": 100.0, "drive.amplitude": np.linspace(0.1, 8.0, 40)})
    kept, dropped = (RK4(1000, certify=False, diagnose=diagnose).run(batch, NAMES) for diagnose in (True, False))
    # Another kernel may fuse other products and sums.
    np.testing.assert_allclose(dropped.rows, kept.rows, rtol=1e-13)
    assert dropped.stiffness is None
    assert not RK4(1000, diagnose=False).run(batch, NAMES).certified.any()
