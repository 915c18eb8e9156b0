"""The seal behind the end of a file: what the HDF5 library could hang on is told before the library sees it."""

import subprocess

import netCDF4
import numpy as np
import pytest
import xarray as xr

from ringsweep import cli
from ringsweep.errors import InputError
from ringsweep.quantities import trailer
from ringsweep.storage import netcdf


@pytest.fixture
def path(tmp_path):
    regime = ("x", np.zeros(50, dtype="int8"), {"flag_values": np.int8([0]), "flag_meanings": "resting"})
    attributes = {"Conventions": "CF-1.11", "ringsweep_version": "0"}
    netcdf.save(xr.Dataset({"regime": regime}, attrs=attributes), tmp_path / "out.nc")
    return tmp_path / "out.nc"


def damage(path):
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 2] ^= 1
    path.write_bytes(raw)


def test_sound_file_is_read_without_another_process(path, monkeypatch):
    monkeypatch.setattr(subprocess, "run", None)
    assert netcdf.check(path)


@pytest.mark.parametrize("command", ["verify", "info", "map", "run", "simulate", "precision"])
def test_file_on_which_the_library_hangs_is_told_by_every_command(path, monkeypatch, capsys, command):
    damage(path)
    monkeypatch.setattr(trailer, "_OPENING", "import time; time.sleep(60)")
    monkeypatch.setattr(trailer, "_LEAST", 0.3)
    assert cli.main([command, str(path)]) == 2
    assert f"{path}: is damaged: the HDF5 library cannot read it" in capsys.readouterr().err


def test_file_on_which_the_library_crashes_is_told(path, monkeypatch):
    damage(path)
    monkeypatch.setattr(trailer, "_OPENING", "import os; os.abort()")
    with pytest.raises(InputError, match="the HDF5 library cannot read it"):
        netcdf.load(path)


def test_file_that_another_program_changed_is_read_as_one_without_a_seal(path):
    with netCDF4.Dataset(path, "a") as file:
        file.institution = "a laboratory"
    assert netcdf.check(path)
    assert netcdf.load(path).attrs["institution"] == "a laboratory"


@pytest.mark.parametrize("command", ["verify", "info", "map", "run", "simulate", "precision"])
@pytest.mark.parametrize(
    ("side", "problem"),
    [(32768, "declares 1.07e+09 cells: a file holds at most 1e+08"), (8192, "bytes of numbers, which")],
    ids=["more cells than a sweep has", "more numbers than the file has"],
)
def test_numbers_that_are_declared_but_not_there_are_never_read(tmp_path, capsys, command, side, problem):
    """Chunks that nobody wrote take no space on the disk, but all of it in memory."""
    with netCDF4.Dataset(tmp_path / "big.nc", "w") as file:
        file.setncatts({"Conventions": "CF-1.11", "ringsweep_version": "0", "configuration": "{}"})
        file.createDimension("x", side)
        file.createDimension("y", side)
        for name, kind in (("regime", "i1"), ("t_end", "f8")):
            file.createVariable(name, kind, ("x", "y"), chunksizes=(256, 256), compression="zlib")
    assert (tmp_path / "big.nc").stat().st_size < 40_000
    assert cli.main([command, str(tmp_path / "big.nc")]) == 2
    message = capsys.readouterr().err
    assert problem in message
    assert message.count("\n") == 1


def test_other_readers_ignore_the_seal(path):
    assert trailer._MARK in path.read_bytes()[-trailer._LENGTH :]
    with xr.open_dataset(path) as ds:
        assert ds.sizes == {"x": 50}
