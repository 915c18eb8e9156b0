"""NetCDF files: written whole or not at all, and read back before they count."""

from __future__ import annotations

import json
import math
import os
import secrets
import tempfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.quantities.variables import Variable, linked
from ringsweep.storage.chunks import Layout

#: Attributes that tell a file of this package from any other NetCDF file.
SIGNATURE = ("Conventions", "ringsweep_version")

#: Below this many elements the chunk index of a compressed variable costs more than compression saves.
COMPRESSED_FROM = 1024


def check_writable(path: str | os.PathLike[str]) -> None:
    """Make sure that a file can be put at `path`, before hours are spent on its contents.

    Parameters
    ----------
    path : path-like
        File to be written later; it may exist.

    Raises
    ------
    InputError
        If `path` is a folder, or its folder does not exist or cannot be written.
    """
    target = Path(path).resolve()
    folder = target.parent
    try:
        if target.is_dir():
            raise InputError(str(path), "is a folder; give the name of a file")
        if not folder.exists():
            raise InputError(str(path), f"the folder {folder} does not exist; create it or choose another")
        if not folder.is_dir():
            raise InputError(str(path), f"{folder} is not a folder")
        # A name that the file system refuses (too long, say) shows only when it is asked for.
        with suppress(FileNotFoundError):
            target.stat()
        # Permission bits do not tell on network drives, read-only mounts or for root: only trying does.
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InputError(str(path), f"cannot be written: {error.strerror or error}") from error


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary name beside `path`; what was written there takes the place of `path` at the end.

    If the block fails or is interrupted, `path` stays as it was and the temporary file is removed.

    Parameters
    ----------
    path : path-like
        File to be written or replaced. A symbolic link is followed.

    Yields
    ------
    Path
        Name to write to, in the same folder and with the same suffix.

    Raises
    ------
    InputError
        If `path` cannot be written.
    """
    check_writable(path)
    target = Path(path).resolve()
    temporary = _sibling(target)
    try:
        yield temporary
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def save(ds: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a dataset as NetCDF4, whole or not at all.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep or a simulation. Attributes other than text, numbers and arrays of numbers are
        written as JSON.
    path : path-like
        File to be written or replaced.

    Raises
    ------
    InputError
        If `path` cannot be written.
    OSError
        If writing fails, or the file does not read back as it was written.
    """
    with replacing(path) as temporary:
        _to_netcdf(ds, temporary)
        if not load(temporary).equals(ds):
            raise OSError(f"{path}: the file does not read back as it was written; the disk may be full or faulty")


def write(
    target: Path,
    folder: Path,
    frame: xr.Dataset,
    variables: Mapping[str, Variable],
    layout: Layout,
    chunks: Iterable[tuple[tuple[slice, ...], dict[str, NDArray[Any]]]],
) -> None:
    """Write the dataset of a sweep chunk by chunk, whole or not at all, and no more than a few chunks in memory.

    Parameters
    ----------
    target : Path
        File to be written or replaced.
    folder : Path
        Folder on the same disk, to write in meanwhile.
    frame : xarray.Dataset
        Coordinates and attributes.
    variables : mapping of str to Variable
        What the columns are.
    layout : Layout
        Chunks of the grid; they are what is compressed, and read, as one.
    chunks : iterable of tuple
        The place of each chunk in the grid, and its columns in the shape of that place.

    Raises
    ------
    OSError
        If writing fails, or the file does not read back as it was written.
    """
    temporary = folder / f"{secrets.token_hex(4)}.tmp"
    try:
        _to_netcdf(frame, temporary)
        written = _write_chunks(temporary, frame, variables, layout, chunks)
        if written != _checksums(temporary, written, layout):
            raise OSError("the file does not read back as it was written")
        with temporary.open("r+b") as file:
            os.fsync(file.fileno())
        temporary.replace(target)
        _flush_folder(target.parent)
    except (OSError, RuntimeError) as error:
        # Of a full disk the NetCDF library says no more than "HDF error".
        raise OSError(f"{target} could not be written ({error}); is the disk full, or faulty?") from error
    finally:
        temporary.unlink(missing_ok=True)


def _to_netcdf(ds: xr.Dataset, path: Path) -> None:
    ds = ds.drop_encoding()
    ds.attrs = _storable(ds.attrs)
    for variable in ds.variables.values():
        variable.attrs = _storable(variable.attrs)
    encoding = {name: _encoding(variable) for name, variable in ds.variables.items()}
    ds.to_netcdf(path, format="NETCDF4", engine="netcdf4", encoding=encoding)


def _write_chunks(
    path: Path,
    frame: xr.Dataset,
    variables: Mapping[str, Variable],
    layout: Layout,
    chunks: Iterable[tuple[tuple[slice, ...], dict[str, NDArray[Any]]]],
) -> dict[str, int]:
    """Add the columns to a file; returns a checksum of each."""
    dims = tuple(map(str, frame.sizes))
    others = " ".join(str(name) for name in frame.coords if name not in dims)
    sums: dict[str, int] = {}
    with netCDF4.Dataset(path, "a") as file:
        for place, columns in chunks:
            for name, column in columns.items():
                if name not in sums:
                    variable = file.createVariable(name, column.dtype, dims, fill_value=False, **_chunked(layout))
                    _cache_one_chunk(variable, layout)
                    described = variables[name].attributes | linked(name, columns)
                    variable.setncatts(described | ({"coordinates": others} if others else {}))
                file[name][place] = column
                sums[name] = zlib.crc32(column.tobytes(), sums.get(name, 0))
    return sums


def _checksums(path: Path, names: Iterable[str], layout: Layout) -> dict[str, int]:
    """Checksums of variables of a file, as :func:`_write_chunks` takes them."""
    found = {}
    with netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        for name in names:
            found[name] = 0
            _cache_one_chunk(file[name], layout)
            for _, _, place in layout.chunks():
                found[name] = zlib.crc32(file[name][place].tobytes(), found[name])
    return found


def _cache_one_chunk(variable: Any, layout: Layout) -> None:
    # Each is passed once; by default some 64 MiB of each variable would be kept.
    if layout.total >= COMPRESSED_FROM:
        size = math.prod(layout.chunk) * variable.dtype.itemsize
        variable.set_var_chunk_cache(size=2 * size, nelems=11, preemption=1.0)


def _chunked(layout: Layout) -> dict[str, Any]:
    if layout.total < COMPRESSED_FROM:
        return {}
    return {"compression": "zlib", "complevel": 1, "shuffle": True, "fletcher32": True, "chunksizes": layout.chunk}


def _flush_folder(folder: Path) -> None:
    # What Windows neither needs nor allows.
    if hasattr(os, "O_DIRECTORY"):
        descriptor = os.open(folder, os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def check_kind(path: str | os.PathLike[str], mark: str, content: str) -> None:
    """Make sure that a file is a result of one kind, which a new one may replace.

    Parameters
    ----------
    path : path-like
        File that exists.
    mark : {"regime", "time", "contender"}
        What tells the kind: a dimension, or for sweeps a variable.
    content : str
        What the new file holds.

    Raises
    ------
    InputError
        If it is none of this package, or of another kind.
    """
    with open_dataset(path) as there:
        kinds = [kind for kind in ("contender", "time", "regime") if kind in there.dims or kind in there]
    if kinds[:1] != [mark]:
        raise InputError(str(path), f"holds something else: name another file for this {content}")


def load(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a file of this package into memory; the file is closed again.

    Parameters
    ----------
    path : path-like
        File written by `save` or `write`.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the file is missing, is not NetCDF, or was not written by this package.
    """
    with open_dataset(path) as ds:
        return ds.load()


def open_dataset(path: str | os.PathLike[str]) -> xr.Dataset:
    """A file of this package, of which no more is read than is asked for; the rest as for :func:`load`.

    It is a context manager, and closes the file at the end.
    """
    if not Path(path).is_file():
        raise InputError(str(path), "is not a file" if Path(path).exists() else "does not exist")
    try:
        # Seconds are numbers here; decoding would turn them into timedelta64 wherever a unit spells them out.
        ds = xr.open_dataset(Path(path).resolve(), engine="netcdf4", decode_times=False)
    except PermissionError as error:
        raise InputError(str(path), "may not be read: permission denied") from error
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(str(path), "is not a NetCDF file, or is damaged") from error
    missing = [name for name in SIGNATURE if name not in ds.attrs]
    if missing:
        ds.close()
        raise InputError(
            str(path), f"was not written by ringsweep: its attributes lack {' and '.join(missing)}; give a result file"
        )
    return ds


def _sibling(target: Path) -> Path:
    return target.with_name(f".ringsweep-{secrets.token_hex(8)}{target.suffix}")


def _encoding(variable: xr.Variable) -> dict[str, Any]:
    # A fill value would make xarray read integers as floats, and NaN is a value of its own here.
    encoding: dict[str, Any] = {"_FillValue": None}
    if variable.dtype.kind in "iuf" and variable.size >= COMPRESSED_FROM:
        encoding |= {"zlib": True, "complevel": 1}
    return encoding


def _storable(attributes: dict[Any, Any]) -> dict[str, Any]:
    return {str(name): _storable_value(value) for name, value in attributes.items()}


def _storable_value(value: Any) -> Any:
    if isinstance(value, str):
        return value
    kind = np.asarray(value).dtype.kind if isinstance(value, int | float | np.generic | np.ndarray) else "O"
    return value if kind in "iuf" else json.dumps(value, default=_plain)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)
