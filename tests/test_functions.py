"""Sine and cosine of an angle from those of a close angle."""

import numpy as np
import pytest

from ringsweep.numerics.functions import ROTATED, rotated, sine_cosine_from


@pytest.mark.parametrize("start", [0.0, 0.7, -2.1, 31.4, 1e4])
class TestCloseAngles:
    @pytest.mark.parametrize("distance", [0.0, 1e-9, -1e-4, 0.03, -0.0999, 0.1001, 2.0])
    def test_sine_and_cosine_from_a_close_angle_are_right_to_rounding(self, start, distance):
        x = start + distance
        found = sine_cosine_from(x, start, np.sin(start), np.cos(start))
        np.testing.assert_allclose(found, (np.sin(x), np.cos(x)), rtol=0, atol=3e-16)

    @pytest.mark.parametrize("distance", [0.0, 1e-12, -1e-6, 1e-3, -ROTATED, ROTATED])
    def test_rotated_sine_and_cosine_are_right_to_rounding(self, start, distance):
        x = start + distance
        found = rotated(np.sin(start), np.cos(start), x - start)
        np.testing.assert_allclose(found, (np.sin(x), np.cos(x)), rtol=0, atol=3e-16)
