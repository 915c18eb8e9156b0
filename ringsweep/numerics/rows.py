"""Rows of tables that are equal."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def distinct_rows(columns: Iterable[NDArray[Any]]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Distinct rows of a table that is given by its columns.

    Parameters
    ----------
    columns : iterable of ndarray of shape ``(rows,)``
        At least one column. ``np.unique`` would compare whole rows, with a call for each comparison.

    Returns
    -------
    tuple of ndarray
        Index of the first of each set of equal rows; and for each row the place of its set among these.
    """
    columns = list(columns)
    order = np.arange(len(columns[0]))
    begins = order == 0
    if varying := [column for column in columns if (column != column[:1]).any()]:
        order = np.lexsort(varying)
        for column in varying:
            begins[1:] |= column[order[1:]] != column[order[:-1]]
    place = np.empty_like(order)
    place[order] = np.cumsum(begins) - 1
    return order[begins], place


def places_of(row: NDArray[np.intp]) -> NDArray[np.intp]:
    """Place of each row number among those that are equal to it; they ascend."""
    return np.arange(len(row)) - np.searchsorted(row, row)
