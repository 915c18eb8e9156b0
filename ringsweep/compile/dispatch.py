"""Hooks: functions with one body for each type of their first argument.

The *body* of a hook for a type is what ``@hook.implements(Type)`` decorates. Its arguments have the names of the
hook's arguments, and the hook's docstring says what they are.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial, wraps
from typing import Any

from ringsweep.compile.options import specialise


def hook(stub: Callable[..., Any] | None = None, *, absorb: bool = False, optional: bool = False) -> Any:
    """Make a function whose body is chosen by the type of its first argument: ``@hook``, or ``@hook(absorb=True)``.

    Bodies are added by ``@name.implements(SomeNamedTuple)``. In a kernel, Numba chooses the body while it compiles. So
    the kernel contains only the code of the law, the drive and the model of its scene. In Python, each call chooses the
    body.

    Parameters
    ----------
    stub : callable
        Gives name, signature and docstring.
    absorb : bool
        Whether bodies of any size are inlined; see :func:`ringsweep.compile.absorbed`.
    optional : bool
        Whether the stub is the body for types without a body.

    Returns
    -------
    callable
        The hook. ``hook.implements(*types)`` decorates a body; ``hook.body_of(type)`` is the body for a type, or None.

    Raises
    ------
    TypeError
        If the arguments of a body differ from those of the stub, or if a call has a type without a body.
    """
    if stub is None:
        return partial(hook, absorb=absorb, optional=optional)
    bodies: dict[type, Callable[..., Any]] = {}
    default = stub if optional else None
    name, names = stub.__name__, list(inspect.signature(stub).parameters)

    @wraps(stub)
    def function(*arguments: Any) -> Any:
        body = body_of(type(arguments[0]))
        if body is None:
            raise TypeError(f"{type(arguments[0]).__name__} has no {name}")
        return body(*arguments)

    def typed(*kinds: Any) -> Callable[..., Any] | None:
        return body_of(getattr(kinds[0], "instance_class", type(None)))

    specialise(function, typed, absorb=absorb)

    def implements(*classes: type) -> Callable[..., Any]:
        def register(body: Callable[..., Any]) -> Callable[..., Any]:
            if list(inspect.signature(body).parameters) != names:
                raise TypeError(f"{body.__qualname__}: the arguments of {name} are ({', '.join(names)})")
            for cls in classes:
                bodies[cls] = body
            return body

        return register

    def body_of(cls: type) -> Callable[..., Any] | None:
        return bodies.get(cls, default)

    function.implements = implements  # type: ignore[attr-defined]
    function.body_of = body_of  # type: ignore[attr-defined]
    return function


def lacking(cls: type, functions: tuple[Any, ...]) -> list[str]:
    """Hooks that have no body for a type, as ``module.name``."""
    missing = [function for function in functions if function.body_of(cls) is None]
    return [f"{function.__module__.rpartition('.')[2]}.{function.__name__}" for function in missing]
