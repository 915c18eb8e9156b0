"""Sweeps and single runs, called from Python."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import ringsweep
from ringsweep.config import load
from ringsweep.models.ring.record import Outcome
from ringsweep.quantities.flags import REGIMES
from ringsweep.quantities.variables import OUTCOMES
from ringsweep.runs import executors
from ringsweep.solvers.certificate import with_errors
from ringsweep.storage.provenance import attributes, identity

CONFIGS = Path(__file__).parents[1] / "configs"
AMPLITUDES = [0.5, 2.0, 8.0]
WIDTHS = ["5 deg", "15 deg", "40 deg"]


@pytest.fixture(scope="module")
def grid(scene):
    return ringsweep.sweep(scene, {"drive.amplitude": AMPLITUDES, "zone.half_angle": WIDTHS})


class TestDataset:
    def test_dataset_has_a_dimension_per_path_and_all_declared_variables(self, grid):
        assert dict(grid.sizes) == {"drive_amplitude": 3, "zone_half_angle": 3}
        bounded = {f"{name}_error" for name in with_errors(Outcome._fields)}
        assert set(grid.data_vars) == {*Outcome._fields, *bounded, "steps", "certified", "uncertified_because"}
        for name, variable in grid.data_vars.items():
            assert variable.attrs["units"] == OUTCOMES[name].units
            assert variable.dtype == OUTCOMES[name].dtype
        np.testing.assert_allclose(grid.zone_half_angle, np.radians([5, 15, 40]), rtol=1e-15)
        assert grid.zone_half_angle.attrs["units"] == "rad"
        assert grid.drive_amplitude.attrs["long_name"]

    def test_only_separating_cells_have_a_time_of_separation_and_a_contact(self, grid):
        separating = grid.regime == REGIMES.index("separating")
        assert separating.any()
        assert not separating.all()
        assert ((grid.separating_contact > 0) == separating).all()
        assert (np.isfinite(grid.t_separation) == separating).all()
        np.testing.assert_array_equal(grid.t_end, grid.t_separation.where(separating, 4.0))


class TestAxes:
    def test_sweep_takes_scene_and_solver_of_a_whole_configuration(self, scene, grid):
        whole = {"scene": scene, "solver": {"method": "event", "rtol": 1e-9}, "sweep": {"grid": {"time.span": [1, 2]}}}
        found = ringsweep.sweep(whole, {"drive.amplitude": AMPLITUDES, "zone.half_angle": WIDTHS})
        assert json.loads(found.attrs["solver"])["rtol"] == 1e-9
        np.testing.assert_array_equal(found.regime, grid.regime)

    def test_simulate_sets_values_by_their_paths(self, scene, grid):
        run = ringsweep.simulate(scene, set={"drive.amplitude": AMPLITUDES[2], "zone.half_angle": WIDTHS[0]})
        assert float(run.t_end) == float(grid.t_end[2, 0])

    def test_axes_that_share_a_dimension_vary_together(self, scene, grid):
        amplitude = xr.DataArray(AMPLITUDES, dims="rig")
        width = xr.DataArray(np.radians([5.0, 15.0, 40.0]), dims="rig")
        points = ringsweep.sweep(scene, {"drive.amplitude": amplitude, "zone.half_angle": width})
        assert dict(points.sizes) == {"rig": 3}
        np.testing.assert_array_equal(points.t_end, np.diag(grid.t_end))
        again = ringsweep.run(json.loads(points.attrs["configuration"]), progress=False)
        np.testing.assert_array_equal(again.t_end, points.t_end)


class TestSingleRun:
    def test_history_and_outcome_of_a_run_agree(self, scene):
        run = ringsweep.simulate(scene)
        assert run.phi.dims == ("time",)
        assert float(run.time[0]) == 0.0
        assert float(run.time[-1]) == float(run.t_end)
        assert (run.time.diff("time") >= 0).all()
        assert float(run.phi[-1]) == pytest.approx(float(run.phi_end), abs=1e-12)
        assert float(run.phi.max()) == pytest.approx(float(run.phi_max), abs=1e-5)
        assert float(run.normal_2[-1]) == pytest.approx(0.0, abs=1e-9)
        assert run.attrs["outcome"].startswith("separating (oscillatory), contact 2")

    def test_history_shows_the_jump_of_the_reaction_that_opens_a_contact(self, scene):
        """Friction changes its sign at once when the body reverses relative to the ring, and the reactions jump."""
        run = ringsweep.simulate(scene | {"drive": {"law": "arctan", "amplitude": 0.5}, "zone": {"half_angle": 0.9}})
        assert run.separating_contact == 2
        assert run.time[-2] == run.time[-1] == run.t_separation
        assert run.normal_2[-2] > 0.04
        assert run.normal_2[-1] == 0.0
        assert run.normal_2.min() == run.normal_min_2

    @pytest.mark.slow
    def test_model_with_one_contact_has_no_variables_of_contact_2(self, scene):
        alone = scene | {"model": "ring-single-contact", "body": {"mass": 0.076}}
        run = ringsweep.simulate(alone | {"initial": {"omega": 5.0}})
        assert "normal_1" in run
        assert not {"normal_2", "zone_2", "normal_min_2"} & set(run.variables)


class TestProgress:
    def test_progress_bar_is_not_shown_in_a_pipe(self, scene, capfd):
        ringsweep.sweep(scene, {"drive.amplitude": [1.0]})
        assert capfd.readouterr().err == ""

    def test_sweep_without_terminal_reports_after_a_minute_and_then_seldom(self, monkeypatch, caplog):
        now = [0.0]
        monkeypatch.setattr("tqdm.std.time", lambda: now[0])
        with caplog.at_level("INFO", "ringsweep"), executors.progress_bar(60, True) as bar:
            for seconds in (30.0, 61.0, 100.0, 121.0, 123.0, 200.0):
                now[0] = seconds
                bar.update(10)
        assert caplog.messages == ["20 runs of 60: about 2 min left", "50 runs of 60: about 25 s left"]


class TestConfigurations:
    @pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
    def test_stored_configuration_has_the_defaults_and_means_the_same(self, path):
        config = load(path)
        stored = json.loads(attributes(config)["configuration"])
        assert stored["scene"]["gravity"] == 9.81
        assert identity(load(stored)) == identity(config)

    def test_axes_of_the_regime_map_are_those_documented(self):
        axes = load(CONFIGS / "regime_map.yaml").axes
        assert axes.sizes == {"drive_amplitude": 64, "zone_half_angle": 64}
        amplitude, width = (values for _, values in axes.columns.values())
        np.testing.assert_allclose(np.diff(np.log(amplitude)), np.log(100) / 63)
        np.testing.assert_allclose(np.degrees(width[[0, -1]]), [2, 60])
