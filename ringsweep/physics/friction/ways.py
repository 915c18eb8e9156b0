"""Friction coefficients that depend on the direction in which the body slides."""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.compile import feature, function_from_lines, specialise, unrolled
from ringsweep.numerics.functions import select


class TwoWay(NamedTuple):
    """Friction coefficient of a body that slides forwards, and of one that slides backwards, 1.

    On a surface with zones each of them is that of all segments.
    """

    forward: Any
    backward: Any


@feature("mu", of=TwoWay, absorb=True)
def along(mu, way):
    """Friction coefficient in a direction; for floats and Lanes.

    Parameters
    ----------
    mu : float or TwoWay
    way : float or Lanes
        Positive if the body slides forwards, or is pulled forwards; negative backwards; 0 for the larger coefficient.
    """
    either = max(mu.forward, mu.backward)
    return select(way > 0.0, mu.forward, select(way < 0.0, mu.backward, either))


@unrolled
def facing(count, coefficients, way):
    """Friction coefficients, a tuple, in a direction; see :func:`along`."""
    return ["return (" + "".join(f"along(coefficients[{i}], way), " for i in range(count)) + ")"]


#: Laws whose formula has the direction of sliding.
SIGNED: set[Any] = set()


def _towards_by_law(law: Any, count: int) -> Any:
    """Body of :func:`towards` for a type of law and a number of coefficients."""
    found = "".join(f"along(coefficients[{i}], way), " for i in range(count))
    direction = "along(TwoWay(1.0, -1.0), way), " if law in SIGNED else ""
    return function_from_lines("law, coefficients, way", [f"return ({found}{direction})"], globals())


def towards(law, coefficients, way):
    """What a law takes of the surfaces of a body that slides in a direction; for floats and Lanes.

    Parameters
    ----------
    law : NamedTuple
    coefficients : tuple of float or TwoWay
        Static and kinetic coefficient under each contact, 1.
    way : float or Lanes
        As for :func:`along`.

    Returns
    -------
    tuple of float or Lanes
        The coefficients; behind them the direction, 1 or -1, if the formula of the law has it.
    """
    return _towards_by_law(type(law), len(coefficients))(law, coefficients, way)


specialise(towards, lambda law, coefficients, way: _towards_by_law(law.instance_class, len(coefficients)))
