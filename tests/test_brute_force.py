"""500 random scenes over nine decades of v0 and seven of alpha, each settled by brute force beforehand.

The file holds what ``benchmarks/brute_force.py`` found, with nothing of the package.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
from solutions import solve

from ringsweep.quantities.variables import REGIMES
from ringsweep.solvers.event import Auto

PATHS = {
    "amplitude": "drive.amplitude",
    "center": "zone.center",
    "half_angle": "zone.half_angle",
    "rough_s": "friction.rough.mu_s",
    "rough_k": "friction.rough.mu_k",
    "rest_s": "friction.rest.mu_s",
    "rest_k": "friction.rest.mu_k",
    "alpha": "friction.alpha",
    "v0": "friction.v0",
    "omega": "initial.omega",
    "span": "time.span",
}


@pytest.fixture(scope="module")
def scenes():
    with open(Path(__file__).parent / "data" / "brute_force.csv", newline="") as file:
        return list(csv.DictReader(file))


def column(rows, name):
    return np.array([float(row[name] or "nan") for row in rows])


@pytest.fixture(scope="module", params=["arctan", "power"])
def both(request, scenes, cells):
    """Scenes of one drive, and what `auto` makes of them in one batch."""
    rows = [row for row in scenes if row["drive"] == request.param]
    paths = PATHS | ({"exponent": "drive.exponent"} if request.param == "power" else {})
    batch = cells({path: column(rows, name) for name, path in paths.items()}, drive=request.param)
    return rows, solve(Auto(), batch)


def test_scenes_cover_what_they_should(scenes):
    assert len(scenes) == 500
    assert {row["regime"] for row in scenes} == {"resting", "oscillatory", "revolving", "separating", "jammed"}
    v0, alpha = column(scenes, "v0"), column(scenes, "alpha")
    assert (v0.min() < 2e-9, v0.max() > 0.5, alpha.min() < 2, alpha.max() > 5e6) == (True,) * 4
    # Brute force is sure of itself: its own two resolutions agree, and no contact that held was close to lost.
    assert all(row["agrees"] == "1" for row in scenes)
    assert np.nanmin(column(scenes, "normal_min")) > 1e-4


def test_nearly_all_are_certified(both):
    assert both[1].certified.mean() >= 0.98


def test_every_certified_one_is_right(both):
    rows, found = both
    wrong = []
    for i in np.flatnonzero(found.certified):
        kind = REGIMES[int(found.regime[i])], REGIMES[int(found.motion[i])], str(int(found.separating_contact[i]))
        if kind != (rows[i]["regime"], rows[i]["motion"], rows[i]["contact"]):
            wrong.append((kind, rows[i]))
    assert wrong == []


def test_separations_are_where_brute_force_finds_them(both):
    """To the few microseconds that its steps leave open."""
    rows, found = both
    error = abs(found.t_separation - column(rows, "t_separation"))
    assert np.isfinite(error).sum() > 60
    assert np.nanmedian(error) < 1e-8
    assert np.nanmax(error) < 5e-6
