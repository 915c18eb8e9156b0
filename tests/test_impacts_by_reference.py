"""100 random scenes that lose a contact, compared with the reference of ``benchmarks.brute_force``.

``benchmarks/brute_force.py --impacts`` computed the file ``data/impacts.csv`` without anything of the package.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import ringsweep
from benchmarks.brute_force import IMPACTS, nest


@pytest.fixture(scope="module")
def followed():
    """The rows of the file, and what the package says of them, in one batch."""
    with open(Path(__file__).parent / "data" / "impacts.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    paths = [name for name in rows[0] if "." in name]
    axes = {path: xr.DataArray([float(row[path]) for row in rows], dims="run") for path in paths}
    return rows, ringsweep.sweep(nest(IMPACTS, {path: float(rows[0][path]) for path in paths}), axes)


def test_certified_runs_with_impacts_have_the_words_of_the_reference(followed):
    rows, data = followed
    certified = data.certified.values == 1
    restitution = np.array([float(row["impact.restitution"]) for row in rows])
    gains = ringsweep.words(data.uncertified_because).values == "law_not_obeyed"
    assert (restitution[gains] > 0.8).all(), "Newton's law gains energy where little is lost"
    assert certified[~gains].mean() >= 0.9
    words = [ringsweep.words(data[name]).values for name in ("regime", "aftermath")]
    contact = data.separating_contact.values
    for i in np.flatnonzero(certified):
        said = str(words[0][i]), str(contact[i]), str(words[1][i])
        assert said == (rows[i]["regime"], rows[i]["contact"], rows[i]["aftermath"]), rows[i]


@pytest.mark.parametrize(
    "name", [
        "t_separation", "t_end", "phi_end", "omega_end", "open_time", "flight_time", "gap_max", "impact_speed_max",
        "impact_loss", "tumbles", "t_recovered",
    ],
)  # fmt: skip
def test_certified_runs_with_impacts_have_the_numbers_of_the_reference(followed, name):
    rows, data = followed
    certified = data.certified.values == 1
    expected = np.array([float(row[name]) for row in rows])
    np.testing.assert_allclose(data[name].values[certified], expected[certified], rtol=1e-4, atol=1e-5)
