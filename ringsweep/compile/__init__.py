"""Compilation: the one place that sets Numba's options, keeps its cache and chooses bodies by type.

Kernels are decorated with :func:`kernel`; formulas with :func:`inlined` or, in the innermost loop, :func:`absorbed`;
functions with one body for each type with :func:`hook`. Nothing outside this package and :mod:`ringsweep.numerics`
touches Numba.
"""

from ringsweep.compile.cache import SOURCES_DIGEST, kernel
from ringsweep.compile.dispatch import hook, lacking
from ringsweep.compile.options import KERNEL_OPTIONS, absorbed, inlined, specialise
from ringsweep.compile.tuples import add_scaled, borrowed, generated, map_leaves, take, unrolled, written

__all__ = [
    "KERNEL_OPTIONS",
    "SOURCES_DIGEST",
    "absorbed",
    "add_scaled",
    "borrowed",
    "generated",
    "hook",
    "inlined",
    "kernel",
    "lacking",
    "map_leaves",
    "specialise",
    "take",
    "unrolled",
    "written",
]
