"""The seal of a file: one changed bit is told by every command, before the HDF5 library sees the file."""

import shutil

import netCDF4
import numpy as np
import pytest
import xarray as xr
from refusals import refused

import ringsweep
from ringsweep import cli
from ringsweep.quantities import trailer
from ringsweep.storage import netcdf

AXES = {"drive.amplitude": [0.5, 2.0, 8.0], "zone.half_angle": np.radians([10.0, 20.0])}
COMMANDS = ["verify", "info", "map", "run", "simulate", "precision"]


@pytest.fixture(scope="module")
def written(scene, tmp_path_factory):
    """File of a sweep of six cells."""
    path = tmp_path_factory.mktemp("written") / "out.nc"
    ringsweep.sweep(scene, AXES, path, progress=False).close()
    return path


@pytest.fixture
def copy(written, tmp_path, monkeypatch):
    """A copy of the file, in the working directory."""
    monkeypatch.chdir(tmp_path)
    return shutil.copy(written, tmp_path / "out.nc")


def flip(path, at):
    """Flip one bit of a file."""
    content = bytearray(path.read_bytes())
    content[at] ^= 16
    path.write_bytes(content)


def without_seal(path):
    """Open a file to change it, by which the HDF5 library removes the seal."""
    netCDF4.Dataset(path, "a").close()
    assert trailer._MARK not in path.read_bytes()


def test_whole_file_is_verified(written, capsys):
    ringsweep.verify(written)
    assert cli.main(["verify", str(written)]) == 0
    assert cli.main(["info", str(written)]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == f"{written}: is what ringsweep wrote"
    assert out[-1] == "seal: the file is what ringsweep wrote"


@pytest.mark.parametrize("command", COMMANDS)
def test_flipped_bit_is_told_by_every_command_and_no_library_sees_the_file(copy, capsys, monkeypatch, command):
    values = netcdf.load(copy)["phi_max"].values.tobytes()
    flip(copy, copy.read_bytes().index(values) + 6)
    monkeypatch.setattr(netCDF4, "Dataset", None)
    assert cli.main([command, str(copy)]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "out.nc: is damaged: its bytes are not those that ringsweep wrote" in message


def test_flipped_bit_is_not_copied_into_a_new_file(scene, copy):
    """Without a seal a sweep took 1.14 for 0.57, and called it certified."""
    flip(copy, 20_000)
    refused("is damaged", ringsweep.sweep, scene, AXES, copy.with_name("new.nc"), reuse=copy, progress=False)
    assert not copy.with_name("new.nc").exists()


@pytest.mark.parametrize("at_once", [trailer.AT_ONCE, 0], ids=["by its seal", "by checksums of its chunks"])
def test_damage_to_compressed_values_is_told(tmp_path, monkeypatch, at_once, capsys):
    """The seal of a very large file is compared only by commands that read all of it."""
    monkeypatch.setattr(trailer, "AT_ONCE", at_once)
    path, noise = tmp_path / "out.nc", np.random.default_rng(1).normal(size=(40, 30))
    attributes = {"Conventions": "CF-1.11", "ringsweep_version": "0"}
    netcdf.save(xr.Dataset({"phi_max": (("x", "y"), noise)}, attrs=attributes), path)
    # The beginning of a compressed chunk.
    flip(path, path.read_bytes().index(b"\x78\x01") + 40)
    refused("damaged", netcdf.load, path)
    assert cli.main(["verify", str(path)]) == 2
    assert "is damaged" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["history", "boundary"])
def test_every_kind_of_file_has_a_seal(scene, written, tmp_path, kind):
    path = tmp_path / "out.nc"
    if kind == "history":
        netcdf.save(ringsweep.simulate(scene, samples=100), path)
    else:
        netcdf.save(ringsweep.boundary(netcdf.load(written), "separating", tolerance=1e-2), path)
    ringsweep.verify(path)
    flip(path, path.stat().st_size // 2)
    refused("is damaged", ringsweep.verify, path)


class TestWithoutSeal:
    """Files that another program or an older version wrote are read, and every command says so."""

    def test_other_readers_ignore_the_seal_and_a_copy_that_they_write_has_none(self, copy, caplog, capsys):
        with xr.open_dataset(copy, decode_times=False) as ds:
            ds.isel(drive_amplitude=[0, 1]).to_netcdf("part.nc")
        assert cli.main(["map", "part.nc"]) == 0
        assert "part.nc has no seal, so another program or an older version wrote it" in caplog.text
        assert cli.main(["verify", "part.nc"]) == 2
        assert "part.nc: no seal: another program" in capsys.readouterr().err

    def test_file_that_another_program_changed_in_place_has_none(self, scene, copy, capsys, caplog):
        without_seal(copy)
        assert cli.main(["info", str(copy)]) == 0
        assert "seal" not in capsys.readouterr().out
        assert caplog.text.count("has no seal") == 1
        assert cli.main(["verify", str(copy), str(copy)]) == 2
        assert capsys.readouterr().err.count(f"{copy}: no seal") == 2
        ringsweep.sweep(scene, AXES, reuse=copy, progress=False)
        assert caplog.text.count("out.nc has no seal") == 1

    def test_zeros_over_the_seal_are_not_silent(self, copy, caplog):
        copy.write_bytes(copy.read_bytes()[: -trailer._LENGTH].ljust(copy.stat().st_size, b"\0"))
        netcdf.load(copy)
        assert "out.nc has no seal" in caplog.text

    def test_digests_of_an_earlier_version_are_not_taken_over(self, copy):
        with netCDF4.Dataset(copy, "a") as file:
            file.digest = "{}"
        assert "digest" not in netcdf.load(copy).attrs

    @pytest.mark.parametrize("name", ["flags", "numbers", "more flags", "configuration", "versions"])
    @pytest.mark.parametrize("command", ["info", "map", "run", "verify"])
    def test_damaged_attribute_is_told_by_every_command(self, copy, capsys, command, name):
        with netCDF4.Dataset(copy, "a") as file:
            match name:
                case "flags":
                    file["regime"].delncattr("flag_meanings")
                case "numbers":
                    file["motion"].setncattr("flag_meanings", 5)
                case "more flags":
                    file["certified"].setncattr("flag_values", np.arange(3, dtype="int8"))
                case _:
                    file.setncattr(name, "{")
        assert cli.main([command, str(copy), *(["-o", str(copy)] if command == "run" else [])]) == 2
        assert "damaged" in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize("command", COMMANDS)
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
