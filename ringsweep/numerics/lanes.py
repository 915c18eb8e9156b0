"""Vector lanes: a Numba type that holds several numbers side by side, and its arithmetic.

``rk4`` puts one number of each of several runs side by side; power series put their terms side by side, see
:mod:`ringsweep.numerics.terms`. The processor computes 32 doubles by four instructions of 512 bits. They are
independent, so it need not wait for one result before it computes the next: a step is one long chain of results.

Functions whose arguments are ``context, builder, sig, args`` write LLVM code; Numba calls them.
"""

from __future__ import annotations

import operator
from typing import Any, ClassVar

import llvmlite.ir as ir
from llvmlite.binding import get_host_cpu_features
from numba import extending
from numba.core import cgutils, types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin, lower_cast, models, register_model

#: Numba's decorator. Its own type says that a call passes the typing context, too.
intrinsic: Any = extending.intrinsic

#: Number of runs side by side. Without AVX-512 registers hold fewer numbers. Results do not depend on it.
WIDTH = 32 if get_host_cpu_features().get("avx512f") else 16

_DOUBLE, _WORD = ir.DoubleType(), ir.IntType(64)

VECTOR, WORDS = (ir.VectorType(kind, WIDTH) for kind in (_DOUBLE, _WORD))


class _Vector(types.Type):
    """Numba type of `width` numbers or truth values side by side."""

    element: ClassVar[Any]

    def __init__(self, width: int) -> None:
        """`width` is the number of lanes."""
        self.width = width
        super().__init__(f"{type(self).__name__}({width})")


class Lanes(_Vector):
    """Numba type of `width` doubles; for runs side by side, one for each run."""

    element = _DOUBLE


class Mask(_Vector):
    """Numba type of `width` truth values."""

    element = ir.IntType(1)


LANES, MASK = Lanes(WIDTH), Mask(WIDTH)


@register_model(Lanes)
@register_model(Mask)
class _VectorModel(models.PrimitiveModel):
    """Memory of a vector: an LLVM vector."""

    def __init__(self, dmm: Any, fe_type: Any) -> None:
        """Numba calls it for each type of lanes."""
        super().__init__(dmm, fe_type, ir.VectorType(fe_type.element, fe_type.width))


# ---- arithmetic ------------------------------------------------------------------------------


def spread_scalar(builder: Any, value: Any, kind: ir.VectorType) -> Any:
    """LLVM vector of type `kind` with `value` in every lane."""
    first = builder.insert_element(ir.Constant(kind, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    everywhere = ir.Constant(ir.VectorType(ir.IntType(32), kind.count), [0] * kind.count)
    return builder.shuffle_vector(first, ir.Constant(kind, ir.Undefined), everywhere)


@lower_cast(types.Float, Lanes)
@lower_cast(types.Integer, Lanes)
def _from_number(context, builder, fromty, toty, value):
    """Cast a number to lanes that all hold it."""
    return spread_scalar(builder, context.cast(builder, value, fromty, types.float64), context.get_value_type(toty))


@lower_cast(types.Boolean, Mask)
def _from_boolean(context, builder, fromty, toty, value):
    """Cast a truth value to a mask that holds it in all lanes."""
    bit = builder.trunc(value, ir.IntType(1)) if value.type.width > 1 else value
    return spread_scalar(builder, bit, context.get_value_type(toty))


def _define(function: Any, argument: Any, result: Any, arity: int, instruction: Any) -> None:
    """Define `function` for `arity` arguments of the class `argument`; a plain number among them is spread.

    `result` is the class of the result. `instruction` takes an LLVM builder and the arguments as LLVM values.
    """
    plain = types.Boolean if argument is Mask else types.Number

    @infer_global(function)
    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            vector = next((a for a in args if isinstance(a, argument)), None)
            if len(args) == arity and vector and all(a == vector or isinstance(a, plain) for a in args):
                return signature(result(vector.width), *[vector] * arity)
            return None

    @lower_builtin(function, *[argument] * arity)
    def lower(context, builder, sig, args):
        return instruction(builder, *args)


def llvm_function(name: str) -> Any:
    """Builder of calls of an LLVM intrinsic with Lanes as arguments and result."""

    def instruction(builder: Any, *args: Any) -> Any:
        vector = args[0].type
        kind = ir.FunctionType(vector, [vector] * len(args))
        name_of_type = f"{name}.v{vector.count}f64"
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, name_of_type), args)

    return instruction


_define(operator.add, Lanes, Lanes, 2, lambda builder, a, b: builder.fadd(a, b))
_define(operator.sub, Lanes, Lanes, 2, lambda builder, a, b: builder.fsub(a, b))
_define(operator.mul, Lanes, Lanes, 2, lambda builder, a, b: builder.fmul(a, b))
_define(operator.truediv, Lanes, Lanes, 2, lambda builder, a, b: builder.fdiv(a, b))
_define(operator.neg, Lanes, Lanes, 1, lambda builder, a: builder.fneg(a))
_define(abs, Lanes, Lanes, 1, llvm_function("llvm.fabs"))


for _function, _sign in {
    operator.lt: "<",
    operator.le: "<=",
    operator.gt: ">",
    operator.ge: ">=",
    operator.eq: "==",
}.items():
    _define(_function, Lanes, Mask, 2, lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b))


_define(operator.and_, Mask, Mask, 2, lambda builder, a, b: builder.and_(a, b))
_define(operator.or_, Mask, Mask, 2, lambda builder, a, b: builder.or_(a, b))


# If the second argument is NaN the first one is taken, as by Python's min and max.
_define(min, Lanes, Lanes, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered("<", b, a), b, a))
_define(max, Lanes, Lanes, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered(">", b, a), b, a))


# ---- memory ----------------------------------------------------------------------------------


def _pointer_to_lanes(context: Any, builder: Any, sig: Any, args: Any, lanes: Lanes) -> Any:
    """Pointer to the lanes that begin at an index of an array of floats."""
    memory = context.make_array(sig.args[0])(context, builder, args[0])
    vector = ir.VectorType(_DOUBLE, lanes.width)
    return builder.bitcast(builder.gep(memory.data, [args[1]]), vector.as_pointer())


def loader(lanes: Lanes) -> Any:
    """Function for kernels of an array and an index: Lanes from consecutive doubles, from this index on."""

    @intrinsic
    def load(typingctx, memory, at):
        def lower(context, builder, sig, args):
            return builder.load(_pointer_to_lanes(context, builder, sig, args, lanes), align=8)

        return lanes(memory, types.intp), lower

    return load


def storer(lanes: Lanes) -> Any:
    """Function for kernels that stores Lanes where :func:`loader` reads them."""

    @intrinsic
    def store(typingctx, memory, at, value):
        def lower(context, builder, sig, args):
            builder.store(args[2], _pointer_to_lanes(context, builder, sig, args, lanes), align=8)
            return context.get_dummy_value()

        return types.none(memory, types.intp, lanes), lower

    return store
