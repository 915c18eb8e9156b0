"""Rodas5P: an L-stable Rosenbrock method of order 5 with dense output of order 4.

Each stage solves one linear system, without iteration; this suits a stiff system of a few equations. The order does not
drop on the slow manifold along which a stuck contact creeps. Coefficients: G. Steinebach, BIT Numerical Mathematics 63,
27 (2023).
"""

from __future__ import annotations

import numpy as np

from ringsweep.compile import add_scaled, inlined, unrolled
from ringsweep.models.interface import implicit

STAGES = 8
GAMMA = 0.21193756319429014

A = np.zeros((STAGES, STAGES))
A[1, :1] = 3.0
A[2, :2] = 2.849394379747939, 0.45842242204463923
A[3, :3] = -6.954028509809101, 2.489845061869568, -10.358996098473584
A[4, :4] = 2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641
A[5, :5] = -7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946
A[6] = A[5]
A[6, 5] = 1.0
A[7] = A[6]
A[7, 6] = 1.0

C = np.zeros((STAGES, STAGES))
C[1, :1] = -14.155112264123755
C[2, :2] = -17.97296035885952, -2.859693295451294
C[3, :3] = 147.12150275711716, -1.41221402718213, 71.68940251302358
C[4, :4] = 165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306
C[5, :5] = 24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471
C[6, :6] = (
    30.91273214028599,
    -3.1208243349937974,
    77.79954646070892,
    34.28646028294783,
    -19.097331116725623,
    -28.087943162872662,
)
C[7, :7] = (
    37.80277123390563,
    -3.2571969029072276,
    112.26918849496327,
    66.9347231244047,
    -40.06618937091002,
    -54.66780262877968,
    -9.48861652309627,
)

#: Times of the stages, as fractions of a step.
TIMES = np.array([0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0])
#: Weights of the partial derivative of the rates with respect to time, for each stage.
TIME_DERIVATIVE_WEIGHTS = np.array(
    [
        0.21193756319429014,
        -0.42387512638858027,
        -0.3384627126235924,
        1.8046452872882734,
        2.325825639765069,
        0.0,
        0.0,
        0.0,
    ]
)

#: Weights of the stages in the dense output, from the lowest power of the fraction of the step up.
DENSE = np.array(
    [
        [
            25.948786856663858,
            -2.5579724845846235,
            10.433815404888879,
            -2.3679251022685204,
            0.524948541321073,
            1.1241088310450404,
            0.4272876194431874,
            -0.17202221070155493,
        ],
        [
            -9.91568850695171,
            -0.9689944594115154,
            3.0438037242978453,
            -24.495224566215796,
            20.176138334709044,
            15.98066361424651,
            -6.789040303419874,
            -6.710236069923372,
        ],
        [
            11.419903575922262,
            2.8879645146136994,
            72.92137995996029,
            80.12511834622643,
            -52.072871366152654,
            -59.78993625266729,
            -0.15582684282751913,
            4.883087185713722,
        ],
    ]
)


@inlined
def step(scene, mode, t, x, linear, h, stages):
    """One step of length `h`.

    Parameters
    ----------
    scene, mode : NamedTuple
    t : float
        Time, s.
    x : tuple of float
        State at time `t`.
    linear : tuple
        What :func:`ringsweep.models.interface.implicit.linearise` returned for this state.
    h : float
        Length of the step, s.
    stages : ndarray of shape ``(STAGES, components)``
        Filled with the stages, which :func:`dense` needs.

    Returns
    -------
    tuple
        ``(state, error)``: state after the step, and the estimate of its error.
    """
    rates, jacobian, bristles, by_time = linear
    shift = 1.0 / (GAMMA * h)
    over_h = 1.0 / h
    forcing = implicit.forcing(scene, t + TIMES[1] * h)
    y = x
    for i in range(STAGES):
        if i > 0:
            y, coupling = combine_twice(x, A[i], C[i], stages, i)
            # The last three stages are at the same time.
            if 1 < i < STAGES - 2:
                forcing = implicit.forcing(scene, t + TIMES[i] * h)
            rates = implicit.rates(scene, mode, forcing, y)
            rates = add_scaled(rates, over_h, coupling)
        solve(bristles, jacobian, shift, add_scaled(rates, h * TIME_DERIVATIVE_WEIGHTS[i], by_time), stages[i])
    # Stiffly accurate: the last stage is the correction, and the error estimate, of the one before.
    error = like(x, stages[STAGES - 1])
    return add_scaled(y, 1.0, error), error


@unrolled
def solve(count, bristles, jacobian, shift, right, out):
    """Fill `out` with the solution k of ``(shift I - J) k = right``.

    J is the Jacobian of place, velocity and deflections. See :func:`ringsweep.models.interface.implicit.linearise` for
    `jacobian` and `bristles`. The derivative of a deflection's rate with respect to the deflection is never positive,
    so that the bristles are eliminated without pivoting.
    """
    numbers = range(count)
    return [
        "j00, j01, j10, j11 = jacobian",
        "r0, r1 = right[0], right[1]",
        "w00, w11 = shift - j00, shift - j11",
        *(f"b{i}, c{i}, d{i} = bristles[{i}]; p{i} = 1.0 / (shift - d{i})" for i in numbers),
        *(f"w11 -= b{i} * c{i} * p{i}; r1 += b{i} * p{i} * right[{i + 2}]" for i in numbers),
        "inverse = 1.0 / (w00 * w11 - j01 * j10)",
        "k1 = (j10 * r0 + w00 * r1) * inverse",
        "out[0], out[1] = (w11 * r0 + j01 * r1) * inverse, k1",
        *(f"out[{i + 2}] = (right[{i + 2}] + c{i} * k1) * p{i}" for i in numbers),
    ]


@unrolled
def acceleration_error(count, bristles, jacobian, error, scales):
    """Error of the acceleration that follows from the `error` of velocity and deflections, in units of the last scale.

    Zero without bristles.
    """
    terms = "".join(f" + bristles[{i}][0] * error[{i + 2}]" for i in range(count))
    return [f"return abs(jacobian[3] * error[1]{terms}) / scales[{count + 2}]" if count else "return 0.0"]


@inlined
def dense(x, x_next, stages, fraction):
    """State at a fraction of a step, from the states at both ends and the stages."""
    rest = 1.0 - fraction
    total = zero(x)
    for row in range(2, -1, -1):
        total = add_scaled(combine(zero(x), DENSE[row], stages, STAGES), fraction, total)
    # rest x + fraction (x_next + rest total)
    end = add_scaled(x_next, rest, total)
    return add_scaled(add_scaled(zero(x), rest, x), fraction, end)


@inlined
def dense_rates(x, x_next, stages, fraction, h):
    """Time derivative of :func:`dense` for a step of length `h`, in s."""
    total, rate = zero(x), zero(x)
    for row in range(2, -1, -1):
        rate = add_scaled(total, fraction, rate)
        total = add_scaled(combine(zero(x), DENSE[row], stages, STAGES), fraction, total)
    change = add_scaled(add_scaled(x_next, -1.0, x), 1.0 - 2.0 * fraction, total)
    return add_scaled(zero(x), 1.0 / h, add_scaled(change, fraction * (1.0 - fraction), rate))


# ---- states: tuples of floats -----------------------------------------------------------------


@unrolled
def combine(length, y, weights, rows, count):
    """Sum of ``y`` and of the first `count` rows of an array, each times its weight."""
    numbers = range(length)
    return [
        "".join(f"a{i}, " for i in numbers) + "= y",
        "for j in range(count):",
        "    w = weights[j]",
        *(f"    a{i} += w * rows[j, {i}]" for i in numbers),
        "return (" + "".join(f"a{i}, " for i in numbers) + ")",
    ]


@unrolled
def combine_twice(length, y, weights, others, rows, count):
    """:func:`combine` with ``y`` and `weights`, and with zero and `others`, in one pass."""
    numbers = range(length)
    return [
        "".join(f"a{i}, " for i in numbers) + "= y",
        " = ".join(f"b{i}" for i in numbers) + " = 0.0",
        "for j in range(count):",
        "    v, w = weights[j], others[j]",
        *(f"    a{i} += v * rows[j, {i}]; b{i} += w * rows[j, {i}]" for i in numbers),
        "return (" + "".join(f"a{i}, " for i in numbers) + "), (" + "".join(f"b{i}, " for i in numbers) + ")",
    ]


@unrolled
def zero(length, y):
    """A state of zeros."""
    return ["return (" + "0.0, " * length + ")"]


@unrolled
def like(length, y, row):
    """A row of an array as a tuple as long as `y`."""
    return ["return (" + "".join(f"row[{i}], " for i in range(length)) + ")"]
