"""Commands of the command line.

Modules that are slow to import are imported where they are needed, so that ``--help`` and errors in the input come
quickly.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Callable, Iterable
from contextlib import redirect_stdout, suppress
from pathlib import Path
from typing import Any

import ringsweep
from ringsweep.errors import InputError, print_error

logger = logging.getLogger("ringsweep")


def init_command(arguments: argparse.Namespace) -> None:
    """Write a first configuration, to be edited.

    ringsweep init                     my-sweep.yaml: two balls in a ring
    ringsweep init --model belt belt.yaml
    ringsweep init --model ring-single-contact
    """
    from importlib.resources import files

    from ringsweep.storage.files import check_writable, replacing

    target = Path(arguments.config)
    check_writable(target)
    if target.exists():
        raise InputError(str(target), "exists already: name another file")
    if target.suffix not in (".yaml", ".yml"):
        raise InputError(str(target), "is not the name of a configuration: name it *.yaml")
    text = (files("ringsweep.cli") / "templates" / f"{arguments.model}.yaml").read_text(encoding="utf-8")
    try:
        with replacing(target) as temporary:
            temporary.write_text(text.replace("{name}", str(target)), encoding="utf-8")
    except OSError as error:
        raise InputError(str(target), f"cannot be written: {error.strerror or error}") from error
    print(f"wrote {target}; next: ringsweep run {target}")


def run_command(arguments: argparse.Namespace) -> int:
    """Run a sweep: NetCDF, and a regime map beside it.

    ringsweep run my.yaml              my.nc and my.png; after a stop the same command goes on
    ringsweep run my.yaml --dry-run    cells, memory, disk, time; writes nothing
    ringsweep run my.yaml --jobs 1 -o results/one.nc
    ringsweep run my.yaml --set time.span=20 -o longer.nc
    ringsweep run finer.yaml --reuse my.nc
    ringsweep run my.yaml --refine     compute only the boundaries of the map
    ringsweep run my.nc -o again.nc    repeat the sweep of my.nc
    ringsweep run my.yaml --backend dask --scheduler tcp://host:8786
    """
    from ringsweep.config import load
    from ringsweep.runs.plans import plan_of

    if arguments.backend == "dask" and arguments.scheduler is None:
        raise InputError("--backend", "dask needs the address of its scheduler: --scheduler ADDRESS")
    if arguments.backend == "threads" and arguments.scheduler is not None:
        raise InputError("--scheduler", "is for --backend dask")
    config = load(arguments.config, arguments.set, refine=arguments.refine or None)
    name = f"{config.name}.nc" if arguments.output is None else arguments.output
    target, picture = _outputs(name, *plan_of(config).kind, (config.begins_from,))

    if arguments.dry_run:
        from ringsweep.runs.needs import describe

        for option, given in (("--backend dask", arguments.scheduler), ("--json", arguments.json)):
            if given:
                raise InputError("--dry-run", f"measures threads of this machine, and prints text: leave {option} out")
        print(describe(config, target, arguments.jobs, arguments.reuse))
        return 0

    from ringsweep.report.text import as_json, in_lines, status_of
    from ringsweep.runs.executors import Execution
    from ringsweep.runs.sweep import write
    from ringsweep.storage import netcdf

    if arguments.scheduler is not None and not arguments.verbose:
        _silence_dask()
    execution = Execution(arguments.jobs, arguments.scheduler, not arguments.quiet)
    out = sys.stdout
    # Whoever reads JSON wants nothing else.
    with redirect_stdout(sys.stderr if arguments.json else out):
        if computed := write(config, target, execution, fresh=arguments.fresh, reuse=arguments.reuse):
            print(f"wrote {target}")
        else:
            print(f"{target} holds this sweep already (--fresh computes it again)")
        with netcdf.reading(target) as result:
            print(as_json(result) if arguments.json else in_lines(result), file=out)
            status = status_of(result)
            if not computed and picture.exists() and picture.stat().st_mtime >= target.stat().st_mtime:
                return status
            if config.axes.sizes or config.sample is not None:
                _draw(lambda: ringsweep.plots.regime_map(result), picture, f"ringsweep map {target}")
    return status


def _draw(figure: Callable[[], Any], picture: Path, command: str) -> None:
    """Draw the picture of a dataset. The dataset is complete, so a picture that fails is only a warning."""
    from ringsweep.cli.drawing import save

    try:
        save(figure(), picture)
    except BrokenPipeError:
        # The picture is there, but nobody reads the output.
        raise
    except Exception as error:
        reason = error.problem if isinstance(error, InputError) else error
        logger.warning("%s is not drawn: %s (draw one with %s)", picture, reason, command)
        logger.debug("where the picture failed", exc_info=True)


def _silence_dask() -> None:
    """Suppress the tracebacks that Dask logs when a connection is lost: ringsweep reports it in one line."""
    with suppress(ImportError):
        # The import sets the levels of its loggers, so it must come first.
        import distributed  # noqa: F401
    for name in ("distributed", "tornado", "asyncio", *logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("distributed", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL)


def _store(result: Any, target: Path, picture: Path, text: str, draw: str) -> None:
    """Write a dataset, print what it says, and draw it by a function of `ringsweep.plots`."""
    from ringsweep.storage import netcdf

    netcdf.save(result, target)
    print(text)
    print(f"wrote {target}")
    _draw(lambda: getattr(ringsweep.plots, draw)(result), picture, f"ringsweep plot {target}")


def map_command(arguments: argparse.Namespace) -> None:
    """Draw a variable of a sweep.

    ringsweep map my.nc                my.png: the regimes
    ringsweep map my.nc --var t_separation --x zone.half_angle
    ringsweep map my.nc --sel "zone.half_angle=15 deg" -o line.pdf
    ringsweep map my.nc -o my.html     a page for the browser: zoom, numbers of each cell, all variables
    ringsweep map my.nc --var origin   which cells of a refined sweep were run
    ringsweep map my.nc --boundaries separating --tolerance 1e-6
    """
    from ringsweep.cli import drawing

    drawing.draw_stored(arguments, drawing.draw_map)


def plot_command(arguments: argparse.Namespace) -> None:
    """Draw a stored run, or stored errors against run time.

    ringsweep plot my-run.nc           my-run.png: the time history
    ringsweep plot my-run.nc --from 3 --to 4 -o end.png
    ringsweep plot my-run.nc --kind phase -o portrait.pdf
    ringsweep plot my-run.nc --kind friction --law lugre
    ringsweep plot uncertain.nc --kind sensitivity --word separating --sel drive.amplitude=2
    """
    from ringsweep.cli import drawing

    drawing.draw_stored(arguments, drawing.draw_plot)


def report_command(arguments: argparse.Namespace) -> None:
    """Write one page about a sweep, to send to a colleague.

    ringsweep report my.nc             my-report.html: map, thresholds, shocks, certificates, what to cite
    """
    from ringsweep.cli import drawing
    from ringsweep.report.page import report

    def write(_: argparse.Namespace, dataset: Path, result: Any) -> None:
        target = arguments.output or dataset.with_name(f"{dataset.stem}-report.html")
        report(result, target)
        print(f"wrote {target}")

    drawing.draw_stored(arguments, write)


def simulate_command(arguments: argparse.Namespace) -> int:
    """Run once, or under each law of a sweep: history and its picture.

    ringsweep simulate my.yaml         my-run.nc and my-run.png
    ringsweep simulate my.yaml --set drive.amplitude=4 --set "zone.half_angle=20 deg"
    ringsweep simulate my.nc --sel drive.amplitude=4     the cell of my.nc at or beside this amplitude
    ringsweep simulate my.nc --set drive.amplitude=4     the scene of my.nc, with this amplitude
    """
    config = _single_run(arguments)
    inputs = arguments.config, config.begins_from
    target, picture = _outputs(arguments.output or f"{config.name}-run.nc", "time", "history", inputs)

    from ringsweep.report.text import events_in_words, status_of
    from ringsweep.runs.simulate import history

    result = history(config)
    _store(result, target, picture, f"{result.attrs['outcome']}\n{events_in_words(result)}", "history")
    return status_of(result)


def _single_run(arguments: argparse.Namespace) -> Any:
    """Configuration of the run of a scene, or of a cell of a file, with the values that are set."""
    from dataclasses import replace

    from ringsweep.config import with_values

    if not arguments.sel:
        return with_values(arguments.config, arguments.set)
    from ringsweep.cli.drawing import selection_of
    from ringsweep.config.reading import is_result
    from ringsweep.storage import netcdf

    if not is_result(Path(arguments.config)):
        raise InputError("--sel", f"names a cell of a result file, and {arguments.config} is none: --set PATH=VALUE")
    with netcdf.reading(arguments.config) as result:
        cell = ringsweep.plots.cell(result, dict(map(selection_of, arguments.sel)))
    return replace(with_values(cell, arguments.set), name=Path(arguments.config).stem)


def threshold_command(arguments: argparse.Namespace) -> None:
    """The value of a number at which a regime begins or ends.

    ringsweep threshold my.yaml --path drive.amplitude --regime separating
    ringsweep threshold my.yaml --path zone.half_angle --regime jammed --from "2 deg" --to "60 deg"
    ringsweep threshold my.yaml --path friction.rough.mu_k --regime separating --from 0.1 --to 0.5 --tolerance 1e-9
    ringsweep threshold my.yaml --path drive.amplitude --regime separating --unit rpm --json -o edge.nc
    """
    from ringsweep.config import load
    from ringsweep.report.text import as_json
    from ringsweep.runs.thresholds import in_words, threshold
    from ringsweep.storage import netcdf

    if arguments.output is not None:
        mark = "vertex" if load(arguments.config).sample is None else "threshold"
        _outputs(arguments.output, mark, "threshold", [arguments.config])
    asked = arguments.config, arguments.path, arguments.regime, (arguments.low, arguments.high), arguments.tolerance
    options = {"set": arguments.set, "scan": arguments.scan, "jobs": arguments.jobs, "unit": arguments.unit}
    found = threshold(*asked, **options)
    print(as_json(found) if arguments.json else in_words(found))
    if arguments.output is not None:
        netcdf.save(found, arguments.output)
        logger.info("wrote %s", arguments.output)


def fit_command(arguments: argparse.Namespace) -> None:
    """Fit parameters of a scene to a measured time history.

    ringsweep fit my.yaml --data run.csv --vary friction.rough.mu_k,zone.half_angle
    ringsweep fit my.yaml --data run.csv --vary "friction.rough.mu_k=0.1..0.6" --noise "0.5 deg"
    The first line of run.csv names the columns: t (s), and phi (deg) or x (mm).
    """
    from ringsweep.config import load
    from ringsweep.runs.fit import dataset, fitted

    config = load(arguments.config, arguments.set)
    target, picture = _outputs(arguments.output or f"{config.name}-fit.nc", "residual", "fit")
    result = dataset(fitted(config, arguments.data, arguments.vary, arguments.start, arguments.noise))
    _store(result, target, picture, result.attrs["fit_report"], "fit")


def animate_command(arguments: argparse.Namespace) -> int:
    """Run once: film of the body.

    ringsweep animate my.yaml          my-run.gif
    ringsweep animate my.yaml -o run.mp4 --set drive.amplitude=4
    ringsweep animate my.nc -o run.html  a page with buttons, for the scene of my.nc
    """
    from ringsweep.models import MODELS

    config = _single_run(arguments)
    target = arguments.output or f"{config.name}-run.gif"
    model = config.scene.structure.model
    if not MODELS[model].driven:
        raise InputError("scene.model", f"{model}: no ring or belt to animate; ringsweep simulate draws the history")
    if config.axes.sizes:
        raise InputError("sweep", "several friction laws: name the one to animate by --set friction.law=...")

    from ringsweep.plots.films import check_animation
    from ringsweep.report.text import status_of
    from ringsweep.runs.simulate import history

    check_animation(target)
    result = history(config)
    ringsweep.plots.save_animation(result, target, progress=not arguments.quiet)
    print(result.attrs["outcome"])
    print(f"wrote {target}")
    return status_of(result)


def precision_command(arguments: argparse.Namespace) -> None:
    """Measure error against run time, and recommend a solver.

    ringsweep precision my.yaml
    ringsweep precision my.yaml --target 1e-9 --cells 64
    """
    from ringsweep.config import load

    name = arguments.output or f"{load(arguments.config).name}-precision.nc"
    target, picture = _outputs(name, "contender", "error against run time")

    from ringsweep.report.text import in_lines

    options = {name: value for name, value in vars(arguments).items() if name in ("target", "cells", "rounds")}
    result = ringsweep.precision(arguments.config, **options, progress=not arguments.quiet)
    _store(result, target, picture, in_lines(result), "work_precision")


def info_command(arguments: argparse.Namespace) -> None:
    """Print a summary of a result file.

    ringsweep info my.nc
    ringsweep info uncertain.nc --sel drive.amplitude=2     probabilities of one cell
    """
    from ringsweep.storage import netcdf

    # A file without seal is told of where it is read.
    sealed = netcdf.check(arguments.dataset)
    with netcdf.reading(arguments.dataset) as result:
        if arguments.cite:
            from ringsweep.config import load
            from ringsweep.storage.provenance import references

            print(references(load(arguments.dataset), result.attrs["ringsweep_version"]))
            return
        from ringsweep.cli.drawing import selection_of
        from ringsweep.plots.selection import select
        from ringsweep.report.text import about, as_json

        result, _ = select(result, dict(map(selection_of, arguments.sel)))
        print(as_json(result) if arguments.json else about(result))
    if sealed and not arguments.json:
        print("seal: the file is what ringsweep wrote")


def verify_command(arguments: argparse.Namespace) -> int:
    """Check that files are what ringsweep wrote.

    ringsweep verify my.nc             exit status 0, or 2 if it is damaged, was changed, or has no seal
    ringsweep verify results/*.nc
    """
    from ringsweep.storage import netcdf

    status = 0
    for file in arguments.files:
        try:
            netcdf.verify(file)
        except InputError as error:
            status = 2
            print_error(str(error))
        else:
            print(f"{file}: is what ringsweep wrote")
    return status


def schema_command(arguments: argparse.Namespace) -> None:
    """Print the JSON schema of the configuration, for editors.

    ringsweep schema > schema.json
    Editors with the YAML language server then check files whose first line is
        # yaml-language-server: $schema=schema.json
    """
    import json

    from ringsweep.config.schema import schema

    print(json.dumps(schema(), indent=2, ensure_ascii=False))


def _outputs(name: str, mark: str, content: str, inputs: Iterable[str | None] = ()) -> tuple[Path, Path]:
    """Paths of the dataset and of its picture, checked before any computation.

    Parameters
    ----------
    name : str
        Path of the dataset.
    mark, content : str
        Kind of the result; see :func:`ringsweep.storage.netcdf.check_kind`.
    inputs : iterable of str, optional
        Files from which the result is computed.

    Raises
    ------
    InputError
        If one of them cannot be written, or would replace a file that is no result of this kind, or an input.
    """
    from ringsweep.storage import files, netcdf

    target = Path(name)
    files.check_writable(target)
    picture = target.with_suffix(".png")
    if target.suffix.lower() not in (".nc", ".nc4", ".h5", ".hdf5"):
        raise InputError(name, "is no name of a dataset: name it *.nc; the picture is beside it")
    files.check_writable(picture)
    if target.exists():
        if any(file is not None and target.samefile(file) for file in inputs):
            raise InputError(str(target), "is the input: name another output")
        netcdf.check_kind(target, mark, content)
    return target, picture
