"""Methods, by their names in configurations."""

from importlib import import_module
from pkgutil import iter_modules

from ringsweep.solvers.event import Auto, Event, Implicit
from ringsweep.solvers.method import Method, Result
from ringsweep.solvers.rk4 import RK4

__all__ = ["METHODS", "Method", "Result", "add_method"]

METHODS: dict[str, type[Method]] = {}


def add_method(method: type[Method]) -> None:
    """Register a method under its name.

    Raises
    ------
    TypeError
        If the name is taken.
    """
    if METHODS.setdefault(method.name, method) is not method:
        raise TypeError(f"there is a method {method.name} already: choose another name")


for _method in (Auto, RK4, Event, Implicit):
    add_method(_method)

# A file that is put into this folder registers what it holds.
for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
