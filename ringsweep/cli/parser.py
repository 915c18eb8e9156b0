"""Parser of the command line."""

from __future__ import annotations

import argparse
import math
import re
import shutil
from contextlib import suppress
from textwrap import dedent, indent
from typing import Any, NoReturn

from ringsweep.cli.commands import (
    animate_command,
    fit_command,
    info_command,
    init_command,
    map_command,
    plot_command,
    precision_command,
    run_command,
    schema_command,
    simulate_command,
    threshold_command,
    verify_command,
)
from ringsweep.errors import InputError, nearest_name, shortened


def build_parser() -> argparse.ArgumentParser:
    """Parser of all commands; the parsed arguments have the function of the command as ``command``."""
    parser = _Parser(
        prog="ringsweep",
        description="Regime maps of dry-friction systems whose friction coefficient jumps.",
        epilog="ringsweep COMMAND --help says more, with examples.\n\n"
        "exit status: 0 done; 2 the input is wrong; 130 stopped by Ctrl-C; 143 stopped by SIGTERM;\n"
        "1 anything else: an error, or every run has failed",
        formatter_class=_formatter,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version")
    _add_verbosity(parser)
    parser.set_defaults(quiet=False, verbose=False)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    init = _add_command(commands, "init", init_command, "write a first configuration, to be edited", """
        ringsweep init                     my-sweep.yaml: two balls in a ring
        ringsweep init --model belt belt.yaml
        ringsweep init --model ring-single-contact
        """)  # fmt: skip
    init.add_argument("config", nargs="?", default="my-sweep.yaml", metavar="NEW.yaml", help="default: my-sweep.yaml")
    models = ["ring", "ring-single-contact", "belt"]
    _option(init, "--model", "what it describes (default: ring)", choices=models, default="ring")

    run = _add_command(commands, "run", run_command, "run a sweep: NetCDF, and a regime map beside it", """
        ringsweep run my.yaml              my.nc and my.png; after a stop the same command goes on
        ringsweep run my.yaml --dry-run    cells, memory, disk, time; writes nothing
        ringsweep run my.yaml --jobs 1 -o results/one.nc
        ringsweep run my.yaml --set time.span=20 -o longer.nc
        ringsweep run finer.yaml --reuse my.nc
        ringsweep run my.yaml --refine     compute only the boundaries of the map
        ringsweep run my.nc -o again.nc    repeat the sweep of my.nc
        ringsweep run my.yaml --backend dask --scheduler tcp://host:8786
        """)  # fmt: skip
    run.add_argument("config", metavar="CONFIG.yaml", help="or OUT.nc, whose sweep is repeated")
    _option(run, "-o --output OUT.nc", "default: the configuration's name, in this folder")
    _option(run, *_SET, **_LIST)
    _option(run, *_JOBS, type=whole_number)
    _option(run, "--dry-run", "estimate memory, disk space and time; write nothing")
    _option(run, "--fresh", "start over: discard what an earlier run computed")
    _option(run, "--reuse OLD.nc", "take cells that this earlier sweep has too")
    _option(run, "--refine", "compute only the boundaries, audit the rest (see sweep.refine)")
    _option(run, "--backend", "what computes (default: threads of this machine)", choices=["threads", "dask"])
    _option(run, "--scheduler ADDRESS", "address of a Dask scheduler, such as tcp://host:8786")

    draw = _add_command(commands, "map", map_command, "draw a variable of a sweep", """
        ringsweep map my.nc                my.png: the regimes
        ringsweep map my.nc --var t_separation --x zone.half_angle
        ringsweep map my.nc --sel "zone.half_angle=15 deg" -o line.pdf
        ringsweep map my.nc -o my.html     a page for the browser: zoom, numbers of each cell, all variables
        ringsweep map my.nc --var origin   which cells of a refined sweep were run
        ringsweep map my.nc --boundaries separating --tolerance 1e-6
        """)  # fmt: skip
    draw.add_argument("dataset", metavar="OUT.nc")
    _option(draw, "-o --output MAP.png", "default: beside OUT.nc; .pdf, .svg and .html too")
    _option(draw, "--x DIM", "coordinate across")
    _option(draw, "--y DIM", "coordinate up")
    _option(draw, "--var V", "variable to draw (default: regime, or the place if there is a section along one axis)")
    held = "fix a coordinate at its value nearest to VALUE, with --boundaries at VALUE; units allowed"
    _option(draw, "--sel DIM=VALUE", held, **_LIST)
    _option(draw, "--log", "colours follow the logarithm of the numbers")
    _option(draw, "--boundaries REGIME", "locate the boundary of a regime: curves, also as NetCDF")
    _option(draw, "--tolerance T", "error of these, in SI units (default: 1e-6)", type=positive_number)

    threshold = _add_command(commands, "threshold", threshold_command,
        "the value of a number at which a regime begins or ends", """
        ringsweep threshold my.yaml --path drive.amplitude --regime separating
        ringsweep threshold my.yaml --path zone.half_angle --regime jammed --from "2 deg" --to "60 deg"
        ringsweep threshold my.yaml --path friction.rough.mu_k --regime separating --from 0.1 --to 0.5 --tolerance 1e-9
        """)  # fmt: skip
    threshold.add_argument("config", metavar="CONFIG.yaml", help="or OUT.nc, whose scene is run")
    _option(threshold, "--path PATH", "the number that varies: drive.amplitude", required=True)
    _option(threshold, "--regime REGIME", "the regime: separating; with impact also: tumbled", required=True)
    _option(threshold, "--from VALUE", "where to look; default: as the sweep has it", dest="low")
    _option(threshold, "--to VALUE", "units allowed", dest="high")
    _option(threshold, "--tolerance T", "largest error (default: 1e-6 of the greatest value)")
    _option(threshold, "--unit U", "unit of the answer: rpm (default: as the ends or the file have it)")
    _option(threshold, "--scan N", "runs in which changes of regime are looked for (default: 128)", type=whole_number)
    _option(threshold, *_JOBS, type=whole_number)
    _option(threshold, *_SET, **_LIST)

    fit = _add_command(commands, "fit", fit_command,
        "fit parameters of a scene to a measured time history", """
        ringsweep fit my.yaml --data run.csv --vary friction.rough.mu_k,zone.half_angle
        ringsweep fit my.yaml --data run.csv --vary "friction.rough.mu_k=0.1..0.6" --noise "0.5 deg"
        The first line of run.csv names the columns: t (s), and phi (deg) or x (mm).
        """)  # fmt: skip
    fit.add_argument("config", metavar="CONFIG.yaml", help="or OUT.nc, whose scene is fitted")
    _option(fit, "--data RUN.csv", "the measured history", required=True)
    _option(fit, "--vary PATHS", "numbers to fit: PATH or PATH=LOW..HIGH, separated by commas", required=True)
    _option(fit, "-o --output FIT.nc", "default: the configuration's name with -fit")
    _option(fit, "--start N", "minimisations, each from its start (default: 8)", type=whole_number, default=8)
    _option(fit, "--noise S", "standard deviation of a measurement (default: by the residuals)")
    _option(fit, *_SET, **_LIST)

    simulate = _add_command(commands, "simulate", simulate_command,
        "run once, or under each law of a sweep: history and its picture", """
        ringsweep simulate my.yaml         my-run.nc and my-run.png
        ringsweep simulate my.yaml --set drive.amplitude=4 --set "zone.half_angle=20 deg"
        ringsweep simulate my.nc --set drive.amplitude=4     the scene of my.nc, with this amplitude
        """)  # fmt: skip
    simulate.add_argument("config", metavar="CONFIG.yaml", help="or OUT.nc, whose scene is run")
    _option(simulate, "-o --output RUN.nc", "default: the configuration's name with -run")
    _option(simulate, *_SET, **_LIST)

    plot = _add_command(commands, "plot", plot_command, "draw a stored run, or stored errors against run time", """
        ringsweep plot my-run.nc           my-run.png: the time history
        ringsweep plot my-run.nc --from 3 --to 4 -o end.png
        ringsweep plot my-run.nc --kind phase -o portrait.pdf
        ringsweep plot my-run.nc --kind friction --law lugre
        ringsweep plot uncertain.nc --kind sensitivity --word separating --sel drive.amplitude=2
        """)  # fmt: skip
    stored = "what ringsweep simulate or precision wrote, or a sampled sweep"
    plot.add_argument("dataset", metavar="RUN.nc", help=stored)
    _option(plot, "-o --output RUN.png", "default: beside RUN.nc; .pdf and .svg too")
    kinds = "phase portrait, or friction force over sliding velocity (belt), in place of the time history; "
    kinds += "of a sampled sweep probabilities (default), survival, or Sobol indices"
    _option(plot, "--kind", kinds, choices=["phase", "friction", "probability", "survival", "sensitivity"])
    _option(plot, "--sel DIM=VALUE", "cell of a sampled sweep", **_LIST)
    _option(plot, "--word REGIME", "regime whose Sobol indices are drawn")
    _option(plot, "--law LAW", "the run under this friction law, if RUN.nc has several")
    _option(plot, "--from T", "draw the history from this time on", type=instant, dest="begin")
    _option(plot, "--to T", "draw the history up to this time; units allowed", type=instant, dest="end")

    animate = _add_command(commands, "animate", animate_command, "run once: film of the body", """
        ringsweep animate my.yaml          my-run.gif
        ringsweep animate my.yaml -o run.mp4 --set drive.amplitude=4
        ringsweep animate my.nc -o run.html  a page with buttons, for the scene of my.nc
        """)  # fmt: skip
    animate.add_argument("config", metavar="CONFIG.yaml", help="or OUT.nc, whose scene is run")
    _option(animate, "-o --output RUN.gif", "default: the configuration's name with -run; .mp4 and .html too")
    _option(animate, *_SET, **_LIST)

    precision = _add_command(commands, "precision", precision_command,
        "measure error against run time, and recommend a solver", """
        ringsweep precision my.yaml
        ringsweep precision my.yaml --target 1e-9 --cells 64
        """)  # fmt: skip
    precision.add_argument("config", metavar="CONFIG.yaml", help="or OUT.nc, whose sweep is taken")
    _option(precision, "-o --output OUT.nc", "default: the configuration's name with -precision")
    target = "largest error allowed: rad or m at the end, s at separation (default: 1e-6)"
    _option(precision, "--target E", target, type=positive_number)
    _option(precision, "--cells N", "number of cells to measure (default: 16)", type=whole_number)
    _option(precision, "--rounds N", "timings of each setting (default: 3)", type=whole_number)

    info = _add_command(commands, "info", info_command, "print a summary of a result file", "ringsweep info my.nc")
    info.add_argument("dataset", metavar="OUT.nc")
    info.add_argument("--cite", action="store_true", help="print only what a paper that uses it can cite")

    verify = _add_command(commands, "verify", verify_command, "check that files are what ringsweep wrote", """
        ringsweep verify my.nc             exit status 0, or 2 if it is damaged, was changed, or has no seal
        ringsweep verify results/*.nc
        """)  # fmt: skip
    verify.add_argument("files", nargs="+", metavar="FILE.nc")

    _add_command(commands, "schema", schema_command, "print the JSON schema of the configuration, for editors", """
        ringsweep schema > schema.json
        Editors with the YAML language server then check files whose first line is
            # yaml-language-server: $schema=schema.json
        """)  # fmt: skip

    completion = _add_command(commands, "completion", completion_command, "print a completion script for a shell", """
        ringsweep completion bash > ~/.local/share/bash-completion/completions/ringsweep
        ringsweep completion zsh > ~/.zfunc/_ringsweep
        ringsweep completion fish > ~/.config/fish/completions/ringsweep.fish
        """)  # fmt: skip
    completion.add_argument("shell", choices=["bash", "zsh", "fish", "tcsh"])
    return parser


def completion_command(arguments: argparse.Namespace) -> None:
    """Print a completion script for a shell."""
    import shtab

    print(shtab.complete(build_parser(), arguments.shell))


def _add_command(commands: Any, name: str, function: Any, summary: str, examples: str) -> argparse.ArgumentParser:
    """Add a command with its summary, examples, and the options of all commands."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.",
        epilog="examples:\n" + indent(dedent(examples).strip(), "  "),
        formatter_class=_formatter,
    )
    _add_verbosity(parser)
    parser.set_defaults(command=function, parser=parser)
    return parser


def _add_verbosity(parser: argparse.ArgumentParser) -> None:
    """Options that may stand before and after the command; without a default the one does not reset the other."""
    verbosity = parser.add_mutually_exclusive_group()
    for letter, name, summary in (
        ("-q", "--quiet", "print only warnings and errors"),
        ("-v", "--verbose", "print more, with the traceback of an unexpected error"),
    ):
        verbosity.add_argument(letter, name, action="store_true", default=argparse.SUPPRESS, help=summary)


def _formatter(prog: str) -> argparse.HelpFormatter:
    return argparse.RawDescriptionHelpFormatter(
        prog, max_help_position=28, width=min(shutil.get_terminal_size().columns - 2, 100)
    )


# Options that several commands have.
_SET = "--set PATH=VALUE", "change a value: drive.amplitude=3"
_JOBS = "--jobs N", "threads (default: all cores)"

# Of an option that may be repeated.
_LIST: dict[str, Any] = {"action": "append", "default": []}


def _option(parser: argparse.ArgumentParser, spelling: str, summary: str, **more: Any) -> None:
    """Add an option: its names, and what its value is called, if it has one that is no choice."""
    names = [word for word in spelling.split() if word.startswith("-")]
    value = spelling.removeprefix(" ".join(names)).strip()
    if not value and "choices" not in more:
        more["action"] = "store_true"
    if value:
        more["metavar"] = value
    parser.add_argument(*names, help=summary, **more)


class _Version(argparse.Action):
    """Prints the version; to look it up takes as long as all else that ``--help`` needs."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> NoReturn:
        from importlib.metadata import version

        print("ringsweep", version("ringsweep"))
        parser.exit()


class _Parser(argparse.ArgumentParser):
    """A parser whose messages quote only the start of a long argument."""

    def error(self, message: str) -> NoReturn:
        """End the process with a message."""
        if wrong := re.match(r"argument COMMAND: invalid choice: '([^']*)' \(choose from (.*)\)", message):
            near = nearest_name(wrong[1], re.findall(r"[a-z]+", wrong[2]))
            message += f"; did you mean `{near}`?" if near else ""
        super().error(shortened(message, 1000))


def whole_number(text: str) -> int:
    """A whole number of at least 1, from an argument."""
    if not text.isdecimal() or len(text) > 18 or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of at least 1")
    return int(text)


def instant(text: str) -> float:
    """A time in seconds, from an argument that may have a unit."""
    from ringsweep.quantities.parameters import Parameter
    from ringsweep.quantities.units import quantity

    try:
        return quantity(text, Parameter("s", "the time"), "time")
    except InputError as error:
        raise argparse.ArgumentTypeError(error.problem) from None


def positive_number(text: str) -> float:
    """A finite number greater than 0, from an argument."""
    with suppress(ValueError):
        if 0.0 < float(text) < math.inf:
            return float(text)
    raise argparse.ArgumentTypeError(f"{text!r} is not a number greater than 0")
