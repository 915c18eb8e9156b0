"""Kernels, and the key of their machine code in the cache on disk.

The key covers the text of all sources that kernels are made of: an edit of one of them compiles all kernels anew, so
a wrong result never comes from old code.
"""

from __future__ import annotations

import gc
import hashlib
import logging
import os
import sys
from collections.abc import Callable, Iterable
from functools import cache, wraps
from pathlib import Path
from typing import Any

import numba

from ringsweep.compile.numba_private import KERNEL_COMPILER, keep_on_disk
from ringsweep.compile.options import KERNEL_OPTIONS
from ringsweep.errors import InputError

logger = logging.getLogger("ringsweep")

if getattr(numba.config, "DISABLE_JIT", 0):
    raise InputError("NUMBA_DISABLE_JIT", "is set, but ringsweep runs compiled code only: unset it")

#: The user's own files (friction laws, drives, models, methods), from the environment variable RINGSWEEP_LAWS.
OWN_FILES = [Path(name) for name in os.environ.get("RINGSWEEP_LAWS", "").split(os.pathsep) if name]

# The sources that determine machine code, and those that determine results. An edit elsewhere, such as in plots, keeps
# the cached kernels and the results valid.
_ROOMS = ("compile", "numerics", "physics", "models", "solvers")
IN_KERNELS = (*_ROOMS, "quantities/flags.py", "quantities/parameters.py")
IN_RESULTS = (*_ROOMS, "quantities", "runs/cells.py", "statistics.py", "config/uncertain.py", "runs/probabilities.py")


def sources_digest(root: Path, own_files: Iterable[Path] = (), places: Iterable[str] = IN_RESULTS) -> str:
    """Digest of the sources that determine results, or of those in other places.

    Parameters
    ----------
    root : Path
        Folder of the package.
    own_files : iterable of Path
        The user's own files, see :data:`OWN_FILES`.
    places : iterable of str
        Folders and files, relative to `root`.

    Returns
    -------
    str
        SHA-256 digest in hexadecimal digits.

    Raises
    ------
    InputError
        If one of the user's own files cannot be read.
    """
    digest = hashlib.sha256()
    for place in places:
        path = root / place
        for source in [path] if path.suffix else sorted(path.rglob("*.py")):
            digest.update(str(source.relative_to(root)).encode())
            digest.update(source.read_bytes())
    for path in own_files:
        if path.exists() and not path.is_file():
            # A pipe would be waited for.
            raise InputError("RINGSWEEP_LAWS", f"{path} is not a file")
        try:
            digest.update(path.read_bytes())
        except OSError as error:
            raise InputError("RINGSWEEP_LAWS", f"{path} cannot be read: {error.strerror or error}") from error
    return digest.hexdigest()


def has_known_source(cls: type) -> bool:
    """Whether the key of the cache covers the file of a class: in the package, or named by ``RINGSWEEP_LAWS``."""
    if cls.__module__.split(".")[0] == __name__.split(".")[0]:
        return True
    file = getattr(sys.modules.get(cls.__module__), "__file__", None)
    return file is not None and Path(file).resolve() in {path.resolve() for path in OWN_FILES}


SOURCES_DIGEST = sources_digest(Path(__file__).parents[1], OWN_FILES)
_KERNELS_DIGEST = sources_digest(Path(__file__).parents[1], OWN_FILES, IN_KERNELS)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function when it is first called, and keep its machine code on disk.

    It runs without the global interpreter lock. The key of the cache covers all sources that determine machine code, so
    an edit in a called function compiles the kernel anew.
    """
    dispatcher = numba.njit(**KERNEL_OPTIONS, **KERNEL_COMPILER)(function)
    dispatcher.compile = _without_collection(dispatcher.compile)
    keep_on_disk(dispatcher, _KERNELS_DIGEST, _announce_compilation)
    return dispatcher


def _without_collection(compiled: Callable[..., Any]) -> Callable[..., Any]:
    """Make a function that runs without the garbage collector: it takes a sixth of the time of a compilation."""

    @wraps(compiled)
    def function(*arguments: Any) -> Any:
        was_enabled = gc.isenabled()
        gc.disable()
        try:
            return compiled(*arguments)
        finally:
            if was_enabled:
                gc.enable()

    return function


@cache
def _announce_compilation() -> None:
    """Tell once in a process that a kernel is compiled."""
    logger.info("compiling for a new kind of scene: this takes 5 to 15 seconds, once")
