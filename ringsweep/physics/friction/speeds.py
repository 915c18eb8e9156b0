"""Speeds at which the expression of a friction law switches, and numbers that are found once for each cell.

All are isolated by interval arithmetic, see :mod:`ringsweep.numerics.isolation`: no feature of a law is too narrow.

A *row* is a cell on one of its surfaces: cells vary fastest. A *threshold* is a speed at which the formula switches.
Nothing here runs in kernels: models call :func:`hidden_fields` and :func:`table_fields` as they build cells.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.numerics.expressions import Node, derivative, evaluate, nodes_of
from ringsweep.numerics.intervals import Enclosure
from ringsweep.numerics.isolation import (
    FASTEST,
    Cells,
    UndecidedError,
    cells_between,
    first_flat,
    not_negligible,
    reach,
    refined,
    sign_changes,
    steepest,
)
from ringsweep.numerics.rows import distinct_rows, places_of
from ringsweep.physics.friction.formula import DIRECTION, FormulaError, Threshold
from ringsweep.physics.friction.velocity import Expression

_Columns = dict[str, NDArray[np.float64]]
_Surface = tuple[NDArray[np.float64], NDArray[np.float64]]

# The stiction band ends where the slope has fallen to this share of the steepest slope below.
_FLAT = 0.01

# Results for so many sets of parameters of a law are kept.
_MOST_KEPT = 4096

# Name of the speed of the motion among the parameters of a law. No parameter has a space in its name.
_SPEED = "speed of the motion"

# Rounding of a friction coefficient.
_ROUNDING = 1e-12


def hidden_fields(
    expression: Expression,
    columns: Mapping[str, NDArray[np.float64]],
    surfaces: Sequence[_Surface],
    speed: NDArray[np.float64] | float = 0.0,
) -> dict[str, NDArray[Any]]:
    """Fields of a law that follow from its parameters.

    Parameters
    ----------
    expression : Expression
    columns : mapping of str to ndarray of shape ``(cells,)``
        Parameters of the law.
    surfaces : sequence of tuple of ndarray of shape ``(cells,)``
        ``(mu_s, mu_k)`` of each surface of the scene. Under a formula with the direction of sliding, those of all
        surfaces forwards stand before those backwards.
    speed : float or ndarray of shape ``(cells,)``
        Speed of the motion, m/s: what changes it by less than its rounding is negligible. 0 if it is not known.

    Returns
    -------
    dict of str to ndarray
        ``slope_at_rest`` and ``slope_beyond``, s/m. For laws with several regions ``edges``, their bounds in ascending
        order, and ``thresholds``, the speeds of the switches; m/s. Under a formula with the direction these are the
        speeds of forward sliding, and ``thresholds_back`` those of backward sliding. For laws with a stiction band
        ``band``, m/s, and ``in_band``, the number of regions within it.

    Raises
    ------
    FormulaError
        If the formula has no value at rest, or another one than its kind needs; if friction jumps up at some speed; or
        if the speeds cannot be found.
    """
    if any(threshold.kind in ("head", "tail") for threshold in expression.thresholds):
        with np.errstate(divide="ignore"):
            # Cells whose speeds are alike have the same fields.
            octave = np.exp2(np.floor(np.log2(speed)))
        columns = {**columns, _SPEED: np.broadcast_to(octave, len(surfaces[0][0]))}
    table = [*columns.values(), *(column for surface in surfaces for column in surface)]
    first, cell_row = distinct_rows(table)
    rows = np.stack([column[first] for column in table], axis=1)
    found = (_kept_fields if len(rows) <= _MOST_KEPT else _fields_of)(expression, tuple(columns), rows)
    return {name: np.ascontiguousarray(field[cell_row]) for name, field in found.items()}


def _fields_of(expression: Expression, names: tuple[str, ...], rows: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """Fields of distinct sets of parameters."""
    columns = {name: rows[:, k] for k, name in enumerate(names)}
    pairs = rows[:, len(names) :].reshape(len(rows), -1, 2)
    return _Finder(expression, columns, [(pairs[:, i, 0], pairs[:, i, 1]) for i in range(pairs.shape[1])]).fields()


@lru_cache(maxsize=64)
def _kept(expression: Expression, names: tuple[str, ...]) -> dict[bytes, Any]:
    """Fields of a law that are found already, by set of parameters."""
    return {}


def _kept_fields(expression: Expression, names: tuple[str, ...], rows: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """Fields of distinct sets of parameters, found once: the tasks of a sweep share many sets."""
    kept, keys = _kept(expression, names), [row.tobytes() for row in rows]
    # Another thread may empty what is kept.
    own: dict[bytes, Any] = {key: kept.get(key) for key in keys}
    if missing := [i for i, key in enumerate(keys) if own[key] is None]:
        found = _fields_of(expression, names, rows[missing])
        new = {keys[i]: {name: field[k] for name, field in found.items()} for k, i in enumerate(missing)}
        if len(kept) + len(new) > _MOST_KEPT:
            kept.clear()
        kept.update(new)
        own |= new
    return {name: np.array([fields[name] for fields in own.values()]) for name in own[keys[0]]}


def table_fields(
    speeds: NDArray[np.float64], mu: NDArray[np.float64], surfaces: Sequence[_Surface]
) -> dict[str, NDArray[Any]]:
    """Fields of a law that is a table, see :class:`ringsweep.physics.friction.laws.Table`.

    Parameters
    ----------
    speeds : ndarray of shape ``(n,)``
        Sliding speeds, m/s, ascending from 0.
    mu : ndarray of shape ``(n,)``
        Friction coefficients.
    surfaces : sequence of tuple of ndarray of shape ``(cells,)``
        The second number of each is the factor on the table.
    """
    # This import takes longer than a small sweep.
    from scipy.interpolate import PchipInterpolator

    curve = PchipInterpolator(speeds, mu)
    last = [speeds[-1], mu[-1], 0.0, 0.0, 0.0]
    pieces = np.vstack([np.column_stack([speeds[:-1], curve.c[::-1].T]), last])
    cells, scale = len(surfaces[0][1]), np.max([factor for _, factor in surfaces], axis=0)
    found: dict[str, NDArray[Any]] = {"pieces": np.broadcast_to(pieces, (cells, *pieces.shape))}
    if mu[0] > 0.0:
        jump = np.where(scale > 0.0, np.inf, 0.0)
        return found | {"slope_at_rest": jump, "slope_beyond": jump}
    # Friction grows up to its first maximum.
    falls = np.flatnonzero(np.diff(mu) <= 0.0)
    top = int(falls[0]) if len(falls) else len(mu) - 1
    return found | {
        "slope_at_rest": scale * abs(curve(0.0, 1)),
        "slope_beyond": scale * _steepest_of(curve.c[::-1, top:], np.diff(speeds)[top:]),
        "band": np.full(cells, speeds[top]),
        "in_band": np.full(cells, top),
    }


def _steepest_of(cubics: NDArray[np.float64], widths: NDArray[np.float64]) -> float:
    """Greatest magnitude of the slopes of cubics, of which each has a column of coefficients from the lowest up."""
    _, linear, square, cube = cubics
    with np.errstate(all="ignore"):
        inflection = np.nan_to_num(-square / (3.0 * cube)).clip(0.0, widths)
    slopes = [abs(linear + x * (2.0 * square + x * 3.0 * cube)) for x in (0.0 * widths, inflection, widths)]
    return float(np.max(slopes, initial=0.0))


class _Finder:
    """Finds the speeds of one expression for several sets of parameters at once.

    A row is a set of parameters with one of the surfaces; the rows of one surface stand together.
    """

    def __init__(self, expression: Expression, columns: _Columns, surfaces: list[_Surface]) -> None:
        """Repeat the parameters for each surface: row ``surface * cells + cell``."""
        self.expression, self.surfaces = expression, len(surfaces)
        self.values = {name: np.tile(column, len(surfaces)) for name, column in columns.items()}
        self.values["mu_s"], self.values["mu_k"] = (np.concatenate(column) for column in zip(*surfaces, strict=True))
        self.rows = len(self.values["mu_s"])
        self.ways = 2 if expression.signed else 1
        if expression.signed:
            self.values[DIRECTION.value] = np.repeat([1.0, -1.0], self.rows // 2)
        self.rest = np.zeros(self.rows)
        self.thresholds: list[NDArray[np.float64]] = []
        self.found: dict[Any, Any] = {}

    def fields(self) -> dict[str, NDArray[Any]]:
        """Fields of the law for each cell: band, edges, thresholds, and steepest slopes; see :func:`hidden_fields`."""
        for threshold in self.expression.thresholds:
            speed = self._speed_of(threshold)
            for index, lower in threshold.within:
                limit = self.thresholds[index]
                speed = np.minimum(speed, limit) if lower else np.maximum(speed, limit)
            self.thresholds.append(speed)
        self._check_rest()
        self._check_jumps()
        found: dict[str, NDArray[Any]] = {}
        of_ways = [[self._by_way(speed)[way, 0] for speed in self.thresholds] for way in range(self.ways)]
        edges = [speed for thresholds in of_ways for speed in thresholds]
        if self.expression.has_band:
            found["band"] = self._band()
            edges.append(found["band"])
        if self.expression.has_edges:
            found["edges"] = _sorted_edges(edges)
            for name, thresholds in zip(("thresholds", "thresholds_back"), of_ways, strict=False):
                if thresholds:
                    found[name] = np.stack(thresholds, axis=1)
        if self.expression.has_band:
            found["in_band"] = (found["edges"] < found["band"][:, None]).sum(axis=1) + 1
        found["slope_at_rest"], found["slope_beyond"] = self._slopes(found.get("band"))
        return found

    def at(self, node: Node, speed: NDArray[np.float64]) -> NDArray[np.float64]:
        """Value of a node at one speed for each row."""
        return np.broadcast_to(evaluate(node, speed, self.values, self.thresholds), self.rows)

    def _by_surface(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values as an array of shape ``(surfaces, cells)``."""
        return values.reshape(self.surfaces, -1)

    def _by_way(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values as an array of shape ``(ways, surfaces, cells)``; the formula may be another one each way."""
        return values.reshape(self.ways, self.surfaces // self.ways, -1)

    def _on_all(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of shape ``(ways, cells)``, repeated for each surface."""
        return np.repeat(values, self.surfaces // self.ways, axis=0).ravel()

    def _enclosed(self, node: Node) -> Enclosure:
        """Bounds on an expression over intervals of the speed."""
        return Enclosure(node, self.values, self.thresholds)

    def _cells(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> Cells:
        """Intervals of the speed from `low` to `high`, divided at the thresholds that are known so far."""
        return cells_between(low, high, [speed for speed in self.thresholds if np.isfinite(speed).any()])

    # ---- switches -----------------------------------------------------------------------------

    def _speed_of(self, threshold: Threshold) -> NDArray[np.float64]:
        """Speed of a threshold in each row, m/s.

        Raises
        ------
        FormulaError
            If rounding hides where the formula switches.
        """
        if threshold.at is not None:
            return self._equal(self._given(threshold.at))
        assert threshold.difference is not None
        low, high = self.rest, np.full(self.rows, np.inf)
        for index, lower in threshold.within:
            limit = self.thresholds[index]
            low, high = (low, np.minimum(high, limit)) if lower else (np.maximum(low, limit), high)
        sought = threshold.kind in ("head", "tail"), threshold.difference, threshold.within
        try:
            if threshold.kind in ("head", "tail"):
                kept = self._once(sought, lambda: self._kept(threshold, low, high))
                return kept[0] if threshold.kind == "head" else kept[1]
            if threshold.kind == "valid":
                return self._once(sought, lambda: self._invalid(threshold.difference))[threshold.order]
            first, speeds = self._once(sought, lambda: self._signs(threshold.difference, low, high))
            return self._equal(self._root(first, speeds, threshold.order))
        except UndecidedError as error:
            what = "whether friction is negative" if threshold.kind == "valid" else "where min, max or abs switch"
            raise self._undecided(what, error) from None

    def _once(self, key: Any, find: Any) -> Any:
        """What `find` returns, found once for each key."""
        if key not in self.found:
            self.found[key] = find()
        return self.found[key]

    @staticmethod
    def _undecided(what: str, error: UndecidedError) -> FormulaError:
        """Error that rounding hides `what`."""
        return FormulaError(
            f"{what} cannot be told from rounding at speeds from {error.low:.6g} to {error.high:.6g} m/s: write the "
            "formula so that nearly equal numbers are not subtracted, or with piecewise"
        )

    def _given(self, speed: Node) -> NDArray[np.float64]:
        """Speed of a threshold that the formula states, m/s."""
        found = self.at(speed, self.rest)
        if np.isnan(found).any():
            raise FormulaError("the speed at which it switches is not a number")
        return found

    def _equal(self, speed: NDArray[np.float64]) -> NDArray[np.float64]:
        """Speeds that must not depend on the surface."""
        found = self._by_way(speed)
        if not np.allclose(found, found[:, :1], rtol=1e-12, atol=0.0):
            raise FormulaError(
                "it switches at a speed that depends on mu_s or mu_k, which differ by zone or direction: "
                "write the speed as a parameter of its own"
            )
        return self._on_all(found[:, 0])

    def _signs(
        self, difference: Node, low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> tuple[NDArray[np.int8], NDArray[np.float64]]:
        """Sign of a difference at first, and the speeds at which it changes, of shape ``(rows, 3)``."""
        enclosure = self._enclosed(difference)
        changes = sign_changes(enclosure, self._cells(low, high))
        count = np.bincount(changes.row, minlength=self.rows)
        if (count + (changes.first > 0) > 3).any():
            raise FormulaError("min, max or abs switch more than three times: write piecewise")
        found = np.full((self.rows, 3), np.inf)
        found[changes.row, places_of(changes.row)] = refined(changes, enclosure)
        return changes.first, found

    @staticmethod
    def _root(first: NDArray[np.int8], speeds: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """Speed at which a difference changes its sign; order 0 is 0 if it is positive at first."""
        wanted = order - (first > 0)
        return np.where(wanted < 0, 0.0, np.take_along_axis(speeds, wanted.clip(0)[:, None], axis=1)[:, 0])

    def _kept(
        self, threshold: Threshold, low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Speeds between which an exponential is not negligible."""
        exponent, scale = threshold.difference, threshold.order
        assert exponent is not None
        rate = derivative(exponent)
        if not rate.varies and threshold.kind == "tail":
            offset, slope = (self.at(node, self.rest) for node in (exponent, rate))
            with np.errstate(all="ignore"):
                found = (reach(scale * slope, self.values[_SPEED]) / scale - offset) / slope
            found = np.where(slope > 0.0, np.maximum(found, 0.0), np.inf)
            return self.rest, self._of_all(found, np.max)
        first, last = not_negligible(self._enclosed(exponent), self._cells(low, high), scale, self.values[_SPEED])
        return self._of_all(np.minimum(first, last), np.min), self._of_all(last, np.max)

    def _of_all(self, values: NDArray[np.float64], choose: Any) -> NDArray[np.float64]:
        """One value for each cell and way, chosen among those on all its surfaces, and repeated for each surface."""
        return self._on_all(choose(self._by_way(values), axis=1))

    # ---- validity -----------------------------------------------------------------------------

    def _invalid(self, mu: Node) -> list[NDArray[np.float64]]:
        """Bounds of the speeds at which friction is negative or no number on some surface, one below the other."""
        at_rest = self.at(mu, self.rest)
        wrong = ~((at_rest >= -_ROUNDING) & (at_rest < np.inf))
        if wrong.any():
            raise FormulaError(
                f"at rest it gives {at_rest[wrong][0]:.6g}: a friction coefficient is a number and not negative"
            )
        enclosure = self._enclosed(mu)
        changes = sign_changes(enclosure, self._cells(self.rest, np.full(self.rows, np.inf)), -_ROUNDING)
        speeds = refined(changes, enclosure, -_ROUNDING)
        sets = self.rows // self.surfaces
        found = np.full((3, self.ways * sets), np.inf)
        of_set = changes.row % sets + changes.row // (self.rows // self.ways) * sets
        for own in np.unique(of_set):
            mine = of_set == own
            order = np.argsort(speeds[mine], kind="stable")
            # Number of surfaces on which friction is invalid.
            count = np.cumsum(-changes.after[mine][order].astype(int))
            bounds = speeds[mine][order][np.diff(count > 0, prepend=False)]
            if len(bounds) > 3:
                raise FormulaError(
                    f"it is negative or no number in several intervals of the speed, from {bounds[0]:.6g} to "
                    f"{bounds[1]:.6g} and from {bounds[2]:.6g} to {bounds[3]:.6g} m/s: it may be so in one interval, "
                    "and from another speed on"
                )
            found[: len(bounds), own] = bounds
        return [self._on_all(bound.reshape(self.ways, sets)) for bound in found]

    def _check_rest(self) -> None:
        """Check values at rest, and that the law has a power series there."""
        at_rest, mu_s = self.at(self.expression.mu, self.rest), self.values["mu_s"]
        for node in nodes_of(self.expression.mu):
            if node.varies and node.kind in ("sqrt", "log", "power") and (self.at(node.parts[0], self.rest) == 0).any():
                raise FormulaError(
                    "a root, a power or a logarithm of something that vanishes at rest has no power series there: "
                    "write a whole exponent as a number, such as **2, or add a small constant"
                )
        if self.expression.set_valued:
            excess = at_rest > mu_s * (1.0 + _ROUNDING) + _ROUNDING
            if excess.any():
                raise FormulaError(
                    f"it begins to slip with friction {at_rest[excess][0]:.6g}, more than the "
                    f"{mu_s[excess][0]:.6g} that it has at rest"
                )
        elif (abs(at_rest) > 1e-9).any():
            raise FormulaError(
                "without at_rest friction must vanish at v = 0, where it is "
                f"{at_rest[abs(at_rest) > 1e-9][0]:.6g}: "
                "give `at_rest: mu_s` for friction that holds up to mu_s at rest",
                "at_rest",
            )

    def _check_jumps(self) -> None:
        """Check that friction does not jump up: there a body would neither get faster nor slower."""
        pairs = zip(self.expression.thresholds, self.thresholds, strict=True)
        for speed in [speed for threshold, speed in pairs if threshold.kind in ("given", "root")]:
            inside = np.where((speed > 0.0) & (speed < FASTEST), speed, 0.0)
            lower = [np.where(other == inside, np.inf, other) for other in self.thresholds]
            mu, slope = self.expression.mu, derivative(self.expression.mu)
            above, rate = self.at(mu, inside), abs(self.at(slope, inside))
            below = np.broadcast_to(evaluate(mu, inside, self.values, lower), self.rows)
            rate = rate + abs(evaluate(slope, inside, self.values, lower))
            with np.errstate(invalid="ignore"):
                rounding = _ROUNDING * (1.0 + abs(below)) + 8.0 * rate * np.spacing(inside)
                jumps = (inside > 0.0) & (above > below + rounding)
            if jumps.any():
                at = np.flatnonzero(jumps)[0]
                raise FormulaError(
                    f"friction jumps up from {below[at]:.6g} to {above[at]:.6g} at v = {inside[at]:.6g} m/s: a body "
                    "would keep this speed, with any friction between the two. Write a steep ramp in place of the jump"
                )

    # ---- band and slopes ----------------------------------------------------------------------

    def _band(self) -> NDArray[np.float64]:
        """Speed up to which friction rises, m/s: the stiction band of a smooth law."""
        if self.expression.band is not None:
            return self._by_surface(self.at(self.expression.band, self.rest))[0]
        cells = self._cells(self.rest, np.full(self.rows, np.inf))
        try:
            low, high, level = first_flat(self._enclosed(self.expression.mu), cells, _FLAT)
        except UndecidedError as error:
            raise self._undecided("where friction grows no more", error) from None
        slope = derivative(self.expression.mu)
        while ((low < (middle := 0.5 * (low + high))) & (middle < high)).any():
            flat = self.at(slope, middle) <= level
            low, high = np.where(flat, low, middle), np.where(flat, middle, high)
        return self._by_surface(high).max(axis=0)

    def _slopes(self, band: NDArray[np.float64] | None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Steepest slopes at rest and beyond the band, on the roughest surface."""
        if band is None:
            jump = np.where(self._by_surface(self.values["mu_s"]).max(axis=0) > 0.0, np.inf, 0.0)
            return jump, jump
        at_rest = abs(self.at(derivative(self.expression.mu), self.rest))
        if self.expression.set_valued:
            at_rest = self.rest
        beyond_band = self._cells(np.tile(band, self.surfaces), np.full(self.rows, np.inf))
        beyond = steepest(self._enclosed(self.expression.mu), beyond_band)
        return self._by_surface(at_rest).max(axis=0), self._by_surface(beyond).max(axis=0)


def _sorted_edges(edges: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Distinct positive edges of each row in ascending order, then infinity."""
    found = np.sort(np.stack(edges, axis=1), axis=1)
    found[found <= 0.0] = np.inf
    found = np.sort(found, axis=1)
    found[:, 1:][found[:, 1:] == found[:, :-1]] = np.inf
    return np.sort(found, axis=1)
