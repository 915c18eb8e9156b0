"""One step of Radau IIA (order 5), with its collocation polynomial and an error estimate."""

import math

import numpy as np

from benchmarks.reference.compiled import copy, inner
from benchmarks.reference.physics import factor, rates, substitute

_S = math.sqrt(6.0)
NODES = np.array([(4.0 - _S) / 10.0, (4.0 + _S) / 10.0, 1.0])
WEIGHTS = np.array(
    [
        [(88.0 - 7.0 * _S) / 360.0, (296.0 - 169.0 * _S) / 1800.0, (-2.0 + 3.0 * _S) / 225.0],
        [(296.0 + 169.0 * _S) / 1800.0, (88.0 + 7.0 * _S) / 360.0, (-2.0 - 3.0 * _S) / 225.0],
        [(16.0 - _S) / 36.0, (16.0 + _S) / 36.0, 1.0 / 9.0],
    ]
)
# Real eigenvalue of WEIGHTS, and the weights of the stages in the error estimate.
GAMMA = 1.0 / (3.0 + 3.0 ** (2.0 / 3.0) - 3.0 ** (1.0 / 3.0))
ESTIMATE = np.array([-13.0 - 7.0 * _S, -13.0 + 7.0 * _S, -1.0]) / 3.0


@inner
def interpolate(y, Z, x, n, out):
    """Write the collocation polynomial at a share x of the step to out."""
    c1, c2, c3 = NODES
    l1 = x * (x - c2) * (x - c3) / (c1 * (c1 - c2) * (c1 - c3))
    l2 = x * (x - c1) * (x - c3) / (c2 * (c2 - c1) * (c2 - c3))
    l3 = x * (x - c1) * (x - c2) / (c3 * (c3 - c1) * (c3 - c2))
    for i in range(n):
        out[i] = y[i] + l1 * Z[0, i] + l2 * Z[1, i] + l3 * Z[2, i]


@inner
def jacobian(p, closed, k1, k2, piece, t, y, f, scale, n, J, work):
    """Write the Jacobian of the rates, by differences, to J."""
    y_, f_ = work[0], work[1]
    for j in range(n):
        copy(y, y_)
        delta = 1e-7 * scale[j]
        y_[j] += delta
        delta = y_[j] - y[j]
        rates(p, closed, k1, k2, piece, t, y_, f_)
        for i in range(n):
            J[i, j] = (f_[i] - f[i]) / delta


@inner
def norm(b, rtol, scale, n):
    """Norm of an error in units of the tolerance; NaN if one of its components is NaN."""
    total = 0.0
    for i in range(n):
        total += (b[i] / (rtol * scale[i])) ** 2
    return math.sqrt(total)


@inner
def attempt(p, closed, k1, k2, piece, t, h, y, f, J, scale, rtol, n, Z, A, order, b, work):
    """Compute the stages Z of a step of length h from y, whose rates are f. Z holds a first guess.

    Returns the error in units of the tolerance; infinite if Newton's iteration does not converge.
    """
    m = 3 * n
    for r in range(3):
        for c in range(3):
            for i in range(n):
                for j in range(n):
                    A[r * n + i, c * n + j] = -h * WEIGHTS[r, c] * J[i, j]
    for i in range(m):
        A[i, i] += 1.0
    factor(A, order, m)
    F, y_ = work[:3], work[3]
    copy(y, y_)
    last, done = math.inf, False
    for iteration in range(15):
        for r in range(3):
            for i in range(n):
                y_[i] = y[i] + Z[r, i]
            rates(p, closed, k1, k2, piece, t + NODES[r] * h, y_, F[r])
        for r in range(3):
            for i in range(n):
                b[r * n + i] = -Z[r, i] + h * (
                    WEIGHTS[r, 0] * F[0, i] + WEIGHTS[r, 1] * F[1, i] + WEIGHTS[r, 2] * F[2, i]
                )
        substitute(A, order, b, m)
        size = 0.0
        for r in range(3):
            for i in range(n):
                Z[r, i] += b[r * n + i]
                size += (b[r * n + i] / (rtol * scale[i])) ** 2
        size = math.sqrt(size)
        if not size < 1e30:
            return math.inf
        # Converged to a thousandth of the tolerance, or as far as rounding allows.
        if size < 1e-3 or (iteration > 3 and size > 0.5 * last and size < 0.1):
            done = True
            break
        if iteration > 4 and size > 2.0 * last:
            return math.inf
        last = size
    if not done:
        return math.inf
    for i in range(n):
        for j in range(n):
            A[i, j] = -h * GAMMA * J[i, j]
        A[i, i] += 1.0
    factor(A, order, n)
    for i in range(n):
        b[i] = GAMMA * (h * f[i] + ESTIMATE[0] * Z[0, i] + ESTIMATE[1] * Z[1, i] + ESTIMATE[2] * Z[2, i])
    substitute(A, order, b, n)
    error = norm(b, rtol, scale, n)
    # In a stiff problem the first estimate is too large: estimate again from the corrected state.
    if not error <= 1.0:
        for i in range(n):
            y_[i] = y[i] + b[i]
        rates(p, closed, k1, k2, piece, t, y_, F[0])
        for i in range(n):
            b[i] = GAMMA * (h * F[0, i] + ESTIMATE[0] * Z[0, i] + ESTIMATE[1] * Z[1, i] + ESTIMATE[2] * Z[2, i])
        substitute(A, order, b, n)
        error = norm(b, rtol, scale, n)
    return error if error < 1e30 else math.inf
