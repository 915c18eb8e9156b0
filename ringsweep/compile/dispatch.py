"""Functions with one body for each type of their first argument: a scene compiles to what it needs and no more."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial, wraps
from typing import Any

from ringsweep.compile.options import specialise


def hook(stub: Callable[..., Any] | None = None, *, absorb: bool = False, optional: bool = False) -> Any:
    """A function whose body is chosen by the type of its first argument: ``@hook``, or ``@hook(absorb=True)``.

    `stub` gives name, signature and docstring. Bodies are added by ``@name.implements(SomeNamedTuple)``. Within a
    kernel Numba picks the body while compiling, so that a scene holds the code of the law, drive and model that it
    names and no other. Called from Python it dispatches in the same way.

    Parameters
    ----------
    stub : callable
    absorb : bool
        Whether bodies are inlined whatever their size, as the innermost loop of a kernel needs it.
    optional : bool
        Whether the stub is the body for types that have none of their own.

    Raises
    ------
    TypeError
        If a body has other arguments than the stub; or when the function is called with a type that has no body.
    """
    if stub is None:
        return partial(hook, absorb=absorb, optional=optional)
    bodies: dict[type, Callable[..., Any]] = {}
    default = stub if optional else None
    name, names = stub.__name__, list(inspect.signature(stub).parameters)

    @wraps(stub)
    def function(*arguments: Any) -> Any:
        body = bodies.get(type(arguments[0]), default)
        if body is None:
            raise TypeError(f"{type(arguments[0]).__name__} has no {name}")
        return body(*arguments)

    def typed(*kinds: Any) -> Callable[..., Any] | None:
        return bodies.get(getattr(kinds[0], "instance_class", type(None)), default)

    specialise(function, typed, absorb=absorb)

    def implements(*classes: type) -> Callable[..., Any]:
        def register(body: Callable[..., Any]) -> Callable[..., Any]:
            if list(inspect.signature(body).parameters) != names:
                raise TypeError(f"{body.__qualname__}: the arguments of {name} are ({', '.join(names)})")
            for cls in classes:
                bodies[cls] = body
            return body

        return register

    def is_defined_for(cls: type) -> bool:
        return optional or cls in bodies

    function.implements = implements  # type: ignore[attr-defined]
    function.is_defined_for = is_defined_for  # type: ignore[attr-defined]
    return function


def lacking(cls: type, functions: tuple[Any, ...]) -> list[str]:
    """Names of the hooks that have no body for a type."""
    return [function.__name__ for function in functions if not function.is_defined_for(cls)]
