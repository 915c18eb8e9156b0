"""Commands that draw stored files; slow to import, as the pictures are."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ringsweep import plots
from ringsweep.errors import InputError
from ringsweep.plots.datasets import is_sampled, resolve
from ringsweep.plots.look import panel
from ringsweep.plots.maps import Map, suitable
from ringsweep.plots.saving import SUFFIXES, suffix_of
from ringsweep.plots.sections import points_of
from ringsweep.plots.selection import select, select_grid
from ringsweep.storage import files, netcdf


def draw_stored(arguments: argparse.Namespace, draw: Callable[[argparse.Namespace, Path, Any], None]) -> None:
    """Draw a file, which errors about a dataset name."""
    dataset = Path(arguments.dataset)
    with netcdf.reading(dataset) as result:
        try:
            draw(arguments, dataset, result)
        except InputError as error:
            if error.path == "ds":
                raise InputError(str(dataset), error.problem) from error
            raise


def draw_map(arguments: argparse.Namespace, dataset: Path, result: Any) -> None:
    """Draw a variable of a sweep: as a map, a bifurcation diagram, a circle of multipliers, or a page."""
    selection = dict(map(selection_of, arguments.sel))
    fixed = {name.replace(".", "_") for name in selection}
    plain = not (arguments.y or arguments.log or arguments.boundaries or str(arguments.output).endswith(".html"))
    kind, var = suitable(result, arguments.var, selection, plain)
    # A page and the boundaries need a variable, other pictures choose it by themselves.
    arguments.var = var if kind == "diagram" or not plain else arguments.var
    along = result.isel(dict.fromkeys(fixed & set(map(str, result.dims)), 0))
    if arguments.var == "attractor" and points_of(result):
        from ringsweep.runs.attractors import attractors

        result = attractors(result)
    # The name differs from that of the regime map of the sweep, which must not be replaced.
    shown = None if arguments.var == "regime" else arguments.var
    bounded = None if arguments.boundaries is None else _name_part(arguments.boundaries)
    target = _picture_of(dataset, arguments.output, shown, *map(_name_part, arguments.sel), bounded)
    page = suffix_of(target, (*SUFFIXES, ".html"), "maps") == ".html"
    for option, given in (("--log", arguments.log), ("--boundaries", arguments.boundaries)):
        if page and given:
            raise InputError(option, "is for pictures, not for a page: name the output *.png")
    if arguments.tolerance is not None and arguments.boundaries is None:
        raise InputError("--tolerance", "is that of --boundaries REGIME")
    curves = None
    if arguments.boundaries is not None:
        written = dataset.with_name(f"{target.stem.removesuffix(f'-{bounded}')}-{bounded}.nc")
        files.check_writable(written)
        if written.exists():
            netcdf.check_kind(written, "vertex", "boundary")
        # What the picture cannot have is told before the boundary is computed.
        word = {"word": arguments.boundaries} if is_sampled(result) else {}
        Map(along, (arguments.x, arguments.y), arguments.var, word).check_takes_curves()

        from ringsweep.runs.boundaries import boundary, run_at
        from ringsweep.runs.executors import Execution
        from ringsweep.runs.probabilities import nominal
        from ringsweep.runs.sweep import compute

        tolerance = 1e-6 if arguments.tolerance is None else arguments.tolerance
        sampled = is_sampled(result)
        # Of a sampled sweep the one in which every uncertain parameter has its median.
        located = compute(nominal(result), Execution(progress=False)) if sampled else result
        held = {name: value for name, value in selection.items() if name != "word" or not sampled}
        located, missing = select_grid(located, held)
        if missing:
            located = run_at(located, missing, arguments.boundaries)
        curves = boundary(located, arguments.boundaries, tolerance)
        if sampled:
            selection["word"] = arguments.boundaries
        else:
            # The picture shows the cells between which the curves lie.
            result, selection = located, {}
        netcdf.save(curves, written)
        print(f"wrote {written}")
    chosen = (arguments.x, arguments.y, arguments.var, selection)
    if page:
        plots.save_page(result, target, *chosen)
        print(f"wrote {target}")
    else:
        save(plots.regime_map(result, *chosen, curves, norm="log" if arguments.log else None), target)


def _name_part(held: str) -> str:
    """A setting as part of a file name, with no character that means something to a shell or to LaTeX."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", held.replace(" ", "").replace("+", ""))


#: Options of `plot` that are not for all files.
_OPTIONS = {"kind": "--kind", "sel": "--sel", "word": "--word", "law": "--law", "begin": "--from", "end": "--to"}

#: The options that each kind of file takes, with the values of those that have few.
_TAKES: dict[str, dict[str, tuple[str, ...]]] = {
    "residual": {},
    "contender": {},
    "probability": {"kind": ("probability", "survival", "sensitivity"), "sel": (), "word": ()},
    "time": {"kind": ("phase", "friction"), "law": (), "begin": (), "end": ()},
}


def draw_plot(arguments: argparse.Namespace, dataset: Path, result: Any) -> None:
    """Draw the history of a run, errors against run time, a fit, or a sampled sweep."""
    mark, kind = netcdf.kind_of(result), arguments.kind
    if mark not in _TAKES:
        raise InputError(str(dataset), f"is a sweep, not the history of a run: ringsweep map {dataset} draws it")
    for name, option in _OPTIONS.items():
        given, values = getattr(arguments, name), _TAKES[mark].get(name)
        if given not in (None, []) and (values is None or (values and given not in values)):
            called = f"--kind {kind}" if name == "kind" else option
            raise InputError(called, f"is not for {netcdf.KINDS[mark]}, which is in {dataset}")
    if arguments.word is not None and kind != "sensitivity":
        raise InputError("--word", "is that of --kind sensitivity")
    target = _picture_of(dataset, arguments.output, kind, arguments.law, *map(_name_part, arguments.sel))
    if mark in ("residual", "contender"):
        save((plots.fit if mark == "residual" else plots.work_precision)(result), target)
    elif mark == "probability":
        selection = dict(map(selection_of, arguments.sel))
        if kind in (None, "probability"):
            save(plots.regime_map(result, sel=selection), target)
        else:
            options = {"word": arguments.word} if arguments.word else {}
            save(panel(getattr(plots, f"{kind}_panel"), select(result, selection)[0], **options), target)
    else:
        part = _part_of(result, arguments, dataset)
        portrait = plots.phase_portrait if kind == "phase" else plots.friction_loop
        save(panel(portrait, part, 4.8) if kind else plots.history(part), target)


def _part_of(result: Any, arguments: argparse.Namespace, dataset: Path) -> Any:
    """The run of a history under the law that is asked for, between the times that are asked for."""
    if arguments.law is not None:
        if "friction_law" not in result.dims:
            raise InputError("--law", f"{dataset} holds a run under one friction law only")
        laws = map(str, result["friction_law"].values)
        result = result.sel(friction_law=resolve("--law", arguments.law, laws))
    part = result.sel(time=slice(arguments.begin, arguments.end))
    if part.sizes["time"] < min(2, result.sizes["time"]):
        first, last = result["time"].values[[0, -1]]
        raise InputError("--from", f"{dataset} has times from {first:g} to {last:g} s: none in this interval")
    return part


def _picture_of(dataset: Path, output: str | None, *parts: str | None) -> Path:
    """Path of a picture of a dataset: `output`, or its name with these parts; checked before anything is drawn."""
    target = Path(output or dataset.with_name("-".join([dataset.stem, *filter(None, parts)]) + ".png"))
    files.check_writable(target)
    return target


def save(figure: Any, picture: Path) -> None:
    """Save a figure, and say so."""
    plots.save(figure, picture)
    print(f"wrote {picture}")


def selection_of(text: str) -> tuple[str, str]:
    """Coordinate and value of ``DIM=VALUE``."""
    name, equals, value = (part.strip() for part in text.partition("="))
    if not equals:
        raise InputError("--sel", f"{text!r} is not of the form DIM=VALUE")
    return name, value
