"""Transition matrices of linear equations ``dw/dt = J(t) w`` by collocation at the nodes of Radau.

The method is of order 13 and L-stable: a mode that decays within a step is gone after it.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from ringsweep.compile import inlined, unrolled

#: Instants of a step at which the matrix J is needed.
NODES = 7


def _radau(nodes: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Nodes of Radau IIA as fractions of a step, and the integrals of the polynomials that are 1 at one of them."""
    fractions = (1.0 + np.sort(legendre.legroots([0.0] * (nodes - 1) + [-1.0, 1.0]))) / 2.0
    fractions[-1] = 1.0
    powers = np.arange(1, nodes + 1)
    integrals = (fractions[:, None] ** powers / powers) @ np.linalg.inv(np.vander(fractions, increasing=True))
    return fractions, np.ascontiguousarray(integrals)


#: The instants, as fractions of a step, and the weights of the stages.
FRACTIONS, _INTEGRALS = _radau(NODES)

# Rows of the scratch array: a system of equations, the matrices J, the transition matrix.
_SYSTEM, _MATRICES, _FOUND = 0, 3 * NODES, 4 * NODES


@inlined
def store(matrix, i, work):
    """Store J at node `i`, a tuple of its entries row by row."""
    row = work[_MATRICES + i]
    for k in range(len(matrix)):
        row[k] = matrix[k]


@unrolled
def stored(length, like, work):
    """The transition matrix that :func:`transition` left in `work`, a tuple like `like`."""
    return [f"row = work[{_FOUND}]", "return " + "".join(f"row[{k}], " for k in range(length))]


@inlined
def transition(n, h, work):
    """Find the transition matrix over a step from the matrices that :func:`store` has stored.

    Parameters
    ----------
    n : int
        Number of components of w, at most 3.
    h : float
        Length of the step, s.
    work : ndarray of at least 29 rows of 24 numbers

    Returns
    -------
    float
        Logarithm of the determinant of the matrix: the integral of the trace of J (Liouville).
    """
    size, log_determinant = n * NODES, 0.0
    # The unknowns are the rates k_i = J_i (w + h sum_j A_ij k_j) at the nodes, for each column of the unit matrix w.
    for i in range(NODES):
        matrix = work[_MATRICES + i]
        for r in range(n):
            row = work[_SYSTEM + i * n + r]
            for k in range(n):
                entry = matrix[r * n + k]
                row[size + k] = entry
                for j in range(NODES):
                    row[j * n + k] = -h * _INTEGRALS[i, j] * entry
            row[i * n + r] += 1.0
            log_determinant += h * _INTEGRALS[NODES - 1, i] * matrix[r * n + r]
    _eliminate(size, size + n, work)
    found = work[_FOUND]
    for r in range(n):
        for k in range(n):
            total = 0.0
            for j in range(NODES):
                total += _INTEGRALS[NODES - 1, j] * work[j * n + r][size + k]
            found[r * n + k] = h * total + (1.0 if r == k else 0.0)
    return log_determinant


@inlined
def _eliminate(size, columns, work):
    """Solve a system of equations in the first rows; the solutions replace its right sides."""
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
