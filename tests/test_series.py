"""Power series within a step: first root, sign changes, sums and bounds."""

from math import exp, inf

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from ringsweep.compile import kernel
from ringsweep.numerics.series import ORDER, STACK, ascending, crossings, first_root, slope, step_size, value, variation
from ringsweep.numerics.terms import COLUMNS

K = np.arange(ORDER + 1)


def series(coefficients):
    c = np.zeros(COLUMNS)
    c[: len(coefficients)] = coefficients
    return c


def from_roots(roots, scale=1.0):
    """Series with these roots only, positive before the first positive root."""
    c = np.atleast_1d(np.poly(roots))[::-1]
    return series(scale * c / (c[0] if c[0] != 0.0 else 1.0))


def first(c, h):
    """First root of a series within a step, and whether there is one."""
    return first_root(c, h, np.empty((STACK, COLUMNS)))


def sign_changes(c, h, count=0):
    """Sorted instants of the sign changes of a series within a step."""
    work = np.empty((STACK, COLUMNS))
    count = crossings(c, h, work, count)
    ascending(work[0], count)
    return work[0, :count]


def noise(c, s):
    """Bound on the rounding error of the series at `s`."""
    return 64 * np.finfo(float).eps * (np.abs(c[: ORDER + 1]) * s**K).sum()


@kernel
def sums_in_kernel(c, s):
    """Value, slope and variation of a series, from vector lanes."""
    return value(c, s), slope(c, s), variation(c, s)


coefficients = st.lists(st.floats(-10, 10), min_size=1, max_size=ORDER)
steps = st.sampled_from([1e-9, 0.1, 1.0, 3.0])


class TestFirstRoot:
    @pytest.mark.slow
    @settings(max_examples=400)
    @given(st.floats(1e-6, 1), coefficients, steps)
    @example(1.0, [-1.0], 1.0)
    @example(1.0, [-2.0, 1.0], 2.0)
    @example(0.5, [0.0] * 15 + [-1.0], 1.0)
    def test_first_root_is_a_zero_without_another_before_it(self, constant, rest, h):
        # Coefficients in units of the step, so that every term matters.
        c = series(np.array([constant, *rest]) / h ** np.arange(len(rest) + 1))
        s, found = first(c, h)
        assert 0 < s <= h
        assert found or s == h
        before = s * np.linspace(0, 1, 2001)[:-1]
        values = np.array([value(c, x) for x in before])
        assert (values > -noise(c, s)).all()
        if found:
            assert abs(value(c, s)) <= noise(c, s) + abs(slope(c, s)) * 1e-15 * h
        else:
            assert value(c, h) > -noise(c, h)

    @settings(max_examples=300)
    @given(st.floats(1e-6, 1), coefficients)
    def test_first_root_is_the_least_root_of_numpy(self, constant, rest):
        # The companion matrix of np.roots cannot have a tiny leading coefficient.
        c = series([constant, *np.round(rest, 3)])
        everywhere = np.roots(np.trim_zeros(c[: ORDER + 1], "b")[::-1])
        # At a nearly double root the two methods may differ in whether there is a root.
        assume((np.abs(everywhere.imag) < 1e-12).sum() == (np.abs(everywhere.imag) < 1e-4 * np.abs(everywhere)).sum())
        real = everywhere[np.abs(everywhere.imag) < 1e-12].real
        inside = np.sort(real[(real > 0) & (real < 1.001)])
        assume(not ((inside > 0.999).any() or (np.diff(inside) < 1e-3).any()))
        s, found = first(c, 1.0)
        assert found == bool(len(inside))
        if found:
            assert s == pytest.approx(inside[0], rel=1e-7)

    @pytest.mark.parametrize("where", [1e-6, 0.1, 1 / 3, 0.5, 0.7, 0.999])
    @pytest.mark.parametrize("depth", [1e-3, 1e-8, 1e-13])
    def test_two_close_roots_are_found_and_a_minimum_above_zero_is_not(self, where, depth):
        """The minimum lies the relative distance `depth` below or above zero."""
        for sign in (-1, 1):
            c = series(np.array([where**2 + sign * depth * where**2, -2 * where, 1.0]) / where**2)
            s, found = first(c, 1.0)
            assert found == (sign < 0)
            if found:
                assert s == pytest.approx(where * (1 - depth**0.5), rel=1e-2 * depth**0.5)

    def test_series_that_rises_from_nearly_zero_has_no_root_there(self):
        s, found = first(series([1e-18, 1e-18, 1.0, -1.5]), 1.0)
        assert found
        assert s == pytest.approx(2 / 3, rel=1e-12)

    @pytest.mark.parametrize("where", [0.125, 0.25, 0.5, 0.75])
    def test_double_root_is_found(self, where):
        """The root is an exact binary fraction: the series touches zero without a sign change."""
        s, found = first(from_roots([where, where]), 1.0)
        assert found
        assert s == pytest.approx(where, abs=1e-7)


class TestCrossings:
    @settings(max_examples=200)
    @given(
        st.lists(st.floats(0.02, 2), max_size=5), st.lists(st.floats(-3, -0.05), max_size=4), st.sampled_from([-1, 1])
    )
    @example([0.25, 0.5, 0.75], [], -1)
    def test_crossings_are_all_roots_in_the_step(self, ahead, behind, sign):
        ahead = np.sort(ahead)
        assume(min(np.diff(ahead), default=1) > 0.05)
        assume((abs(ahead - 1) > 1e-3).all())
        found = sign_changes(sign * from_roots([*ahead, *behind]), 1.0)
        np.testing.assert_allclose(found, ahead[ahead < 1], atol=1e-6)

    def test_root_at_the_beginning_or_after_the_end_is_not_a_crossing(self):
        assert sign_changes(series([0.0, 1.0, -2.0]), 1.0) == pytest.approx([0.5], rel=1e-15)
        assert len(sign_changes(series([1.0, -1.0]), 1.0 - 1e-15)) == 0


class TestSums:
    @given(coefficients, st.floats(0, 2))
    def test_value_and_slope_agree_with_numpy(self, a, s):
        one = series(a)
        assert value(one, s) == pytest.approx(np.polyval(one[ORDER::-1], s), rel=1e-13, abs=1e-12)
        derivative = np.polynomial.Polynomial(one[: ORDER + 1]).deriv()
        assert slope(one, s) == pytest.approx(derivative(s), rel=1e-12, abs=1e-9 * 2.0**ORDER)
        assert sums_in_kernel(one, s) == pytest.approx((value(one, s), slope(one, s), variation(one, s)), rel=1e-13)

    @given(coefficients, st.floats(0.01, 2), st.floats(0, 1))
    def test_change_of_a_series_is_at_most_its_variation(self, a, h, fraction):
        c = series(a)
        bound = variation(c, h)
        assert abs(value(c, fraction * h) - c[0]) <= bound * (1 + 1e-12)

    def test_step_size_is_where_a_geometric_series_meets_its_tolerance(self):
        """The terms ``(s / r)^k`` equal the tolerance t at ``s = r t^(1/k)``; the smaller of the last two counts."""
        r, t = 3.0, 1e-10
        h = step_size(r**-ORDER / t, r ** -(ORDER - 1) / t)
        assert h == pytest.approx(r * t ** (1 / (ORDER - 1)), rel=1e-12)
        assert (h / r) ** ORDER < t
        assert step_size(0.0, 0.0) == inf
        assert step_size(exp(-ORDER), 0.0) == pytest.approx(exp(1.0))
