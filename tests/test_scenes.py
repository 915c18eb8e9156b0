"""A kernel has no code for what its scene lacks, and a sweep stores nothing but outcomes."""

import tracemalloc

import pytest

from benchmarks import scenes
from benchmarks.work_precision import SCENES
from ringsweep import config
from ringsweep.runs import sweep
from ringsweep.runs.executors import Execution
from ringsweep.solvers import automaton

LEANEST, CUT = "one contact, Coulomb, immobile uniform ring", "+ a zone"


@pytest.fixture(scope="module")
def code(tmp_path_factory: pytest.TempPathFactory):
    """Code of the `rk4` kernels of two scenes, compiled with an empty cache: a cached kernel has no assembly text."""
    cache = tmp_path_factory.mktemp("cache")
    return scenes.in_child(scenes.codes, (LEANEST, CUT), "rk4", cache=cache)


@pytest.mark.slow
def test_kernel_calls_only_functions_that_its_scene_uses(code):
    assert code[LEANEST]["calls"] == []
    # Calls of the arctan drive.
    assert set(code[CUT]["calls"]) == {"atan", "log1p"}
    assert code[LEANEST]["instructions"] < code[CUT]["instructions"]


@pytest.mark.slow
def test_kernel_takes_no_function_from_what_its_scene_lacks(code):
    for one in code.values():
        assert one["optional"] == dict.fromkeys(scenes.OPTIONAL, 0)


def test_sampled_sweep_runs_the_kernels_of_the_plain_one():
    scene = scenes.on_ring("stiction", drive={"law": "arctan", "amplitude": 2.0}, arcs=1)
    plain = {"scene": scene, "sweep": {"grid": {"initial.phi": [0.1]}}}
    sampled = {"scene": scene, "sweep": {"sample": {"n": 16, "of": {"drive.amplitude": {"uniform": [1.0, 2.0]}}}}}
    counts = []
    for source in (plain, sampled):
        sweep.compute(config.load(source), Execution(1, progress=False))
        counts.append(len(automaton._integrate.signatures))
    assert counts[0] == counts[1]


def test_memory_of_a_sweep_does_not_grow_with_its_steps():
    def most(steps: int) -> int:
        smooth = SCENES["smooth"]
        configuration = smooth.configuration(smooth.cells(256), "rk4", steps=steps)
        sweep.compute(configuration, Execution(1, progress=False))
        tracemalloc.start()
        try:
            sweep.compute(configuration, Execution(1, progress=False))
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    most(20)  # Imports late modules.
    # The states of 256 cells at 2000 steps would take eight megabytes.
    assert most(2000) < most(20) + 100_000
