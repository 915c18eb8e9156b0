"""NetCDF files: written completely or not at all, and read back for comparison."""

from __future__ import annotations

import json
import math
import os
import zlib
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.quantities.variables import MISSING, Variable, error_attribute
from ringsweep.storage.chunks import Layout
from ringsweep.storage.files import WorkingFolder, check_name, put_in_place, replacing

#: Attributes that every file of this package has.
SIGNATURE = ("Conventions", "ringsweep_version")

#: Variables with fewer elements are not compressed: the index of their chunks would take more than compression saves.
COMPRESSED_FROM = 1024


def save(ds: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a dataset as NetCDF4, completely or not at all.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep or a simulation. Attributes other than text, numbers and arrays of numbers are
        written as JSON.
    path : path-like
        File to write or replace.

    Raises
    ------
    InputError
        If `path` cannot be written.
    OSError
        If writing fails, or the file differs from the dataset when it is read back.
    """
    with replacing(path) as temporary:
        _to_netcdf(ds, temporary)
        if not load(temporary).equals(ds):
            raise OSError(f"{path}: the file does not read back as it was written; the disk may be full or faulty")


def write(
    target: Path,
    folder: WorkingFolder,
    frame: xr.Dataset,
    variables: Mapping[str, Variable],
    layout: Layout,
    chunks: Iterable[tuple[tuple[slice, ...], dict[str, NDArray[Any]]]],
    gaps: Collection[str] = (),
) -> None:
    """Write the dataset of a sweep chunk by chunk, completely or not at all. Memory holds a few chunks at a time.

    Parameters
    ----------
    target : Path
        File to write or replace.
    folder : WorkingFolder
        Folder for the temporary file.
    frame : xarray.Dataset
        Coordinates and attributes.
    variables : mapping of str to Variable
        Declarations of the columns.
    layout : Layout
        Chunks of the grid.
    chunks : iterable of tuple
        Slices of each chunk in the grid, and its columns in the shape of the chunk.
    gaps : collection of str
        Columns of whole numbers in which `MISSING` stands for no value: xarray reads them as floats with NaN.

    Raises
    ------
    OSError
        If writing fails, or the file differs from the dataset when it is read back.
    """
    temporary = folder.temporary()
    try:
        _to_netcdf(frame, temporary)
        written = _write_chunks(temporary, frame, variables, layout, chunks, gaps)
        if written != _checksums(temporary, written, layout):
            raise OSError("the file does not read back as it was written")
        put_in_place(temporary, target)
    except (OSError, RuntimeError) as error:
        folder.check()
        # If the disk is full, the NetCDF library only reports "HDF error".
        raise OSError(f"{target} could not be written ({error}); is the disk full, or faulty?") from error
    finally:
        with suppress(OSError):
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
    gaps: Collection[str],
) -> dict[str, int]:
    """Add the columns to a file and return a checksum of each."""
    dims = tuple(map(str, frame.sizes))
    others = " ".join(str(name) for name in frame.coords if name not in dims)
    sums: dict[str, int] = {}
    with netCDF4.Dataset(path, "a") as file:
        for region, columns in chunks:
            for name, column in columns.items():
                if name not in sums:
                    fill = MISSING if name in gaps else False
                    variable = file.createVariable(name, column.dtype, dims, fill_value=fill, **_chunked(layout))
                    variable.set_auto_maskandscale(False)
                    _cache_one_chunk(variable, layout)
                    described = variables[name].attributes | error_attribute(name, columns)
                    variable.setncatts(described | ({"coordinates": others} if others else {}))
                file[name][region] = column
                sums[name] = zlib.crc32(column.tobytes(), sums.get(name, 0))
    return sums


def _checksums(path: Path, names: Iterable[str], layout: Layout) -> dict[str, int]:
    """Checksums of variables of a file, as :func:`_write_chunks` computes them."""
    found = {}
    with netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        for name in names:
            found[name] = 0
            _cache_one_chunk(file[name], layout)
            for _, _, region in layout.chunks():
                found[name] = zlib.crc32(file[name][region].tobytes(), found[name])
    return found


def _cache_one_chunk(variable: Any, layout: Layout) -> None:
    # Each chunk is used once, but NetCDF would by default keep 64 MiB of each variable in memory.
    if layout.total >= COMPRESSED_FROM:
        size = math.prod(layout.chunk) * variable.dtype.itemsize
        variable.set_var_chunk_cache(size=2 * size, nelems=11, preemption=1.0)


def _chunked(layout: Layout) -> dict[str, Any]:
    if layout.total < COMPRESSED_FROM:
        return {}
    return {"compression": "zlib", "complevel": 1, "shuffle": True, "fletcher32": True, "chunksizes": layout.chunk}


def check_kind(path: str | os.PathLike[str], mark: str, content: str) -> None:
    """Check that a file is a result of a given kind, so that a new result of this kind may replace it.

    Parameters
    ----------
    path : path-like
        File that exists.
    mark : {"regime", "time", "contender"}
        Dimension or variable by which the kind is known: sweep, history, or error against run time.
    content : str
        Contents of the new file, for the message.

    Raises
    ------
    InputError
        If it is no file of this package, or a result of another kind.
    """
    with open_dataset(path) as existing:
        kinds = [kind for kind in ("contender", "time", "regime") if kind in existing.dims or kind in existing]
    if kinds[:1] != [mark]:
        raise InputError(str(path), f"holds a result of another kind: name another file for this {content}")


def load(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a file of this package into memory; the file is closed again.

    Parameters
    ----------
    path : path-like
        File written by :func:`save` or :func:`write`.

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
    """Open a file of this package. Values are read when they are needed.

    The dataset is a context manager that closes the file. Parameters and errors are those of :func:`load`.
    """
    if not Path(path).is_file():
        raise InputError(str(path), "is not a file" if Path(path).exists() else "does not exist")
    check_name(path)
    try:
        # Decoding would turn numbers of seconds into timedelta64.
        ds = xr.open_dataset(Path(path).resolve(), engine="netcdf4", decode_times=False)
    except PermissionError as error:
        raise InputError(str(path), "cannot be read: permission denied") from error
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(str(path), "is not a NetCDF file, or is damaged") from error
    missing = [name for name in SIGNATURE if name not in ds.attrs]
    if missing:
        ds.close()
        raise InputError(
            str(path), f"was not written by ringsweep: its attributes lack {' and '.join(missing)}; give a result file"
        )
    return ds


def _encoding(variable: xr.Variable) -> dict[str, Any]:
    # With a fill value xarray would read integers as floats.
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
