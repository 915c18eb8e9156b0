"""A sweep as one page that answers an engineer's questions, to be sent to a colleague."""

from __future__ import annotations

import base64
import html
import io
import os
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
import yaml
from matplotlib.figure import Figure

from ringsweep.errors import InputError
from ringsweep.plots.datasets import is_numeric, is_sampled, require_sweep, scene_text
from ringsweep.plots.look import panel
from ringsweep.plots.maps import regime_map
from ringsweep.plots.probability import sensitivity_panel, survival_panel
from ringsweep.plots.saving import suffix_of
from ringsweep.quantities.variables import DEFINITIONS, configuration_of, swept, words, written
from ringsweep.report.text import summary
from ringsweep.storage.files import check_writable, replacing

_HEAD = """<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>body {{ font: 16px/1.45 sans-serif; max-width: 54em; margin: 2em auto; padding: 0 1em }}
img {{ max-width: 100% }} pre {{ white-space: pre-wrap; font: inherit }} pre.code {{ font: 13px monospace }}</style>
</head><body><h1>{title}</h1>"""


def report(ds: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a sweep as one page for the browser that needs no network: pictures and what they mean, in words.

    The page has the map, the value of each swept number at which a regime begins or ends, what follows a lost contact,
    probabilities if the sweep has a sample, shocks, certificates, what to cite, and the configuration. The thresholds
    need some hundred runs for each swept number, in which the others have their value in the scene.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep.
    path : path-like
        File to write or replace, ``*.html``. If writing fails, an older file of that name stays as it was.

    Raises
    ------
    InputError
        If the dataset is no sweep with a configuration, or the file cannot be written.
    """
    suffix_of(path, (".html",), "reports")
    check_writable(path)
    require_sweep(ds)
    configuration = configuration_of(ds)
    lines = summary(ds)
    occurring = _words(ds)
    parts = [_HEAD.format(title=html.escape(str(ds.attrs.get("title", "ringsweep"))))]

    def add(title: str, text: list[str], draw: Callable[[], Figure] | None = None) -> None:
        """Add a section: heading, picture and lines; what cannot be drawn says why."""
        parts.append(f"<h2>{title}</h2>")
        try:
            if draw is not None:
                picture = io.BytesIO()
                draw().savefig(picture, format="png", dpi=150)
                data = base64.b64encode(picture.getvalue()).decode()
                parts.append(f'<img alt="{title}" src="data:image/png;base64,{data}">')
        except InputError as error:
            text = [*text, f"no picture: {error}"]
        if text:
            parts.append(f"<pre>{html.escape(chr(10).join(text))}</pre>")

    def of(variable: str) -> Callable[[], Figure] | None:
        return (lambda: regime_map(ds, var=variable)) if variable in ds else None

    add("The map", ["; ".join(scene_text(ds)), *lines["regimes"]], lambda: regime_map(ds))
    # Of "ring: ...; belt: ..." the part of the model.
    model = "belt" if configuration["scene"]["model"] == "belt" else "ring"
    meanings = {word: DEFINITIONS[word].rpartition(f"{model}: ")[2].partition("; belt: ")[0] for word in occurring}
    add("What the words mean", [f"{word}: {meaning}" for word, meaning in meanings.items()])
    if thresholds := _thresholds(ds, configuration, occurring):
        add("Where regimes begin and end", thresholds)
    if "separating_contact" in ds and "separating" in occurring:
        first = f"the earliest loss of a contact is at {float(ds['t_separation'].min()):.4g} s"
        add("Which contact is lost", [first], of("separating_contact"))
        cure = ["a run ends where a contact is lost; with scene.impact, such as {restitution: 0.5}, it goes on"]
        add("What follows a lost contact", lines.get("aftermath", cure), of("aftermath"))
    # These pictures are those of one cell.
    is_one = is_sampled(ds) and all(ds.sizes[dim] == 1 for dim in ds["probability"].dims if dim != "word")
    if "sobol_first" in ds and is_one:
        add("What the regime depends on", [], lambda: panel(sensitivity_panel, ds))
    if "survival" in ds and is_one:
        add("How long it holds", [], lambda: panel(survival_panel, ds))
    if "shocks" in lines:
        add("Shocks", lines["shocks"], of("jump_max"))
    add("How sure it is", lines["certificates"])
    add("To cite", str(ds.attrs.get("references", "")).splitlines())
    scene = yaml.safe_dump(configuration, sort_keys=False, allow_unicode=True)
    parts.append(f'<details><summary>Configuration</summary><pre class="code">{html.escape(scene)}</pre></details>')
    with replacing(path) as temporary:
        temporary.write_text("\n".join(parts) + "</body></html>\n", encoding="utf-8")


def _words(ds: xr.Dataset) -> list[str]:
    """The regimes that occur, the most frequent first."""
    if is_sampled(ds):
        share = {str(word): float(ds["probability"].sel(word=word).mean()) for word in ds["word"].values}
    else:
        share = dict(zip(*np.unique(words(ds["regime"]).values, return_counts=True), strict=True))
    return sorted((word for word in share if share[word] > 0.0), key=lambda word: -share[word])


def _thresholds(ds: xr.Dataset, configuration: dict[str, Any], occurring: list[str]) -> list[str]:
    """Where each regime but one begins and ends along each axis, with the values of the other axes.

    Where all others begin or end, that one ends or begins: the most frequent one that neither loses a contact nor jams.
    """
    from ringsweep.runs.probabilities import nominal
    from ringsweep.runs.thresholds import SCAN, in_words, threshold

    axes = {str(one.attrs["path"]): one for one in swept(ds) if is_numeric(one)}
    if not axes:
        return []
    if len(occurring) == 1:
        return [f"every run is {occurring[0]}: no regime begins or ends in this map"]
    if (configuration.get("sweep") or {}).get("follow"):
        return ["cells follow each other, so a threshold depends on the cells before"]
    config, fixed = configuration, list[str]()
    if is_sampled(ds):
        config, fixed = nominal(ds).source, ["what is uncertain has its median"]
    # A scene need not have a value for what is swept: then the one in the middle is taken.
    own = {path: written(config, path) for path in axes}
    at = {path: one.values.flat[one.size // 2].item() if own[path] is None else own[path] for path, one in axes.items()}
    left_out = next((word for word in occurring if word not in ("separating", "jammed")), occurring[0])
    lines = []
    for path in axes:
        others = {other: value for other, value in at.items() if other != path}
        given = [f"{other} = {value}" for other, value in others.items()]
        lines.append(f"{', '.join([f'along {path}', *fixed, *given])}:")
        for regime in (word for word in occurring if word != left_out):
            try:
                found = threshold(config, path, regime, set=others)
            except InputError as error:
                lines.append(f"  {regime}: {error}")
            else:
                lines += [f"  {line}" for line in in_words(found).splitlines()[:-1]]
    return [*lines, f"{SCAN} runs or more along each axis; two changes between neighbours among them are missed"]
