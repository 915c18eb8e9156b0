"""Friction coefficients that depend on the direction in which the body slides."""

from __future__ import annotations

from typing import NamedTuple

from ringsweep.compile import feature
from ringsweep.numerics.functions import select
from ringsweep.quantities.parameters import Leaf


class TwoWay(NamedTuple):
    """Friction coefficient of a body that slides forwards, and of one that slides backwards, 1."""

    forward: Leaf
    backward: Leaf


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
