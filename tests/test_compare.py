"""Comparison of friction laws: an axis of a sweep, runs in one dataset, lines in one picture."""

import json
import logging
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from belts import on_belt
from jsonschema import Draft202012Validator
from refusals import refused
from rings import edited

import ringsweep
from ringsweep import plots
from ringsweep.cli import main
from ringsweep.config import load, with_values
from ringsweep.config.schema import schema
from ringsweep.storage import netcdf

CONFIGS = Path(__file__).parents[1] / "configs"
LAWS = ["coulomb", "stiction", "tustin"]
CONFIG = {
    "scene": on_belt({"mu_s": 0.15, "mu_k": 0.1, "alpha": 10.0}, 2.0, velocity=0.1, span=20.0)
    | {"initial": {"velocity": 0.0}},
    "sweep": {"grid": {"friction.law": LAWS, "belt.velocity": [0.05, 0.1]}},
}


changed = partial(edited, CONFIG)


def grid(**axes):
    return changed(sweep={"grid": {path.replace("__", "."): values for path, values in axes.items()}})


refusal = partial(refused, None)


@pytest.fixture(scope="module")
def swept():
    return ringsweep.run(CONFIG, progress=False)


@pytest.fixture(scope="module")
def compared():
    return ringsweep.simulate(grid(friction__law=LAWS))


class TestSweep:
    def test_sweep_has_friction_laws_as_a_coordinate_of_names(self, swept):
        assert dict(swept.sizes) == {"friction_law": 3, "belt_velocity": 2}
        assert swept.friction_law.values.tolist() == LAWS
        assert swept.friction_law.attrs == {"long_name": "friction law", "path": "friction.law"}

    @pytest.mark.parametrize("law", LAWS)
    def test_cell_of_a_law_equals_the_run_with_that_law(self, swept, law):
        for speed in (0.05, 0.1):
            run = ringsweep.simulate(changed(scene__friction__law=law, scene__belt__velocity=speed, sweep=None))
            cell = swept.sel(friction_law=law, belt_velocity=speed)
            for name in swept.data_vars:
                np.testing.assert_array_equal(cell[name], run[name], err_msg=name)

    def test_parameter_of_one_law_does_not_change_cells_of_others(self):
        found = ringsweep.run(grid(friction__alpha=[1.0, 10.0], friction__law=["stiction", "tustin"]), progress=False)
        first, second = (found.x_end.sel(friction_alpha=alpha) for alpha in (1.0, 10.0))
        assert (first == second).values.tolist() == [True, False]

    def test_sweep_in_python_accepts_laws_and_numbers_as_axes(self, swept):
        found = ringsweep.sweep(CONFIG["scene"], {"friction.law": LAWS, "belt.velocity": [0.05, 0.1]}, progress=False)
        xr.testing.assert_equal(found, swept)
        again = ringsweep.run(json.loads(found.attrs["configuration"]), progress=False)
        xr.testing.assert_equal(again.transpose(*found.dims), found)

    def test_law_and_number_may_vary_together(self, swept):
        law = xr.DataArray(["tustin", "coulomb"], dims="rig")
        speed = xr.DataArray([0.05, 0.1], dims="rig")
        found = ringsweep.sweep(CONFIG["scene"], {"friction.law": law, "belt.velocity": speed}, progress=False)
        np.testing.assert_array_equal(found.x_end, swept.x_end.sel(friction_law=law, belt_velocity=speed))
        again = ringsweep.run(json.loads(found.attrs["configuration"]), progress=False)
        np.testing.assert_array_equal(again.x_end, found.x_end)


class TestConfiguration:
    @pytest.mark.parametrize(
        ("laws", "path", "problem"),
        [
            (["coulomb", "striction"], "sweep.grid.friction.law.1", "did you mean `stiction`?"),
            (["coulomb", "coulomb"], "sweep.grid.friction.law.1", "stands twice"),
            (["coulomb", 3], "sweep.grid.friction.law.1", "3 is not a friction law"),
            ("coulomb", "sweep.grid.friction.law", "a list of values"),
            ([], "sweep.grid.friction.law", "empty"),
            ({"linspace": [1, 2, 3]}, "sweep.grid.friction.law", "list"),
        ],
    )
    def test_wrong_law_is_refused_with_its_path(self, laws, path, problem):
        error = refusal(load, grid(friction__law=laws))
        assert error.path == path
        assert problem in error.problem
        # The schema does not know the names that a scene or a session gives to laws of its own.
        assert Draft202012Validator(schema()).is_valid(grid(friction__law=laws)) == ("did you mean" in problem)

    def test_parameter_that_one_law_needs_must_be_given_or_swept(self):
        missing = changed(scene__friction__alpha=None)
        assert refusal(load, missing).path == "scene.friction.alpha"
        missing["sweep"]["grid"]["friction.alpha"] = [5.0, 10.0]
        assert load(missing).axes.sizes["friction_alpha"] == 2
        assert load(changed(scene__friction={"mu_k": 0.1}, sweep={"grid": {"friction.law": ["coulomb"]}}))

    def test_warning_names_only_parameters_that_no_law_uses(self, caplog):
        with caplog.at_level(logging.WARNING, logger="ringsweep"):
            load(CONFIG)
            assert not caplog.records
            load(grid(friction__law=["coulomb", "stiction"]))
        assert [record.args[0] for record in caplog.records] == ["friction.alpha"]

    def test_method_that_refuses_one_law_refuses_the_sweep(self):
        config = changed(solver={"method": "event"}, scene__friction__v0=1e-3)
        load(config)
        config["sweep"]["grid"]["friction.law"] = ["coulomb", "bengisu-akay"]
        assert "does not take friction law bengisu-akay" in refusal(load, config).problem

    def test_values_are_checked_for_each_law(self):
        """Only laws with a static coefficient require that the kinetic one is not greater."""
        load(grid(friction__law=["coulomb"], friction__mu_k=[0.1, 0.2]))
        assert "exceeds mu_s" in refusal(load, grid(friction__law=LAWS, friction__mu_k=[0.1, 0.2])).problem

    def test_message_mentions_the_sweep_only_if_swept_values_are_wrong(self):
        wrong = changed(scene__friction__mu_k=0.2)
        assert refusal(load, wrong).problem.endswith("static friction")
        wrong["scene"]["belt"].clear()
        assert refusal(load, wrong).problem.endswith("static friction")
        assert refusal(load, grid(friction__law=LAWS, friction__mu_s=[0.05, 0.2])).problem.endswith("of the sweep)")


class TestRuns:
    def test_history_of_each_law_equals_a_run_with_that_law_only(self, compared):
        assert compared.x.dims == ("friction_law", "time")
        assert (compared.time.diff("time") > 0).all()
        for law in LAWS:
            alone = ringsweep.simulate(changed(scene__friction__law=law, sweep=None))
            own = compared.sel(friction_law=law)
            assert np.isin(alone.time, compared.time).all()
            # Of the two states of an event, the comparison has the second.
            last = alone.isel(time=np.append(np.diff(alone.time) > 0, True))
            for name in ("x", "velocity", "friction_force", "mode"):
                np.testing.assert_array_equal(own[name].sel(time=last.time), last[name], err_msg=name)
                assert own[name].dtype == alone[name].dtype
                assert own[name].attrs.keys() == alone[name].attrs.keys()
            for name in ("regime", "x_end", "slips"):
                assert own[name] == alone[name]

    def test_compared_histories_interpolate_numbers_and_hold_modes(self, compared):
        """While the body sticks it has the speed of the belt, also at samples of other runs."""
        stuck = compared.where(compared["mode"] == 0)
        np.testing.assert_allclose(stuck.velocity.where(stuck.velocity.notnull(), 0.1), 0.1, atol=1e-9)
        assert set(np.unique(compared["mode"])) <= {-1, 0, 1}

    def test_saved_comparison_can_be_run_again_with_the_same_result(self, compared, tmp_path):
        netcdf.save(compared, tmp_path / "laws-run.nc")
        loaded = netcdf.load(tmp_path / "laws-run.nc")
        xr.testing.assert_identical(loaded, compared)
        xr.testing.assert_equal(ringsweep.simulate(json.loads(loaded.attrs["configuration"])), compared)

    def test_setting_a_law_replaces_the_sweep_over_laws(self):
        config = with_values(CONFIG, ["friction.law=stiction"])
        assert not config.axes.sizes
        assert config.scene.structure.law == "stiction"

    def test_other_swept_parameters_need_a_value_in_a_single_run(self):
        missing = changed(scene__belt={}, sweep__grid__gravity=[9.81])
        missing["scene"]["body"].clear()
        missing["sweep"]["grid"]["body.mass"] = [1.0, 2.0]
        assert "--set body.mass=VALUE" in refusal(with_values, missing).problem
        settled = with_values(missing, ["body.mass=1", "belt.velocity=0.1"])
        assert settled.axes.sizes == {"friction_law": 3}

    def test_numbers_after_the_end_of_a_shorter_run_are_missing(self):
        ring = load(CONFIGS / "regime_map.yaml").source["scene"]
        # With this wide regularisation the body creeps and stays on the ring.
        scene = ring | {"friction": ring["friction"] | {"alpha": 100.0, "v0": 0.2}, "time": {"span": 4.0}}
        del scene["friction"]["law"]
        laws = ["stiction", "bengisu-akay"]
        found = ringsweep.simulate({"scene": scene, "sweep": {"grid": {"friction.law": laws}}})
        ended = found.time > found.t_end
        assert ended.any("time").values.tolist() == [True, False]
        assert (found.phi.isnull() == ended).all()
        assert found.zone_1.dtype == "int32"
        figure = plots.history(found)
        assert [len(axes.lines) for axes in figure.axes] == [2] * 5
        assert figure.axes[4].get_title(loc="left") == "contact 2"


class TestPicture:
    def test_panels_of_compared_laws_have_a_line_for_each_law_and_no_shading(self, compared):
        figure = plots.history(compared)
        assert len(figure.axes) == 3
        for axes in figure.axes:
            assert len({(line.get_color(), line.get_linestyle()) for line in axes.lines}) == 3
            assert not axes.collections
            assert axes.get_legend() is None
        (legend,) = figure.legends
        words = ("oscillatory", "stick-slip", "stick-slip")
        assert [text.get_text() for text in legend.get_texts()] == [
            f"{law}: {word}" for law, word in zip(LAWS, words, strict=True)
        ]

    def test_picture_of_one_of_several_laws_has_the_outcome_of_that_law(self, compared):
        figure = plots.history(compared.sel(friction_law="stiction"))
        period = float(compared.period.sel(friction_law="stiction"))
        assert figure.get_suptitle().startswith(f"stiction: stick-slip, t = 20 s, period {period:.6g} s")


class TestCommands:
    @pytest.fixture
    def folder(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "laws.yaml").write_text(yaml.safe_dump(CONFIG))
        return tmp_path

    @pytest.mark.slow
    def test_plot_draws_one_law_of_a_stored_run(self, folder, compared, capsys):
        netcdf.save(compared, "laws-run.nc")
        assert main(["plot", "laws-run.nc"]) == 0
        assert main(["plot", "laws-run.nc", "--kind", "phase", "--law", "stiction"]) == 0
        assert capsys.readouterr().out == "wrote laws-run.png\nwrote laws-run-phase-stiction.png\n"
        assert (folder / "laws-run-phase-stiction.png").exists()
        assert main(["plot", "laws-run.nc", "--law", "stictoin"]) == 2
        assert "did you mean stiction?" in capsys.readouterr().err
        assert main(["plot", "laws-run.nc", "--kind", "friction"]) == 2
        assert "holds a run under each of coulomb, stiction, tustin: choose one" in capsys.readouterr().err
