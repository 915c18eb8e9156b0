"""Fits of numbers of a scene to measured histories."""

import json
import logging
import sys

import numpy as np
import pytest
import xarray as xr
from belts import on_belt
from refusals import refused

import ringsweep
from ringsweep import cli, plots
from ringsweep.runs.fit import apart
from ringsweep.statistics import unit_points

lmfit = pytest.importorskip("lmfit")

BELT = on_belt({"law": "stiction", "mu_s": 0.15, "mu_k": 0.1}, 2.0, velocity=0.1, span=10.0)
T = np.linspace(0.1, 20.0, 150)


def measured(scene, name, t, noise, seed):
    """A history with normal noise."""
    run = ringsweep.simulate(scene | {"time": {"span": float(t[-1])}})
    return {
        "t": t,
        name: np.interp(t, run.time, run[name]) + noise * np.random.default_rng(seed).standard_normal(len(t)),
    }


class TestFit:
    def test_a_body_that_rides_is_a_straight_line(self):
        """x = v t: the fit is the regression through the origin, with its standard error."""
        t = np.linspace(0.1, 5.0, 40)
        x = 0.1 * t + 0.003 * np.random.default_rng(5).standard_normal(40)
        slope = (t @ x) / (t @ t)
        found = ringsweep.fit(BELT, {"t": t, "x": x}, {"belt.velocity": (0.05, 0.13)}, start=2)
        velocity = found.params["belt_velocity"]
        deviation = np.sqrt(np.sum((x - slope * t) ** 2) / 39)
        assert velocity.value == pytest.approx(slope, rel=1e-7)
        assert velocity.stderr == pytest.approx(deviation / np.sqrt(t @ t), rel=1e-5)
        given = ringsweep.fit(BELT, {"t": t, "x (mm)": 1e3 * x}, {"belt.velocity": (0.05, 0.13)}, start=2, noise="3 mm")
        assert given.params["belt_velocity"].stderr == pytest.approx(0.003 / np.sqrt(t @ t), rel=1e-5)

    @pytest.mark.slow
    def test_a_wrong_start_finds_the_numbers_that_made_the_history(self):
        """Friction of the scene is twice and half the true one."""
        data = measured(BELT, "x", T, 0.002, 2)
        wrong = BELT | {"friction": {"law": "stiction", "mu_s": 0.3, "mu_k": 0.05}}
        found = ringsweep.fit(wrong, data, "friction.mu_s=0.1..0.5, friction.mu_k=0.01..0.3")
        truth = {"friction_mu_s": 0.15, "friction_mu_k": 0.1}
        # Four standard errors: one fit in 8000 is beyond.
        assert all(
            abs(found.params[name].value - true) < 4.0 * found.params[name].stderr < 4e-3
            for name, true in truth.items()
        )
        assert np.sqrt(found.redchi) == pytest.approx(0.002, rel=0.25)
        for name, ends in found.conf_interval(sigmas=[0.9999]).items():
            assert ends[0][1] < truth[name] < ends[-1][1]

    def test_starts_are_looked_for_where_a_sweep_has_its_values(self):
        """Half the value of the scene is beyond the true friction, the cells of the sweep are around it."""
        maps = ringsweep.sweep(BELT, {"friction.mu_k": [0.06, 0.12]})
        data = measured(BELT | {"friction": BELT["friction"] | {"mu_k": 0.08}}, "x", T, 0.002, 6)
        found = ringsweep.fit(maps, data, "friction.mu_k", start=2)
        assert found.best_values["friction_mu_k"] == pytest.approx(0.08, abs=3e-4)

    @pytest.mark.slow
    def test_history_after_a_lost_contact_is_the_last_state(self, scene, caplog):
        """The data go on at rest after the loss, for a tenth of the time before it."""
        lost = ringsweep.simulate(scene | {"drive": {"law": "arctan", "amplitude": 2.0}})
        end = float(lost.t_separation)
        t = np.linspace(0.01, 1.1, 120) * end
        phi = np.interp(t, lost.time, lost.phi) + 0.01 * np.random.default_rng(1).standard_normal(120)
        with caplog.at_level(logging.WARNING):
            found = ringsweep.fit(scene, {"t": t, "phi": phi}, "drive.amplitude=1.5..2.5")
        amplitude = found.params["drive_amplitude"]
        assert abs(amplitude.value - 2.0) < 4.0 * amplitude.stderr
        assert np.ptp(found.best_fit[t > 1.01 * end]) == 0.0
        assert f"{len(t[t > end])} of 120 residuals are those of its last state" in caplog.text


class TestWhatTheDataDoNotTell:
    def test_a_model_that_is_wrong_leaves_residuals_like_their_neighbours(self, caplog):
        """The spring of the scene is twice too stiff, and only the friction may vary."""
        data = measured(BELT, "x", T, 0.002, 6)
        with caplog.at_level(logging.WARNING):
            ringsweep.fit(BELT | {"spring": {"stiffness": 4.0}}, data, "friction.mu_k=0.02..0.14", start=2)
        assert "residuals are like their neighbours" in caplog.text
        caplog.clear()
        with caplog.at_level(logging.WARNING):
            ringsweep.fit(BELT, data, "friction.mu_k=0.02..0.14", start=2)
        assert "residuals are like their neighbours" not in caplog.text

    @pytest.mark.slow
    def test_mass_and_stiffness_move_the_body_only_by_their_ratio(self):
        """Friction is proportional to the mass, so x'' = -(k/m) x + mu g."""
        found = ringsweep.fit(BELT, measured(BELT, "x", T, 0.002, 3), ["body.mass", "spring.stiffness"], start=2)
        mass, stiffness = (found.best_values[name] for name in ("body_mass", "spring_stiffness"))
        assert stiffness / mass == pytest.approx(2.0, rel=1e-2)
        assert not found.errorbars or found.params["body_mass"].correl["spring_stiffness"] > 0.999

    def test_friction_in_slip_has_no_influence_before_the_first_slip(self):
        data = measured(BELT, "x", np.linspace(0.1, 5.0, 40), 0.003, 4)
        found = ringsweep.fit(BELT, data, "belt.velocity, friction.mu_k=0.05..0.14", start=1)
        assert not found.errorbars
        assert "friction_mu_k:  at initial value" in found.fit_report()

    def test_friction_in_slip_has_hardly_an_influence_soon_after_it_begins(self, caplog):
        """The first slip begins at 7.36 s."""
        data = measured(BELT, "x", np.linspace(0.1, 7.4, 40), 0.003, 4)
        with caplog.at_level(logging.WARNING):
            ringsweep.fit(BELT, data, "belt.velocity, friction.mu_k=0.05..0.14", start=1)
        assert "friction.mu_k: the data say little of it" in caplog.text
        assert "belt.velocity: the data" not in caplog.text


class TestCommand:
    @pytest.mark.slow
    def test_fit_is_printed_stored_and_drawn(self, tmp_path, capsys, monkeypatch):
        monkeypatch.chdir(tmp_path)
        data = measured(BELT, "x", T, 0.002, 2)
        rows = "".join(f"{a:.6f},{1e3 * b:.6f}\n" for a, b in zip(data["t"], data["x"], strict=True))
        (tmp_path / "run.csv").write_text("t,x (mm)\n" + rows)
        (tmp_path / "my.yaml").write_text(
            json.dumps({"scene": BELT, "sweep": {"grid": {"friction.mu_k": [0.05, 0.14]}}})
        )
        line = ["fit", "my.yaml", "--data", "run.csv", "--vary", "friction.mu_k", "--start", "2", "--noise"]
        assert cli.main([*line, "2 mm"]) == 0
        said = capsys.readouterr().out
        assert "friction_mu_k:  0.0999" in said
        assert cli.main([*line, "2 mm"]) == 0
        assert (tmp_path / "my-fit.png").stat().st_size > 10_000
        assert cli.main(["info", "my-fit.nc"]) == 0
        assert "friction_mu_k:  0.0999" in capsys.readouterr().out
        assert cli.main(["verify", "my-fit.nc"]) == 0
        (tmp_path / "my-fit.png").unlink()
        assert cli.main(["plot", "my-fit.nc"]) == 0
        assert (tmp_path / "my-fit.png").exists()
        assert cli.main(["plot", "my-fit.nc", "--kind", "phase"]) == 2
        with xr.open_dataset("my-fit.nc") as ds:
            assert (ds["residual"] == ds["measured"] - ds["fitted"]).all()
            again = lmfit.model.ModelResult(lmfit.Model(lambda t: t), None).loads(ds["lmfit"].item())
            assert (again.best_fit == ds["fitted"]).all()
        # The scene of the file is the fitted one.
        assert ringsweep.simulate("my-fit.nc").attrs["configuration"].count("0.0999") == 1

    def test_fault_of_the_data_names_its_line(self, tmp_path, capsys):
        (tmp_path / "run.csv").write_text("t,x\n0.1,0.2\n0.2,abc\n")
        (tmp_path / "my.yaml").write_text(json.dumps({"scene": BELT}))
        line = ["fit", str(tmp_path / "my.yaml"), "--data", str(tmp_path / "run.csv"), "--vary", "friction.mu_k"]
        assert cli.main(line) == 2
        (message,) = capsys.readouterr().err.strip().splitlines()
        assert "run.csv" in message
        assert "line 3" in message or ":3" in message
        (tmp_path / "run.csv").write_text("t,x\n0.1,0.2\n0.2,0.3\n")
        assert cli.main([*line[:-1], "friction.mu_x"]) == 2
        assert "did you mean `friction.mu_s`?" in (message := capsys.readouterr().err)
        assert "LOW..HIGH" not in message

    def test_without_lmfit_one_line_says_how_to_get_it(self, monkeypatch):
        monkeypatch.setitem(sys.modules, "lmfit", None)
        refused(r"pip install 'ringsweep\[fit\]'", ringsweep.fit, BELT, {"t": [1.0], "x": [0.1]}, "friction.mu_k")

    def test_an_angle_is_drawn_in_the_unit_of_all_pictures(self):
        about = {"units": "rad", "long_name": "angle"}
        columns = {name: ("measurement", [0.0, np.pi], about) for name in ("measured", "fitted", "residual")}
        above, below = plots.fit(xr.Dataset(columns, {"t": ("measurement", [0.0, 1.0])})).axes
        assert (above.get_ylabel(), below.get_ylabel()) == ("angle (°)", "residual (°)")
        assert [line.get_ydata()[-1] for axes in (above, below) for line in axes.lines] == [180.0, 180.0, 0.0, 180.0]

    def test_a_sweep_is_no_fit(self):
        refused("is no fit", plots.fit, ringsweep.simulate(BELT))


def test_starts_reach_a_minimum_whose_points_are_not_among_the_best():
    """One valley is deep and wide: each of the eight best points lies in it."""
    tried = unit_points("sobol", 512, 2, 0, 0)
    wide, other = (((tried - centre) ** 2).sum(axis=1) for centre in (0.25, 0.8))
    misfits = np.minimum(wide, 0.05 + other)
    assert (wide < other)[np.argsort(misfits)[:8]].all()
    starts = apart(tried, misfits, 8)
    assert len(starts) > 1
    assert starts[0] == np.argmin(misfits)
    assert (np.abs(tried[starts] - 0.8).max(axis=1) < 0.2).any()
