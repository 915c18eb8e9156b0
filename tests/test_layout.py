"""Order of cells and size of tasks: every cell once, neighbours together."""

import math
from threading import Event

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ringsweep.runs.pace import Pace, tasks
from ringsweep.storage.chunks import CHUNK, Layout


class Took:
    """So many cells that took so many seconds."""

    def __init__(self, cells, seconds):
        self.positions, self.seconds = range(cells), seconds


SIZES = st.lists(st.integers(1, 9), min_size=0, max_size=4)


@given(sizes=SIZES, data=st.data())
def test_every_cell_has_one_position_and_lies_in_its_chunk(sizes, data):
    layout = Layout(sizes, [data.draw(st.integers(1, size)) for size in sizes])
    seen = np.zeros(sizes, dtype=int)
    after = 0
    for begin, end, place in layout.chunks():
        assert begin == after
        after = end
        indices = layout.indices(np.arange(begin, end))
        here = np.zeros(sizes, dtype=bool)
        here[place] = True
        assert here[indices].all()
        # In the order of the chunk's own array.
        if sizes:
            np.testing.assert_array_equal(np.transpose(indices), np.argwhere(here))
        seen[place] += 1
        assert end - begin == here.sum()
    assert after == layout.total
    assert (seen == 1).all()


@given(sizes=st.lists(st.integers(1, 300), min_size=1, max_size=5))
def test_a_chunk_is_small_and_no_smaller_than_needed(sizes):
    chunk = Layout(sizes).chunk
    assert math.prod(chunk) <= CHUNK
    assert all(1 <= edge <= size for edge, size in zip(chunk, sizes, strict=True))
    if math.prod(sizes) > CHUNK:
        assert math.prod(chunk) > CHUNK / 4


def test_a_map_of_a_sweep_over_five_axes_lies_in_few_chunks():
    layout = Layout([25] * 5)
    chunks = [place for _, _, place in layout.chunks()]
    passed = sum(all(place[dim].start <= 12 < place[dim].stop for dim in (1, 2, 4)) for place in chunks)
    assert passed * math.prod(layout.chunk) < 0.06 * layout.total


class TestPace:
    def test_a_task_takes_a_hundredth_of_the_time_before_within_bounds(self):
        pace = Pace(1, lambda: 2)
        assert pace.next(10**9) == 1
        pace.learn(Took(100, 0.1))
        assert pace.next(10**9) == 100
        pace.learn(Took(99_000, 99.0))
        assert pace.next(10**9) == pytest.approx(1000, rel=0.02)
        pace.learn(Took(10**6, 1e3))
        assert pace.next(10**9) == pytest.approx(2000, rel=0.02)

    def test_a_task_grows_no_faster_than_what_is_known_of_the_cost(self):
        pace = Pace(1, lambda: 2)
        pace.learn(Took(1, 1e-6))
        assert pace.next(10**9) == 8

    def test_runs_that_go_side_by_side_are_not_parted(self):
        pace = Pace(16, lambda: 2)
        assert pace.next(10**9) == 16
        pace.learn(Took(16, 100.0))
        assert pace.next(10**9) == 16
        pace.learn(Took(1600, 1.6))
        assert pace.next(10**9) % 16 == 0

    @given(done=st.lists(st.booleans(), min_size=1, max_size=200), cost=st.floats(1e-5, 10.0))
    def test_tasks_hold_every_open_cell_once_and_shrink_to_the_end(self, done, cost):
        done = np.array(done)
        pace = Pace(1, lambda: 2)
        pace.learn(Took(4, 4 * cost))
        found = list(tasks(done, int((~done).sum()), pace, Event()))
        if not found:
            assert done.all()
            return
        np.testing.assert_array_equal(np.concatenate(found), np.flatnonzero(~done))
        assert all(len(task) for task in found)
        if cost > Pace.longest:
            assert {len(task) for task in found} == {1}


@pytest.mark.parametrize("total", [1, 40_000])
def test_gaps_wider_than_a_task_are_passed_over(total):
    done = np.ones(total + 100_000, dtype=bool)
    done[-total:] = False
    pace = Pace(1, lambda: 1)
    pace.learn(Took(1000, 0.001))
    np.testing.assert_array_equal(
        np.concatenate(list(tasks(done, total, pace, Event()))), np.arange(100_000, 100_000 + total)
    )
