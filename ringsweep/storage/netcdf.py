"""NetCDF files: written completely or not at all, and read back for comparison."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import netCDF4
import numpy as np
import xarray as xr
from numpy.typing import NDArray
from xarray.backends import NetCDF4DataStore

from ringsweep.errors import InputError
from ringsweep.quantities import trailer
from ringsweep.quantities.variables import MISSING, OUTCOMES, Variable, error_attribute, meanings_of
from ringsweep.storage.chunks import Layout
from ringsweep.storage.files import WorkingFolder, check_name, replacing

#: Attributes that every file of this package has.
SIGNATURE = ("Conventions", "ringsweep_version")

#: Variables with fewer elements are not compressed: the index of their chunks would take more than compression saves.
COMPRESSED_FROM = 1024

# Bytes of each variable of an open file that are kept: a few chunks.
_CACHE = 1 << 20


def save(
    frame: xr.Dataset,
    path: str | os.PathLike[str],
    folder: WorkingFolder | None = None,
    variables: Mapping[str, Variable] = MappingProxyType({}),
    layout: Layout | None = None,
    chunks: Iterable[tuple[tuple[slice, ...], dict[str, NDArray[Any]]]] = (),
    gaps: Collection[str] = (),
) -> None:
    """Write a dataset as NetCDF4, and the columns of a sweep chunk by chunk, completely or not at all.

    Memory holds a few chunks at a time. The file is sealed if it reads back as it was written.

    Parameters
    ----------
    frame : xarray.Dataset
        Its attributes are text, numbers, or arrays of numbers. Of a sweep it has coordinates and attributes.
    path : path-like
        File to write or replace.
    folder : WorkingFolder, optional
        Folder for the temporary file, if this process has one already.
    variables : mapping of str to Variable
        Declarations of the columns; their dimensions are those besides the grid.
    layout : Layout, optional
        Chunks of the grid.
    chunks : iterable of tuple
        Slices of each chunk in the grid, and its columns in the shape of the chunk.
    gaps : collection of str
        Columns of whole numbers in which `MISSING` stands for no value: xarray reads them as floats with NaN.

    Raises
    ------
    InputError
        If `path` cannot be written.
    OSError
        If writing fails, or the file differs from the dataset when it is read back.
    """
    target, digest, names = Path(path), hashlib.blake2b(), list[str]()
    with replacing(path) if folder is None else folder.replacing(target) as temporary:
        try:
            with _small_caches(), _created(temporary) as file:
                # xarray must not close the file.
                encoding = {name: _encoding(variable) for name, variable in frame.variables.items()}
                frame.drop_encoding().dump_to_store(NetCDF4DataStore(file), encoding=encoding)
                for data in frame.variables.values():
                    _add_values(digest, data.values)
                for region, columns in chunks:
                    if layout is not None and not names:
                        names = list(columns)
                        _declare(file, frame, variables, layout, columns, gaps)
                    for name in names:
                        file[name][(*region, ...)] = columns[name]
                        _add_values(digest, columns[name])
            _seal(temporary, frame, names, layout, digest.digest())
        except (OSError, RuntimeError) as error:
            # If the disk is full, the NetCDF library only reports "HDF error".
            raise OSError(f"{target} could not be written ({error}); is the disk full, or faulty?") from error


@contextmanager
def _created(path: Path) -> Iterator[Any]:
    file = netCDF4.Dataset(path, "w")
    try:
        yield file
        file.sync()
        file.close()
    except BaseException:
        # Closing a file that cannot be written crashes the library. Nobody needs what is in it.
        file._isopen = 0
        raise


def _add_values(digest: Any, values: Any) -> None:
    array = np.asarray(values)
    text = array.dtype.kind in "OU"
    digest.update(json.dumps(array.tolist()).encode() if text else np.ascontiguousarray(array).data)


def _seal(path: Path, frame: xr.Dataset, names: Iterable[str], layout: Layout | None, written: bytes) -> None:
    """Seal a complete file, if all numbers and texts in it are those written, in their order."""
    again = hashlib.blake2b()
    with _small_caches(), netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        for name in frame.variables:
            _add_values(again, file[str(name)][...])
        for _, _, region in layout.chunks() if layout is not None else ():
            for name in names:
                _add_values(again, file[name][(*region, ...)])
    if again.digest() != written:
        raise OSError("the file does not read back as it was written")
    trailer.seal(path)


def _declare(
    file: Any,
    frame: xr.Dataset,
    variables: Mapping[str, Variable],
    layout: Layout,
    columns: Mapping[str, NDArray[Any]],
    gaps: Collection[str],
) -> None:
    """Declare columns in a file, whose values come chunk by chunk."""
    grid = list(map(str, frame.sizes))[: len(layout.sizes)]
    others = " ".join(str(name) for name in frame.coords if name not in frame.dims)
    for name, column in columns.items():
        inner = column.shape[len(grid) :]
        for dim, size in zip(variables[name].dims, inner, strict=True):
            if dim not in file.dimensions:
                file.createDimension(dim, size)
        stored: dict[str, Any] = {"fill_value": MISSING if name in gaps else False}
        if layout.total * math.prod(inner) >= COMPRESSED_FROM:
            stored |= {"compression": "zlib", "complevel": 1, "fletcher32": True, "chunksizes": (*layout.chunk, *inner)}
        variable = file.createVariable(name, column.dtype, (*grid, *variables[name].dims), **stored)
        variable.set_auto_maskandscale(False)
        described = variables[name].attributes | error_attribute(name, columns)
        variable.setncatts(described | ({"coordinates": others} if others else {}))


@contextmanager
def _small_caches() -> Iterator[None]:
    """Let files that are opened in the block keep few chunks: by default it would be 64 MiB of each variable."""
    before = netCDF4.get_chunk_cache()
    netCDF4.set_chunk_cache(_CACHE)
    try:
        yield
    finally:
        netCDF4.set_chunk_cache(*before)


#: Kinds of results, by a dimension or a variable that no kind after it has.
KINDS = {
    "contender": "errors against run time",
    "time": "a history",
    "probability": "a sampled sweep",
    "residual": "a fit",
    "vertex": "a boundary",
    "threshold": "a distribution of thresholds",
    "regime": "a sweep",
}


def kind_of(ds: xr.Dataset) -> str:
    """The kind of a result, a key of :data:`KINDS`; empty if it is none of them."""
    return next((mark for mark in KINDS if mark in ds.dims or mark in ds), "")


def check_kind(path: str | os.PathLike[str], mark: str, content: str) -> None:
    """Check that a file is a result of a given kind, so that a new result of this kind may replace it.

    Parameters
    ----------
    path : path-like
        File that exists.
    mark : str
        A key of :data:`KINDS`.
    content : str
        Contents of the new file, for the message.

    Raises
    ------
    InputError
        If it is no file of this package, or a result of another kind.
    """
    with open_dataset(path) as existing:
        kind = kind_of(existing)
    if kind != mark:
        raise InputError(str(path), f"holds a result of another kind: name another file for this {content}")


def load(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a file of this package into memory; the file is closed again.

    Parameters
    ----------
    path : path-like
        File written by :func:`save`.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the file is missing, is not NetCDF, or was not written by this package.
    """
    with reading(path) as ds:
        return ds.load()


def open_dataset(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a file of this package. Values are read when they are needed.

    The dataset is a context manager that closes the file. Parameters and errors are those of :func:`load`.
    """
    _check_exists(path)
    with trailer.telling_damage(path), _small_caches():
        with trailer.opened(path):
            pass
        # Decoding would turn numbers of seconds into timedelta64.
        ds = xr.open_dataset(Path(path).resolve(), engine="netcdf4", decode_times=False)
        try:
            if missing := [name for name in SIGNATURE if name not in ds.attrs]:
                lacking = f"its attributes lack {' and '.join(missing)}; give a result file"
                raise InputError(str(path), f"was not written by ringsweep: {lacking}")
            _check_attributes(ds)
        except BaseException:
            ds.close()
            raise
    # That of an earlier version does not hold for what is made of the dataset.
    ds.attrs.pop("digest", None)
    return ds


@contextmanager
def reading(path: str | os.PathLike[str]) -> Iterator[xr.Dataset]:
    """A file of this package, open for a block in which an error means that the file is damaged or was made by hand.

    An error about a file that is what was written stays as it is.
    """
    with open_dataset(path) as ds:
        try:
            yield ds
        except (InputError, MemoryError):
            raise
        except Exception as error:
            if "NetCDF: " in str(error):
                raise InputError(str(path), "is not a NetCDF file, or is damaged") from error
            if isinstance(error, OSError) or trailer.check(path, whole=True):
                raise
            problem = f"is not what ringsweep writes ({type(error).__name__}: {error})"
            raise InputError(str(path), problem) from error


def check(path: str | os.PathLike[str]) -> bool:
    """Compare all bytes of a file with its seal.

    Returns
    -------
    bool
        Whether it has a seal. Files that another program or an older version wrote have none.

    Raises
    ------
    InputError
        If the file is not what was written, or as for :func:`load`.
    """
    _check_exists(path)
    with trailer.telling_damage(path):
        sealed = trailer.check(path, whole=True)
    open_dataset(path).close()
    return sealed


def verify(path: str | os.PathLike[str]) -> None:
    """Check that a file is what ringsweep wrote, byte for byte.

    The seal of a file shows damage. It is no signature: someone who wants to deceive can compute it too.

    Parameters
    ----------
    path : path-like
        File that ringsweep wrote.

    Raises
    ------
    InputError
        If the file is damaged, or has no seal because another program or an older version wrote it.

    Examples
    --------
    >>> import ringsweep
    >>> ds = ringsweep.run("my-sweep.yaml", "my-sweep.nc")
    >>> ringsweep.verify("my-sweep.nc")
    """
    if not check(path):
        raise InputError(str(path), "no seal: another program or an older version wrote it. Nothing is known")


def _check_exists(path: str | os.PathLike[str]) -> None:
    try:
        if not Path(path).exists():
            raise InputError(str(path), "does not exist")
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from error
    if not Path(path).is_file():
        raise InputError(str(path), "is not a file")
    if Path(path).suffix.lower() in (".yaml", ".yml"):
        raise InputError(str(path), f"is a configuration, not a result: `ringsweep run {path}` writes one")
    check_name(path)


def _check_attributes(ds: xr.Dataset) -> None:
    """Raise an error of any kind if attributes that are read later are missing or have another form."""
    for name, variable in ds.variables.items():
        classified = str(name) in OUTCOMES and OUTCOMES[str(name)].flags
        if classified and not all(isinstance(flag, int) for flag in meanings_of(variable)):
            raise ValueError(f"{name} has flags that are no whole numbers")
    for name in ("configuration", "versions", "solver"):
        json.loads(ds.attrs.get(name, "{}"))


def _encoding(variable: xr.Variable) -> dict[str, Any]:
    # With a fill value xarray would read integers as floats.
    encoding: dict[str, Any] = {"_FillValue": None}
    if variable.dtype.kind == "U" and "path" not in variable.attrs:
        # Characters: the library can crash if some handles of a file read its texts of variable length and others not.
        encoding["dtype"] = "S1"
    if variable.dtype.kind in "iuf" and variable.size >= COMPRESSED_FROM:
        encoding |= {"zlib": True, "complevel": 1, "fletcher32": True}
    return encoding
