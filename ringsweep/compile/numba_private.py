"""All that this package uses of Numba's private interfaces, each with a fallback on public ones.

Without them kernels take longer to compile, and are compiled anew in each process. Their results are the same bit for
bit. A release of Numba that moves one of these names costs time, not correctness.
"""

from __future__ import annotations

import logging
import pickle
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

logger = logging.getLogger("ringsweep")

# A function that calls this many others, directly or not, leaves the optimisation of all of them to its caller. Else
# each level between the innermost formulas and the kernel would optimise the same code again.
_LEFT_TO_THE_CALLER = 28

try:
    from numba._dynfunc import make_function
    from numba.core import cgutils
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import CompilerBase, DefaultPassBuilder
    from numba.core.compiler_machinery import register_pass
    from numba.core.typed_passes import NativeLowering
    from numba.extending import intrinsic
except ImportError:
    AVAILABLE = False
else:
    AVAILABLE = True


if AVAILABLE:

    class _AbsorbedLibrary(JITCodeLibrary):
        """Code of a function that its callers absorb: it never becomes machine code of its own."""

        def _optimize_final_module(self) -> None:
            if len(self._beneath()) < _LEFT_TO_THE_CALLER:
                super()._optimize_final_module()

        def _beneath(self) -> set[Any]:
            found = set(self._linking_libraries)
            for library in self._linking_libraries:
                if isinstance(library, _AbsorbedLibrary):
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
            state.library = _AbsorbedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.enable_object_caching()
            state.flags.no_compile = True
            super().run_pass(state)
            made, library = state["cr"], state.library
            # Callers know the function by this name; it cannot be called from Python.
            name = make_function(made.fndesc.lookup_module(), made.fndesc.qualname, "", 0, made.env, (library,))
            state.targetctx.insert_user_function(name, made.fndesc, [library])
            state.reload_init.extend(library._reload_init)
            state["cr"] = made._replace(cfunc=name)
            return True

    class _CalleeCompiler(CompilerBase):
        """Numba's own passes without machine code: a kernel compiles in two thirds of the time, to the same code."""

        def define_pipelines(self) -> list[Any]:
            passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
            passes.passes = [
                (_AbsorbedLowering, why) if one is NativeLowering else (one, why) for one, why in passes.passes
            ]
            passes.finalize()
            return [passes]

    @intrinsic
    def _borrowed(typingctx: Any, array: Any) -> Any:
        """The same array without a count of references, for as long as its owner lives.

        Every call that is given an array, or a tuple that holds one, counts up and down again. Each of these atomic
        operations costs more than a coefficient of a series.
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


def keep_on_disk(dispatcher: Any, digest: str, suffix: str, tell: Callable[[], None]) -> None:
    """Keep the compiled code of a function on disk, under a key that covers more sources than its own file.

    Numba notices an edit only in the file that holds the function. Without its private interfaces, or where no folder
    can be written, the function is compiled anew in each process.

    Parameters
    ----------
    dispatcher : Dispatcher
        What ``numba.njit`` returned.
    digest : str
        Digest of all sources that decide the code.
    suffix : str
        Added to the name of the index; functions of different suffixes do not replace each other.
    tell : callable
        Called before a compilation.
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
        # No folder can be written.
        return
    except AttributeError:
        _tell_of_no_cache()
        dispatcher._cache = _no_cache()
        return

    def load_index() -> Any:
        # An index left by other sources may name types that do not exist any more: it is stale, not an error.
        try:
            return load()
        except (AttributeError, ImportError, EOFError, pickle.UnpicklingError):
            return {}

    def load_or_tell(*arguments: Any) -> Any:
        found = load_overload(*arguments)
        if found is None:
            tell()
        return found

    index._load_index, kept.load_overload = load_index, load_or_tell


def _no_cache() -> Any:
    from numba.core.caching import NullCache

    return NullCache()


@cache
def _tell_of_no_cache() -> None:
    logger.warning("this version of Numba keeps compiled kernels in another way: each process compiles its own")
