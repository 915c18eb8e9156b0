"""Measurement of error against run time, and the recommended solver."""

import json
from math import acos, pi, sqrt
from pathlib import Path

import numpy as np
import pytest
import yaml
from belts import on_belt, with_all_parts
from refusals import refused

import ringsweep
from ringsweep.cli import main
from ringsweep.config import load
from ringsweep.errors import InputError
from ringsweep.quantities.variables import PRECISION
from ringsweep.report.precision import report
from ringsweep.report.text import as_json
from ringsweep.runs import precision
from ringsweep.storage import netcdf

CONFIGS = Path(__file__).parents[1] / "configs"
TARGET = 1e-7

BELT = on_belt({"law": "stiction", "mu_s": 0.15, "mu_k": 0.1}, 2.0, velocity=0.1, span=9.0)


@pytest.fixture(scope="module", autouse=True)
def short():
    """Use few settings of rk4, to save time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(precision, "_STEPS", (100, 1000, 10_000))
        yield


@pytest.fixture(scope="module")
def config():
    """The paper's Fig. 29 with the limit law, over amplitudes and widths."""
    scene = dict(load(CONFIGS / "regime_map.yaml").source["scene"])
    friction = {"law": "stiction", "rough": scene["friction"]["rough"], "rest": scene["friction"]["elsewhere"]}
    grid = {
        "drive.amplitude": {"geomspace": [0.5, 8.0, 5]},
        "zone.half_angle": {"linspace": ["5 deg", "40 deg", 4]},
    }
    return {"scene": scene | {"friction": friction, "time": {"span": "4 s"}}, "sweep": {"grid": grid}}


@pytest.fixture(scope="module")
def found(config):
    return ringsweep.precision(config, target=TARGET, cells=8, rounds=2, progress=False)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "belt.yaml").write_text(yaml.safe_dump({"scene": BELT}))
    return tmp_path


def rerun(found, config, solver):
    """Outcomes of the sampled cells with a solver of the dataset, certificates included."""
    points = {found[name].attrs["path"]: found[name].values for name in ("drive_amplitude", "zone_half_angle")}
    return ringsweep.run(
        {"scene": config["scene"], "sweep": {"points": points}, "solver": yaml.safe_load(f"{{{solver}}}")},
        progress=False,
    )


class TestDataset:
    def test_variables_units_and_flags_are_those_declared(self, found):
        assert set(found.data_vars) == set(PRECISION)
        assert found.sizes["cell"] == 8
        for name, data in found.data_vars.items():
            assert data.attrs["units"] == PRECISION[name].units
            assert data.dtype == PRECISION[name].dtype
        for name in ("regime_wrong", "flagged"):
            assert found[name].dtype == found[name].attrs["flag_values"].dtype == np.int8


class TestErrors:
    def test_errors_of_event_fall_with_rtol_to_rounding(self, found):
        event = found.isel(contender=found["method"].values == "event")
        median = event["error_end"].median("cell").values
        assert (median[2:] < median[:-2]).all()
        assert median[-1] < 1e-11
        assert (event["error_end"].max("cell")[-1] < 1e-8).all()

    def test_rk4_misses_static_friction_and_its_errors_are_flagged(self, found):
        rk4 = found.isel(contender=found["method"].values == "rk4")
        assert rk4["error_end"].max("cell").min() > 1e-3
        assert (rk4["regime_wrong"] == 1).any("cell").all()
        assert (rk4["flagged"] == 1).all()

    def test_rk4_that_converges_to_another_motion_is_told(self, found):
        assert "rk4 converges to another motion: its median error stays at" in report(found)
        assert "rad from 100 to 10000 steps" in report(found)
        falling = np.geomspace(1e-2, 1e-6, 3)[:, np.newaxis]
        better = found.copy(deep=True)
        better["error_end"][found["method"].values == "rk4"] = falling
        assert "another motion" not in report(better)

    def test_errors_equal_differences_of_reported_states(self, found, config):
        reference = rerun(found, config, found.attrs["reference"])
        for k in (0, 4):
            plain = rerun(found, config, f"{found['solver'].values[k]}, certify: false")
            np.testing.assert_array_equal(found["error_end"][k], abs(plain["phi_end"] - reference["phi_end"]))

    @pytest.mark.slow
    def test_reference_agrees_with_the_closed_form_within_its_uncertainty(self):
        found = ringsweep.precision({"scene": BELT}, rounds=1, progress=False)
        solver = yaml.safe_load(f"{{{found.attrs['reference']}}}")
        x = float(ringsweep.run({"scene": BELT, "solver": solver}, progress=False)["x_end"])
        # The body sticks until the spring force equals static friction. It slips on a circle in the phase plane, about
        # the deflection under kinetic friction, until it has the velocity of the belt, and sticks again.
        rate, far, middle = sqrt(2.0), 0.15 * 9.81 / 2.0, 0.1 * 9.81 / 2.0
        slip = 2.0 * (pi - acos((far - middle) / np.hypot(far - middle, 0.1 / rate))) / rate
        after = 9.0 - far / 0.1
        assert 0.0 < after < slip
        exact = middle + (far - middle) * np.cos(rate * after) + 0.1 / rate * np.sin(rate * after)
        assert x == pytest.approx(exact, abs=1e-13)
        assert found["reference_error_end"].item() < 1e-12
        assert found["error_end"].attrs["units"] == "m"
        assert "error_separation" not in found


class TestRecommendation:
    def test_recommended_solver_meets_the_target_when_run_again(self, found, config):
        line = report(found).splitlines()[-1]
        assert json.loads(as_json(found))["summary"]["precision"][-1] == line
        solver = yaml.safe_load(line)["solver"]
        assert line == f"solver: {{{found.attrs['recommended']}}}"
        again = rerun(found, config, ", ".join(f"{name}: {value}" for name, value in solver.items()))
        reference = rerun(found, config, found.attrs["reference"])
        for name in ("regime", "motion", "separating_contact"):
            np.testing.assert_array_equal(again[name], reference[name])
        assert abs(again["phi_end"] - reference["phi_end"]).max() <= TARGET
        assert abs(again["t_separation"] - reference["t_separation"]).max() <= TARGET

    def test_recommended_solver_is_the_fastest_that_meets_the_target(self, found):
        bound = (found["error_end"] + found["reference_error_end"]).max("cell")
        apart = (found["error_separation"] + found["reference_error_separation"]).max("cell")
        met = (bound <= TARGET) & ~(apart > TARGET) & (found["regime_wrong"] == 0).all("cell")
        assert met.any()
        assert not met.all()
        fastest = found["time_per_run"].where(met).argmin("contender")
        assert found.attrs["recommended"] == found["solver"].values[fastest]

    @pytest.mark.parametrize(("rtol", "meets"), [(1e-4, "misses"), (1e-11, "meets")])
    def test_report_says_whether_the_configured_solver_meets_the_target(self, found, rtol, meets):
        solver, other = (
            next(name for name in found["solver"].values if name.endswith(f"rtol: {one!r}")) for one in (rtol, 1e-12)
        )
        text = report(found.assign_attrs(configured=solver, recommended=other))
        assert f"the solver of this configuration, `{solver}`, {meets} the target: " in text
        text = report(found.assign_attrs(configured=found.attrs["recommended"]))
        assert "it is the solver of this configuration already: nothing needs to change" in text

    @pytest.mark.slow
    def test_unreachable_target_is_reported_with_the_closest_solver(self, folder, capsys):
        assert main(["precision", "belt.yaml", "--target", "1e-40", "--rounds", "1"]) == 0
        out = capsys.readouterr().out
        closest = netcdf.load("belt-precision.nc").attrs["closest"]
        assert f"met by none; closest is `{closest}`: no wrong regimes, errors up to" in out
        assert "\nsolver:" not in out

    @pytest.mark.slow
    def test_configured_setting_competes_and_keeps_its_max_steps(self):
        solver = {"method": "event", "rtol": 2.5e-7, "max_steps": 1}
        found = ringsweep.precision({"scene": BELT, "solver": solver}, rounds=1, progress=False)
        own = found["solver"].values == "method: event, rtol: 2.5e-07, max_steps: 1"
        assert own.sum() == 1
        assert np.isinf(found["error_end"][own]).all()
        assert "closest" in found.attrs
        found = ringsweep.precision({"scene": BELT, "solver": {"method": "rk4", "steps": 777}}, progress=False)
        assert "method: rk4, steps: 777" in found["solver"].values


@pytest.mark.slow
class TestSample:
    def test_sample_is_the_same_at_every_call_and_complete_for_small_sweeps(self, config, found):
        again = ringsweep.precision(config, cells=8, rounds=1, progress=False)
        np.testing.assert_array_equal(again["cell"], found["cell"])
        few = {"scene": BELT, "sweep": {"grid": {"belt.velocity": [0.05, 0.1], "friction.law": ["stiction"]}}}
        found = ringsweep.precision(few, cells=16, rounds=1, progress=False)
        np.testing.assert_array_equal(found["belt_velocity"], [0.05, 0.1])
        np.testing.assert_array_equal(found["friction_law"], ["stiction", "stiction"])

    def test_cells_without_a_reference_are_left_out_and_counted(self, config, monkeypatch):
        monkeypatch.setattr(precision, "_STEPS", (100,))
        monkeypatch.setattr(precision, "_TIGHTEST", {precision.Event: (1e-15, 1e-3)})
        many = yaml.safe_load((CONFIGS / "belt_viscous.yaml").read_text(encoding="utf-8"))
        many["scene"] = with_all_parts(many["scene"])
        found = ringsweep.precision(many, rounds=1, progress=False)
        assert 0 < found.sizes["cell"] < 16
        dropped = 16 - found.sizes["cell"]
        assert f"{found.sizes['cell']} of 4096 cells; {dropped} more were drawn" in found.attrs["sampled"]

    def test_settings_that_would_take_too_long_are_left_out_and_named(self, monkeypatch):
        monkeypatch.setattr(precision, "_BUDGET", 0.0)
        found = ringsweep.precision({"scene": BELT}, rounds=1, progress=False)
        assert found["setting"].values.tolist() == ["rtol 0.0001", "100 steps"]
        for name in ("event, rtol 1e-12", "rk4, 1000 steps", "rk4, 10000 steps"):
            assert name in found.attrs["left_out"]
        assert found.attrs["left_out"] in report(found)

    def test_law_that_rk4_does_not_take_is_measured_without_rk4(self):
        friction = {"law": "bristle", "mu_k": 0.1, "sigma0": 100.0, "seed": 1}
        found = ringsweep.precision({"scene": BELT | {"friction": friction}}, rounds=1, progress=False)
        assert set(found["method"].values) == {"implicit"}
        assert "rk4 does not take friction law bristle" in found.attrs["left_out"]


class TestInput:
    @pytest.mark.parametrize(
        ("arguments", "problem"),
        [
            ({"target": 0}, "target: 0 is not allowed: target must be greater than 0"),
            ({"target": float("nan")}, "target: .* not finite"),
            ({"target": "small"}, "target: 'small' is not a number"),
            ({"cells": 0}, "cells: 0 is not allowed"),
            ({"cells": 2.5}, "cells: 2.5 is not a whole number"),
            ({"rounds": None}, "rounds: nothing is not a number"),
        ],
    )
    def test_arguments_out_of_range_are_refused(self, arguments, problem):
        refused(problem, ringsweep.precision, {"scene": BELT}, **arguments)

    @pytest.mark.parametrize("part", ["grid", "points"])
    def test_sweep_over_several_laws_is_refused_with_its_path(self, part):
        sweep = {part: {"friction.law": ["coulomb", "stiction"]}}
        with pytest.raises(InputError, match=rf"sweep\.{part}\.friction\.law: each of coulomb, stiction"):
            ringsweep.precision({"scene": BELT, "sweep": sweep})


@pytest.mark.slow
def test_command_writes_dataset_and_picture_and_prints_table_and_solver(folder, capsys):
    assert main(["precision", "belt.yaml", "-o", "out.nc", "--rounds", "1"]) == 0
    out = capsys.readouterr().out
    found = netcdf.load("out.nc")
    assert (folder / "out.png").read_bytes().startswith(b"\x89PNG")
    assert found.attrs["target"] == 1e-6
    lines = out.splitlines()
    assert [line.split("  ")[0] for line in lines[1 : 1 + found.sizes["contender"]]] == [
        f"{method}, {setting}" for method, setting in zip(found["method"].values, found["setting"].values, strict=True)
    ]
    (pasted,) = (line for line in lines if line.startswith("solver: "))
    config = {"scene": BELT, **yaml.safe_load(pasted)}
    assert load(config).solver.name == "event"
    assert main(["info", "out.nc"]) == 0
    assert pasted in capsys.readouterr().out


@pytest.mark.slow
def test_result_of_another_kind_is_neither_replaced_nor_drawn(folder, capsys):
    assert main(["run", "belt.yaml", "-o", "sweep.nc"]) == 0
    assert main(["precision", "belt.yaml", "-o", "belt.nc", "--rounds", "1"]) == 0
    kept = {name: (folder / name).read_bytes() for name in ("sweep.nc", "belt.nc")}
    for arguments in (
        ["precision", "belt.yaml", "-o", "sweep.nc"],
        ["run", "belt.yaml"],
        ["simulate", "belt.yaml", "-o", "belt.nc"],
        ["map", "belt.nc", "--var", "error_end"],
    ):
        assert main(arguments) == 2
    assert {name: (folder / name).read_bytes() for name in kept} == kept
