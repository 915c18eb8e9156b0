"""Numba's options for all compiled code, and the decorators of formulas.

A function with ``@inlined`` or ``@absorbed`` is compiled only as a part of a kernel. It may take and return floats,
nested tuples, and arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ringsweep.compile.numba_private import CALLEE_COMPILER, choose_body

# Fused multiply-add ("contract") is the only deviation from IEEE arithmetic. "nnan" and "ninf" would delete the checks
# that find failed runs. "reassoc" would reorder sums that are ordered against cancellation.
#: Options of kernels.
KERNEL_OPTIONS: Any = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    # Nobody calls kernels from C.
    "no_cfunc_wrapper": True,
}

# Options of functions that are compiled into a kernel.
_CALLED_BY_KERNELS = KERNEL_OPTIONS | CALLEE_COMPILER | {"no_cpython_wrapper": True}


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a formula into the kernels that call it.

    In Python it stays a Python function. A compiled entry point for Python would have to unpack a whole scene; for most
    formulas that takes longer to compile than the formula.
    """
    specialise(function, lambda *kinds: function)
    return function


def absorbed(function: Callable[..., Any]) -> Any:
    """Compile a formula into the kernels that call it, and inline it whatever its size.

    For the innermost loop of a kernel, where a call would pass its arguments through memory.
    """
    specialise(function, lambda *kinds: function, absorb=True)
    return function


def specialise(function: Callable[..., Any], choose: Callable[..., Any], *, absorb: bool = False) -> None:
    """Give a function bodies for kernels, chosen by the types of the arguments.

    Parameters
    ----------
    function : callable
        The function that kernels call.
    choose : callable
        Takes the Numba types of the arguments. Returns the body, a function with the same arguments; or None if there
        is no body for these types.
    absorb : bool
        Whether bodies of any size are inlined; see :func:`absorbed`.
    """

    choose_body(function, choose, _CALLED_BY_KERNELS | {"forceinline": absorb})
