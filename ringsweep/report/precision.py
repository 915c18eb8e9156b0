"""Error against run time as text: a table, and the recommended solver for the configuration."""

from __future__ import annotations

import numpy as np
import xarray as xr

from ringsweep.runs.contenders import judge


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
    lines = table(ds)
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    aligned = ["  ".join([line[0].ljust(widths[0]), *map(str.rjust, line[1:], widths[1:])]).rstrip() for line in lines]
    return "\n".join([*aligned, "", *_verdict(ds)])


def table(ds: xr.Dataset) -> list[list[str]]:
    """Header and rows, one for each contender, of a dataset of :func:`ringsweep.runs.contenders.compete`."""
    unit = ds["error_end"].attrs["units"]
    rows = []
    for k in range(ds.sizes["contender"]):
        one = ds.isel(contender=k)
        end, wrong = one["error_end"].dropna("cell"), one["regime_wrong"].dropna("cell") == 1
        row = {"": f"{one['method'].item()}, {one['setting'].item()}"}
        if ds["error_end"].isnull().any():
            row["cells"] = str(end.size)
        row["ms per run"] = f"{1e3 * one['time_per_run'].item():.3g}"
        if "steps" in ds:
            row["steps"] = f"{one['steps'].item():.0f}"
        row |= {f"median error, {unit}": f"{np.median(end):.1e}", f"largest, {unit}": f"{end.max():.1e}"}
        if "error_separation" in ds and ds["error_separation"].notnull().any():
            separation = one["error_separation"].dropna("cell")
            row["largest of separation, s"] = f"{separation.max():.1e}" if separation.size else "-"
        row["wrong regimes"] = f"{wrong.mean():.0%}" if wrong.size else "-"
        if "flagged" in ds:
            row["wrong but not flagged"] = f"{1 - one['flagged'][wrong.values].mean():.0%}" if wrong.any() else "-"
        rows.append(row)
    return [list(rows[0]), *(list(row.values()) for row in rows)]


def _another_motion(ds: xr.Dataset) -> list[str]:
    """A sentence if the error of rk4 stays, beyond rounding, while its steps become a hundred times as many."""
    rk4 = ds.isel(contender=ds["method"].values == "rk4")
    steps = [float(str(setting).split()[0]) for setting in rk4["setting"].values]
    errors = rk4["error_end"].median("cell").values
    if not len(steps) or not np.inf > errors[-1] > max(
        1e4 * float(ds["error_end"].median("cell").min()), ds.attrs["target"]
    ):
        return []
    differ = np.flatnonzero(abs(np.log2(errors / errors[-1])) > 1.0)
    first = steps[differ[-1] + 1 if len(differ) else 0]
    if steps[-1] < 100.0 * first:
        return []
    staying = f"stays at {errors[-1]:.1e} {ds['error_end'].attrs['units']} from {first:g} to {steps[-1]:g} steps"
    return [f"rk4 converges to another motion: its median error {staying}, none of which meets static friction"]


def _verdict(ds: xr.Dataset) -> list[str]:
    """Sentences about sample, reference, cost of certificates and recommended solver."""
    attributes, unit = ds.attrs, ds["error_end"].attrs["units"]
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
    words += _another_motion(ds)
    solvers = ds["solver"].values.tolist()
    wrong, worst, meets = judge(ds, attributes["target"])

    def reached(k: int) -> str:
        errors = "runs that failed"
        if np.isfinite(worst[k]):
            errors = f"errors up to {worst[k]:.1e} (with the uncertainty of the reference)"
        return f"{wrong[k] or 'no'} wrong regime{'' if wrong[k] == 1 else 's'}, {errors}"

    words.append(f"with certificates, the default, a run takes {attributes['certificate_cost']:.2g} times as long")
    target = f"target {attributes['target']:g} ({unit} at the end{', s at separation' * ('error_separation' in ds)})"
    name = attributes.get("recommended", attributes.get("closest"))
    chosen = solvers.index(name)
    if attributes.get("configured", name) != name:
        own = solvers.index(attributes["configured"])
        factor = ds["time_per_run"].values[own] / ds["time_per_run"].values[chosen]
        words.append(
            f"the solver of this configuration, `{solvers[own]}`, {'meets' if meets[own] else 'misses'} the target: "
            f"{reached(own)}"
        )
        if meets[own]:
            words[-1] += f"; it takes {factor:.2g} times as long as the solver below"
    if "recommended" not in attributes:
        return [*words, f"{target} in every sampled cell is met by none; closest is `{name}`: {reached(chosen)}"]
    words.append(f"{target} in every sampled cell is met fastest by this solver: {reached(chosen)}")
    if attributes.get("configured") == name:
        words.append("it is the solver of this configuration already: nothing needs to change")
    return [*words, f"solver: {{{name}}}"]
