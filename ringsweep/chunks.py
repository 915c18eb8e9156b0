"""Finished cells of a sweep on disk, in a folder beside the file that they will become.

The folder of `OUT.nc` is `OUT.nc.partial`. It holds one file a chunk, which is complete or absent: it is written
aside, flushed and renamed. Each knows what determines its bits (:func:`ringsweep.provenance.identity`) and carries
checksums, so that nothing else is ever mixed in. One process at a time owns the folder.
"""

from __future__ import annotations

import json
import logging
import os
import secrets
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any
from zipfile import BadZipFile

import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.layout import Layout
from ringsweep.provenance import differences, fingerprint

logger = logging.getLogger("ringsweep")

Columns = Mapping[str, NDArray[Any]]

# What NumPy may make of a file that is no archive of arrays, or a damaged one.
_UNREADABLE = (
    OSError,
    ValueError,
    TypeError,
    AttributeError,
    EOFError,
    KeyError,
    NotImplementedError,
    BadZipFile,
    zlib.error,
)

_MANIFEST, _LOCK = "sweep.json", "lock"


@contextmanager
def owned(target: Path, identity: Mapping[str, str], layout: Layout, *, fresh: bool = False) -> Iterator[Chunks]:
    """The chunks of the sweep that becomes `target`, to be read and added to by this process alone.

    If no chunk is there at the end the folder goes with it.

    Parameters
    ----------
    target : Path
        File that the sweep becomes.
    identity : mapping of str to str
        What determines the bits of the sweep.
    layout : Layout
        Order of its cells.
    fresh : bool
        Whether to discard what is there.

    Raises
    ------
    InputError
        If another process owns the folder, if it holds chunks of another sweep, or cannot be written.
    """
    folder = target.with_name(f"{target.name}.partial")
    try:
        folder.mkdir(exist_ok=True)
        lock = FileLock(folder / _LOCK, timeout=0)
        lock.acquire()
    except Timeout:
        raise InputError(str(target), f"another ringsweep is computing it (it owns {folder})") from None
    except OSError as error:
        raise InputError(str(target), f"cannot be written: {error.strerror or error}") from error
    chunks = Chunks(folder, identity, layout)
    try:
        if fresh:
            chunks.clear()
        chunks.begin()
        yield chunks
    finally:
        empty = not any(folder.glob("*.npz"))
        if empty:
            chunks.clear()
        lock.release()
        if empty:
            with suppress(OSError):
                (folder / _LOCK).unlink(missing_ok=True)
                folder.rmdir()


class Chunks:
    """Finished cells of a sweep, a file a chunk; made by :func:`owned`.

    Attributes
    ----------
    folder : Path
    done : ndarray of bool, shape ``(cells,)``
        Whether the cell at each position of the layout's order is here.
    files : dict of Path to tuple of int
        Chunk files, with the first and the last position in each.
    processors : set of str
        Names of those that computed them.
    """

    def __init__(self, folder: Path, identity: Mapping[str, str], layout: Layout):
        self.folder = folder
        self.identity = dict(identity)
        self.layout = layout
        self.key = fingerprint(identity)
        self.done = np.zeros(layout.total, dtype=bool)
        self.files: dict[Path, tuple[int, int]] = {}
        self.processors: set[str] = set()

    def begin(self) -> None:
        """Take up what is there, which must be of this very sweep."""
        manifest = self.folder / _MANIFEST
        for path in self.folder.glob("*.tmp"):
            path.unlink()
        try:
            before = dict(json.loads(manifest.read_text()))
        except (OSError, ValueError):
            before = {}
        others = sorted(self.folder.glob("*.npz"))
        if before and before != self.identity and others:
            changes = differences(before, self.identity)
            raise InputError(
                str(self.folder),
                f"holds finished cells of another sweep: {changes}. --fresh starts over, -o keeps both",
            )
        if before != self.identity:
            text = json.dumps(self.identity, indent=1)
            _durably(manifest, lambda file: file.write(text.encode()))
        for path in others:
            try:
                positions, _ = self.read(path)
            except Damaged as damage:
                logger.warning("%s: its cells are computed again", damage)
            else:
                self.done[positions] = True
                self.files[path] = int(positions.min()), int(positions.max())

    def put(self, positions: NDArray[np.integer], columns: Columns, processor: str) -> None:
        """Keep the columns of the cells at these positions, which ascend."""
        path = self.folder / f"{self.key[:12]}-{positions[0]:010d}-{len(positions)}.npz"
        # One array of all columns: each member of an archive takes longer to write than a few hundred cells.
        cells = np.empty(len(positions), dtype=[(name, column.dtype) for name, column in columns.items()])
        for name, column in columns.items():
            cells[name] = column
        members = {
            "key": np.array(self.key),
            "processor": np.array(processor),
            "positions": positions.astype(np.uint32),
        }
        _durably(path, lambda file: np.savez(file, allow_pickle=False, cells=cells, **members))
        self.processors.add(processor)
        self.done[positions] = True
        self.files[path] = int(positions[0]), int(positions[-1])

    def read(self, path: Path) -> tuple[NDArray[np.intp], dict[str, NDArray[Any]]]:
        """Positions and columns of a chunk file.

        Raises
        ------
        Damaged
            If it is not a whole chunk of this sweep.
        """
        try:
            # The checksum of each member is verified on the way.
            with path.open("rb") as file, np.load(file, allow_pickle=False) as members:
                found = dict(members)
        except _UNREADABLE as problem:
            raise Damaged(f"{path} is damaged ({' '.join(str(problem).split())})") from problem
        if str(found.pop("key", "")) != self.key:
            raise Damaged(f"{path} is not of this sweep")
        self.processors.add(str(found["processor"]))
        cells = found["cells"]
        return found["positions"].astype(np.intp), {name: cells[name] for name in cells.dtype.names}

    def bricks(self) -> Iterator[tuple[tuple[slice, ...], dict[str, NDArray[Any]]]]:
        """Place of every brick in the grid, in order, and its columns in the shape of that place."""
        waiting = sorted(self.files, key=lambda path: self.files[path], reverse=True)
        read: dict[Path, tuple[NDArray[np.intp], dict[str, NDArray[Any]]]] = {}
        for begin, end, place in self.layout.bricks():
            while waiting and self.files[waiting[-1]][0] < end:
                path = waiting.pop()
                read[path] = self.read(path)
            brick: dict[str, NDArray[Any]] = {}
            for positions, columns in read.values():
                part = slice(*np.searchsorted(positions, (begin, end)))
                for name, column in columns.items():
                    whole = brick.setdefault(name, np.empty(end - begin, dtype=column.dtype))
                    whole[positions[part] - begin] = column[part]
            yield place, {name: column.reshape([s.stop - s.start for s in place]) for name, column in brick.items()}
            for path in [path for path in read if self.files[path][1] < end]:
                del read[path]

    def clear(self) -> None:
        """Remove all that was kept."""
        for path in [*self.folder.glob("*.npz"), *self.folder.glob("*.tmp"), self.folder / _MANIFEST]:
            path.unlink(missing_ok=True)
        self.files.clear()
        self.done[:] = False


class Damaged(Exception):
    """A chunk file is not a whole chunk of this sweep."""


def _durably(path: Path, write: Callable[[IO[bytes]], Any]) -> None:
    """Write a file aside, flush it to the disk, and give it its name."""
    temporary = path.with_name(f"{secrets.token_hex(4)}.tmp")
    try:
        with temporary.open("xb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
