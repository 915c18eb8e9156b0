"""Vector lanes: a type that holds one number for each of sixteen runs, and its arithmetic.

The processor takes a value of sixteen doubles in two instructions of 512 bits, or in more and narrower ones. While it
waits for the result of one part it works on the other.
"""

from __future__ import annotations

import operator
from typing import Any

import llvmlite.ir as ir
from numba.core import cgutils, types
from numba.core.typing import signature
from numba.extending import lower_builtin, lower_cast, models, register_model, type_callable

#: Runs in one value.
WIDTH = 16


_DOUBLE, _WORD = ir.DoubleType(), ir.IntType(64)


VECTOR, WORDS, _BITS = (ir.VectorType(kind, WIDTH) for kind in (_DOUBLE, _WORD, ir.IntType(1)))


class Lanes(types.Type):
    """Several doubles."""

    def __init__(self) -> None:
        super().__init__("Lanes")


class Mask(types.Type):
    """Several truth values."""

    def __init__(self) -> None:
        super().__init__("Mask")


LANES, MASK = Lanes(), Mask()


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, VECTOR)


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _BITS)


# ---- arithmetic ------------------------------------------------------------------------------


def spread_scalar(builder: Any, value: Any, kind: ir.VectorType) -> Any:
    """A vector with `value` in every lane."""
    first = builder.insert_element(ir.Constant(kind, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    everywhere = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(first, ir.Constant(kind, ir.Undefined), everywhere)


@lower_cast(types.Float, LANES)
@lower_cast(types.Integer, LANES)
def _from_number(context, builder, fromty, toty, value):
    return spread_scalar(builder, context.cast(builder, value, fromty, types.float64), VECTOR)


@lower_cast(types.Boolean, MASK)
def _from_boolean(context, builder, fromty, toty, value):
    return spread_scalar(builder, builder.trunc(value, ir.IntType(1)) if value.type.width > 1 else value, _BITS)


def _teach(function: Any, taken: Any, given: Any, arity: int, instruction: Any) -> None:
    """Give `function` a meaning for arguments of type `taken`, plain ones among them spread over the lanes."""
    alike = types.Boolean if taken is MASK else types.Number

    @type_callable(function)
    def typer(context):
        def typed(*args):
            if len(args) == arity and taken in args and all(a == taken or isinstance(a, alike) for a in args):
                return signature(given, *[taken] * arity)
            return None

        return typed

    @lower_builtin(function, *[taken] * arity)
    def lower(context, builder, sig, args):
        return instruction(builder, *args)


def named(name: str) -> Any:
    def instruction(builder: Any, *args: Any) -> Any:
        kind = ir.FunctionType(VECTOR, [VECTOR] * len(args))
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"{name}.v{WIDTH}f64"), args)

    return instruction


_teach(operator.add, LANES, LANES, 2, lambda builder, a, b: builder.fadd(a, b))


_teach(operator.sub, LANES, LANES, 2, lambda builder, a, b: builder.fsub(a, b))


_teach(operator.mul, LANES, LANES, 2, lambda builder, a, b: builder.fmul(a, b))


_teach(operator.truediv, LANES, LANES, 2, lambda builder, a, b: builder.fdiv(a, b))


_teach(operator.neg, LANES, LANES, 1, lambda builder, a: builder.fneg(a))


_teach(abs, LANES, LANES, 1, named("llvm.fabs"))


for _function, _sign in {
    operator.lt: "<",
    operator.le: "<=",
    operator.gt: ">",
    operator.ge: ">=",
    operator.eq: "==",
}.items():
    _teach(_function, LANES, MASK, 2, lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b))


_teach(operator.and_, MASK, MASK, 2, lambda builder, a, b: builder.and_(a, b))


_teach(operator.or_, MASK, MASK, 2, lambda builder, a, b: builder.or_(a, b))


# Where the second is NaN, the first: so Python's min and max choose.
_teach(min, LANES, LANES, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered("<", b, a), b, a))


_teach(max, LANES, LANES, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered(">", b, a), b, a))
