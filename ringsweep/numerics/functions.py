"""Functions that take a float or vector lanes alike.

A formula that is written with these functions, and without ``if``, serves one run (a float, with the mathematical
functions of the C library) and sixteen runs side by side (``Lanes``, with the polynomials below).

.. math::

    e^{-x} = 2^n e^r,\\ |r| \\le \\tfrac12 \\ln 2; \\qquad
    \\sin(x), \\cos(x) \\text{ from those of } r = x - n\\tfrac{\\pi}{2},\\ |r| \\le \\tfrac{\\pi}{4}

with :math:`n` the nearest integer. They are within 6e-16 of the C library's, sine and cosine up to arguments of 1e6.
The numbers of a run never depend on its neighbours: a branch only saves work that changes no lane.
"""

from __future__ import annotations

import math
from typing import Any

import llvmlite.ir as ir
import numpy as np
from numba.core import types
from numba.extending import intrinsic

from ringsweep.compile import specialise
from ringsweep.numerics.lanes import LANES, MASK, VECTOR, WIDTH, WORDS, named


@intrinsic
def _select(typingctx, condition, a, b):
    given = MASK if MASK in (a, b) else LANES
    return given(MASK, given, given), lambda context, builder, sig, args: builder.select(*args)


@intrinsic
def _any(typingctx, mask):
    def lower(context, builder, sig, args):
        return builder.icmp_unsigned(
            "!=", builder.bitcast(args[0], ir.IntType(WIDTH)), ir.Constant(ir.IntType(WIDTH), 0)
        )

    return types.boolean(MASK), lower


def _unary(name: str) -> Any:
    """An operation of the processor on every lane."""
    instruction = named(name)

    @intrinsic
    def function(typingctx, x):
        return LANES(LANES), lambda context, builder, sig, args: instruction(builder, *args)

    return function


_floor, _sqrt = _unary("llvm.floor"), _unary("llvm.sqrt")


_copy = named("llvm.copysign")


@intrinsic
def _copysign(typingctx, x, sign):
    return LANES(LANES, LANES), lambda context, builder, sig, args: _copy(builder, *args)


@intrinsic
def _times_power_of_two(typingctx, x, shifted):
    """``x * 2**n``, where `shifted` is n + 1.5 * 2**52: its last bits hold n, which is added to the exponent of x."""

    def lower(context, builder, sig, args):
        x, shifted = (builder.bitcast(a, WORDS) for a in args)
        return builder.bitcast(builder.add(x, builder.shl(shifted, ir.Constant(WORDS, [52] * WIDTH))), VECTOR)

    return LANES(LANES, LANES), lower


@intrinsic
def _bit(typingctx, shifted, place):
    """Whether the bit of that place is set in n, where `shifted` is n + 1.5 * 2**52."""
    if not isinstance(place, types.IntegerLiteral):
        return None
    bit = 1 << place.literal_value

    def lower(context, builder, sig, args):
        word = builder.and_(builder.bitcast(args[0], WORDS), ir.Constant(WORDS, [bit] * WIDTH))
        return builder.icmp_unsigned("!=", word, ir.Constant(WORDS, [0] * WIDTH))

    return MASK(LANES, place), lower


_SHIFT = 1.5 * 2.0**52


_PER_LN2, _PER_HALF_PI = 1.0 / math.log(2.0), 2.0 / math.pi


_LN2 = math.log(2.0)


# A sum of which the first two terms end in zeros, so that their products with whole numbers are exact.
_HALF_PI_1, _HALF_PI_2, _HALF_PI_3 = map(
    float.fromhex, ("0x1.921fb54400000p+0", "0x1.0b4611a600000p-34", "0x1.3198a2e037073p-69")
)


def either(scalar: Any) -> Any:
    """A function of numbers whose body for lanes is given by the decorator ``@either(scalar)``."""

    def register(lanes: Any) -> Any:
        specialise(scalar, lambda *kinds: lanes if LANES in kinds or MASK in kinds else scalar)
        return lanes

    return register


def select(condition, a, b):
    """`a` where the condition holds, else `b`; both are evaluated."""
    return a if condition else b


@either(select)
def _lanes_select(condition, a, b):
    return _select(condition, a, b)


def any_of(condition):
    """Whether the condition holds in any lane."""
    return condition


@either(any_of)
def _lanes_any_of(condition):
    return _any(condition)


def floor(x):
    """Greatest whole number not above `x`, as a float."""
    return np.floor(x)


@either(floor)
def _lanes_floor(x):
    return _floor(x)


def square_root(x):
    """Square root of `x`."""
    return math.sqrt(x)


@either(square_root)
def _lanes_square_root(x):
    return _sqrt(x)


def decay(x):
    """``exp(-x)`` for `x` not below 0; of other Lanes anything may come, and must not be heard."""
    return math.exp(-x)


@either(decay)
def _lanes_decay(x):
    shifted = _SHIFT - x * _PER_LN2
    n = shifted - _SHIFT
    r = -x - n * _LN2
    s = r * r
    f = s * s
    # Of degree 10, as near to e^r as can be, in pairs: products need not wait for one another.
    low = (1.0 + r * 1.0000000000000064) + s * (0.49999999999997263 + r * 0.16666666666558028)
    middle = (0.04166666666844455 + r * 0.008333333384564497) + s * (0.0013888888493793516 + r * 0.00019841171513760236)
    high = (2.4801923751985747e-05 + r * 2.7639713991164592e-06) + s * 2.748609738437795e-07
    return _times_power_of_two(low + f * (middle + f * high), shifted)


def sine_cosine(x):
    """Sine and cosine of `x`."""
    return math.sin(x), math.cos(x)


@either(sine_cosine)
def _lanes_sine_cosine(x):
    shifted = x * _PER_HALF_PI + _SHIFT
    n = shifted - _SHIFT
    r = ((x - n * _HALF_PI_1) - n * _HALF_PI_2) - n * _HALF_PI_3
    s = r * r
    f = s * s
    # Coefficients of fdlibm.
    sine = r + r * s * (
        (-1.66666666666666324348e-01 + s * 8.33333333332248946124e-03)
        + f * (-1.98412698298579493134e-04 + s * 2.75573137070700676789e-06)
        + f * f * (-2.50507602534068634195e-08 + s * 1.58969099521155010221e-10)
    )
    cosine = (1.0 - 0.5 * s) + f * (
        (4.16666666666666019037e-02 + s * -1.38888888888741095749e-03)
        + f * (2.48015872894767294178e-05 + s * -2.75573143513906633035e-07)
        + f * f * (2.08757232129817482790e-09 + s * -1.13596475577881948265e-11)
    )
    swap = _bit(shifted, 0)
    a, b = _select(swap, cosine, sine), _select(swap, sine, cosine)
    # Sine is negative in the third and fourth quadrant, cosine in the second and third.
    return _select(_bit(shifted, 1), -a, a), _select(_bit(shifted + 1.0, 1), -b, b)


def sine_cosine_near(x, x_0, sine, cosine):
    """Sine and cosine of `x`, given those of `x_0`, which is likely to be near."""
    return math.sin(x), math.cos(x)


@either(sine_cosine_near)
def _lanes_sine_cosine_near(x, x_0, sine, cosine):
    r = x - x_0
    s = r * r
    sine_r = r + r * s * (-1 / 6 + s * (1 / 120 - s * (1 / 5040)))
    cosine_r = 1.0 + s * (-1 / 2 + s * (1 / 24 - s * (1 / 720)))
    a, b = sine * cosine_r + cosine * sine_r, cosine * cosine_r - sine * sine_r
    # Where the next term of the series could be seen.
    far = s > 1.0 / 1024.0
    if any_of(far):
        sine, cosine = sine_cosine(x)
        a, b = _select(far, sine, a), _select(far, cosine, b)
    return a, b


def opposing(x, v):
    """`x`, which is not negative, with the sign opposite to that of `v`; where `v` is 0 a plain number is."""
    return -x if v > 0.0 else x if v < 0.0 else 0.0 * x


@either(opposing)
def _lanes_opposing(x, v):
    return _copysign(x, -v)
