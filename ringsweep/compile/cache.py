"""Kernels, and the key under which their machine code is kept on disk."""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numba

from ringsweep.compile.numba_private import keep_on_disk
from ringsweep.compile.options import KERNEL_OPTIONS
from ringsweep.errors import InputError

logger = logging.getLogger("ringsweep")

#: Files of the user's own friction laws, from the environment; they are compiled with the package's laws.
OWN_LAWS = [Path(name) for name in os.environ.get("RINGSWEEP_LAWS", "").split(os.pathsep) if name]

# All that decides the bits of a result. An edit elsewhere, in plots say, leaves kernels and results as they are.
_DECIDE_BITS = ("compile", "numerics", "physics", "models", "solvers", "quantities", "runs/cells.py")


def sources_digest(root: Path, own_laws: Iterable[Path] = ()) -> str:
    """Digest of the sources in a folder of the package that decide the bits of a result.

    Parameters
    ----------
    root : Path
        Folder of the package.
    own_laws : iterable of Path
        Files of friction laws that are the user's own.

    Raises
    ------
    InputError
        If a file of own laws cannot be read.
    """
    digest = hashlib.sha256()
    for place in _DECIDE_BITS:
        path = root / place
        for source in [path] if path.suffix else sorted(path.rglob("*.py")):
            digest.update(str(source.relative_to(root)).encode())
            digest.update(source.read_bytes())
    for path in own_laws:
        try:
            digest.update(path.read_bytes())
        except OSError as error:
            raise InputError("RINGSWEEP_LAWS", f"{path} cannot be read: {error.strerror or error}") from error
    return digest.hexdigest()


SOURCES_DIGEST = sources_digest(Path(__file__).parents[1], OWN_LAWS)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function lazily, without the interpreter lock, and keep it on disk.

    The key of the cache covers all sources that decide bits, so that an edit in a callee is never missed.
    """
    dispatcher = numba.njit(**KERNEL_OPTIONS)(function)
    # Without a suffix, kernels compiled with own laws and kernels compiled without would replace each other.
    keep_on_disk(dispatcher, SOURCES_DIGEST, SOURCES_DIGEST[:12] if OWN_LAWS else "", _tell_of_compilation)
    return dispatcher


@cache
def _tell_of_compilation() -> None:
    logger.info("compiling for a kind of scene that is new here: some ten to twenty seconds, once")
