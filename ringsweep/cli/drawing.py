"""Commands that draw stored files; slow to import, as the pictures are."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from ringsweep import plots
from ringsweep.errors import InputError
from ringsweep.plots.datasets import is_sampled, resolve
from ringsweep.plots.maps import Map, suitable
from ringsweep.plots.sections import points_of
from ringsweep.plots.selection import select, select_grid
from ringsweep.storage import files, netcdf

_SAMPLE_KINDS = ("probability", "survival", "sensitivity")


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
    selection = dict(_selection(text) for text in arguments.sel)
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
    target = _picture_of(dataset, arguments.output, shown, *map(_name_part, arguments.sel))
    page = target.suffix.lower() == ".html"
    if page and arguments.log:
        raise InputError("--log", "is for pictures, not for a page: name the output *.png")
    if page and arguments.boundaries is not None:
        raise InputError("--boundaries", "are drawn into pictures, not into a page: name the output *.png")
    if arguments.tolerance is not None and arguments.boundaries is None:
        raise InputError("--tolerance", "is that of --boundaries REGIME")
    curves = None
    if arguments.boundaries is not None:
        written = dataset.with_name(f"{target.stem}-{_name_part(arguments.boundaries)}.nc")
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


def draw_plot(arguments: argparse.Namespace, dataset: Path, result: Any) -> None:
    """Draw the history of a run, errors against run time, a fit, or a sampled sweep."""
    if "residual" in result:
        given = (arguments.kind, arguments.law, arguments.word, arguments.begin, arguments.end)
        if arguments.sel or any(option is not None for option in given):
            raise InputError(str(dataset), "is a fit, of which there is one picture: leave other options out")
        save(plots.fit(result), Path(arguments.output or dataset.with_suffix(".png")))
        return
    if is_sampled(result):
        _plot_sample(arguments, dataset, result)
        return
    if arguments.sel or arguments.word is not None or arguments.kind in _SAMPLE_KINDS:
        option = "--sel" if arguments.sel else "--word" if arguments.word is not None else f"--kind {arguments.kind}"
        raise InputError(option, f"is for a sampled sweep, and {dataset} is none")
    if not {"time", "contender"} & set(result.dims):
        raise InputError(str(dataset), f"is a sweep, not the history of a run: ringsweep map {dataset} draws it")
    target = _picture_of(dataset, arguments.output, arguments.kind, arguments.law)
    cut = slice(arguments.begin, arguments.end)
    if "contender" in result.dims and (arguments.kind or arguments.law or cut != slice(None)):
        raise InputError(str(dataset), "holds errors against run time: --kind, --law, --from, --to are for histories")
    if arguments.law is not None:
        if "friction_law" not in result.dims:
            raise InputError("--law", f"{dataset} holds a run under one friction law only")
        laws = map(str, result["friction_law"].values)
        result = result.sel(friction_law=resolve("--law", arguments.law, laws))
    if cut != slice(None):
        times = result["time"].values
        result = result.sel(time=cut)
        if result.sizes["time"] < 2:
            raise InputError(
                "--from", f"{dataset} has times from {times[0]:g} to {times[-1]:g} s: none in this interval"
            )
    if "contender" in result.dims:
        figure = plots.work_precision(result)
    elif arguments.kind is None:
        figure = plots.history(result)
    else:
        figure = panel(plots.phase_portrait if arguments.kind == "phase" else plots.friction_loop, result, 4.8)
    save(figure, target)


def _plot_sample(arguments: argparse.Namespace, dataset: Path, result: Any) -> None:
    """Draw a sampled sweep, or one cell of it."""
    if arguments.law is not None or arguments.begin is not None or arguments.end is not None:
        raise InputError(str(dataset), "is a sampled sweep: --law, --from, --to are for histories")
    if arguments.kind not in (None, *_SAMPLE_KINDS):
        raise InputError("--kind", f"{arguments.kind} is for histories; of {dataset}: {', '.join(_SAMPLE_KINDS)}")
    kind = arguments.kind or "probability"
    if arguments.word is not None and kind != "sensitivity":
        raise InputError("--word", "is that of --kind sensitivity")
    target = _picture_of(dataset, arguments.output, arguments.kind, *map(_name_part, arguments.sel))
    selection = dict(_selection(text) for text in arguments.sel)
    if kind == "probability":
        save(plots.regime_map(result, sel=selection), target)
        return
    draw = getattr(plots, f"{kind}_panel")
    options = {"word": arguments.word} if arguments.word else {}
    save(panel(draw, select(result, selection)[0], **options), target)


def _picture_of(dataset: Path, output: str | None, *parts: str | None) -> Path:
    """Path of a picture of a dataset: `output`, or its name with these parts; checked before anything is drawn."""
    target = Path(output or dataset.with_name("-".join([dataset.stem, *filter(None, parts)]) + ".png"))
    files.check_writable(target)
    return target


def save(figure: Any, picture: Path) -> None:
    """Save a figure, and say so."""
    plots.save(figure, picture)
    print(f"wrote {picture}")


def panel(draw: Callable[..., Any], result: Any, height: float = 4.2, **options: Any) -> Any:
    """A new figure with one picture."""
    figure = Figure(figsize=(7.6, height), layout="constrained")
    draw(result, ax=figure.add_subplot(), **options)
    return figure


def _selection(text: str) -> tuple[str, str]:
    """Coordinate and value of ``DIM=VALUE``."""
    name, equals, value = (part.strip() for part in text.partition("="))
    if not equals:
        raise InputError("--sel", f"{text!r} is not of the form DIM=VALUE")
    return name, value
