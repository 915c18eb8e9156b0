"""The commands, each a few lines over the Python calls."""

from __future__ import annotations

import argparse
import json
import logging
from contextlib import suppress
from pathlib import Path

from ringsweep.cli.report import summarise, warn_of_launch, warn_of_stiffness
from ringsweep.errors import InputError


def init_command(arguments: argparse.Namespace) -> None:
    from importlib.resources import files

    target = Path(arguments.config)
    if target.exists():
        raise InputError(str(target), "is there already: name another file")
    if target.suffix not in (".yaml", ".yml"):
        raise InputError(str(target), "is no name for a configuration: name it *.yaml")
    text = (files("ringsweep.cli") / "templates" / f"{arguments.model}.yaml").read_text(encoding="utf-8")
    try:
        target.write_text(text.replace("{name}", str(target)), encoding="utf-8")
    except OSError as error:
        raise InputError(str(target), f"cannot be written: {error.strerror or error}") from error
    print(f"wrote {target}; next: ringsweep run {target}")


def run_command(arguments: argparse.Namespace) -> None:
    from ringsweep.config import load

    if arguments.backend == "dask" and arguments.scheduler is None:
        raise InputError("--backend", "dask needs the address of its scheduler: --scheduler ADDRESS")
    if arguments.backend == "threads" and arguments.scheduler is not None:
        raise InputError("--scheduler", "is for --backend dask")
    config = load(arguments.config)
    target, picture = _outputs(f"{config.name}.nc" if arguments.output is None else arguments.output, "regime", "sweep")

    from ringsweep import plots
    from ringsweep.runs.sweep import write
    from ringsweep.storage import netcdf

    if arguments.scheduler is not None and not arguments.verbose:
        _silence_dask()
    options = {name: getattr(arguments, name) for name in ("jobs", "fresh", "reuse", "scheduler")}
    if computed := write(config, target, **options, progress=not arguments.quiet):
        print(f"wrote {target}")
    else:
        print(f"{target} holds this sweep already (--fresh runs it again)")
    with netcdf.open_dataset(target) as result:
        summarise(result)
        warn_of_stiffness(result, config)
        warn_of_launch(result)
        if not config.axes.sizes or (not computed and _is_newer(picture, target)):
            return
        try:
            plots.save(plots.regime_map(result), picture)
        except InputError as error:
            # The sweep is sound and saved; only what to hold fixed in a picture is open.
            print(f"no map yet: {error.problem} (ringsweep map {target})")
        else:
            print(f"wrote {picture}")


def _is_newer(one: Path, other: Path) -> bool:
    return one.exists() and one.stat().st_mtime >= other.stat().st_mtime


def _silence_dask() -> None:
    """Of a connection that is lost Dask tells with tracebacks what is told here in one line."""
    with suppress(ImportError):
        # It sets the levels of its loggers when it is imported.
        import distributed  # noqa: F401
    for name in ("distributed", "tornado", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL)


def map_command(arguments: argparse.Namespace) -> None:
    from ringsweep import plots
    from ringsweep.storage import netcdf

    dataset = Path(arguments.dataset)
    result = netcdf.open_dataset(dataset)
    # Beside the regime map of the sweep, not in its place.
    shown = [arguments.var] * (arguments.var != "regime") + [held.replace(" ", "") for held in arguments.sel]
    target = Path(arguments.output or dataset.with_name("-".join([dataset.stem, *shown]) + ".png"))
    netcdf.check_writable(target)
    held = dict(_selection(text) for text in arguments.sel)
    try:
        figure = plots.regime_map(result, arguments.x, arguments.y, arguments.var, held)
    except InputError as error:
        if error.path == "ds":
            raise InputError(str(dataset), error.problem) from error
        raise
    plots.save(figure, target)
    print(f"wrote {target}")


def simulate_command(arguments: argparse.Namespace) -> None:
    from ringsweep.config import with_values

    config = with_values(arguments.config, arguments.set)
    target, picture = _outputs(arguments.output or f"{config.name}-run.nc", "time", "history")

    from ringsweep import plots
    from ringsweep.runs.simulate import history
    from ringsweep.storage import netcdf

    result = history(config)
    netcdf.save(result, target)
    plots.save(plots.history(result), picture)
    print(result.attrs["outcome"])
    warn_of_stiffness(result, config)
    warn_of_launch(result)
    print(f"wrote {target}\nwrote {picture}")


def animate_command(arguments: argparse.Namespace) -> None:
    from ringsweep.config import with_values
    from ringsweep.models import MODELS

    config = with_values(arguments.config, arguments.set)
    target = arguments.output or f"{config.name}-run.gif"
    model = config.scene.structure.model
    if "phi_end" not in MODELS[model].outcomes:
        raise InputError("scene.model", f"{model}: there is no ring to film; ringsweep simulate draws its history")
    if config.axes.sizes:
        raise InputError("sweep", "several friction laws: a film is of one run; give its law by --set friction.law=...")

    from ringsweep import plots
    from ringsweep.plots.motion import check_animation
    from ringsweep.runs.simulate import history

    check_animation(target)
    result = history(config)
    plots.save_animation(result, target)
    print(result.attrs["outcome"])
    print(f"wrote {target}")


def precision_command(arguments: argparse.Namespace) -> None:
    from ringsweep.config import load

    config = load(arguments.config)
    target, picture = _outputs(arguments.output or f"{config.name}-precision.nc", "contender", "error against run time")

    from ringsweep import plots
    from ringsweep.cli.precision_table import report
    from ringsweep.runs.precision import measure
    from ringsweep.storage import netcdf

    given = {name: getattr(arguments, name) for name in ("target", "cells", "rounds")}
    options = {name: value for name, value in given.items() if value is not None}
    result = measure(config, **options, progress=not arguments.quiet)
    netcdf.save(result, target)
    plots.save(plots.work_precision(result), picture)
    print(report(result))
    print(f"wrote {target}\nwrote {picture}")


def info_command(arguments: argparse.Namespace) -> None:
    from ringsweep.storage import netcdf

    result = netcdf.open_dataset(arguments.dataset)
    print(result.attrs.get("title", arguments.dataset))
    print("dimensions:", ", ".join(f"{name} {size}" for name, size in result.sizes.items()) or "none: a single run")
    for name, axis in result.coords.items():
        if "contender" in axis.dims:
            continue
        if axis.dtype.kind not in "iuf":
            print(f"  {name}: {', '.join(dict.fromkeys(map(str, axis.values.flat)))}")
            continue
        unit = axis.attrs.get("units", "1")
        print(f"  {name}: {axis.values.min():g} to {axis.values.max():g}{'' if unit == '1' else f' {unit}'}")
    if not {"contender", "time"} & set(result.dims):
        print("variables:", ", ".join(map(str, result.data_vars)))
    if "contender" in result.dims:
        from ringsweep.cli.precision_table import report

        print(report(result))
    else:
        summarise(result)
    configuration = json.loads(result.attrs.get("configuration", "{}"))
    print("solver:", json.dumps(configuration.get("solver", result.attrs.get("method"))))
    print("versions:", result.attrs["ringsweep_version"], result.attrs.get("versions", ""))


def schema_command(arguments: argparse.Namespace) -> None:
    from ringsweep.config.schema import schema

    print(json.dumps(schema(), indent=2, ensure_ascii=False))


def _selection(text: str) -> tuple[str, str]:
    """A coordinate and a value, from ``DIM=VALUE``."""
    name, equals, value = (part.strip() for part in text.partition("="))
    if not equals:
        raise InputError("--sel", f"{text!r} is not of the form DIM=VALUE")
    return name, value


def _outputs(name: str, mark: str, content: str) -> tuple[Path, Path]:
    """Dataset and picture to be written, both known to be writable before any work is done.

    A file that is there is replaced if it is a result of the same kind, known by a variable or dimension, and
    refused otherwise.
    """
    from ringsweep.storage import netcdf

    target = Path(name)
    netcdf.check_writable(target)
    picture = target.with_suffix(".png")
    if target == picture:
        raise InputError(name, "is where the picture goes: name the dataset *.nc")
    netcdf.check_writable(picture)
    if target.exists():
        netcdf.check_kind(target, mark, content)
    return target, picture
