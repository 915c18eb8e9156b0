"""The values at which a regime begins or ends."""

import json

import numpy as np
import pytest
from belts import on_belt

import ringsweep
from ringsweep import cli
from ringsweep.storage import netcdf

BELT = on_belt({"law": "stiction", "mu_s": 0.15, "mu_k": 0.1}, 2.0, velocity=0.1, span=10.0)


class TestThreshold:
    def test_belt_carries_its_load_until_the_spring_reaches_static_friction(self):
        """The spring is stretched by v T: k v T = mu_s m g."""
        for stiffness in (2.0, 3.0):
            scene = BELT | {"spring": {"stiffness": stiffness}}
            found = ringsweep.threshold(scene, "friction.mu_s", "riding", (0.12, 0.4), 1e-9)
            exact = stiffness * 0.1 * 10.0 / 9.81
            assert abs(found.friction_mu_s.item() - exact) <= found.error.item() <= 1e-9
            assert found.begins.item() == 1
            assert ringsweep.words(found.beyond).item() == "stick-slip"

    def test_every_change_of_the_regime_in_the_interval_is_told(self, scene):
        """Runs beside each threshold, on both sides of its error, differ in the regime as it says."""
        found = ringsweep.threshold(scene, "drive.amplitude", "separating", (0.5, 8.0), scan=33)
        assert found.sizes["vertex"] > 1
        assert (np.diff(found.begins) != 0).all()
        for value, error, begins in zip(
            found.drive_amplitude.values, found.error.values, found.begins.values, strict=True
        ):
            ends = ringsweep.sweep(scene, {"drive.amplitude": [value - 1.001 * error, value + 1.001 * error]})
            assert (ringsweep.words(ends.regime).values == "separating").tolist() == [begins == 0, begins == 1]

    def test_no_change_between_cells_of_the_sweep_is_missed(self, scene):
        """The runs of a scan divide the intervals of the axis, however it is spaced, and its cells are among them."""
        swept = [0.5, 0.75, 0.8, 5.0, 7.6, 7.7, 7.9, 8.0]
        maps = ringsweep.sweep(scene, {"drive.amplitude": swept}, progress=False)
        inside = ringsweep.words(maps.regime).values == "separating"
        config = {"scene": scene, "sweep": {"grid": {"drive.amplitude": swept}}}
        found = ringsweep.threshold(config, "drive.amplitude", "separating", scan=2, tolerance=1e-2)
        between = np.searchsorted(swept, found.drive_amplitude.values) - 1
        assert 0 < found.sizes["vertex"] == np.count_nonzero(np.diff(inside.astype(int)))
        assert between.tolist() == np.flatnonzero(np.diff(inside.astype(int))).tolist()

    @pytest.mark.slow
    def test_what_follows_a_lost_contact_has_thresholds_too(self, scene, tmp_path, capsys):
        """Runs beside each threshold differ in the word of the aftermath. Without `impact` there is none."""
        going_on = scene | {"impact": {"restitution": 0.5}}
        found = ringsweep.threshold(going_on, "drive.amplitude", "recovered", (0.5, 8.0), scan=17)
        assert found.sizes["vertex"] > 0
        for value, error, begins in zip(
            found.drive_amplitude.values, found.error.values, found.begins.values, strict=True
        ):
            axes = {"drive.amplitude": [value - 1.001 * error, value + 1.001 * error]}
            words = ringsweep.words(ringsweep.sweep(going_on, axes, progress=False).aftermath).values
            assert (words == "recovered").tolist() == [begins == 0, begins == 1]
        assert set(ringsweep.words(found.beyond).values) <= {"held", "open", "tumbled"}

        config = tmp_path / "ring.yaml"
        config.write_text(json.dumps({"scene": scene}))
        asked = ["threshold", str(config), "--path", "drive.amplitude", "--from", "1", "--to", "2"]
        assert cli.main([*asked, "--regime", "tumbled"]) == 2
        assert "'tumbled' needs impact in the scene" in capsys.readouterr().err

    def test_axis_beside_the_threshold_has_the_value_of_the_command_line(self, tmp_path, capsys):
        """k v T = mu_s m g again, with a spring that the sweep varies."""
        grid = {"friction.mu_s": [0.12, 0.4], "spring.stiffness": [2.0, 3.0]}
        config = tmp_path / "belt.yaml"
        config.write_text(json.dumps({"scene": BELT, "sweep": {"grid": grid}}))
        asked = ["threshold", str(config), "--path", "friction.mu_s", "--regime", "riding"]
        assert cli.main([*asked, "--set", "spring.stiffness=3", "--scan", "5"]) == 0
        assert "riding begins at friction.mu_s = 0.30581" in capsys.readouterr().out
        assert cli.main([*asked, "--set", "friction.mu_s=0.2"]) == 2
        assert "friction.mu_s: is swept here" in capsys.readouterr().err

    def test_answer_has_the_unit_in_which_the_number_was_written(self, tmp_path, capsys):
        """k v T = mu_s m g: the mass is 1.359157 kg."""
        config = tmp_path / "belt.yaml"
        sweep = {"grid": {"body.mass": {"linspace": ["1000 g", "2000 g", 5]}}}
        config.write_text(json.dumps({"scene": BELT, "sweep": sweep}))
        asked = ["threshold", str(config), "--path", "body.mass", "--regime", "riding", "--scan", "5"]
        for more, mass, ends in (
            ([], "1359.15", "1000 g to 2000 g"),
            (["--from", "1 kg", "--to", "2 kg"], "1.35915", "1 kg to 2 kg"),
            (["--unit", "lb"], "2.99642", "2.20462 lb to 4.40925 lb"),
        ):
            assert cli.main([*asked, *more]) == 0
            said = capsys.readouterr().out
            assert f"riding begins at body.mass = {mass}" in said
            assert f"scan: 5 runs from {ends}" in said
        assert cli.main([*asked, "--unit", "rpm"]) == 2
        assert "unit: the unit 'rpm' does not fit: body.mass is in kg" in capsys.readouterr().err
        assert cli.main(["run", str(config), "-o", str(tmp_path / "belt.nc")]) == 0
        assert cli.main(["info", str(tmp_path / "belt.nc")]) == 0
        assert "body_mass: 1000 to 2000 g" in capsys.readouterr().out

    def test_thresholds_are_written_and_printed_as_json(self, tmp_path, capsys):
        config, output = tmp_path / "belt.yaml", str(tmp_path / "edge.nc")
        config.write_text(json.dumps({"scene": BELT, "sweep": {"grid": {"body.mass": ["1000 g", "2000 g"]}}}))
        asked = ["threshold", str(config), "--path", "body.mass", "--regime", "riding", "--scan", "5", "-o", output]
        for _ in range(2):
            assert cli.main([*asked, "--json"]) == 0
        found = json.loads(capsys.readouterr().out.partition("}\n{")[0] + "}")
        (one,) = found["thresholds"]
        assert (one["does"], one["beyond"], found["unit"]) == ("begins", "stick-slip", "g")
        assert abs(one["value"] - 1359.157) < 0.01 >= one["error"]
        assert cli.main(["info", output]) == 0
        assert "riding begins at body.mass = 1359.15" in capsys.readouterr().out
        assert cli.main(["info", output, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["thresholds"] == [one]
        with netcdf.open_dataset(output) as written:
            assert written.body_mass.item() == pytest.approx(1e-3 * one["value"])

    def test_interval_without_a_change_has_no_threshold(self, tmp_path, capsys, caplog):
        config = tmp_path / "belt.yaml"
        config.write_text(json.dumps({"scene": BELT, "sweep": {"grid": {"friction.mu_s": [0.3, 0.4]}}}))
        assert (
            cli.main(["threshold", str(config), "--path", "friction.mu_s", "--regime", "riding", "--scan", "20"]) == 0
        )
        out, err = capsys.readouterr()
        assert "riding neither begins nor ends along friction.mu_s\nscan: 20 runs from 0.3 to 0.4: 20 riding" in out
        assert "do the axes reach far enough" not in caplog.text
        assert not err


class TestDistribution:
    @pytest.mark.slow
    def test_uncertain_spring_makes_the_threshold_uncertain_in_proportion(self, tmp_path, capsys):
        """k v T = mu_s m g, with k even between 1.5 and 2.5 N/m: so is mu_s, and its quantiles are known."""
        of = {"spring.stiffness": {"uniform": [1.5, 2.5]}}
        config = tmp_path / "belt.yaml"
        config.write_text(json.dumps({"scene": BELT, "sweep": {"sample": {"n": 128, "seed": 3, "of": of}}}))
        found = ringsweep.threshold(config, "friction.mu_s", "riding", (0.12, 0.4), 1e-7, scan=9)
        exact = (1.5 + found["quantile"].values) * 0.1 * 10.0 / 9.81
        assert (found.threshold_quantile_low.values <= exact).all()
        assert (exact <= found.threshold_quantile_high.values).all()
        assert found.threshold_quantile.values == pytest.approx(exact, rel=0.02)
        assert np.isfinite(found.threshold).all()
        line = ["threshold", str(config), "--path", "friction.mu_s", "--regime", "riding", "--scan", "9"]
        assert cli.main([*line, "--from", "0.12", "--to", "0.2"]) == 0
        said = capsys.readouterr().out
        assert "50% below 0.2" in said or "50% below inf" in said
        # k < 0.2 m g / (v T) = 1.962 N/m begins within: 46.2 % of the points.
        assert "; in 69 it begins nowhere there" in said or "; in 68 it begins nowhere there" in said
