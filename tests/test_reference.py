"""The code of the reference of ``benchmarks.brute_force``: which of its functions Python may call."""

import pkgutil
from collections.abc import Iterator
from importlib import import_module
from inspect import getmembers, isfunction
from types import CodeType

import pytest

import benchmarks.reference


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
