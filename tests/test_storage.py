"""Result files: written completely or not at all, and read back unchanged."""

import os
import stat

import netCDF4
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from refusals import refused

import ringsweep
from ringsweep import plots
from ringsweep.plots.films import check_animation
from ringsweep.quantities.variables import OUTCOMES
from ringsweep.storage import files, netcdf, provenance


@pytest.fixture
def sweep() -> xr.Dataset:
    shape = (40, 50)
    dims = ("drive_amplitude", "zone_half_angle")
    regime = np.arange(2000, dtype="int8").reshape(shape) % 5
    t_separation = np.where(regime == 3, 1.5, np.nan)
    return xr.Dataset(
        {
            "regime": (dims, regime, OUTCOMES["regime"].attributes),
            "t_separation": (dims, t_separation, OUTCOMES["t_separation"].attributes),
            "steps": (dims, np.full(shape, 2**40), OUTCOMES["steps"].attributes),
        },
        coords={
            "drive_amplitude": ("drive_amplitude", np.geomspace(0.1, 10, 40), {"units": "rad s-1"}),
            "zone_half_angle": ("zone_half_angle", np.linspace(0.1, 1, 50), {"units": "rad"}),
            "law": ("drive_amplitude", np.array(["arctan"] * 40)),
        },
        attrs={"Conventions": "CF-1.11", "ringsweep_version": "0", "title": "ω against Δθ"},
    )


def test_loaded_dataset_equals_the_saved_one(sweep, tmp_path):
    netcdf.save(sweep, tmp_path / "out.nc")
    loaded = netcdf.load(tmp_path / "out.nc")
    xr.testing.assert_identical(loaded, sweep)
    for name, variable in sweep.data_vars.items():
        assert loaded[name].dtype == variable.dtype
    assert loaded["regime"].attrs["flag_values"].dtype == np.int8


def test_no_variable_has_a_fill_value_and_large_variables_are_compressed(sweep, tmp_path):
    netcdf.save(sweep, tmp_path / "out.nc")
    with netCDF4.Dataset(tmp_path / "out.nc") as file:
        assert not [name for name, variable in file.variables.items() if "_FillValue" in variable.ncattrs()]
        assert file["regime"].dtype == np.int8
        assert file["regime"].filters()["zlib"]
        assert not file["zone_half_angle"].filters()["zlib"]
        assert file["zone_half_angle"].units == "rad"


@pytest.mark.parametrize("failure", [OSError("disk full"), KeyboardInterrupt()])
def test_failing_save_leaves_the_old_file_and_no_temporary_file(sweep, tmp_path, monkeypatch, failure):
    path = tmp_path / "out.nc"
    netcdf.save(sweep, path)
    before = path.read_bytes()

    def fail(self, *_, **__):
        raise failure

    monkeypatch.setattr(xr.Dataset, "dump_to_store", fail)
    with pytest.raises(type(failure)):
        netcdf.save(sweep, path)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["out.nc"]


def test_file_that_reads_back_differently_is_removed(sweep, tmp_path, monkeypatch):
    write = xr.Dataset.dump_to_store
    monkeypatch.setattr(
        xr.Dataset, "dump_to_store", lambda self, *a, **k: write(self.assign(steps=self.steps + 1), *a, **k)
    )
    with pytest.raises(OSError, match="does not read back"):
        netcdf.save(sweep, tmp_path / "out.nc")
    assert not os.listdir(tmp_path)


def test_saving_follows_a_symbolic_link_and_keeps_usual_permissions(sweep, tmp_path):
    (tmp_path / "plain").touch()
    (tmp_path / "link.nc").symlink_to(tmp_path / "real.nc")
    netcdf.save(sweep, tmp_path / "link.nc")
    assert (tmp_path / "link.nc").is_symlink()
    assert (tmp_path / "real.nc").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("missing/out.nc", "does not exist"),
        ("file/out.nc", "not a folder"),
        (".", "is a folder"),
        ("n" * 300 + ".nc", "cannot be written"),
    ],
)
def test_unwritable_path_is_refused(tmp_path, name, problem):
    (tmp_path / "file").touch()
    assert refused(problem, files.check_writable, tmp_path / name).path == str(tmp_path / name)
    assert os.listdir(tmp_path) == ["file"]


WRITERS = {
    "run.nc": netcdf.save,
    "run.svg": lambda _, path: plots.save(Figure(), path),
    "run.html": plots.save_page,
    "run.gif": lambda _, path: check_animation(path),
}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with a name")
@pytest.mark.parametrize(("name", "write"), WRITERS.items())
def test_no_writer_replaces_a_pipe(sweep, tmp_path, name, write):
    os.mkfifo(tmp_path / name)
    refused("is a device or a pipe", write, sweep, tmp_path / name)
    assert stat.S_ISFIFO((tmp_path / name).stat().st_mode)


def test_folder_without_permission_to_write_is_refused(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.TemporaryFile", refuse)
    refused("Permission denied", files.check_writable, tmp_path / "out.nc")


def test_load_names_the_problem_of_a_file(tmp_path):
    (tmp_path / "text.nc").write_text("time,phi\n0,0\n")
    xr.Dataset({"a": 1}, attrs={"Conventions": "CF-1.11"}).to_netcdf(tmp_path / "foreign.nc")
    for name, problem in {
        "none.nc": "does not exist",
        ".": "is not a file",
        "text.nc": "is not a NetCDF file",
        "foreign.nc": "not written by ringsweep: its attributes lack ringsweep_version",
    }.items():
        refused(problem, netcdf.load, tmp_path / name)


def test_words_replace_flags_and_a_variable_without_flags_is_refused():
    flags = {"long_name": "regime", "flag_values": np.array([0, 3], "int8"), "flag_meanings": "resting separating"}
    told = ringsweep.words(xr.DataArray([[3, 0, 7]], dims=("a", "b"), attrs=flags))
    assert told.values.tolist() == [["separating", "resting", ""]]
    assert told.dims == ("a", "b")
    assert not told.attrs, "a comparison would inherit them"
    refused("phi_end", ringsweep.words, xr.DataArray([0.5], name="phi_end"))
    refused(r"data: is not a classification, such as ds\.regime", ringsweep.words, xr.Dataset({"regime": told}))


def test_processor_with_a_feature_turned_off_has_another_name(monkeypatch):
    """It rounds sums of products differently, so a file must not name both alike."""
    names = []
    for features in ("+fma,+avx2", "-fma,+avx2"):
        monkeypatch.setattr(provenance.numba.config, "CPU_NAME", "generic")
        monkeypatch.setattr(provenance.numba.config, "CPU_FEATURES", features)
        names.append(provenance.processor.__wrapped__())
    assert len(set(names)) == 2
    assert all(name.startswith("generic-") for name in names)
