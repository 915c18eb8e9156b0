"""What the benchmarks share: the Fig. 29 family of scenes, fair timing, printing."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from math import radians
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from ringsweep import config, engine
from ringsweep.models import MODELS, batch

#: The paper's Fig. 29 (SI units), law as printed.
ALPHA, V0 = 1e5, 2e-6
SPAN = 10.0
PAPER_STEPS = 5000
BODY = {"mass": 0.076, "inertia": 4.47e-5, "half_distance": 0.025, "ball_radius": 0.01}
RADIUS, GRAVITY = 0.043378, 9.81
ROUGH, REST = {"mu_s": 0.5, "mu_k": 0.3}, {"mu_s": 0.2, "mu_k": 0.1}

#: Law that each method is given.
LAWS: dict[str, dict[str, Any]] = {
    "event": {"law": "stiction"},
    "implicit": {"law": "bengisu-akay", "alpha": ALPHA, "v0": V0},
    "rk4": {"law": "bengisu-akay", "alpha": ALPHA, "v0": V0},
}

#: A cell of the family: amplitude of the drive (rad/s), half-angle of the rough zone (rad).
Cell = tuple[float, float]
FIG_29: Cell = (2.0, radians(15.0))


def _config(sweep: Mapping[str, Any], method: str, law: Mapping[str, Any] | None, options: Mapping[str, Any]) -> Any:
    scene = {
        "model": "ring",
        "body": BODY,
        "ring": {"radius": RADIUS},
        "friction": {**(law or LAWS[method]), "rough": ROUGH, "rest": REST},
        "zone": {"half_angle": FIG_29[1]},
        "drive": {"law": "arctan", "amplitude": FIG_29[0]},
        "initial": {"phi": 0.0, "omega": 0.0},
        "time": {"span": SPAN},
        "gravity": GRAVITY,
    }
    return config.load({"scene": scene, "solver": {"method": method, **options}, "sweep": sweep})


def family(side: int, method: str, law: Mapping[str, Any] | None = None, **options: Any) -> Any:
    """Configuration of the Fig. 29 family, ``side`` amplitudes by ``side`` half-angles."""
    grid = {
        "drive.amplitude": {"geomspace": [0.1, 10.0, side]},
        "zone.half_angle": {"linspace": [radians(2.0), radians(60.0), side]},
    }
    return _config({"grid": grid}, method, law, options)


def compute(configuration: Any) -> Any:
    """Run a configuration on all cores through the engine."""
    return engine.compute(configuration, jobs=None, progress=False)


@dataclass(frozen=True)
class Outcomes:
    """What a method made of some cells; `stiffness` of a fixed step only."""

    regime: Any
    phi_end: Any
    omega_end: Any
    t_separation: Any
    steps: Any
    stiffness: Any


def on_one_core(
    cells: Sequence[Cell], method: str, law: Mapping[str, Any] | None = None, **options: Any
) -> Callable[[], Outcomes]:
    """A call that runs `cells` in this thread, and nothing else: no engine, no dataset."""
    amplitudes, half_angles = zip(*cells, strict=True)
    points = {"drive.amplitude": list(amplitudes), "zone.half_angle": list(half_angles)}
    c = _config({"points": points}, method, law, options)
    names = MODELS["ring"].outcomes
    prepared = batch(c.scene.structure, engine.cells(c.scene, c.axes, np.arange(len(cells))))

    def call() -> Outcomes:
        result = c.solver.run(prepared, names)
        columns = dict(zip(names, result.rows.T, strict=True))
        wanted = (columns[name] for name in ("regime", "phi_end", "omega_end", "t_separation"))
        return Outcomes(*wanted, result.steps, result.stiffness)

    return call


@dataclass(frozen=True)
class Times:
    """Seconds of each round: by the clock, and of processor over all threads."""

    wall: list[float]
    cpu: list[float]

    def ratio(self, other: Times) -> float:
        """How many times longer this took than `other`: median over the rounds, each measured side by side."""
        return median(a / b for a, b in zip(self.wall, other.wall, strict=True))


def alternate(contenders: Mapping[Any, Callable[[], Any]], rounds: int) -> tuple[dict[Any, Times], dict[Any, Any]]:
    """Time contenders in turn, forwards and backwards, so that a noisy neighbour troubles all of them alike.

    Returns their times and what they returned last. They must be warm.
    """
    times: dict[Any, Times] = {name: Times([], []) for name in contenders}
    results: dict[Any, Any] = {}
    for k in range(rounds):
        for name in list(contenders)[:: 1 if k % 2 == 0 else -1]:
            wall, cpu = time.perf_counter(), time.process_time()
            results[name] = contenders[name]()
            times[name].wall.append(time.perf_counter() - wall)
            times[name].cpu.append(time.process_time() - cpu)
    return times, results


def heading(text: str) -> None:
    """Print the title of a section."""
    print(f"\n{text}\n{'-' * len(text)}", flush=True)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table, columns aligned to the right but for the first."""
    lines = [header, *rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(header))]
    for line in lines:
        cells = (cell.rjust(width) for cell, width in zip(line[1:], widths[1:], strict=True))
        print("  ".join([line[0].ljust(widths[0]), *cells]).rstrip(), flush=True)


def machine() -> None:
    """Print what the figures were measured on."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    load = f", load {os.getloadavg()[0]:.2f} at the start" if hasattr(os, "getloadavg") else ""
    print(f"{models[0] if models else platform.processor() or platform.machine()}, {cores} cores{load}")
    names = ("ringsweep", "numba", "llvmlite", "numpy", "scipy", "joblib")
    print(f"{platform.system()}, python {platform.python_version()}, " + ", ".join(f"{n} {version(n)}" for n in names))
