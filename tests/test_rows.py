"""Rows of tables that are equal."""

from __future__ import annotations

import numpy as np
import pytest

from ringsweep.numerics.rows import distinct_rows


@pytest.mark.parametrize("varying", [0, 1, 3])
def test_rows_of_one_set_equal_its_first_and_no_other(varying):
    rng = np.random.default_rng(5)
    table = [np.full(200, np.inf), *(rng.integers(3, size=200) / 3.0 for _ in range(varying)), np.zeros(200)]
    first, place = distinct_rows(table)
    rows = np.stack(table, axis=1)
    assert (rows[first[place]] == rows).all()
    assert len(first) == len(np.unique(rows, axis=0))
    assert (first == [np.flatnonzero(place == k)[0] for k in range(len(first))]).all()
