"""Reuse of the cells of an earlier sweep."""

import shutil

import netCDF4
import numpy as np
import pytest
import xarray as xr
from refusals import refused

import ringsweep
from ringsweep import cli, plots
from ringsweep.storage import netcdf
from ringsweep.storage.checkpoint import Checkpoint

AMPLITUDES, WIDTHS = np.linspace(0.5, 4.5, 5), np.radians([10.0, 20.0, 30.0])
COARSE = {"drive.amplitude": AMPLITUDES, "zone.half_angle": WIDTHS}


@pytest.fixture(scope="module")
def earlier(scene, tmp_path_factory):
    """File of an earlier sweep of 5 x 3 cells."""
    path = tmp_path_factory.mktemp("earlier") / "coarse.nc"
    ringsweep.sweep(scene, COARSE, path, progress=False).close()
    return path


@pytest.fixture
def computed(monkeypatch):
    """Number of cells in each call that stores cells."""
    counts = []
    put = Checkpoint.put
    monkeypatch.setattr(Checkpoint, "put", lambda self, p, *rest: (counts.append(len(p)), put(self, p, *rest)))
    return counts


def taken(scene, axes, earlier, tmp_path, caplog, **options):
    """Number of cells that a sweep takes from the earlier file. The results must equal those without reuse."""
    with caplog.at_level("INFO", logger="ringsweep"):
        found = ringsweep.sweep(scene, axes, tmp_path / "new.nc", reuse=earlier, progress=False, **options)
    alone = ringsweep.sweep(scene, {name: found[name.replace(".", "_")].values for name in axes}, progress=False)
    for name in alone.data_vars:
        assert found[name].values.tobytes() == alone[name].values.tobytes(), name
    found.close()
    (line,) = [record.getMessage() for record in caplog.records if "taken from" in record.getMessage()]
    return int(line.split()[0])


@pytest.mark.parametrize(
    ("axes", "cells"),
    [
        ({"drive.amplitude": np.linspace(0.5, 4.5, 9), "zone.half_angle": WIDTHS}, 15),
        ({"zone.half_angle": [np.radians(25.0), *WIDTHS[::-1]], "drive.amplitude": [9.0, *AMPLITUDES[1:]]}, 12),
        ({"drive.amplitude": AMPLITUDES[:2], "initial.omega": [0.0, 1.0], "zone.half_angle": WIDTHS}, 6),
    ],
    ids=["finer", "wider in another order", "another axis through the value of the scene"],
)
def test_grid_takes_the_cells_that_it_shares(scene, earlier, tmp_path, caplog, axes, cells):
    assert taken(scene, axes, earlier, tmp_path, caplog) == cells


def test_line_through_the_earlier_grid_takes_all_its_cells(scene, earlier, tmp_path, caplog):
    along = scene | {"zone": {"half_angle": WIDTHS[1]}}
    assert taken(along, {"drive.amplitude": AMPLITUDES}, earlier, tmp_path, caplog) == 5


def test_points_take_cells_of_a_grid_and_a_grid_takes_points(scene, earlier, tmp_path, caplog):
    points = {"drive.amplitude": [0.5, 1.5, 1.6], "zone.half_angle": [*WIDTHS[:2], WIDTHS[2]]}
    config = {"scene": scene, "sweep": {"points": points}}
    with caplog.at_level("INFO", logger="ringsweep"):
        ringsweep.run(config, tmp_path / "points.nc", reuse=earlier, progress=False).close()
        ringsweep.sweep(scene, COARSE, tmp_path / "grid.nc", reuse=tmp_path / "points.nc", progress=False).close()
    lines = [record.getMessage() for record in caplog.records if "taken from" in record.getMessage()]
    assert [line.split(" cells")[0] for line in lines] == ["2 of 3", "2 of 15"]


def test_sweep_over_laws_takes_cells_of_one_law_despite_other_parameters(scene, earlier, tmp_path, caplog):
    laws = scene | {"friction": scene["friction"] | {"alpha": 1e3}}
    axes = COARSE | {"friction.law": ["stiction", "tustin"]}
    assert taken(laws, axes, earlier, tmp_path, caplog) == 15


def test_sweep_of_one_law_takes_its_cells_of_a_sweep_over_laws(scene, tmp_path, caplog):
    friction = {"friction": scene["friction"] | {"alpha": 1e3}}
    axes = {"drive.amplitude": AMPLITUDES, "friction.law": ["coulomb", "stiction"], "friction.alpha": [1e3, 2e3]}
    refused("no such number", ringsweep.sweep, scene | friction, axes, progress=False)
    laws = {"friction.law": ["tustin", "stiction"], **COARSE}
    ringsweep.sweep(scene | friction, laws, tmp_path / "l.nc", progress=False).close()
    assert taken(scene, COARSE, tmp_path / "l.nc", tmp_path, caplog) == 15


def test_shared_cells_are_not_computed_again(scene, earlier, tmp_path, computed):
    ringsweep.sweep(scene, COARSE, tmp_path / "new.nc", reuse=earlier, progress=False).close()
    assert computed == [15]


@pytest.mark.parametrize(
    ("change", "solver", "problem"),
    [
        ({"time": {"span": "5 s"}}, "auto", "scene.time.span was 4.0, is 5.0"),
        ({"drive": {"law": "constant", "amplitude": 1.0}}, "auto", "scene.drive.law was arctan, is constant"),
        ({}, {"method": "event", "rtol": 1e-8}, "solver was"),
    ],
)
def test_file_of_another_scene_or_solver_is_refused_with_the_difference(scene, earlier, change, solver, problem):
    options = {"solver": solver, "reuse": earlier, "progress": False}
    assert problem in str(refused("has no cell of this sweep", ringsweep.sweep, scene | change, COARSE, **options))


def test_file_of_another_version_is_refused(scene, earlier, tmp_path, monkeypatch):
    from ringsweep.runs import reuse

    known = reuse.identity
    monkeypatch.setattr(reuse, "identity", lambda config: known(config) | {"sources": "others"})
    refused("another version", ringsweep.sweep, scene, COARSE, reuse=earlier, progress=False)


def test_file_with_units_of_earlier_versions_is_reused_repeated_and_drawn(scene, earlier, tmp_path, caplog):
    """Coordinates had "rad/s" where they now have "rad s-1"."""
    old = tmp_path / "old.nc"
    shutil.copy(earlier, old)
    with netCDF4.Dataset(old, "a") as file:
        assert file["drive_amplitude"].units == "rad s-1"
        file["drive_amplitude"].units = "rad/s"
    assert taken(scene, COARSE, old, tmp_path, caplog) == 15
    loaded, new = netcdf.load(old), netcdf.load(earlier)
    xr.testing.assert_equal(ringsweep.run(old, progress=False), new)
    assert ringsweep.run(old, progress=False)["drive_amplitude"].attrs["units"] == "rad s-1"
    labels = [plots.regime_map(ds).axes[0].get_xlabel() for ds in (loaded, new)]
    assert labels[0] == labels[1]
    cells = [plots.cell(ds, {"drive.amplitude": "1.5 rad/s", "zone.half_angle": "10 deg"}) for ds in (loaded, new)]
    assert cells[0] == cells[1]


def test_history_file_is_refused_as_an_earlier_sweep(scene, tmp_path, earlier, capsys):
    netcdf.save(ringsweep.simulate(scene), tmp_path / "history.nc")
    output = ["-o", str(tmp_path / "new.nc")]
    assert cli.main(["run", str(earlier), *output, "--reuse", str(tmp_path / "history.nc")]) == 2
    assert "history.nc: holds no sweep whose cells could be reused" in capsys.readouterr().err
