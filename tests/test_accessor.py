"""The functions of ringsweep as ``ds.ringsweep``: the same results as the functions."""

import subprocess
import sys

import pytest
import xarray as xr

import ringsweep
from ringsweep import plots


@pytest.fixture(scope="module")
def ds(scene):
    return ringsweep.sweep(scene, {"drive.amplitude": [0.5, 2.0, 8.0], "zone.half_angle": ["5 deg", "15 deg"]})


@pytest.mark.slow
def test_words_and_boundary_are_those_of_the_functions(ds):
    xr.testing.assert_identical(ds.ringsweep.words(), ringsweep.words(ds.regime))
    xr.testing.assert_identical(ds.ringsweep.words("certified"), ringsweep.words(ds.certified))
    xr.testing.assert_identical(
        ds.ringsweep.boundary("separating", 1e-2), ringsweep.boundary(ds, "separating", tolerance=1e-2)
    )


def test_run_of_a_cell_has_the_outcome_of_that_cell(ds):
    run = ds.ringsweep.simulate(drive_amplitude=2, zone_half_angle="15 deg")
    xr.testing.assert_identical(
        run.drop_attrs(), ds.ringsweep.simulate({"drive.amplitude": 2, "zone.half_angle": "15 deg"}).drop_attrs()
    )
    here = ds.sel(drive_amplitude=2.0).isel(zone_half_angle=1)
    assert float(run.phi_end) == float(here.phi_end)


def test_frame_has_a_row_for_each_cell_and_makes_the_same_runs_again(ds, scene):
    frame = ds.ringsweep.to_frame()
    assert frame["regime"].tolist() == ringsweep.words(ds.regime).values.ravel().tolist()
    assert list(frame["regime"].cat.categories) == ds.regime.attrs["flag_meanings"].split()
    points = frame.rename(columns={"drive_amplitude": "drive.amplitude", "zone_half_angle": "zone.half_angle"})
    again = ringsweep.sweep(scene, points[["drive.amplitude", "zone.half_angle"]])
    assert again.sizes == {"point": 6}
    assert again.phi_end.values.tolist() == ds.phi_end.values.ravel().tolist()


def test_frames_of_a_history_have_a_row_for_each_sample_or_event(ds):
    run = ds.ringsweep.simulate(drive_amplitude=2, zone_half_angle="15 deg")
    frame, events = run.ringsweep.to_frame(), run.ringsweep.to_frame("event")
    assert frame.time.tolist() == run.time.values.tolist()
    assert frame.phi.tolist() == run.phi.values.tolist()
    assert events.event_time.tolist() == run.event_time.values.tolist()
    assert events.event_kind.tolist() == ringsweep.words(run.event_kind).values.tolist()
    with pytest.raises(ringsweep.InputError, match="no dimension"):
        run.ringsweep.to_frame("point")


def test_dataset_in_place_of_a_scene_is_refused_with_what_to_call(ds):
    with pytest.raises(ringsweep.InputError, match=r"got a dataset: ds\.ringsweep\.simulate"):
        ringsweep.simulate(ds)


def test_map_has_the_title_of_the_function(ds):
    assert ds.ringsweep.map("t_end").axes[-1].get_ylabel() == plots.regime_map(ds, var="t_end").axes[-1].get_ylabel()


@pytest.mark.parametrize("imports", ["ringsweep.accessor, xarray as xr", "xarray as xr, ringsweep"])
def test_accessor_is_there_for_a_file_that_xarray_alone_has_opened(imports):
    code = f"import {imports}; print(xr.Dataset().ringsweep.words.__name__)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "words"
