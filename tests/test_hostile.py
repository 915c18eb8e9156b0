"""Attacks in a short version: random configurations, damaged files, faults of the disk, two writers; test_survival
kills."""

import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.hostile import configurations as hostile
from benchmarks.hostile.__main__ import PARTS, SEED

pytestmark = pytest.mark.slow


@pytest.mark.skipif(sys.platform == "win32", reason="attacks need fork and SIGKILL")
def test_short_attacks_find_nothing():
    parts = [part for part in PARTS if part not in ("configurations", "kills")]
    found = subprocess.run(
        [sys.executable, "-m", "benchmarks.hostile", *parts, "--short"],
        cwd=Path(__file__).parents[1],
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.returncode == 0, found.stdout + found.stderr
    assert "everything held" in found.stdout
    for part in parts:
        assert f"{part}: " in found.stdout


def test_random_configurations_are_refused_in_one_line_or_stay_finite(tmp_path):
    report = hostile.configurations(tmp_path, 50, SEED, hostile.COMMON)
    assert not report.broken
    assert report.counts["run: all cells have a regime"] > 10
    assert report.counts["run: exit status 2"] > 10
