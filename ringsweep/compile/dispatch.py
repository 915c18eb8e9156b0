"""Functions with one body for each type of their first argument: how a scene compiles to what it needs and no more."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any

from ringsweep.compile.options import specialise


def hook(stub: Callable[..., Any], *, absorb: bool = False) -> Any:
    """A function whose body is chosen by the type of its first argument.

    `stub` gives name, signature and docstring. Bodies are added by ``@name.implements(SomeNamedTuple)``. Within a
    kernel Numba picks the body while compiling, so that a scene holds the code of the law, drive and model that it
    names and no other. Called from Python it dispatches in the same way.

    Raises
    ------
    TypeError
        If a body has other arguments than the stub; or when the function is called with a type that has no body.
    """
    bodies: dict[type, Callable[..., Any]] = {}
    signature = inspect.signature(stub)

    @wraps(stub)
    def function(*arguments: Any) -> Any:
        body = bodies.get(type(arguments[0]))
        if body is None:
            raise TypeError(f"{type(arguments[0]).__name__} has no {stub.__name__}")
        return body(*arguments)

    def typed(*kinds: Any) -> Callable[..., Any] | None:
        return bodies.get(getattr(kinds[0], "instance_class", type(None)))

    specialise(function, typed, absorb=absorb)

    def implements(*classes: type) -> Callable[..., Any]:
        def register(body: Callable[..., Any]) -> Callable[..., Any]:
            if list(inspect.signature(body).parameters) != list(signature.parameters):
                names = ", ".join(signature.parameters)
                raise TypeError(f"{body.__qualname__}: the arguments of {stub.__name__} are ({names})")
            for cls in classes:
                bodies[cls] = body
            return body

        return register

    function.implements = implements  # type: ignore[attr-defined]
    function.bodies = bodies  # type: ignore[attr-defined]
    return function


def absorbed_hook(stub: Callable[..., Any]) -> Any:
    """A :func:`hook` whose bodies are inlined whatever their size, for the innermost loop of a kernel."""
    return hook(stub, absorb=True)
