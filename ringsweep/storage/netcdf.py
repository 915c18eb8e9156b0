"""NetCDF files: written completely or not at all, and read back for comparison."""

from __future__ import annotations

import json
import math
import os
import stat
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

import netCDF4
import numpy as np
import xarray as xr
from numpy.typing import NDArray
from xarray.backends import NetCDF4DataStore

from ringsweep.errors import InputError
from ringsweep.quantities import digest, trailer
from ringsweep.quantities.digest import Digests
from ringsweep.quantities.variables import MISSING, OUTCOMES, Variable, error_attribute, meanings_of
from ringsweep.storage.chunks import Layout
from ringsweep.storage.files import WorkingFolder, check_name, put_in_place, replacing

#: Attributes that every file of this package has.
SIGNATURE = ("Conventions", "ringsweep_version")

#: Variables with fewer elements are not compressed: the index of their chunks would take more than compression saves.
COMPRESSED_FROM = 1024

# Number of differing names that a message lists.
_MAX_NAMED = 4

# Bytes of each variable of an open file that are kept: a few chunks.
_CACHE = 1 << 20


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
    with replacing(path) as temporary, _naming_the_cause(Path(path)):
        with _created(temporary) as file:
            _add(ds, file)
            _record_digests(file, ds)
        _read_back(temporary)
        trailer.seal(temporary)


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
        Declarations of the columns; their dimensions are those besides the grid.
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
        with _naming_the_cause(target):
            with _created(temporary) as file:
                _add(frame, file)
                _write_chunks(file, frame, variables, layout, chunks, gaps)
            _read_back(temporary)
            trailer.seal(temporary)
            put_in_place(temporary, target)
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextmanager
def _naming_the_cause(target: Path) -> Iterator[None]:
    try:
        yield
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


def _read_back(path: Path) -> None:
    try:
        changed = altered(path, whole=True, trusted=True)
    except InputError as error:
        raise OSError("the file cannot be read back") from error
    if changed:
        raise OSError("the file does not read back as it was written")


def _add(ds: xr.Dataset, file: Any) -> None:
    """Write a dataset into an open file, which xarray must not close."""
    ds = ds.drop_encoding()
    ds.attrs = _storable(ds.attrs)
    for variable in ds.variables.values():
        variable.attrs = _storable(variable.attrs)
    encoding = {name: _encoding(variable) for name, variable in ds.variables.items()}
    ds.dump_to_store(NetCDF4DataStore(file), encoding=encoding)


def _write_chunks(
    file: Any,
    frame: xr.Dataset,
    variables: Mapping[str, Variable],
    layout: Layout,
    chunks: Iterable[tuple[tuple[slice, ...], dict[str, NDArray[Any]]]],
    gaps: Collection[str],
) -> None:
    """Add the columns and the digests to a file."""
    dims = tuple(map(str, frame.sizes))[: len(layout.sizes)]
    others = " ".join(str(name) for name in frame.coords if name not in frame.dims)
    digests: dict[str, Any] = {}
    for region, columns in chunks:
        for name, column in columns.items():
            if name not in digests:
                fill = MISSING if name in gaps else False
                inner = column.shape[len(dims) :]
                for dim, size in zip(variables[name].dims, inner, strict=True):
                    if dim not in file.dimensions:
                        file.createDimension(dim, size)
                all_dims = (*dims, *variables[name].dims)
                variable = file.createVariable(name, column.dtype, all_dims, fill_value=fill, **_chunked(layout, inner))
                variable.set_auto_maskandscale(False)
                _cache_one_chunk(variable)
                described = variables[name].attributes | error_attribute(name, columns)
                variable.setncatts(described | ({"coordinates": others} if others else {}))
                digests[name] = digest.of_variable(variable)
            file[name][(*region, ...)] = column
            digest.add(digests[name], column)
    _record_digests(file, frame, digests, layout)


def _record_digests(
    file: Any, ds: xr.Dataset, digests: Mapping[str, Any] = MappingProxyType({}), layout: Layout | None = None
) -> None:
    """Write the digests of a dataset into its file, together with those of columns that were written chunk by chunk."""
    own = {name: digest.of_variable(file[name], [ds[name].values]) for name in map(str, ds.variables)}
    covered = [name for name in file.ncattrs() if name not in digest.FREE]
    recorded = Digests(
        dimensions={name: len(dimension) for name, dimension in file.dimensions.items()},
        attributes={name: digest.of_attribute(file.getncattr(name)) for name in covered},
        variables={name: one.hexdigest() for name, one in {**own, **digests}.items()},
        block=None if layout is None else list(layout.chunk),
    )
    file.setncattr(digest.ATTRIBUTE, recorded.text)


def altered(path: str | os.PathLike[str], *, whole: bool, trusted: bool = False) -> list[str] | None:
    """Names of what is not as it was written in a file; None if the file has no digests.

    Parameters
    ----------
    path : path-like
    whole : bool
        Whether to read all variables, or only those whose values have no checksums of their own.
    trusted : bool
        Whether the HDF5 library is given the file without a look at its seal.

    Raises
    ------
    InputError
        If the file is no NetCDF file, or is damaged.
    """
    if not trusted:
        with _reading_file(path):
            trailer.check(path, whole=whole)
    with _reading_file(path), trailer.opened(path) as file:
        recorded = Digests.read(file)
        if recorded is None:
            return None
        checked = set()
        for name, variable in file.variables.items():
            _cache_one_chunk(variable)
            filters: Any = variable.filters()
            if not whole and filters and filters["fletcher32"]:
                checked.add(name)
        # Other programs may add names, but what a result is read by has a digest.
        needed = [name for name, one in file.variables.items() if name in OUTCOMES or "path" in one.ncattrs()]
        names = [name for name in dict.fromkeys((*recorded.variables, *needed)) if name not in checked]
        attributes = dict.fromkeys((*recorded.attributes, *{"configuration", *SIGNATURE}.intersection(file.ncattrs())))
        return recorded.altered(file, attributes, names, _blocks)


def _blocks(shape: Sequence[int], block: list[int]) -> Iterator[tuple[Any, ...]]:
    for _, _, region in Layout(shape[: len(block)], block).chunks():
        yield (*region, ...)


@contextmanager
def _small_caches() -> Iterator[None]:
    """Let files that are opened in the block keep few chunks: by default it would be 64 MiB of each variable."""
    before = netCDF4.get_chunk_cache()
    netCDF4.set_chunk_cache(_CACHE)
    try:
        yield
    finally:
        netCDF4.set_chunk_cache(*before)


def _cache_one_chunk(variable: Any) -> None:
    # Each chunk is used once.
    if variable.dtype is not str and variable.chunking() not in (None, "contiguous"):
        size = math.prod(variable.chunking()) * np.dtype(variable.dtype).itemsize
        variable.set_var_chunk_cache(size=2 * size, nelems=11, preemption=1.0)


def _chunked(layout: Layout, inner: tuple[int, ...]) -> dict[str, Any]:
    if layout.total * math.prod(inner) < COMPRESSED_FROM:
        return {}
    return {"compression": "zlib", "complevel": 1, "fletcher32": True, "chunksizes": (*layout.chunk, *inner)}


def check_kind(path: str | os.PathLike[str], mark: str, content: str) -> None:
    """Check that a file is a result of a given kind, so that a new result of this kind may replace it.

    Parameters
    ----------
    path : path-like
        File that exists.
    mark : {"regime", "time", "contender", "probability", "standard_error", "vertex"}
        Dimension or variable by which the kind is known: sweep, history, error against run time, sampled sweep,
        fit, or boundary.
    content : str
        Contents of the new file, for the message.

    Raises
    ------
    InputError
        If it is no file of this package, or a result of another kind.
    """
    with open_dataset(path) as existing:
        marks = ("contender", "time", "probability", "standard_error", "vertex", "regime")
        kinds = [kind for kind in marks if kind in existing.dims or kind in existing]
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
    with reading(path) as ds:
        return ds.load()


def open_dataset(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a file of this package. Values are read when they are needed.

    Attributes, and values that have no checksum of their own, are compared with the digests in the file. The dataset
    does not have these, because they do not hold for what is made of it. It is a context manager that closes the file.
    Parameters and errors are those of :func:`load`.
    """
    _check_exists(path)
    if changed := altered(path, whole=False):
        raise InputError(str(path), _difference(changed))
    with _reading_file(path), _small_caches():
        # Decoding would turn numbers of seconds into timedelta64.
        ds = xr.open_dataset(Path(path).resolve(), engine="netcdf4", decode_times=False)
    try:
        missing = [name for name in SIGNATURE if name not in ds.attrs]
        if missing:
            raise InputError(
                str(path),
                f"was not written by ringsweep: its attributes lack {' and '.join(missing)}; give a result file",
            )
        with _reading_file(path):
            _check_attributes(ds)
    except InputError:
        ds.close()
        raise
    ds.attrs.pop(digest.ATTRIBUTE, None)
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
                raise InputError(str(path), _DAMAGED) from error
            if isinstance(error, OSError) or altered(path, whole=True) == []:
                raise
            problem = f"is not what ringsweep writes ({type(error).__name__}: {error})"
            raise InputError(str(path), problem) from error


def check(path: str | os.PathLike[str]) -> bool:
    """Compare all that a file holds with its digests.

    Returns
    -------
    bool
        Whether it has digests. Files of versions before 0.1 have none.

    Raises
    ------
    InputError
        If the file is not what was written, or as for :func:`load`.
    """
    _check_exists(path)
    changed = altered(path, whole=True)
    if changed:
        raise InputError(str(path), _difference(changed))
    open_dataset(path).close()
    return changed is not None


def verify(path: str | os.PathLike[str]) -> None:
    """Check that a file holds what ringsweep wrote: every value, its unit and meaning, and every attribute.

    The digests that a file holds cover neither compression and chunks, nor attributes and variables that other programs
    add. They show damage and changes, but they are no signature: someone who wants to deceive can compute them too.

    Parameters
    ----------
    path : path-like
        File that ringsweep wrote.

    Raises
    ------
    InputError
        If the file is damaged, was changed, or has no digest because an older version wrote it.

    Examples
    --------
    >>> import ringsweep
    >>> ds = ringsweep.run("my-sweep.yaml", "my-sweep.nc")
    >>> ringsweep.verify("my-sweep.nc")
    """
    if not check(path):
        raise InputError(
            str(path), "no digest: xarray or an older version wrote it, or it was removed. Nothing is known"
        )


_DAMAGED = "is not a NetCDF file, or is damaged"


def _difference(names: Sequence[str]) -> str:
    listed = ", ".join(names[:_MAX_NAMED]) + f" and {len(names) - _MAX_NAMED} more" * (len(names) > _MAX_NAMED)
    return (
        f"{digest.ALTERED}: not as ringsweep wrote them are {listed} "
        f'(a part or a change that is wanted: `del ds.attrs["{digest.ATTRIBUTE}"]` in xarray, and save ds)'
    )


def _check_exists(path: str | os.PathLike[str]) -> None:
    try:
        kind = Path(path).stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(str(path), "does not exist") from None
    except (OSError, ValueError) as error:
        raise InputError(str(path), f"cannot be read: {getattr(error, 'strerror', error)}") from error
    if not stat.S_ISREG(kind):
        raise InputError(str(path), "is not a file")
    if Path(path).suffix.lower() in (".yaml", ".yml"):
        raise InputError(str(path), f"is a configuration, not a result: `ringsweep run {path}` writes one")
    check_name(path)


@contextmanager
def _reading_file(path: str | os.PathLike[str]) -> Iterator[None]:
    try:
        yield
    except PermissionError as error:
        raise InputError(str(path), "cannot be read: permission denied") from error
    except InputError as error:
        raise InputError(str(path), error.problem) from error
    except Exception as error:
        # On a damaged file the libraries raise errors of many kinds.
        raise InputError(str(path), _DAMAGED) from error


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


def _storable(attributes: dict[Any, Any]) -> dict[str, Any]:
    return {str(name): _storable_value(value) for name, value in attributes.items()}


def _storable_value(value: Any) -> Any:
    if isinstance(value, str):
        return value
    kind = np.asarray(value).dtype.kind if isinstance(value, int | float | np.generic | np.ndarray) else "O"
    return value if kind in "iuf" else json.dumps(value, default=_plain)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)
