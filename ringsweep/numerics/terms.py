"""Vector lanes within a power series: its terms side by side, and the products of several series side by side.

In a kernel the terms of the powers 1 ... ORDER of a series are one vector, so that a sum over them takes a few
instructions. A product of two series cannot be computed at once where its coefficients appear one after another, as in
the solution of a differential equation. But several products can grow side by side, one in each lane.

Functions named ``..._in_kernel`` write the code that kernels call in place of the Python function before them; an
edit of one needs the same edit of the other. A *factor* is coefficient k of one of the two series of a product.
"""

from __future__ import annotations

from math import ceil
from typing import Any

import llvmlite.ir as ir
import numpy as np
from numba.core import cgutils, types

from ringsweep.compile import absorbed, function_from_lines, generated, specialise
from ringsweep.numerics.lanes import Lanes, intrinsic, loader, spread_scalar, storer

#: Highest power of every series.
ORDER = 16

#: Number of products that grow side by side.
PRODUCTS = 8

#: Columns of a table of series: ORDER + 3 numbers, rounded up so that rows begin at multiples of 64 bytes.
COLUMNS = 24

#: Rows of a table for a group of PRODUCTS pairs of factors, see :func:`set_factors`.
FACTOR_ROWS = ceil(2 * (ORDER + 1) * PRODUCTS / COLUMNS)

#: Largest number of groups in a table.
MOST_GROUPS = 3

#: ``NUMBERS[k - 1]`` is k.
NUMBERS = np.arange(1.0, ORDER + 1)

_TERMS, _FACTORS = Lanes(ORDER), Lanes(PRODUCTS)
_TERMS_VECTOR = ir.VectorType(ir.DoubleType(), ORDER)


def _in_kernels(function: Any, body: Any) -> None:
    """Let kernels call `body` in place of `function`."""
    specialise(function, lambda *kinds: body, absorb=True)


_load_terms, _store_terms, _load_factors, _store_factors = (
    make(lanes) for lanes in (_TERMS, _FACTORS) for make in (loader, storer)
)


# ---- terms of one series ----------------------------------------------------------------------


def terms(c):
    """Coefficients 1 ... ORDER of a series side by side; in Python an array."""
    return c[1 : ORDER + 1]


_in_kernels(terms, lambda c: _load_terms(c, 1))


def set_terms(c, values):
    """Set the coefficients 1 ... ORDER of a series."""
    c[1 : ORDER + 1] = values


_in_kernels(set_terms, lambda c, values: _store_terms(c, 1, values))


def numbers_from(values, first):
    """Numbers `first` ... `first` + ORDER - 1 of an array side by side."""
    return values[first : first + ORDER]


_in_kernels(numbers_from, lambda values, first: _load_terms(values, first))


def powers(s):
    """The powers 0 ... ORDER - 1 of a number, side by side."""
    return s ** np.arange(float(ORDER))


@intrinsic
def _powers_in_kernel(typingctx, s):
    """Form of :func:`powers` for kernels."""

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


_in_kernels(powers, lambda s: _powers_in_kernel(s))


def total(values):
    """Sum over the lanes."""
    return values.sum()


@intrinsic
def _total_in_kernel(typingctx, values):
    """Form of :func:`total` for kernels."""

    def lower(context, builder, sig, args):
        kind = ir.FunctionType(ir.DoubleType(), [ir.DoubleType(), args[0].type])
        add = cgutils.get_or_insert_function(builder.module, kind, f"llvm.vector.reduce.fadd.v{args[0].type.count}f64")
        # The order of the sum is free, so that the processor adds pairs.
        return builder.call(add, [ir.Constant(ir.DoubleType(), -0.0), args[0]], fastmath=("reassoc",))

    return types.float64(_TERMS), lower


_in_kernels(total, lambda values: _total_in_kernel(values))


def least(values):
    """Least of the lanes."""
    return values.min()


@intrinsic
def _least_in_kernel(typingctx, values):
    """Form of :func:`least` for kernels."""

    def lower(context, builder, sig, args):
        kind = ir.FunctionType(ir.DoubleType(), [args[0].type])
        fold = cgutils.get_or_insert_function(builder.module, kind, f"llvm.vector.reduce.fmin.v{args[0].type.count}f64")
        return builder.call(fold, [args[0]], fastmath=("nnan",))

    return types.float64(_TERMS), lower


_in_kernels(least, lambda values: _least_in_kernel(values))


def sign_changes(values):
    """Number of sign changes along the lanes, which a positive number precedes; zero counts as negative."""
    positive = np.concatenate([[True], values > 0.0])
    return int((positive[1:] != positive[:-1]).sum())


@intrinsic
def _sign_changes_in_kernel(typingctx, values):
    """Form of :func:`sign_changes` for kernels."""

    def lower(context, builder, sig, args):
        bits = ir.IntType(ORDER)
        zeros = ir.Constant(_TERMS_VECTOR, [0.0] * ORDER)
        positive = builder.bitcast(builder.fcmp_ordered(">", args[0], zeros), bits)
        before = builder.or_(builder.shl(positive, ir.Constant(bits, 1)), ir.Constant(bits, 1))
        return builder.zext(builder.ctpop(builder.xor(positive, before)), ir.IntType(64))

    return types.int64(_TERMS), lower


_in_kernels(sign_changes, lambda values: _sign_changes_in_kernel(values))


# ---- products of several series ---------------------------------------------------------------

# Products grow side by side in groups of PRODUCTS. The factors of a group are a pair, left ones and right ones.


def _groups_for(products: int) -> int:
    """Number of groups of side-by-side factors that so many products need."""
    return -(-products // PRODUCTS)


@intrinsic
def _zero_factors(typingctx):
    """A group of factors that are zero."""
    zeros = ir.Constant(ir.VectorType(ir.DoubleType(), PRODUCTS), [0.0] * PRODUCTS)
    return _FACTORS(), lambda context, builder, sig, args: zeros


@generated(absorb=True)
def no_factors(like):
    """Factors before the first ones, for as many products as the tuple `like` is long, see :func:`set_factors`."""
    return [f"return ({'(zeros(), zeros()), ' * _groups_for(len(like))})"], {"zeros": _zero_factors}


@generated(absorb=True)
def set_factors(c, row, k, left, right):
    """Store coefficient `k` of pairs of factors.

    Parameters
    ----------
    c : ndarray of shape ``(rows, columns)``
        Table of series.
    row : int
        Row of the table from which on the factors stand, FACTOR_ROWS for each group.
    k : int
    left, right : tuple of float
        One number for each product.

    Returns
    -------
    tuple
        The same numbers side by side, for :func:`inner_products`.
    """

    def part(name: str, group: int) -> str:
        places = range(group * PRODUCTS, (group + 1) * PRODUCTS)
        return "(" + "".join(f"{name}[{i}], " if i < len(left) else "0.0, " for i in places) + ")"

    calls = (
        f"set_group(c, row + {group * FACTOR_ROWS}, k, {part('left', group)}, {part('right', group)}), "
        for group in range(_groups_for(len(left)))
    )
    return [f"return ({''.join(calls)})"], {"set_group": _set_group}


@intrinsic
def _packed(typingctx, values):
    """Vector of factors from a tuple of numbers."""

    def lower(context, builder, sig, args):
        vector = ir.Constant(ir.VectorType(ir.DoubleType(), PRODUCTS), ir.Undefined)
        for k in range(PRODUCTS):
            number = builder.extract_value(args[0], k)
            vector = builder.insert_element(vector, number, ir.Constant(ir.IntType(32), k))
        return vector

    return _FACTORS(types.UniTuple(types.float64, PRODUCTS)), lower


@absorbed
def _set_group(c, row, k, left, right):
    """Store a group of left and right factors of coefficient `k` from row `row` on, and return both vectors."""
    at = row * c.shape[1] + k * (2 * PRODUCTS)
    a, b = _packed(left), _packed(right)
    _store_factors(c, at, a)
    _store_factors(c, at + PRODUCTS, b)
    return a, b


@generated(absorb=True)
def inner_products(c, row, k, first, newest):
    """Coefficient `k` of products of two series, without the terms that contain a coefficient 0 or `k`.

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
        For each pair of factors a and b the sum of ``a[j] b[k - j]`` over j = 1 ... k - 1. The length is a multiple of
        PRODUCTS.
    """
    lines, numbers = [], []
    for group in range(len(first)):
        lines.append(f"g{group} = of_group(c, row + {group * FACTOR_ROWS}, k, first[{group}], newest[{group}])")
        numbers += [f"g{group}[{i}], " for i in range(PRODUCTS)]
    return [*lines, f"return ({''.join(numbers)})"], {"of_group": _inner_products_of_group}


@intrinsic
def _unpacked(typingctx, vector):
    """Tuple of numbers from a vector of factors."""
    result = types.UniTuple(types.float64, PRODUCTS)

    def lower(context, builder, sig, args):
        numbers = [builder.extract_element(args[0], ir.Constant(ir.IntType(32), k)) for k in range(PRODUCTS)]
        return context.make_tuple(builder, result, numbers)

    return result(_FACTORS), lower


@absorbed
def _inner_products_of_group(c, row, k, first, newest):
    """Sums of the products of older factors of one group, for coefficient `k`."""
    a = row * c.shape[1]
    b = a + (2 * k + 1) * PRODUCTS
    even = odd = _zero_factors()
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


def joined(a, b):
    """One tuple of the numbers of two tuples."""
    return (*a, *b)


def _joined_in_kernel(a: Any, b: Any) -> Any:
    """Body of :func:`joined` for the types of its arguments."""
    numbers = [f"{name}[{i}], " for name, kind in (("a", a), ("b", b)) for i in range(len(kind))]
    return function_from_lines("a, b", [f"return ({''.join(numbers)})"], {})


specialise(joined, _joined_in_kernel, absorb=True)


def part_from(values, like, after):
    """``values[len(after):len(after) + len(like)]``, in kernels."""
    return values[len(after) : len(after) + len(like)]


def _part_in_kernel(values: Any, like: Any, after: Any) -> Any:
    """Body of :func:`part_from` for the types of its arguments."""
    numbers = [f"values[{i}], " for i in range(len(after), len(after) + len(like))]
    return function_from_lines("values, like, after", [f"return ({''.join(numbers)})"], {})


specialise(part_from, _part_in_kernel, absorb=True)
