"""Drives: angle, angular velocity and angular acceleration are consistent."""

from itertools import pairwise
from math import atan, inf, log

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refused
from scipy.integrate import quad

from ringsweep.compile import take
from ringsweep.config import load
from ringsweep.errors import InputError
from ringsweep.models import parameters
from ringsweep.models.parts import drive_of
from ringsweep.models.scene import Structure
from ringsweep.physics.drives import (
    COURSE_SHAPE,
    DRIVES,
    Arctan,
    Constant,
    Power,
    Sinusoidal,
    Still,
    follow,
    jerk,
    new_course,
    shape,
    turn,
    turn_near,
)

KNOTS = np.array([0.0, 0.4, 0.5, 1.1, 2.0, 3.0])


def table(times, angles, interpolate="spline"):
    return Structure("ring", "coulomb", "table", table=(times, angles, interpolate))


def tabulated(angles, times=KNOTS, amplitude=1.0, interpolate="spline"):
    values = {"drive.amplitude": np.array([amplitude]), "time.span": np.array([times[-1]])}
    return take(drive_of(table(times, np.asarray(angles, dtype=float), interpolate), values), 0)


SAMPLES = [
    Still(),
    Constant(3.0),
    Arctan(2.0),
    Power(20.0, 1.1),
    Power(1.0, 2.0),
    Power(1.0, 3.7),
    Sinusoidal(0.3, 0.7, 0.2),
    tabulated(np.sin(2 * KNOTS)),
]


def test_every_drive_is_tested():
    assert {type(drive) for drive in SAMPLES} == set(DRIVES.values())


@pytest.mark.parametrize("law", DRIVES)
def test_words_for_a_drive_of_a_belt_tell_of_a_line(law):
    for path, p in parameters(Structure("belt", "coulomb", law)).items():
        if path.startswith("drive."):
            words = f"{p.unit} {p.long_name} {p.unit_in_words}"
            assert ("rad" in words) == (path == "drive.phase")
            assert "ring" not in words
            assert "angular" not in words


@pytest.mark.parametrize("drive", SAMPLES, ids=lambda drive: type(drive).__name__)
class TestDerivatives:
    """Derivatives of the shape against finite differences."""

    TIMES = np.linspace(0.05, 2.95, 30)
    STEP = 1e-5

    @pytest.mark.parametrize("order", [1, 2])
    def test_rate_and_acceleration_of_a_shape_are_its_derivatives(self, drive, order):
        for t in self.TIMES:
            before, after = shape(drive, t - self.STEP), shape(drive, t + self.STEP)
            difference = (after[order - 1] - before[order - 1]) / (2 * self.STEP)
            assert shape(drive, t)[order] == pytest.approx(difference, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("drive", [*SAMPLES, Sinusoidal(0.3, 40.0, 0.0)], ids=lambda drive: type(drive).__name__)
class TestCourse:
    """Within a step the series about a recent time replaces the drive."""

    def course(self, drive, t, h):
        course = np.empty(COURSE_SHAPE)
        new_course(course)
        follow(drive, course, t, h)
        return course

    @pytest.mark.parametrize("t", [1e-14, 1e-9, 1e-3, 0.05, 0.39, 1.1, 2.9])
    def test_series_differs_from_the_drive_by_rounding(self, drive, t):
        course = self.course(drive, t, 1e-3)
        times = t + np.linspace(0.0, 1.0, 23) * min(course[0, 1], 0.1)
        exact = np.array([[*turn(drive, time), jerk(drive, time)] for time in times])
        found = np.array([turn_near(drive, course, time, 0.0) for time in times])
        # The drive itself is as uncertain as its time.
        largest = abs(exact).max(axis=0)
        allowed = 4e-15 * largest[:3] + 4e-16 * t * largest[1:]
        assert (abs(found - exact[:, :3]) <= allowed).all()


class TestArctan:
    """The paper's run-up."""

    def test_shape_of_arctan_is_the_papers_h(self):
        for t in (0.0, 0.3, 1.0, 10.0):
            assert shape(Arctan(1.0), t)[0] == pytest.approx(t * atan(t) - 0.5 * log(1 + t * t), abs=1e-15)
            assert shape(Arctan(1.0), t)[0] == pytest.approx(quad(atan, 0.0, t)[0], abs=1e-12)


class TestPowerAtTheStart:
    @pytest.mark.parametrize(
        ("exponent", "at_rest"),
        [(1.0, (0.0, 1.0, 0.0)), (1.1, (0.0, 0.0, inf)), (2.0, (0.0, 0.0, 2.0)), (2.5, (0.0, 0.0, 0.0))],
    )
    def test_power_law_has_its_limits_at_zero(self, exponent, at_rest):
        assert shape(Power(1.0, exponent), 0.0) == at_rest


class TestTable:
    @given(st.lists(st.floats(-5, 5), min_size=4, max_size=4), st.floats(0.0, 3.0))
    def test_table_reproduces_a_cubic(self, coefficients, t):
        cubic = np.polynomial.Polynomial(coefficients)
        expected = [cubic(t), cubic.deriv(1)(t), cubic.deriv(2)(t)]
        np.testing.assert_allclose(shape(tabulated(cubic(KNOTS)), t), expected, rtol=1e-10, atol=1e-9)

    @given(st.lists(st.floats(-3, 3), min_size=len(KNOTS), max_size=len(KNOTS)))
    def test_table_is_smooth_to_second_order_at_every_knot(self, angles):
        drive = tabulated(angles)
        for knot, angle in zip(KNOTS, angles, strict=True):
            here = shape(drive, knot)
            assert here[0] == pytest.approx(angle, abs=1e-9)
            for side in (-1e-10, 1e-10):
                np.testing.assert_allclose(shape(drive, knot + side), here, rtol=1e-6, atol=1e-6)

    @pytest.mark.parametrize("interpolate", ["monotone", "linear"])
    @given(st.lists(st.floats(-3, 3), min_size=len(KNOTS), max_size=len(KNOTS)))
    def test_table_stays_between_neighbours_unless_it_is_a_spline(self, interpolate, samples):
        course = tabulated(samples, interpolate=interpolate)
        for k, (before, after) in enumerate(pairwise(samples)):
            found = [shape(course, t)[0] for t in np.linspace(KNOTS[k], KNOTS[k + 1], 20)]
            assert min(before, after) - 1e-12 <= min(found) <= max(found) <= max(before, after) + 1e-12

    def test_spline_that_overshoots_a_step_is_warned_of(self, scene, caplog):
        step = {"law": "table", "time": [0.0, 0.5, 0.51, 1.0, 1.01, 5.0], "theta": [0.0, 0.0, 3.0, 3.0, 0.0, 0.0]}
        load({"scene": scene | {"drive": step | {"interpolate": "monotone"}}})
        assert not caplog.messages
        load({"scene": scene | {"drive": step}})
        assert "the spline leaves the range of its table by 1.85e+03" in caplog.text

    @pytest.mark.parametrize("interpolate", ["linear", "step"])
    def test_table_of_a_drive_that_would_jump_is_refused_with_a_remedy(self, scene, interpolate):
        drive = {"law": "table", "time": [0.0, 1.0, 5.0], "theta": [0.0, 1.0, 0.0], "interpolate": interpolate}
        problem = (
            f"scene.drive.interpolate: '{interpolate}' is no interpolation of a drive: its place must not jump; .*velo"
        )
        refused(problem, load, {"scene": scene | {"drive": drive}})

    def test_span_longer_than_the_table_is_an_input_error(self):
        values = {"drive.amplitude": np.ones(2), "time.span": np.array([3.0, 3.5])}
        with pytest.raises(InputError, match=r"time\.span.*3\.5 s is longer than the table.*3 s"):
            drive_of(table(KNOTS, np.zeros(len(KNOTS))), values)
