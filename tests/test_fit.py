"""Fits of numbers of a scene to measured histories."""

import json
import logging

import numpy as np
import pytest

import ringsweep
from ringsweep import cli, plots
from ringsweep.errors import InputError
from ringsweep.runs.fit import _apart, _end
from ringsweep.statistics import unit_points

BELT = {
    "model": "belt",
    "body": {"mass": 1.0},
    "spring": {"stiffness": 2.0},
    "belt": {"velocity": 0.1},
    "friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.1},
    "time": {"span": 10.0},
}
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
        deviation = np.sqrt(np.sum((x - slope * t) ** 2) / 39)
        assert found.value.item() == pytest.approx(slope, rel=1e-7)
        assert found.standard_error.item() == pytest.approx(deviation / np.sqrt(t @ t), rel=1e-6)
        # The 97.5 % quantile of Student's distribution with 39 degrees of freedom, from a table.
        half = 2.0227 * deviation / np.sqrt(t @ t)
        ends = [found.low, found.high, found.profile_low, found.profile_high]
        assert [end.item() for end in ends] == pytest.approx(2 * [slope - half, slope + half], rel=1e-3)
        given = ringsweep.fit(BELT, {"t": t, "x (mm)": 1e3 * x}, {"belt.velocity": (0.05, 0.13)}, start=2, noise="3 mm")
        assert given.standard_error.item() == pytest.approx(0.003 / np.sqrt(t @ t), rel=1e-6)

    @pytest.mark.slow
    def test_a_wrong_start_finds_the_numbers_that_made_the_history(self):
        """Friction of the scene is twice and half the true one."""
        data = measured(BELT, "x", T, 0.002, 2)
        wrong = BELT | {"friction": {"law": "stiction", "mu_s": 0.3, "mu_k": 0.05}}
        found = ringsweep.fit(wrong, data, "friction.mu_s=0.1..0.5, friction.mu_k=0.01..0.3")
        # Four standard errors: one fit in 8000 is beyond.
        assert (np.abs(found.value - [0.15, 0.1]) < 4.0 * found.standard_error).all()
        assert (found.standard_error < 1e-3).all()
        assert found.attrs["noise"] == pytest.approx(0.002, rel=0.25)
        assert found.attrs["held_measurements"] == found.attrs["uncertified_runs"] == 0

    @pytest.mark.slow
    def test_history_after_a_lost_contact_is_the_last_state(self, scene, caplog):
        """The data go on at rest after the loss, for a tenth of the time before it."""
        lost = ringsweep.simulate(scene | {"drive": {"law": "arctan", "amplitude": 2.0}})
        end = float(lost.t_separation)
        t = np.linspace(0.01, 1.1, 120) * end
        phi = np.interp(t, lost.time, lost.phi) + 0.01 * np.random.default_rng(1).standard_normal(120)
        with caplog.at_level(logging.WARNING):
            found = ringsweep.fit(scene, {"t": t, "phi": phi}, "drive.amplitude=1.5..2.5")
        assert abs(found.value.item() - 2.0) < 4.0 * found.standard_error.item()
        assert found.attrs["held_measurements"] == np.count_nonzero(t > end)
        after = found.fitted.values[t > 1.01 * end]
        assert np.ptp(after) == 0.0
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
    def test_mass_and_stiffness_move_the_body_only_by_their_ratio(self, caplog):
        """Friction is proportional to the mass, so x'' = -(k/m) x + mu g."""
        data = measured(BELT, "x", T, 0.002, 3)
        with caplog.at_level(logging.WARNING):
            found = ringsweep.fit(BELT, data, "body.mass, spring.stiffness", start=2)
        assert "body.mass" in found.attrs["not_told_apart"]
        assert "spring.stiffness" in found.attrs["not_told_apart"]
        assert found.attrs["not_told_apart"] in caplog.text
        mass, stiffness = found.value.values
        assert stiffness / mass == pytest.approx(2.0, rel=1e-2)
        assert (found.standard_error > 0.5 * found.value).all()

    def test_friction_in_slip_has_no_influence_before_the_first_slip(self, caplog):
        t = np.linspace(0.1, 5.0, 40)
        with caplog.at_level(logging.WARNING):
            found = ringsweep.fit(
                BELT, measured(BELT, "x", t, 0.003, 4), "belt.velocity, friction.mu_k=0.05..0.14", start=1
            )
        assert found.standard_error.values[1] == np.inf
        assert np.isfinite(found.standard_error.values[0])
        assert "the data do not depend on friction.mu_k" in caplog.text
        assert np.isinf(found.profile_high.values[1])


class TestCommand:
    @pytest.mark.slow
    def test_fit_is_printed_stored_and_drawn(self, tmp_path, capsys, monkeypatch):
        monkeypatch.chdir(tmp_path)
        data = measured(BELT, "x", T, 0.002, 2)
        rows = "".join(f"{a:.6f},{1e3 * b:.6f}\n" for a, b in zip(data["t"], data["x"], strict=True))
        (tmp_path / "run.csv").write_text("t,x (mm)\n" + rows)
        (tmp_path / "my.yaml").write_text(
            json.dumps({"scene": BELT, "sweep": {"grid": {"friction.mu_k": [0.1, 0.12]}}})
        )
        line = [
            "fit",
            "my.yaml",
            "--data",
            "run.csv",
            "--vary",
            "friction.mu_k=0.05..0.14",
            "--noise",
            "2 mm",
            "--start",
            "2",
        ]
        assert cli.main(line) == 0
        said = capsys.readouterr().out
        assert "friction.mu_k = 0.099999 ± 1.6e-05" in said
        assert "noise 0.002 m (given), 150 measurements" in said
        assert (tmp_path / "my-fit.png").stat().st_size > 10_000
        assert cli.main(line) == 0
        assert cli.main(["info", "my-fit.nc"]) == 0
        assert "friction.mu_k = 0.099999 ± 1.6e-05" in capsys.readouterr().out
        assert cli.main(["verify", "my-fit.nc"]) == 0
        (tmp_path / "my-fit.png").unlink()
        assert cli.main(["plot", "my-fit.nc"]) == 0
        assert (tmp_path / "my-fit.png").exists()
        assert cli.main(["plot", "my-fit.nc", "--kind", "phase"]) == 2

    def test_fault_of_the_data_names_its_line(self, tmp_path, capsys):
        (tmp_path / "run.csv").write_text("t,x\n0.1,0.2\n0.2,abc\n")
        (tmp_path / "my.yaml").write_text(json.dumps({"scene": BELT}))
        line = ["fit", str(tmp_path / "my.yaml"), "--data", str(tmp_path / "run.csv"), "--vary", "friction.mu_k"]
        assert cli.main(line) == 2
        (message,) = capsys.readouterr().err.strip().splitlines()
        assert "run.csv" in message
        assert "line 3" in message or ":3" in message

    def test_a_sweep_is_no_fit(self):
        with pytest.raises(InputError, match="is no fit"):
            plots.fit(ringsweep.simulate(BELT))


def test_starts_reach_a_minimum_whose_points_are_not_among_the_best():
    """One valley is deep and wide: each of the eight best points lies in it."""
    tried = unit_points("sobol", 512, 2, 0, 0)
    wide, other = (((tried - centre) ** 2).sum(axis=1) for centre in (0.25, 0.8))
    misfits = np.minimum(wide, 0.05 + other)
    assert (wide < other)[np.argsort(misfits)[:8]].all()
    starts = np.array(_apart(tried, misfits, 8))
    assert len(starts) > 1
    assert starts[0].tolist() == tried[np.argmin(misfits)].tolist()
    assert (np.abs(starts - 0.8).max(axis=1) < 0.2).any()


@pytest.mark.parametrize("jump", [0.15, 0.5, 0.85])
def test_an_interval_ends_where_the_misfit_jumps(jump):
    """The straight line between the ends would end it at 0.2."""
    end = _end(lambda value: value**2 if value < jump else 100.0, (0.0, 0.0), (1.0, 100.0), 4.0)
    assert jump <= end <= jump + 1 / 64


def test_an_interval_on_a_parabola_ends_at_its_root():
    assert _end(lambda value: 16.0 * value**2, (0.0, 0.0), (1.0, 16.0), 4.0) == pytest.approx(0.5)
