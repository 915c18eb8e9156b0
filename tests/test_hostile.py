"""Attacks in a short version: damaged files, faults of the disk, two writers. test_survival.py kills, and
test_hostile_configurations.py makes configurations."""

import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.hostile.__main__ import PARTS

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
