"""Everything that this package uses of Numba's private interfaces: with them kernels compile in a third of the time.

A release of Numba may change what lies behind the names: `pyproject.toml` has an upper bound.

Methods of classes that derive from a class of Numba are called by Numba, and replace its own method of that name.
What follows after an upgrade of Numba: run all tests; if a name is gone, look at Numba's own method.
"""

from __future__ import annotations

import hashlib
import logging
import operator
import pickle
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from copy import copy
from functools import cache, cached_property
from pathlib import Path
from time import time
from types import CodeType
from typing import Any, ClassVar

import numba
from llvmlite import binding as llvm
from numba._dynfunc import make_function
from numba.core import cgutils, types
from numba.core.caching import IndexDataCacheFile, NullCache
from numba.core.codegen import CodeLibrary, JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags, StateDict
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.cpu import CPUContext
from numba.core.datamodel.models import ArrayModel
from numba.core.runtime.context import NRTContext
from numba.core.typed_passes import InlineOverloads, IRLegalization, NativeLowering, NopythonRewrites
from numba.core.typing.context import Context
from numba.core.typing.templates import AbstractTemplate, infer, infer_global
from numba.core.untyped_passes import InlineClosureLikes, IRProcessing, WithLifting
from numba.extending import intrinsic, register_model

logger = logging.getLogger("ringsweep")


# ---- LLVM: each function is linked and optimised once, as a part of its kernel ---------------


# Linkage of functions that several modules may define, of Numba's own and of callees: LLVM keeps unused ones of these.
_SHARED = llvm.Linkage.linkonce_odr, llvm.Linkage.weak_odr


class _CalleeLibrary(JITCodeLibrary):
    """Code of a function that kernels call: its text, until a kernel is made."""

    def __init__(self, codegen: Any, name: str) -> None:
        """Numba calls it; no code is there yet."""
        CodeLibrary.__init__(self, codegen, name)
        self._linking_libraries: list[Any] = []
        self._text, self._shared_module = "", None
        # Numba 0.63 makes it in the class that is passed over here.
        self._reload_init: set[Any] = set()

    def add_ir_module(self, ir_module: Any) -> None:
        """Keep the text of a function; Numba would compile it."""
        self._text = cgutils.normalize_ir_text(str(ir_module))

    def finalize(self) -> None:
        """Take over from callees what must be initialised when the code is loaded."""
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._finalized = True

    def module(self) -> Any:
        """The code as a new module of LLVM, whose functions another module may define again."""
        found = llvm.parse_assembly(self._text)
        for function in found.functions:
            if function.linkage == llvm.Linkage.external and not function.is_declaration:
                function.linkage = llvm.Linkage.weak_odr
        return found

    def _get_module_for_linking(self) -> Any:
        """Module with all callees, for Numba's own functions."""
        # Kernels do not come here, but functions of Numba's own that call a function of the package.
        if self._shared_module is None:
            self._shared_module = self.module()
            _link_all(self._shared_module, self._linking_libraries)
        return self._shared_module


class _KernelLibrary(JITCodeLibrary):
    """Code of a kernel with all functions that it calls."""

    def finalize(self) -> None:
        """Link each callee once, and make all functions but the kernel's own private to it."""
        module = self._final_module
        own = {function.name for function in module.functions if not function.is_declaration}
        _link_all(module, self._linking_libraries)
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._linking_libraries = []
        # LLVM inlines a function of any size at its only call, and drops arguments without use, if it knows that
        # there are no calls from elsewhere.
        for function in module.functions:
            if function.linkage in _SHARED and function.name not in own:
                function.linkage = llvm.Linkage.internal
        super().finalize()

    def _optimize_final_module(self) -> None:
        """Optimise once, without Numba's cheap passes before."""
        # Numba's cheap passes before these serve to remove reference counts, which kernels hardly have.
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)


def _link_all(module: Any, libraries: list[Any]) -> None:
    """Link libraries, and all libraries that they call, into a module: each of them once."""
    done: set[Any] = set()
    waiting, small, others = list(libraries), deque[Any](), []
    while waiting:
        library = waiting.pop()
        if library in done:
            continue
        done.add(library)
        if isinstance(library, _CalleeLibrary):
            small.append(library.module())
            waiting.extend(library._linking_libraries)
        else:
            others.append(library)
    # The time to link two modules grows with the sizes of both: two at a time, as in a tournament.
    while len(small) > 1:
        small.append(small.popleft())
        small[-1].link_in(small.popleft())
    for whole in small:
        module.link_in(whole)
    for library in others:
        module.link_in(library._get_module_for_linking(), preserve=True)


@register_pass(mutates_CFG=True, analysis_only=False)
class _KernelLowering(NativeLowering):
    """Numba's pass that writes the code of a kernel."""

    _name = "kernel_lowering"

    def run_pass(self, state: Any) -> bool:
        """Write the code into a :class:`_KernelLibrary`."""
        state.library = _KernelLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


@register_pass(mutates_CFG=True, analysis_only=False)
class _CalleeLowering(NativeLowering):
    """Numba's pass that writes the code of a function which kernels call, but does not compile it."""

    _name = "callee_lowering"

    def run_pass(self, state: Any) -> bool:
        """Write the code into a :class:`_CalleeLibrary`, and give Numba an object by which callers find it."""
        state.library = _CalleeLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        state.flags.no_compile = True
        super().run_pass(state)
        made, library = state["cr"], state.library
        # Callers find the function by this object; Python cannot call it.
        name = make_function(made.fndesc.lookup_module(), made.fndesc.qualname, "", 0, made.env, (library,))
        state.targetctx.insert_user_function(name, made.fndesc, [library])
        state.reload_init.extend(library._reload_init)
        state["cr"] = made._replace(cfunc=name)
        return True


# ---- lowering ---------------------------------------------------------------------------------

# By LLVM type: size, bytes.
_sizes: dict[Any, int] = {}


class _ReferenceCounts(NRTContext):
    """Numba's reference counts, without code that takes apart tuples of numbers in search of arrays."""

    def get_meminfos(self, builder: Any, ty: Any, val: Any) -> Any:
        """Reference counts in a value; none are looked for in a tuple of numbers."""
        if not _holds_arrays(self._context.data_model_manager, ty):
            return []
        return super().get_meminfos(builder, ty, val)


@cache
def _holds_arrays(models: Any, kind: Any) -> bool:
    """Whether a value of a Numba type has a reference count in it."""
    return bool(models[kind].contains_nrt_meminfo())


@register_pass(mutates_CFG=True, analysis_only=False)
class _ArrayReleases(IRLegalization):
    """Instructions at the end of the life of variables, in functions that have arrays with reference counts."""

    _name = "array_releases"

    def run_pass(self, state: Any) -> bool:
        """Do nothing in functions without reference counts."""
        models = state.targetctx.data_model_manager
        return any(_holds_arrays(models, kind) for kind in state.typemap.values()) and bool(super().run_pass(state))


class _Target(CPUContext):
    """Numba's target with :class:`_ReferenceCounts`."""

    def get_abi_sizeof(self, ty: Any) -> int:
        """Size of an LLVM type, bytes: LLVM tells it of a text that it has to read."""
        if ty not in _sizes:
            _sizes[ty] = super().get_abi_sizeof(ty)
        return _sizes[ty]

    @cached_property
    def nrt(self) -> Any:
        """Numba's interface to reference counts."""
        return _ReferenceCounts(self, self.enable_nrt)


# ---- typing -----------------------------------------------------------------------------------

# By function and types of the arguments: the function, and its signature.
_signatures: dict[Any, Any] = {}


class _Typing(Context):
    """Numba's typing with a memory of signatures. For each operation Numba tries dozens of overloads."""

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """Signature of a call, remembered by function and types of the arguments."""
        if kws or not (type(func) is types.Function or func in _OPERATORS):
            return super().resolve_function_type(func, args, kws)
        key = id(func), tuple(args)
        if key not in _signatures:
            signature = super().resolve_function_type(func, args, kws)
            if signature is None:
                return None
            # The function is kept, so that no other object gets its id.
            _signatures[key] = func, signature
        return _signatures[key][1]

    def resolve_value_type(self, val: Any) -> Any:
        """Type of a global; operators remember their signatures."""
        found = super().resolve_value_type(val)
        return _Operator(found.templates) if type(found) is types.Function and val in _OPERATORS else found


# Operators whose signature Numba looks for again when it writes their code.
_OPERATORS = {one for name, one in vars(operator).items() if not name.startswith("_")}


class _Operator(types.Function):
    """Numba type of an operator, whose signatures are remembered."""

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """Signature of an operation, remembered by types of the arguments."""
        key = id(self), tuple(args)
        if key not in _signatures:
            _signatures[key] = self, super().get_call_type(context, args, kws)
        return _signatures[key][1]


@cache
def _typing(context: Any) -> Any:
    """Numba's context of typing, as :class:`_Typing`. Both share their contents."""
    found = copy(context)
    found.__class__ = _Typing
    return found


def choose_body(function: Callable[..., Any], choose: Callable[..., Any], options: Any) -> None:
    """Give a function bodies for kernels, like ``numba.extending.overload``.

    Numba's own decorator compiles a body again for callers with other options, and compares signatures and options
    in each call.

    Parameters
    ----------
    function, choose : callable
        As in :func:`ringsweep.compile.options.specialise`.
    options : dict
        Options of ``numba.njit``.
    """
    # By body: its compiler. By types of the arguments: the signature. By types of all parameters: compiled code.
    compilers: dict[Any, Any] = {}
    signatures: dict[Any, Any] = {}
    compiled: dict[Any, Any] = {}

    class Template(AbstractTemplate):
        """How Numba finds signature and code of a call."""

        key = function

        def generic(self, args: Any, kws: Any) -> Any:
            args = tuple(args)
            if args not in signatures:
                body = None if kws else choose(*args)
                if body is None:
                    return None
                if body not in compilers:
                    compilers[body] = numba.njit(**options)(body)
                pysig, parameters = compilers[body].fold_argument_types(args, {})
                compilers[body].compile(parameters)
                made = compilers[body].overloads[parameters]
                compiled[parameters] = made.entry_point
                signatures[args] = made.signature.replace(pysig=pysig)
            return signatures[args]

        def get_impl_key(self, sig: Any) -> Any:
            return compiled[sig.args]

    infer(Template)
    infer_global(function, types.Function(Template))


# ---- passes -----------------------------------------------------------------------------------


class _Passes(PassManager):
    """Passes without a record of each of them: it prints the types of all arguments."""

    def _runPass(self, index: int, one: Any, state: Any) -> None:
        """Run one pass, and record nothing."""
        one.analysis = self._analysis
        one.run_initialization(state)
        one.run_pass(state)
        one.run_finalizer(state)


# Kernels have no blocks ``with``, and no loops over whole arrays to fuse. Nothing reads how long variables live before
# later passes compute it again.
_ALWAYS = IRProcessing, WithLifting, NopythonRewrites
_NEEDLESS = _ALWAYS, (*_ALWAYS, InlineClosureLikes, InlineOverloads)

_INLINED_BY_NUMBA = {"reduce", "bool"}


class _KernelCompiler(CompilerBase):
    """Numba's passes, without those that kernels do not need. Kernels compile in half the time."""

    lowering: ClassVar[type] = _KernelLowering

    def __init__(self, typingctx: Any, *arguments: Any) -> None:
        """Let Numba use this package's typing and target."""
        super().__init__(_typing(typingctx), *arguments)
        self.state.targetctx.__class__ = _Target
        self.state.targetctx.typing_context = self.state.typingctx

    def define_pipelines(self) -> list[Any]:
        """Passes for a function: fewer if it calls nothing that Numba must inline."""
        code = self.state.func_id.func.__code__
        closures = any(isinstance(constant, CodeType) for constant in code.co_consts)
        return [self._passes(not closures and _INLINED_BY_NUMBA.isdisjoint(code.co_names))]

    @classmethod
    @cache
    def _passes(cls, plain: bool) -> Any:
        """Numba's passes, without those that are not needed; a `plain` function calls nothing that Numba inlines."""
        whole = DefaultPassBuilder.define_nopython_pipeline(StateDict(flags=Flags(), func_ir=None))
        passes, own = _Passes(whole.pipeline_name), {NativeLowering: cls.lowering, IRLegalization: _ArrayReleases}
        for one, why in whole.passes:
            if one not in _NEEDLESS[plain]:
                passes.add_pass(own.get(one, one), why)
        passes.finalize()
        return passes


class _CalleeCompiler(_KernelCompiler):
    """As :class:`_KernelCompiler`, for a function that kernels call."""

    lowering = _CalleeLowering


class _Borrowed(types.Array):
    """Numba type of an array without a reference count."""

    def copy(self, *arguments: Any, **changes: Any) -> Any:
        """The same with changes; Numba makes types of views by it."""
        return without_count(super().copy(*arguments, **changes))


def without_count(array: Any) -> Any:
    """Numba type of an array that :func:`borrowed` returns."""
    return _Borrowed(array.dtype, array.ndim, array.layout, readonly=not array.mutable, aligned=array.aligned)


@register_model(_Borrowed)
class _BorrowedModel(ArrayModel):
    """Memory of a borrowed array: that of an array whose count nobody looks at."""

    def contains_nrt_meminfo(self) -> bool:
        """A borrowed array has no count."""
        return False


@intrinsic
def _borrowed(typingctx: Any, array: Any) -> Any:
    """View of an array without a reference count; valid while the array lives.

    Each call with an array, or with a tuple that holds one, increments and decrements the count. Each of these
    atomic operations costs more than a coefficient of a series, and the code for them takes time to compile.
    """

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        view = context.make_array(array)(context, builder, args[0])
        view.meminfo = cgutils.get_null_value(view.meminfo.type)
        view.parent = cgutils.get_null_value(view.parent.type)
        return view._getvalue()

    return without_count(array)(array), build


borrowed: Any = _borrowed

# ---- compiled code on disk --------------------------------------------------------------------


class _NamedFiles(IndexDataCacheFile):
    """One file for each compiled kernel, whose name is a digest of all that determines the code.

    These are the sources, the version of Numba, and Numba's key: function, types of the arguments, processor and
    its features. A file begins with a digest of its content, and holds the key too: two types can have one name.
    """

    def _path(self, key: Any) -> Path:
        """File of a kernel: its function, a stamp of the sources, and a digest of Numba's key.

        Other sources and another version of Numba have other files, so no old code is ever loaded.
        """
        name = hashlib.sha256(repr((self._version, self._index_name, key)).encode()).hexdigest()
        return Path(self._cache_path, f"{self._index_name.partition('-')[0]}-{self._source_stamp}-{name[:32]}.nbc")

    def save(self, key: Any, data: Any) -> None:
        """Write a kernel, and remove those of other sources that are older than :data:`_KEPT`."""
        body = self._dump((self._index_name, key, data))
        with self._open_for_write(self._path(key)) as file:
            file.write(hashlib.sha256(body).digest() + body)
        for old in Path(self._cache_path).glob("*.nb[ci]"):
            # Of other sources; another process may remove it at the same time.
            with suppress(OSError):
                if f"-{self._source_stamp}-" not in old.name and time() - old.stat().st_mtime > _KEPT:
                    old.unlink()

    def load(self, key: Any) -> Any:
        """Data of a kernel; None if there is no intact file with exactly this key."""
        try:
            content = self._path(key).read_bytes()
            body = content[_DIGEST:]
            if hashlib.sha256(body).digest() != content[:_DIGEST]:
                return None
            *found, data = pickle.loads(body)
        except (OSError, AttributeError, ImportError):
            # It is not there, belongs to another user, or names types that this process does not have.
            return None
        return data if found == [self._index_name, key] else None


_DIGEST = hashlib.sha256().digest_size

# Seconds for which compiled code of other sources is kept.
_KEPT = 86_400.0

#: Further options of kernels, and of functions that are compiled into kernels.
KERNEL_COMPILER: dict[str, Any] = {"pipeline_class": _KernelCompiler}
CALLEE_COMPILER: dict[str, Any] = {"pipeline_class": _CalleeCompiler}


def keep_on_disk(dispatcher: Any, digest: str, announce: Callable[[], None]) -> None:
    """Keep the compiled code of a function on disk, under a name that covers the sources of all functions it calls.

    Numba itself notices an edit only in the file of the function, and trusts what the files of its cache hold. If no
    folder for the cache is writable, each process compiles the function anew.

    Parameters
    ----------
    dispatcher : Dispatcher
        The result of ``numba.njit``.
    digest : str
        Digest of the sources.
    announce : callable
        Called before each compilation.
    """
    problem = ""
    try:
        dispatcher.enable_caching()
        kept = dispatcher._cache
        kept._cache_file = _NamedFiles(kept._cache_path, kept._cache_file._index_name, digest[:16])
    except RuntimeError:
        kept = dispatcher._cache = NullCache()
        problem = "no folder for it is writable: NUMBA_CACHE_DIR can name one"
    load_overload, save_overload = kept.load_overload, kept.save_overload

    def load_or_announce(*arguments: Any) -> Any:
        found = load_overload(*arguments)
        if found is None:
            announce()
            if problem:
                _warn_of_no_cache(problem)
        return found

    def save_or_warn(*arguments: Any) -> None:
        try:
            save_overload(*arguments)
        except OSError as error:
            _warn_of_no_cache(f"{kept._cache_path}: {error.strerror or error}")

    kept.load_overload, kept.save_overload = load_or_announce, save_or_warn


@cache
def _warn_of_no_cache(why: str) -> None:
    """Warn once for each reason."""
    logger.warning("compiled code cannot be kept (%s): each process compiles its own", why)
