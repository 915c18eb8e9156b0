"""The functions of ringsweep as ``ds.ringsweep``: the same results as the functions."""

import html
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from refusals import refused

import ringsweep
from ringsweep import plots
from ringsweep.config import load
from ringsweep.plots.datasets import scene_text
from ringsweep.runs.plans import plan_of
from ringsweep.runs.thresholds import in_words


@pytest.fixture(scope="module")
def ds(scene):
    return ringsweep.sweep(scene, {"drive.amplitude": [0.5, 2.0, 8.0], "zone.half_angle": ["5 deg", "15 deg"]})


def test_where_keeps_the_cells_of_classes_and_refuses_unknown_words(ds):
    lost = ds.ringsweep.where(regime="separating", certified="certified")
    inside = (ringsweep.words(ds.regime) == "separating") & (ds.certified == 1)
    xr.testing.assert_equal(lost.t_separation, ds.t_separation.where(inside))
    assert int(lost.regime.count()) == int(inside.sum()) > 0
    assert ringsweep.words(lost.regime).values[inside.values].tolist() == ["separating"] * int(inside.sum())
    either = ds.ringsweep.where(regime=["separating", "oscillatory"]).regime.notnull()
    assert (either == ringsweep.words(ds.regime).isin(["separating", "oscillatory"])).all()
    for wrong, message in (
        ({"certified": 1}, "certified"),
        ({"regime": "separeting"}, "did you mean separating"),
        ({"regim": "separating"}, "did you mean regime"),
        ({"t_end": "separating"}, "t_end"),
    ):
        refused(message, ds.ringsweep.where, **wrong)


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
    refused("'point' is not in the dataset, which has time", run.ringsweep.to_frame, "point")


def test_map_of_a_mean_of_flags_is_refused_with_what_to_do(ds):
    mean = ds.mean("drive_amplitude")
    for use in (mean.ringsweep.map, mean.ringsweep.words, lambda: mean.ringsweep.report("my.html")):
        refused(r"regime: .*\(ds.ringsweep.words\('regime'\) == 'WORD'\).mean", use)
    assert mean.ringsweep.map("phi_max")


def test_report_has_pictures_thresholds_and_citation_and_needs_no_network(ds, scene, tmp_path):
    ds.ringsweep.report(tmp_path / "my.html")
    page = (tmp_path / "my.html").read_text(encoding="utf-8")
    assert page.count('src="data:image/png;base64,') == 3
    assert set(re.findall(r'(?:src|href)="(\w+)', page)) == {"data"}
    found = ringsweep.threshold(scene, "zone.half_angle", "separating", ("5 deg", "15 deg"))
    assert in_words(found).splitlines()[0] in html.unescape(page)
    for text in (
        "certified: 100.0%",
        "doi.org/10.3390/computation12090181",
        "greatest: jump_max",
        "half_angle: 15 deg",
    ):
        assert text in page


@pytest.mark.slow
def test_report_tells_each_change_once_and_words_of_its_model(tmp_path):
    """A small body in a drum: most runs are oscillatory, some separate, two revolve."""
    drum = {"model": "ring-single-contact", "body": {"mass": 2.5}, "ring": {"radius": 0.3}, "zone": {"half_angle": 0.9}}
    drum |= {
        "friction": {"law": "stiction", "rough": {"mu_s": 0.6, "mu_k": 0.45}, "elsewhere": {"mu_s": 0.25, "mu_k": 0.2}}
    }
    drum |= {"drive": {"law": "constant", "amplitude": 5.0}, "time": {"span": 20.0}}
    sample = {"n": 16, "of": {"friction.rough.mu_k": {"uniform": "0.45 +- 5 %"}}}
    sweep = {"grid": {"drive.amplitude": ["40 rpm", "50 rpm", "105 rpm"]}}
    for name, more in (("plain", {}), ("sampled", {"sample": sample})):
        found = ringsweep.run({"scene": drum, "sweep": sweep | more}, progress=False)
        found.ringsweep.report(tmp_path / f"{name}.html")
        page = html.unescape((tmp_path / f"{name}.html").read_text(encoding="utf-8"))
        assert "along drive.amplitude" in page
        assert ("what is uncertain has its median" in page) == (name == "sampled")
        assert "separating begins at drive.amplitude" in page
        assert "oscillatory ends at drive.amplitude" not in page
        assert "oscillatory: at least one reversal" in page
        assert "belt" not in page


def test_report_that_cannot_be_written_leaves_the_older_one(ds, tmp_path, monkeypatch):
    (tmp_path / "my.html").write_text("older")
    monkeypatch.setattr(Path, "write_text", lambda *_, **__: (_ for _ in ()).throw(OSError("full")))
    with pytest.raises(OSError, match="full"):
        ds.isel(drive_amplitude=[1], zone_half_angle=[1]).ringsweep.report(tmp_path / "my.html")
    assert (tmp_path / "my.html").read_bytes() == b"older"
    refused(r"reports end in \.html", ds.ringsweep.report, tmp_path / "my.txt")


class TestAHistoryAtOtherTimes:
    @pytest.fixture
    def run(self):
        """A body that falls from 0 s, is stopped at 1 s, and is lost at 2 s. Two things happen at once at 1 s."""
        time = [0.0, 1.0, 1.0, 1.0, 2.0, 2.0]
        columns = {"velocity": [0.0, 10.0, 5.0, 0.0, 0.0, -1.0], "x": [0.0, 5.0, 5.0, 5.0, 5.0, 5.0]}
        both = {name: ("time", column) for name, column in columns.items()}
        both["mode"] = "time", np.array([1, 1, -1, 0, 0, 1], dtype="int8")
        return xr.Dataset(both | {"t_end": 2.0}, {"time": ("time", time, {"units": "s"})})

    def test_up_to_an_event_it_is_as_before_and_from_there_as_after(self, run):
        at = run.ringsweep.at([0.5, 0.999, 1.0, 1.001, 1.999, 2.0])
        assert at.velocity.values == pytest.approx([5.0, 9.99, 0.0, 0.0, 0.0, -1.0])
        assert at.mode.values.tolist() == [1, 1, 0, 0, 0, 1]
        assert (at.mode.dtype, at.t_end.item(), at.time.attrs) == ("int8", 2.0, {"units": "s"})

    def test_outside_numbers_are_nan_and_classifications_those_of_the_end(self, run):
        at = run.ringsweep.at([3.0, -1.0])
        assert np.isnan(at.velocity).all()
        assert at.mode.values.tolist() == [1, 1]

    def test_runs_under_several_laws_end_each_at_its_own_time(self, run):
        longer = run.assign_coords(time=run.time * 2.0)
        law = xr.concat([run.ringsweep.at([0.0, 2.0, 4.0]), longer.ringsweep.at([0.0, 2.0, 4.0])], "friction_law")
        found = law.ringsweep.at([2.0, 3.0]).x.values
        assert found == pytest.approx(np.array([[5.0, np.nan], [5.0, 5.0]]), nan_ok=True)

    @pytest.mark.parametrize(("times", "problem"), [("soon", "numbers"), ([[1.0]], "one dimension")])
    def test_wrong_times_are_refused(self, run, times, problem):
        refused(problem, run.ringsweep.at, times)
        refused("no time history", xr.Dataset().ringsweep.at, times)


def test_dataset_in_place_of_a_scene_is_refused_with_what_to_call(ds):
    refused(r"got a dataset: ds\.ringsweep\.simulate", ringsweep.simulate, ds)


@pytest.mark.parametrize("imports", ["ringsweep, xarray as xr", "xarray as xr, ringsweep"])
def test_accessor_is_there_for_a_file_that_xarray_alone_has_opened(imports):
    code = f"import {imports}; print(xr.Dataset().ringsweep.words.__name__)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "words"


def mapped(scene, axes, points=False):
    """Dataset of a sweep without computing it."""
    config = load({"scene": scene, "sweep": {"points" if points else "grid": axes}})
    plan = plan_of(config)
    coords, attrs = plan.coordinates(), plan.attributes()
    return xr.Dataset(coords=coords, attrs=attrs)


def test_picture_of_a_scene_of_plain_numbers_has_their_units(scene):
    plain = scene | {"zone": {"half_angle": np.pi / 12}, "drive": {"law": "arctan", "amplitude": 2.0}}
    ds = mapped(plain, {"friction.rough.mu_k": [0.1, 0.3]})
    assert scene_text(ds) == ["stiction", "drive arctan", "amplitude 2 rad/s", "zone ±15°", "span 4 s"]


class TestCell:
    """Cells of a sweep as configurations."""

    @pytest.fixture
    def maps(self, scene):
        axes = {"drive.amplitude": [0.5, 2.0, 8.0], "zone.half_angle": ["10 deg", "20 deg", "40 deg", "60 deg"]}
        return mapped(scene, axes)

    def test_cell_is_the_configuration_with_the_values_of_the_cell(self, maps, caplog):
        found = plots.cell(maps, {"drive.amplitude": 1.9, "zone_half_angle": np.radians(39.0)})
        assert "sweep" not in found
        values = load(found).scene.values
        assert values["drive.amplitude"] == 2.0
        assert values["zone.half_angle"] == float(maps["zone_half_angle"][2])
        assert caplog.messages == [
            "drive.amplitude: 1.9 rad s⁻¹ is not in the dataset: the nearest value is taken, 2 rad s⁻¹",
            "zone_half_angle: 39° is not in the dataset: the nearest value is taken, 40°",
        ]

    def test_cell_of_points_is_selected_by_number(self, scene):
        ds = mapped(scene, {"drive.amplitude": [0.5, 2.0, 8.0], "initial.omega": [3.0, 1.0, 2.0]}, points=True)
        values = load(plots.cell(ds, {"point": 1})).scene.values
        assert (values["drive.amplitude"], values["initial.omega"]) == (2.0, 1.0)

    def test_cell_may_be_selected_by_law_and_by_a_number_of_an_arc(self, scene):
        bare = {name: part for name, part in scene.items() if name != "zone"}
        bare["friction"] = {"rest": scene["friction"]["rest"]}
        bare["zones"] = [{"half_angle": "10 deg", "mu_s": 0.5, "mu_k": 0.3}]
        ds = mapped(bare, {"friction.law": ["coulomb", "stiction"], "zones.0.mu_k": [0.2, 0.25]})
        found = plots.cell(ds, {"friction.law": "coulomb", "zones.0.mu_k": 0.25})
        assert found["scene"]["friction"]["law"] == "coulomb"
        assert found["scene"]["zones"][0]["mu_k"] == 0.25

    def test_cell_refuses_incomplete_selections_and_unconfigured_datasets(self, maps):
        refused(r"zone_half_angle \(4\) is left", plots.cell, maps, {"drive.amplitude": 2.0})
        refused("did you mean drive_amplitude", plots.cell, maps, {"drive.amplitud": 2.0})
        refused("no attribute configuration", plots.cell, maps.isel(drive_amplitude=0, zone_half_angle=0).drop_attrs())
