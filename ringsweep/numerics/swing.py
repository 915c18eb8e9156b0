"""Power series of an angle whose acceleration is linear in its sine and cosine, in its rate and in the square of that.

Such is the motion of a body that slides under constant friction. Two products of series follow from the rotation of
sine and cosine, and one is the square. All coefficients stay in registers, and the newest enter a sum last, so that the
next coefficient waits for few instructions.

Only slip on a ring under friction that does not depend on the speed takes it, once in each step.
"""

from __future__ import annotations

from typing import Any

import llvmlite.ir as ir
from numba.core import types

from ringsweep.numerics.lanes import intrinsic, spread_scalar
from ringsweep.numerics.terms import ORDER

_DOUBLE, _PAIR = ir.DoubleType(), ir.VectorType(ir.DoubleType(), 2)


class _Code:
    """Instructions that LLVM may fuse."""

    def __init__(self, builder: Any) -> None:
        """Write with a builder of LLVM code."""
        self.builder = builder

    def times(self, a: Any, b: Any) -> Any:
        """Product."""
        return self.builder.fmul(a, b, flags=("contract",))

    def plus(self, a: Any, b: Any) -> Any:
        """Sum."""
        return self.builder.fadd(a, b, flags=("contract",))

    def sum_of_products(self, pairs: Any) -> Any:
        """Sum of products, the newest of which come last: two sums, of which each waits for every second product."""
        sums: list[Any] = [None, None]
        for i, (a, b) in enumerate(pairs):
            product = self.times(a, b)
            sums[i % 2] = product if sums[i % 2] is None else self.plus(sums[i % 2], product)
        return sums[0] if sums[1] is None else self.plus(*sums)


@intrinsic
def swing(typingctx, omega, sine, cosine, square, factors):
    """Fill coefficients 1 ... ORDER of the rate of an angle, of its sine and cosine, and of the square of the rate.

    Parameters
    ----------
    omega, sine, cosine, square : ndarray
        Series, of which coefficients 0 are given; that of the angle is not needed.
    factors : tuple of float
        A constant, and the factors of sine, cosine, rate and square, whose sum is the second derivative of the angle.
    """

    def lower(context, builder, sig, args):
        code = _Code(builder)
        rows = [
            context.make_array(kind)(context, builder, arg).data
            for kind, arg in zip(sig.args[:4], args[:4], strict=True)
        ]

        def place(row: Any, k: int) -> Any:
            return builder.gep(row, [ir.Constant(ir.IntType(64), k)])

        def both(value: Any) -> Any:
            return spread_scalar(builder, value, _PAIR)

        lane = [ir.Constant(ir.IntType(32), i) for i in range(2)]
        constant, by_sine, by_cosine, by_omega, by_square = (builder.extract_value(args[4], i) for i in range(5))
        rate = builder.load(place(rows[0], 0))
        rates, doubled, spread = [rate], [code.plus(rate, rate)], [both(rate)]
        # Cosine and sine, which turn into each other.
        pair = ir.Constant(_PAIR, ir.Undefined)
        for i, row in ((0, rows[2]), (1, rows[1])):
            pair = builder.insert_element(pair, builder.load(place(row, 0)), lane[i])
        pairs = [pair]
        by_pair = builder.insert_element(both(by_cosine), by_sine, lane[1])
        for k in range(ORDER + 1):
            # From the middle outwards: the outermost factors are the newest.
            products = [(rates[k // 2], rates[k // 2])] if k % 2 == 0 else []
            products += [(doubled[j], rates[k - j]) for j in range((k - 1) // 2, -1, -1)]
            squared = code.sum_of_products(products)
            builder.store(squared, place(rows[3], k))
            if k == ORDER:
                break
            weighed = code.times(pairs[k], by_pair)
            known = code.plus(builder.extract_element(weighed, lane[0]), builder.extract_element(weighed, lane[1]))
            known = code.plus(known, code.times(by_omega, rates[k]))
            known = code.plus(known, constant) if k == 0 else known
            accelerated = code.plus(known, code.times(by_square, squared))
            order = sorted(range(k + 1), key=lambda j: abs(2 * j - k))
            turned = code.sum_of_products([(spread[j], pairs[k - j]) for j in order])
            swapped = builder.shuffle_vector(turned, turned, ir.Constant(ir.VectorType(ir.IntType(32), 2), [1, 0]))
            scale = 1.0 / (k + 1.0)
            pairs.append(code.times(swapped, ir.Constant(_PAIR, [-scale, scale])))
            rate = code.times(accelerated, ir.Constant(_DOUBLE, scale))
            rates.append(rate)
            doubled.append(code.plus(rate, rate))
            spread.append(both(rate))
            builder.store(rate, place(rows[0], k + 1))
            for i, row in ((0, rows[2]), (1, rows[1])):
                builder.store(builder.extract_element(pairs[-1], lane[i]), place(row, k + 1))
        return context.get_dummy_value()

    return types.none(omega, sine, cosine, square, factors), lower
