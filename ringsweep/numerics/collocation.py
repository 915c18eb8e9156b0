"""Transition matrices of linear equations ``dw/dt = J(t) w`` by collocation at the nodes of Radau.

With n nodes the method is of order 2n - 1. It is L-stable: a mode that decays within a step is gone after it.

`work` is an array of rows: :func:`store` puts the Jacobians there, :func:`transition` replaces them by the result.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from ringsweep.compile import inlined, unrolled


def _radau(nodes: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Nodes of Radau IIA as fractions of a step, and the integrals of the polynomials that are 1 at one of them."""
    fractions = (1.0 + np.sort(legendre.legroots([0.0] * (nodes - 1) + [-1.0, 1.0]))) / 2.0
    fractions[-1] = 1.0
    powers = np.arange(1, nodes + 1)
    integrals = (fractions[:, None] ** powers / powers) @ np.linalg.inv(np.vander(fractions, increasing=True))
    return fractions, np.ascontiguousarray(integrals)


#: Fractions of a step at which J is needed, and weights of the stages: for series, and for implicit steps of order 5.
MANY, WEIGHTS_OF_MANY = _radau(7)
FEW, WEIGHTS_OF_FEW = _radau(4)

# Rows of the scratch array after the system of equations: the matrices J, the transition matrix.
_MATRICES, _FOUND = 3 * len(MANY), 4 * len(MANY)


@inlined
def store(matrix, i, work):
    """Store J at node `i`, a tuple of its entries row by row."""
    row = work[_MATRICES + i]
    for k in range(len(matrix)):
        row[k] = matrix[k]


@inlined
def largest_trace(n, nodes, work):
    """Largest trace of the matrices that are stored for the nodes; 0 if none is positive."""
    largest = 0.0
    for i in range(nodes):
        row, trace = work[_MATRICES + i], 0.0
        for r in range(n):
            trace += row[r * n + r]
        largest = max(largest, trace)
    return largest


@unrolled
def stored(length, like, work):
    """The transition matrix that :func:`transition` left in `work`, a tuple like `like`."""
    return [f"row = work[{_FOUND}]", "return " + "".join(f"row[{k}], " for k in range(length))]


@inlined
def transition(n, h, weights, work):
    """Find the transition matrix over a step from the matrices that :func:`store` has stored.

    Parameters
    ----------
    n : int
        Number of components of w, at most 3.
    h : float
        Length of the step, s.
    weights : ndarray
        ``WEIGHTS_OF_MANY`` or ``WEIGHTS_OF_FEW``.
    work : ndarray of at least 29 rows of 24 numbers

    Returns
    -------
    float
        Logarithm of the determinant of the matrix: the integral of the trace of J (Liouville).
    """
    nodes, log_determinant = len(weights), 0.0
    size, last = n * nodes, weights[nodes - 1]
    # The unknowns are the rates k_i = J_i (w + h sum_j A_ij k_j) at the nodes, for each column of the unit matrix w.
    for i in range(nodes):
        matrix = work[_MATRICES + i]
        for r in range(n):
            row = work[i * n + r]
            for k in range(n):
                entry = matrix[r * n + k]
                row[size + k] = entry
                for j in range(nodes):
                    row[j * n + k] = -h * weights[i, j] * entry
            row[i * n + r] += 1.0
            log_determinant += h * last[i] * matrix[r * n + r]
    _eliminate(size, size + n, work)
    found = work[_FOUND]
    for r in range(n):
        for k in range(n):
            total = 0.0
            for j in range(nodes):
                total += last[j] * work[j * n + r][size + k]
            found[r * n + k] = h * total + (1.0 if r == k else 0.0)
    return log_determinant


@inlined
def _eliminate(size, columns, work):
    """Solve `size` linear equations: the first rows of `work`, whose other columns up to `columns` are right sides.

    Gauss's elimination with row pivoting. The solutions replace the right sides; the matrix is lost.
    """
    for p in range(size):
        best = p
        for i in range(p + 1, size):
            if abs(work[i][p]) > abs(work[best][p]):
                best = i
        if best != p:
            for k in range(p, columns):
                work[p][k], work[best][k] = work[best][k], work[p][k]
        inverse = 1.0 / work[p][p]
        for i in range(p + 1, size):
            factor = work[i][p] * inverse
            if factor != 0.0:
                for k in range(p + 1, columns):
                    work[i][k] -= factor * work[p][k]
    for p in range(size - 1, -1, -1):
        for k in range(size, columns):
            total = work[p][k]
            for i in range(p + 1, size):
                total -= work[p][i] * work[i][k]
            work[p][k] = total / work[p][p]
