"""NetCDF files: written whole or not at all, and read back before they count."""

from __future__ import annotations

import json
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ringsweep.errors import InputError

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
        trial = _sibling(target)
        trial.touch(exist_ok=False)
        trial.unlink()
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
    ds = ds.drop_encoding()
    ds.attrs = _storable(ds.attrs)
    for variable in ds.variables.values():
        variable.attrs = _storable(variable.attrs)
    with replacing(path) as temporary:
        ds.to_netcdf(
            temporary,
            format="NETCDF4",
            engine="netcdf4",
            encoding={name: _encoding(variable) for name, variable in ds.variables.items()},
        )
        if not _read(temporary).equals(ds):
            raise OSError(f"{path}: the file does not read back as it was written; the disk may be full or faulty")


def load(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a file of this package into memory; the file is closed again.

    Parameters
    ----------
    path : path-like
        File written by `save`.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the file is missing, is not NetCDF, or was not written by this package.
    """
    if not Path(path).is_file():
        raise InputError(str(path), "is not a file" if Path(path).exists() else "does not exist")
    try:
        ds = _read(Path(path))
    except PermissionError as error:
        raise InputError(str(path), "may not be read: permission denied") from error
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(str(path), "is not a NetCDF file, or is damaged") from error
    missing = [name for name in SIGNATURE if name not in ds.attrs]
    if missing:
        raise InputError(
            str(path), f"was not written by ringsweep: its attributes lack {' and '.join(missing)}; give a result file"
        )
    return ds


def _sibling(target: Path) -> Path:
    return target.with_name(f".ringsweep-{secrets.token_hex(8)}{target.suffix}")


def _read(path: Path) -> xr.Dataset:
    # Seconds are numbers here; decoding would turn them into timedelta64 wherever a unit spells them out.
    return xr.load_dataset(path.resolve(), engine="netcdf4", decode_times=False)


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
