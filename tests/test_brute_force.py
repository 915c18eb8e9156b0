"""500 random scenes over nine decades of v0 and seven of alpha, compared with brute force.

``benchmarks/brute_force.py --csv`` computed the file ``data/brute_force.csv`` without anything of the package.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
from solutions import solve
from tiers import mostly_slow

from ringsweep.quantities.flags import REGIMES
from ringsweep.solvers.event import Auto


@pytest.fixture(scope="module")
def scenes():
    with open(Path(__file__).parent / "data" / "brute_force.csv", newline="") as file:
        return list(csv.DictReader(file))


def column(rows, name):
    return np.array([float(row[name] or "nan") for row in rows])


@pytest.fixture(scope="module", params=mostly_slow(["arctan", "power"], ("arctan",)))
def both(request, scenes, cells):
    """Scenes of one drive, and the outcomes of `auto` for them, in one batch."""
    rows = [row for row in scenes if row["drive"] == request.param]
    paths = [name for name in rows[0] if "." in name and (request.param == "power" or name != "drive.exponent")]
    batch = cells({path: column(rows, path) for path in paths}, drive=request.param)
    return rows, solve(Auto(), batch)


def test_scenes_cover_all_regimes_and_the_ranges_of_v0_and_alpha(scenes):
    assert len(scenes) == 500
    assert {row["regime"] for row in scenes} == {"resting", "oscillatory", "revolving", "separating", "jammed"}
    v0, alpha = column(scenes, "friction.v0"), column(scenes, "friction.alpha")
    assert (v0.min() < 2e-9, v0.max() > 0.5, alpha.min() < 2, alpha.max() > 5e6) == (True,) * 4
    # Brute force is clear about each scene: its runs agree, and no contact that held came close to separation.
    assert all(row["agrees"] == "1" for row in scenes)
    assert np.nanmin(column(scenes, "normal_min")) > 1e-4


def test_a_body_on_compliant_contacts_contradicts_no_end_of_brute_force(scenes):
    """It decides wherever the law is not so steep at rest that friction changes faster than springs ring."""
    assert {row["compliant"] for row in scenes} <= {"confirmed", "undecided"}
    gentle = [row for row in scenes if float(row["friction.v0"]) > 1e-3 and float(row["friction.alpha"]) < 1e3]
    assert len(gentle) > 30
    assert {row["compliant"] for row in gentle} == {"confirmed"}


def test_at_least_98_percent_of_the_scenes_are_certified(both):
    assert both[1].certified.mean() >= 0.98


def test_every_certified_scene_has_the_kind_of_brute_force(both):
    rows, found = both
    wrong = []
    for i in np.flatnonzero(found.certified):
        kind = REGIMES[int(found.regime[i])], REGIMES[int(found.motion[i])], str(int(found.separating_contact[i]))
        if kind != (rows[i]["regime"], rows[i]["motion"], rows[i]["contact"]):
            wrong.append((kind, rows[i]))
    assert wrong == []


def test_times_of_separation_agree_with_brute_force(both):
    """The steps of brute force leave an error of a few microseconds."""
    rows, found = both
    error = abs(found.t_separation - column(rows, "t_separation"))
    assert np.isfinite(error).sum() > 60
    assert np.nanmedian(error) < 1e-8
    assert np.nanmax(error) < 5e-6
