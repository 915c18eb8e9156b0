"""Speeds at which the expression of a friction law switches, and numbers that are found once for each cell."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.numerics.expressions import Node, derivative, evaluate, nodes_of
from ringsweep.physics.friction.formula import FormulaError, Threshold
from ringsweep.physics.friction.velocity import Expression

_Columns = dict[str, NDArray[np.float64]]
_Surface = tuple[NDArray[np.float64], NDArray[np.float64]]

# Speeds at which expressions are looked at, m/s.
_GRID = np.concatenate([[0.0], np.geomspace(1e-15, 1e9, 481)])

# The stiction band ends where the slope has fallen to this share of the steepest slope below.
_FLAT = 0.01

# Rounding of a friction coefficient.
_ROUNDING = 1e-12


def hidden_fields(
    expression: Expression, columns: Mapping[str, NDArray[np.float64]], surfaces: Sequence[_Surface]
) -> dict[str, NDArray[Any]]:
    """Fields of a law that follow from its parameters.

    Parameters
    ----------
    expression : Expression
    columns : mapping of str to ndarray of shape ``(cells,)``
        Parameters of the law.
    surfaces : sequence of tuple of ndarray of shape ``(cells,)``
        ``(mu_s, mu_k)`` of each surface of the scene.

    Returns
    -------
    dict of str to ndarray
        ``slope_at_rest`` and ``slope_beyond``, s/m. For laws with several regions ``edges``, their bounds in ascending
        order, and ``thresholds``, the speeds of the switches; m/s. For laws with a stiction band ``band``, m/s, and
        ``in_band``, the number of regions within it.

    Raises
    ------
    FormulaError
        If the formula has no value at rest, or another one than its kind needs.
    """
    table = np.stack([*columns.values(), *(column for surface in surfaces for column in surface)], axis=1)
    rows, cell_row = _distinct(table)
    found_columns = {name: rows[:, k] for k, name in enumerate(columns)}
    pairs = rows[:, len(columns) :].reshape(len(rows), -1, 2)
    found = _Finder(expression, found_columns, [(pairs[:, i, 0], pairs[:, i, 1]) for i in range(pairs.shape[1])])
    return {name: np.ascontiguousarray(field[cell_row]) for name, field in found.fields().items()}


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
    slopes = abs(curve(np.concatenate([np.linspace(a, b, 33) for a, b in itertools.pairwise(speeds)]), 1))
    found: dict[str, NDArray[Any]] = {"pieces": np.broadcast_to(pieces, (cells, *pieces.shape))}
    if mu[0] > 0.0:
        jump = np.where(scale > 0.0, np.inf, 0.0)
        return found | {"slope_at_rest": jump, "slope_beyond": jump}
    # Friction grows up to its first maximum.
    falls = np.flatnonzero(np.diff(mu) <= 0.0)
    top = int(falls[0]) if len(falls) else len(mu) - 1
    return found | {
        "slope_at_rest": scale * abs(curve(0.0, 1)),
        "slope_beyond": scale * (slopes[33 * top :].max() if top + 1 < len(mu) else 0.0),
        "band": np.full(cells, speeds[top]),
        "in_band": np.full(cells, top),
    }


def _distinct(table: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Distinct rows, and for each row its place among them."""
    if (table == table[0]).all():
        return table[:1], np.zeros(len(table), dtype=np.intp)
    rows, place = np.unique(table, axis=0, return_inverse=True)
    return rows, place.reshape(-1)


class _Finder:
    """Finds the speeds of one expression for several sets of parameters at once."""

    def __init__(self, expression: Expression, columns: _Columns, surfaces: list[_Surface]) -> None:
        self.expression = expression
        self.rows = len(surfaces[0][0])
        self.values = [{**columns, "mu_s": mu_s, "mu_k": mu_k} for mu_s, mu_k in surfaces]
        self.thresholds: list[NDArray[np.float64]] = []

    def fields(self) -> dict[str, NDArray[Any]]:
        for threshold in self.expression.thresholds:
            self.thresholds.append(self._clipped(threshold, self._speed_of(threshold)))
        self._check_rest()
        found: dict[str, NDArray[Any]] = {}
        edges = list(self.thresholds)
        if self.expression.has_band:
            found["band"] = self._band()
            edges.append(found["band"])
        if self.expression.has_edges:
            found["edges"] = _sorted_edges(edges)
            if self.thresholds:
                found["thresholds"] = np.stack(self.thresholds, axis=1)
        if self.expression.has_band:
            found["in_band"] = (found["edges"] < found["band"][:, None]).sum(axis=1) + 1
        found["slope_at_rest"], found["slope_beyond"] = self._slopes(found)
        return found

    def at(self, node: Node, speed: Any, values: _Columns) -> NDArray[np.float64]:
        """Value of a node at speeds of shape ``(rows,)`` or ``(rows, speeds)``."""
        speed = np.asarray(speed)
        if speed.ndim == 1:
            return np.broadcast_to(evaluate(node, speed, values, self.thresholds), speed.shape)
        wide = {name: column[:, None] for name, column in values.items()}
        return np.broadcast_to(
            evaluate(node, speed, wide, [threshold[:, None] for threshold in self.thresholds]), speed.shape
        )

    def on_grid(self, node: Node, values: _Columns) -> NDArray[np.float64]:
        """Value of a node on the grid, shape ``(rows, speeds)``."""
        return self.at(node, np.broadcast_to(_GRID, (self.rows, len(_GRID))), values)

    def _speed_of(self, threshold: Threshold) -> NDArray[np.float64]:
        found = [self._speed_on(threshold, values) for values in self.values]
        if threshold.kind == "tail":
            return np.max(found, axis=0)
        if threshold.kind == "valid":
            return np.min(found, axis=0)
        for other in found[1:]:
            if not np.allclose(other, found[0], rtol=1e-12, atol=0.0):
                raise FormulaError(
                    "it switches at a speed that depends on mu_s or mu_k, which differ by zone: "
                    "write the speed as a parameter of its own"
                )
        return found[0]

    def _speed_on(self, threshold: Threshold, values: _Columns) -> NDArray[np.float64]:
        if threshold.at is not None:
            found = self.at(threshold.at, np.zeros(self.rows), values)
            if np.isnan(found).any():
                raise FormulaError("the speed at which it switches is not a number")
            return found
        assert threshold.difference is not None
        if threshold.kind == "tail":
            return self._tail(threshold.difference, threshold.order, values)
        if threshold.kind == "valid":
            return self._first_invalid(threshold.difference, values)
        return self._root(threshold.difference, threshold.order, values)

    def _clipped(self, threshold: Threshold, speed: NDArray[np.float64]) -> NDArray[np.float64]:
        for index, lower in threshold.within:
            speed = np.minimum(speed, self.thresholds[index]) if lower else np.maximum(speed, self.thresholds[index])
        return speed

    def _root(self, difference: Node, order: int, values: _Columns) -> NDArray[np.float64]:
        """Speed at which a difference changes its sign; order 0 is 0 if it is positive at first."""
        signs = self.on_grid(difference, values) > 0.0
        # At rest the sign is that just above rest.
        signs[:, 0] = signs[:, 1]
        changes = signs[:, 1:] != signs[:, :-1]
        if (changes.sum(axis=1) + signs[:, 0] > 3).any():
            raise FormulaError("min, max or abs switch more than three times: write piecewise")
        found, wanted = np.full(self.rows, np.inf), order - signs[:, 0]
        found[wanted < 0] = 0.0
        # Number of changes up to each speed of the grid.
        place = (np.cumsum(changes, axis=1) <= wanted[:, None]).sum(axis=1)
        rows = np.flatnonzero((wanted >= 0) & (place < changes.shape[1]))
        found[rows] = self._bisect(difference, values, rows, _GRID[place[rows]], _GRID[place[rows] + 1])
        return found

    def _bisect(
        self, node: Node, values: _Columns, rows: NDArray[np.intp], low: NDArray[Any], high: NDArray[Any]
    ) -> NDArray[np.float64]:
        """Speeds between two speeds at which the sign of a node changes, in some of the rows."""
        own = {name: column[rows] for name, column in values.items()}
        thresholds = [threshold[rows] for threshold in self.thresholds]
        positive = evaluate(node, high, own, thresholds) > 0.0
        while True:
            middle = 0.5 * (low + high)
            if not ((low < middle) & (middle < high)).any():
                return high
            same = (evaluate(node, middle, own, thresholds) > 0.0) == positive
            low, high = np.where(same, low, middle), np.where(same, middle, high)

    def _tail(self, exponent: Node, scale: int, values: _Columns) -> NDArray[np.float64]:
        """Speed beyond which ``exp(-scale * exponent)`` is negligible.

        The rest of it changes a sliding velocity by less than 1e-17 m/s.
        """
        rate = derivative(exponent)
        if not rate.varies:
            offset, slope = (self.at(node, np.zeros(self.rows), values) for node in (exponent, rate))
            with np.errstate(all="ignore"):
                found = (_reach(scale * slope) / scale - offset) / slope
            return np.where(slope > 0.0, np.maximum(found, 0.0), np.inf)
        on_grid, rates = self.on_grid(exponent, values), self.on_grid(rate, values)
        with np.errstate(invalid="ignore"):
            short = ~(scale * on_grid > _reach(scale * rates))
        # The first speed from which the exponent has grown once and for all.
        last = np.where(short.any(axis=1), short.shape[1] - short[:, ::-1].argmax(axis=1), 0)
        return np.append(_GRID, np.inf)[last]

    def _first_invalid(self, mu: Node, values: _Columns) -> NDArray[np.float64]:
        """First speed at which friction is negative or no number."""
        grid = self.on_grid(mu, values)
        with np.errstate(invalid="ignore"):
            invalid = ~((grid >= -_ROUNDING) & (grid < np.inf))
        found = np.full(self.rows, np.inf)
        rows = np.flatnonzero(invalid.any(axis=1))
        place = invalid[rows].argmax(axis=1)
        if (place == 0).any():
            value = grid[rows[place == 0][0], 0]
            raise FormulaError(f"at rest it gives {value:.6g}: a friction coefficient is a number and not negative")
        found[rows] = _GRID[place - 1]
        # A pole is not bisected: friction is positive on both sides.
        bounded = grid[rows, place] != np.inf
        rows, place = rows[bounded], place[bounded]
        found[rows] = self._bisect(mu, values, rows, _GRID[place - 1], _GRID[place])
        return found

    def _check_rest(self) -> None:
        """Check values at rest, and that the law has a power series there."""
        for values in self.values:
            at_rest = self.at(self.expression.mu, np.zeros(self.rows), values)
            for node in nodes_of(self.expression.mu):
                if node.varies and node.kind in ("sqrt", "log", "power"):
                    inner = self.at(node.parts[0], np.zeros(self.rows), values)
                    if (inner == 0.0).any():
                        raise FormulaError(
                            "a root, a power or a logarithm of something that vanishes at rest has no power series "
                            "there: take a whole exponent, or add a small constant"
                        )
            if self.expression.set_valued:
                excess = at_rest > values["mu_s"] * (1.0 + _ROUNDING) + _ROUNDING
                if excess.any():
                    raise FormulaError(
                        f"it begins to slip with friction {at_rest[excess][0]:.6g}, more than the "
                        f"{values['mu_s'][excess][0]:.6g} that it has at rest"
                    )
            elif (abs(at_rest) > 1e-9).any():
                raise FormulaError(
                    "without at_rest friction must vanish at v = 0, where it is "
                    f"{at_rest[abs(at_rest) > 1e-9][0]:.6g}: "
                    "give `at_rest: mu_s` for friction that holds up to mu_s at rest",
                    "at_rest",
                )

    def _band(self) -> NDArray[np.float64]:
        if self.expression.band is not None:
            return self.at(self.expression.band, np.zeros(self.rows), self.values[0])
        slope = derivative(self.expression.mu)
        found = []
        for values in self.values:
            slopes = self.on_grid(slope, values)
            steepest = np.maximum.accumulate(slopes, axis=1)
            flat = (slopes <= _FLAT * steepest) & (steepest > 0.0)
            first = np.where(flat.any(axis=1), flat.argmax(axis=1), len(_GRID) - 1)
            found.append(_GRID[first])
        return np.max(found, axis=0)

    def _slopes(self, found: Mapping[str, NDArray[Any]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Steepest slopes at rest and beyond the band, on the roughest surface."""
        rough = np.max([values["mu_s"] for values in self.values], axis=0) > 0.0
        if not self.expression.has_band:
            jump = np.where(rough, np.inf, 0.0)
            return jump, jump
        slope = derivative(self.expression.mu)
        at_rest, beyond = np.zeros(self.rows), np.zeros(self.rows)
        edges, band = found["edges"], found["band"]
        lows = np.concatenate([np.zeros((self.rows, 1)), edges], axis=1)
        highs = np.concatenate([edges, np.full((self.rows, 1), np.inf)], axis=1)
        with np.errstate(invalid="ignore", over="ignore"):
            shares = np.linspace(0.0, 1.0, 64, endpoint=False)
            inside = np.where(np.isfinite(highs), highs, 1e3 * np.maximum(lows, band[:, None]))[:, :, None]
            speeds = (lows[:, :, None] + shares * (inside - lows[:, :, None])).reshape(self.rows, -1)
        speeds = np.where(np.isfinite(speeds), speeds, band[:, None])
        for values in self.values:
            if not self.expression.set_valued:
                at_rest = np.fmax(at_rest, abs(self.at(slope, np.zeros(self.rows), values)))
            steep = np.where(speeds >= band[:, None], abs(self.at(slope, speeds, values)), 0.0)
            beyond = np.fmax(beyond, np.nanmax(steep, axis=1))
        return at_rest, beyond


def _reach(rate: Any) -> Any:
    """Exponent from which an exponential that decays at a rate, s/m, is negligible."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.clip(39.1 - np.log(rate), 10.0, 40.0)


def _sorted_edges(edges: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Distinct positive edges of each row in ascending order, then infinity."""
    found = np.sort(np.stack(edges, axis=1), axis=1)
    found[found <= 0.0] = np.inf
    found = np.sort(found, axis=1)
    found[:, 1:][found[:, 1:] == found[:, :-1]] = np.inf
    return np.sort(found, axis=1)
