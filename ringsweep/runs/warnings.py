"""Warnings about the results of a sweep or of a single run."""

from __future__ import annotations

import logging

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.config import Config
from ringsweep.config.axes import by_law
from ringsweep.models import model_of
from ringsweep.models.cycles import POSITIVE, ZERO
from ringsweep.models.model import Continues
from ringsweep.quantities.flags import FAILED, JAMMED, REGIMES, RIDING, SEPARATING
from ringsweep.quantities.quantity import after_number
from ringsweep.quantities.units import rounded_up
from ringsweep.quantities.variables import INFERRED
from ringsweep.solvers.automaton import PATIENCE
from ringsweep.solvers.rk4 import STABILITY_LIMIT
from ringsweep.storage.chunks import Layout, parts

# Least number of cells of which it is surprising that all have one regime, and of values that change nothing.
_MAP, _ALONG = 16, 3

# Regimes of runs that have not begun to settle, or ended before they could.
_ENDED = (RIDING, FAILED, SEPARATING, JAMMED)

logger = logging.getLogger("ringsweep")


def warn_of_results(results: xr.Dataset, config: Config, *, counted: bool = False) -> None:
    """Warn of steps beyond the limit of stability, of motions that have not settled, and of runs that end at t = 0.

    Parameters
    ----------
    results : xarray.Dataset
        Outcomes of all cells, in memory or on disk. They are read chunk by chunk.
    config : Config
        Configuration of the runs.
    counted : bool
        Whether the caller says how many runs have each regime: then nothing is said of one that all have.
    """
    size = count = results["t_end"].size
    ended_at_start = unstable = unsettled = start = 0
    largest, failed, cells = 0.0, np.empty(0, dtype=np.intp), np.zeros(len(REGIMES), dtype=np.intp)
    names = ("t_end", "stiffness", "origin", "regime", "settled")
    for ended, stiffness, origin, regime, settled in parts(results, *names):
        inferred = origin == INFERRED
        count -= int(np.count_nonzero(inferred))
        ended_at_start += int(np.count_nonzero(ended == 0.0))
        if stiffness is not None:
            # NaN is not within the limit either.
            beyond = stiffness[~((stiffness <= STABILITY_LIMIT) | inferred)]
            unstable += beyond.size
            # Unlike max(), this keeps NaN.
            largest = float(np.maximum(largest, beyond.max(initial=0.0)))
        if regime is not None:
            cells += np.bincount(regime.ravel(), minlength=len(REGIMES))
            failed = np.append(failed, start + np.flatnonzero(regime == FAILED))
            start += regime.size
        if settled is not None:
            unsettled += int(np.count_nonzero((settled == 0) & ~np.isin(regime, _ENDED)))
    # Of a sweep with sections one looks at these.
    if size >= _MAP and np.count_nonzero(cells) == 1 and "section" not in results.dims and not counted:
        zones = any(one.arcs and one.model != "belt" for one in config.scene.structures.values())
        where = ", does a contact meet the zone (zone.center counts from the bottom of the ring)" * zones
        why = "do the axes reach far enough, is the span long enough"
        regime = REGIMES[int(cells.argmax())]
        logger.info("all %d cells are %s: %s%s? ringsweep simulate shows one run", size, regime, why, where)
    if unstable:
        if np.isfinite(largest):
            steps = config.solver.steps * largest / STABILITY_LIMIT
            remedy = f"about {rounded_up(steps):.2g} steps are needed"
        else:
            remedy = "no step is small enough for a friction law that jumps"
        logger.warning(
            "%.1f %% of the cells exceed the limit of stability of rk4 (stiffness above %.4g), "
            "and their regimes may be wrong: %s; solver auto has no such limit",
            100.0 * unstable / count,
            STABILITY_LIMIT,
            remedy,
        )
    if unsettled:
        who = "the motion has" if size == 1 else f"{unsettled / count:.1%} of the motions have"
        what = "regime, share of stick and stops" if "stick_share" in results else "what it settles to"
        logger.warning("%s not settled: a longer span may change %s%s", who, what, _hint_at_a_torus(results, config))
    if riding := cells[RIDING]:
        who = "the body rides: it has" if size == 1 else f"{riding / size:.1%} of the bodies ride: they have"
        why = "the pull does not reach mu_s F_N within the span (a spring on a steady belt pulls with k v t)"
        logger.warning("%s not broken loose; %s", who, why)
    if len(failed):
        _warn_of_failures(results, config, failed)
    if "regime" in results:
        _hint_at_idle_axes(results)
    if ended_at_start > 0.5 * count:
        runs = "the run ends" if count == 1 else f"{ended_at_start / count:.0%} of the runs end"
        logger.warning("%s at t = 0: is a unit or the initial state wrong?", runs)


def _hint_at_a_torus(results: xr.Dataset, config: Config) -> str:
    """In which span exponents that may be 0 would be known well enough: their errors fall as the span grows."""
    scene, axes, needed, start = config.scene, config.axes, [], 0
    layout = Layout(results["regime"].shape)
    names = ("regime", "settled", "t_end", "lyapunov", "lyapunov_error")
    for regime, settled, ended, rate, error in parts(results, *names) if "lyapunov" in results else ():
        known = (settled == 0) & ~np.isin(regime, _ENDED) & (abs(rate) <= POSITIVE * error)
        cells = np.flatnonzero(known)
        indices = dict(zip(axes.sizes, layout.indices(start + cells), strict=True))
        start += regime.size
        for structure, own, values in by_law(scene, axes, indices, len(cells)):
            model = model_of(structure)
            assert isinstance(model, Continues)
            change = (abs(rate) + POSITIVE * error).flat[cells[own]] * model.forcing_period(structure, values)
            # Where the error is small enough already, something else is not settled.
            needed.append((change / ZERO * ended.flat[cells[own]])[change > ZERO])
    spans = np.concatenate([*needed, []])
    if not np.isfinite(spans).any():
        return ""
    half, every = (f"{rounded_up(share(spans[np.isfinite(spans)])):.2g} s" for share in (np.median, np.max))
    return f"; to show an exponent of 0, that of a torus, takes about {half}" + (
        f" to {every}" if len(spans) > 1 else ""
    )


def _warn_of_failures(results: xr.Dataset, config: Config, failed: NDArray[np.intp]) -> None:
    """Name the first run that failed, and say why; `failed` are positions of such runs."""
    regime = results.variables["regime"]
    first = Layout(regime.shape).indices(failed[:1])
    one = results.isel({dim: int(k[0]) for dim, k in zip(regime.dims, first, strict=True)})
    steps = int(one["steps"]) if "steps" in one else 0
    finite = all(np.isfinite(float(one[name])) for name in ("phi_end", "omega_end", "velocity_end") if name in one)
    other = "another" if hasattr(config.solver, "rtol") else "solver.method event with another"
    why = "a number was not finite"
    if steps >= min(PATIENCE, getattr(config.solver, "max_steps", PATIENCE)):
        span = float(one["time_span"]) if "time_span" in one.coords else config.scene.values.get("time.span", np.nan)
        why = f"it was given up after {steps} steps at t = {float(one['t_end']):.6g} s of {span:.6g} s"
        why += ", as events go on: a shorter time.span has a result"
    elif any(structure.own_law for structure in config.scene.structures.values()):
        why = "its friction law may be negative, or no number, at a sliding speed that the body reached"
        why += f"; if it is not, {other} rtol may have a result" if finite else ""
    elif finite:
        why = f"no step succeeds at t = {float(one['t_end']):.6g} s; {other} rtol may have a result"
    who = "the run has failed"
    if regime.size > 1:
        at = ", ".join(f"{name} = {_value(axis)}" for name, axis in one.coords.items() if "path" in axis.attrs)
        who = f"{len(failed)} of {regime.size} runs have failed; the first at {at}"
    logger.warning("%s: %s", who, why)


def _value(axis: xr.DataArray) -> str:
    if axis.dtype.kind not in "iuf":
        return str(axis.item())
    return f"{axis.item():g}{after_number(axis.attrs.get('units', '1'))}"


def _hint_at_idle_axes(results: xr.Dataset) -> None:
    """Say which axes change no number of any cell."""
    columns = [results.variables[name] for name in results.data_vars if name != "steps"]
    for dim in map(str, results["regime"].dims):
        if "origin" in results or results.sizes[dim] < _ALONG or not all(_is_idle(one, dim) for one in columns):
            continue
        why = ": no contact meets an edge of the zone, or friction is alike on both sides" if "zone" in dim else ""
        logger.info("no number depends on %s%s", dim, why)


def _is_idle(column: xr.Variable, dim: str) -> bool:
    """Whether each value is the first one along a dimension. A file is read in chunks, up to the first that differs."""
    for _, _, region in Layout(column.shape).chunks():
        first = tuple(slice(1) if name == dim else part for name, part in zip(column.dims, region, strict=True))
        values, expected = np.broadcast_arrays(column[region].values, column[first].values)
        if not np.array_equal(values, expected, equal_nan=column.dtype.kind == "f"):
            return False
    return True
