"""Runs side by side in vector lanes: functions against the C library, and runs against single runs."""

from math import radians

import numba
import numpy as np
import pytest

from ringsweep.compile import KERNEL_OPTIONS, take
from ringsweep.models import MODELS
from ringsweep.numerics.functions import any_of, decay, floor, opposing, select, sine_cosine, sine_cosine_near
from ringsweep.numerics.lanes import WIDTH
from ringsweep.numerics.memory import Several, Single, conform, read_lanes, side_by_side, write
from ringsweep.physics.drives import without_shape
from ringsweep.physics.friction import LAWS
from ringsweep.physics.friction.velocity import BAND, piece, steepest, stiction_band, weights
from ringsweep.quantities.parameters import declared
from ringsweep.solvers import rk4
from ringsweep.solvers.rk4 import RK4

NAMES = MODELS["ring"].outcomes


@numba.njit(**KERNEL_OPTIONS)
def _functions(x, near, out):
    (a,), (b,) = read_lanes(x, 0, (0.0,)), read_lanes(near, 0, (0.0,))
    sine, cosine = sine_cosine(a)
    far = select(a > b, a, -b)
    write(out, 0, WIDTH, (sine, cosine, decay(abs(a)), floor(a), opposing(abs(a), b), far, min(a, b), max(a, b)))
    write(out, 8 * WIDTH, WIDTH, sine_cosine_near(b, a, sine, cosine))
    return any_of(a > 1e5)


@numba.njit(**KERNEL_OPTIONS)
def _weights(law, memory, at, speed, out):
    (x,) = read_lanes(speed, 0, (0.0,))
    write(out, 0, WIDTH, conform(weights(read_lanes(memory, at, law), x), read_lanes(out, 0, (0.0, 0.0, 0.0, 0.0))))


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
            np.testing.assert_allclose(out[:2], exact[:2], rtol=0, atol=4e-16)
            if scale < 700:
                np.testing.assert_allclose(out[2], exact[2], rtol=0, atol=6e-16)
            np.testing.assert_array_equal(out[3], np.floor(x))
            np.testing.assert_array_equal(out[4], np.copysign(x, -near))
            np.testing.assert_array_equal(out[5], np.where(x > near, x, -near))
            np.testing.assert_array_equal(out[6:8], [np.minimum(x, near), np.maximum(x, near)])
            np.testing.assert_allclose(out[8:], [np.sin(near), np.cos(near)], rtol=0, atol=6e-16)

    def test_min_and_max_of_lanes_ignore_nan_in_the_second_argument(self):
        x = np.linspace(-1.0, 1.0, WIDTH)
        near = x.copy()
        near[3] = np.nan
        out = np.empty((10, WIDTH))
        _functions(x, near, out.reshape(-1))
        np.testing.assert_array_equal(out[6:8], [x, x])


def test_generated_function_called_in_python_raises_type_error():
    with pytest.raises(TypeError, match="write can only be called in a kernel"):
        write(np.empty(1), 0, 1, (0.0,))


class TestWeights:
    """Each law has a formula without branches, `blend`, beside its pieces."""

    @pytest.mark.parametrize(
        "name", ["coulomb", "stiction", "tustin", "threlfall", "piecewise-linear", "piecewise-cubic", "bengisu-akay"]
    )
    def test_blend_of_a_law_agrees_with_its_pieces(self, name):
        rng = np.random.default_rng(2)
        cls = LAWS[name]
        out = np.empty((4, WIDTH))
        for _ in range(300):
            v0, alpha = 10.0 ** rng.uniform(-4, 0), 10.0 ** rng.uniform(0, 4)
            given = {"v0": v0, "v1": v0 * rng.uniform(1.1, 10.0), "alpha": alpha}
            law = cls(*map(float, getattr(cls, "of", cls)(**{name: given[name] for name in declared(cls)})))
            speed = 10.0 ** rng.uniform(-5, 1, WIDTH)
            memory = np.repeat(np.array([float(x) for x in law]), WIDTH) if law else np.zeros(WIDTH)
            _weights(law, memory, 0, speed, out.reshape(-1))
            exact = np.transpose([weights(law, float(x)) for x in speed])
            scale = 1.0 + np.abs(exact).max(axis=1, keepdims=True)
            np.testing.assert_allclose(out / scale, exact / scale, rtol=0, atol=1e-14)

    @pytest.mark.parametrize("name", ["threlfall", "piecewise-linear", "piecewise-cubic", "bengisu-akay"])
    def test_steepest_of_a_law_is_its_slope_at_rest_and_its_largest_outside_the_band(self, name):
        cls = LAWS[name]
        given = {"v0": 0.1, "v1": 0.4, "alpha": 7.0}
        law = cls(*map(float, getattr(cls, "of", cls)(**{key: given[key] for key in declared(cls)})))
        assert stiction_band(law) == piece(law, BAND).high
        at_rest, at_edge = steepest(law)
        assert weights(law, 0.0)[2:] == pytest.approx(at_rest, rel=1e-14)
        slopes = np.array([weights(law, v)[2:] for v in np.linspace(stiction_band(law), 3.0, 20001)])
        np.testing.assert_allclose(np.abs(slopes).max(axis=0), np.abs(at_edge), rtol=1e-6)


def family(cells, model="ring", count=40):
    """Cells with random amplitudes, half-angles and launches, which slip, stick, reverse and separate."""
    rng = np.random.default_rng(7)
    values = {
        "drive.amplitude": rng.uniform(0.1, 8.0, count),
        "zone.half_angle": rng.uniform(radians(2.0), radians(60.0), count),
        "initial.omega": rng.uniform(-20.0, 20.0, count),
        "time.span": 3.0,
    }
    return cells(values | {"friction.v0": 0.2, "friction.alpha": 100.0}, drive="arctan", model=model)


def integrate(kind, batch, steps, order=None):
    """Outcomes of the cells of a batch, computed in a given order, one by one or side by side."""
    order = np.arange(len(batch.span)) if order is None else order
    rows, report = np.empty((len(batch.span), len(NAMES))), np.empty((len(batch.span), 5))
    scenes = side_by_side(batch._replace(drive=without_shape(batch.drive))) if isinstance(kind, Several) else batch
    rk4.integrate(kind, rk4.Diagnosed(), scenes, take(batch.drive, 0), order, steps, rows, report)
    columns = zip(("steps", "stiffness", "slack", "fall", "stride"), report.T, strict=True)
    return dict(zip(NAMES, rows.T, strict=True)) | dict(columns)


class TestEachLane:
    @pytest.mark.parametrize("model", ["ring", "ring-single-contact"])
    def test_run_side_by_side_agrees_with_the_single_run_to_rounding(self, cells, model):
        """A smooth law and short steps, so that rounding does not grow."""
        batch = family(cells, model=model)
        alone, together = (integrate(kind, batch, 6000) for kind in (Single(), Several()))
        assert alone["reversals"].max() > 1
        for name in alone:
            scale = np.nanmax(np.abs(alone[name]), initial=1.0)
            np.testing.assert_allclose(together[name], alone[name], rtol=0, atol=1e-11 * scale, err_msg=name)
        regimes = "regime", "motion", "separating_contact", "reversals", "turns", "steps"
        for name in regimes:
            np.testing.assert_array_equal(together[name], alone[name])

    def test_run_does_not_depend_on_the_runs_beside_it(self, cells):
        """Bit for bit, for other runs beside it and another order."""
        batch = family(cells)
        whole = integrate(Several(), batch, 2000)
        shuffled = integrate(Several(), batch, 2000, np.random.default_rng(1).permutation(len(batch.span)))
        for name in whole:
            np.testing.assert_array_equal(shuffled[name], whole[name], err_msg=name)
        for i in (0, 17, 39):
            one = integrate(Several(), take(batch, [i]), 2000)
            for name in whole:
                np.testing.assert_array_equal(one[name][0], whole[name][i], err_msg=name)


def test_outcomes_do_not_depend_on_diagnosis(cells):
    batch = family(cells)
    kept, dropped = (RK4(1000, certify=False, diagnose=diagnose).run(batch, NAMES) for diagnose in (True, False))
    np.testing.assert_array_equal(dropped.rows, kept.rows)
    assert dropped.stiffness is None
    assert not RK4(1000, diagnose=False).run(batch, NAMES).certified.any()
