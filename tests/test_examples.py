"""Examples in docstrings are correct, and the API reference lists every public name."""

import doctest
import inspect
import re
from pathlib import Path

import pytest
from tiers import mostly_slow

import ringsweep
from ringsweep import cli, plots

ROOT = Path(__file__).parents[1]
PUBLIC = {
    f"{module.__name__}.{name}": getattr(module, name)
    for module in (ringsweep, plots)
    for name in module.__all__
    if callable(getattr(module, name))
}
#: Functions whose examples need kernels that no other test needs.
OF_OWN_KERNELS = {"ringsweep.fit", "ringsweep.friction_law", "ringsweep.precision", "ringsweep.plots.animation"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Working folder with the configuration that `ringsweep init` writes."""
    monkeypatch.chdir(tmp_path)
    assert cli.main(["init", "-q"]) == 0
    return tmp_path


@pytest.mark.parametrize("name", mostly_slow(PUBLIC, set(PUBLIC) - OF_OWN_KERNELS))
def test_examples_in_public_docstrings_are_correct(name, folder):
    drawing = {name: getattr(plots, name) for name in plots.__all__}
    (test,) = doctest.DocTestFinder(recurse=False).find(PUBLIC[name], name, globs=drawing)
    assert test.examples
    report: list[str] = []
    assert doctest.DocTestRunner().run(test, out=report.append).failed == 0, "".join(report)


def test_public_docstrings_describe_every_parameter():
    for name, function in PUBLIC.items():
        for parameter in inspect.signature(function).parameters:
            assert parameter in (function.__doc__ or ""), f"{name}: {parameter}"


def test_api_reference_lists_every_public_name():
    page = (ROOT / "docs" / "api.md").read_text()
    for module in (ringsweep, plots):
        for name in module.__all__:
            assert re.search(rf"^( {{3}}|\.\. py:data:: ){name}$", page, re.M), name
