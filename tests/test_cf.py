"""Files follow the CF conventions, by the word of an independent checker (extra ``lint``)."""

import json

import numpy as np
import pytest
from belts import on_belt

import ringsweep
from ringsweep.storage import netcdf

pytestmark = pytest.mark.slow

runner = pytest.importorskip("compliance_checker.runner")

BELT = on_belt({"law": "stiction", "mu_s": 0.15, "mu_k": 0.1}, 2.0, velocity=0.1, span=20.0)
SPEEDS = {"belt.velocity": np.linspace(0.05, 0.2, 4).tolist(), "friction.mu_s": [0.12, 0.15, 0.2]}

#: A history has each event twice, before and after, and counts seconds since its start rather than since a date.
TIME_OF_A_RUN = (
    'Coordinate variable "time" must be strictly monotonic',
    "time does not have correct time units",
    'Time coordinate variable "time" should have a string valued attribute "calendar"',
    "Coordinate variable 'time' should have standard_name='time', found: 'None'",
)


def complaints(path):
    """Everything that the checker says about a file."""
    report = path.with_suffix(".json")
    runner.CheckSuite.load_all_available_checkers()
    runner.ComplianceChecker.run_checker(
        str(path), ["cf:1.11"], 0, "strict", output_filename=str(report), output_format="json"
    )
    found = json.loads(report.read_text())["cf:1.11"]
    return [
        message
        for level in ("high", "medium", "low")
        for one in found[f"{level}_priorities"]
        for message in one["msgs"]
    ]


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("options", [{}, {"refine": {"stride": 2}}], ids=["full", "refined"])
def test_sweep_follows_the_conventions(tmp_path, options):
    ringsweep.sweep(BELT, SPEEDS, tmp_path / "sweep.nc", progress=False, **options).close()
    assert complaints(tmp_path / "sweep.nc") == []


@pytest.mark.filterwarnings("default")
def test_run_follows_the_conventions_but_for_its_time(tmp_path):
    netcdf.save(ringsweep.simulate({"scene": BELT}), tmp_path / "run.nc")
    assert set(complaints(tmp_path / "run.nc")) <= set(TIME_OF_A_RUN)
