"""Mathematical functions for floats and for vector lanes.

A formula without ``if`` that calls only these functions can compute one run (floats, C library) or several runs side by
side (``Lanes``, polynomials below). The polynomials need arguments close to zero:

.. math::

    e^{-x} = 2^n e^r,\\ |r| \\le \\tfrac1{16} \\ln 2; \\qquad
    \\sin(x), \\cos(x) \\text{ from } \\sin(r), \\cos(r),\\ r = x - n\\tfrac{\\pi}{2},\\ |r| \\le \\tfrac{\\pi}{4}

with :math:`n` the nearest integer. The results differ from the C library by at most 6e-16; sine and cosine up to
arguments of 1e6. The numbers of a run do not depend on the runs in the other lanes.

The form of a function for vector lanes stands behind it, with the name ``..._in_lanes``. An edit of one needs the
same edit of the other.
"""

from __future__ import annotations

import math
from typing import Any

import llvmlite.ir as ir
import numpy as np
from llvmlite.binding import get_host_cpu_features
from numba.core import cgutils, types

from ringsweep.compile import absorbed, inlined, specialise, unrolled
from ringsweep.numerics.lanes import LANES, MASK, VECTOR, WIDTH, WORDS, intrinsic, llvm_function, spread_scalar


@intrinsic
def _select_lanes(typingctx, condition, a, b):
    """Form of :func:`select` for vector lanes."""
    given = MASK if MASK in (a, b) else LANES
    return given(MASK, given, given), lambda context, builder, sig, args: builder.select(*args)


@intrinsic
def _any_lane(typingctx, mask):
    """Whether some lane of a mask is true."""

    def lower(context, builder, sig, args):
        return builder.icmp_unsigned(
            "!=", builder.bitcast(args[0], ir.IntType(WIDTH)), ir.Constant(ir.IntType(WIDTH), 0)
        )

    return types.boolean(MASK), lower


@intrinsic
def _opposed(typingctx, x, v):
    """`x`, whose sign bit is not set, with the sign bit that `v` does not have."""

    def lower(context, builder, sig, args):
        x, v = (builder.bitcast(a, WORDS) for a in args)
        signs = builder.and_(builder.not_(v), ir.Constant(WORDS, [1 << 63] * WIDTH))
        return builder.bitcast(builder.or_(x, signs), VECTOR)

    return LANES(LANES, LANES), lower


# Powers of two with a fraction are found in a table of this many; without AVX-512 there are only whole powers.
_PARTS = 8 if get_host_cpu_features().get("avx512f") else 1


@intrinsic
def _power_of_two(typingctx, shifted):
    """``2**n`` where `shifted` is ``n + 1.5 * 2**52 / _PARTS``: its last bits hold n in units of ``1 / _PARTS``."""
    places = _PARTS.bit_length() - 1
    # The bits of n in units of one are added to the exponent. Those of its fraction, which are added below, are
    # subtracted here.
    powers = np.exp2(np.arange(_PARTS) / _PARTS).view(np.int64) - (np.arange(_PARTS) << (52 - places))

    def lower(context, builder, sig, args):
        words = builder.bitcast(args[0], WORDS)
        exponents = builder.shl(words, ir.Constant(WORDS, [52 - places] * WIDTH))
        return builder.bitcast(builder.add(_from_table(builder, powers.tolist(), words), exponents), VECTOR)

    return LANES(LANES), lower


def _from_table(builder: Any, table: list[int], words: Any) -> Any:
    """Word of the table for each lane, by the last bits of `words`."""
    if len(table) == 1:
        return ir.Constant(WORDS, table * WIDTH)
    eight, kind = len(table), ir.VectorType(ir.IntType(64), len(table))
    permute = cgutils.get_or_insert_function(
        builder.module, ir.FunctionType(kind, [kind, kind]), "llvm.x86.avx512.permvar.di.512"
    )

    def some(vector: Any, other: Any, first: int, count: int) -> Any:
        places = ir.Constant(ir.VectorType(ir.IntType(32), count), list(range(first, first + count)))
        return builder.shuffle_vector(vector, other, places)

    nothing = ir.Constant(WORDS, ir.Undefined)
    parts = [
        builder.call(permute, [ir.Constant(kind, table), some(words, nothing, first, eight)])
        for first in range(0, WIDTH, eight)
    ]
    while len(parts) > 1:
        parts = [some(a, b, 0, 2 * a.type.count) for a, b in zip(parts[::2], parts[1::2], strict=True)]
    return parts[0]


@intrinsic
def _bit(typingctx, shifted, place):
    """Whether bit number `place` of n is set, where `shifted` is n + 1.5 * 2**52."""
    if not isinstance(place, types.IntegerLiteral):
        return None
    bit = 1 << place.literal_value

    def lower(context, builder, sig, args):
        word = builder.and_(builder.bitcast(args[0], WORDS), ir.Constant(WORDS, [bit] * WIDTH))
        return builder.icmp_unsigned("!=", word, ir.Constant(WORDS, [0] * WIDTH))

    return MASK(LANES, place), lower


# A float of this size has no fraction bits: adding it rounds to the nearest integer.
_SHIFT = 1.5 * 2.0**52

_PER_LN2, _PER_HALF_PI = 1.0 / math.log(2.0), 2.0 / math.pi

_LN2 = math.log(2.0)

# pi/2 is the sum of these three numbers. The first two end in zero bits, so their products with n are exact.
_HALF_PI_1, _HALF_PI_2, _HALF_PI_3 = map(
    float.fromhex, ("0x1.921fb54400000p+0", "0x1.0b4611a600000p-34", "0x1.3198a2e037073p-69")
)


def lanes_body(scalar: Any) -> Any:
    """Decorator: the function is the form of `scalar` for vector lanes, which kernels call for Lanes and Mask."""

    def register(lanes: Any) -> Any:
        specialise(scalar, lambda *kinds: lanes if LANES in kinds or MASK in kinds else scalar)
        return lanes

    return register


def _apply_to_lanes(scalar: Any, name: str) -> None:
    """Let the body for Lanes of a function of one number apply an LLVM intrinsic to every lane."""
    instruction = llvm_function(name)

    @intrinsic
    def function(typingctx, x):
        return LANES(LANES), lambda context, builder, sig, args: instruction(builder, *args)

    lanes_body(scalar)(lambda x: function(x))


def select(condition, a, b):
    """`a` where the condition holds, else `b`. Both are evaluated."""
    return a if condition else b


lanes_body(select)(lambda condition, a, b: _select_lanes(condition, a, b))


@absorbed
def negated(condition):
    """Whether a condition does not hold."""
    return select(condition, 0.0, 1.0) > 0.0


def any_of(condition):
    """Whether the condition holds in any lane."""
    return condition


lanes_body(any_of)(lambda condition: _any_lane(condition))


def floor(x):
    """Largest integer not above `x`, as a float."""
    return np.floor(x)


_apply_to_lanes(floor, "llvm.floor")


def nearest(x):
    """Integer nearest to `x`, as a float."""
    return np.rint(x)


_apply_to_lanes(nearest, "llvm.rint")


def square_root(x):
    """Square root of `x`."""
    return math.sqrt(x)


_apply_to_lanes(square_root, "llvm.sqrt")


@unrolled
def _polynomial(length, c, x):
    """Polynomial with the coefficients `c`, a tuple, by Horner's rule."""
    return [f"p = c[{length - 1}]", *(f"p = c[{k}] + x * p" for k in reversed(range(length - 1))), "return p"]


# Near-minimax polynomial for (e^r - 1)/r where |r| is at most ln(2)/16, or ln(2)/2 without a table: its power series as
# a sum of Chebyshev polynomials, without those that are rounding.
_WITHIN, _TERMS = _LN2 / (2.0 * _PARTS), 7 if _PARTS == 8 else 11
_SERIES = np.polynomial.Polynomial([1.0 / math.factorial(k) for k in range(1, 25)])
_CHEBYSHEV = _SERIES.convert(kind=np.polynomial.Chebyshev, domain=[-_WITHIN, _WITHIN]).truncate(_TERMS)
_GROWTH = tuple(_CHEBYSHEV.convert(kind=np.polynomial.Polynomial).coef.tolist())


def decay(x):
    """``exp(-x)`` for `x` from 0 to 700. For other `x` the result of Lanes is undefined."""
    return math.exp(-x)


@lanes_body(decay)
def _decay_in_lanes(x):
    """Form of :func:`decay` for vector lanes."""
    shifted = _SHIFT / _PARTS - x * _PER_LN2
    n = shifted - _SHIFT / _PARTS
    r = -x - n * _LN2
    y = _power_of_two(shifted)
    return y + y * r * _polynomial(_GROWTH, r)


def exponential(x):
    """``exp(x)``; in Lanes exponents beyond 700 count as 700, and those below -700 as -700."""
    return math.exp(x)


lanes_body(exponential)(lambda x: decay(min(max(-x, -700.0), 700.0)))


def hyperbolic_tangent(x):
    """Hyperbolic tangent of `x`."""
    return math.tanh(x)


@lanes_body(hyperbolic_tangent)
def _hyperbolic_tangent_in_lanes(x):
    """Form of :func:`hyperbolic_tangent` for vector lanes."""
    q = decay(min(2.0 * abs(x), 80.0))
    large, square = (1.0 - q) / (1.0 + q), x * x
    # The difference would lose the digits of a small result.
    small = x * (1.0 + square * (-1 / 3 + square * (2 / 15 + square * (-17 / 315 + square * (62 / 2835)))))
    return select(square < 1e-3, small, select(x < 0.0, -large, large))


_pow = llvm_function("llvm.pow")


@intrinsic
def _power_in_lanes(typingctx, x, exponent):
    """Form of :func:`power` for vector lanes."""
    return LANES(LANES, LANES), lambda context, builder, sig, args: _pow(builder, *args)


@intrinsic
def _arc_tangent_in_lanes(typingctx, x):
    """Form of the arc tangent for vector lanes."""

    def lower(context, builder, sig, args):
        # LLVM has no such function of vectors: the C library computes each lane.
        kind = ir.FunctionType(ir.DoubleType(), [ir.DoubleType()])
        function, found = cgutils.get_or_insert_function(builder.module, kind, "atan"), args[0]
        for lane in range(WIDTH):
            place = ir.Constant(ir.IntType(32), lane)
            found = builder.insert_element(
                found, builder.call(function, [builder.extract_element(args[0], place)]), place
            )
        return found

    return LANES(LANES), lower


def logarithm(x):
    """Natural logarithm of `x`; for Lanes the C library computes each lane."""
    return math.log(x)


_apply_to_lanes(logarithm, "llvm.log")


def raised(x, exponent):
    """`x`, at least 0, to the power `exponent`; for Lanes the C library computes each lane."""
    return x**exponent


lanes_body(raised)(lambda x, exponent: _power_in_lanes(spread(x), spread(exponent)))


def arc_tangent(x):
    """Arc tangent of `x`; for Lanes the C library computes each lane."""
    return math.atan(x)


lanes_body(arc_tangent)(lambda x: _arc_tangent_in_lanes(x))


@intrinsic
def _splat(typingctx, x):
    """Lanes that all hold the same number."""
    return LANES(types.float64), lambda context, builder, sig, args: spread_scalar(builder, args[0], VECTOR)


def spread(x):
    """The number `x` in every lane. In kernels it takes floats and Lanes, and returns Lanes."""
    return x


_spread_number: Any = _splat


@intrinsic
def gather(typingctx, values, places):
    """Numbers of an array at the places in Lanes, which are whole numbers within the array."""

    def lower(context, builder, sig, args):
        base = builder.ptrtoint(context.make_array(sig.args[0])(context, builder, args[0]).data, ir.IntType(64))
        offsets = builder.shl(builder.fptosi(args[1], WORDS), ir.Constant(WORDS, [3] * WIDTH))
        addresses = builder.add(spread_scalar(builder, base, WORDS), offsets)
        pointers = ir.VectorType(ir.DoubleType().as_pointer(), WIDTH)
        mask = ir.VectorType(ir.IntType(1), WIDTH)
        kind = ir.FunctionType(VECTOR, [pointers, ir.IntType(32), mask, VECTOR])
        name = f"llvm.masked.gather.v{WIDTH}f64.v{WIDTH}p0f64"
        function = cgutils.get_or_insert_function(builder.module, kind, name)
        everywhere, nothing = ir.Constant(mask, [1] * WIDTH), ir.Constant(VECTOR, ir.Undefined)
        align = ir.Constant(ir.IntType(32), 8)
        return builder.call(function, [builder.inttoptr(addresses, pointers), align, everywhere, nothing])

    return LANES(values, LANES), lower


specialise(spread, lambda kind: (lambda x: x) if kind == LANES else (lambda x: _spread_number(x)))


def sine_cosine(x):
    """Sine and cosine of `x`."""
    return math.sin(x), math.cos(x)


@lanes_body(sine_cosine)
def _sine_cosine_in_lanes(x):
    """Form of :func:`sine_cosine` for vector lanes."""
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
    a, b = _select_lanes(swap, cosine, sine), _select_lanes(swap, sine, cosine)
    # Sine is negative in the third and fourth quadrants, cosine in the second and third.
    return _select_lanes(_bit(shifted, 1), -a, a), _select_lanes(_bit(shifted + 1.0, 1), -b, b)


def sine_cosine_carried(x, x_0, sine, cosine, afresh):
    """Sine and cosine of `x`, given `sine` and `cosine` of a number `x_0` that is probably close to `x`.

    In a series of numbers, each with the results for the one before, rounding errors add up: to 2e-15 at most over 64
    numbers. So `afresh`, a bool, is to be true now and then. Then the results do not depend on `x_0`.
    """
    return math.sin(x), math.cos(x)


@lanes_body(sine_cosine_carried)
def _sine_cosine_carried_in_lanes(x, x_0, sine, cosine, afresh):
    """Form of :func:`sine_cosine_carried` for vector lanes."""
    r = x - x_0
    s = r * r
    sine_r = r + r * s * (-1 / 6 + s * (1 / 120 - s * (1 / 5040)))
    # The cosine of r is 1 + less.
    less = s * (-1 / 2 + s * (1 / 24 - s * (1 / 720)))
    a, b = (sine + cosine * sine_r) + sine * less, (cosine - sine * sine_r) + cosine * less
    # In these lanes the truncation error of the series exceeds rounding.
    far = s > 1.0 / 1024.0
    if afresh or any_of(far):
        sine, cosine = sine_cosine(x)
        far = far | afresh
        a, b = _select_lanes(far, sine, a), _select_lanes(far, cosine, b)
    return a, b


# Within this distance the truncation error of the series of sine and cosine is below rounding, rad.
_CLOSE = 0.1


@inlined
def sine_cosine_from(x, x_0, sine, cosine):
    """Sine and cosine of the float `x`, given `sine` and `cosine` of a number `x_0`: fast if the two are close."""
    r = x - x_0
    if not abs(r) < _CLOSE:
        return math.sin(x), math.cos(x)
    s = r * r
    sine_r = r + r * s * (-1 / 6 + s * (1 / 120 + s * (-1 / 5040 + s * (1 / 362880))))
    less = s * (-1 / 2 + s * (1 / 24 + s * (-1 / 720 + s * (1 / 40320))))
    # The cosine of r is 1 + less.
    return sine + (sine * less + cosine * sine_r), cosine + (cosine * less - sine * sine_r)


#: Largest angle that :func:`rotated` takes, rad.
ROTATED = 0.004


@inlined
def rotated(sine, cosine, r):
    """Sine and cosine of the sum of an angle, given by its `sine` and `cosine`, and of `r`, at most ROTATED, rad."""
    return (
        sine
        + r * (cosine - r * (1 / 2) * (sine + r * (1 / 3) * (cosine - r * (1 / 4) * (sine + r * (1 / 5) * cosine)))),
        cosine
        - r * (sine + r * (1 / 2) * (cosine - r * (1 / 3) * (sine + r * (1 / 4) * (cosine - r * (1 / 5) * sine)))),
    )


def opposing(x, v):
    """`x`, at least 0, with the sign opposite to the sign of `v`. If `v` is 0: for a float 0; for Lanes -`x` or `x`."""
    return -x if v > 0.0 else x if v < 0.0 else 0.0 * x


lanes_body(opposing)(lambda x, v: _opposed(x, v))
