"""Checkpoint of a running sweep: its finished cells, in a folder beside the file that they will become.

The folder of ``OUT.nc`` is ``OUT.nc.partial``, with one file for each finished task. A task file is complete or absent:
it is written under another name, flushed and renamed (:mod:`ringsweep.storage.files`). It holds the fingerprint of its
sweep (:func:`ringsweep.storage.provenance.fingerprint`), and its name ends with a checksum. One process at a time uses
the folder.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.storage.chunks import Layout
from ringsweep.storage.files import MANIFEST, WorkingFolder, folder_of, working_folder
from ringsweep.storage.provenance import differences, fingerprint

logger = logging.getLogger("ringsweep")

Columns = Mapping[str, NDArray[Any]]

# In place of the path of a task file: the cells of the only task, in memory.
_HELD = Path("in memory")


@contextmanager
def open_checkpoint(
    target: Path, identity: Mapping[str, str], layout: Layout, *, fresh: bool = False
) -> Iterator[Checkpoint]:
    """Checkpoint of the sweep that becomes `target`, locked for this process.

    Parameters
    ----------
    target : Path
        File that the sweep becomes.
    identity : mapping of str to str
        All that determines the bits of the sweep.
    layout : Layout
        Order of its cells.
    fresh : bool
        Whether to discard what an earlier run left.

    Raises
    ------
    InputError
        If another process uses the folder, it was not made by this package, or it cannot be written.
    """
    with working_folder(target) as folder:
        checkpoint = Checkpoint(folder, identity, layout)
        if fresh:
            checkpoint.clear()
        checkpoint.resume()
        yield checkpoint


def cells_done(target: Path, fingerprint: str) -> int:
    """Number of finished cells that a sweep with this fingerprint has left beside its file."""
    names = (path.name for path in folder_of(target).glob(f"{fingerprint[:12]}-*.npz"))
    return sum(int(name.split("-")[2]) for name in names)


class Checkpoint:
    """Finished cells of a sweep on disk, one file for each task; made by :func:`open_checkpoint`.

    Attributes
    ----------
    working_folder : WorkingFolder
    folder : Path
    done : ndarray of bool, shape ``(cells,)``
        Whether the cell at each position of the layout is finished.
    files : dict of Path to tuple of int
        Task files, with the first and the last position in each.
    processors : set of str
        Names of the processors that computed the cells.
    other : str
        What is different in the sweep whose finished cells the folder holds; empty if they are of this one.
    """

    def __init__(self, folder: WorkingFolder, identity: Mapping[str, str], layout: Layout):
        self.working_folder = folder
        self.folder = folder.path
        self.identity = dict(identity)
        self.layout = layout
        self.fingerprint = fingerprint(identity)
        self.done = np.zeros(layout.total, dtype=bool)
        self.files: dict[Path, tuple[int, int]] = {}
        self.processors: set[str] = set()
        self.other = ""
        self._held: tuple[NDArray[np.intp], dict[str, NDArray[Any]], str] | None = None

    def resume(self) -> None:
        """Read what an earlier run left, unless that is of another sweep."""
        before = _read_manifest(self.folder / MANIFEST)
        if before and before != self.identity and self.working_folder.finished_cells():
            self.other = differences(before, self.identity)
            return
        if before != self.identity:
            self.working_folder.write(MANIFEST, json.dumps(self.identity, indent=1).encode())
        self.scan()

    def scan(self) -> None:
        """Find out which cells are finished. Warns of damaged task files and of those of another sweep."""
        self.done[:] = False
        self.files.clear()
        self._held = None
        damaged = []
        for path in self.working_folder.finished_cells():
            try:
                positions, _ = self.read(path)
            except DamagedTask as damage:
                damaged.append(str(damage))
            else:
                self.done[positions] = True
                self.files[path] = int(positions[0]), int(positions[-1])
        if damaged:
            others = f", and {len(damaged) - 1} more such files" * (len(damaged) > 1)
            logger.warning("%s%s: the cells are computed again", damaged[0], others)

    def put(self, positions: NDArray[np.integer], columns: Columns, processor: str) -> None:
        """Store the columns of the cells at these positions, which ascend.

        A task that has all cells of the sweep stays in memory: the file of the sweep is written next. If that fails,
        :meth:`keep` writes the task.
        """
        self.processors.add(processor)
        self.done[positions] = True
        if len(positions) == self.layout.total:
            self._held = positions.astype(np.intp), dict(columns), processor
            self.files[_HELD] = 0, len(positions) - 1
        else:
            self._write(positions, columns, processor)

    def keep(self) -> None:
        """Write the cells that are only in memory.

        Raises
        ------
        InputError, OSError
            If they cannot be written. Then they do not count as finished.
        """
        if self._held is None:
            return
        held, self._held = self._held, None
        del self.files[_HELD]
        self.done[:] = False
        self._write(*held)
        self.done[:] = True

    def _write(self, positions: NDArray[np.integer], columns: Columns, processor: str) -> None:
        """Write a task file."""
        # One structured array: each member of an archive takes longer to write than a few hundred cells.
        dtype = [(name, column.dtype, column.shape[1:]) for name, column in columns.items()]
        cells = np.empty(len(positions), dtype=dtype)
        for name, column in columns.items():
            cells[name] = column
        labels = {"key": np.array(self.fingerprint), "processor": np.array(processor)}
        content = io.BytesIO()
        np.savez(content, allow_pickle=False, cells=cells, positions=positions.astype(np.uint32), **labels)
        stem = f"{self.fingerprint[:12]}-{positions[0]:010d}-{len(positions)}"
        name = f"{stem}-{_checksum(content.getvalue())}.npz"
        self.working_folder.check()
        self.working_folder.write(name, content.getvalue())
        self.files[self.folder / name] = int(positions[0]), int(positions[-1])

    def read(self, path: Path) -> tuple[NDArray[np.intp], dict[str, NDArray[Any]]]:
        """Positions and columns of a task file.

        Raises
        ------
        DamagedTask
            If the file is damaged, or belongs to another sweep.
        """
        if path == _HELD and self._held is not None:
            return self._held[:2]
        try:
            content = path.read_bytes()
        except OSError as error:
            raise DamagedTask(f"{path} cannot be read ({error.strerror or error})") from error
        # The members of an archive have checksums, but its directory has none.
        if not path.stem.endswith(f"-{_checksum(content)}"):
            raise DamagedTask(f"{path} is damaged")
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            members = dict(archive)
        if str(members["key"]) != self.fingerprint:
            raise DamagedTask(f"{path} is not of this sweep")
        self.processors.add(str(members["processor"]))
        cells = members["cells"]
        return members["positions"].astype(np.intp), {name: cells[name] for name in cells.dtype.names}

    def finished(self) -> Iterator[tuple[NDArray[np.intp], dict[str, NDArray[Any]]]]:
        """Positions and columns of every task file."""
        for path in list(self.files):
            yield self.read(path)

    def chunks(
        self, complete: Callable[[tuple[slice, ...], NDArray[np.bool_], dict[str, NDArray[Any]]], bool] | None = None
    ) -> Iterator[tuple[tuple[slice, ...], dict[str, NDArray[Any]]]]:
        """Slices in the grid of every chunk, in order, and its columns in the shape of the chunk.

        Parameters
        ----------
        complete : callable, optional
            Gets the slices of a chunk, a mask of the cells that are in no file, and the columns, both in the shape of
            the chunk. It fills these cells, adds columns, and returns whether it knows all of them.

        Raises
        ------
        DamagedTask
            If a task file has changed, or some cells are in no file.
        """
        waiting = sorted(self.files, key=lambda path: self.files[path], reverse=True)
        read: dict[Path, tuple[NDArray[np.intp], dict[str, NDArray[Any]]]] = {}
        dtypes: dict[str, Any] = {}
        if waiting and complete is not None:
            dtypes = {name: column.dtype for name, column in self.read(waiting[-1])[1].items()}
        for start, stop, region in self.layout.chunks():
            while waiting and self.files[waiting[-1]][0] < stop:
                path = waiting.pop()
                read[path] = self.read(path)
            # A chunk without a computed cell has the columns of the others.
            chunk = {name: np.empty(stop - start, dtype=dtype) for name, dtype in dtypes.items()}
            missing = np.ones(stop - start, dtype=bool)
            for positions, columns in read.values():
                part = slice(*np.searchsorted(positions, (start, stop)))
                within = positions[part] - start
                missing[within] = False
                for name, column in columns.items():
                    whole = chunk.setdefault(name, np.empty((stop - start, *column.shape[1:]), column.dtype))
                    whole[within] = column[part]
            shape = [s.stop - s.start for s in region]
            chunk = {name: column.reshape((*shape, *column.shape[1:])) for name, column in chunk.items()}
            known = complete is not None and complete(region, missing.reshape(shape), chunk)
            if missing.any() and not known:
                raise DamagedTask(f"{missing.sum()} cells are in no task file of {self.folder}")
            yield region, chunk
            for path in [path for path in read if self.files[path][1] < stop]:
                del read[path]

    def clear(self) -> None:
        """Remove all files but the lock."""
        if not self.working_folder.is_own():
            return
        for path in [*self.working_folder.finished_cells(), self.folder / MANIFEST]:
            path.unlink(missing_ok=True)
        self.working_folder.remove_temporary()
        self.scan()


def another_sweep(path: str, problem: str, changes: str) -> InputError:
    """The error about a file or a folder with cells of another sweep, which a new sweep would replace."""
    cure = "--fresh (in Python fresh=True) starts over, another output file keeps both"
    return InputError(path, f"{problem}: {changes}. {cure}")


class DamagedTask(Exception):
    """A task file is damaged, missing, or of another sweep."""


def _checksum(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=8).hexdigest()


def _read_manifest(path: Path) -> dict[str, str]:
    """Identity of the sweep in a folder; empty if the file is missing or damaged."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) and all(isinstance(value, str) for value in found.values()) else {}
