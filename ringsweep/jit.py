"""Compilation: the one owner of Numba's options, of the cache key and of static dispatch."""

from __future__ import annotations

import hashlib
import inspect
import logging
import os
import pickle
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba import types
from numba._dynfunc import make_function
from numba.core import cgutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering
from numba.extending import intrinsic, overload, register_jitable

from ringsweep.errors import InputError

logger = logging.getLogger("ringsweep")

# Contraction to fused multiply-add is the only liberty taken with IEEE arithmetic: "nnan" and
# "ninf" would delete the checks by which a run is flagged as failed, and "reassoc" would undo the
# care taken over cancellation.
OPTIONS: Any = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    # A second entry point for callers in C, of whom there are none.
    "no_cfunc_wrapper": True,
}


# Functions beneath one, from which on it is left to its caller to optimise all of them: those on the way from the
# innermost formulas to the kernel would else be optimised again at each level, the kernel's own once more.
_LEFT_TO_THE_CALLER = 28


class _Absorbed(JITCodeLibrary):
    """Code of a function that callers absorb: it never becomes machine code of its own."""

    def _optimize_final_module(self) -> None:
        if len(self._beneath()) < _LEFT_TO_THE_CALLER:
            super()._optimize_final_module()

    def _beneath(self) -> set[Any]:
        found = set(self._linking_libraries)
        for library in self._linking_libraries:
            if isinstance(library, _Absorbed):
                found |= library._beneath()
        return found

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _AbsorbedLowering(NativeLowering):
    _name = "absorbed_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _Absorbed(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        state.flags.no_compile = True
        super().run_pass(state)
        made, library = state["cr"], state.library
        # What callers know it by; there is no entry from Python.
        name = make_function(made.fndesc.lookup_module(), made.fndesc.qualname, "", 0, made.env, (library,))
        state.targetctx.insert_user_function(name, made.fndesc, [library])
        state.reload_init.extend(library._reload_init)
        state["cr"] = made._replace(cfunc=name)
        return True


class _Callee(CompilerBase):
    """Numba's own passes, but for the making of machine code: a third less time for a kernel, the same code."""

    def define_pipelines(self) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [
            (_AbsorbedLowering, why) if one is NativeLowering else (one, why) for one, why in passes.passes
        ]
        passes.finalize()
        return [passes]


#: Options of all that is compiled into a kernel.
WITHIN = OPTIONS | {"pipeline_class": _Callee}

#: Files of friction laws that are the user's own, from the environment: they are compiled with the package's.
OWN_LAWS = [Path(name) for name in os.environ.get("RINGSWEEP_LAWS", "").split(os.pathsep) if name]


def _sources_digest() -> str:
    """Digest over every source file of the package, and of laws that are the user's own."""
    digest = hashlib.sha256()
    root = Path(__file__).parent
    for path in sorted(root.rglob("*.py")):
        digest.update(str(path.relative_to(root)).encode())
        digest.update(path.read_bytes())
    for path in OWN_LAWS:
        try:
            digest.update(path.read_bytes())
        except OSError as error:
            raise InputError("RINGSWEEP_LAWS", f"{path} cannot be read: {error.strerror or error}") from error
    return digest.hexdigest()


SOURCES_DIGEST = _sources_digest()


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function lazily, without the interpreter lock, and keep it on disk.

    Numba's cache notices an edit only in the file that holds the function; here the key covers
    all sources of the package, so that an edit in a callee is never missed. Where no directory
    can be written, the function is compiled anew in each process.
    """
    dispatcher = numba.njit(**OPTIONS)(function)
    try:
        dispatcher.enable_caching()
    except RuntimeError:
        return dispatcher
    index = dispatcher._cache._cache_file
    index._source_stamp = (index._source_stamp, SOURCES_DIGEST)
    if OWN_LAWS:
        # Beside what is compiled without them, whose index would be started anew.
        name = f"{index._index_name.removesuffix('.nbi')}-{SOURCES_DIGEST[:12]}"
        index._index_name, index._data_name_pattern = f"{name}.nbi", f"{name}.{{number:d}}.nbc"
        index._index_path = str(Path(index._cache_path) / index._index_name)
    load = index._load_index

    def load_index() -> Any:
        # An index left by other sources may name types that are no more: it is stale, not an error.
        try:
            return load()
        except (AttributeError, ImportError, EOFError, pickle.UnpicklingError):
            return {}

    index._load_index = load_index
    load_overload = dispatcher._cache.load_overload

    def load_or_tell(*arguments: Any) -> Any:
        found = load_overload(*arguments)
        if found is None:
            _tell_of_compilation()
        return found

    dispatcher._cache.load_overload = load_or_tell
    return dispatcher


@cache
def _tell_of_compilation() -> None:
    logger.info("compiling for a kind of scene that is new here: some ten to twenty seconds, once")


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a small formula that callers absorb; it needs no cache entry of its own.

    Called from Python it is the function that it was: an entry from there, through which a whole scene is unpacked,
    takes longer to compile than most formulas, and there would be one for each.
    """
    return register_jitable(**WITHIN)(function)


def absorbed(function: Callable[..., Any]) -> Any:
    """The same, whatever its size: in the innermost loop of a kernel a call would pass its arguments through memory."""
    return register_jitable(**WITHIN, forceinline=True)(function)


def inner_hook(stub: Callable[..., Any]) -> Any:
    """A :func:`hook` whose bodies are :func:`absorbed`."""
    return hook(stub, within=True)


def hook(stub: Callable[..., Any], *, within: bool = False) -> Any:
    """A function whose body is chosen by the type of its first argument.

    `stub` gives name, signature and docstring. Bodies are added by
    ``@name.implements(SomeNamedTuple)``; within a kernel Numba picks the body while compiling, so a
    scene holds the code of the law, drive and model that it names and no other. Called from
    Python it dispatches in the same way.
    """
    bodies: dict[type, Callable[..., Any]] = {}
    names = list(inspect.signature(stub).parameters)

    def choose(first: Any) -> Callable[..., Any]:
        return bodies[type(first)]

    def typed(first: Any) -> Callable[..., Any] | None:
        return bodies.get(getattr(first, "instance_class", type(None)))

    # Numba compares signatures of an overload and its bodies by name: hence generated text.
    arguments = ", ".join(names)
    scope: dict[str, Any] = {"choose": choose, "typed": typed}
    exec(
        f"def {stub.__name__}({arguments}): return choose({names[0]})({arguments})\n"
        f"def overloaded({arguments}): return typed({names[0]})\n",
        scope,
    )
    function = scope[stub.__name__]
    function.__doc__ = stub.__doc__
    function.__module__ = stub.__module__
    overload(function, jit_options=WITHIN | {"forceinline": within})(scope["overloaded"])

    def implements(*classes: type) -> Callable[..., Any]:
        def register(body: Callable[..., Any]) -> Callable[..., Any]:
            if list(inspect.signature(body).parameters) != names:
                raise TypeError(f"{body.__qualname__}: the arguments of {stub.__name__} are ({arguments})")
            for cls in classes:
                bodies[cls] = body
            return body

        return register

    function.implements = implements
    return function


def over_leaves(change: Callable[[Any], Any], nested: Any) -> Any:
    """A nested tuple with each of its leaves changed."""
    if not isinstance(nested, tuple):
        return change(nested)
    leaves = (over_leaves(change, part) for part in nested)
    return type(nested)(*leaves) if hasattr(nested, "_fields") else tuple(leaves)


@intrinsic
def borrowed(typingctx: Any, array: Any) -> Any:
    """The same array without a count of references, for as long as its owner lives.

    Else every call that is handed the array, or a tuple that holds it, counts up and down again, and each of these
    is an atomic operation that costs more than a coefficient of a series.
    """

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        view = context.make_array(array)(context, builder, args[0])
        view.meminfo = cgutils.get_null_value(view.meminfo.type)
        view.parent = cgutils.get_null_value(view.parent.type)
        return view._getvalue()

    return array(array), build


def take(batch: Any, i: Any) -> Any:
    """Cell `i` of a batch: the same nested tuple with each array replaced by its row; in Python several cells too."""
    return over_leaves(lambda leaf: leaf[i], batch)


@overload(take, jit_options=WITHIN)
def _take(batch, i):
    if isinstance(batch, types.Array):
        return (lambda batch, i: batch[i]) if batch.ndim == 1 else (lambda batch, i: borrowed(batch[i]))
    leaves = "".join(f"take(batch[{k}], i), " for k in range(len(batch)))
    scope = {"cls": getattr(batch, "instance_class", None), "take": take}
    exec(f"def row(batch, i): return {'cls' if scope['cls'] else ''}({leaves})", scope)
    return scope["row"]


# ---- states: tuples of floats of any length --------------------------------------------------


def unrolled(function: Callable[..., Any]) -> Any:
    """A function whose body is written out for the length of its first argument, a tuple.

    `function` takes that length, then the names of the arguments; it returns the lines of the body.
    """
    first, *others = list(inspect.signature(function).parameters)[1:]
    names = ", ".join([first, *others])

    def written(length: int) -> Any:
        lines = "\n    ".join(function(length, first, *others))
        scope = dict(function.__globals__)
        exec(f"def body({names}):\n    {lines}", scope)
        return scope["body"]

    scope: dict[str, Any] = {"written": written}
    exec(
        f"def {function.__name__}({names}): return written(len({first}))({names})\n"
        f"def overloaded({names}): return written(len({first}))\n",
        scope,
    )
    found = scope[function.__name__]
    found.__doc__ = function.__doc__
    overload(found, jit_options=WITHIN)(scope["overloaded"])
    return found


def generated(write: Callable[..., Any]) -> Any:
    """A function for kernels alone, whose body is written out for the types of its arguments.

    `write` takes these types under the names of the arguments; it returns the lines of the body, and what they name.
    """
    name, names = write.__name__, ", ".join(inspect.signature(write).parameters)

    def written(*kinds: Any) -> Any:
        lines, scope = write(*kinds)
        exec(f"def body({names}):\n    " + "\n    ".join(lines), scope)
        return scope["body"]

    scope: dict[str, Any] = {"written": written}
    exec(
        f"def {name}({names}): raise TypeError('{name} is for kernels alone')\n"
        f"def overloaded({names}): return written({names})\n",
        scope,
    )
    found = scope[name]
    found.__doc__ = write.__doc__
    overload(found, jit_options=WITHIN)(scope["overloaded"])
    return found


@unrolled
def add_scaled(length, y, factor, k):
    """``y + factor * k``."""
    return ["return (" + "".join(f"y[{i}] + factor * k[{i}], " for i in range(length)) + ")"]


@unrolled
def combine(length, y, weights, rows, count):
    """``y`` and the first `count` of the rows of an array, each times its weight."""
    numbers = range(length)
    return [
        "".join(f"a{i}, " for i in numbers) + "= y",
        "for j in range(count):",
        "    w = weights[j]",
        *(f"    a{i} += w * rows[j, {i}]" for i in numbers),
        "return (" + "".join(f"a{i}, " for i in numbers) + ")",
    ]


@unrolled
def combine_twice(length, y, weights, others, rows, count):
    """:func:`combine` of ``y`` and of zero, with two sets of weights in one pass."""
    numbers = range(length)
    return [
        "".join(f"a{i}, " for i in numbers) + "= y",
        " = ".join(f"b{i}" for i in numbers) + " = 0.0",
        "for j in range(count):",
        "    v, w = weights[j], others[j]",
        *(f"    a{i} += v * rows[j, {i}]; b{i} += w * rows[j, {i}]" for i in numbers),
        "return (" + "".join(f"a{i}, " for i in numbers) + "), (" + "".join(f"b{i}, " for i in numbers) + ")",
    ]


@unrolled
def zero(length, y):
    """A state of zeros."""
    return ["return (" + "0.0, " * length + ")"]


@unrolled
def like(length, y, row):
    """A row of an array as a state of the length of `y`."""
    return ["return (" + "".join(f"row[{i}], " for i in range(length)) + ")"]
