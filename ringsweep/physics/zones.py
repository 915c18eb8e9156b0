"""Surfaces: which friction coefficients a contact meets, as a function of its place on the ring.

A surface is either uniform or cut into segments by the edges of its rough arcs. Angles are in
the ring's frame, where an arc stands still.
"""

from __future__ import annotations

import math
from math import inf, pi
from typing import Annotated, Any, NamedTuple

import numpy as np
from numba import types

from ringsweep.compile import hook, inlined, specialise, written
from ringsweep.numerics.functions import floor, select
from ringsweep.quantities.parameters import Leaf, Parameter

HALF_ANGLE = Parameter("rad", "half-angle of the rough zone", lower=0.0, upper=pi)
CENTER = Parameter("rad", "centre of the rough zone in the ring's frame", lower=-2 * pi, upper=2 * pi, default=0.0)

#: Turns in a radian.
PER_TURN = 0.5 / pi


# What rounding leaves between two ends that meet, such as those of an arc that goes all round: as a surface of its own
# it could jam a body, or lift it, at an edge that is not there.
_SLIVER = 1e-14


class Uniform(NamedTuple):
    """A ring with one pair of friction coefficients all round."""

    mu_s: float
    mu_k: float


class Segments(NamedTuple):
    """A ring cut at ``edges`` (ascending, in [0, 2 pi)); segment j runs from edge j to edge j + 1.

    ``arc`` is 0 where no rough arc lies and k on the k-th of them; ``roughest`` is the largest static and the least
    kinetic coefficient, ``narrowest`` the width of the narrowest segment, rad. In memory a cell's segments are a row of
    an array; where cells stand side by side, in :mod:`ringsweep.numerics.lanes`, they are a tuple.
    """

    edges: Any
    mu_s: Any
    mu_k: Any
    arc: Any
    roughest: tuple[Leaf, Leaf]
    narrowest: Leaf


class Arc(NamedTuple):
    """A rough arc as the configuration gives it."""

    center: Annotated[Any, CENTER]
    half_angle: Annotated[Any, HALF_ANGLE]
    mu_s: Any
    mu_k: Any


@inlined
def wrap(x):
    """Angle reduced to [0, 2 pi): the paper's psi (Eq. 28)."""
    y = x - 2.0 * pi * floor(x * (0.5 / pi))
    return select(y < 2.0 * pi, y, 0.0)


def cut(arcs: list[Arc], mu_s: Any, mu_k: Any) -> Uniform | Segments:
    """Lay rough arcs on a ring whose rest has `mu_s`, `mu_k`; where arcs overlap the later one holds.

    Parameters
    ----------
    arcs : list of Arc
        Rough arcs; each field a float or an array of shape ``(cells,)``, angles in rad.
    mu_s, mu_k : float or ndarray of shape ``(cells,)``
        Coefficients outside the arcs.

    Returns
    -------
    Uniform or Segments
        Leaves of shape ``(cells,)`` and ``(cells, segments)`` with two segments to an arc.
    """
    if not arcs:
        return Uniform(mu_s, mu_k)
    turn = 2.0 * np.pi
    ends = [np.asarray(a.center + side * a.half_angle, dtype=float) for a in arcs for side in (-1, 1)]
    edges = np.stack(np.broadcast_arrays(*ends), axis=-1) % turn
    edges = np.sort(np.where(edges >= turn, 0.0, edges), axis=-1)
    width = np.diff(edges, axis=-1, append=edges[..., :1] + turn)
    middle = edges + 0.5 * width
    static = np.broadcast_to(np.asarray(mu_s, dtype=float)[..., None], middle.shape)
    kinetic = np.broadcast_to(np.asarray(mu_k, dtype=float)[..., None], middle.shape)
    index = np.zeros(middle.shape)
    for k, arc in enumerate(arcs, start=1):
        center, half_angle, rough_s, rough_k = (np.asarray(x, dtype=float)[..., None] for x in arc)
        distance = np.abs((middle - center + np.pi) % turn - np.pi)
        inside = distance < half_angle
        static = np.where(inside, rough_s, static)
        kinetic = np.where(inside, rough_k, kinetic)
        index = np.where(inside, k, index)
    # A sliver takes after the segment before it.
    number = np.where(width > _SLIVER, np.arange(edges.shape[-1]), -1)
    number = np.maximum.accumulate(number, axis=-1)
    number = np.where(number < 0, number[..., -1:], number)
    static, kinetic, index = (np.take_along_axis(leaf, number, axis=-1) for leaf in (static, kinetic, index))
    narrowest = np.where(width > _SLIVER, width, turn).min(axis=-1)
    return Segments(edges, static, kinetic, index, (static.max(axis=-1), kinetic.min(axis=-1)), narrowest)


@hook
def segment(surface, angle):
    """Index of the segment that holds `angle` (rad, in the ring's frame, any number of turns)."""


@segment.implements(Uniform)
def _no_segment(surface, angle):
    return 0


@segment.implements(Segments)
def _segment(surface, angle):
    x = wrap(angle)
    # Below the first edge lies the last segment, which closes the ring.
    found = len(surface.edges) - 1
    for j in range(len(surface.edges)):
        if surface.edges[j] <= x:
            found = j
    return found


@hook
def coefficients(surface, segment):
    """Static and kinetic coefficient of a segment, and the rough arc that it lies on (0: none)."""


@coefficients.implements(Uniform)
def _uniform(surface, segment):
    return surface.mu_s, surface.mu_k, 0.0


@coefficients.implements(Segments)
def _segments(surface, segment):
    return surface.mu_s[segment], surface.mu_k[segment], surface.arc[segment]


def under(values, edges, x):
    """The value at `x`, in turns from 0 to 1, of those that hold in the segments which begin at `edges` (rad).

    On an edge itself the answer may go either way: it is ``abs(x - middle) < half`` that decides, rounded.
    """
    # Below the first edge lies the last segment, which closes the ring.
    found = values[len(values) - 1]
    for j in range(len(edges) - 1):
        middle, half = 0.5 * PER_TURN * (edges[j + 1] + edges[j]), 0.5 * PER_TURN * (edges[j + 1] - edges[j])
        found = values[j] if abs(x - middle) < half else found
    return found


def _unrolled_under(values: Any, edges: Any, x: Any) -> Any:
    if isinstance(values, types.Array):
        return under
    lines = [f"found = values[{len(values) - 1}]"]
    for j in range(len(values) - 1):
        lines.append(f"middle, half = (edges[{j + 1}] + edges[{j}]) * scale, (edges[{j + 1}] - edges[{j}]) * scale")
        lines.append(f"found = select(abs(x - middle) < half, values[{j}], found)")
    return written("values, edges, x", [*lines, "return found"], {"select": select, "scale": 0.5 * PER_TURN})


specialise(under, _unrolled_under)


@hook(absorb=True)
def roughness(surface, turns):
    """Static and kinetic coefficient under a contact at an angle in the ring's frame, in turns."""


@roughness.implements(Uniform)
def _uniform_roughness(surface, turns):
    return surface.mu_s, surface.mu_k


@roughness.implements(Segments)
def _segments_roughness(surface, turns):
    x = turns - floor(turns)
    return under(surface.mu_s, surface.edges, x), under(surface.mu_k, surface.edges, x)


@hook
def roughest(surface):
    """Largest static coefficient of the surface, and the least kinetic one: the steepest fall of friction."""


@roughest.implements(Uniform)
def _uniform_roughest(surface):
    return surface.mu_s, surface.mu_k


@roughest.implements(Segments)
def _segments_roughest(surface):
    return surface.roughest


@hook
def narrowest(surface):
    """Width of the narrowest segment of the surface, rad."""


@narrowest.implements(Uniform)
def _uniform_narrowest(surface):
    return 2.0 * pi


@narrowest.implements(Segments)
def _segments_narrowest(surface):
    return surface.narrowest


@hook
def locate(surface, angle):
    """Segment that holds `angle` and the number of whole turns to its lower edge."""


@locate.implements(Uniform)
def _nowhere(surface, angle):
    return 0, 0


@locate.implements(Segments)
def _locate(surface, angle):
    turn = math.floor(angle / (2.0 * pi))
    x = angle - 2.0 * pi * turn
    found = -1
    for j in range(len(surface.edges)):
        if surface.edges[j] <= x:
            found = j
    if found < 0:
        return len(surface.edges) - 1, turn - 1
    return found, turn


@hook
def edge_ahead(surface, place, direction):
    """Angle of the edge that a contact at `place` = (segment, turn) meets in `direction` (+1, -1), rad."""


@edge_ahead.implements(Uniform)
def _no_edge(surface, place, direction):
    return direction * inf


@edge_ahead.implements(Segments)
def _edge_ahead(surface, place, direction):
    j, turn = place
    if direction > 0:
        j += 1
        if j == len(surface.edges):
            j, turn = 0, turn + 1
    return surface.edges[j] + 2.0 * pi * turn


@hook
def cross(surface, place, direction):
    """Place of a contact after it has crossed the edge ahead of it."""


@cross.implements(Uniform)
def _cross_nothing(surface, place, direction):
    return place


@cross.implements(Segments)
def _cross(surface, place, direction):
    j, turn = place
    j += direction
    if j == len(surface.edges):
        return 0, turn + 1
    if j < 0:
        return len(surface.edges) - 1, turn - 1
    return j, turn


# A contact that is this near to an edge is on it, rad.
_ON_EDGE = 1e-13


@inlined
def beyond(surface, place, angle, direction):
    """Place of a contact that moves from `angle` (rad) in a direction (+1, -1): beyond the edge, if it is on one."""
    away = direction * (edge_ahead(surface, place, direction) - angle)
    return cross(surface, place, direction) if away <= _ON_EDGE else place
