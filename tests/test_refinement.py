"""Decisions of a refined map, on label maps whose truth is known."""

import numpy as np
import pytest

from ringsweep.quantities.variables import AUDITED, COMPUTED, INFERRED
from ringsweep.runs.decisions import largest_number, refine

SIZE = 257


def refined(truth, certain=None, stride=32, audit=0.02, **options):
    """Refine a map of labels; returns the result and the number of cells of each round."""
    truth = np.asarray(truth)
    shape = truth.shape if truth.ndim == 3 else (1, *truth.shape)
    labels = truth.ravel() if certain is None else np.where(np.ravel(certain), truth.ravel(), ~truth.ravel())
    asked = []

    def run(cells):
        asked.append(cells)
        return labels[cells]

    found = refine(shape, stride, audit, run, **options)
    cells = np.concatenate(asked)
    assert len(np.unique(cells)) == len(cells), "a cell is asked for twice"
    np.testing.assert_array_equal(np.sort(cells), np.flatnonzero(found.origin != INFERRED))
    return found, [len(cells) for cells in asked]


def wrong(found, truth):
    """Cells whose label is wrong."""
    return found.labels.reshape(np.shape(truth)) != truth


def plane(size=SIZE):
    """Coordinates from 0 to 1 of the cells of a map."""
    return np.meshgrid(np.linspace(0, 1, size), np.linspace(0, 1, size), indexing="ij")


def tongues(random):
    """Tongues thinner than a coarse block, which begin at an edge."""
    y, x = plane()
    labels = (x + 0.3 * np.sin(4 * y) > 0.9).astype(int)
    for _ in range(3):
        centre, slope, width = random.uniform(0.2, 0.8), random.uniform(-0.4, 0.4), random.uniform(0.004, 0.02)
        labels[(np.abs(y - centre - slope * x) < width * (1 - x)) & (x < random.uniform(0.4, 1.0))] = 2
    return labels


def islands(random):
    """Islands smaller than a coarse block."""
    y, x = plane()
    labels = np.zeros((SIZE, SIZE), dtype=int)
    for _ in range(random.integers(1, 12)):
        across, up = random.uniform(0.003, 0.05, 2)
        centre = random.uniform(0, 1, 2)
        labels[((x - centre[0]) / across) ** 2 + ((y - centre[1]) / up) ** 2 < 1] = random.integers(1, 4)
    return labels


def stripes(random):
    """Stripes, some narrower than a coarse block."""
    y, x = plane()
    angle, waves = random.uniform(0, np.pi), random.uniform(2, 40)
    return (np.sin(2 * np.pi * waves * (x * np.cos(angle) + y * np.sin(angle))) > random.uniform(-0.9, 0.99)).astype(
        int
    )


def fractal(random):
    """Basins of attraction of Newton's method, and dust in a corner."""
    y, x = plane()
    z = (x - random.uniform(0, 1)) * 3 + 1j * (y - random.uniform(0, 1)) * 3 + 1e-9
    for _ in range(25):
        z = z - (z**3 - 1) / (3 * z**2 + 1e-30)
    labels = np.argmin(np.abs(z[..., None] - np.exp(2j * np.pi * np.arange(3) / 3)), axis=-1)
    corner = (x > 0.85) & (y < 0.15)
    return np.where(corner & (random.random(x.shape) < random.uniform(0, 0.1)), 3, labels)


class TestBoundaries:
    @pytest.mark.parametrize("shape", [(1, 1), (2, 3), (5, 1), (33, 64), (100, 37), (129, 130)])
    @pytest.mark.parametrize("stride", [1, 2, 7, 32])
    def test_map_of_any_size_is_right_if_a_smooth_boundary_divides_it(self, shape, stride):
        rows, columns = np.indices(shape)
        truth = (rows + 1.7 * columns > 0.8 * max(shape)).astype(int)
        found, _ = refined(truth, stride=stride, audit=0.0)
        assert not wrong(found, truth).any()

    def test_every_boundary_lies_between_two_computed_cells(self):
        truth = islands(np.random.default_rng(4)) + tongues(np.random.default_rng(5))
        found, _ = refined(truth)
        labels, computed = found.labels[0], found.origin[0] != INFERRED
        for low, high in (((slice(None, -1),), (slice(1, None),)), ((..., slice(None, -1)), (..., slice(1, None)))):
            differ = labels[low] != labels[high]
            assert differ.any()
            assert computed[low][differ].all()
            assert computed[high][differ].all()

    def test_boundary_leaving_a_block_by_an_edge_with_equal_ends_is_followed(self):
        truth = np.zeros((129, 129), dtype=int)
        truth[40:70, 20:50] = 1
        truth[45:55, 20:120] = truth[35:125, 67:90] = 1
        found, _ = refined(truth, audit=0.0)
        assert not wrong(found, truth).any()

    def test_cost_grows_with_the_side_and_not_with_the_area(self):
        counts = []
        for size in (256, 512, 1024):
            y, x = plane(size)
            _, asked = refined((x**2 + y**2 > 0.5).astype(int), audit=0.0)
            counts.append(sum(asked))
        # The coarse lattice grows with the area, by a thousandth of it.
        assert counts[2] < 2.4 * counts[1] < 2.4**2 * counts[0]
        assert counts[2] < 0.02 * 1024**2

    def test_strip_narrower_than_two_cells_is_followed_without_an_audit(self):
        y, x = plane()
        for width, waves, height in ((0.002, 0.5, 0.3), (0.002, 9.0, 0.05), (0.004, 5.0, 0.45)):
            truth = (np.abs(y - 0.5 - height * np.sin(waves * x)) < width).astype(int)
            assert not wrong(refined(truth, audit=0.0)[0], truth).any()

    def test_all_around_a_cell_that_is_not_certain_is_computed(self):
        truth, certain = np.zeros((65, 65), dtype=int), np.ones((65, 65), dtype=bool)
        certain[32, 20:45] = False
        found, _ = refined(truth, certain, audit=0.0)
        assert (found.origin[0, 31:34, 20:45] == COMPUTED).all()
        assert (found.labels == 0).all()
        assert (found.origin == INFERRED).mean() > 0.9

    def test_maps_of_a_stack_do_not_touch_each_other(self):
        stack = np.stack([tongues(np.random.default_rng(k)) for k in range(3)])
        found, _ = refined(stack, audit=0.0)
        for k in range(3):
            alone, _ = refined(stack[k], audit=0.0)
            for name in ("labels", "origin", "level"):
                np.testing.assert_array_equal(getattr(found, name)[k], getattr(alone, name)[0])


class TestAudit:
    def test_sample_is_the_share_asked_for_and_seeded(self):
        truth = islands(np.random.default_rng(1))
        found, again = refined(truth)[0], refined(truth)[0]
        other = refined(truth, seed=1)[0]
        before = (refined(truth, audit=0.0)[0].origin == INFERRED).sum()
        assert found.audit.cells == (found.origin == AUDITED).sum() == np.ceil(0.02 * before)
        np.testing.assert_array_equal(found.origin, again.origin)
        assert (found.origin != other.origin).any()

    def test_island_that_the_audit_meets_is_followed_to_its_shore(self):
        truth = np.zeros((SIZE, SIZE), dtype=int)
        truth[100:120, 130:150] = 1
        found, _ = refined(truth)
        assert found.audit.wrong > 0
        assert found.audit.corrected == 400
        assert not wrong(found, truth).any()

    def test_audit_of_every_cell_leaves_nothing_inferred(self):
        truth = fractal(np.random.default_rng(3))
        found, _ = refined(truth, audit=1.0)
        assert not (found.origin == INFERRED).any()
        assert found.audit.bound == 0.0
        assert not wrong(found, truth).any()

    @pytest.mark.parametrize("period", [2, 31, 33])
    def test_bound_is_a_share_even_if_most_cells_were_found_wrong(self, period):
        stripes = (np.arange(SIZE) % period == 1)[:, None] & np.ones(SIZE, dtype=bool)
        for seed in range(5):
            found, _ = refined(stripes.astype(int), audit=0.1, seed=seed)
            assert 0.0 <= found.audit.bound <= 1.0

    def test_bound_is_exact_in_small_cases(self):
        # With nine wrong cells of ten, one that is drawn is right with a probability of 10 %.
        assert largest_number(10, 1, 0) == 9
        assert largest_number(10, 10, 3) == 3
        # Ten of twenty miss three wrong cells with a probability of 10.5 %, and four with 4.3 %.
        assert largest_number(20, 10, 0) == 3

    @pytest.mark.slow
    @pytest.mark.parametrize("kind", [tongues, islands, stripes, fractal])
    def test_stated_bound_covers_the_truth(self, kind):
        """Fifty maps of each kind; at a confidence of 95 % less than one in a hundred trials has 44 or fewer."""
        held = missed = 0
        for seed in range(50):
            truth = kind(np.random.default_rng(seed))
            found, _ = refined(truth, seed=seed)
            inferred = (found.origin == INFERRED).sum()
            share = wrong(found, truth).sum() / max(inferred, 1)
            held += share <= found.audit.bound
            missed += share > 0
        assert held >= 47
        # Maps on which nothing is missed would show nothing.
        if kind is not stripes:
            assert missed >= 5
