"""Functions of nested tuples in kernels: their code is generated for the types or the length of an argument.

A function that is *generated* is given the Numba types of its arguments when a kernel is compiled. It returns the
lines of its body, or the function to use.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection
from functools import cache, partial
from math import inf, nan
from typing import Any

from numba import types

from ringsweep.compile.cells import CellsType, cell_at
from ringsweep.compile.numba_private import borrowed
from ringsweep.compile.options import specialise


def function_from_lines(names: str, lines: list[str], scope: dict[str, Any]) -> Any:
    """Function with arguments `names` and a body of `lines`; the body may use the names in `scope`."""
    scope = dict(scope)
    exec(f"def body({names}):\n    " + "\n    ".join(lines), scope)
    return scope["body"]


def stub(function: Callable[..., Any], names: list[str], call: Any, choose: Any, *, absorb: bool = False) -> Any:
    """Function that passes its arguments, `names`, to `call`; with name and docstring of `function`.

    Kernels call the body that `choose` finds for the types of the arguments, see :func:`specialise`.
    """

    def found(*arguments: Any) -> Any:
        return call(*arguments)

    found.__name__, found.__doc__, found.__module__ = function.__name__, function.__doc__, function.__module__
    parameters = [inspect.Parameter(name, inspect.Parameter.POSITIONAL_OR_KEYWORD) for name in names]
    found.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    specialise(found, choose, absorb=absorb)
    return found


def unrolled(write: Callable[..., Any]) -> Any:
    """Make a function whose body is generated for the length of its first argument, a tuple.

    Parameters
    ----------
    write : callable
        Takes the length, then the names of the arguments; returns the lines of the body.
    """
    names = list(inspect.signature(write).parameters)[1:]

    def body(first: Any) -> Any:
        return function_from_lines(", ".join(names), write(len(first), *names), write.__globals__)

    return stub(write, names, lambda *arguments: body(arguments[0])(*arguments), lambda *kinds: body(kinds[0]))


def generated(write: Callable[..., Any] | None = None, *, absorb: bool = False) -> Any:
    """Make a function for kernels whose body is generated for the types of its arguments.

    Parameters
    ----------
    write : callable
        Takes the Numba types of the arguments, under the names of the arguments. Returns either the lines of the body
        and a dictionary of the names that they use, or a function with the same arguments.
    absorb : bool
        Whether bodies of any size are inlined; see :func:`ringsweep.compile.absorbed`.
    """
    if write is None:
        return partial(generated, absorb=absorb)
    names = list(inspect.signature(write).parameters)

    def refuse(*arguments: Any) -> Any:
        raise TypeError(f"{write.__name__} can only be called in a kernel")

    def body(*kinds: Any) -> Any:
        made = write(*kinds)
        return function_from_lines(", ".join(names), *made) if isinstance(made, tuple) else made

    return stub(write, names, refuse, body, absorb=absorb)


def feature(otherwise: str, *, of: type | Collection[type] = (), absorb: bool = False) -> Any:
    """Compile a formula for a feature: a part of a scene or of a record that may be missing.

    Where it is missing, kernels contain nothing of the formula.

    Parameters
    ----------
    otherwise : str
        Result where the feature is missing: an expression of the arguments, and of names of the module.
    of : type or collection of type
        Types of the first argument that have the feature. By default an empty tuple stands in place of one that has
        not.
    absorb : bool
        Whether the formula is inlined whatever its size; see :func:`ringsweep.compile.absorbed`.
    """
    having = (of,) if isinstance(of, type) else tuple(of)

    def decorate(body: Callable[..., Any]) -> Any:
        names = list(inspect.signature(body).parameters)

        @cache
        def without() -> Any:
            # By now the module has all its names. What stands for the absence of a feature is no part of it.
            scope = body.__globals__ | {"inf": inf, "nan": nan, "__name__": __name__}
            return function_from_lines(", ".join(names), [f"return {otherwise}"], scope)

        def chosen(first: type | None) -> Any:
            return body if (first in having if having else first is not tuple) else without()

        def typed(*kinds: Any) -> Any:
            return chosen(tuple if kinds[0] == types.Tuple(()) else getattr(kinds[0], "instance_class", None))

        return stub(body, names, lambda *arguments: chosen(type(arguments[0]))(*arguments), typed, absorb=absorb)

    return decorate


def map_leaves(change: Callable[[Any], Any], nested: Any) -> Any:
    """Apply `change` to each leaf of a nested tuple."""
    if not isinstance(nested, tuple):
        return change(nested)
    leaves = (map_leaves(change, part) for part in nested)
    return type(nested)(*leaves) if hasattr(nested, "_fields") else tuple(leaves)


def take(batch: Any, i: Any) -> Any:
    """Cell `i` of a batch.

    Parameters
    ----------
    batch : nested tuple of ndarray
        First dimension of each array: cells. In kernels also :class:`ringsweep.compile.Cells`: then the result is a
        reference.
    i : int
        Number of the cell. In Python also a slice, or an array of numbers: then the result is a batch.

    Returns
    -------
    nested tuple
        `batch` with each array replaced by its row `i`. An array that stands in several places of the batch is still
        one: kernels write to those that hold values between two knots of a drive.
    """
    rows: dict[int, Any] = {}
    return map_leaves(lambda leaf: rows[id(leaf)] if id(leaf) in rows else rows.setdefault(id(leaf), leaf[i]), batch)


def _take_one(batch: Any, i: Any) -> Any:
    """Body of :func:`take` for the type of a batch: a cell of each array."""
    if isinstance(batch, CellsType):
        return lambda batch, i: cell_at(batch, i)
    if isinstance(batch, types.Array):
        return (lambda batch, i: batch[i]) if batch.ndim == 1 else (lambda batch, i: borrowed(batch[i]))
    leaves = "".join(f"take(batch[{k}], i), " for k in range(len(batch)))
    cls = getattr(batch, "instance_class", None)
    return function_from_lines("batch, i", [f"return {'cls' if cls else ''}({leaves})"], {"cls": cls, "take": take})


specialise(take, _take_one)


def replacing(*names: str) -> Any:
    """Make a function that takes a NamedTuple and values of the fields `names`, and returns it with these values."""
    arguments = ", ".join(("whole", *names))
    in_python = f"return whole._replace({', '.join(f'{name}={name}' for name in names)})"

    def body(whole: Any, *values: Any) -> Any:
        fields = [name if name in names else f"whole.{name}" for name in whole.fields]
        return function_from_lines(arguments, [f"return cls({', '.join(fields)})"], {"cls": whole.instance_class})

    replaced = function_from_lines(arguments, [in_python], {})
    specialise(replaced, body, absorb=True)
    return replaced


@unrolled
def put(length, arrays, i, numbers):
    """Store each of a tuple of numbers at index `i` of one of a tuple of arrays."""
    return [f"arrays[{k}][i] = numbers[{k}]" for k in range(length)]


@unrolled
def add_scaled(length, y, factor, k):
    """``y + factor * k`` for tuples `y` and `k` of equal length and a number `factor`."""
    return ["return (" + "".join(f"y[{i}] + factor * k[{i}], " for i in range(length)) + ")"]
