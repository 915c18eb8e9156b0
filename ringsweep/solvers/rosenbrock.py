"""Rodas5P: an L-stable Rosenbrock method of order 5 with dense output of order 4.

Each stage solves one linear system, without iteration; this suits a stiff system of a few equations. The order does not
drop on the slow manifold along which a stuck contact creeps. Coefficients: G. Steinebach, BIT Numerical Mathematics 63,
27 (2023).
"""

from __future__ import annotations

import numpy as np

from ringsweep.compile import function_from_lines, hook, unrolled
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
        "mode, common, (f, jacobian, bristles, by_time) = start.mode, start.common, start.linear",
        "per_h, factors = 1.0 / h, factorise(bristles, jacobian, 1.0 / (GAMMA * h))",
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
        names, right = "".join(f"k{i}_{c}, " for c in parts), "".join(f"r{c}, " for c in parts)
        lines.append(f"{names} = solve(bristles, factors, ({right}))")
    for row in range(3):
        for c in parts:
            lines.append(
                f"bends[{row}, {c}] = " + " + ".join(f"{float(DENSE[row, j])} * k{j}_{c}" for j in range(STAGES))
            )
    # Stiffly accurate: the last stage is the correction, and the error estimate, of the one before.
    after, error = "".join(f"y{c} + k7_{c}, " for c in parts), "".join(f"k7_{c}, " for c in parts)
    return [*lines, f"return ({after}), ({error})"]


@hook(optional=True)
def factorise(bristles, jacobian, shift):
    """Factors of ``shift I - J`` for :func:`solve`; see :func:`implicit.linearise` for `bristles` and `jacobian`."""
    return _factorise(bristles, jacobian, shift)


@hook(optional=True)
def solve(bristles, factors, right):
    """Solution k of ``(shift I - J) k = right``, with the result of :func:`factorise`; a tuple like `right`."""
    return _solve(bristles, factors, right)


@hook(optional=True)
def acceleration_error(bristles, jacobian, error, scales):
    """Error of the acceleration that follows from the `error` of velocity and deflections, in units of the last scale.

    Zero without bristles.
    """
    return _acceleration_error(bristles, jacobian, error, scales)


@unrolled
def _factorise(count, bristles, jacobian, shift):
    """Factors of ``shift I - J`` for :func:`solve`.

    J is the Jacobian of place, velocity and deflections. See :func:`ringsweep.models.interface.implicit.linearise` for
    `jacobian` and `bristles`. The derivative of a deflection's rate with respect to the deflection is never positive,
    so that the bristles are eliminated without pivoting.
    """
    numbers = range(count)
    return [
        "j00, j01, j10, j11 = jacobian",
        "w00, w11 = shift - j00, shift - j11",
        *(f"b{i}, c{i}, d{i} = bristles[{i}]; p{i} = 1.0 / (shift - d{i})" for i in numbers),
        *(f"w11 -= b{i} * c{i} * p{i}" for i in numbers),
        "inverse = 1.0 / (w00 * w11 - j01 * j10)",
        "eliminated = (" + "".join(f"(p{i}, b{i} * p{i}, c{i} * p{i}), " for i in numbers) + ")",
        "return w11 * inverse, j01 * inverse, j10 * inverse, w00 * inverse, eliminated",
    ]


@unrolled
def _solve(count, bristles, factors, right):
    numbers = range(count)
    return [
        "m00, m01, m10, m11, eliminated = factors",
        "r0, r1 = right[0], right[1]",
        *(f"r1 += eliminated[{i}][1] * right[{i + 2}]" for i in numbers),
        "k1 = m10 * r0 + m11 * r1",
        "return (m00 * r0 + m01 * r1, k1, "
        + "".join(f"eliminated[{i}][0] * right[{i + 2}] + eliminated[{i}][2] * k1, " for i in numbers)
        + ")",
    ]


@unrolled
def _acceleration_error(count, bristles, jacobian, error, scales):
    terms = "".join(f" + bristles[{i}][0] * error[{i + 2}]" for i in range(count))
    return [f"return abs(jacobian[3] * error[1]{terms}) / scales[{count + 2}]" if count else "return 0.0"]


# The velocity relaxes fastest, so that it is eliminated first, and nothing else needs a pivot.
_ELIMINATED = (1, 3, 2, 0)


def _factors_of_four() -> list[str]:
    lines = [f"a{i}{j} = {'shift ' if i == j else ''}- bristles.rows[{i}][{j}]" for i in range(4) for j in range(4)]
    for place, i in enumerate(_ELIMINATED):
        lines.append(f"p{i} = 1.0 / a{i}{i}")
        for j in _ELIMINATED[place + 1 :]:
            lines.append(f"a{j}{i} *= p{i}")
            lines += [f"a{j}{k} -= a{j}{i} * a{i}{k}" for k in _ELIMINATED[place + 1 :]]
    rows = "".join(f"({', '.join(f'a{i}{j}' for j in range(4))}), " for i in range(4))
    return [*lines, f"return ({rows}), (p0, p1, p2, p3), 1.0 / shift"]


def _solution_of_four() -> list[str]:
    lines = ["a, p, rest = factors", *(f"r{i} = right[{i}]" for i in range(4))]
    for place, i in enumerate(_ELIMINATED):
        lines += [f"r{j} -= a[{j}][{i}] * r{i}" for j in _ELIMINATED[place + 1 :]]
    for place, i in reversed(list(enumerate(_ELIMINATED))):
        known = "".join(f" - a[{i}][{j}] * r{j}" for j in _ELIMINATED[place + 1 :])
        lines.append(f"r{i} = (r{i}{known}) * p[{i}]")
    return [*lines, "return r0, r1, r2, r3, rest * right[4]"]


factorise.implements(implicit.Coupled)(function_from_lines("bristles, jacobian, shift", _factors_of_four(), {}))
solve.implements(implicit.Coupled)(function_from_lines("bristles, factors, right", _solution_of_four(), {}))


@acceleration_error.implements(implicit.Coupled)
def _no_acceleration_error(bristles, jacobian, error, scales):
    return 0.0


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
