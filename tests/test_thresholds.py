"""The values at which a regime begins or ends."""

import json

import numpy as np
import pytest

import ringsweep
from ringsweep import cli
from ringsweep.errors import InputError

BELT = {
    "model": "belt",
    "body": {"mass": 1.0},
    "spring": {"stiffness": 2.0},
    "belt": {"velocity": 0.1},
    "friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.1},
    "time": {"span": 10.0},
}


class TestThreshold:
    def test_belt_carries_its_load_until_the_spring_reaches_the_static_friction(self):
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

    def test_interval_without_a_change_has_no_threshold(self, tmp_path, capsys):
        config = tmp_path / "belt.yaml"
        config.write_text(json.dumps({"scene": BELT, "sweep": {"grid": {"friction.mu_s": [0.3, 0.4]}}}))
        assert cli.main(["threshold", str(config), "--path", "friction.mu_s", "--regime", "riding", "--scan", "5"]) == 0
        assert "riding neither begins nor ends there\nscan: 5 runs from 0.3 to 0.4: 5 riding" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("path", "between", "problem"),
    [
        ("friction.mu", (0.1, 0.2), "path: the scene has no such number to vary; did you mean"),
        ("friction.law", (0.1, 0.2), "no number that varies continuously"),
        ("friction.mu_s", None, "does not sweep friction.mu_s: say where to look, by --from and --to"),
        ("friction.mu_s", (0.3, 0.2), "to: 0.2 is not greater than 0.3"),
        ("friction.mu_s", (0.2, "3 kg"), "to: "),
    ],
)
def test_wrong_request_says_what_is_wrong(path, between, problem):
    with pytest.raises(InputError) as error:
        ringsweep.threshold(BELT, path, "riding", between)
    assert problem in str(error.value)
