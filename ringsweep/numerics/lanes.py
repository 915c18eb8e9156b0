"""Vector lanes: a Numba type that holds one number for each of several runs, and its arithmetic.

The processor computes 32 doubles by four instructions of 512 bits. They are independent, so it need not wait for one
result before it computes the next: a step is one long chain of results.
"""

from __future__ import annotations

import operator
from typing import Any

import llvmlite.ir as ir
from llvmlite.binding import get_host_cpu_features
from numba.core import cgutils, types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin, lower_cast, models, register_model

#: Number of runs side by side. Without AVX-512 registers hold fewer numbers. Results do not depend on it.
WIDTH = 32 if get_host_cpu_features().get("avx512f") else 16

_DOUBLE, _WORD = ir.DoubleType(), ir.IntType(64)

VECTOR, WORDS, _BITS = (ir.VectorType(kind, WIDTH) for kind in (_DOUBLE, _WORD, ir.IntType(1)))


class Lanes(types.Type):
    """Numba type of :data:`WIDTH` doubles, one for each run."""

    def __init__(self) -> None:
        super().__init__("Lanes")


class Mask(types.Type):
    """Numba type of :data:`WIDTH` truth values, one for each run."""

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
    """LLVM vector of type `kind` with `value` in every lane."""
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


def _define(function: Any, argument: Any, result: Any, arity: int, instruction: Any) -> None:
    """Define `function` for `arity` arguments of type `argument`; a plain number among them is spread over the lanes.

    `instruction` takes an LLVM builder and the arguments as LLVM values.
    """
    plain = types.Boolean if argument is MASK else types.Number

    @infer_global(function)
    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if len(args) == arity and argument in args and all(a == argument or isinstance(a, plain) for a in args):
                return signature(result, *[argument] * arity)
            return None

    @lower_builtin(function, *[argument] * arity)
    def lower(context, builder, sig, args):
        return instruction(builder, *args)


def llvm_function(name: str) -> Any:
    """Builder of calls of an LLVM intrinsic with Lanes as arguments and result."""

    def instruction(builder: Any, *args: Any) -> Any:
        kind = ir.FunctionType(VECTOR, [VECTOR] * len(args))
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"{name}.v{WIDTH}f64"), args)

    return instruction


_define(operator.add, LANES, LANES, 2, lambda builder, a, b: builder.fadd(a, b))
_define(operator.sub, LANES, LANES, 2, lambda builder, a, b: builder.fsub(a, b))
_define(operator.mul, LANES, LANES, 2, lambda builder, a, b: builder.fmul(a, b))
_define(operator.truediv, LANES, LANES, 2, lambda builder, a, b: builder.fdiv(a, b))
_define(operator.neg, LANES, LANES, 1, lambda builder, a: builder.fneg(a))
_define(abs, LANES, LANES, 1, llvm_function("llvm.fabs"))


for _function, _sign in {
    operator.lt: "<",
    operator.le: "<=",
    operator.gt: ">",
    operator.ge: ">=",
    operator.eq: "==",
}.items():
    _define(_function, LANES, MASK, 2, lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b))


_define(operator.and_, MASK, MASK, 2, lambda builder, a, b: builder.and_(a, b))
_define(operator.or_, MASK, MASK, 2, lambda builder, a, b: builder.or_(a, b))


# If the second argument is NaN the first one is taken, as by Python's min and max.
_define(min, LANES, LANES, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered("<", b, a), b, a))
_define(max, LANES, LANES, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered(">", b, a), b, a))
