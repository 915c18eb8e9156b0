"""Options of all compiled code, and the decorators of formulas."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from numba.extending import overload, register_jitable

from ringsweep.compile.numba_private import CALLEE_OPTIONS

# Contraction to fused multiply-add is the only liberty taken with IEEE arithmetic. "nnan" and "ninf" would delete the
# checks by which a run is flagged as failed, and "reassoc" would undo the care taken over cancellation.
#: Options of kernels.
KERNEL_OPTIONS: Any = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    # A second entry point for callers in C, of whom there are none.
    "no_cfunc_wrapper": True,
}

#: Options of all that is compiled into a kernel.
_WITHIN = KERNEL_OPTIONS | CALLEE_OPTIONS


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a formula into its callers; it needs no cache entry of its own.

    Called from Python it stays the Python function. An entry from Python, through which a whole scene is unpacked,
    takes longer to compile than most formulas, and there would be one for each.
    """
    return register_jitable(**_WITHIN)(function)


def absorbed(function: Callable[..., Any]) -> Any:
    """Compile a formula of any size into its callers, as the innermost loop of a kernel needs it.

    There a call would pass its arguments through memory.
    """
    return register_jitable(**_WITHIN, forceinline=True)(function)


def specialise(function: Callable[..., Any], choose: Callable[..., Any], *, absorb: bool = False) -> None:
    """Give a function bodies for kernels, which `choose` picks by the types of the arguments.

    Parameters
    ----------
    function : callable
        What kernels call.
    choose : callable
        Takes the Numba types of the arguments; returns a function with the same arguments, or None if there is no
        body for these types.
    absorb : bool
        Whether bodies of any size are inlined; see :func:`absorbed`.
    """

    def typed(*kinds: Any) -> Any:
        return choose(*kinds)

    # Numba compares the signatures of an overload and of its bodies, which have no annotations.
    plain = [
        inspect.Parameter(name, inspect.Parameter.POSITIONAL_OR_KEYWORD)
        for name in inspect.signature(function).parameters
    ]
    typed.__signature__ = inspect.Signature(plain)  # type: ignore[attr-defined]
    overload(function, jit_options=_WITHIN | {"forceinline": absorb})(typed)
