"""Error against run time as text: a table, and the recommended solver for the configuration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from ringsweep.runs.precision import error_bounds


def report(ds: xr.Dataset) -> str:
    """Text of a measurement: a table, and the recommended solver for the configuration.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.precision`.

    Returns
    -------
    str
        Several lines.
    """
    unit = ds["error_end"].attrs["units"]
    separating = "error_separation" in ds and bool(np.isfinite(ds["error_separation"]).any())
    header = ["", "ms per run", "steps", f"median error, {unit}", f"largest, {unit}"]
    header += ["largest of separation, s"] * separating + ["wrong regimes", "wrong but not flagged"]
    lines = []
    for k in range(ds.sizes["contender"]):
        one = ds.isel(contender=k)
        end, wrong = one["error_end"].values, one["regime_wrong"].values == 1
        silent = one["flagged"].values[wrong] == 0
        line = [f"{one['method'].item()}, {one['setting'].item()}", f"{1e3 * one['time_per_run'].item():.3g}"]
        line += [f"{one['steps'].item():.0f}", f"{np.median(end):.1e}", f"{end.max():.1e}"]
        if separating:
            separation = one["error_separation"].values
            line.append(f"{np.nanmax(separation):.1e}" if np.isfinite(separation).any() else "-")
        lines.append([*line, f"{wrong.mean():.0%}", f"{silent.mean():.0%}" if wrong.any() else "-"])
    return "\n".join([*_aligned(header, lines), "", *_verdict(ds, unit)])


def _verdict(ds: xr.Dataset, unit: str) -> list[str]:
    """Sentences about sample, reference, cost of certificates and recommended solver."""
    attributes = ds.attrs
    uncertainty = [f"{ds['reference_error_end'].values.max():.1e} {unit}"]
    if "reference_error_separation" in ds and np.isfinite(ds["reference_error_separation"]).any():
        uncertainty.append(f"{np.nanmax(ds['reference_error_separation'].values):.1e} s")
    words = [
        f"sampled: {attributes['sampled']}",
        f"reference: {attributes['reference']}; with a ten times larger tolerance it differs by at most "
        f"{' and '.join(uncertainty)}",
    ]
    if "left_out" in attributes:
        words.append(f"left out: {attributes['left_out']}")
    name = attributes.get("recommended", attributes.get("closest"))
    k = ds["solver"].values.tolist().index(name)
    worst, wrong = error_bounds(ds).max(axis=1)[k], int((ds["regime_wrong"][k] == 1).sum())
    errors = (
        f"errors up to {worst:.1e} (with the uncertainty of the reference)"
        if np.isfinite(worst)
        else "runs that failed"
    )
    reached = f"{wrong or 'no'} wrong regime{'s' * (wrong != 1)}, {errors}"
    words.append(f"with certificates, the default, a run takes {attributes['certificate_cost']:.2g} times as long")
    target = f"target {attributes['target']:g} ({unit} at the end{', s at separation' * ('error_separation' in ds)})"
    if "recommended" in attributes:
        words.append(f"{target} in every sampled cell is met fastest by this solver: {reached}")
        return [*words, f"solver: {{{name}}}"]
    return [*words, f"{target} in every sampled cell is met by none; closest is `{name}`: {reached}"]


def _aligned(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    return [
        "  ".join([line[0].ljust(widths[0]), *map(str.rjust, line[1:], widths[1:])]).rstrip()
        for line in (header, *rows)
    ]
