"""Warnings about the results of a sweep or of a single run."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.compile import take
from ringsweep.config import Config
from ringsweep.config.axes import by_law, laws_at, values_at
from ringsweep.models import batch
from ringsweep.physics import drives, ring, zones
from ringsweep.physics.drives import Constant
from ringsweep.quantities.flags import FAILED, JAMMED, REGIMES, RIDING, SEPARATING
from ringsweep.quantities.quantity import after_number
from ringsweep.quantities.units import rounded_up
from ringsweep.quantities.variables import INFERRED
from ringsweep.solvers.automaton import PATIENCE
from ringsweep.solvers.rk4 import STABILITY_LIMIT
from ringsweep.storage.chunks import Layout, parts

# Least number of cells of which it is surprising that all have one regime, and of values that change nothing.
_MAP, _ALONG = 16, 3

# Most cells of which it is asked whether a contact met a zone, and instants at which the ring is looked at.
_CELLS, _INSTANTS = 64, 1000

logger = logging.getLogger("ringsweep")

# Share of runs without certificate that is worth a warning.
_MANY_UNSURE = 0.01


def warn_of_results(results: xr.Dataset, config: Config) -> None:
    """Warn of steps beyond the limit of stability, of motions that have not settled, and of runs that end at t = 0.

    Parameters
    ----------
    results : xarray.Dataset
        Outcomes of all cells, in memory or on disk. They are read chunk by chunk.
    config : Config
        Configuration of the runs.
    """
    ended_at_start = unstable = 0
    count = results["t_end"].size
    if "regime" in results:
        _hint_at_one_word(results, config)
    largest = 0.0
    for ended, stiffness, origin in parts(results, "t_end", "stiffness", "origin"):
        inferred = origin == INFERRED
        count -= int(np.count_nonzero(inferred))
        ended_at_start += int(np.count_nonzero(ended == 0.0))
        if stiffness is not None:
            # NaN is not within the limit either.
            beyond = stiffness[~((stiffness <= STABILITY_LIMIT) | inferred)]
            unstable += beyond.size
            # Unlike max(), this keeps NaN.
            largest = float(np.maximum(largest, beyond.max(initial=0.0)))
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
    if "settled" in results:
        _warn_of_long_runs(results, config, count)
    if "regime" in results:
        _warn_of_failures(results, config)
        _hint_at_idle_axes(results)
        _hint_at_zone_never_met(results, config)
    if ended_at_start > 0.5 * count:
        runs = "the run ends" if count == 1 else f"{ended_at_start / count:.0%} of the runs end"
        logger.warning("%s at t = 0: is a unit or the initial state wrong?", runs)


def _hint_at_one_word(results: xr.Dataset, config: Config) -> None:
    """Say what to look at where one word fills a map: its axes may not reach what decides."""
    size = results["regime"].size
    if size < _MAP:
        return
    found: set[int] = set()
    for (regime,) in parts(results, "regime"):
        found.update(np.unique(regime).tolist())
        if len(found) > 1:
            return
    zones = any(structure.arcs for structure in config.scene.structures.values())
    logger.info(
        "all %d cells are %s: do the axes reach far enough, is the span long enough%s? "
        "ringsweep simulate shows one run",
        size,
        REGIMES[found.pop()],
        ", does a contact meet the zone" if zones else "",
    )


def _warn_of_failures(results: xr.Dataset, config: Config) -> None:
    """Name the first run that failed, and say why."""
    regime, start, failed = results.variables["regime"], 0, np.empty(0, dtype=np.intp)
    for (part,) in parts(results, "regime"):
        failed = np.append(failed, start + np.flatnonzero(part == FAILED))
        start += part.size
    if not len(failed):
        return
    first = Layout(regime.shape).indices(failed[:1])
    one = results.isel({dim: int(k[0]) for dim, k in zip(regime.dims, first, strict=True)})
    steps = int(one["steps"]) if "steps" in one else 0
    finite = all(np.isfinite(float(one[name])) for name in ("phi_end", "omega_end", "velocity_end") if name in one)
    other = "another" if hasattr(config.solver, "rtol") else "solver.method event with another"
    why = "a number was not finite"
    if steps >= min(PATIENCE, getattr(config.solver, "max_steps", PATIENCE)):
        span = float(one["time_span"]) if "time_span" in one.coords else config.scene.values.get("time.span", np.nan)
        why = (
            f"it was given up after {steps} steps at t = {float(one['t_end']):.6g} s of {span:.6g} s, "
            "as events go on: a shorter time.span has a result"
        )
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


def _hint_at_zone_never_met(results: xr.Dataset, config: Config) -> None:
    """Say that no contact came to a zone, if the ranges of body and ring exclude it in cells spread over the grid."""
    regime = results.variables["regime"]
    draw = np.random.default_rng(0)
    drawn = np.arange(regime.size) if regime.size <= _CELLS else np.sort(draw.integers(regime.size, size=_CELLS))
    if not all(_misses_zones(results, config, np.unravel_index(k, regime.shape)) for k in drawn):
        return
    who = "the run" if regime.size == 1 else "any cell"
    if regime.size > _CELLS:
        who = f"{len(drawn)} of {regime.size} cells"
    logger.info("no contact meets a zone in %s: zone.center is the angle from the bottom of the ring", who)


def _misses_zones(results: xr.Dataset, config: Config, cell: tuple[np.intp, ...]) -> bool:
    """Whether no contact of a cell can have met a zone."""
    scene, axes = config.scene, config.axes
    indices = dict(zip(axes.sizes, np.atleast_2d(np.array(cell)).T, strict=False))
    structure = scene.structures[str(laws_at(scene, axes, indices, 1)[0])]
    one = take(batch(structure, values_at(scene, axes, indices, 1)), 0)
    if not isinstance(getattr(one, "surface", None), zones.Segments):
        return False
    end, low, high = (float(results.variables[name][cell].values) for name in ("t_end", "phi_min", "phi_max"))
    # Multiples of the golden ratio meet no period of a drive again and again.
    instants = end * (np.arange(_INSTANTS) * 0.6180339887498949 % 1.0)
    # A few of them mostly show that a contact may have met the zone.
    for some in (instants[:4], instants):
        theta = [drives.turn(one.drive, t)[0] for t in some]
        margin = 0.01 * (max(theta) - min(theta))
        width = high - low + max(theta) - min(theta) + 2.0 * margin
        for side in (-1.0, 1.0):
            first = low + side * ring.contact_offset(one.body) - max(theta) - margin
            at = one.surface.arc[zones.segment(one.surface, first)]
            # NaN, of a cell that was not run, says nothing.
            if at or not np.all((one.surface.edges - first) % (2.0 * np.pi) > width):
                return False
    return True


def _is_idle(column: xr.Variable, dim: str) -> bool:
    """Whether each value is the first one along a dimension."""
    for _, _, region in Layout(column.shape).chunks():
        values = column[region].values
        first = column[
            tuple(slice(0, 1) if name == dim else part for name, part in zip(column.dims, region, strict=True))
        ]
        if not ((values == first.values) | (values != values) & (first.values != first.values)).all():
            return False
    return True


def _warn_of_long_runs(results: xr.Dataset, config: Config, count: int) -> None:
    """Warn of motions that have not settled, and of bodies that have not broken loose.

    `count` is the number of cells that were run. No others have a value of `settled`.
    """
    size = results["regime"].size
    layout = Layout(results["regime"].shape)
    unsettled = riding = start = 0
    soonest, latest = np.inf, 0.0
    for regime, settled, ended in parts(results, "regime", "settled", "t_end"):
        goes_on = ~np.isin(regime, (RIDING, FAILED, SEPARATING, JAMMED))
        unsettled += int(np.count_nonzero((settled == 0) & goes_on))
        if len(rides := np.flatnonzero(regime == RIDING)):
            riding += len(rides)
            spans = _spans_of_first_slip(config, layout.indices(start + rides), len(rides))
            spans = spans[np.isfinite(spans) & (spans > ended.flat[rides])]
            soonest, latest = min(soonest, spans.min(initial=np.inf)), max(latest, spans.max(initial=0.0))
        start += regime.size
    if unsettled:
        who = "the motion has" if size == 1 else f"{unsettled / count:.1%} of the motions have"
        what = "regime, share of stick and stops" if "stick_share" in results else "what it settles to"
        logger.warning("%s not settled: a longer span may change %s", who, what)
    if riding:
        remedy = "what pulls them does not reach breakaway"
        if latest > 0.0:
            remedy = f"the first slip, at k v t = mu_s F_N, needs a span of more than {soonest:.5g} s"
            remedy += f" to {latest:.5g} s" if latest > 1.01 * soonest else ""
        several = f"{riding / size:.1%} of the bodies ride: they have"
        who = "the body rides: it has" if size == 1 else several
        logger.warning("%s not broken loose; %s", who, remedy)


def warn_of_sample(results: xr.Dataset, config: Config) -> None:
    """Warn of runs of a sample that failed or have no certificate.

    Parameters
    ----------
    results : xarray.Dataset
        Statistics of all cells, in memory or on disk.
    config : Config
        Configuration of the runs.
    """
    runs = results["runs"].sum([dim for dim in results["runs"].dims if dim not in ("word", "certificate")]).values
    share, failed = runs[:, 0].sum() / runs.sum(), int(runs[FAILED].sum())
    if share > _MANY_UNSURE:
        cure = "" if config.certifies else ": the solver does not certify"
        logger.warning("%.1f %% of the runs have no certificate, and widen the intervals%s", 100 * share, cure)
    if failed:
        logger.warning("%d runs failed", failed)


def _spans_of_first_slip(config: Config, cells: Sequence[NDArray[np.intp]], count: int) -> NDArray[np.float64]:
    """Times at which bodies that ride on belts of constant velocity would slip, s; otherwise infinite.

    They are for a linear spring and a damper, and for no force.

    `cells` are indices along each dimension, shape ``(cells, dimensions)``; None for a single run.
    """
    scene, axes = config.scene, config.axes
    indices = dict(zip(axes.sizes, cells, strict=True))
    spans = np.full(count, np.inf)
    for structure, own in by_law(scene, axes, indices, count):
        body = batch(structure, values_at(scene, axes, {dim: along[own] for dim, along in indices.items()}, len(own)))
        if isinstance(body.drive, Constant):
            velocity = body.drive.amplitude
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                parts, ahead = body.body, np.sign(velocity)
                load = body.mu_s * parts.mass * parts.gravity - getattr(parts, "damping", 0.0) * np.abs(velocity)
                stiffness = parts.stiffness - ahead * body.mu_s * getattr(parts, "normal_stiffness", 0.0)
                holds = load / stiffness - ahead * body.initial_x
                spans[own] = np.where((velocity != 0.0) & (stiffness > 0.0), holds / np.abs(velocity), np.inf)
    return spans
