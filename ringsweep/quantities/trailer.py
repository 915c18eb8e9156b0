"""Result files are opened here: damage, and what would take all memory, is told before HDF5 sees the file.

A seal stands behind the end of a file: a mark, and the BLAKE2b digest of all bytes before it. On some damaged files
HDF5 loops for ever or crashes. Programs that read NetCDF ignore bytes behind the end; HDF5 removes them when a program
opens the file to change it.
"""

from __future__ import annotations

import hashlib
import logging
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, BinaryIO

import netCDF4
import numpy as np

from ringsweep.errors import InputError

logger = logging.getLogger("ringsweep")

#: Largest number of cells of a sweep. With 24 variables each they take some ten gigabytes on a disk.
MAX_CELLS = 100_000_000

_MARK = b"\nringsweep seal\n\0"
_DIGEST = 32
_LENGTH = len(_MARK) + _DIGEST

#: Files with more bytes are compared with their seal only when all of them are read anyway.
AT_ONCE = 1 << 30

# Deflate makes nothing smaller than by this factor. What is smaller was declared, and never written.
_MOST_COMPRESSED = 1032


def seal(path: Path) -> None:
    """Add the seal to a file that is complete."""
    with path.open("rb") as file:
        digest = _digest(file, path.stat().st_size)
    with path.open("ab") as file:
        file.write(_MARK + digest)


def _digest(file: BinaryIO, size: int) -> bytes:
    """Digest of the first `size` bytes of an open file."""
    digest = hashlib.blake2b(digest_size=_DIGEST)
    while size > 0 and (block := file.read(min(size, 1 << 20))):
        digest.update(block)
        size -= len(block)
    return digest.digest()


def check(path: str | os.PathLike[str], *, whole: bool) -> bool:
    """Whether a file has a seal, which then fits. Without one nothing is known, and the HDF5 library may be tried.

    Parameters
    ----------
    path : path-like
    whole : bool
        Whether to compare files of more than :data:`AT_ONCE` bytes too.

    Raises
    ------
    InputError
        If the seal does not fit: the file is damaged.
    """
    status = Path(path).stat()
    compare = whole or status.st_size <= AT_ONCE
    return _check(os.path.realpath(path), compare, status.st_size, status.st_mtime_ns, status.st_ino)


@lru_cache(maxsize=16)
def _check(path: str, compare: bool, size: int, *_: int) -> bool:
    with open(path, "rb") as file:
        file.seek(max(size - _LENGTH, 0))
        end = file.read()
        file.seek(0)
        if not end.startswith(_MARK):
            return False
        if compare and _digest(file, size - _LENGTH) != end[len(_MARK) :]:
            raise InputError(path, "is damaged: its bytes are not those that ringsweep wrote")
    return True


@contextmanager
def telling_damage(path: str | os.PathLike[str], what: str = "a NetCDF file") -> Iterator[None]:
    """A block that reads a file, in which an error of any kind means that the file is damaged, or not `what`.

    On a damaged file the libraries raise errors of many kinds.
    """
    try:
        yield
    except InputError as error:
        raise InputError(str(path), error.problem) from error
    except PermissionError as error:
        raise InputError(str(path), "cannot be read: permission denied") from error
    except Exception as error:
        raise InputError(str(path), f"is not {what}, or is damaged") from error


@contextmanager
def opened(path: str | os.PathLike[str], what: str = "a NetCDF file", whole: bool = False) -> Iterator[netCDF4.Dataset]:
    """An open NetCDF file whose seal fits, if it has one, for a block as of :func:`telling_damage`.

    Raises
    ------
    InputError
        As :func:`check`; if the file declares more cells than a sweep can have, or more numbers than it can hold; or if
        it cannot be read.
    """
    with telling_damage(path, what):
        sealed = check(path, whole=whole)
        with netCDF4.Dataset(Path(path).resolve()) as file:
            regime = file.variables.get("regime")
            if regime is not None and (cells := math.prod(regime.shape)) > MAX_CELLS:
                raise InputError("", f"declares {cells:.3g} cells: a file holds at most {MAX_CELLS:.3g}")
            declared, there = sum(map(_bytes, file.variables.values())), Path(path).stat().st_size
            if declared > _MOST_COMPRESSED * there:
                raise InputError("", f"declares {declared:.3g} bytes of numbers, which {there} bytes cannot hold")
            if not sealed and "ringsweep_version" in file.ncattrs():
                _warn_of_no_seal(str(path), Path(path).stat().st_mtime_ns)
            yield file


def _bytes(variable: Any) -> int:
    return math.prod(variable.shape) * (1 if variable.dtype is str else np.dtype(variable.dtype).itemsize)


@cache
def _warn_of_no_seal(path: str, _: int) -> None:
    logger.warning("%s has no seal, so another program or an older version wrote it: damage would not be noticed", path)
