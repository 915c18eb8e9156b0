"""The balances of a pivot: what follows from their declaration, against the equations of ``docs/physics.md``."""

import numpy as np
import pytest

from ringsweep.physics import pivot


@pytest.fixture(params=range(8))
def f(request):
    """A frame of a random body and motion."""
    rng = np.random.default_rng(request.param)
    mass, inertia, radius, reach = rng.uniform([0.05, 1e-5, 0.005, 0.03], [0.5, 1e-4, 0.02, 0.2])
    alpha, psi_dot, alpha_dot = rng.uniform(-3.0, 3.0, 3)
    u, w = rng.uniform(-0.03, 0.03, 2)
    return pivot.Frame(
        *(mass, inertia, 9.81, radius, reach, alpha, np.sin(alpha), np.cos(alpha), u, w),
        *(psi_dot, alpha_dot, psi_dot**2, alpha_dot**2),
    )


def by_hand(f, last_row, last):
    """Solution of the three balances and of one equation more, as linear equations."""
    matrix = [
        [-f.mass * f.w, 0.0, 1.0, 0.0],
        [f.mass * f.u, f.mass * f.reach, 0.0, -1.0],
        [f.inertia, 0.0, f.w, f.u - f.radius],
        last_row,
    ]
    across = f.mass * (f.gravity * f.cos_alpha + f.reach * f.alpha_dot**2 + f.u * f.psi_dot**2)
    along = f.mass * (f.w * f.psi_dot**2 - f.gravity * f.sin_alpha)
    return np.linalg.solve(matrix, [across, along, 0.0, last])


@pytest.mark.parametrize("K", [-0.4, 0.0, 0.3])
def test_solution_in_slip_is_that_of_the_equations(f, K):
    found = pivot.in_slip(f, K)
    np.testing.assert_allclose(found, by_hand(f, [0.0, 0.0, -K, 1.0], 0.0), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(pivot.imbalance(f, found), 0.0, atol=1e-12)
    assert pivot.determinant(f, K) == pytest.approx(f.inertia + f.mass * f.w * (f.w - K * (f.radius - f.u)), rel=1e-12)


def test_solution_in_stick_is_that_of_the_equations(f):
    found = pivot.in_stick(f, 0.7)
    np.testing.assert_allclose(found, by_hand(f, [f.radius, f.reach, 0.0, 0.0], 0.7), rtol=1e-9, atol=1e-12)
    assert pivot.sliding_acceleration(f, found, 0.7) == pytest.approx(0.0, abs=1e-10)


def test_imbalance_of_change_is_what_a_change_and_its_products_add(f):
    """The balances have products of two numbers, so that their change is exact with the products of the changes."""
    rng = np.random.default_rng(7)
    solution, added = pivot.in_slip(f, 0.3), tuple(rng.uniform(-1.0, 1.0, 4))
    change = tuple(rng.uniform(-0.1, 0.1, len(pivot.MOTION)))
    changed = f._replace(**{name: getattr(f, name) + d for name, d in zip(pivot.MOTION, change, strict=True)})
    left, right = pivot.left_factors(f, change, added), pivot.right_factors(f, change, added)
    found = pivot.imbalance_of_change(f, solution, change, tuple(np.multiply(left, right)))
    moved = np.add(solution, added)
    by_unknowns = np.subtract(pivot.imbalance(f, moved), pivot.imbalance(f, solution))
    np.testing.assert_allclose(found + by_unknowns, pivot.imbalance(changed, moved), atol=1e-12)
