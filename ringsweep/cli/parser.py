"""Parser of the command line."""

from __future__ import annotations

import argparse
import re
import shutil
from collections.abc import Callable
from textwrap import dedent, indent
from typing import Any, NoReturn

from ringsweep.cli import commands
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
    entries = parser.add_subparsers(required=True, metavar="COMMAND")

    first = "my-sweep.yaml"
    init = _add_command(
        entries, commands.init_command, "config NEW.yaml", f"default: {first}", nargs="?", default=first
    )
    models = {"ring": "two balls (default)", "ring-single-contact": "a drum", "belt": "a mass on a spring"}
    models |= {"belt-pair": "two coupled masses on a belt"}
    _option(init, "--model", "; ".join(map(": ".join, models.items())), choices=list(models), default="ring")

    run = _add_command(entries, commands.run_command, "config CONFIG.yaml", "or OUT.nc, whose sweep is repeated")
    _option(run, "-o --output OUT.nc", "default: the configuration's name, in this folder")
    _options(run, _SET, _JOBS, _JSON)
    _option(run, "--dry-run", "estimate memory, disk space and time; write nothing")
    _option(run, "--fresh", "start over: discard what an earlier run computed")
    _option(run, "--reuse OLD.nc", "take cells that this earlier sweep has too")
    _option(run, "--refine", "compute only the boundaries, audit the rest (see sweep.refine)")
    _option(run, "--backend", "what computes (default: threads of this machine)", choices=["threads", "dask"])
    _option(run, "--scheduler ADDRESS", "address of a Dask scheduler, such as tcp://host:8786")

    draw = _add_command(entries, commands.map_command, "dataset OUT.nc")
    _option(draw, "-o --output MAP.png", "default: beside OUT.nc; .pdf, .svg and .html too")
    _option(draw, "--x DIM", "coordinate across")
    _option(draw, "--y DIM", "coordinate up")
    _option(draw, "--var V", "variable to draw (default: regime, or the place if there is a section along one axis)")
    held = "fix a coordinate at its value nearest to VALUE, with --boundaries at VALUE; units allowed"
    _option(draw, "--sel DIM=VALUE", held, **_LIST)
    _option(draw, "--log", "colours follow the logarithm of the numbers")
    _option(draw, "--boundaries REGIME", "locate the boundary of a regime: curves, also as NetCDF")
    _option(draw, "--tolerance T", "error of these, in SI units (default: 1e-6)", type=_POSITIVE)

    report = _add_command(entries, commands.report_command, "dataset OUT.nc")
    _option(report, "-o --output MY.html", "default: beside OUT.nc")

    threshold = _add_command(entries, commands.threshold_command, "config CONFIG.yaml", "or OUT.nc, whose scene is run")
    _option(threshold, "--path PATH", "the number that varies: drive.amplitude", required=True)
    _option(threshold, "--regime REGIME", "the regime: separating; with impact also: tumbled", required=True)
    _option(threshold, "--from VALUE", "where to look; default: as the sweep has it", dest="low")
    _option(threshold, "--to VALUE", "units allowed", dest="high")
    _option(threshold, "--tolerance T", "largest error (default: 1e-6 of the greatest value)")
    _option(threshold, "--unit U", "unit of the answer: rpm (default: as the ends or the file have it)")
    _option(threshold, "--scan N", "runs in which changes of regime are looked for (default: 128)", type=_COUNT)
    _option(threshold, "-o --output OUT.nc", "write the thresholds too (default: only print them)")
    _options(threshold, _JSON, _JOBS, _SET)

    fit = _add_command(entries, commands.fit_command, "config CONFIG.yaml", "or OUT.nc, whose scene is fitted")
    _option(fit, "--data RUN.csv", "the measured history", required=True)
    _option(fit, "--vary PATHS", "numbers to fit: PATH or PATH=LOW..HIGH, separated by commas", required=True)
    _option(fit, "-o --output FIT.nc", "default: the configuration's name with -fit")
    _option(fit, "--start N", "minimisations, each from its start (default: 8)", type=_COUNT, default=8)
    _option(fit, "--noise S", "standard deviation of a measurement (default: by the residuals)")
    _options(fit, _SET)

    simulate = _add_command(entries, commands.simulate_command, "config CONFIG.yaml", "or OUT.nc, whose scene is run")
    _option(simulate, "-o --output RUN.nc", "default: the configuration's name with -run")
    _options(simulate, _SET, _SEL)

    stored = "what ringsweep simulate or precision wrote, or a sampled sweep"
    plot = _add_command(entries, commands.plot_command, "dataset RUN.nc", stored)
    _option(plot, "-o --output RUN.png", "default: beside RUN.nc; .pdf and .svg too")
    kinds = "phase portrait, or friction force over sliding velocity (belt), in place of the time history; "
    kinds += "of a sampled sweep probabilities (default), survival, or Sobol indices"
    _option(plot, "--kind", kinds, choices=["phase", "friction", "probability", "survival", "sensitivity"])
    _option(plot, "--sel DIM=VALUE", "cell of a sampled sweep", **_LIST)
    _option(plot, "--word REGIME", "regime whose Sobol indices are drawn")
    _option(plot, "--law LAW", "the run under this friction law, if RUN.nc has several")
    _option(plot, "--from T", "draw the history from this time on", type=_TIME, dest="begin")
    _option(plot, "--to T", "draw the history up to this time; units allowed", type=_TIME, dest="end")

    animate = _add_command(entries, commands.animate_command, "config CONFIG.yaml", "or OUT.nc, whose scene is run")
    _option(animate, "-o --output RUN.gif", "default: the configuration's name with -run; .mp4 and .html too")
    _options(animate, _SET, _SEL)

    taken = "or OUT.nc, whose sweep is taken"
    precision = _add_command(entries, commands.precision_command, "config CONFIG.yaml", taken)
    _option(precision, "-o --output OUT.nc", "default: the configuration's name with -precision")
    target = "largest error allowed: rad or m at the end, s at separation (default: 1e-6)"
    _option(precision, "--target E", target, type=_POSITIVE, default=argparse.SUPPRESS)
    _option(precision, "--cells N", "cells to measure (default: 16)", type=_COUNT, default=argparse.SUPPRESS)
    _option(precision, "--rounds N", "timings of each setting (default: 3)", type=_COUNT, default=argparse.SUPPRESS)

    info = _add_command(entries, commands.info_command, "dataset OUT.nc")
    _option(info, "--sel DIM=VALUE", "only the cells whose coordinate is nearest to VALUE; units allowed", **_LIST)
    _options(info, _JSON)
    _option(info, "--cite", "print only what a paper that uses it can cite")

    _add_command(entries, commands.verify_command, "files FILE.nc", nargs="+")

    _add_command(entries, commands.schema_command)

    shells = ["bash", "zsh", "fish", "tcsh"]
    _add_command(entries, completion_command, "shell", choices=shells)
    return parser


def completion_command(arguments: argparse.Namespace) -> None:
    """Print a completion script for a shell.

    ringsweep completion bash > ~/.local/share/bash-completion/completions/ringsweep
    ringsweep completion zsh > ~/.zfunc/_ringsweep
    ringsweep completion fish > ~/.config/fish/completions/ringsweep.fish
    """
    import shtab

    print(shtab.complete(build_parser(), arguments.shell))


def _add_command(entries: Any, function: Any, argument: str = "", about: str | None = None, **more: Any) -> Any:
    """Add a command, whose docstring is its help: the summary, then examples.

    Parameters
    ----------
    entries : argparse action
        What the command is added to.
    function : callable
        Takes the parsed arguments.
    argument : str, optional
        Name of its argument, and what that is called.
    about : str, optional
        Help of the argument.
    **more
        Further keywords of the argument for argparse.
    """
    # Without docstrings, as with python -OO, there is no help.
    summary, _, examples = (function.__doc__ or "").partition("\n")
    parser = entries.add_parser(
        function.__name__.removesuffix("_command"),
        help=f"{summary[:1].lower()}{summary[1:].rstrip('.')}",
        description=summary,
        epilog="examples:\n" + indent(dedent(examples).strip(), "  "),
        formatter_class=_formatter,
    )
    _add_verbosity(parser)
    parser.set_defaults(command=function, parser=parser)
    if argument:
        name, *value = argument.split()
        parser.add_argument(name, metavar=value[0] if value else None, help=about, **more)
    return parser


def _add_verbosity(parser: argparse.ArgumentParser) -> None:
    """Options that may stand before and after the command; without a default the one does not reset the other."""
    verbosity = parser.add_mutually_exclusive_group()
    more = "print more, with the traceback of an unexpected error"
    _option(verbosity, "-q --quiet", "print only warnings and errors", default=argparse.SUPPRESS)
    _option(verbosity, "-v --verbose", more, default=argparse.SUPPRESS)


def _formatter(prog: str) -> argparse.HelpFormatter:
    return argparse.RawDescriptionHelpFormatter(
        prog, max_help_position=28, width=min(shutil.get_terminal_size().columns - 2, 100)
    )


def _option(parser: Any, spelling: str, summary: str, **more: Any) -> None:
    """Add an option: its names, and what its value is called, if it has one that is no choice."""
    names = [word for word in spelling.split() if word.startswith("-")]
    value = spelling.removeprefix(" ".join(names)).strip()
    if not value and "choices" not in more:
        more["action"] = "store_true"
    if value:
        more["metavar"] = value
    parser.add_argument(*names, help=summary, **more)


def _options(parser: Any, *shared: tuple[str, str, dict[str, Any]]) -> None:
    """Add options that several commands have."""
    for spelling, summary, more in shared:
        _option(parser, spelling, summary, **more)


class _Version(argparse.Action):
    """Prints the version; to look it up takes as long as all else that ``--help`` needs."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> NoReturn:
        from importlib.metadata import version

        print("ringsweep", version("ringsweep"))
        parser.exit()


# Commands that other programs have, and what does the same here.
_ELSEWHERE = {"help": "--help", "version": "--version", "sweep": "run"}


class _Parser(argparse.ArgumentParser):
    """A parser whose messages quote only the start of a long argument."""

    def error(self, message: str) -> NoReturn:
        """End the process with a message."""
        if wrong := re.match(r"argument COMMAND: invalid choice: '([^']*)' \(choose from (.*)\)", message):
            near = _ELSEWHERE.get(wrong[1]) or nearest_name(wrong[1], re.findall(r"[a-z]+", wrong[2]))
            message += f"; did you mean `{near}`?" if near else ""
        super().error(shortened(message, 1000))


def _number(name: str, unit: str = "1", **interval: Any) -> Callable[[str], float]:
    """What makes a number in an interval of an argument, which may have a unit."""

    def read(text: str) -> float:
        from ringsweep.quantities.parameters import Parameter
        from ringsweep.quantities.units import quantity

        try:
            number = quantity(text, Parameter(unit, name, **interval), "")
        except InputError as error:
            raise argparse.ArgumentTypeError(error.problem) from None
        return int(number) if "whole" in interval else number

    return read


_COUNT = _number("a count", lower=1, upper=10**9, whole=True)
_POSITIVE = _number("an error", lower=0, open_lower=True)
_TIME = _number("the time", "s")

# Of an option that may be repeated.
_LIST: dict[str, Any] = {"action": "append", "default": []}

# Options that several commands have.
_SET = "--set PATH=VALUE", "change a value: drive.amplitude=3", _LIST
_SEL = "--sel DIM=VALUE", "run the cell of OUT.nc nearest to VALUE; units allowed", _LIST
_JSON = "--json", "print JSON in place of text", dict[str, Any]()
_JOBS = "--jobs N", "threads (default: all cores)", {"type": _COUNT}
