"""Surfaces: friction coefficients by zones, their edges and their order."""

from math import floor, nextafter, pi

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ringsweep.physics.zones import Arc, Uniform, coefficients, locate, roughest, surface_of

REST = (0.2, 0.1)

centers = st.floats(-2 * pi, 2 * pi)
half_angles = st.floats(0.0, pi)
angles = st.floats(-60.0, 60.0)
arcs = st.lists(st.tuples(centers, half_angles), min_size=1, max_size=4)


def psi(x):
    return x - 2 * pi * floor(x / (2 * pi))


def on(arc, angle):
    """Whether a contact at `angle` in the frame of the ring is on the zone, by the paper's half-open rule."""
    center, half_angle = arc
    return 0.0 <= psi(angle - center + half_angle) < 2 * half_angle


def clear_of_edges(arcs, angle):
    """Whether `angle` is farther from every edge than rounding."""
    return all(
        1e-9 < psi(angle - center - side * half_angle) < 2 * pi - 1e-9
        for center, half_angle in arcs
        for side in (-1, 1)
    )


def surface_with(arcs):
    """Surface on which zone number k, counted from 1, has mu_s = k and mu_k = k / 2."""
    return surface_of([Arc(*arc, float(k), 0.5 * k) for k, arc in enumerate(arcs, start=1)], *REST)


def found_at(surface, angle):
    return coefficients(surface, locate(surface, angle)[0])


class TestMembership:
    @given(arcs, angles)
    def test_last_arc_at_an_angle_gives_the_coefficients(self, arcs, angle):
        assume(clear_of_edges(arcs, angle))
        last = max((k for k, arc in enumerate(arcs, start=1) if on(arc, angle)), default=0)
        assert found_at(surface_with(arcs), angle) == ((float(last), 0.5 * last, last) if last else (*REST, 0))

    @given(angles)
    def test_ring_without_arcs_is_uniform(self, angle):
        surface = surface_of([], *REST)
        assert isinstance(surface, Uniform)
        assert found_at(surface, angle) == (*REST, 0.0)
        assert roughest(surface) == REST


class TestEdges:
    """Edges at binary fractions, which are free of rounding."""

    @pytest.mark.parametrize(
        ("angle", "arc"),
        [(nextafter(0.5, 0), 0), (0.5, 1), (nextafter(1.5, 0), 1), (1.5, 2), (nextafter(2.5, 0), 2), (2.5, 0)],
    )
    def test_edge_belongs_to_the_segment_after_it(self, angle, arc):
        assert found_at(surface_with([(1.0, 0.5), (2.0, 0.5)]), angle)[2] == arc

    @pytest.mark.parametrize(("angle", "arc"), [(0.0, 1), (nextafter(0.25, 0), 1), (0.25, 0), (-0.125, 1), (-0.5, 0)])
    def test_arc_across_angle_zero_is_one_arc(self, angle, arc):
        assert found_at(surface_with([(0.0, 0.25)]), angle)[2] == arc

    @pytest.mark.parametrize("x", [-1e-300, -1e-17, -0.0])
    def test_tiny_negative_angle_does_not_round_to_a_full_turn(self, x):
        assert found_at(surface_with([(1.0, 1.0)]), x)[2] in (0, 1)
