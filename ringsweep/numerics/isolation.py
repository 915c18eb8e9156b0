"""Speeds at which a function changes its sign, and its greatest slope: isolated by intervals, never sampled.

An interval of the speed is decided if the bounds on the function exclude zero, or if those on its derivative do: then
its values at both ends tell all. Other intervals are halved. So no feature is missed, however narrow it is.

A *row* is a set of parameters of the law. Nothing here runs in kernels: :mod:`ringsweep.physics.friction.speeds`
calls it once for each set of parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ringsweep.numerics.expressions import evaluate
from ringsweep.numerics.intervals import VANISHING, Enclosure, Interval, add, exact, multiply

#: Speeds, m/s: less is rest, and nothing is faster than the second, which is three times the speed of light.
SLOWEST, FASTEST = 1e-15, 1e9

# Bounds of the first intervals.
_DECADES = np.geomspace(SLOWEST, FASTEST, 25)

# Most intervals of one set of parameters that are undecided at the same time, and intervals that are computed at once.
_MOST, _BLOCK = 1000, 4096

# Bounds that are so many roundings wide tell nothing but zero, if a rounding is not more than a share of the terms.
_ROUNDINGS, _ROUNDING = 8.0, 1e-12

# Greater numbers are no finite values.
_HUGE = 1e300

_OPEN, _RISES, _FALLS = 9, 2, 3

_Decide = Callable[["Cells", NDArray[np.bool_]], NDArray[np.int8]]


class UndecidedError(ArithmeticError):
    """A function cannot be told from zero in an interval of the speed.

    Parameters
    ----------
    low, high : float
        Bounds of the interval, m/s.
    """

    def __init__(self, low: float, high: float):
        """`low` and `high` are the bounds of the interval of the speed, m/s."""
        self.low, self.high = low, high
        super().__init__(f"undecided from {low:.6g} to {high:.6g} m/s")


class Cells(NamedTuple):
    """Intervals of the speed, m/s, each of one set of parameters; in ascending order for each set."""

    row: NDArray[np.intp]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def where(self, chosen: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Cells:
        """Some of the intervals."""
        return Cells(self.row[chosen], self.low[chosen], self.high[chosen])

    def middle(self) -> NDArray[np.float64]:
        """A speed that halves each interval; a wide one by orders of magnitude."""
        wide = (self.high > 4.0 * self.low) & (self.low > 0.0)
        return np.where(wide, np.sqrt(self.low) * np.sqrt(self.high), 0.5 * (self.low + self.high))

    def narrow(self, share: float = 0.0) -> NDArray[np.bool_]:
        """Whether an interval is too narrow to be halved, or narrower than a share of its speed."""
        middle = self.middle()
        ends = (middle <= self.low) | (middle >= self.high)
        return ends | (self.high <= SLOWEST) | (self.high - self.low <= share * self.high)

    def halves(self, split: NDArray[np.bool_]) -> tuple[Cells, NDArray[np.intp]]:
        """Intervals of which some are halved, and for each the number of the interval it comes from."""
        source = np.repeat(np.arange(len(self.row)), np.where(split, 2, 1))
        first = np.concatenate([source[1:] == source[:-1], [False]])
        second = np.concatenate([[False], first[:-1]])
        middle = self.middle()[source]
        low, high = np.where(second, middle, self.low[source]), np.where(first, middle, self.high[source])
        return Cells(self.row[source], low, high), source


def cells_between(low: NDArray[np.float64], high: NDArray[np.float64], breaks: list[NDArray[np.float64]]) -> Cells:
    """First intervals of each set of parameters.

    Parameters
    ----------
    low, high : ndarray of shape ``(rows,)``
        Bounds of the speed, m/s.
    breaks : list of ndarray of shape ``(rows,)``
        Speeds, m/s, that no interval may contain.
    """
    decades = np.broadcast_to(_DECADES, (len(low), len(_DECADES)))
    speeds = np.concatenate([decades, np.zeros((len(low), 1)), *(speed[:, None] for speed in (*breaks, high))], axis=1)
    speeds = np.sort(np.clip(speeds, low[:, None], np.minimum(high, FASTEST)[:, None]), axis=1)
    row, place = np.nonzero(speeds[:, 1:] > speeds[:, :-1])
    return Cells(row, speeds[row, place], speeds[row, place + 1])


def _check_budget(cells: Cells, split: NDArray[np.bool_]) -> None:
    """Raise if some row still has too many cells that are to be divided."""
    count = np.bincount(cells.row[split], minlength=1)
    if count.max() > _MOST:
        chosen = split & (cells.row == count.argmax())
        raise UndecidedError(cells.low[chosen].min(), cells.high[chosen].max())


def _subdivide(cells: Cells, decide: _Decide) -> tuple[Cells, NDArray[np.int8]]:
    """Halve intervals until all are decided."""
    decided, codes = [], []
    while len(cells.row):
        narrow = cells.narrow()
        code = np.empty(len(cells.row), dtype=np.int8)
        for begin in range(0, len(code), _BLOCK):
            part = slice(begin, begin + _BLOCK)
            code[part] = decide(cells.where(part), narrow[part])
        split = code == _OPEN
        decided.append(cells.where(~split))
        codes.append(code[~split])
        _check_budget(cells, split)
        rest = cells.where(split)
        cells, _ = rest.halves(np.ones(len(rest.row), dtype=bool))
    found, code = _joined(decided), np.concatenate(codes)
    order = np.lexsort((found.low, found.row))
    return found.where(order), code[order]


def _joined(parts: list[Cells]) -> Cells:
    """Cells of several tables in one."""
    row, low, high = (np.concatenate(fields) for fields in zip(*parts, strict=True))
    return Cells(row, low, high)


# ---- bounds -----------------------------------------------------------------------------------


def _at(enclosure: Enclosure, cells: Cells, speed: NDArray[np.float64], k: int) -> Interval:
    """Derivative `k` of a function at one speed of each cell, m/s, on the side of the cell."""
    return enclosure(cells.row, speed, speed, cells.low, k)[k]


def _whole(found: Interval) -> NDArray[np.bool_]:
    """Where an expression is defined on the whole of a cell."""
    defined = ~np.isnan(found.low)
    return defined if found.partial is None else defined & ~found.partial


def _centred(point: Interval, rate: Interval, cells: Cells, middle: NDArray[np.float64]) -> Interval:
    """Bounds on a function by the mean value theorem: its value at `middle` and bounds on its rate."""
    return add(point, multiply(rate, add(Interval(cells.low, cells.high), exact(-middle))))


class _Bounds(NamedTuple):
    """Bounds on a function in some intervals: arrays of shape ``(cells,)``, NaN where it is undefined.

    Attributes
    ----------
    low, high : ndarray
    least, most : ndarray
        It takes a value that is not greater than `least`, and one that is not less than `most`.
    falls : ndarray of bool
        Whether it certainly falls or is constant.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    least: NDArray[np.float64]
    most: NDArray[np.float64]
    falls: NDArray[np.bool_]


def _ends(enclosure: Enclosure, cells: Cells, k: int) -> list[Interval]:
    """Derivative `k` at both ends of each interval."""
    both = _joined([cells, cells])
    found = _at(enclosure, both, np.concatenate([cells.low, cells.high]), k)
    return [Interval(found.low[half], found.high[half]) for half in np.split(np.arange(len(both.row)), 2)]


def _bounds(enclosure: Enclosure, cells: Cells, k: int) -> _Bounds:
    """Bounds on derivative `k`."""
    found = []
    for begin in range(0, max(len(cells.row), 1), _BLOCK):
        part = cells.where(slice(begin, begin + _BLOCK))
        middle = part.middle()
        bounds = enclosure(part.row, part.low, part.high, part.low, k + 1)
        natural, rate = bounds[k:]
        point = _at(enclosure, part, middle, k)
        least, most = point.high.copy(), point.low.copy()
        with np.errstate(all="ignore"):
            low, high, _ = _centred(point, rate, part, middle)
            low, high = np.fmax(natural.low, low), np.fmin(natural.high, high)
            monotone = ((rate.low >= -VANISHING) | (rate.high <= VANISHING)) & _whole(rate)
            if monotone.any():
                ends = _ends(enclosure, part.where(monotone), k)
                low[monotone] = np.fmax(low[monotone], np.minimum(*(end.low for end in ends)))
                high[monotone] = np.fmin(high[monotone], np.maximum(*(end.high for end in ends)))
                least[monotone] = np.fmin(least[monotone], np.minimum(*(end.high for end in ends)))
                most[monotone] = np.fmax(most[monotone], np.maximum(*(end.low for end in ends)))
        nowhere = np.isnan(natural.low) | np.isnan(bounds[0].low)
        low[nowhere] = high[nowhere] = least[nowhere] = most[nowhere] = np.nan
        found.append((low, high, least, most, monotone & (rate.high <= VANISHING)))
    return _Bounds(*(np.concatenate(fields) for fields in zip(*found, strict=True)))


# ---- signs ------------------------------------------------------------------------------------


class Changes(NamedTuple):
    """Changes of the sign of a function, in ascending order for each set of parameters.

    Attributes
    ----------
    first : ndarray of shape ``(rows,)``
        The sign at first; 0 for a function that is zero.
    row : ndarray of shape ``(changes,)``
    low, high : ndarray of shape ``(changes,)``
        Bounds of each change, m/s.
    after : ndarray of shape ``(changes,)``
        The sign after it.
    """

    first: NDArray[np.int8]
    row: NDArray[np.intp]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    after: NDArray[np.int8]


def sign_changes(enclosure: Enclosure, cells: Cells, least: float | None = None) -> Changes:
    """All changes of the sign of a function.

    Parameters
    ----------
    enclosure : Enclosure
    cells : Cells
        Where it is looked for them.
    least : float, optional
        The function counts as positive where it is a finite number and not less than this, and as negative elsewhere,
        also where it is no number. By default it has no sign where it is no number or zero to rounding.

    Raises
    ------
    UndecidedError
        If too many intervals remain undecided.
    """

    def decide(some: Cells, narrow: NDArray[np.bool_]) -> NDArray[np.int8]:
        code = _signs(enclosure, some, least)
        if least is None:
            code[(code == _OPEN) & narrow] = 0
            # At rest the sign is that just above rest.
            code[some.high <= SLOWEST] = 0
        else:
            code[(code == _OPEN) & narrow] = -1
            # A coefficient that is no number at rest is refused elsewhere.
            code[some.high <= SLOWEST] = 1
        return code

    found, code = _subdivide(cells, decide)
    # Where it passes zero within an interval, the two ends have one sign each.
    passes = (code == _RISES) | (code == _FALLS)
    source = np.repeat(np.arange(len(code)), np.where(passes, 2, 1))
    second = np.concatenate([[False], source[1:] == source[:-1]])
    sign = np.where(passes[source], np.where((code[source] == _RISES) == second, 1, -1), code[source])
    low = np.where(passes[source] & second, found.high[source], found.low[source])
    high = np.where(passes[source] & ~second, found.low[source], found.high[source])
    signed = sign != 0
    row, low, high, sign = found.row[source][signed], low[signed], high[signed], sign[signed].astype(np.int8)
    first = np.zeros(enclosure.rows, dtype=np.int8)
    first[row[::-1]] = sign[::-1]
    change = np.flatnonzero((row[1:] == row[:-1]) & (sign[1:] != sign[:-1]))
    return Changes(first, row[change], high[change], low[change + 1], sign[change + 1])


def refined(changes: Changes, enclosure: Enclosure, least: float = 0.0) -> NDArray[np.float64]:
    """First speed beyond each change of sign, m/s; `least` as for :func:`sign_changes`."""
    values = {name: column[changes.row] for name, column in enclosure.values.items()}
    thresholds = [threshold[changes.row] for threshold in enclosure.thresholds]
    low, high = changes.low, changes.high
    while True:
        middle = 0.5 * (low + high)
        if not ((low < middle) & (middle < high)).any():
            return high
        value = evaluate(enclosure.output, middle, values, thresholds) - least
        # A number that is none is not the one before a pole.
        passed = np.where(changes.after > 0, value >= 0.0, ~(value > 0.0) if least == 0.0 else ~(value >= 0.0))
        low, high = np.where(passed, low, middle), np.where(passed, middle, high)


def _signs(enclosure: Enclosure, cells: Cells, least: float | None) -> NDArray[np.int8]:
    """Sign of a function in each interval, or how it passes zero there, or that this is open."""
    count, shift = len(cells.row), exact(-(least or 0.0))
    with np.errstate(all="ignore"):
        value, slope = enclosure(cells.row, cells.low, cells.high, cells.low, 1)
        value = add(value, shift) if least else value
        whole = _whole(value)
        code = np.full(count, _OPEN, dtype=np.int8)
        if least is None:
            code[value.low > 0.0], code[value.high < 0.0] = 1, -1
            code[np.isnan(value.low)] = 0
        else:
            code[(value.low >= 0.0) & (value.high < _HUGE) & whole] = 1
            code[(value.high < 0.0) | (value.low > _HUGE) | np.isnan(value.low)] = -1
        rest = np.flatnonzero((code == _OPEN) & whole & (value.high < _HUGE) & (value.low > -_HUGE))
        if not len(rest):
            return code
        some = cells.where(rest)
        value, slope = (
            Interval(found.low[rest], found.high[rest], None if found.partial is None else found.partial[rest])
            for found in (value, slope)
        )
        middle = some.middle()
        point = add(_at(enclosure, some, middle, 0), shift)
        centred = _centred(point, slope, some, middle)
        found = np.full(len(rest), _OPEN, dtype=np.int8)
        found[centred.low > 0.0], found[centred.high < 0.0] = 1, -1
        rounding = _ROUNDINGS * (point.high - point.low)
        zero = np.flatnonzero((found == _OPEN) & (value.low >= -rounding) & (value.high <= rounding))
        if len(zero):
            size = enclosure.size(some.row[zero], middle[zero], some.low[zero])
            found[zero[rounding[zero] <= _ROUNDING * size]] = 0 if least is None else 1
        monotone = (found == _OPEN) & ((slope.low >= -VANISHING) | (slope.high <= VANISHING)) & _whole(slope)
        some = some.where(monotone)
        ends = [add(end, shift) for end in _ends(enclosure, some, 0)]
        before, after = ((end.low > 0.0).astype(np.int8) - (end.high < 0.0) for end in ends)
        if least is not None:
            before, after = (np.where(sign == 0, 1, sign) for sign in (before, after))
        same = np.where(before == 0, after, np.where((after == 0) | (after == before), before, _OPEN))
        found[monotone] = np.where(same == _OPEN, np.where(before < 0, _RISES, _FALLS), same)
        code[rest] = found
    return code


# ---- extremes ---------------------------------------------------------------------------------


def steepest(enclosure: Enclosure, cells: Cells) -> NDArray[np.float64]:
    """Greatest magnitude of the slope in the intervals of each set of parameters, or up to 1 % more.

    Zero without intervals; infinite at a pole. Where rounding prevents that, it is more.
    """
    best, bound = np.zeros(enclosure.rows), np.zeros(enclosure.rows)
    while len(cells.row):
        found = _bounds(enclosure, cells, 1)
        greatest = np.nan_to_num(np.maximum(abs(found.low), abs(found.high)), nan=0.0, posinf=np.inf)
        np.maximum.at(best, cells.row, np.nan_to_num(np.maximum(found.most, -found.least), nan=0.0))
        split = (greatest > 1.01 * best[cells.row]) & (greatest > VANISHING) & ~cells.narrow()
        count = np.bincount(cells.row[split], minlength=enclosure.rows)
        split &= (count <= _MOST)[cells.row]
        np.maximum.at(bound, cells.row[~split], greatest[~split])
        rest = cells.where(split)
        cells, _ = rest.halves(np.ones(len(rest.row), dtype=bool))
    return bound


def first_flat(
    enclosure: Enclosure, cells: Cells, share: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """First speed at which the slope has fallen to a share of its greatest value below.

    Returns
    -------
    tuple of ndarray of shape ``(rows,)``
        Bounds of this speed, m/s, and the slope there, s/m. Within the bounds the slope falls; they are equal where it
        jumps. FASTEST if the slope does not fall so far.
    """
    least, most = np.full(enclosure.rows, FASTEST), np.full(enclosure.rows, FASTEST)
    level = np.zeros(enclosure.rows)
    found = _bounds(enclosure, cells, 1)
    while len(cells.row):
        low, high, _, value, falls = found
        rows, index = np.unique(cells.row, return_inverse=True)
        place = np.arange(len(index)) - np.searchsorted(index, np.arange(len(rows)))[index]
        at, shape = (index, place), (len(rows), place.max() + 1)
        # Least and greatest possible value of the steepest slope, up to the end of each interval; and up to its start.
        certain = _running_maximum(value, at, shape)
        possible = _running_maximum(np.nan_to_num(high, nan=np.inf), at, shape)[at]
        before = np.concatenate([np.full((len(rows), 1), -np.inf), certain[:, :-1]], axis=1)[at]
        # Where friction is no number it grows no more.
        flat = ((high <= share * before) & (before > 0.0)) | np.isnan(low)
        # The slope may be zero at rest, where friction has yet to grow.
        grows = (low > share * possible) | (possible <= VANISHING) | (cells.high <= SLOWEST)
        # The first interval in which the slope may have fallen so far.
        stops = np.zeros(shape, dtype=bool)
        stops[at] = ~grows
        ends = np.where(stops.any(axis=1), stops.argmax(axis=1), shape[1])
        last = place == ends[index]
        narrow = cells.narrow(1e-12)
        # An earlier interval matters if the slope may be steepest there.
        top = (1.0 + 1e-10) * certain[np.arange(len(rows)), ends - 1][index]
        vague = (place < ends[index]) & (high > top) & (high > VANISHING) & ~narrow
        clear = np.ones(len(rows), dtype=bool)
        clear[index[vague]] = False
        isolated = last & falls & (place > 0) & clear[index]
        done = last & (flat | narrow | isolated)
        least[cells.row[done]] = cells.low[done]
        most[cells.row[done]] = np.where(isolated & ~flat, cells.high, cells.low)[done]
        level[cells.row[done]] = share * np.fmax(before, value)[done]
        running = np.zeros(len(rows), dtype=bool)
        running[index[last & ~done]] = True
        flats = np.zeros(shape, dtype=np.intp)
        flats[at] = flat
        kept = running[index] & (np.cumsum(flats, axis=1)[at] <= flat)
        split = kept & (vague | last) & ~narrow
        _check_budget(cells, split)
        cells, source = cells.where(kept).halves(split[kept])
        found = _Bounds(*(field[kept][source] for field in found))
        new = split[kept][source]
        for field, computed in zip(found, _bounds(enclosure, cells.where(new), 1), strict=True):
            field[new] = computed
    return least, most, level


def _running_maximum(
    values: NDArray[np.float64], at: tuple[NDArray[np.intp], NDArray[np.intp]], shape: tuple[int, int]
) -> NDArray[np.float64]:
    """Greatest of these values up to each column; other columns hold minus infinity."""
    wide = np.full(shape, -np.inf)
    wide[at] = values
    found: NDArray[np.float64] = np.maximum.accumulate(wide, axis=1)
    return found


def not_negligible(
    enclosure: Enclosure, cells: Cells, factor: float, speed: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest speed, m/s, at which ``exp(-factor * exponent)`` is not negligible; infinity and 0 for none.

    Parameters
    ----------
    enclosure : Enclosure
        Of the exponent.
    cells : Cells
    factor : float
    speed : ndarray of shape ``(rows,)``
        As for :func:`reach`.
    """
    first, last = np.full(enclosure.rows, np.inf), np.zeros(enclosure.rows)

    def decide(some: Cells, narrow: NDArray[np.bool_]) -> NDArray[np.int8]:
        low, high, *_ = _bounds(enclosure, some, 0)
        _, rate = enclosure(some.row, some.low, some.high, some.low, 1)
        least = np.where((rate.low <= 0.0) & (rate.high >= 0.0), 0.0, np.minimum(abs(rate.low), abs(rate.high)))
        with np.errstate(invalid="ignore"):
            small = factor * low > reach(factor * np.nan_to_num(least, nan=0.0), speed[some.row])
            kept = ~small & ((factor * high <= 10.0) | (factor * (high - low) < 2.0) | narrow | np.isnan(low))
        return np.where(small, 0, np.where(kept, 1, _OPEN)).astype(np.int8)

    found, code = _subdivide(cells, decide)
    found = found.where(code == 1)
    np.minimum.at(first, found.row, found.low)
    np.maximum.at(last, found.row, found.high)
    return first, np.where(last >= FASTEST, np.inf, last)


def reach(rate: NDArray[np.float64], speed: NDArray[np.float64]) -> NDArray[np.float64]:
    """Exponent from which an exponential that decays at a rate, s/m, is negligible.

    The rest of it changes a sliding velocity by less than the rounding of a speed, m/s.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        found: NDArray[np.float64] = np.clip(36.8 - np.log(rate * speed), 10.0, 40.0)
    return found
