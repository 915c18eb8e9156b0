"""Statistics of uncertain parameters: distributions, points, intervals of shares and quantiles, Sobol indices.

Pure functions of numbers: nothing here knows scenes, solvers or files. Samples come in replicates. The replicates of a
design are independent of each other, so their scatter tells the error of their mean, whatever the points within a
replicate have to do with each other (A. B. Owen, Practical Quasi-Monte Carlo Integration, 2023, ch. 17).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Confidence of all intervals.
CONFIDENCE = 0.95

#: Methods of :func:`unit_points`.
METHODS = ("sobol", "latin-hypercube", "random")


# Distributions


#: What the numbers of each distribution mean, by its name. Mean and deviation are those of the number itself.
DISTRIBUTIONS = {
    "normal": ("mean", "standard deviation"),
    "uniform": ("least value", "greatest value"),
    "lognormal": ("mean", "standard deviation"),
    "truncnormal": ("mean", "standard deviation", "least value", "greatest value"),
    "triangular": ("least value", "mode", "greatest value"),
}


@lru_cache(maxsize=64)
def distribution(kind: str, *numbers: float) -> Any:
    """A distribution of :data:`DISTRIBUTIONS` as SciPy has it: made once, since SciPy writes its documentation too."""
    # It is slow to import, and only samples need it.
    from scipy import stats

    # Of NumPy, so that a division by zero is no exception.
    first, second, *ends = map(np.float64, numbers)
    match kind:
        case "normal":
            return stats.norm(first, second)
        case "uniform":
            return stats.uniform(first, second - first)
        case "lognormal":
            variance = np.log1p((second / first) ** 2)
            return stats.lognorm(np.sqrt(variance), scale=first * np.exp(-0.5 * variance))
        case "truncnormal":
            return stats.truncnorm(*((np.array(ends) - first) / second), first, second)
    return stats.triang((second - first) / (ends[0] - first), first, ends[0] - first)


# Designs


def unit_points(method: str, count: int, dimension: int, seed: int, replicate: int) -> Floats:
    """Points of one replicate in the unit cube, none of them on its faces.

    The first points of a longer replicate are those of a shorter one, but for Latin hypercubes.

    Parameters
    ----------
    method : {"sobol", "latin-hypercube", "random"}
        Scrambled Sobol points, a Latin hypercube, or independent points.
    count, dimension : int
    seed, replicate : int
        Replicates of one seed are independent of each other.

    Returns
    -------
    ndarray of shape ``(count, dimension)``
    """
    random = np.random.default_rng([seed, replicate])
    if method == "random":
        points = random.random((count, dimension))
    else:
        # It is slow to import, and only samples need it.
        from scipy.stats import qmc

        if method == "sobol":
            sequence = qmc.Sobol(dimension, seed=random)
            # Points are multiples of 2^-30: half of that moves them away from 0.
            points = sequence.random_base2(int(count).bit_length() - 1) + 2.0**-31
        else:
            points = qmc.LatinHypercube(dimension, seed=random).random(count)
    return np.clip(points, 2.0**-53, 1.0 - 2.0**-53)


def saltelli(points: Floats) -> Floats:
    """Saltelli's design for first and total Sobol indices.

    Parameters
    ----------
    points : ndarray of shape ``(count, 2 * parameters)``
        The matrices A and B side by side.

    Returns
    -------
    ndarray of shape ``(count, parameters + 2, parameters)``
        Rows of A, of A with one column from B for each parameter, and of B: the order of SALib.
    """
    parameters = points.shape[1] // 2
    a, b = points[:, :parameters], points[:, parameters:]
    mixed = np.repeat(a[:, None, :], parameters, axis=1)
    own = np.arange(parameters)
    mixed[:, own, own] = b
    return np.concatenate([a[:, None], mixed, b[:, None]], axis=1)


# Shares


def clopper_pearson(hits: Any, runs: Any) -> tuple[Floats, Floats]:
    """Two-sided interval of Clopper and Pearson (1934) for a probability; `hits` and `runs` need not be whole."""
    hits, runs = np.broadcast_arrays(np.asarray(hits, dtype=float), np.asarray(runs, dtype=float))
    tail = 0.5 * (1.0 - CONFIDENCE)
    missed = np.maximum(runs - hits, 0.0)
    # SciPy is slow to import, and every command reads this module.
    from scipy.special import betaincinv

    low = np.where(hits > 0.0, betaincinv(np.maximum(hits, 1e-300), missed + 1.0, tail), 0.0)
    high = np.where(missed > 0.0, betaincinv(hits + 1.0, np.maximum(missed, 1e-300), 1.0 - tail), 1.0)
    return low, high


def share_interval(hits: NDArray[Any], size: int, independent: bool) -> tuple[Floats, Floats]:
    """95 % interval of a probability from the hits of each replicate.

    Independent runs: Clopper and Pearson. Otherwise the same with an effective number of runs, from the scatter of the
    replicates (E. L. Korn, B. I. Graubard, Survey Methodology 24, 1998, p. 193): the scatter is taken as one hit in one
    replicate at least, since equal whole numbers do not mean equal shares.

    Parameters
    ----------
    hits : ndarray of int, shape ``(..., replicates)``
    size : int
        Runs of each replicate.
    independent : bool
        Whether all runs are independent of each other.

    Returns
    -------
    low, high : ndarray of shape ``(...)``
    """
    replicates = hits.shape[-1]
    runs = float(replicates * size)
    total = hits.sum(axis=-1).astype(float)
    if independent:
        return clopper_pearson(total, runs)
    share = total / runs
    scatter = np.maximum(hits.var(axis=-1, ddof=1), 1.0 / replicates) / replicates / size**2
    effective = share * (1.0 - share) / scatter * (_student(runs - 1.0) / _student(replicates - 1.0)) ** 2
    effective = np.where((total == 0.0) | (total == runs), runs, effective)
    return clopper_pearson(share * effective, effective)


def _student(freedom: float) -> float:
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + 0.5 * CONFIDENCE))


# Quantiles


def quantiles(
    values: Floats, levels: NDArray[Any] | tuple[float, ...], independent: bool
) -> tuple[Floats, Floats, Floats]:
    """Quantiles of a number with 95 % intervals, from its values in each replicate.

    The interval of a quantile holds the numbers x at which the interval of the probability to be at most x holds the
    level. Runs whose number is not known count both ways: as the least and as the greatest number.

    Parameters
    ----------
    values : ndarray of shape ``(replicates, runs)``
        NaN is not known; infinite numbers are allowed.
    levels : sequence of float
    independent : bool
        As for :func:`share_interval`.

    Returns
    -------
    value, low, high : ndarray of shape ``(levels,)``
        Infinite where the sample does not bound them, and NaN where no number is known.
    """
    size, unknown = values.shape[1], np.isnan(values).sum(axis=1)
    numbers = np.unique(values[~np.isnan(values)])
    if not len(numbers):
        return np.full(len(levels), np.nan), np.full(len(levels), -np.inf), np.full(len(levels), np.inf)
    # Runs of each replicate at most at each number; NaN is sorted behind all numbers.
    ranks = np.stack([np.searchsorted(np.sort(row), numbers, side="right") for row in values], axis=-1)
    below = ranks.sum(axis=-1) / (values.size - unknown.sum())
    floor, _ = share_interval(ranks, size, independent)
    _, ceiling = share_interval(ranks + unknown, size, independent)
    # The probability to lie below all numbers that occur is not 0.
    _, before = share_interval(unknown[None, :], size, independent)
    value, low, high = (np.empty(len(levels)) for _ in range(3))
    for k, level in enumerate(levels):
        value[k] = numbers[min(np.searchsorted(below, level * (1.0 - 1e-12)), len(numbers) - 1)]
        low[k] = -np.inf if before[0] >= level else numbers[int(np.argmax(ceiling >= level))]
        enough = floor >= level
        high[k] = numbers[int(np.argmax(enough))] if enough.any() else np.inf
    return value, low, high


# Sensitivity


def sobol_sums(rows: Floats) -> Floats:
    """Sums over the rows of Saltelli's design, from which :func:`sobol_indices` follow. Sums of two parts add up.

    Parameters
    ----------
    rows : ndarray of shape ``(..., count, parameters + 2)``
        Values of a function at the points of :func:`saltelli`.

    Returns
    -------
    ndarray of shape ``(..., 3 + 3 * parameters)``
        The sums of f(A), f(B) and f(A)² + f(B)², then for each parameter those of f(AB), f(B) (f(AB) - f(A)) and
        (f(A) - f(AB))².
    """
    a, b, mixed = rows[..., :1], rows[..., -1:], rows[..., 1:-1]
    own = np.concatenate([a, b, a**2 + b**2], axis=-1).sum(axis=-2)
    each = np.stack([mixed, b * (mixed - a), (a - mixed) ** 2], axis=-1).sum(axis=-3)
    return np.concatenate([own, each.reshape(*own.shape[:-1], -1)], axis=-1)


def sobol_indices(sums: Floats, size: int) -> tuple[Floats, Floats]:
    """First and total Sobol indices with 95 % intervals.

    First indices: A. Saltelli et al., Computer Physics Communications 181, 2010, Table 2 (b), about the mean. Total
    indices: M. J. W. Jansen, 1999, Table 2 (f) there. Intervals come from the jackknife over replicates. If a function
    does not vary in the sample, or is missing (NaN) somewhere, its indices are 0, and as nothing is known of them,
    their intervals are 0 to 1.

    Parameters
    ----------
    sums : ndarray of shape ``(..., replicates, 3 + 3 * parameters)``
        Of :func:`sobol_sums`.
    size : int
        Rows of each replicate.

    Returns
    -------
    first, total : ndarray of shape ``(3, ..., parameters)``
        Index, and the ends of its interval.
    """
    replicates = sums.shape[-2]
    sums = np.where(np.isfinite(sums).all(axis=(-2, -1), keepdims=True), sums, 0.0)
    together = sums.sum(axis=-2, keepdims=True)
    pooled = _indices(together, replicates * size)[..., 0, :, :]
    without = _indices(together - sums, (replicates - 1) * size)
    spread = (replicates - 1) / replicates * ((without - without.mean(axis=-3, keepdims=True)) ** 2).sum(axis=-3)
    half = _student(replicates - 1.0) * np.sqrt(spread)
    known = _variance(together[..., 0, :], replicates * size)[..., None, None] > 0.0
    low = np.where(known, np.clip(pooled - half, 0.0, 1.0), 0.0)
    high = np.where(known, np.clip(pooled + half, 0.0, 1.0), 1.0)
    first, total = np.moveaxis(np.stack([np.clip(pooled, 0.0, 1.0), low, high]), -1, 0)
    return first, total


def _variance(sums: Floats, count: int) -> Floats:
    """Variance of f over A and B together."""
    mean = (sums[..., 0] + sums[..., 1]) / (2 * count)
    variance = sums[..., 2] / (2 * count) - mean**2
    # Below this it is rounding.
    return np.where(variance > 1e-12 * np.abs(sums[..., 2]) / count, variance, 0.0)


def _indices(sums: Floats, count: int) -> Floats:
    """First and total indices along the last axis, shape ``(..., parameters, 2)``; 0 where f does not vary."""
    each = sums[..., 3:].reshape(*sums.shape[:-1], -1, 3)
    mean = ((sums[..., 0] + sums[..., 1]) / (2 * count))[..., None]
    variance = _variance(sums, count)[..., None]
    first = (each[..., 1] - mean * (each[..., 0] - sums[..., :1])) / count
    both = np.stack([first, 0.5 * each[..., 2] / count], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(variance[..., None] > 0.0, both / variance[..., None], 0.0)
