"""Vector lanes within a power series: its terms side by side, and the products of several series side by side.

In a kernel the terms of the powers 1 ... ORDER of a series are one vector, so that a sum over them takes a few
instructions. A product of two series cannot be computed at once where its coefficients appear one after another, as in
the solution of a differential equation. But several products can grow side by side, one in each lane.
"""

from __future__ import annotations

from typing import Any

import llvmlite.ir as ir
import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic

from ringsweep.compile import specialise
from ringsweep.numerics.lanes import Lanes, spread_scalar

#: Highest power of every series.
ORDER = 16

#: Number of products that grow side by side.
PRODUCTS = 8

#: ``NUMBERS[k - 1]`` is k.
NUMBERS = np.arange(1.0, ORDER + 1)

_TERMS, _FACTORS = Lanes(ORDER), Lanes(PRODUCTS)
_TERMS_VECTOR = ir.VectorType(ir.DoubleType(), ORDER)


def _compiled(body: Any, function: Any) -> None:
    """Let kernels call `body` in place of `function`."""
    specialise(function, lambda *kinds: body, absorb=True)


def _place(context: Any, builder: Any, sig: Any, args: Any, lanes: Lanes) -> Any:
    memory = context.make_array(sig.args[0])(context, builder, args[0])
    vector = ir.VectorType(ir.DoubleType(), lanes.width)
    return builder.bitcast(builder.gep(memory.data, [args[1]]), vector.as_pointer())


def _loader(lanes: Lanes) -> Any:
    @intrinsic
    def load(typingctx, memory, at):
        def lower(context, builder, sig, args):
            return builder.load(_place(context, builder, sig, args, lanes), align=8)

        return lanes(memory, types.intp), lower

    return load


def _storer(lanes: Lanes) -> Any:
    @intrinsic
    def store(typingctx, memory, at, value):
        def lower(context, builder, sig, args):
            builder.store(args[2], _place(context, builder, sig, args, lanes), align=8)
            return context.get_dummy_value()

        return types.none(memory, types.intp, lanes), lower

    return store


_load_terms, _store_terms, _load_factors, _store_factors = (
    make(lanes) for lanes in (_TERMS, _FACTORS) for make in (_loader, _storer)
)


# ---- terms of one series ----------------------------------------------------------------------


def terms(c):
    """Coefficients 1 ... ORDER of a series side by side; in Python an array."""
    return c[1 : ORDER + 1]


def _terms_in_kernel(c):
    return _load_terms(c, 1)


_compiled(_terms_in_kernel, terms)


def set_terms(c, values):
    """Set the coefficients 1 ... ORDER of a series."""
    c[1 : ORDER + 1] = values


def _set_terms_in_kernel(c, values):
    _store_terms(c, 1, values)


_compiled(_set_terms_in_kernel, set_terms)


def numbers_from(values, first):
    """Numbers `first` ... `first` + ORDER - 1 of an array side by side."""
    return values[first : first + ORDER]


def _numbers_in_kernel(values, first):
    return _load_terms(values, first)


_compiled(_numbers_in_kernel, numbers_from)


def powers(s):
    """The powers 0 ... ORDER - 1 of a number, side by side."""
    return s ** np.arange(float(ORDER))


@intrinsic
def _powers(typingctx, s):
    def lower(context, builder, sig, args):
        result, power = None, args[0]
        ones = ir.Constant(_TERMS_VECTOR, [1.0] * ORDER)
        for bit in range(ORDER.bit_length() - 1):
            has = ir.Constant(ir.VectorType(ir.IntType(1), ORDER), [k >> bit & 1 for k in range(ORDER)])
            factor = builder.select(has, spread_scalar(builder, power, _TERMS_VECTOR), ones)
            result = factor if result is None else builder.fmul(result, factor)
            power = builder.fmul(power, power)
        return result

    return _TERMS(types.float64), lower


def _powers_in_kernel(s):
    return _powers(s)


_compiled(_powers_in_kernel, powers)


def total(values):
    """Sum over the lanes."""
    return values.sum()


@intrinsic
def _total(typingctx, values):
    def lower(context, builder, sig, args):
        kind = ir.FunctionType(ir.DoubleType(), [ir.DoubleType(), args[0].type])
        add = cgutils.get_or_insert_function(builder.module, kind, f"llvm.vector.reduce.fadd.v{args[0].type.count}f64")
        # The order of the sum is free, so that the processor adds pairs.
        return builder.call(add, [ir.Constant(ir.DoubleType(), -0.0), args[0]], fastmath=("reassoc",))

    return types.float64(_TERMS), lower


def _total_in_kernel(values):
    return _total(values)


_compiled(_total_in_kernel, total)


# ---- products of several series ---------------------------------------------------------------


def no_factors():
    """Factors before the first ones, see :func:`set_factors`."""
    return np.zeros(PRODUCTS), np.zeros(PRODUCTS)


@intrinsic
def _no_factor(typingctx):
    zeros = ir.Constant(ir.VectorType(ir.DoubleType(), PRODUCTS), [0.0] * PRODUCTS)
    return _FACTORS(), lambda context, builder, sig, args: zeros


def _no_factors_in_kernel():
    return _no_factor(), _no_factor()


_compiled(_no_factors_in_kernel, no_factors)


def set_factors(c, row, k, left, right):
    """Store coefficient `k` of PRODUCTS pairs of factors.

    Parameters
    ----------
    c : ndarray of shape ``(rows, columns)``
        Table of series.
    row : int
        Row of the table from which on the factors stand.
    k : int
    left, right : tuple of float
        PRODUCTS numbers each.

    Returns
    -------
    tuple
        The same numbers side by side, for :func:`inner_products`; in Python arrays.
    """
    pairs = c.reshape(-1)[row * c.shape[1] :][: (k + 1) * 2 * PRODUCTS].reshape(k + 1, 2, PRODUCTS)
    pairs[k] = left, right
    return np.array(left), np.array(right)


@intrinsic
def _packed(typingctx, values):
    def lower(context, builder, sig, args):
        vector = ir.Constant(ir.VectorType(ir.DoubleType(), PRODUCTS), ir.Undefined)
        for k in range(PRODUCTS):
            number = builder.extract_value(args[0], k)
            vector = builder.insert_element(vector, number, ir.Constant(ir.IntType(32), k))
        return vector

    return _FACTORS(types.UniTuple(types.float64, PRODUCTS)), lower


def _set_factors_in_kernel(c, row, k, left, right):
    at = row * c.shape[1] + k * (2 * PRODUCTS)
    a, b = _packed(left), _packed(right)
    _store_factors(c, at, a)
    _store_factors(c, at + PRODUCTS, b)
    return a, b


_compiled(_set_factors_in_kernel, set_factors)


def inner_products(c, row, k, first, newest):
    """Coefficient `k` of PRODUCTS products of two series, without the terms that contain a coefficient 0 or `k`.

    Parameters
    ----------
    c : ndarray of shape ``(rows, columns)``
        Table of series.
    row : int
        Row of the table from which on the factors stand, see :func:`set_factors`.
    k : int
        The coefficients 1 ... `k` - 1 of the factors are known.
    first, newest : tuple
        What :func:`set_factors` returned for the coefficients 1 and `k` - 1, or :func:`no_factors`.

    Returns
    -------
    tuple of float
        For each pair of factors a and b the sum of ``a[j] b[k - j]`` over j = 1 ... k - 1.
    """
    if k < 2:
        return (0.0,) * PRODUCTS
    pairs = c.reshape(-1)[row * c.shape[1] :][: k * 2 * PRODUCTS].reshape(k, 2, PRODUCTS)
    return tuple((pairs[1:, 0] * pairs[:0:-1, 1]).sum(axis=0))


@intrinsic
def _unpacked(typingctx, vector):
    result = types.UniTuple(types.float64, PRODUCTS)

    def lower(context, builder, sig, args):
        numbers = [builder.extract_element(args[0], ir.Constant(ir.IntType(32), k)) for k in range(PRODUCTS)]
        return context.make_tuple(builder, result, numbers)

    return result(_FACTORS), lower


def _inner_products_in_kernel(c, row, k, first, newest):
    a = row * c.shape[1]
    b = a + (2 * k + 1) * PRODUCTS
    even = odd = _no_factor()
    # Of two sums each waits only for every second product. The newest factors come last, from registers, so that
    # nothing waits for the memory.
    for j in range(2, k - 2, 2):
        at = 2 * j * PRODUCTS
        even = even + _load_factors(c, a + at) * _load_factors(c, b - at)
        at += 2 * PRODUCTS
        odd = odd + _load_factors(c, a + at) * _load_factors(c, b - at)
    if k % 2 == 0 and k > 2:
        at = 2 * (k - 2) * PRODUCTS
        even = even + _load_factors(c, a + at) * _load_factors(c, b - at)
    if k > 2:
        odd = odd + newest[0] * first[1]
    return _unpacked(even + first[0] * newest[1] + odd)


_compiled(_inner_products_in_kernel, inner_products)
