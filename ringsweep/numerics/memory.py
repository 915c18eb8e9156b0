"""Nested tuples of numbers in arrays: one run, or several runs side by side in vector lanes.

A tuple may also hold arrays that all runs share. They are not stored: runs take those of another tuple of the type.

Number k of a tuple is at ``at + k * stride``. ``rk4`` keeps its runs so; records use :func:`select_all`.
"""

from __future__ import annotations

import itertools
from typing import Any

import llvmlite.ir as ir
import numpy as np
from numba.core import types
from numba.extending import intrinsic

from ringsweep.compile import function_from_lines, generated, map_leaves, specialise
from ringsweep.numerics.functions import select, spread
from ringsweep.numerics.lanes import LANES, VECTOR, WIDTH, loader, storer


def _numbers(kind: Any, name: str) -> list[tuple[str, Any]]:
    """``(text, type)`` of each number of a nested tuple called `name`, in order."""
    if isinstance(kind, types.BaseTuple):
        parts: list[Any] = list(iter(kind))  # type: ignore[call-overload]
        return [number for k, part in enumerate(parts) for number in _numbers(part, f"{name}[{k}]")]
    return [] if isinstance(kind, types.Array) else [(name, kind)]


@generated
def size_of(nested):
    """Number of the numbers in a nested tuple."""
    return [f"return {len(_numbers(nested, 'nested'))}"], {}


_load, _store = loader(LANES), storer(LANES)


@intrinsic
def align_stack(typingctx):
    """Align the stack of the calling function to 64 bytes.

    Otherwise vectors that LLVM spills to the stack may lie across two cache lines each.
    """

    def lower(context, builder, sig, args):
        with builder.goto_entry_block():
            variable = builder.alloca(VECTOR)
        variable.align = 64
        # Empty assembly code, so that LLVM does not remove the variable.
        builder.asm(ir.FunctionType(ir.VoidType(), [variable.type]), "", "r", [variable], side_effect=True)
        return context.get_dummy_value()

    return types.none(), lower


@generated
def write(memory, at, stride, nested):
    """Store the numbers of a nested tuple in an array, from index `at` on and `stride` apart."""
    lines = ["pass"]
    for k, (name, kind) in enumerate(_numbers(nested, "nested")):
        place = f"at + {k} * stride"
        lines.append(f"store(memory, {place}, {name})" if kind == LANES else f"memory[{place}] = {name}")
    return lines, {"store": _store}


def _rebuilt(like: Any, number: Any) -> tuple[str, dict[str, Any]]:
    """Source of a nested tuple of the type `like`, with the classes that it names.

    The source of the k-th number is ``number(type, k)``.
    """
    classes: dict[str, Any] = {}
    count = itertools.count()

    def visit(kind: Any, place: str) -> str:
        if isinstance(kind, types.Array):
            return place
        if not isinstance(kind, types.BaseTuple):
            return str(number(kind, next(count)))
        cls = getattr(kind, "instance_class", None)
        name = "" if cls is None else cls.__name__
        classes[name] = cls
        parts: list[Any] = list(iter(kind))  # type: ignore[call-overload]
        return name + "(" + "".join(f"{visit(part, f'{place}[{k}]')}, " for k, part in enumerate(parts)) + ")"

    return visit(like, "like"), classes


@generated
def read(memory, at, stride, like):
    """Nested tuple of the type of `like`, from an array in which :func:`write` stored it."""
    forms = {types.Float: "memory[{}]", types.Integer: "int(memory[{}])", types.Boolean: "memory[{}] != 0.0"}

    def number(kind: Any, k: int) -> str:
        form = next(form for family, form in forms.items() if isinstance(kind, family))
        return form.format(f"at + {k} * stride")

    text, scope = _rebuilt(like, number)
    return [f"return {text}"], scope


@generated
def read_lanes(memory, at, like):
    """Nested tuple of the type of `like`, but of Lanes, from an array where several such tuples stand side by side."""
    text, scope = _rebuilt(like, lambda kind, k: f"load(memory, at + {k * WIDTH})")
    return [f"return {text}"], scope | {"load": _load}


@generated
def conform(nested, like):
    """Nested tuple in which a number becomes Lanes wherever `like` has Lanes."""
    numbers = _numbers(nested, "nested")

    def fitting(kind: Any, k: int) -> str:
        name, given = numbers[k]
        return f"spread({name})" if kind == LANES and given != LANES else name

    text, scope = _rebuilt(like, fitting)
    return [f"return {text}"], scope | {"spread": spread}


def select_all(condition, a, b):
    """Nested tuple `a` where the condition holds, else `b`, which is of the same shape; for floats and Lanes."""
    if not isinstance(a, tuple):
        return select(condition, a, b)
    return type(a)(*(select_all(condition, one, other) for one, other in zip(a, b, strict=True)))


def _select_all_in_kernel(condition: Any, a: Any, b: Any) -> Any:
    """Body of :func:`select_all` for the types of its arguments."""
    others = [name for name, _ in _numbers(b, "b")]
    ones = [name for name, _ in _numbers(a, "a")]
    text, scope = _rebuilt(a, lambda kind, k: f"select(condition, {ones[k]}, {others[k]})")
    return function_from_lines("condition, a, b", [f"return {text}"], scope | {"select": select})


specialise(select_all, _select_all_in_kernel, absorb=True)


def side_by_side(batch: Any) -> Any:
    """Batch in which each array of shape ``(cells, n)`` is replaced by a tuple of n arrays of shape ``(cells,)``.

    Arrays with more dimensions stay: all cells have equal ones.
    """
    return map_leaves(
        lambda leaf: leaf if leaf.ndim != 2 else tuple(np.ascontiguousarray(column) for column in leaf.T), batch
    )
