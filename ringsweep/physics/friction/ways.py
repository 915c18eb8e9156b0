"""Friction coefficients that depend on the direction in which the body slides."""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.compile import feature, unrolled
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
