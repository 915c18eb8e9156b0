"""The code of the reference of ``benchmarks.brute_force``: which of its functions Python may call."""

import pkgutil
from collections.abc import Iterator
from importlib import import_module
from inspect import getmembers, isfunction
from types import CodeType

import pytest
from rings import course, rubs, shape

import benchmarks.reference
from benchmarks.reference.compliant import follow
from benchmarks.reference.problem import problem


def names_in(code: CodeType) -> Iterator[str]:
    """Names that a function and the functions within it look up."""
    yield from code.co_names
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield from names_in(part)


@pytest.mark.parametrize("module", [found.name for found in pkgutil.iter_modules(benchmarks.reference.__path__)])
def test_python_calls_no_function_that_only_compiled_code_can_call(module):
    # Such a call would end the process.
    for _, function in getmembers(import_module(f"benchmarks.reference.{module}"), isfunction):
        for name in names_in(function.__code__):
            options = getattr(function.__globals__.get(name), "targetoptions", {})
            assert not options.get("no_cpython_wrapper"), f"{function.__name__} calls {name}"


@pytest.mark.slow
def test_springs_do_not_end_at_the_reactions_of_a_step_that_they_reject():
    """Friction of bristles turns 1e4 times as fast as the springs ring: the first step that is tried is too long."""
    mass, phi, omega = 2e5, 1.15, 94.7
    friction = rubs("lugre", rest=(0.48, 0.26), sigma0=4e3, sigma1=3e4, sigma2=0.0, v_s=0.0125)
    course_ = course("sinusoidal", 0.94, 476.0, -1.537, phi=phi, omega=omega, span=0.1)
    p = problem(shape(mass, 3.3e-4, 0.043, 0.0145, 0.065) | friction | course_ | {"gravity": 9.81})
    load, until = 23.0 * mass * p.gravity, 1e-10
    found = follow(p, (0.0, phi, omega, 0.0, 0.0, load, load, 0.0), 0.0, until, 1e18, 1.0)
    assert found["t"] == until
