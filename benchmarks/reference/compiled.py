"""Decorators of the functions that Numba compiles, and a copy that compiles fast.

Numba compiles a function once more for each literal argument. So constants that are arguments are integers of NumPy.
"""

from numba import njit

_OPTIONS = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True}

#: A function that Python calls.
kernel = njit(**_OPTIONS)

#: A function that only compiled code calls. An entry for Python would have to unpack a whole scene; for most of them
#: that takes longer to compile than the function.
inner = njit(**_OPTIONS, no_cpython_wrapper=True)


@inner
def copy(a, b):
    """Write the vector a to b. Numba's own assignment takes seconds to compile, since it words an error of shapes."""
    for i in range(a.size):
        b[i] = a[i]
