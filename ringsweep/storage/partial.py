"""Finished cells of a sweep on disk, in a folder beside the file that they will become.

The folder of `OUT.nc` is `OUT.nc.partial`. It holds one file a task, which is complete or absent: it is written
aside, flushed and renamed. Each knows what determines its bits (:func:`ringsweep.storage.provenance.identity`) and
carries
checksums, so that nothing else is ever mixed in. One process at a time owns the folder.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
import os
import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.storage.chunks import Layout
from ringsweep.storage.provenance import differences, fingerprint

logger = logging.getLogger("ringsweep")

Columns = Mapping[str, NDArray[Any]]

# Files that are left out, which are named one by one.
_MOST = 3

_MANIFEST, _LOCK = "sweep.json", "lock"


@contextmanager
def owned(target: Path, identity: Mapping[str, str], layout: Layout, *, fresh: bool = False) -> Iterator[Partial]:
    """The tasks of the sweep that becomes `target`, to be read and added to by this process alone.

    If no task is there at the end the folder goes with it.

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
        If another process owns the folder, if it holds tasks of another sweep, or cannot be written.
    """
    folder = target.with_name(f"{target.name}.partial")
    if folder.exists() and not folder.is_dir():
        raise InputError(str(target), f"cannot be computed: {folder} stands where its tasks would, and is no folder")
    try:
        folder.mkdir(exist_ok=True)
        lock = FileLock(folder / _LOCK, timeout=0)
        lock.acquire()
    except Timeout:
        raise InputError(str(target), f"another ringsweep is computing it (it owns {folder})") from None
    except OSError as error:
        raise InputError(str(target), f"cannot be written: {error.strerror or error}") from error
    tasks = Partial(folder, identity, layout)
    try:
        if fresh:
            tasks.clear()
        tasks.begin()
        yield tasks
    finally:
        empty = not tasks.found()
        if empty:
            tasks.clear()
        lock.release()
        if empty:
            with suppress(OSError):
                (folder / _LOCK).unlink(missing_ok=True)
                folder.rmdir()


class Partial:
    """Finished cells of a sweep, a file a task; made by :func:`owned`.

    Attributes
    ----------
    folder : Path
    done : ndarray of bool, shape ``(cells,)``
        Whether the cell at each position of the layout's order is here.
    files : dict of Path to tuple of int
        Task files, with the first and the last position in each. The name of each ends with a digest of it.
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
        before = _texts(manifest)
        if before and before != self.identity and self.found():
            changes = differences(before, self.identity)
            raise InputError(
                str(self.folder),
                f"holds finished cells of another sweep: {changes}. --fresh starts over, -o keeps both",
            )
        if before != self.identity:
            _durably(manifest, json.dumps(self.identity, indent=1).encode())
        self.take_stock()

    def found(self) -> list[Path]:
        """Whatever task files there are, of this sweep or not."""
        return sorted(path for path in self.folder.glob("*.npz") if path.is_file())

    def take_stock(self) -> None:
        """Read what is there; what is not whole, or not of this sweep, is left out with a word."""
        self.done[:] = False
        self.files.clear()
        left_out = 0
        for path in self.found():
            try:
                positions, _ = self.read(path)
            except Damaged as damage:
                left_out += 1
                if left_out <= _MOST:
                    logger.warning("%s: its cells are computed again", damage)
            else:
                self.done[positions] = True
                self.files[path] = int(positions[0]), int(positions[-1])
        if left_out > _MOST:
            logger.warning("so are those of %d more such files", left_out - _MOST)

    def put(self, positions: NDArray[np.integer], columns: Columns, processor: str) -> None:
        """Keep the columns of the cells at these positions, which ascend."""
        # One array of all columns: each member of an archive takes longer to write than a few hundred cells.
        cells = np.empty(len(positions), dtype=[(name, column.dtype) for name, column in columns.items()])
        for name, column in columns.items():
            cells[name] = column
        members = {
            "key": np.array(self.key),
            "processor": np.array(processor),
            "positions": positions.astype(np.uint32),
        }
        content = io.BytesIO()
        np.savez(content, allow_pickle=False, cells=cells, **members)
        stem = f"{self.key[:12]}-{positions[0]:010d}-{len(positions)}"
        path = self.folder / f"{stem}-{_digest(content.getvalue())}.npz"
        _durably(path, content.getvalue())
        self.processors.add(processor)
        self.done[positions] = True
        self.files[path] = int(positions[0]), int(positions[-1])

    def read(self, path: Path) -> tuple[NDArray[np.intp], dict[str, NDArray[Any]]]:
        """Positions and columns of a task file.

        Raises
        ------
        Damaged
            If it is not a whole task of this sweep.
        """
        try:
            content = path.read_bytes()
        except OSError as error:
            raise Damaged(f"{path} cannot be read ({error.strerror or error})") from error
        # Members of an archive have checksums, its directory has none.
        if not path.stem.endswith(f"-{_digest(content)}"):
            raise Damaged(f"{path} is damaged")
        with np.load(io.BytesIO(content), allow_pickle=False) as members:
            found = dict(members)
        if str(found["key"]) != self.key:
            raise Damaged(f"{path} is not of this sweep")
        self.processors.add(str(found["processor"]))
        cells = found["cells"]
        return found["positions"].astype(np.intp), {name: cells[name] for name in cells.dtype.names}

    def chunks(self) -> Iterator[tuple[tuple[slice, ...], dict[str, NDArray[Any]]]]:
        """Place of every chunk in the grid, in order, and its columns in the shape of that place.

        Raises
        ------
        Damaged
            If a file is not what it was, or some cells are in none.
        """
        waiting = sorted(self.files, key=lambda path: self.files[path], reverse=True)
        read: dict[Path, tuple[NDArray[np.intp], dict[str, NDArray[Any]]]] = {}
        for begin, end, place in self.layout.chunks():
            while waiting and self.files[waiting[-1]][0] < end:
                path = waiting.pop()
                read[path] = self.read(path)
            chunk: dict[str, NDArray[Any]] = {}
            missing = np.ones(end - begin, dtype=bool)
            for positions, columns in read.values():
                part = slice(*np.searchsorted(positions, (begin, end)))
                missing[positions[part] - begin] = False
                for name, column in columns.items():
                    whole = chunk.setdefault(name, np.empty(end - begin, dtype=column.dtype))
                    whole[positions[part] - begin] = column[part]
            if missing.any():
                raise Damaged(f"{missing.sum()} cells are in no task of {self.folder}")
            yield place, {name: column.reshape([s.stop - s.start for s in place]) for name, column in chunk.items()}
            for path in [path for path in read if self.files[path][1] < end]:
                del read[path]

    def clear(self) -> None:
        """Remove all that was kept."""
        for path in [*self.found(), *self.folder.glob("*.tmp"), self.folder / _MANIFEST]:
            path.unlink(missing_ok=True)
        self.files.clear()
        self.done[:] = False


class Damaged(Exception):
    """A task file is not a whole task of this sweep."""


def _digest(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=8).hexdigest()


def _texts(path: Path) -> dict[str, str]:
    """A mapping of texts from a file of JSON; empty if that is not what it holds."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) and all(isinstance(value, str) for value in found.values()) else {}


def _durably(path: Path, content: bytes) -> None:
    """Write a file aside, flush it to the disk, and give it its name."""
    temporary = path.with_name(f"{secrets.token_hex(4)}.tmp")
    try:
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path.parent)) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
