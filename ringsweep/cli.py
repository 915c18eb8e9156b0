"""Command line: verbs, each a few lines over the Python calls."""

from __future__ import annotations

import argparse
import json
import logging
import math
import os
import shutil
import sys
import traceback
from collections.abc import Sequence
from contextlib import nullcontext, redirect_stdout, suppress
from pathlib import Path
from textwrap import dedent, indent
from typing import TYPE_CHECKING, Any

from ringsweep.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from ringsweep.config import Config


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; the exit status is 0 if done, 2 if the input is wrong, 1 for anything else."""
    parser = _parser()
    given = sys.argv[1:] if argv is None else list(argv)
    if not given:
        parser.print_help()
        return 2
    arguments, unknown = parser.parse_known_args(given)
    if unknown:
        takes_values = any(option in given for option in ("--set", "--sel"))
        hint = "; what has a space wants quotes: --set 'drive.amplitude=2 rad/s'" if takes_values else ""
        parser.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
    told = logging.getLogger("ringsweep")
    logging.basicConfig(stream=sys.stderr, level=logging.WARNING)
    logging.getLogger().handlers[0].setFormatter(_Words(_is_coloured(sys.stderr)))
    told.setLevel(logging.DEBUG if arguments.verbose else logging.WARNING if arguments.quiet else logging.INFO)
    try:
        with redirect_stdout(None) if arguments.quiet else nullcontext():
            arguments.verb(arguments)
    except InputError as error:
        return _fail(str(error), 2)
    except KeyboardInterrupt as error:
        return _fail("interrupted", 130, error)
    except BrokenPipeError:
        # What reads the output, as `head` does, has enough.
        sys.stdout = None
        return 0
    except Exception as error:
        if arguments.verbose:
            traceback.print_exception(error)
        return _fail(f"{type(error).__name__}: {error}", 1, error)
    return 0


def _fail(message: str, status: int, error: BaseException | None = None) -> int:
    notes = getattr(error, "__notes__", [])
    prefix = "\033[1;31mringsweep:\033[0m" if _is_coloured(sys.stderr) else "ringsweep:"
    print(prefix, " ".join("; ".join([message, *notes]).split()), file=sys.stderr)
    return status


def _is_coloured(stream: Any) -> bool:
    return stream.isatty() and "NO_COLOR" not in os.environ and os.environ.get("TERM") != "dumb"


class _Words(logging.Formatter):
    """What is told besides results: one line each, warnings in colour on a terminal."""

    def __init__(self, coloured: bool):
        super().__init__("ringsweep: %(message)s")
        self.coloured = coloured

    def format(self, record: logging.LogRecord) -> str:
        text = super().format(record)
        if self.coloured and record.levelno >= logging.WARNING:
            return text.replace("ringsweep:", "\033[33mringsweep:\033[0m", 1)
        return text


# ---- what can be asked -----------------------------------------------------------------------


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="ringsweep",
        description="Regime maps of dry-friction systems whose friction coefficient jumps.",
        epilog="ringsweep COMMAND --help tells more, with examples.",
        formatter_class=_formatter,
    )
    parser.add_argument("--version", action=_Version)
    _loudness(parser)
    parser.set_defaults(quiet=False, verbose=False)
    verbs = parser.add_subparsers(required=True, metavar="COMMAND")

    init = _verb(verbs, "init", _init, "write a configuration to start from", """
        ringsweep init                     my-sweep.yaml: two balls in a ring
        ringsweep init --model belt belt.yaml
        """)  # fmt: skip
    init.add_argument("config", nargs="?", default="my-sweep.yaml", metavar="NEW.yaml", help="default: my-sweep.yaml")
    init.add_argument("--model", choices=["ring", "belt"], default="ring", help="what it describes (default: ring)")

    run = _verb(verbs, "run", _run, "run a sweep: NetCDF, and a regime map beside it", """
        ringsweep run my.yaml              my.nc and my.png; the same again goes on after a stop
        ringsweep run my.yaml --jobs 1 -o results/one.nc
        ringsweep run finer.yaml --reuse my.nc
        ringsweep run my.nc -o again.nc    the sweep that my.nc holds
        ringsweep run my.yaml --backend dask --scheduler tcp://host:8786
        """)  # fmt: skip
    run.add_argument("config", metavar="CONFIG.yaml", help="or OUT.nc, whose sweep is repeated")
    run.add_argument("-o", "--output", metavar="OUT.nc", help="default: the configuration's name, in this folder")
    run.add_argument("--jobs", type=whole_number, metavar="N", help="threads (default: all cores)")
    run.add_argument("--fresh", action="store_true", help="start over: discard what an earlier run has left")
    run.add_argument("--reuse", metavar="OLD.nc", help="take the cells that it shares with this earlier sweep")
    run.add_argument("--backend", choices=["threads", "dask"], help="who computes (default: threads of this machine)")
    run.add_argument("--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers compute, as tcp://host:8786")

    draw = _verb(verbs, "map", _map, "draw a variable of a sweep", """
        ringsweep map my.nc                my.png: the regimes
        ringsweep map my.nc --var t_separation --x zone.half_angle
        ringsweep map my.nc --sel "zone.half_angle=15 deg" -o line.pdf
        """)  # fmt: skip
    draw.add_argument("dataset", metavar="OUT.nc")
    draw.add_argument("-o", "--output", metavar="MAP.png", help="default: beside OUT.nc; .pdf and .svg too")
    draw.add_argument("--x", metavar="DIM", help="coordinate across")
    draw.add_argument("--y", metavar="DIM", help="coordinate up")
    draw.add_argument("--var", default="regime", metavar="V", help="variable to draw (default: regime)")
    draw.add_argument(
        "--sel", action="append", default=[], metavar="DIM=VALUE", help="hold at the nearest value; units allowed"
    )

    simulate = _verb(verbs, "simulate", _simulate,
        "run once, or under each law of a sweep: history and a picture of it", """
        ringsweep simulate my.yaml         my-run.nc and my-run.png
        ringsweep simulate my.yaml --set drive.amplitude=4 --set "zone.half_angle=20 deg"
        ringsweep simulate my.nc --set drive.amplitude=4     the scene that my.nc holds, with this amplitude
        """)  # fmt: skip
    simulate.add_argument("config", metavar="CONFIG.yaml", help="or OUT.nc, whose scene is run")
    simulate.add_argument("-o", "--output", metavar="RUN.nc", help="default: the configuration's name with -run")
    _settings(simulate)

    animate = _verb(verbs, "animate", _animate, "run once: a film of the body in the ring", """
        ringsweep animate my.yaml          my-run.gif
        ringsweep animate my.yaml -o run.mp4 --set drive.amplitude=4
        ringsweep animate my.nc -o run.html  a page with buttons, of the scene that my.nc holds
        """)  # fmt: skip
    animate.add_argument("config", metavar="CONFIG.yaml", help="or OUT.nc, whose scene is run")
    animate.add_argument(
        "-o", "--output", metavar="RUN.gif", help="default: the configuration's name with -run; .mp4 and .html too"
    )
    _settings(animate)

    precision = _verb(verbs, "precision", _precision,
        "error against run time for this scene, and the cheapest solver", """
        ringsweep precision my.yaml
        ringsweep precision my.yaml --target 1e-9 --cells 64
        """)  # fmt: skip
    precision.add_argument("config", metavar="CONFIG.yaml", help="or OUT.nc, whose sweep is taken")
    precision.add_argument("-o", "--output", metavar="OUT.nc", help="default: the configuration's name with -precision")
    precision.add_argument(
        "--target",
        type=positive_number,
        metavar="E",
        help="largest error allowed: rad or m at the end, s at separation (default: 1e-6)",
    )
    precision.add_argument("--cells", type=whole_number, metavar="N", help="cells to draw from the sweep (default: 16)")
    precision.add_argument("--rounds", type=whole_number, metavar="N", help="timings of each setting (default: 3)")

    info = _verb(verbs, "info", _info, "tell what a result file holds", "ringsweep info my.nc")
    info.add_argument("dataset", metavar="OUT.nc")

    _verb(verbs, "schema", _schema, "print the JSON schema of the configuration, for editors", """
        ringsweep schema > schema.json
        Editors that know YAML's language server then check what begins with
            # yaml-language-server: $schema=schema.json
        """)  # fmt: skip

    completion = _verb(verbs, "completion", _completion, "print what lets a shell complete these commands", """
        ringsweep completion bash > ~/.local/share/bash-completion/completions/ringsweep
        ringsweep completion zsh > ~/.zfunc/_ringsweep
        """)  # fmt: skip
    completion.add_argument("shell", choices=["bash", "zsh", "tcsh"])
    return parser


def _verb(verbs: Any, name: str, function: Any, words: str, examples: str) -> argparse.ArgumentParser:
    """A command with what all have in common."""
    parser: argparse.ArgumentParser = verbs.add_parser(
        name,
        help=words,
        description=f"{words[0].upper()}{words[1:]}.",
        epilog="examples:\n" + indent(dedent(examples).strip(), "  "),
        formatter_class=_formatter,
    )
    _loudness(parser)
    parser.set_defaults(verb=function)
    return parser


def _loudness(parser: argparse.ArgumentParser) -> None:
    """May be asked for before the command and after it: where it is not, what was said before stands."""
    loudness = parser.add_mutually_exclusive_group()
    for letter, name, words in (
        ("-q", "--quiet", "tell only what is wrong"),
        ("-v", "--verbose", "tell more, and where an unexpected error arose"),
    ):
        loudness.add_argument(letter, name, action="store_true", default=argparse.SUPPRESS, help=words)


def _formatter(prog: str) -> argparse.HelpFormatter:
    return argparse.RawDescriptionHelpFormatter(
        prog, max_help_position=28, width=min(shutil.get_terminal_size().columns - 2, 100)
    )


def _settings(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set", action="append", default=[], metavar="PATH=VALUE", help="change a value, as drive.amplitude=3"
    )


class _Version(argparse.Action):
    """Prints the version; it is looked up when asked for."""

    def __init__(self, **options: Any):
        super().__init__(**options, nargs=0, help="print the version")

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        parser.exit(message=f"ringsweep {version('ringsweep')}\n")


def whole_number(text: str) -> int:
    # Of a bare ValueError argparse would show the name of this function.
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of at least 1")
    return int(text)


def positive_number(text: str) -> float:
    # "nan" compares as false.
    with suppress(ValueError):
        if 0.0 < float(text) < math.inf:
            return float(text)
    raise argparse.ArgumentTypeError(f"{text!r} is not a number greater than 0")


# ---- what is done ----------------------------------------------------------------------------


def _init(arguments: argparse.Namespace) -> None:
    from importlib.resources import files

    target = Path(arguments.config)
    if target.exists():
        raise InputError(str(target), "is there already: name another file")
    if target.suffix not in (".yaml", ".yml"):
        raise InputError(str(target), "is no name for a configuration: name it *.yaml")
    text = (files("ringsweep") / "templates" / f"{arguments.model}.yaml").read_text(encoding="utf-8")
    try:
        target.write_text(text.replace("{name}", str(target)), encoding="utf-8")
    except OSError as error:
        raise InputError(str(target), f"cannot be written: {error.strerror or error}") from error
    print(f"wrote {target}; next: ringsweep run {target}")


def _completion(arguments: argparse.Namespace) -> None:
    import shtab

    print(shtab.complete(_parser(), arguments.shell))


def _run(arguments: argparse.Namespace) -> None:
    from ringsweep.config import load

    if arguments.backend == "dask" and arguments.scheduler is None:
        raise InputError("--backend", "dask needs the address of its scheduler: --scheduler ADDRESS")
    if arguments.backend == "threads" and arguments.scheduler is not None:
        raise InputError("--scheduler", "is for --backend dask")
    config = load(arguments.config)
    target, picture = _outputs(f"{config.name}.nc" if arguments.output is None else arguments.output, "regime", "sweep")

    from ringsweep import plots
    from ringsweep.engine import write
    from ringsweep.storage import netcdf

    if arguments.scheduler is not None and not arguments.verbose:
        _silence_dask()
    options = {name: getattr(arguments, name) for name in ("jobs", "fresh", "reuse", "scheduler")}
    if computed := write(config, target, **options, progress=not arguments.quiet):
        print(f"wrote {target}")
    else:
        print(f"{target} holds this sweep already (--fresh runs it again)")
    with netcdf.open_dataset(target) as result:
        _summarise(result)
        _warn_of_stiffness(result, config)
        _warn_of_launch(result)
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


def _map(arguments: argparse.Namespace) -> None:
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


def _simulate(arguments: argparse.Namespace) -> None:
    from ringsweep.config import with_values

    config = with_values(arguments.config, arguments.set)
    target, picture = _outputs(arguments.output or f"{config.name}-run.nc", "time", "history")

    from ringsweep import plots
    from ringsweep.single import history
    from ringsweep.storage import netcdf

    result = history(config)
    netcdf.save(result, target)
    plots.save(plots.history(result), picture)
    print(result.attrs["outcome"])
    _warn_of_stiffness(result, config)
    _warn_of_launch(result)
    print(f"wrote {target}\nwrote {picture}")


def _animate(arguments: argparse.Namespace) -> None:
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
    from ringsweep.single import history

    check_animation(target)
    result = history(config)
    plots.save_animation(result, target)
    print(result.attrs["outcome"])
    print(f"wrote {target}")


def _precision(arguments: argparse.Namespace) -> None:
    from ringsweep.config import load

    config = load(arguments.config)
    target, picture = _outputs(arguments.output or f"{config.name}-precision.nc", "contender", "error against run time")

    from ringsweep import plots
    from ringsweep.storage import netcdf
    from ringsweep.work import measure, report

    given = {name: getattr(arguments, name) for name in ("target", "cells", "rounds")}
    options = {name: value for name, value in given.items() if value is not None}
    result = measure(config, **options, progress=not arguments.quiet)
    netcdf.save(result, target)
    plots.save(plots.work_precision(result), picture)
    print(report(result))
    print(f"wrote {target}\nwrote {picture}")


def _info(arguments: argparse.Namespace) -> None:
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
        from ringsweep.work import report

        print(report(result))
    else:
        _summarise(result)
    configuration = json.loads(result.attrs.get("configuration", "{}"))
    print("solver:", json.dumps(configuration.get("solver", result.attrs.get("method"))))
    print("versions:", result.attrs["ringsweep_version"], result.attrs.get("versions", ""))


def _schema(arguments: argparse.Namespace) -> None:
    from ringsweep.config.schema import schema

    print(json.dumps(schema(), indent=2, ensure_ascii=False))


def _summarise(result: xr.Dataset) -> None:
    """Print how many cells there are, and the share of each regime."""
    import numpy as np

    regime = result["regime"]
    print("cells:", regime.size)
    meanings = str(regime.attrs["flag_meanings"]).split()
    for flag, meaning in zip(np.atleast_1d(regime.attrs["flag_values"]), meanings, strict=True):
        count = int((regime == flag).sum())
        if count:
            print(f"  {meaning}: {count} ({count / regime.size:.1%})")
    if "certified" in result:
        share = float((result["certified"] == 1).mean())
        # All is said only of all.
        print(f"certified: {share if share == 1.0 else min(share, 0.999):.1%}")
    stated = [str(name).removesuffix("_error") for name in result.data_vars if str(name).endswith("_error")]
    if stated:
        print("bounds on errors (median, largest):")
    for name in stated:
        bounds = result[f"{name}_error"].values
        bounds = bounds[np.isfinite(bounds)]
        unit = result[name].attrs.get("units", "")
        if bounds.size:
            print(f"  {name}: {np.median(bounds):.1e}, {bounds.max():.1e} {unit}")


def _warn_of_stiffness(result: xr.Dataset, config: Config) -> None:
    """Say which share of the cells a fixed step cannot follow, and which step could."""
    import numpy as np

    if "stiffness" not in result:
        return
    from ringsweep.solvers.rk4 import STABILITY_LIMIT

    stiffness = result["stiffness"].values
    beyond = ~(stiffness <= STABILITY_LIMIT)
    if not beyond.any():
        return
    if np.isfinite(stiffness[beyond]).all():
        remedy = f"about {config.solver.steps * stiffness[beyond].max() / STABILITY_LIMIT:.2g} steps would be needed"
    else:
        remedy = "no step is small enough for a friction law that jumps"
    logging.getLogger("ringsweep").warning(
        "%.1f %% of the cells went beyond the limit of stability of rk4 (stiffness above %.4g) "
        "and may be wrong in kind: %s; solver auto needs none",
        100.0 * beyond.mean(),
        STABILITY_LIMIT,
        remedy,
    )


def _warn_of_launch(result: xr.Dataset) -> None:
    """Say if most runs are over as they begin, which a forgotten unit can do."""
    share = float((result["t_end"] == 0.0).mean())
    if share > 0.5:
        logging.getLogger("ringsweep").warning(
            "%s at t = 0: is a unit or the launch other than meant?",
            "the run ends" if result["t_end"].size == 1 else f"{share:.0%} of the runs end",
        )


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
