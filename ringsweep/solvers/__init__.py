"""Methods by the name that the configuration gives them."""

from ringsweep.solvers.event import Auto, Event, Implicit
from ringsweep.solvers.method import Method
from ringsweep.solvers.rk4 import RK4

METHODS: dict[str, type[Method]] = {method.name: method for method in (Auto, RK4, Event, Implicit)}
