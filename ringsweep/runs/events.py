"""Events of a run (edges, stops, breakaways, reversals, lost contacts, impacts, jams), and histories at other times."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.quantities.flags import JAMMED
from ringsweep.quantities.variables import CONTACTS, Variable, classes, explained

#: Kinds of events, and what each says.
KINDS = {
    "none": "no event",
    "edge": "a contact passes to another segment of the ring",
    "stop": "the body comes to stick",
    "breakaway": "the body breaks loose",
    "reversal": "the slip changes its direction",
    "separation": "a contact is lost",
    "rebound": "an open contact hits the race and opens again",
    "closure": "an open contact hits the race and stays on it",
    "jam": "the rigid body has no motion, or several",
}

#: Variables along the dimension ``event``.
VARIABLES = {
    "event_time": Variable("s", "time of the event"),
    "event_kind": classes("kind of the event", KINDS.keys(), explained(KINDS)),
    "event_contact": classes("contact that the event concerns; none: the body as a whole", CONTACTS),
}

_FLIGHT = 2

_NUMBERS = {kind: number for number, kind in enumerate(KINDS)}


class Events(NamedTuple):
    """Events of one kind: times, s, and contacts as `separating_contact` has them, both of shape ``(events,)``."""

    kind: str
    times: NDArray[np.float64]
    contacts: NDArray[np.int8]


def history_at(run: xr.Dataset, times: NDArray[np.float64]) -> xr.Dataset:
    """A history at other times.

    A history has each event twice, before and after it. Between two rows numbers are interpolated, up to an event from
    the row before it; at an event they have their values after it. Classifications have the value of the row before.
    Outside the history numbers are NaN, and classifications have the value of its end.

    Parameters
    ----------
    run : xarray.Dataset
    times : ndarray of float64, shape ``(times,)``
        Times, s.
    """
    own = run["time"].values
    row = np.clip(np.searchsorted(own, times, side="right") - 1, 0, len(own) - 1)
    after = np.minimum(row + 1, len(own) - 1)
    inside = (times >= own[0]) & (times <= own[-1])
    passed, length = times - own[row], own[after] - own[row]
    between = inside & (passed > 0.0)
    share = xr.Variable("time", np.divide(passed, length, out=np.zeros(len(times)), where=between))
    found = run.isel(time=row).assign_coords(time=("time", times, run["time"].attrs))
    for name, data in run.data_vars.items():
        if data.dtype.kind == "f" and "time" in data.dims:
            begin, end = found[name].variable, data.variable.isel(time=after)
            # A row at its own time must not see the next one, which may be NaN.
            values = xr.where(xr.Variable("time", between), begin + share * (end - begin), begin)
            found[name] = found[name].copy(data=values.where(xr.Variable("time", inside)).transpose(*data.dims).data)
    return found


def _edges(run: xr.Dataset, outcome: xr.Dataset) -> Iterator[Events]:
    """A history has each located event twice, before and after it."""
    times = run["time"].values
    crossing = np.zeros(len(times) - 1, dtype=np.int8)
    for contact in (1, 2):
        if f"zone_{contact}" in run:
            crossing += contact * (np.diff(run[f"zone_{contact}"].values) != 0).astype(np.int8)
    at = np.flatnonzero((crossing > 0) & (np.diff(times) == 0.0))
    yield Events("edge", times[at], crossing[at])


def _changes_of_mode(run: xr.Dataset, outcome: xr.Dataset) -> Iterator[Events]:
    # Of two masses each has a mode.
    for contact, name in enumerate(("mode", "mode_1", "mode_2")):
        if name not in run:
            continue
        times, mode = run["time"].values, run[name].values.astype(int)
        if "impact_time" in run:
            # A body in flight neither sticks nor slips.
            reactions = [run[name].values for name in ("normal_1", "normal_2") if name in run]
            mode = np.where(np.all(np.array(reactions) == 0.0, axis=0), _FLIGHT, mode)
        at = np.flatnonzero((np.diff(mode) != 0) & (np.diff(times) == 0.0))
        before, after = mode[at], mode[at + 1]
        breaks = (before == 0) & (after != _FLIGHT)
        for kind, which in (("stop", after == 0), ("breakaway", breaks), ("reversal", before * after == -1)):
            yield Events(kind, times[at][which], np.full(np.count_nonzero(which), contact, dtype=np.int8))


def _end(run: xr.Dataset, outcome: xr.Dataset) -> Iterator[Events]:
    # With impacts the method tells each lost contact.
    if int(outcome.get("separating_contact", 0)) and "impact_time" not in run:
        contact = np.atleast_1d(outcome["separating_contact"].values).astype(np.int8)
        yield Events("separation", np.atleast_1d(outcome["t_separation"].values), contact)
    if outcome["regime"] == JAMMED:
        yield Events("jam", np.atleast_1d(outcome["t_end"].values), np.zeros(1, dtype=np.int8))


#: What finds events in a history and the outcomes of the run. Events at one instant keep this order.
FINDERS: tuple[Callable[[xr.Dataset, xr.Dataset], Iterator[Events]], ...] = (_edges, _changes_of_mode, _end)


def events(run: xr.Dataset, outcome: xr.Dataset, told: Iterable[Events] = ()) -> xr.Dataset:
    """Events of a run along the dimension ``event``, in the order of their times.

    Parameters
    ----------
    run : xarray.Dataset
        History of the run.
    outcome : xarray.Dataset
        Its outcomes.
    told : iterable of Events
        Events that the method itself tells.

    Returns
    -------
    xarray.Dataset
        The variables of :data:`VARIABLES`. ``rk4`` locates no events but the last.
    """
    found = [*told, *(one for finder in FINDERS for one in finder(run, outcome))]
    times = np.concatenate([one.times for one in found])
    kinds = np.repeat([_NUMBERS[one.kind] for one in found], [len(one.times) for one in found]).astype(np.int8)
    contacts = np.concatenate([one.contacts for one in found])
    order = np.argsort(times, kind="stable")
    columns = zip(VARIABLES.items(), (times, kinds, contacts), strict=True)
    return xr.Dataset({name: ("event", column[order], kind.attributes) for (name, kind), column in columns})


def side_by_side(tables: dict[str, xr.Dataset]) -> xr.Dataset:
    """Events under several friction laws; shorter tables are filled with NaN and ``none``."""
    numbered = [table.assign_coords(event=np.arange(table.sizes["event"])) for table in tables.values()]
    filler = {"event_time": np.nan, "event_kind": 0, "event_contact": 0}
    return xr.concat(numbered, "friction_law", join="outer", fill_value=filler).drop_vars("event")
