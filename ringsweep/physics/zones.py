"""Surfaces: friction coefficients as a function of the place on the ring, or along the belt.

A surface is either uniform, or divided into segments by the edges of its zones. Angles are in the frame of the
ring, in which the zones are fixed. On a belt lengths (m) stand in place of angles (rad), and a period of the belt in
place of a turn.

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

from ringsweep.compile import absorbed, feature, function_from_lines, inlined, specialise
from ringsweep.numerics.functions import floor, nearest, select
from ringsweep.physics.friction.ways import TwoWay
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

    mu_s: Any
    mu_k: Any


class Ruler(NamedTuple):
    """Measures of a surface along a line, m.

    Attributes
    ----------
    period : float
        Length after which the zones repeat. Longer than any way of a body if they do not.
    unit : float
        Length in proportion to which another one is rounding.
    """

    period: Leaf
    unit: Leaf


class InSpace(NamedTuple):
    """Frame of zones that stand in space, and do not move with the belt."""


class Segments(NamedTuple):
    """Ring that is divided into segments. Segment j is from edge j to edge j + 1; the last one ends at edge 0.

    The first four fields have one value for each segment: for one cell arrays of shape ``(segments,)``, in vector lanes
    tuples.

    Attributes
    ----------
    edges : ndarray or tuple
        Lower edges of the segments in ascending order, rad, from 0 to less than 2 pi.
    mu_s, mu_k : ndarray, tuple or TwoWay
        Static and kinetic friction coefficient, 1.
    arc : ndarray or tuple
        Number of the zone, counted from 1; 0 outside the zones.
    roughest : tuple of float
        Largest static and least kinetic coefficient, 1.
    narrowest : float
        Width of the narrowest segment, rad.
    ruler : Ruler
        An empty tuple on a ring.
    frame : InSpace
        An empty tuple if the zones move with the ring or the belt.
    """

    edges: Any
    mu_s: Any
    mu_k: Any
    arc: Any
    roughest: tuple[Any, Any]
    narrowest: Leaf
    ruler: Any = ()
    frame: Any = ()


class Arc(NamedTuple):
    """Zone as in the configuration: centre and half-angle, rad; friction coefficients, 1."""

    center: Annotated[Any, CENTER]
    half_angle: Annotated[Any, HALF_ANGLE]
    mu_s: Any
    mu_k: Any


class Stretch(NamedTuple):
    """Zone on a belt, as :class:`Arc`: centre and half-length, m; friction coefficients, 1."""

    center: Annotated[Any, Parameter("m", "centre of the zone", default=0.0)]
    half_length: Annotated[Any, Parameter("m", "half-length of the zone", lower=0.0)]
    mu_s: Any
    mu_k: Any


# Ends of a surface that does not repeat, m.
_FAR = 1e300


def surface_of(arcs: Any, mu_s: Any, mu_k: Any, period: Any = 2.0 * pi) -> Uniform | Segments:
    """Surface of a ring or a belt with zones. Where zones overlap, the later one in the list holds.

    Parameters
    ----------
    arcs : list of Arc or Stretch
        Zones. Each field is a float or an array of shape ``(cells,)``.
    mu_s, mu_k : float or ndarray of shape ``(cells,)``
        Static and kinetic friction coefficient outside the zones, 1.
    period : float or ndarray of shape ``(cells,)``, optional
        Angle, or length of a belt, after which the zones repeat; None if they do not.

    Returns
    -------
    Uniform or Segments
        Arrays of shape ``(cells,)`` and ``(cells, segments)``; each zone gives two segments.
    """
    if not arcs:
        return Uniform(mu_s, mu_k)
    ends = [np.asarray(a.center + side * a[1], dtype=float) for a in arcs for side in (-1, 1)]
    edges = np.stack(np.broadcast_arrays(*ends), axis=-1)
    if period is None:
        unit = np.abs(edges).max(axis=-1)
        edges, circle = np.insert(edges, 0, -_FAR, axis=-1), np.full((*unit.shape, 1), 2.0 * _FAR)
    else:
        circle = np.broadcast_to(np.asarray(period, dtype=float)[..., None], (*edges.shape[:-1], 1))
        unit = circle[..., 0] * PER_TURN
        edges = edges % circle
        edges = np.where(edges >= circle, 0.0, edges)
    edges = np.sort(edges, axis=-1)
    width = np.diff(edges, axis=-1, append=edges[..., :1] + circle)
    middle = edges + 0.5 * width
    static = np.broadcast_to(np.asarray(mu_s, dtype=float)[..., None], middle.shape)
    kinetic = np.broadcast_to(np.asarray(mu_k, dtype=float)[..., None], middle.shape)
    index = np.zeros(middle.shape)
    for k, arc in enumerate(arcs, start=1):
        center, half_angle, rough_s, rough_k = (np.asarray(x, dtype=float)[..., None] for x in arc)
        offset = middle - center
        distance = offset if period is None else (offset + 0.5 * circle) % circle - 0.5 * circle
        inside = np.abs(distance) < half_angle
        static = np.where(inside, rough_s, static)
        kinetic = np.where(inside, rough_k, kinetic)
        index = np.where(inside, k, index)
    # A segment of negligible width takes the coefficients of the segment before it.
    counts = width > _NEGLIGIBLE_WIDTH * unit[..., None]
    number = np.where(counts, np.arange(edges.shape[-1]), -1)
    number = np.maximum.accumulate(number, axis=-1)
    number = np.where(number < 0, number[..., -1:], number)
    static, kinetic, index = (np.take_along_axis(leaf, number, axis=-1) for leaf in (static, kinetic, index))
    narrowest = np.where(counts, width, circle).min(axis=-1)
    roughest = static.max(axis=-1), kinetic.min(axis=-1)
    if not isinstance(arcs[0], Stretch):
        return Segments(edges, static, kinetic, index, roughest, narrowest)
    ruler, frame = Ruler(circle[..., 0].copy(), unit), InSpace() if period is None else ()
    return Segments(edges, static, kinetic, index, roughest, narrowest, ruler, frame)


def two_way(ahead: Any, back: Any) -> Any:
    """Surface of which `ahead` are the coefficients of a body that slides forwards, and `back` those of the other way.

    Both have the same segments.
    """
    of_ways: dict[str, Any] = {name: TwoWay(getattr(ahead, name), getattr(back, name)) for name in ("mu_s", "mu_k")}
    if isinstance(ahead, Segments):
        of_ways["roughest"] = tuple(map(TwoWay, ahead.roughest, back.roughest))
    return ahead._replace(**of_ways)


# The defaults are those of a uniform surface.


@feature("values[segment]", of=TwoWay)
def _in_segment(values, segment):
    """Coefficient in a segment."""
    return TwoWay(values.forward[segment], values.backward[segment])


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
    return _in_segment(surface.mu_s, segment), _in_segment(surface.mu_k, segment), surface.arc[segment]


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


def _is_two_way(values: Any) -> bool:
    """Whether coefficients depend on the direction, by their Numba type."""
    return getattr(values, "instance_class", None) is TwoWay


def _value_at_for_kernels(values: Any, edges: Any, x: Any) -> Any:
    """Code of :func:`value_at` for kernels: without a loop where the segments are tuples."""
    if _is_two_way(values):
        return lambda values, edges, x: TwoWay(value_at(values.forward, edges, x), value_at(values.backward, edges, x))
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
    two = isinstance(edges, types.BaseTuple) and len(edges) == 2 and not _is_two_way(surface[1])
    return _roughness_of_two_segments if two else _roughness_of_segments


specialise(_roughness_of_segments, _choose_roughness, absorb=True)


@absorbed
def roughness_along(surface, place):
    """Static and kinetic friction coefficient at a place on a belt, m, for floats and Lanes."""
    period, begin, _ = _measures(surface.ruler, surface.edges)
    x = place - period * floor((place - begin) / period)
    return _latest(surface.mu_s, surface.edges, x), _latest(surface.mu_k, surface.edges, x)


def _latest(values, edges, x):
    """The value that belongs to the last edge up to `x`, in m; before the first edge that of the last one."""
    found = values[len(values) - 1]
    for j in range(len(edges)):
        found = values[j] if edges[j] <= x else found
    return found


def _latest_for_kernels(values: Any, edges: Any, x: Any) -> Any:
    """Code of :func:`_latest` for kernels: without a loop where the segments are tuples."""
    if _is_two_way(values):
        return lambda values, edges, x: TwoWay(_latest(values.forward, edges, x), _latest(values.backward, edges, x))
    if isinstance(values, types.Array):
        return _latest
    lines = [f"found = select(edges[{j}] <= x, values[{j}], found)" for j in range(len(values))]
    return function_from_lines(
        "values, edges, x", [f"found = values[{len(values) - 1}]", *lines, "return found"], {"select": select}
    )


specialise(_latest, _latest_for_kernels, absorb=True)


@feature("surface.mu_s, surface.mu_k", of=Segments)
def roughest(surface):
    """Largest static and least kinetic friction coefficient of the surface, 1."""
    return surface.roughest


@feature("2.0 * pi", of=Segments)
def narrowest(surface):
    """Width of the narrowest segment of the surface, rad."""
    return surface.narrowest


@feature("2.0 * pi, 0.0, 1.0")
def _measures(ruler, edges):
    """Period of a surface, place at which it begins, and unit of its lengths: rad on a ring, m on a belt."""
    return ruler.period, edges[0], ruler.unit


@feature("0, 0", of=Segments)
def locate(surface, angle):
    """Place of a contact at `angle`, rad: segment, and number of whole revolutions to the lower edge of the segment."""
    circle, begin, _ = _measures(surface.ruler, surface.edges)
    revolution = math.floor((angle - begin) / circle)
    x = angle - circle * revolution
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
    return surface.edges[j] + _measures(surface.ruler, surface.edges)[0] * revolution


@feature("place", of=Segments)
def cross_edge(surface, place, direction):
    """Place of a contact after it has crossed the edge ahead; arguments as for :func:`edge_ahead`."""
    j, revolution = place
    last = len(surface.edges) - 1
    circle, _, unit = _measures(surface.ruler, surface.edges)
    while True:
        j += direction
        if j > last:
            j, revolution = 0, revolution + 1
        elif j < 0:
            j, revolution = last, revolution - 1
        end = surface.edges[j + 1] if j < last else surface.edges[0] + circle
        # Edges at one place are crossed at once.
        if end - surface.edges[j] > _NEGLIGIBLE_WIDTH * unit:
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


@feature("x - shift", absorb=True)
def place_in(frame, x, shift):
    """Place of a body in the frame of the zones of a belt, m; `x` in space, `shift` of the belt."""
    return x


@feature("False")
def carries(frame):
    """Whether a belt carries a body that sticks to it through the zones."""
    return True


# A body this close to an edge may be on it: units in the last place of the numbers whose difference the distance is,
# and share of the unit of length.
_ROUNDINGS, _ON_LINE = 2.0**-49, 1e-14


@inlined
def distance_to_edge(surface, place, direction, x, shift):
    """Distance of a body on a belt from the edge of its segment in a direction, m; 0 if it is but rounding."""
    edge = edge_ahead(surface, place, direction)
    found = direction * (edge - place_in(surface.frame, x, shift))
    rounding = _ROUNDINGS * (abs(x) + abs(shift)) + _ON_LINE * surface.ruler.unit
    return 0.0 if abs(found) <= rounding else found
