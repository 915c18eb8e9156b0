"""Shared by the benchmarks: scenes of the package, timing of contenders in turn, printing, reports."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import platform
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from benchmarks.rows import RING, ZONES
from ringsweep import config
from ringsweep.models import batch, model_of
from ringsweep.runs import cells, contenders
from ringsweep.solvers.method import Result

#: Environment variable with the core to which a benchmark is pinned while others run beside it.
CORE = "BENCHMARKS_CORE"

#: Results that the documents show.
RESULTS = Path(__file__).parent / "results"

SPAN = 10.0
PAPER_STEPS = 5000
ROUGH, REST = ZONES["rough"], ZONES["rest"]
#: Parameters of the Bengisu-Akay law in Fig. 29.
ALPHA, V0 = 1e5, 2e-6

#: A cell of the family: amplitude of the drive (rad/s), half-angle of the zone (rad).
Cell = tuple[float, float]


def ring(law: Mapping[str, Any]) -> dict[str, Any]:
    """Scene of Fig. 29 under a friction law, given as the keys of `friction`."""
    return RING | {"friction": {**law, **ZONES}}


def family(side: int) -> list[Cell]:
    """Cells around Fig. 29: `side` amplitudes from 0.1 to 10 rad/s by `side` half-angles from 2 to 60 degrees."""
    amplitudes, half_angles = np.geomspace(0.1, 10.0, side), np.radians(np.linspace(2.0, 60.0, side))
    return [(float(a), float(h)) for a in amplitudes for h in half_angles]


def configure(
    scene: Mapping[str, Any],
    axes: Mapping[str, Sequence[float]],
    method: str,
    *,
    kind: str = "points",
    record: Mapping[str, Any] | None = None,
    **options: Any,
) -> Any:
    """Configuration of a sweep over points or a grid. It has no certificates: they cost a second run."""
    solver = {"method": method, "certify": False, **options}
    parts = {"scene": scene, "solver": solver, "sweep": {kind: axes}}
    return config.load(parts | ({"record": record} if record else {}))


def bare(configuration: Any) -> Callable[[], Result]:
    """A function that runs the solver on a configuration in this thread, without tasks and without a dataset."""
    structure = configuration.scene.structure
    names = model_of(structure).columns(structure)
    count = len(next(iter(configuration.source["sweep"]["points"].values())))
    prepared = batch(structure, cells.values_of_cells(configuration.scene, configuration.axes, np.arange(count)))
    return lambda: configuration.solver.run(prepared, names)


def on_one_core(configuration: Any) -> Callable[[], dict[str, Any]]:
    """A function as :func:`bare` gives it, which returns outcomes by name."""
    structure = configuration.scene.structure
    names = model_of(structure).columns(structure)
    run = bare(configuration)
    return lambda: dict(zip(names, run().rows.T, strict=True))


def cores() -> list[int]:
    """Cores on which this process may run, the last one first."""
    count = os.cpu_count() or 1
    return sorted(os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else range(count), reverse=True)


@contextmanager
def one_core() -> Iterator[None]:
    """Pin this process, and the threads that libraries start in it, to one core."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = cores()
    os.sched_setaffinity(0, {int(os.environ.get(CORE, before[0]))})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


@dataclass(frozen=True)
class Times:
    """Time of one contender in each round, s."""

    wall: list[float]

    @property
    def median(self) -> float:
        """Median over the rounds."""
        return median(self.wall)

    def ratio(self, other: Times) -> float:
        """How many times longer this took than `other`: median over the rounds that both have."""
        return median(a / b for a, b in zip(self.wall, other.wall, strict=False))


def alternate(
    calls: Mapping[Any, Callable[[], Any]], rounds: int, **options: Any
) -> tuple[dict[Any, Times], dict[Any, Any]]:
    """Times and results of functions, as :func:`ringsweep.runs.contenders.alternate` measures them."""
    times, results = contenders.alternate(calls, rounds, **options)
    return {name: Times(wall) for name, wall in times.items()}, results


def heading(text: str) -> None:
    """Print the title of a section."""
    print(f"\n{text}\n{'-' * len(text)}", flush=True)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table. All columns but the first are aligned to the right."""
    lines = [header, *rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(header))]
    for line in lines:
        cells = (cell.rjust(width) for cell, width in zip(line[1:], widths[1:], strict=True))
        print("  ".join([line[0].ljust(widths[0]), *cells]).rstrip(), flush=True)


def markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown. All columns but the first two are aligned to the right."""
    rule = ["---" if k < 2 else "---:" for k in range(len(header))]
    return "".join(f"| {' | '.join(line)} |\n" for line in (header, rule, *rows))


def shown(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Print a table under its title; the same table in Markdown."""
    heading(title)
    table(header, rows)
    return markdown(header, rows)


def machine(also: Sequence[str] = ()) -> str:
    """Processor, cores and load of this machine, and versions of the packages, with those named in `also`."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    load = f", load {os.getloadavg()[0]:.2f} at the start" if hasattr(os, "getloadavg") else ""
    versions = [f"{platform.system()}, python {platform.python_version()}"]
    for name in ("ringsweep", "numba", "llvmlite", "numpy", "scipy", "joblib", *also):
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            versions.append(f"{name} absent")
    processor = models[0] if models else platform.processor() or platform.machine()
    return f"{processor}, {len(cores())} cores{load}\n{', '.join(versions)}"


def command(doc: str) -> argparse.ArgumentParser:
    """Parser of the command line of a benchmark, with the options that all have."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="less of everything: to see that it works")
    parser.add_argument("--keep", action="store_true", help=f"write to {RESULTS.name}/, which the documents show")
    return parser


def folder_of(given: argparse.Namespace) -> Path:
    """Folder of the report: `benchmark-results` in the current folder, unless it shall be kept."""
    if given.keep and given.quick:
        raise SystemExit("--keep: a quick measurement is not kept; leave out --quick")
    folder = RESULTS if given.keep else Path("benchmark-results", "quick" if given.quick else "full")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def sources() -> str:
    """Digest of the sources of the package that a benchmark measures: all but pictures and the command line."""
    root = Path(config.__file__).parents[1]
    digest = hashlib.blake2b(digest_size=6)
    for path in sorted(root.rglob("*.py")):
        if (name := path.relative_to(root)).parts[0] not in ("plots", "cli"):
            digest.update(f"{name.as_posix()}\n".encode() + path.read_bytes())
    return digest.hexdigest()


def stamp(name: str, options: Sequence[str]) -> str:
    """What a report says of its command and its sources; one with another stamp is older than the sources."""
    return f"`{shlex.join(['python', '-m', f'benchmarks.{name}', *options])}` on sources `{sources()}`"


def publish(
    given: argparse.Namespace, name: str, title: str, where: str, body: str, figures: Mapping[str, str] | None = None
) -> None:
    """Write a report, and the figures that documents take from it.

    Parameters
    ----------
    given : argparse.Namespace
        Options of the command.
    name, title : str
    where : str
        Machine, in lines.
    body : str
        Markdown.
    figures : mapping, optional
        Texts by name, as a document prints them: numbers, words, or tables in Markdown. They go to `{name}.json`;
        :mod:`benchmarks.documents` fills them in.
    """
    folder = folder_of(given)
    lines = "".join(f"- {line}\n" for line in where.splitlines())
    options = [option for option in sys.argv[1:] if option != "--keep"]
    mark = stamp(Path(sys.argv[0]).stem, options)
    report = f"# {title}\n\n{mark}, {datetime.now(UTC).date()}:\n\n{lines}\n{body.strip()}\n"
    (folder / f"{name}.md").write_text(report)
    if figures is not None:
        (folder / f"{name}.json").write_text(json.dumps(figures, indent=1, ensure_ascii=False) + "\n")
    print(f"\n{name}.md is in {folder.resolve()}", flush=True)
