"""Nested tuples in memory, one by one or side by side in vector lanes."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import llvmlite.ir as ir
import numpy as np
from numba.core import types
from numba.extending import intrinsic

from ringsweep.compile import generated, hook, map_leaves
from ringsweep.numerics.lanes import LANES, VECTOR, WIDTH, spread_scalar


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
    return builder.bitcast(builder.gep(memory.data, [args[1]]), VECTOR.as_pointer())


@intrinsic
def align_stack(typingctx):
    """Have the stack of the function that is being compiled aligned to 64 bytes.

    LLVM spills vectors to where the stack happens to lie, across two cache lines each, unless a variable of the
    function asks for more.
    """

    def lower(context, builder, sig, args):
        with builder.goto_entry_block():
            variable = builder.alloca(VECTOR)
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
    return LANES(types.float64), lambda context, builder, sig, args: spread_scalar(builder, args[0], VECTOR)


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
    return map_leaves(
        lambda leaf: leaf if leaf.ndim == 1 else tuple(np.ascontiguousarray(column) for column in leaf.T), batch
    )
