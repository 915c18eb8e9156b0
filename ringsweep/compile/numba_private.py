"""Everything that this package uses of Numba's private interfaces, with fallbacks on public ones.

Without the private interfaces kernels take longer to compile, and each process compiles its own. Results are equal bit
for bit. So a release of Numba in which one of these imports fails costs time, not correctness. A release that changes
what lies behind the names may fail while it compiles: `pyproject.toml` has an upper bound.
"""

from __future__ import annotations

import logging
import pickle
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

logger = logging.getLogger("ringsweep")

# A function that calls at least this many others, directly or not, is optimised only as a part of its caller. Else each
# level of calls would optimise the same code again.
_OPTIMISED_BY_CALLER = 28

try:
    from numba._dynfunc import make_function
    from numba.core import cgutils
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import CompilerBase, DefaultPassBuilder
    from numba.core.compiler_machinery import register_pass
    from numba.core.runtime.context import NRTContext
    from numba.core.typed_passes import NativeLowering
    from numba.extending import intrinsic
except ImportError:
    AVAILABLE = False
else:
    AVAILABLE = True


if AVAILABLE:

    class _AbsorbedLibrary(JITCodeLibrary):
        """Code of a function that is compiled into its callers; no machine code is made of the function itself."""

        def _optimize_final_module(self) -> None:
            if len(self._callees()) < _OPTIMISED_BY_CALLER:
                super()._optimize_final_module()

        def _callees(self) -> set[Any]:
            found = set(self._linking_libraries)
            for library in self._linking_libraries:
                if isinstance(library, _AbsorbedLibrary):
                    found |= library._callees()
            return found

        def _finalize_final_module(self) -> None:
            self._finalize_dynamic_globals()
            self._verify_declare_only_symbols()
            self._finalized = True

    @register_pass(mutates_CFG=True, analysis_only=False)
    class _AbsorbedLowering(NativeLowering):
        _name = "absorbed_lowering"

        def run_pass(self, state: Any) -> bool:
            state.library = _AbsorbedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
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

    class _Uncounted(NRTContext):
        """References to arrays are not counted.

        The kernel holds them while its callees run. Each count is a call, and keeps LLVM from holding numbers in
        registers.
        """

        def get_meminfos(self, builder: Any, ty: Any, val: Any) -> list[Any]:
            return []

    class _CalleeCompiler(CompilerBase):
        """Numba's passes, but without machine code for callees: kernels compile in two thirds of the time."""

        def define_pipelines(self) -> list[Any]:
            passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
            passes.passes = [
                (_AbsorbedLowering, why) if one is NativeLowering else (one, why) for one, why in passes.passes
            ]
            passes.finalize()
            context = self.state.targetctx
            context.__dict__["nrt"] = _Uncounted(context, context.enable_nrt)
            return [passes]

    @intrinsic
    def _borrowed(typingctx: Any, array: Any) -> Any:
        """View of an array without a reference count; valid while the array lives.

        Each call with an array, or with a tuple that holds one, increments and decrements the count. Each of these
        atomic operations costs more than a coefficient of a series.
        """

        def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            view = context.make_array(array)(context, builder, args[0])
            view.meminfo = cgutils.get_null_value(view.meminfo.type)
            view.parent = cgutils.get_null_value(view.parent.type)
            return view._getvalue()

        return array(array), build

    borrowed: Any = _borrowed

    #: Options of functions that are compiled into kernels.
    CALLEE_OPTIONS: dict[str, Any] = {"pipeline_class": _CalleeCompiler}

else:
    from numba.extending import register_jitable

    @register_jitable
    def _itself(array):
        return array

    borrowed = _itself
    CALLEE_OPTIONS = {}


def keep_on_disk(dispatcher: Any, digest: str, suffix: str, announce: Callable[[], None]) -> None:
    """Keep the compiled code of a function on disk, under a key that covers the sources of all functions it calls.

    Numba itself notices an edit only in the file of the function. Without Numba's private interfaces, or if no folder
    for the cache is writable, each process compiles the function anew.

    Parameters
    ----------
    dispatcher : Dispatcher
        The result of ``numba.njit``.
    digest : str
        Digest of the sources.
    suffix : str
        Added to the name of the cache's index. Functions with different suffixes do not replace each other.
    announce : callable
        Called before each compilation.
    """
    if not AVAILABLE:
        return
    try:
        dispatcher.enable_caching()
        kept = dispatcher._cache
        index = kept._cache_file
        load, load_overload = index._load_index, kept.load_overload
        index._source_stamp = (index._source_stamp, digest)
        if suffix:
            name = f"{index._index_name.removesuffix('.nbi')}-{suffix}"
            index._index_name, index._data_name_pattern = f"{name}.nbi", f"{name}.{{number:d}}.nbc"
            index._index_path = str(Path(kept._cache_path) / index._index_name)
    except RuntimeError:
        # No folder for the cache is writable.
        return
    except AttributeError:
        _warn_of_no_cache()
        dispatcher._cache = _no_cache()
        return

    def load_index() -> Any:
        # An index of earlier sources may name types that no longer exist: it is stale, not an error.
        try:
            return load()
        except (AttributeError, ImportError, EOFError, pickle.UnpicklingError):
            return {}

    def load_or_announce(*arguments: Any) -> Any:
        found = load_overload(*arguments)
        if found is None:
            announce()
        return found

    index._load_index, kept.load_overload = load_index, load_or_announce


def _no_cache() -> Any:
    from numba.core.caching import NullCache

    return NullCache()


@cache
def _warn_of_no_cache() -> None:
    logger.warning("this version of Numba has another cache: each process compiles its own kernels")
