"""Record and outcome of two masses on a belt: those of a belt for each, and one word for both."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ringsweep.compile import function_from_lines, inlined
from ringsweep.models.belt.record import Outcome
from ringsweep.models.interface import recorder
from ringsweep.numerics.terms import joined
from ringsweep.physics.pair import BeltPair
from ringsweep.quantities.flags import FAILED, OSCILLATORY, RIDING, SLIDING, STICK_SLIP, STICKING

#: Outcomes of each mass.
OF_EACH = tuple(name for name in Outcome._fields if name not in ("regime", "t_end", "settled"))

#: Words for a mass, from the calmest to that which decides the regime of both.
_ORDER = RIDING, STICKING, SLIDING, OSCILLATORY, STICK_SLIP, FAILED

_RANK = np.zeros(1 + max(_ORDER))
_RANK[list(_ORDER)] = np.arange(len(_ORDER))

_of_each = inlined(function_from_lines("o", [f"return ({', '.join(f'o.{name}' for name in OF_EACH)})"], {}))


class Record(NamedTuple):
    """Records of both masses, each that of a belt."""

    first: Any
    second: Any


@recorder.begin.implements(BeltPair)
def _begin_record_of_pair(scene, t, seen):
    """Implement :func:`recorder.begin`."""
    return Record(recorder.begin(scene.first, t, seen[0]), recorder.begin(scene.second, t, seen[1]))


@recorder.observe.implements(BeltPair)
def _observe_of_pair(scene, record, t, duration, stuck, seen):
    """Implement :func:`recorder.observe`; `seen` tells which mass sticks."""
    return Record(
        recorder.observe(scene.first, record.first, t, duration, seen[2][0], seen[0]),
        recorder.observe(scene.second, record.second, t, duration, seen[2][1], seen[1]),
    )


@recorder.enter.implements(BeltPair)
def _enter_of_pair(scene, record, t, seen):
    """Implement :func:`recorder.enter`."""
    return Record(
        recorder.enter(scene.first, record.first, t, seen[0]), recorder.enter(scene.second, record.second, t, seen[1])
    )


@recorder.conclude.implements(BeltPair)
def _conclude_of_pair(scene, record, status, t, place, velocity):
    """Implement :func:`recorder.conclude`: the regime is that of the mass whose word ranks higher."""
    first = recorder.conclude(scene.first, record.first, status, t, place[0], velocity[0])
    second = recorder.conclude(scene.second, record.second, status, t, place[1], velocity[1])
    higher = first.motion if _RANK[int(first.motion)] >= _RANK[int(second.motion)] else second.motion
    both = higher, higher, t, min(first.settled, second.settled)
    return joined(joined(both, _of_each(first)), _of_each(second))
