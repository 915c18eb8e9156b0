"""Compilation with Numba: options, cache, and the choice of function bodies by type.

:func:`kernel` decorates a function that Python calls. :func:`inlined` decorates a formula that kernels call, and
:func:`absorbed` a formula in the innermost loop. :func:`hook` decorates a function with one body for each type, and
:func:`feature` one for what a scene may lack. Only this package and :mod:`ringsweep.numerics` use Numba.
"""

from ringsweep.compile.cache import SOURCES_DIGEST, has_known_source, kernel
from ringsweep.compile.cells import Cells
from ringsweep.compile.dispatch import hook, lacking
from ringsweep.compile.errors import readable_compile_errors
from ringsweep.compile.numba_private import borrowed
from ringsweep.compile.options import absorbed, inlined, specialise
from ringsweep.compile.tuples import (
    add_scaled,
    feature,
    function_from_lines,
    generated,
    map_leaves,
    put,
    replacing,
    stub,
    take,
    unrolled,
)

__all__ = [
    "SOURCES_DIGEST",
    "Cells",
    "absorbed",
    "add_scaled",
    "borrowed",
    "feature",
    "function_from_lines",
    "generated",
    "has_known_source",
    "hook",
    "inlined",
    "kernel",
    "lacking",
    "map_leaves",
    "put",
    "readable_compile_errors",
    "replacing",
    "specialise",
    "stub",
    "take",
    "unrolled",
]
