"""Order of the cells of a sweep, and division into tasks."""

import math
from threading import Event

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ringsweep.runs.task_sizes import TaskSizes, divide_into_tasks
from ringsweep.storage.chunks import CHUNK, Layout


class FinishedTask:
    """A task of some cells that took some seconds."""

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
        # Positions within a chunk follow the order of its array.
        if sizes:
            np.testing.assert_array_equal(np.transpose(indices), np.argwhere(here))
        seen[place] += 1
        assert end - begin == here.sum()
    assert after == layout.total
    assert (seen == 1).all()


@given(sizes=st.lists(st.integers(1, 300), min_size=1, max_size=5))
def test_chunk_is_not_larger_than_allowed_and_not_needlessly_small(sizes):
    chunk = Layout(sizes).chunk
    assert math.prod(chunk) <= CHUNK
    assert all(1 <= edge <= size for edge, size in zip(chunk, sizes, strict=True))
    if math.prod(sizes) > CHUNK:
        assert math.prod(chunk) > CHUNK / 4


class TestTaskSizes:
    @given(done=st.lists(st.booleans(), min_size=1, max_size=200), cost=st.floats(1e-5, 10.0))
    def test_tasks_contain_every_open_cell_once(self, done, cost):
        done = np.array(done)
        sizes = TaskSizes(1, lambda: 2)
        sizes.learn(FinishedTask(4, 4 * cost))
        found = list(divide_into_tasks(done, sizes, Event()))
        if not found:
            assert done.all()
            return
        np.testing.assert_array_equal(np.concatenate(found), np.flatnonzero(~done))
        assert all(len(task) for task in found)
        if cost > TaskSizes.max_seconds:
            assert {len(task) for task in found} == {1}
