"""Cells of a batch as kernels take them: one block of memory, and references to the cells in it.

A cell holds dozens of numbers. If it were passed by value, Numba would unpack it and pack it again in every call, which
would be half of the code that LLVM has to optimise. A reference is one pointer. In kernels it looks like the tuple:
attributes, indices and unpacking load a number, and a ``NamedTuple`` within it is again a reference.

Functions with the arguments ``context, builder, ...`` write LLVM code; Numba calls them. `offset` is in bytes. Python
makes a :class:`Cells` from a batch; kernels read its cells with ``take(batch, i)``.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, cached_property
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import (
    NativeValue,
    intrinsic,
    lower_builtin,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)

from ringsweep.compile.numba_private import without_count

_WORD = 8
_BYTE, _INTEGER = ir.IntType(8), ir.IntType(64)


class Cells:
    """Cells of a batch in one block of memory, which kernels only read.

    Parameters
    ----------
    batch : nested tuple of ndarray
        First dimension of each array: cells. A later change of a number has no effect on the block.

    Attributes
    ----------
    batch : nested tuple of ndarray
    kind : CellsType
        Numba type of the cells.
    address : int
        Address of the first cell.
    """

    def __init__(self, batch: Any) -> None:
        """Copy the numbers of a batch, and the addresses of its longer arrays, into the block."""
        leaves = [leaf if leaf.ndim == 1 else _with_whole_rows(leaf) for leaf in _leaves(batch)]
        self.batch, self.kind = batch, _cells_type(_layout(batch))
        # The block holds the addresses of these arrays.
        self._arrays = [leaf for leaf in leaves if leaf.ndim > 1]
        self._block = np.empty((len(leaves[0]), sum(leaf.ndim for leaf in leaves)))
        self.address = _address(self._block)
        integers, k = self._block.view(np.int64), 0
        for leaf in leaves:
            if leaf.ndim > 1:
                integers[:, k] = _address(leaf) + leaf.strides[0] * np.arange(len(leaf))
                integers[:, k + 1 : k + leaf.ndim] = leaf.shape[1:]
            elif leaf.dtype.kind == "f":
                self._block[:, k] = leaf
            else:
                integers[:, k] = leaf
            k += leaf.ndim


def _leaves(batch: Any) -> Iterator[Any]:
    """Arrays of a batch, in order."""
    if not isinstance(batch, tuple):
        yield batch
        return
    for part in batch:
        yield from _leaves(part)


def _with_whole_rows(leaf: Any) -> Any:
    """Float array with contiguous rows; a broadcast row (stride 0) is allowed."""
    leaf = np.asarray(leaf, dtype=np.float64)
    return leaf if len(leaf) and leaf[0].flags.c_contiguous else np.ascontiguousarray(leaf)


def _address(array: Any) -> int:
    """Address of the first number of an array."""
    found: int = array.__array_interface__["data"][0]
    return found


def _layout(batch: Any) -> Any:
    """What the type of a cell depends on: classes, and types and dimensions of the arrays."""
    if isinstance(batch, tuple):
        return type(batch), tuple(_layout(part) for part in batch)
    return batch.dtype.kind, batch.ndim - 1


_NUMBERS = {"f": types.float64, "i": types.int64, "b": types.boolean}


@cache
def _cell_type(layout: Any) -> Any:
    """Numba type of a cell that is passed by value."""
    kind, parts = layout
    if isinstance(parts, tuple):
        return types.BaseTuple.from_types([_cell_type(part) for part in parts], kind)
    return without_count(types.Array(types.float64, parts, "C")) if parts else _NUMBERS[kind]


@cache
def _words(kind: Any) -> int:
    """Length of a value in the block."""
    if isinstance(kind, types.BaseTuple):
        parts: list[Any] = list(iter(kind))  # type: ignore[call-overload]
        return sum(_words(part) for part in parts)
    return 1 + kind.ndim if isinstance(kind, types.Array) else 1


# ---- types ------------------------------------------------------------------------------------


class CellsType(types.Type):
    """Numba type of :class:`Cells`: a pointer to the first cell."""

    def __init__(self, cell: Any) -> None:
        """`cell` is the Numba type of a cell."""
        self.cell = cell
        super().__init__(f"cells of {cell}")

    @property
    def key(self) -> Any:
        """What tells types apart: the number that Numba gives a type, since each call hashes that of its cells."""
        return self.cell._code

    @property
    def mangling_args(self) -> Any:
        """Part of the names of functions with such an argument."""
        return "Cells", ()


class Reference(types.BaseNamedTuple):
    """Numba type of a reference to a ``NamedTuple`` in the block.

    Parameters
    ----------
    value : NamedTuple
        Numba type of the tuple by value.
    """

    def __init__(self, value: Any) -> None:
        """Take over the fields of the tuple `value`."""
        self.value, self.fields, self.instance_class, self.count = (
            value,
            value.fields,
            value.instance_class,
            value.count,
        )
        # Functions have names that contain those of their types. A short name saves a tenth of the work of LLVM.
        super().__init__(f"{value.instance_class.__name__}.{value._code}")

    @cached_property
    def types(self) -> tuple[Any, ...]:
        """Types of the fields."""
        return tuple(Reference(part) if isinstance(part, types.BaseNamedTuple) else part for part in self.value)

    @cached_property
    def offsets(self) -> list[int]:
        """Offset of each field, bytes."""
        words = [_words(part) for part in self.value]
        return [_WORD * sum(words[:k]) for k in range(len(words))]

    def __getitem__(self, k: Any) -> Any:
        """Type of field `k`."""
        return self.types[k]

    def __len__(self) -> int:
        """Number of fields."""
        return int(self.count)

    def __iter__(self) -> Iterator[Any]:
        """Types of the fields."""
        return iter(self.types)


register_model(CellsType)(models.OpaqueModel)
register_model(Reference)(models.OpaqueModel)


@typeof_impl.register(Cells)
def _type_of_cells(cells: Any, context: Any) -> Any:
    """Numba type of :class:`Cells` that a kernel is given; Numba calls it."""
    return cells.kind


@cache
def _cells_type(layout: Any) -> Any:
    """Numba type of cells of this kind, made once."""
    return CellsType(_cell_type(layout))


@unbox(CellsType)  # type: ignore[untyped-decorator]
def _unbox_cells(kind: Any, cells: Any, c: Any) -> Any:
    """Address of the first cell, for a kernel; Numba calls it."""
    number = c.pyapi.object_getattr_string(cells, "address")
    address = c.pyapi.long_as_voidptr(number)
    c.pyapi.decref(number)
    return NativeValue(address)


# ---- code -------------------------------------------------------------------------------------


@intrinsic
def _cell_at(typingctx, cells, i):
    """Reference to cell `i`."""

    def lower(context, builder, sig, args):
        size = ir.Constant(_INTEGER, _WORD * _words(cells.cell))
        return builder.gep(args[0], [builder.mul(args[1], size)])

    return Reference(cells.cell)(cells, types.intp), lower


cell_at: Any = _cell_at


def _load(context: Any, builder: Any, kind: Any, pointer: Any, offset: int) -> Any:
    """Value of the type `kind` at a place in the block."""
    if isinstance(kind, Reference):
        return _shifted(builder, pointer, offset)
    if isinstance(kind, types.BaseTuple):
        values = []
        for part in iter(kind):  # type: ignore[call-overload]
            values.append(_load(context, builder, part, pointer, offset))
            offset += _WORD * _words(part)
        return context.make_tuple(builder, kind, values)
    if isinstance(kind, types.Array):
        return _load_array(context, builder, kind, pointer, offset)
    if kind == types.boolean:
        return builder.trunc(_load_word(builder, _INTEGER, pointer, offset), ir.IntType(1))
    return _load_word(builder, context.get_value_type(kind), pointer, offset)


def _shifted(builder: Any, pointer: Any, offset: int) -> Any:
    """Pointer that is `offset` bytes farther."""
    return builder.gep(pointer, [ir.Constant(_INTEGER, offset)]) if offset else pointer


def _load_word(builder: Any, kind: Any, pointer: Any, offset: int) -> Any:
    """Number or address that is `offset` bytes behind `pointer`, of the LLVM type `kind`."""
    value = builder.load(builder.bitcast(_shifted(builder, pointer, offset), kind.as_pointer()), align=_WORD)
    # Nothing writes to the block while a kernel runs: a number that was loaded once need not be loaded again.
    value.set_metadata("invariant.load", builder.module.add_metadata([]))
    return value


def _load_array(context: Any, builder: Any, kind: Any, pointer: Any, offset: int) -> Any:
    """View of an array of which the block holds the address and the shape."""
    view = context.make_array(kind)(context, builder)
    lengths = [_load_word(builder, _INTEGER, pointer, offset + _WORD * (k + 1)) for k in range(kind.ndim)]
    strides: list[Any] = []
    size = ir.Constant(_INTEGER, _WORD)
    for length in reversed(lengths):
        strides.insert(0, size)
        size = builder.mul(size, length)
    view.data = _load_word(builder, view.data.type, pointer, offset)
    view.itemsize = ir.Constant(view.itemsize.type, _WORD)
    view.nitems = builder.sdiv(size, ir.Constant(_INTEGER, _WORD))
    view.shape = context.make_tuple(builder, types.UniTuple(types.intp, kind.ndim), lengths)
    view.strides = context.make_tuple(builder, types.UniTuple(types.intp, kind.ndim), strides)
    view.meminfo = ir.Constant(view.meminfo.type, None)
    view.parent = ir.Constant(view.parent.type, None)
    return view._getvalue()


@lower_getattr_generic(Reference)  # type: ignore[untyped-decorator]
def _attribute(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    """Field of a reference by its name; Numba calls it."""
    return _field(context, builder, kind, value, kind.fields.index(name))


def _field(context: Any, builder: Any, kind: Any, value: Any, k: int) -> Any:
    """Field `k` of a reference."""
    return _load(context, builder, kind.types[k], value, kind.offsets[k])


@lower_builtin("static_getitem", Reference, types.IntegerLiteral)  # type: ignore[untyped-decorator]
@lower_builtin("static_getitem", Reference, types.SliceLiteral)  # type: ignore[untyped-decorator]
def _item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Field of a reference by an index, or a tuple of fields by a slice; Numba calls it."""
    kind, (value, index) = sig.args[0], args
    if isinstance(index, slice):
        values = [_field(context, builder, kind, value, k) for k in range(len(kind))[index]]
        return context.make_tuple(builder, sig.return_type, values)
    return _field(context, builder, kind, value, range(len(kind))[index])
