"""Digests: one changed bit of a file is noticed wherever its numbers are used, and what changes no number is not."""

import json
import shutil
from itertools import product

import netCDF4
import numpy as np
import pytest
import xarray as xr

import ringsweep
from ringsweep import cli
from ringsweep.errors import InputError
from ringsweep.quantities import digest
from ringsweep.storage import netcdf

AXES = {"drive.amplitude": [0.5, 2.0, 8.0], "zone.half_angle": np.radians([10.0, 20.0])}
COMMANDS = {"info": [], "map": [], "run": ["-o", "again.nc"], "verify": []}


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


def flip(path, values):
    """Flip one bit of an array where the file holds it."""
    content = bytearray(path.read_bytes())
    wanted = np.asarray(values).tobytes()
    assert content.count(wanted) == 1
    content[content.index(wanted) + len(wanted) - 2] ^= 16
    path.write_bytes(content)


def without_digest(path):
    with netCDF4.Dataset(path, "a") as file:
        file.delncattr("digest")


def test_whole_file_is_verified(written, capsys):
    ringsweep.verify(written)
    assert cli.main(["verify", str(written)]) == 0
    assert cli.main(["info", str(written)]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == f"{written}: is what ringsweep wrote"
    assert out[-1] == "digest: the file is what ringsweep wrote"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "name"),
    [
        *product(("info", "map", "verify"), ("phi_max", "regime", "drive_amplitude", "t_separation_error")),
        # A sweep is repeated from its configuration and its axes alone.
        ("run", "drive_amplitude"),
    ],
)
def test_flipped_bit_of_a_small_file_is_told_by_every_command_that_uses_its_numbers(copy, capsys, command, name):
    flip(copy, netcdf.load(copy)[name].values)
    assert cli.main([command, str(copy), *COMMANDS[command]]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "is a part of a result, or another program changed it, or it is damaged" in message
    assert name in message


def test_flipped_bit_is_not_copied_into_a_new_file(scene, copy):
    """Without a digest a sweep took 1.14 for 0.57, and called it certified."""
    flip(copy, netcdf.load(copy)["phi_max"].values)
    with pytest.raises(InputError, match="phi_max"):
        ringsweep.sweep(scene, AXES, copy.with_name("new.nc"), reuse=copy, progress=False)
    assert not copy.with_name("new.nc").exists()


def test_changed_configuration_is_not_run(copy, capsys):
    content = copy.read_bytes()
    at = content.index(b"mu_k")
    copy.write_bytes(content[:at] + content[at:].replace(b"0.3", b"0.7", 1))
    for command in ("run", "simulate"):
        assert cli.main([command, str(copy), "-o", "again.nc"]) == 2
        assert "configuration" in capsys.readouterr().err


@pytest.mark.slow
def test_flipped_bit_of_a_large_file_is_told(scene, tmp_path, capsys):
    path = tmp_path / "out.nc"
    axes = {"drive.amplitude": np.geomspace(0.5, 8.0, 40), "zone.half_angle": np.radians(np.linspace(5, 40, 30))}
    with ringsweep.sweep(scene, axes, path, progress=False) as ds:
        stored = ds["phi_max"].encoding["original_shape"]
        assert ds["phi_max"].encoding["fletcher32"]
    assert stored == (40, 30)
    content = bytearray(path.read_bytes())
    # Beginnings of compressed chunks.
    for at in [k for k in range(len(content) - 2) if content[k : k + 2] == b"\x78\x01"]:
        content[at + 40] ^= 8
    path.write_bytes(content)
    for command in ("info", "map", "verify"):
        assert cli.main([command, str(path)]) == 2
        assert "damaged" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["history", "boundary"])
def test_every_kind_of_file_has_a_digest(scene, written, tmp_path, kind):
    path = tmp_path / "out.nc"
    if kind == "history":
        netcdf.save(ringsweep.simulate(scene, samples=100), path)
    else:
        netcdf.save(ringsweep.boundary(netcdf.load(written), "separating", tolerance=1e-2), path)
    ringsweep.verify(path)
    with netCDF4.Dataset(path, "a") as file:
        name = next(name for name, variable in file.variables.items() if variable.dtype == np.float64)
        file[name][0] += 1.0
    with pytest.raises(InputError, match=name):
        ringsweep.verify(path)


class TestOtherPrograms:
    def test_file_written_again_by_xarray_is_verified(self, copy):
        """Compression, chunks, fill values of floats, the order of attributes, and what is added, change no number."""
        with xr.open_dataset(copy, decode_times=False) as ds:
            again = ds.load()
        again.attrs = dict(reversed(again.attrs.items())) | {"history": "copied"}
        again["phi_max"].attrs["comment"] = "as in the talk"
        again["own"] = again["phi_max"] * 2.0
        encoding = {name: {"zlib": True, "chunksizes": (2, 1)} for name in ("phi_max", "regime", "reversals")}
        again.to_netcdf(copy.with_name("again.nc"), encoding=encoding)
        ringsweep.verify(copy.with_name("again.nc"))

    def test_selection_by_xarray_is_told_and_one_of_a_result_has_no_digest(self, copy, capsys):
        with xr.open_dataset(copy, decode_times=False) as ds:
            ds.isel(drive_amplitude=[0, 1]).to_netcdf("part.nc")
        assert cli.main(["verify", "part.nc"]) == 2
        assert "not as ringsweep wrote them are drive_amplitude" in capsys.readouterr().err
        with netcdf.open_dataset(copy) as ds:
            ds.isel(drive_amplitude=[0, 1]).to_netcdf("own.nc")
        assert cli.main(["verify", "own.nc"]) == 2
        assert "own.nc: no digest" in capsys.readouterr().err
        assert cli.main(["map", "own.nc"]) == 0

    def test_file_without_digest_is_read_and_said_to_be_without(self, scene, copy, capsys, caplog):
        without_digest(copy)
        assert cli.main(["verify", str(copy), str(copy)]) == 2
        assert capsys.readouterr().err.count(f"{copy}: no digest") == 2
        assert cli.main(["info", str(copy)]) == 0
        assert "digest: none" in capsys.readouterr().out
        ringsweep.sweep(scene, AXES, reuse=copy, progress=False)
        assert "out.nc has no digest" in caplog.text


def damage(path, name):
    """Damage an attribute of a file that has no digest."""
    without_digest(path)
    with netCDF4.Dataset(path, "a") as file:
        match name:
            case "flags":
                file["regime"].delncattr("flag_meanings")
            case "numbers":
                file["motion"].setncattr("flag_meanings", 5)
            case "more flags":
                file["certified"].setncattr("flag_values", np.arange(3, dtype="int8"))
            case "digest":
                file.setncattr("digest", '{"variables": {}}')
            case _:
                file.setncattr(name, "{")


@pytest.mark.parametrize("name", ["flags", "numbers", "more flags", "digest", "configuration", "versions"])
@pytest.mark.parametrize("command", COMMANDS)
def test_damaged_attribute_is_told_by_every_command(copy, capsys, command, name):
    damage(copy, name)
    if command == "run" and name in ("flags", "numbers", "more flags", "versions"):
        assert cli.main(["run", str(copy), "-o", str(copy)]) == 2
    else:
        assert cli.main([command, str(copy), *COMMANDS[command]]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "damaged" in message


def test_digests_of_another_file_do_not_pass(copy, written):
    with netCDF4.Dataset(copy, "a") as file:
        found = json.loads(file.digest)
        assert set(found) == {"algorithm", "dimensions", "attributes", "variables", "block"}
        found["variables"]["regime"] = found["variables"]["motion"]
        file.digest = json.dumps(found)
    with pytest.raises(InputError, match="regime"):
        ringsweep.verify(copy)


@pytest.mark.parametrize("emptied", [["variables"], ["attributes"], ["variables", "attributes", "dimensions"]])
def test_digest_without_entries_vouches_for_nothing(copy, capsys, emptied):
    with netCDF4.Dataset(copy, "a") as file:
        file.digest = json.dumps(json.loads(file.digest) | {key: {} for key in emptied})
        file["phi_max"][0, 0] = 0.5
    assert cli.main(["verify", str(copy)]) == 2
    assert cli.main(["run", str(copy), "-o", "again.nc"]) == 2
    assert capsys.readouterr().err.count("\n") == 2


@pytest.mark.parametrize("name", ["phi_max", "drive_amplitude", "configuration"])
def test_what_a_result_is_read_by_has_a_digest(copy, name):
    with netCDF4.Dataset(copy, "a") as file:
        found = json.loads(file.digest)
        for part in ("variables", "attributes"):
            found[part].pop(name, None)
        file.digest = json.dumps(found)
    with pytest.raises(InputError, match=name):
        ringsweep.verify(copy)


def test_file_with_replaced_digests_has_one_answer(copy, capsys):
    """A digest is no signature: who replaces both is believed, by every command."""
    with netCDF4.Dataset(copy, "a") as file:
        file.title = "another title"
        found = json.loads(file.digest)
        found["attributes"]["title"] = digest.of_attribute(file.title)
        file.digest = json.dumps(found)
    assert cli.main(["verify", str(copy)]) == 0
    assert cli.main(["run", str(copy), "-o", str(copy)]) == 0
    assert "holds this sweep already" in capsys.readouterr().out
