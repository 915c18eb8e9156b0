"""Rodas5P: an L-stable Rosenbrock method of order 5 with dense output of order 4.

Each stage solves one linear system, without iteration; this suits a stiff system of a few equations. The order does not
drop on the slow manifold along which a stuck contact creeps. Coefficients: G. Steinebach, BIT Numerical Mathematics 63,
27 (2023).

Only ``creep.py`` calls it. `x` is the state of an implicit step, `bends` an array of three rows for the dense output,
`fraction` a place within the step, from 0 to 1.
"""

from __future__ import annotations

import numpy as np

from ringsweep.compile import unrolled

# The lines of `step` use it.
from ringsweep.models.interface import implicit  # noqa: F401

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


#: Fractions of a step at which :func:`step` needs the forcing. The last three stages are at the end.
STAGE_TIMES = tuple(float(time) for time in TIMES[1:6])


@unrolled
def step(length, x, scene, start, h, forcings, bends):
    """One step of length `h`.

    Parameters
    ----------
    x : tuple of float
        State at the beginning.
    scene : NamedTuple
    start : ringsweep.solvers.creep.Start
        The beginning of the step.
    h : float
        Length of the step, s.
    forcings : tuple of tuple of float
        Forcing at each of :data:`STAGE_TIMES`.
    bends : ndarray of shape ``(3, components)``
        Filled with what :func:`dense` needs.

    Returns
    -------
    tuple
        ``(state, error)``: state after the step, and the estimate of its error.
    """
    parts = range(length)
    lines = [
        "mode, common, (f, jacobian, by_time) = start.mode, start.common, start.linear",
        "per_h, matrix = 1.0 / h, inverse(jacobian, 1.0 / (GAMMA * h))",
    ]
    for i in range(STAGES):
        if 0 < i < 6:
            sums = ["".join(f" + {float(A[i, j])} * k{j}_{c}" for j in range(i) if A[i, j]) for c in parts]
            lines += [f"y{c} = x[{c}]{sums[c]}" for c in parts]
        elif i:
            lines += [f"y{c} += k{i - 1}_{c}" for c in parts]
        if i:
            state = "".join(f"y{c}, " for c in parts)
            lines.append(f"f = implicit.rates(scene, mode, common, forcings[{min(i, 5) - 1}], ({state}))")
        for c in parts:
            coupling = " + ".join(f"{float(C[i, j])} * k{j}_{c}" for j in range(i))
            by_time = f" + h * {float(TIME_DERIVATIVE_WEIGHTS[i])} * by_time[{c}]" if TIME_DERIVATIVE_WEIGHTS[i] else ""
            lines.append(f"r{c} = f[{c}]{by_time}" + (f" + per_h * ({coupling})" if i else ""))
        for c in parts:
            lines.append(f"k{i}_{c} = " + " + ".join(f"matrix[{c}][{j}] * r{j}" for j in parts))
    for row in range(3):
        for c in parts:
            lines.append(
                f"bends[{row}, {c}] = " + " + ".join(f"{float(DENSE[row, j])} * k{j}_{c}" for j in range(STAGES))
            )
    # Stiffly accurate: the last stage is the correction, and the error estimate, of the one before.
    after, error = "".join(f"y{c} + k7_{c}, " for c in parts), "".join(f"k7_{c}, " for c in parts)
    return [*lines, f"return ({after}), ({error})"]


@unrolled
def inverse(length, jacobian, shift):
    """Inverse of ``shift I - J``, row by row, by Gauss-Jordan elimination without pivoting.

    The last components are eliminated first: the derivative of a deflection's rate by the deflection is never positive.
    """
    parts = range(length)
    lines = [f"m{i}{j} = {'shift ' if i == j else ''}-jacobian[{i}][{j}]" for i in parts for j in parts]
    for k in reversed(parts):
        others = [i for i in parts if i != k]
        lines += [f"m{k}{k} = 1.0 / m{k}{k}", *(f"m{k}{j} *= m{k}{k}" for j in others)]
        for i in others:
            lines += [*(f"m{i}{j} -= m{i}{k} * m{k}{j}" for j in others), f"m{i}{k} *= -m{k}{k}"]
    rows = ", ".join("(" + "".join(f"m{i}{j}, " for j in parts) + ")" for i in parts)
    return [*lines, f"return {rows},"]


@unrolled
def acceleration_error(length, error, jacobian):
    """Error of the acceleration, m/s^2, that follows from the `error` of velocity and deflections."""
    return ["return abs(" + " + ".join(f"jacobian[1][{i}] * error[{i}]" for i in range(1, length)) + ")"]


@unrolled
def dense(length, x, x_next, bends, fraction):
    """State at a fraction of a step, from the states at both ends and from what :func:`step` left in `bends`."""
    bend = "bends[0, {c}] + fraction * (bends[1, {c}] + fraction * bends[2, {c}])"
    line = f"rest * x[{{c}}] + fraction * (x_next[{{c}}] + rest * ({bend}))"
    return ["rest = 1.0 - fraction", "return (" + "".join(line.format(c=c) + ", " for c in range(length)) + ")"]


@unrolled
def dense_rates(length, x, x_next, bends, fraction, h):
    """Time derivative of :func:`dense` for a step of length `h`, in s."""
    return [
        "rest, per_h = 1.0 - fraction, 1.0 / h",
        *(f"d{c} = bends[1, {c}] + fraction * bends[2, {c}]" for c in range(length)),
        "return ("
        + "".join(
            f"per_h * (x_next[{c}] - x[{c}] + (1.0 - 2.0 * fraction) * (bends[0, {c}] + fraction * d{c})"
            f" + fraction * rest * (d{c} + fraction * bends[2, {c}])), "
            for c in range(length)
        )
        + ")",
    ]
