"""Surfaces: friction coefficients as a function of the place on the ring.

A surface is either uniform, or divided into segments by the edges of its zones. Angles are in the frame of the
ring, in which the zones are fixed.

`edges` are ascending angles, rad. A *place* is a segment and the number of whole turns to its lower edge, so that a
contact on an edge is on one side of it, and rounding does not take it across. Models call these functions at events;
``rk4`` calls :func:`roughness` in each stage.
"""

from __future__ import annotations

import math
from math import pi
from typing import Annotated, Any, NamedTuple

import numpy as np
from numba import types

from ringsweep.compile import feature, function_from_lines, inlined, specialise
from ringsweep.numerics.functions import floor, nearest, select
from ringsweep.quantities.parameters import Leaf, Parameter

HALF_ANGLE = Parameter("rad", "half-angle of the zone", lower=0.0, upper=pi)
CENTER = Parameter("rad", "centre of the zone in the ring's frame", lower=-2 * pi, upper=2 * pi, default=0.0)

#: Turns in a radian.
PER_TURN = 0.5 / pi

# Two zones that touch, or the ends of a zone of a full turn, may leave a segment of this width by rounding, rad. With
# coefficients of its own it could jam or lift a body at an edge that does not exist.
_NEGLIGIBLE_WIDTH = 1e-14


class Uniform(NamedTuple):
    """Ring with the same friction coefficients everywhere."""

    mu_s: float
    mu_k: float


class Segments(NamedTuple):
    """Ring that is divided into segments. Segment j is from edge j to edge j + 1; the last one ends at edge 0.

    The first four fields have one value for each segment: for one cell arrays of shape ``(segments,)``, in vector lanes
    tuples.

    Attributes
    ----------
    edges : ndarray or tuple
        Lower edges of the segments in ascending order, rad, from 0 to less than 2 pi.
    mu_s, mu_k : ndarray or tuple
        Static and kinetic friction coefficient, 1.
    arc : ndarray or tuple
        Number of the zone, counted from 1; 0 outside the zones.
    roughest : tuple of float
        Largest static and least kinetic coefficient, 1.
    narrowest : float
        Width of the narrowest segment, rad.
    """

    edges: Any
    mu_s: Any
    mu_k: Any
    arc: Any
    roughest: tuple[Leaf, Leaf]
    narrowest: Leaf


class Arc(NamedTuple):
    """Zone as in the configuration: centre and half-angle, rad; friction coefficients, 1."""

    center: Annotated[Any, CENTER]
    half_angle: Annotated[Any, HALF_ANGLE]
    mu_s: Any
    mu_k: Any


def surface_of(arcs: list[Arc], mu_s: Any, mu_k: Any) -> Uniform | Segments:
    """Surface of a ring with zones. Where zones overlap, the later one in the list holds.

    Parameters
    ----------
    arcs : list of Arc
        Zones. Each field is a float or an array of shape ``(cells,)``.
    mu_s, mu_k : float or ndarray of shape ``(cells,)``
        Static and kinetic friction coefficient outside the zones, 1.

    Returns
    -------
    Uniform or Segments
        Arrays of shape ``(cells,)`` and ``(cells, segments)``; each zone gives two segments.
    """
    if not arcs:
        return Uniform(mu_s, mu_k)
    circle = 2.0 * np.pi
    ends = [np.asarray(a.center + side * a.half_angle, dtype=float) for a in arcs for side in (-1, 1)]
    edges = np.stack(np.broadcast_arrays(*ends), axis=-1) % circle
    edges = np.sort(np.where(edges >= circle, 0.0, edges), axis=-1)
    width = np.diff(edges, axis=-1, append=edges[..., :1] + circle)
    middle = edges + 0.5 * width
    static = np.broadcast_to(np.asarray(mu_s, dtype=float)[..., None], middle.shape)
    kinetic = np.broadcast_to(np.asarray(mu_k, dtype=float)[..., None], middle.shape)
    index = np.zeros(middle.shape)
    for k, arc in enumerate(arcs, start=1):
        center, half_angle, rough_s, rough_k = (np.asarray(x, dtype=float)[..., None] for x in arc)
        distance = np.abs((middle - center + np.pi) % circle - np.pi)
        inside = distance < half_angle
        static = np.where(inside, rough_s, static)
        kinetic = np.where(inside, rough_k, kinetic)
        index = np.where(inside, k, index)
    # A segment of negligible width takes the coefficients of the segment before it.
    number = np.where(width > _NEGLIGIBLE_WIDTH, np.arange(edges.shape[-1]), -1)
    number = np.maximum.accumulate(number, axis=-1)
    number = np.where(number < 0, number[..., -1:], number)
    static, kinetic, index = (np.take_along_axis(leaf, number, axis=-1) for leaf in (static, kinetic, index))
    narrowest = np.where(width > _NEGLIGIBLE_WIDTH, width, circle).min(axis=-1)
    return Segments(edges, static, kinetic, index, (static.max(axis=-1), kinetic.min(axis=-1)), narrowest)


# The defaults are those of a uniform surface.


@feature("surface.mu_s, surface.mu_k, 0.0", of=Segments)
def coefficients(surface, segment):
    """Friction coefficients and zone of a segment.

    Parameters
    ----------
    surface : Uniform or Segments
    segment : int

    Returns
    -------
    tuple of float
        Static and kinetic coefficient, 1; number of the zone, 0 for none.
    """
    return surface.mu_s[segment], surface.mu_k[segment], surface.arc[segment]


def value_at(values, edges, x):
    """Value at the place `x` of a quantity that is constant in each segment.

    Exactly on an edge, rounding decides which of the two segments holds.

    Parameters
    ----------
    values : ndarray or tuple
        Value in each segment.
    edges : ndarray or tuple
        Lower edges of the segments, rad.
    x : float or Lanes
        Place, from 0 to 1 turn.
    """
    # The last segment extends across 0 to the first edge.
    found = values[len(values) - 1]
    for j in range(len(edges) - 1):
        middle, half = 0.5 * PER_TURN * (edges[j + 1] + edges[j]), 0.5 * PER_TURN * (edges[j + 1] - edges[j])
        found = values[j] if abs(x - middle) < half else found
    return found


def _value_at_for_kernels(values: Any, edges: Any, x: Any) -> Any:
    """Code of :func:`value_at` for kernels: without a loop where the segments are tuples."""
    if isinstance(values, types.Array):
        return value_at
    lines = [f"found = values[{len(values) - 1}]"]
    for j in range(len(values) - 1):
        lines.append(f"middle, half = (edges[{j + 1}] + edges[{j}]) * scale, (edges[{j + 1}] - edges[{j}]) * scale")
        lines.append(f"found = select(abs(x - middle) < half, values[{j}], found)")
    return function_from_lines(
        "values, edges, x", [*lines, "return found"], {"select": select, "scale": 0.5 * PER_TURN}
    )


specialise(value_at, _value_at_for_kernels)


@feature("surface.mu_s, surface.mu_k", of=Segments, absorb=True)
def roughness(surface, turns, shift):
    """Static and kinetic friction coefficient at a place, for floats and Lanes.

    Parameters
    ----------
    surface : Uniform or Segments
    turns, shift : float or Lanes
        The place is their sum, in turns; any number of turns. What does not change in a run is best in `shift`.
    """
    return _roughness_of_segments(surface, turns, shift)


def _roughness_of_segments(surface, turns, shift):
    """Both coefficients where the place is `turns` + `shift`, in turns of the ring."""
    x = turns + shift
    x = x - floor(x)
    return value_at(surface.mu_s, surface.edges, x), value_at(surface.mu_k, surface.edges, x)


def _roughness_of_two_segments(surface, turns, shift):
    """As :func:`_roughness_of_segments`, for one zone: the distance from its middle decides."""
    (low, high), (s_1, s_2), (k_1, k_2) = surface.edges, surface.mu_s, surface.mu_k
    from_middle = turns + (shift - 0.5 * PER_TURN * (low + high))
    inside = abs(from_middle - nearest(from_middle)) < 0.5 * PER_TURN * (high - low)
    return select(inside, s_1, s_2), select(inside, k_1, k_2)


def _choose_roughness(surface: Any, turns: Any, shift: Any) -> Any:
    """Function that finds both coefficients for the type of a surface."""
    edges = surface[0]
    two = isinstance(edges, types.BaseTuple) and len(edges) == 2
    return _roughness_of_two_segments if two else _roughness_of_segments


specialise(_roughness_of_segments, _choose_roughness, absorb=True)


@feature("surface.mu_s, surface.mu_k", of=Segments)
def roughest(surface):
    """Largest static and least kinetic friction coefficient of the surface, 1."""
    return surface.roughest


@feature("2.0 * pi", of=Segments)
def narrowest(surface):
    """Width of the narrowest segment of the surface, rad."""
    return surface.narrowest


@feature("0, 0", of=Segments)
def locate(surface, angle):
    """Place of a contact at `angle`, rad: segment, and number of whole revolutions to the lower edge of the segment."""
    revolution = math.floor(angle / (2.0 * pi))
    x = angle - 2.0 * pi * revolution
    found = -1
    for j in range(len(surface.edges)):
        if surface.edges[j] <= x:
            found = j
    if found < 0:
        return len(surface.edges) - 1, revolution - 1
    return found, revolution


@feature("direction * inf", of=Segments)
def edge_ahead(surface, place, direction):
    """Angle of the next edge of a contact, rad; infinite on a uniform surface.

    Parameters
    ----------
    surface : Uniform or Segments
    place : tuple of int
        Segment and revolution of the contact, see :func:`locate`.
    direction : int
        Direction of motion, +1 or -1.
    """
    j, revolution = place
    if direction > 0:
        j += 1
        if j == len(surface.edges):
            j, revolution = 0, revolution + 1
    return surface.edges[j] + 2.0 * pi * revolution


@feature("place", of=Segments)
def cross_edge(surface, place, direction):
    """Place of a contact after it has crossed the edge ahead; arguments as for :func:`edge_ahead`."""
    j, revolution = place
    last = len(surface.edges) - 1
    while True:
        j += direction
        if j > last:
            j, revolution = 0, revolution + 1
        elif j < 0:
            j, revolution = last, revolution - 1
        end = surface.edges[j + 1] if j < last else surface.edges[0] + 2.0 * pi
        # Edges at one place are crossed at once.
        if end - surface.edges[j] > _NEGLIGIBLE_WIDTH:
            return j, revolution


# A contact this close to an edge is on the edge, rad.
_ON_EDGE = 1e-13


@inlined
def leave_edge(surface, place, angle, direction):
    """Place of a contact that starts to move: if it is on the edge ahead, its place after the edge.

    Parameters
    ----------
    surface : Uniform or Segments
    place : tuple of int
        Segment and revolution of the contact, see :func:`locate`.
    angle : float
        Angle of the contact, rad.
    direction : int
        Direction of motion, +1 or -1.
    """
    away = direction * (edge_ahead(surface, place, direction) - angle)
    return cross_edge(surface, place, direction) if away <= _ON_EDGE else place
