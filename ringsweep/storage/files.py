"""Files that are written completely or not at all.

While ``OUT.nc`` is written, the folder ``OUT.nc.partial`` beside it belongs to one process, which holds the lock in it.
What a killed process left there is removed by the next one.
"""

from __future__ import annotations

import errno
import logging
import os
import re
import secrets
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic, sleep

from ringsweep.errors import InputError

if sys.platform == "win32":
    import msvcrt

    def _lock(descriptor: int) -> None:
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


logger = logging.getLogger("ringsweep")

MANIFEST = "sweep.json"

#: Names of task files.
TASK = re.compile(r"[0-9a-f]{12}-\d{10}-\d+-[0-9a-f]{16}\.npz")

_LOCK = "lock"
_TEMPORARY = re.compile(r"[0-9a-f]{8}\.tmp(\.\w+)?")

# A file is complete within seconds of the computation that precedes it.
_PATIENCE = 20.0

# Seconds between two looks at a lock that another process has.
_LOOK = 0.05

# Errors of a file system that has no locks.
_NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP)


def check_writable(path: str | os.PathLike[str]) -> None:
    """Check that a file can be written at `path`, before its contents are computed.

    Parameters
    ----------
    path : path-like
        File that is written later; it may exist.

    Raises
    ------
    InputError
        If `path` is a folder, a device or a pipe, its folder does not exist or cannot be written, or the locale does
        not have its characters.
    """
    check_name(path)
    if not str(path).isprintable():
        raise InputError(ascii(str(path))[1:-1], "the name has control characters: choose another one")
    target = Path(path).resolve()
    folder = target.parent
    try:
        if target.exists() and not target.is_file():
            # The finished file would take the place of a device or a pipe.
            kind = "a folder" if target.is_dir() else "a device or a pipe"
            raise InputError(str(path), f"is {kind}; give the name of a file")
        if not folder.exists():
            raise InputError(str(path), f"the folder {folder} does not exist; create it or choose another")
        if not folder.is_dir():
            raise InputError(str(path), f"{folder} is not a folder")
        # Raises if the file system does not accept the name.
        with suppress(FileNotFoundError):
            folder_of(target).stat()
        if folder_of(target).exists():
            # Removes what a killed process left. If something forbids it, the writer reports it.
            with suppress(InputError), working_folder(target):
                pass
        # Permission bits are not reliable on network drives, on read-only mounts, or for root.
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InputError(str(path), f"cannot be written: {error.strerror or error}") from error


def check_name(path: str | os.PathLike[str]) -> None:
    """Check that the NetCDF library can be given the name of a file.

    Raises
    ------
    InputError
        If the locale does not have its characters, or it is a symbolic link to itself.
    """
    encoding = sys.getfilesystemencoding()
    try:
        str(Path(path).resolve()).encode(encoding)
    except (RuntimeError, OSError) as error:
        raise InputError(str(path), "is a symbolic link that leads to itself") from error
    except UnicodeEncodeError as error:
        shown = os.fsencode(path).decode("utf-8", "replace")
        problem = f"the name, or that of a folder above it, has characters that the locale ({encoding}) does not have: "
        cure = "set LC_ALL=C.UTF-8 or PYTHONUTF8=1, or choose another name"
        raise InputError(ascii(shown)[1:-1], problem + cure) from error


@contextmanager
def working_folder(target: Path, patience: float = 0.0) -> Iterator[WorkingFolder]:
    """The folder beside `target`, locked for this process. It is removed at the end if it holds no finished cells.

    Parameters
    ----------
    target : Path
        File that is written.
    patience : float
        How long to wait for another process that uses the folder, s.

    Raises
    ------
    InputError
        If another process uses the folder, it was not made by this package, or it cannot be written.
    """
    check_name(target)
    folder = folder_of(target)
    mode = 0o777
    with suppress(FileNotFoundError):
        # A user who may not read the file may not read its cells either.
        mode = _permissions(target)
        mode |= 0o700 | (mode & 0o444) >> 2
    made, until = False, monotonic() + patience
    try:
        while True:
            with suppress(FileExistsError):
                folder.mkdir(mode=mode)
                made = True
                flush_folder(folder.parent)
            # Another process may remove the folder meanwhile, because it has finished.
            with suppress(FileNotFoundError):
                _refuse_foreign(target, folder)
                try:
                    used = WorkingFolder(folder)
                    break
                except BlockingIOError:
                    if monotonic() >= until:
                        raise InputError(str(target), f"another ringsweep is computing it (it uses {folder})") from None
                    sleep(_LOOK)
    except OSError as error:
        if made:
            with suppress(OSError):
                (folder / _LOCK).unlink(missing_ok=True)
                folder.rmdir()
        raise InputError(str(target), f"cannot be written: {error.strerror or error}") from error
    try:
        if _permissions(folder) & ~mode:
            folder.chmod(_permissions(folder) & mode)
        used.remove_temporary()
        yield used
    except OSError:
        # The folder may be the cause.
        used.check()
        raise
    finally:
        removable = used.is_own() and not used.finished_cells()
        if removable:
            used.remove_temporary()
            with suppress(OSError):
                (folder / MANIFEST).unlink(missing_ok=True)
                # Windows does not remove a file that is open.
                (folder / _LOCK).unlink(missing_ok=True)
        used.release()
        if removable:
            with suppress(OSError):
                (folder / _LOCK).unlink(missing_ok=True)
                folder.rmdir()


class WorkingFolder:
    """Folder beside a file that is written, locked for this process; made by :func:`working_folder`.

    Attributes
    ----------
    path : Path

    Raises
    ------
    BlockingIOError
        If another process has locked it.
    FileNotFoundError
        If another process has removed it meanwhile.
    """

    def __init__(self, path: Path):
        self.path = path
        self._descriptor = os.open(path / _LOCK, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o644)
        self._lock = os.fstat(self._descriptor)
        try:
            _lock(self._descriptor)
            if not self.is_own():
                raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                self.release()
                # Some file systems, and Windows, call a lock of another process a lack of permission.
                if isinstance(error, PermissionError):
                    raise BlockingIOError(*error.args) from error
                raise
            logger.warning("%s: this file system has no locks; do not write the same file twice at once", path)

    def release(self) -> None:
        """Let other processes use the folder."""
        # This ends the lock too.
        os.close(self._descriptor)

    def is_own(self) -> bool:
        """Whether the folder is still the one that this process locked."""
        try:
            return os.path.samestat(self._lock, (self.path / _LOCK).lstat())
        except OSError:
            return False

    def check(self) -> None:
        """Raise an `OSError` that names the cause if the folder was deleted, or replaced by another process."""
        if not self.is_own():
            raise OSError(f"{self.path} was deleted while this process used it; what it held is lost")

    def remove_temporary(self) -> None:
        """Remove what was not finished."""
        for path in self._named(_TEMPORARY):
            with suppress(OSError):
                path.unlink(missing_ok=True)

    def finished_cells(self) -> list[Path]:
        """All task files, usable or not."""
        return self._named(TASK)

    def _named(self, pattern: re.Pattern[str]) -> list[Path]:
        try:
            return sorted(path for path in self.path.iterdir() if pattern.fullmatch(path.name))
        except OSError:
            return []

    @contextmanager
    def replacing(self, target: Path) -> Iterator[Path]:
        """Give a temporary name. At the end of the block the file of that name takes the place of `target`.

        It gets the permissions of `target`, and no power cut can undo it. If the block fails, it is removed.
        """
        # A file of such a name is removed by the next process, if this one does not.
        temporary = self.path / f"{secrets.token_hex(4)}.tmp{target.suffix}"
        try:
            yield temporary
            with temporary.open("r+b") as file:
                os.fsync(file.fileno())
            with suppress(FileNotFoundError):
                temporary.chmod(_permissions(target))
            temporary.replace(target)
            flush_folder(target.parent)
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)

    def write(self, name: str, content: bytes) -> None:
        """Write a file in the folder so that it is on the disk, completely or not at all."""
        try:
            with self.replacing(self.path / name) as temporary:
                temporary.write_bytes(content)
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.path)) from error


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary name. At the end of the block the file of that name replaces `path`.

    If the block fails or is interrupted, `path` stays unchanged and the temporary file is removed. If the process is
    killed, the next one that writes `path` removes it.

    Parameters
    ----------
    path : path-like
        File to write or replace. A symbolic link is followed.

    Yields
    ------
    Path
        Name to write to, on the same disk and with the same suffix.

    Raises
    ------
    InputError
        If `path` cannot be written.
    """
    check_writable(path)
    target = Path(path).resolve()
    with working_folder(target, _PATIENCE) as folder, folder.replacing(target) as temporary:
        yield temporary


def flush_folder(folder: Path) -> None:
    """Write the names of the files in a folder to the disk."""
    # Windows neither needs this nor allows it.
    if hasattr(os, "O_DIRECTORY"):
        descriptor = os.open(folder, os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def folder_of(target: Path) -> Path:
    """Folder of the unfinished cells of a file."""
    return target.with_name(f"{target.name}.partial")


def _permissions(path: Path) -> int:
    return path.stat().st_mode & 0o777


def _refuse_foreign(target: Path, folder: Path) -> None:
    """Refuse a folder that this package has not made, and links, which would lead out of it."""
    refusal = f"cannot be written: unfinished files go to the folder {folder}, but"
    if not stat.S_ISDIR(folder.lstat().st_mode):
        kind = "a symbolic link" if folder.is_symlink() else "a file"
        raise InputError(str(target), f"{refusal} it is {kind}: remove it, or name another output")
    names = sorted(os.listdir(folder))
    own = [name for name in names if name in (_LOCK, MANIFEST) or TASK.fullmatch(name) or _TEMPORARY.fullmatch(name)]
    for name in own:
        # Another process may have removed a file in the meantime.
        with suppress(FileNotFoundError):
            if not stat.S_ISREG((folder / name).lstat().st_mode):
                raise InputError(str(target), f"{refusal} {name} in it is a link or no file: remove it")
    if MANIFEST not in names and len(own) < len(names):
        other = next(name for name in names if name not in own)
        problem = f"it is not of ringsweep: it holds {other}. Rename it, or name another output"
        raise InputError(str(target), f"{refusal} {problem}")
