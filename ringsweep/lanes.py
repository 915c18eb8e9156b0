"""Sixteen runs in one value: a vector type for kernels, and functions that take it or a plain float alike.

A formula written with the functions of this module, and without ``if``, serves both one run (a float, with the
mathematical functions of the C library) and sixteen side by side (``Lanes``, one run in each lane, with the polynomials
below). The processor takes a value of the latter kind in two instructions of 512 bits, or in more and narrower ones:
while one part waits for its result the other is worked on.

.. math::

    e^{-x} = 2^n e^r,\\ |r| \\le \\tfrac12 \\ln 2; \\qquad
    \\sin(x), \\cos(x) \\text{ from those of } r = x - n\\tfrac{\\pi}{2},\\ |r| \\le \\tfrac{\\pi}{4}

with :math:`n` the nearest integer. They are within 6e-16 of the C library's, sine and cosine up to arguments of 1e6.
What a run is never depends on its neighbours: branches spare work that no lane feels, and change no lane.
"""

from __future__ import annotations

import inspect
import itertools
import math
import operator
from typing import Any, NamedTuple

import llvmlite.ir as ir
import numpy as np
from numba.core import cgutils, types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, overload, register_model

from ringsweep.jit import WITHIN, generated, hook, over_leaves

#: Runs in one value.
WIDTH = 16

_DOUBLE, _WORD = ir.DoubleType(), ir.IntType(64)
_VECTOR, _WORDS, _BITS = (ir.VectorType(kind, WIDTH) for kind in (_DOUBLE, _WORD, ir.IntType(1)))


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
        super().__init__(dmm, fe_type, _VECTOR)


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _BITS)


# ---- arithmetic ------------------------------------------------------------------------------


def _spread(builder: Any, value: Any, kind: ir.VectorType) -> Any:
    """A vector with `value` in every lane."""
    first = builder.insert_element(ir.Constant(kind, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    everywhere = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(first, ir.Constant(kind, ir.Undefined), everywhere)


@lower_cast(types.Float, LANES)
@lower_cast(types.Integer, LANES)
def _from_number(context, builder, fromty, toty, value):
    return _spread(builder, context.cast(builder, value, fromty, types.float64), _VECTOR)


@lower_cast(types.Boolean, MASK)
def _from_boolean(context, builder, fromty, toty, value):
    return _spread(builder, builder.trunc(value, ir.IntType(1)) if value.type.width > 1 else value, _BITS)


def _teach(function: Any, taken: Any, given: Any, arity: int, instruction: Any) -> None:
    """Give `function` a meaning for arguments of type `taken`, plain ones among them spread over the lanes."""
    alike = types.Boolean if taken is MASK else types.Number

    @infer_global(function)
    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if len(args) == arity and taken in args and all(a == taken or isinstance(a, alike) for a in args):
                return signature(given, *[taken] * arity)
            return None

    @lower_builtin(function, *[taken] * arity)
    def lower(context, builder, sig, args):
        return instruction(builder, *args)


def _named(name: str) -> Any:
    def instruction(builder: Any, *args: Any) -> Any:
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * len(args))
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"{name}.v{WIDTH}f64"), args)

    return instruction


_teach(operator.add, LANES, LANES, 2, lambda builder, a, b: builder.fadd(a, b))
_teach(operator.sub, LANES, LANES, 2, lambda builder, a, b: builder.fsub(a, b))
_teach(operator.mul, LANES, LANES, 2, lambda builder, a, b: builder.fmul(a, b))
_teach(operator.truediv, LANES, LANES, 2, lambda builder, a, b: builder.fdiv(a, b))
_teach(operator.neg, LANES, LANES, 1, lambda builder, a: builder.fneg(a))
_teach(abs, LANES, LANES, 1, _named("llvm.fabs"))
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


# ---- functions of a float or of Lanes --------------------------------------------------------


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
    instruction = _named(name)

    @intrinsic
    def function(typingctx, x):
        return LANES(LANES), lambda context, builder, sig, args: instruction(builder, *args)

    return function


_floor, _sqrt = _unary("llvm.floor"), _unary("llvm.sqrt")
_copy = _named("llvm.copysign")


@intrinsic
def _copysign(typingctx, x, sign):
    return LANES(LANES, LANES), lambda context, builder, sig, args: _copy(builder, *args)


@intrinsic
def _times_power_of_two(typingctx, x, shifted):
    """``x * 2**n``, where `shifted` is n + 1.5 * 2**52: its last bits hold n, which is added to the exponent of x."""

    def lower(context, builder, sig, args):
        x, shifted = (builder.bitcast(a, _WORDS) for a in args)
        return builder.bitcast(builder.add(x, builder.shl(shifted, ir.Constant(_WORDS, [52] * WIDTH))), _VECTOR)

    return LANES(LANES, LANES), lower


@intrinsic
def _bit(typingctx, shifted, place):
    """Whether the bit of that place is set in n, where `shifted` is n + 1.5 * 2**52."""
    if not isinstance(place, types.IntegerLiteral):
        return None
    bit = 1 << place.literal_value

    def lower(context, builder, sig, args):
        word = builder.and_(builder.bitcast(args[0], _WORDS), ir.Constant(_WORDS, [bit] * WIDTH))
        return builder.icmp_unsigned("!=", word, ir.Constant(_WORDS, [0] * WIDTH))

    return MASK(LANES, place), lower


_SHIFT = 1.5 * 2.0**52
_PER_LN2, _PER_HALF_PI = 1.0 / math.log(2.0), 2.0 / math.pi
_LN2 = math.log(2.0)
# A sum of which the first two terms end in zeros, so that their products with whole numbers are exact.
_HALF_PI_1, _HALF_PI_2, _HALF_PI_3 = map(
    float.fromhex, ("0x1.921fb54400000p+0", "0x1.0b4611a600000p-34", "0x1.3198a2e037073p-69")
)


def either(scalar: Any) -> Any:
    """A function of numbers whose body for Lanes is given by the decorator ``@either(scalar)``."""

    def register(lanes: Any) -> Any:
        names = ", ".join(inspect.signature(scalar).parameters)
        scope: dict[str, Any] = {"choose": lambda *kinds: lanes if LANES in kinds or MASK in kinds else scalar}
        exec(f"def overloaded({names}): return choose({names})", scope)
        overload(scalar, jit_options=WITHIN)(scope["overloaded"])
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


# ---- nested tuples in memory -----------------------------------------------------------------


def _numbers(kind: Any, name: str) -> list[tuple[str, Any]]:
    """How the numbers in a nested tuple of that name are reached, in order, and their types."""
    if isinstance(kind, types.BaseTuple):
        parts: list[Any] = list(iter(kind))  # type: ignore[call-overload]
        return [number for k, part in enumerate(parts) for number in _numbers(part, f"{name}[{k}]")]
    return [(name, kind)]


@generated
def size_of(nested):
    """How many numbers a nested tuple holds."""
    return [f"return {len(_numbers(nested, 'nested'))}"], {}


@intrinsic
def _load(typingctx, memory, at):
    """Lanes from consecutive doubles of an array."""

    def lower(context, builder, sig, args):
        return builder.load(_place(context, builder, sig, args), align=8)

    return LANES(memory, at), lower


@intrinsic
def _store(typingctx, memory, at, value):
    def lower(context, builder, sig, args):
        builder.store(args[2], _place(context, builder, sig, args), align=8)
        return context.get_dummy_value()

    return types.none(memory, at, LANES), lower


def _place(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    memory = context.make_array(sig.args[0])(context, builder, args[0])
    return builder.bitcast(builder.gep(memory.data, [args[1]]), _VECTOR.as_pointer())


@intrinsic
def align_stack(typingctx):
    """Have the stack of the function that is being compiled aligned to 64 bytes.

    LLVM spills vectors to where the stack happens to lie, across two cache lines each, unless a variable of the
    function asks for more.
    """

    def lower(context, builder, sig, args):
        with builder.goto_entry_block():
            variable = builder.alloca(_VECTOR)
        variable.align = 64
        # Nothing is done with it, but LLVM is not told so.
        builder.asm(ir.FunctionType(ir.VoidType(), [variable.type]), "", "r", [variable], side_effect=True)
        return context.get_dummy_value()

    return types.none(), lower


@generated
def write(memory, at, stride, nested):
    """Store the numbers of a nested tuple from index `at` of an array on, `stride` apart."""
    lines = ["pass"]
    for k, (name, kind) in enumerate(_numbers(nested, "nested")):
        place = f"at + {k} * stride"
        lines.append(f"store(memory, {place}, {name})" if kind == LANES else f"memory[{place}] = {name}")
    return lines, {"store": _store}


def _rebuilt(like: Any, number: Any) -> tuple[str, dict[str, Any]]:
    """Text of a nested tuple of the type `like`, its k-th number ``number(type, k)``, and the classes that it names."""
    classes: dict[str, Any] = {}
    count = itertools.count()

    def visit(kind: Any) -> str:
        if not isinstance(kind, types.BaseTuple):
            return str(number(kind, next(count)))
        cls = getattr(kind, "instance_class", None)
        name = "" if cls is None else cls.__name__
        classes[name] = cls
        parts: list[Any] = list(iter(kind))  # type: ignore[call-overload]
        return name + "(" + "".join(f"{visit(part)}, " for part in parts) + ")"

    return visit(like), classes


@generated
def read(memory, at, stride, like):
    """A nested tuple of the type of `like` from where :func:`write` stored one."""
    forms = {types.Float: "memory[{}]", types.Integer: "int(memory[{}])", types.Boolean: "memory[{}] != 0.0"}

    def number(kind: Any, k: int) -> str:
        form = next(form for family, form in forms.items() if isinstance(kind, family))
        return form.format(f"at + {k} * stride")

    text, scope = _rebuilt(like, number)
    return [f"return {text}"], scope


@generated
def read_lanes(memory, at, like):
    """The same from where tuples stand side by side, with Lanes in place of the numbers of `like`."""
    text, scope = _rebuilt(like, lambda kind, k: f"load(memory, at + {k * WIDTH})")
    return [f"return {text}"], scope | {"load": _load}


@intrinsic
def _broadcast(typingctx, x):
    return LANES(types.float64), lambda context, builder, sig, args: _spread(builder, args[0], _VECTOR)


@generated
def conform(nested, like):
    """The nested tuple with a number spread over the lanes wherever `like` has Lanes."""
    numbers = _numbers(nested, "nested")

    def spread(kind: Any, k: int) -> str:
        name, given = numbers[k]
        return f"broadcast({name})" if kind == LANES and given != LANES else name

    text, scope = _rebuilt(like, spread)
    return [f"return {text}"], scope | {"broadcast": _broadcast}


# ---- runs one by one, or several side by side ------------------------------------------------


class Single(NamedTuple):
    """One run in a value, a float."""


class Several(NamedTuple):
    """Several runs in a value, Lanes."""


@hook
def width(kind):
    """Runs in a value."""


@width.implements(Single)
def _one(kind):
    return 1


@width.implements(Several)
def _several(kind):
    return WIDTH


@hook
def gather(kind, memory, at, like):
    """A nested tuple from index `at` of an array on, where each number of the runs in a value stands side by side."""


@gather.implements(Single)
def _gather_one(kind, memory, at, like):
    return read(memory, at, 1, like)


@gather.implements(Several)
def _gather_several(kind, memory, at, like):
    return read_lanes(memory, at, like)


def side_by_side(batch: Any) -> Any:
    """A batch in which each array of shape ``(cells, n)`` is a tuple of n arrays: every leaf is one number a cell."""
    return over_leaves(
        lambda leaf: leaf if leaf.ndim == 1 else tuple(np.ascontiguousarray(column) for column in leaf.T), batch
    )
