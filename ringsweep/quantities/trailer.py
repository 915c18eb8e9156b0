"""Result files are opened here: what would make the HDF5 library hang or crash, or take all memory, is told before.

A seal stands behind the end of a file. On some damaged files HDF5 loops for ever or crashes. The seal is a mark and the
BLAKE2b digest of all bytes before it. Programs that read NetCDF ignore bytes behind the end; programs that add to a
file write over them.
"""

from __future__ import annotations

import hashlib
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO

import netCDF4
import numpy as np

from ringsweep.errors import InputError

#: Largest number of cells of a sweep. With 24 variables each they take some ten gigabytes on a disk.
MAX_CELLS = 100_000_000

_MARK = b"\nringsweep seal\n\0"
_DIGEST = 32
_LENGTH = len(_MARK) + _DIGEST

#: Files with more bytes are compared only when all of them are read anyway.
AT_ONCE = 1 << 30

# Seconds, and bytes per second, in which a sound file opens and can be read.
_LEAST, _RATE = 20.0, 10e6

_OPENING = """
import sys
sys.path.insert(0, sys.argv[2])
from ringsweep.storage import netcdf
netcdf.altered(sys.argv[1], whole=True, trusted=True)
"""

# Deflate makes nothing smaller than by this factor. What is smaller was declared, and never written.
_MOST_COMPRESSED = 1032

HANGS = "is damaged: the HDF5 library cannot read it, and would not come back"


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


def check(path: str | os.PathLike[str], *, whole: bool) -> None:
    """Make sure that the HDF5 library can be given a file.

    A file without a seal is left to the library. One whose seal does not fit was damaged, or another program changed it
    in place: another process tries to read it first.

    Parameters
    ----------
    path : path-like
    whole : bool
        Whether to read files of more than :data:`AT_ONCE` bytes too.

    Raises
    ------
    InputError
        If the library does not come back from the file, or crashes.
    """
    status = Path(path).stat()
    if status.st_size >= _LENGTH and (whole or status.st_size <= AT_ONCE):
        _check(os.path.realpath(path), status.st_size, status.st_mtime_ns, status.st_ino)


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[netCDF4.Dataset]:
    """An open NetCDF file, of which no variable is read yet.

    Raises
    ------
    InputError
        If it declares more cells than a sweep can have, or more numbers than the file can hold.
    OSError
        If it is no NetCDF file.
    """
    with netCDF4.Dataset(Path(path).resolve()) as file:
        regime = file.variables.get("regime")
        if regime is not None and (cells := math.prod(regime.shape)) > MAX_CELLS:
            raise InputError(str(path), f"declares {cells:.3g} cells: a file holds at most {MAX_CELLS:.3g}")
        declared, there = sum(map(_bytes, file.variables.values())), Path(path).stat().st_size
        if declared > _MOST_COMPRESSED * there:
            raise InputError(str(path), f"declares {declared:.3g} bytes of numbers, which {there} bytes cannot hold")
        yield file


def _bytes(variable: Any) -> int:
    return math.prod(variable.shape) * (1 if variable.dtype is str else np.dtype(variable.dtype).itemsize)


@lru_cache(maxsize=16)
def _check(path: str, size: int, *_: int) -> None:
    with open(path, "rb") as file:
        file.seek(size - _LENGTH)
        end = file.read()
        file.seek(0)
        if not end.startswith(_MARK) or _digest(file, size - _LENGTH) == end[len(_MARK) :]:
            return
    try:
        found = subprocess.run(
            [sys.executable, "-P", "-c", _OPENING, path, str(Path(__file__).parents[2])],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_LEAST + size / _RATE,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise InputError(path, HANGS) from None
    if found.returncode < 0:
        raise InputError(path, HANGS)
