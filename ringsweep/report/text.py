"""Summary of a result as text."""

from __future__ import annotations

import json
from contextlib import suppress
from itertools import chain
from typing import Any

import numpy as np
import xarray as xr

from ringsweep.errors import InputError
from ringsweep.quantities.flags import CERTIFIED, FAILED, JAMMED, REGIMES, RIDING, SEPARATING
from ringsweep.quantities.quantity import after_number
from ringsweep.quantities.variables import (
    DOUBTS,
    INFERRED,
    in_unit,
    is_classification,
    meanings_of,
    words,
    written_unit,
)
from ringsweep.storage.chunks import parts


def status_of(result: xr.Dataset) -> int:
    """Exit status of a command that has computed a dataset: 1 if every run has failed."""
    if "probability" in result:
        return int((result["probability"].sel(word=REGIMES[FAILED]) == 1.0).all())
    return int((result["regime"] == FAILED).all())


def in_lines(result: xr.Dataset) -> str:
    """The summary of a result as text."""
    return "\n".join(chain(*summary(result).values()))


def about(result: xr.Dataset) -> str:
    """What a file holds, as text: its dimensions, coordinates and variables, the summary, and what it was made with."""
    configuration, lines = json.loads(result.attrs.get("configuration", "{}")), [result.attrs.get("title", "a result")]
    sizes = ", ".join(f"{name} {size}" for name, size in result.sizes.items())
    lines.append(f"dimensions: {sizes or 'none: a single run'}")
    for name, axis in result.coords.items():
        if "contender" in axis.dims:
            continue
        if axis.dtype.kind not in "iuf":
            lines.append(f"  {name}: {', '.join(dict.fromkeys(map(str, axis.values.flat)))}")
        elif axis.size:
            with suppress(InputError):
                axis = in_unit(axis, written_unit(configuration, axis.attrs.get("path", "")))
            unit = after_number(axis.attrs.get("units", "1"))
            low, high = axis.values.min(), axis.values.max()
            lines.append(f"  {name}: {low:g}{f' to {high:g}' * bool(high > low)}{unit}")
    if not {"contender", "time"} & set(result.dims):
        lines.append(f"variables: {', '.join(map(str, result.data_vars))}")
    lines += [in_lines(result), f"solver: {json.dumps(configuration.get('solver', result.attrs.get('method')))}"]
    if "own_files" in result.attrs:
        lines.append(f"own files: {result.attrs['own_files']} (RINGSWEEP_LAWS must name them to run it again)")
    return "\n".join([*lines, f"versions: {result.attrs['ringsweep_version']} {result.attrs.get('versions', '')}"])


def as_json(result: xr.Dataset) -> str:
    """What a result says, as JSON: its lines by topic, and cells of each class, probabilities or thresholds."""
    found: dict[str, Any] = {"title": result.attrs.get("title"), "dimensions": dict(result.sizes)}
    found["summary"] = {topic: [line.strip() for line in lines] for topic, lines in summary(result).items()}
    if "threshold_path" in result.attrs:
        from ringsweep.runs.thresholds import plain

        found |= plain(result)
    else:
        flagged = [str(name) for name, data in result.data_vars.items() if is_classification(data)]
        found["counts"] = {name: {word: count for _, word, count in _counts(result, name)} for name in flagged}
        if "probability" in result:
            found |= _statistics(result)
    # JSON has no infinity.
    found = json.loads(json.dumps(found), parse_constant=lambda _: None)
    return json.dumps(found, indent=2, ensure_ascii=False)


def _statistics(result: xr.Dataset) -> dict[str, Any]:
    """What a sampled sweep says of each cell, in the shape of the grid, by word where it has words; the coordinates."""
    statistics = result.drop_vars("runs").drop_dims(("sample", "replicate"), errors="ignore")
    found: dict[str, Any] = {
        str(name): {word: data.sel(word=word).values.tolist() for word in data["word"].values.tolist()}
        if "word" in data.dims
        else data.values.tolist()
        for name, data in statistics.data_vars.items()
    }
    axes = statistics.drop_vars("word").coords.items()
    return found | {
        "coordinates": {name: {"units": c.attrs.get("units"), "values": c.values.tolist()} for name, c in axes}
    }


def summary(result: xr.Dataset) -> dict[str, list[str]]:
    """What a result says, in lines, by what they are about.

    ``"regimes"`` has the number of cells and the share of each regime, or its probability; ``"aftermath"`` what follows
    a lost contact; ``"shocks"`` what loads the body most; ``"certificates"`` the share of certified cells, the reasons
    why others are not, and the bounds on errors. Of the curves of a boundary, ``"boundary"`` has their number and the
    largest distance of the boundary from them.
    """
    if "threshold_path" in result.attrs:
        from ringsweep.runs.thresholds import in_words

        return {"thresholds": in_words(result).splitlines()}
    if "contender" in result.dims:
        from ringsweep.report.precision import report

        return {"precision": report(result).splitlines()}
    if "fit_report" in result.attrs:
        return {"fit": result.attrs["fit_report"].splitlines()}
    if "vertex" in result.dims:
        curves, points = len(np.unique(result["line"])), result.sizes["vertex"]
        within = f", each within {result['error'].values.max():.2g} along its axis" if points else ""
        return {"boundary": [f"boundary of {result.attrs['boundary_of']}: {curves} curves, {points} points{within}"]}
    if "probability" in result:
        return _of_sample(result)
    regime = result["regime"]
    found = {"regimes": [f"cells: {regime.size}", *_shares(result, "regime")]}
    if "aftermath" in result:
        found["aftermath"] = ["contacts:", *_shares(result, "aftermath"), *_losses(result)]
    extremes = []
    for name in (name for name in _GREATEST if name in result):
        largest = np.fmax.reduce([np.fmax.reduce(part, axis=None) for (part,) in parts(result, name)])
        if not np.isnan(largest):
            extremes.append(f"{name} {largest:.3g} {result[name].attrs.get('units', '')}")
    if extremes:
        found["shocks"] = [f"greatest: {', '.join(extremes)}"]
    lines = found["certificates"] = []
    if "certified" in result:
        # NaN in a refined sweep, where no cell was run.
        run = sum(np.count_nonzero(~np.isnan(part)) for (part,) in parts(result, "certified"))
        share = sum(np.count_nonzero(part == 1) for (part,) in parts(result, "certified")) / run
        lines.append(f"certified: {_share_at_most(share)}{'' if run == regime.size else f' of the {run} cells run'}")
    if "uncertified_because" in result:
        counts = _counts(result, "uncertified_because")
        lines += [f"  {count} not: {DOUBTS.get(name, name)}" for flag, name, count in counts if flag != CERTIFIED]
    if "settled" in result:
        unsettled = int(((result["settled"] == 0) & ~regime.isin([RIDING, FAILED, SEPARATING, JAMMED])).sum())
        if unsettled:
            cells = np.count_nonzero(result["origin"] != INFERRED) if "origin" in result else regime.size
            lines.append(f"not settled: {unsettled / cells:.1%} of the motions; a longer span may change them")
    if "audit" in result.attrs:
        lines.append(f"refined: {result.attrs['audit']}")
    bounds, diverging = [], 0
    for name in (str(name).removesuffix("_error") for name in result.data_vars if str(name).endswith("_error")):
        finite = []
        for bound, certified in parts(result, f"{name}_error", "certified"):
            finite.append(bound[np.isfinite(bound)])
            if name in ("phi_end", "x_end"):
                diverging += int(np.sum((certified == 1) & np.isnan(bound)))
        if (known := np.concatenate(finite)).size:
            unit = result[name].attrs.get("units", "")
            bounds.append(f"  {name}: {np.median(known):.1e}, {known.max():.1e} {unit}".rstrip())
    lines += ["bounds on errors (median, largest):", *bounds] if bounds else []
    lines += [f"no bound where nearby runs diverge: {diverging} of the certified cells"] if diverging else []
    return found


def _share_at_most(share: float) -> str:
    """A share in per cent; rounding does not turn "nearly all" into 100 %."""
    return f"{share if share == 1.0 else min(share, 0.999):.1%}"


# What loads or shakes the body most, over all cells.
_GREATEST = ("jump_max", "normal_max_1", "normal_max_2", "gap_max", "impact_speed_max", "impulse_max")


def _counts(result: xr.Dataset, variable: str) -> list[tuple[int, str, int]]:
    """Flag, name and number of cells of each class that occurs."""
    meanings = meanings_of(result[variable])
    counts = np.zeros(len(meanings), dtype=int)
    for (part,) in parts(result, variable):
        counts += [np.count_nonzero(part == flag) for flag in meanings]
    return [(flag, name, int(n)) for (flag, name), n in zip(meanings.items(), counts, strict=True) if n]


def _shares(result: xr.Dataset, variable: str) -> list[str]:
    """The number and the share of the cells of each class that occurs."""
    size = result[variable].size
    return [f"  {meaning}: {count} ({count / size:.1%})" for _, meaning, count in _counts(result, variable)]


def _losses(result: xr.Dataset) -> list[str]:
    """How often the contacts of a run are lost, and how often they hit the ring."""
    told = []
    for name, what in (("separations", "losses of contact"), ("impacts", "impacts")):
        # Inferred cells have no number; cells that lose no contact have no losses.
        counts = np.concatenate([part[part > 0] for (part,) in parts(result, name)]) if name in result else np.empty(0)
        if counts.size == 1:
            told.append(f"{what} {counts[0]:.0f}")
        elif counts.size:
            told.append(f"{what} {counts.min():.0f} to {counts.max():.0f}, median {np.median(counts):.0f}")
    return [f"  in a run that has any: {'; '.join(told)}"] if told else []


# Most events of a run that are printed. Where contacts hit, only events of contacts are.
_MOST_EVENTS = 12
_OF_CONTACTS = ("separation", "rebound", "closure")


def events_in_words(run: xr.Dataset) -> str:
    """How many events of each kind a run has, and the first of them, line by line."""
    if "friction_law" in run.dims:
        return "\n".join(f"{law}: {events_in_words(run.sel(friction_law=law))}" for law in run["friction_law"].values)
    kinds, contacts = words(run["event_kind"]).values, words(run["event_contact"]).values
    kinds = kinds[kinds != "none"]
    counts = [f"{kind} {np.count_nonzero(kinds == kind)}" for kind in dict.fromkeys(kinds.tolist())]
    lines = [f"events: {', '.join(counts) or 'none'}"]
    hits = np.flatnonzero(np.isin(kinds, _OF_CONTACTS[1:]))
    speeds = dict(zip(hits.tolist(), run["impact_speed"].values.tolist(), strict=False)) if len(hits) else {}
    told = np.flatnonzero(np.isin(kinds, _OF_CONTACTS) | (not speeds)).tolist()
    for k in told[:_MOST_EVENTS]:
        who = contacts[k].replace("contact_", " contact ").replace("both", " both contacts").replace("none", "")
        speed = f", {speeds[k]:.6g} m/s" if k in speeds else ""
        lines.append(f"  {run['event_time'].values[k]:.9g} s {kinds[k]}{who}{speed}")
    if len(told) > _MOST_EVENTS:
        lines.append(f"  ... {len(told) - _MOST_EVENTS} more{', and the other kinds,' * bool(speeds)} are in the file")
    if speeds:
        hardest = max(speeds, key=speeds.__getitem__)
        when = run["event_time"].values[hardest]
        gap = float(run["gap_max"])
        lines.append(f"hardest impact: {speeds[hardest]:.6g} m/s at {when:.9g} s; greatest gap: {gap:.6g} m")
    return "\n".join(lines)


def _indices(of: xr.Dataset) -> list[str]:
    """The total indices of a regime in one cell, the greatest first, unless nothing is known of them."""
    if "sobol_total" not in of or float((of["sobol_total_high"] - of["sobol_total_low"]).min()) >= 1.0:
        return []
    columns = [of[f"sobol_total{end}"].values for end in ("", "_low", "_high")]
    told = sorted(zip(*columns, of["parameter"].values, strict=True), key=lambda one: -one[0])
    parts = [f"{name} {index:.0%} ({low:.0%} to {high:.0%})" for index, low, high, name in told]
    return [f"    total Sobol index: {', '.join(parts)}"]


def _of_sample(result: xr.Dataset) -> dict[str, list[str]]:
    """The probability of each regime that occurs, with its interval; of several cells the range."""
    probability = result["probability"]
    cells = probability.size // result.sizes["word"]
    told = (f"{key.removeprefix('sample_')}: {result.attrs.get(key)}" for key in ("sample", "sample_interval"))
    lines = [f"cells: {cells}", *told]
    grid = [dim for dim in probability.dims if dim != "word"]
    for word in map(str, result["word"].values):
        of = result.sel(word=word)
        share, low, high, numerics = (of[f"probability{end}"].values for end in ("", "_low", "_high", "_numerics"))
        part = f", of which {'up to ' * (cells > 1)}{numerics.max():.2%} are numerics" * bool(numerics.max() > 0.0)
        if share.max() > 0.0 and cells == 1:
            lines.append(f"  {word}: {share.item():.2%} ({low.item():.2%} to {high.item():.2%}{part})")
            lines += _indices(of.squeeze(grid))
        elif share.max() > 0.0:
            shares = f"{share.min():.2%} to {share.max():.2%}, mean {share.mean():.2%}"
            lines.append(f"  {word}: {shares}; intervals up to {(high - low).max():.2%} long{part}")
    runs = result["runs"]
    certified = float(runs.isel(certificate=1).sum() / runs.sum())
    return {"regimes": lines, "certificates": [f"certified: {_share_at_most(certified)} of {int(runs.sum())} runs"]}
