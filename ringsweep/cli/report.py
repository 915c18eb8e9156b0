"""Summary of a result as text."""

from __future__ import annotations

import numpy as np
import xarray as xr

from ringsweep.quantities.flags import FAILED, RIDING
from ringsweep.quantities.variables import CERTIFIED, DOUBTS, INFERRED, words


def summarise(result: xr.Dataset) -> None:
    """Print the number of cells, the share of each regime, the share of certified cells and the bounds on errors.

    Of the curves of a boundary, print their number and the largest distance of the boundary from them.
    """
    if "vertex" in result.dims:
        curves, points = len(np.unique(result["line"])), result.sizes["vertex"]
        print(f"boundary of {result.attrs['boundary_of']}: {curves} curves, {points} points", end="")
        print(f", each within {result['error'].values.max():.2g} along its axis" if points else "")
        return
    regime = result["regime"]
    print("cells:", regime.size)
    meanings = str(regime.attrs["flag_meanings"]).split()
    for flag, meaning in zip(np.atleast_1d(regime.attrs["flag_values"]), meanings, strict=True):
        count = int((regime == flag).sum())
        if count:
            print(f"  {meaning}: {count} ({count / regime.size:.1%})")
    if "certified" in result:
        # NaN in a refined sweep, where no cell was run.
        certified = result["certified"].values
        run = ~np.isnan(certified)
        share = float((certified[run] == 1).mean())
        # Rounding must not turn "nearly all" into 100 %.
        of = "" if run.all() else f" of the {np.count_nonzero(run)} cells run"
        print(f"certified: {share if share == 1.0 else min(share, 0.999):.1%}{of}")
    if "uncertified_because" in result:
        because = result["uncertified_because"]
        names = str(because.attrs["flag_meanings"]).split()
        for flag, name in zip(np.atleast_1d(because.attrs["flag_values"]), names, strict=True):
            if flag != CERTIFIED and (count := int((because == flag).sum())):
                print(f"  {count} not: {DOUBTS.get(name, name)}")
    if "settled" in result:
        unsettled = (result["settled"] == 0) & ~regime.isin([RIDING, FAILED])
        if unsettled.any():
            cells = np.count_nonzero(result["origin"] != INFERRED) if "origin" in result else regime.size
            print(f"not settled: {int(unsettled.sum()) / cells:.1%} of the motions; a longer span may change them")
    if "audit" in result.attrs:
        print("refined:", result.attrs["audit"])
    lines = []
    for name in (str(name).removesuffix("_error") for name in result.data_vars if str(name).endswith("_error")):
        bounds = result[f"{name}_error"].values
        bounds = bounds[np.isfinite(bounds)]
        if bounds.size:
            lines.append(f"  {name}: {np.median(bounds):.1e}, {bounds.max():.1e} {result[name].attrs.get('units', '')}")
    if lines:
        print("bounds on errors (median, largest):", *lines, sep="\n")
    for name in ("phi_end_error", "x_end_error"):
        if name in result and (unbounded := int(((result["certified"] == 1) & result[name].isnull()).sum())):
            print(f"no bound: {unbounded} certified cells, where nearby runs diverge")


# Events of a run that are printed: all, or the first and the last.
_FIRST, _LAST = 8, 4


def print_events(run: xr.Dataset) -> None:
    """Print how many events of each kind a run has, and the first and the last of them."""
    if "friction_law" in run.dims:
        for law in run["friction_law"].values:
            print(f"{law}: ", end="")
            print_events(run.sel(friction_law=law))
        return
    kinds, contacts = words(run["event_kind"]).values, words(run["event_contact"]).values
    kinds = kinds[kinds != "none"]
    counts = [f"{kind} {np.count_nonzero(kinds == kind)}" for kind in dict.fromkeys(kinds.tolist())]
    print("events:", ", ".join(counts) or "none")
    left_out = range(_FIRST, len(kinds) - _LAST)
    for k, kind in enumerate(kinds):
        if k == left_out.start and len(left_out) > 1:
            print(f"  ... {len(left_out)} more are in the file")
        if k not in left_out or len(left_out) == 1:
            who = contacts[k].replace("contact_", " contact ").replace("both", " both contacts").replace("none", "")
            print(f"  {run['event_time'].values[k]:.9g} s {kind}{who}")
