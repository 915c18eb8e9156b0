"""Cases that run by default, and cases that only ``.ci/run`` asks for."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def mostly_slow(cases: Iterable[Any], fast: Collection[Any]) -> list[Any]:
    """Cases of ``pytest.mark.parametrize``, of which only `fast` are not marked slow.

    A claim about every friction law needs a kernel for each of them. By default it is tested with those kernels that
    other tests need too.
    """
    cases = list(cases)
    assert all(case in cases for case in fast), "a fast case that the test does not have"
    return [case if case in fast else _slow(*case) if isinstance(case, tuple) else _slow(case) for case in cases]


def _slow(*values: Any) -> Any:
    return pytest.param(*values, marks=pytest.mark.slow)
