"""A scene compiles to what it uses: what it lacks is not in the code, and a sweep keeps nothing but outcomes."""

import tracemalloc

import pytest

from benchmarks import scenes
from benchmarks.work_precision import SCENES
from ringsweep.runs import sweep

LEANEST, CUT = "one contact, Coulomb, immobile uniform ring", "+ an arc"


@pytest.fixture(scope="module")
def code(tmp_path_factory: pytest.TempPathFactory):
    """Code of the `rk4` kernel of scenes, compiled where nothing is cached: what comes from there has no text."""
    cache = tmp_path_factory.mktemp("cache")
    return scenes.in_child(scenes.codes, (LEANEST, CUT), "rk4", cache=cache)


def test_calls_are_found_in_code():
    text = "\tmovabsq\t$exp, %rax\n\tcallq\t*%rax\n\tcallq\tatan@PLT\n\t.globl\tlog\n_exponent:\n"
    assert scenes.code_of(text) == {"instructions": 3, "calls": ["exp", "atan"]}


def test_kernel_holds_what_the_scene_uses(code):
    assert code[LEANEST]["calls"] == []
    # Of its drive.
    assert set(code[CUT]["calls"]) == {"atan", "log1p"}
    assert code[LEANEST]["instructions"] < code[CUT]["instructions"]


def test_sweep_stores_outcomes_alone():
    def most(steps: int) -> int:
        smooth = SCENES["smooth"]
        configuration = smooth.configuration(smooth.cells(256), "rk4", steps=steps)
        sweep.compute(configuration, jobs=1, progress=False)
        tracemalloc.start()
        try:
            sweep.compute(configuration, jobs=1, progress=False)
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    most(20)  # Modules that are imported late.
    # A state of 256 cells at each of 2000 steps would be eight megabytes.
    assert most(2000) < most(20) + 100_000
