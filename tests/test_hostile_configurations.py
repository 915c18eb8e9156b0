"""A short version of the attack by random configurations, and that it would see what it looks for."""

import sys

import pytest

from benchmarks.hostile import configurations as hostile
from benchmarks.hostile.__main__ import SEED
from ringsweep import cli


@pytest.mark.slow
def test_random_configurations_are_refused_in_one_line_or_stay_finite(tmp_path):
    report = hostile.configurations(tmp_path, 50, SEED, hostile.COMMON)
    assert not report.broken
    assert report.counts["run: all cells have a regime"] > 10
    assert report.counts["run: exit status 2"] > 10


def raising(arguments):
    raise ZeroDivisionError


@pytest.mark.parametrize(
    ("main", "problem"),
    [
        (raising, "ZeroDivisionError"),
        (lambda arguments: 1, "exit status 1"),
        (lambda arguments: print("Traceback (most recent call last)", file=sys.stderr) or 2, "traceback"),
        (lambda arguments: print("no", file=sys.stderr) or 2, "no place is named: no"),
        (lambda arguments: print("scene" * 500, file=sys.stderr) or 2, "2500 characters"),
        (lambda arguments: 0, "the file is missing"),
    ],
)
def test_what_must_not_happen_is_seen(tmp_path, monkeypatch, main, problem):
    (tmp_path / "work").mkdir()
    monkeypatch.setattr(cli, "main", main)
    report = hostile.configurations(tmp_path / "work", 1, SEED, hostile.COMMON)
    assert len(report.broken) == 1
    assert problem in report.broken[0]
    assert "number 0" in report.broken[0]
