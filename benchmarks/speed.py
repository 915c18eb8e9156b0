"""Speed and error of the solvers on the Fig. 29 family, beside Runge-Kutta 4, SciPy and hand-written C.

    python benchmarks/speed.py            everything, about eight minutes
    python benchmarks/speed.py --quick    fewer cells, rounds and steps, under a minute

1. Error against run time of `event` and `implicit` over the tolerance, on all cores through the engine: 64 amplitudes
   of the drive (0.1 to 10 rad/s) by 64 half-angles of the rough zone (2 to 60 degrees), T = 10 s, all else Fig. 29.
2. Ratio to `rk4` at the step that reaches the same error, on one core.
3. Ratio to SciPy's Radau and LSODA with events, on one core, interpreted and compiled.
4. Compilation of a cold kernel, and loading it from the cache on disk (`--quick`: of `rk4` alone).
5. `rk4` against `rk4.c`, on one core.

Contenders of a table run in turn, round after round, and what is printed is the median; a ratio is the median of the
ratios within the rounds. On a noisy machine trust the ratios, and the processor time more than the clock.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path
from statistics import geometric_mean, median
from typing import Any

import numpy as np
from _common import (
    ALPHA,
    BODY,
    FIG_29,
    GRAVITY,
    LAWS,
    PAPER_STEPS,
    RADIUS,
    REST,
    ROUGH,
    SPAN,
    V0,
    Cell,
    Outcomes,
    alternate,
    compute,
    family,
    heading,
    machine,
    on_one_core,
    table,
)
from _scipy_ring import ScipyRing

from ringsweep.solvers import METHODS
from ringsweep.solvers.rk4 import STABILITY_LIMIT

# Cells that separate, early and late, on both sides of Fig. 29.
CELLS: list[Cell] = [
    FIG_29,
    (10.0, radians(15.8)),
    (6.0, radians(29.6)),
    (3.6, radians(20.4)),
    (2.15, radians(14.9)),
]
TIGHTEST = {"event": 1e-15, "implicit": 1e-11}


@dataclass(frozen=True)
class Effort:
    """How much of everything to measure."""

    side: int
    rounds: int
    tolerances: dict[str, list[float]]
    cells: int
    steps: list[int]
    scipy_cells: int
    scipy_tolerances: list[float]
    compiled: list[str]


FULL = Effort(
    side=64,
    rounds=3,
    tolerances={
        "event": [1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13],
        "implicit": [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9],
    },
    cells=5,
    steps=[PAPER_STEPS, 50_000, 500_000, 2_000_000, 5_000_000, 10_000_000, 20_000_000, 50_000_000, 100_000_000],
    scipy_cells=3,
    scipy_tolerances=[1e-4, 1e-6, 1e-8, 1e-10],
    compiled=["rk4", "event", "implicit"],
)
QUICK = Effort(
    side=16,
    rounds=2,
    tolerances={"event": [1e-8, 1e-10, 1e-12], "implicit": [1e-4, 1e-6, 1e-8]},
    cells=2,
    steps=[PAPER_STEPS, 500_000, 5_000_000, 10_000_000],
    scipy_cells=1,
    scipy_tolerances=[1e-6],
    compiled=["rk4"],
)


@dataclass(frozen=True)
class Target:
    """What the project asks of a method on the whole family, at its default tolerance."""

    rate: float
    error: float
    of: str

    def met(self, rate: float, phi: Any, t_separation: Any) -> tuple[bool, str]:
        """Whether rate and error suffice, and the error in words."""
        if self.of == "phi_end":
            error = float(np.median(phi))
            words = f"median error of phi_end {error:.1e} rad"
        else:
            error = float(np.max(t_separation, initial=0.0))
            words = f"largest error of t_separation {error:.1e} s"
        return rate >= self.rate and error <= self.error, words


TARGETS = {"event": Target(25_000, 1e-10, "phi_end"), "implicit": Target(4_000, 1e-6, "t_separation")}


def deviations(data: Any, reference: Any) -> tuple[Any, Any, int]:
    """Errors of phi_end, of t_separation where both separate, and the number of regimes that differ."""
    phi, t, regime = (np.ravel(getattr(data, name)) for name in ("phi_end", "t_separation", "regime"))
    phi_r, t_r, regime_r = (np.ravel(getattr(reference, name)) for name in ("phi_end", "t_separation", "regime"))
    both = np.isfinite(t) & np.isfinite(t_r)
    return np.abs(phi - phi_r), np.abs(t - t_r)[both], int((regime != regime_r).sum())


# ---- 1 -------------------------------------------------------------------------------------


def error_against_time(effort: Effort) -> None:
    """Section 1."""
    cells = effort.side**2
    heading(f"1. Error against run time: {cells} cells, T = {SPAN:g} s, all cores, through the engine")
    references = {}
    for method, target in TARGETS.items():
        default = METHODS[method].rtol  # type: ignore[attr-defined]
        plain = {
            f"{rtol:.0e}": family(effort.side, method, rtol=rtol, certify=False)
            for rtol in sorted({*effort.tolerances[method], default}, reverse=True)
        }
        certified = f"{default:.0e} certified"
        configs = plain | {certified: family(effort.side, method)}
        compute(family(2, method))
        reference = compute(family(effort.side, method, rtol=TIGHTEST[method], certify=False))
        references[method] = reference
        times, results = alternate({name: lambda c=c: compute(c) for name, c in configs.items()}, effort.rounds)
        lines, verdicts = [], {}
        for name in configs:
            rate = cells / median(times[name].wall)
            phi, t_separation, differ = deviations(results[name], reference)
            lines.append([
                name, f"{rate:.0f}", f"{median(times[name].cpu) / cells * 1e6:.1f}",
                f"{float(results[name].steps.mean()):.0f}",
                f"{np.median(phi):.1e}", f"{np.quantile(phi, 0.99):.1e}", f"{phi.max():.1e}",
                f"{np.median(t_separation):.1e}", f"{t_separation.max():.1e}", str(differ),
            ])  # fmt: skip
            verdicts[name] = (rate, *target.met(rate, phi, t_separation))
        print(f"\n`{method}`, law {LAWS[method]['law']}; reference: the same at rtol {TIGHTEST[method]:.0e}")
        table(
            ["rtol", "runs/s", "CPU us/run", "steps/run", "phi median", "99 %", "max", "t_sep median", "max", "differ"],
            lines,
        )
        share = float(results[certified].certified.mean())
        rate, met, words = verdicts[f"{default:.0e}"]
        print(f"certified at the default tolerance: {100 * share:.2f} % of the cells")
        print(
            f"target {target.rate:.0f} runs/s with {target.of} within {target.error:.0e}: {'met' if met else 'MISSED'} "
            f"at the default rtol {default:.0e}: {rate:.0f} runs/s, {words}"
        )
        within = [name for name in plain if verdicts[name][1]]
        print(f"    met at rtol {', '.join(within) or 'none'} of those measured")
        if effort is QUICK:
            print("    (it is meant for the whole family: a reduced one is too short to reach the rate)")

    paper = family(effort.side, "rk4", steps=PAPER_STEPS, certify=False)
    compute(family(2, "rk4", steps=PAPER_STEPS, certify=False))
    contenders = {
        "rk4": paper,
        "event": family(effort.side, "event", certify=False),
        "implicit": family(effort.side, "implicit", certify=False),
    }
    times, results = alternate({name: lambda c=c: compute(c) for name, c in contenders.items()}, effort.rounds)
    print(f"\nthe wrong way: `rk4` at the paper's {PAPER_STEPS} steps, law bengisu-akay, in the same rounds")
    _, _, differ = deviations(results["rk4"], references["implicit"])
    print(
        f"{cells / median(times['rk4'].wall):.0f} runs/s, {100 * differ / cells:.1f} % of the regimes wrong; "
        + ", ".join(f"`{name}` is {times['rk4'].ratio(times[name]):.1f} times as fast" for name in TARGETS)
    )
    phi, _, differ = deviations(references["event"], references["implicit"])
    print(
        f"the laws themselves (stiction against bengisu-akay at v0 = {V0:g}, both converged): phi_end differs by "
        f"{np.median(phi):.1e} in the median, {differ} regimes differ"
    )


# ---- 2 -------------------------------------------------------------------------------------


def ratio_to_rk4(effort: Effort) -> None:
    """Section 2."""
    cells = CELLS[: effort.cells]
    heading(f"2. Ratio to rk4 at the step that reaches the same error: {len(cells)} cells, one core")
    reference = on_one_core(cells, "implicit", rtol=TIGHTEST["implicit"], certify=False)()
    limit = on_one_core(cells, "event", rtol=TIGHTEST["event"], certify=False)()
    many = 20
    ours = {name: on_one_core(cells * many, name, certify=False) for name in TARGETS}
    schemes = {n: on_one_core(cells, "rk4", steps=n, certify=False) for n in effort.steps}
    for call in (*ours.values(), on_one_core(cells, "rk4", steps=PAPER_STEPS, certify=False)):
        call()

    # Brute force takes long: our methods run beside each of its steps and are compared within that round.
    brute: dict[int, tuple[Outcomes, float, dict[str, float]]] = {}
    for n, scheme in schemes.items():
        times, results = alternate({"rk4": scheme, **ours}, 3 if n <= 500_000 else 1)
        beside = {name: times["rk4"].ratio(times[name]) * many for name in ours}
        brute[n] = results["rk4"], median(times["rk4"].wall), beside

    lines, errors = [], {}
    for n, (found, seconds, beside) in brute.items():
        error = np.where(found.regime == reference.regime, np.abs(found.t_separation - reference.t_separation), np.inf)
        errors[n] = error
        lines.append([
            f"{n:.0e}", f"{SPAN / n:.1e}", f"{seconds / len(cells):.3g}", f"{seconds / found.steps.sum() * 1e9:.0f}",
            str(int(np.isinf(error).sum())), f"{np.median(error):.1e}", f"{error.max():.1e}",
            *(f"{beside[name]:.3g}" for name in ours),
        ])  # fmt: skip
    print(f"law bengisu-akay, v0 = {V0:g}; error of t_separation against `implicit` at rtol {TIGHTEST['implicit']:.0e}")
    table(
        ["steps", "step, s", "s/run", "ns/step", "regimes wrong", "t_sep error median", "max"]
        + [f"time / {name}" for name in ours],
        lines,
    )
    mine = {
        "implicit": np.abs(ours["implicit"]().t_separation[: len(cells)] - reference.t_separation),
        "event": np.abs(ours["event"]().t_separation[: len(cells)] - limit.t_separation),
    }
    for name, error in mine.items():
        print(f"`{name}` at its default tolerance: t_sep error median {np.median(error):.1e}, max {error.max():.1e}")

    stable = [n for n, (found, _, _) in brute.items() if found.stiffness.max() <= STABILITY_LIMIT]
    print(f"\nWithin the limit of stability: {', '.join(f'{n:.0e}' for n in stable) or 'none of these'} steps.")
    # Error over step, in every cell and stable step: a constant for a method of order 1.
    slopes = [float(e) * n / SPAN for n in stable for e in errors[n]]
    if slopes:
        print(
            "rk4 takes no notice of arc edges: a step across one errs in proportion to its length and to where in it\n"
            "the edge lies, so that rk4 is at best of order 1 there, and erratic. Extrapolation assumes order 1:\n"
            f"error / step = {geometric_mean(slopes):.1g} (geometric mean; {min(slopes):.1g} to {max(slopes):.1g}). "
            "Read it as an order of magnitude."
        )
    own = float(np.median(mine["implicit"]))
    goals = {1e-4: "", 1e-5: "", 1e-6: "", 1e-8: "", own: "implicit's own", 1e-10: "event's target"}
    lines = []
    for goal, note in goals.items():
        reached = [n for n in brute if all(np.median(errors[m]) <= goal for m in brute if m >= n)]
        if reached:
            n = min(reached)
            shown = [f"{n:.1e}", f"{brute[n][1] / len(cells):.3g}", "measured"]
            lines.append([f"{goal:.1e}", note, *shown, *(f"{factor:.3g}" for factor in brute[n][2].values())])
        elif slopes:
            n = max(stable)
            growth = max(1.0, geometric_mean(slopes) * SPAN / goal / n)
            shown = [f"{n * growth:.0e}", f"{brute[n][1] * growth / len(cells):.0e}", "extrapolated"]
            lines.append([f"{goal:.1e}", note, *shown, *(f"{factor * growth:.0e}" for factor in brute[n][2].values())])
        else:
            lines.append([f"{goal:.1e}", note, "-", "-", "not reached", *("-" for _ in ours)])
    table(["median t_sep error", "", "steps", "s/run", "", *(f"time / {name}" for name in ours)], lines)

    if effort is QUICK:
        return
    print("\nrk4 on the law that `event` solves, stiction, against `event`: no step makes it see static friction")
    lines = []
    for n in effort.steps[:4]:
        found = on_one_core(cells, "rk4", law=LAWS["event"], steps=n, certify=False)()
        phi, _, differ = deviations(found, limit)
        lines.append([f"{n:.0e}", f"{np.median(phi):.1e}", str(differ)])
    table(["steps", "phi_end error median", "regimes wrong"], lines)


# ---- 3 -------------------------------------------------------------------------------------


def ratio_to_scipy(effort: Effort) -> None:
    """Section 3."""
    cells = CELLS[: effort.scipy_cells]
    heading(f"3. Ratio to SciPy's solve_ivp with events: {len(cells)} cells, one core")
    print(
        "SciPy restarts at arc edges and at |v| = v0, so that each piece is smooth, and stops at separation; it is\n"
        "given the Jacobian. 'interpreted' calls plain Python functions of floats, 'compiled' the same through numba.\n"
        f"Law bengisu-akay, v0 = {V0:g}; errors against `implicit` at rtol {TIGHTEST['implicit']:.0e}, with which\n"
        "SciPy shares no code. solve_ivp cannot take a set-valued law: `event` beside it solves the limit of the scene."
    )
    reference = on_one_core(cells, "implicit", rtol=TIGHTEST["implicit"], certify=False)()
    many = 50
    contenders: dict[Any, Callable[[], Any]] = {
        name: on_one_core(cells * many, name, certify=False) for name in TARGETS
    }
    for words, compiled in (("interpreted", False), ("compiled", True)):
        solver = ScipyRing(compiled)
        for method in ("Radau", "LSODA"):
            solver.run(cells[0], method, 1e-4)
            for rtol in effort.scipy_tolerances:
                contenders[method, words, rtol] = lambda s=solver, m=method, r=rtol: [s.run(c, m, r) for c in cells]
    for name in TARGETS:
        contenders[name]()
    times, results = alternate(contenders, effort.rounds)
    lines = []
    for name, found in results.items():
        if name in TARGETS:
            phi = np.abs(found.phi_end[: len(cells)] - reference.phi_end)
            t = np.abs(found.t_separation[: len(cells)] - reference.t_separation)
            steps, count, label = float(found.steps.mean()), many, [name, "", "default"]
            shown = ["-", "-"] if name == "event" else [f"{phi.max():.1e}", f"{np.nanmax(t):.1e}"]
        else:
            method, words, rtol = name
            phi = np.abs([run.phi for run in found] - reference.phi_end)
            t = np.abs([run.t if run.separated else np.inf for run in found] - reference.t_separation)
            steps, count, label = median(run.steps for run in found), 1, [method, words, f"{rtol:.0e}"]
            shown = [f"{phi.max():.1e}", f"{np.nanmax(t):.1e}"]
        lines.append([
            *label, f"{1e3 * median(times[name].wall) / len(cells) / count:.3g}", f"{steps:.0f}", *shown,
            *(f"{times[name].ratio(times[ours]) * many / count:.3g}" for ours in TARGETS),
        ])  # fmt: skip
    header = ["", "right-hand side", "rtol", "ms/run", "steps/run", "phi error max", "t_sep error max"]
    table(header + [f"time / {name}" for name in TARGETS], lines)


# ---- 4 -------------------------------------------------------------------------------------

_PROBE = """
import json, sys, time
begin = time.perf_counter()
from ringsweep import config, engine
ready = time.perf_counter()
configuration = config.load(json.loads(sys.argv[1]))
def run():
    begin = time.perf_counter()
    engine.compute(configuration, jobs=1, progress=False)
    return time.perf_counter() - begin
first, second = run(), run()
print(json.dumps([ready - begin, first - second]))
"""


def compilation(effort: Effort) -> None:
    """Section 4."""
    heading("4. Compilation of a cold kernel, and loading it from the cache on disk, s")
    lines = []
    for method in effort.compiled:
        options = {"steps": PAPER_STEPS} if method == "rk4" else {}
        source = json.dumps(family(1, method, certify=False, **options).source)
        with tempfile.TemporaryDirectory() as cache:
            (_, compiled), *warm = (_probe(source, cache) for _ in range(1 + effort.rounds))
        imported, loaded = (median(column) for column in zip(*warm, strict=True))
        lines.append([method, f"{compiled:.1f}", f"{loaded:.2f}", f"{imported:.2f}"])
    table(["", "compile", "load", "imports"], lines)


def _probe(source: str, cache: str) -> tuple[float, float]:
    """Seconds of the imports, and of a first run beyond a second one, in a new process."""
    environment = os.environ | {"NUMBA_CACHE_DIR": cache}
    command = [sys.executable, "-c", _PROBE, source]
    imported, first = json.loads(subprocess.check_output(command, env=environment, text=True))
    return imported, first


# ---- 5 -------------------------------------------------------------------------------------


class _Scene(ctypes.Structure):
    """`scene_t` of rk4.c."""

    _fields_ = [
        (name, ctypes.c_double)
        for name in (
            "mass", "inertia", "half_distance", "ball_radius", "radius", "gravity",
            "rough_s", "rough_k", "rest_s", "rest_k", "alpha", "v0", "epsilon_omega",
        )
    ]  # fmt: skip


#: Columns of its outcomes.
_COLUMNS, _PHI_END, _OMEGA_END, _CONTACT, _STEPS = 14, 1, 2, 3, 13
_FLAGS = ("-O3", "-march=native", "-ffast-math")


def _hand_written(compiler: str, cells: Sequence[Cell], directory: str) -> Callable[[float, float], Any]:
    """A call that runs rk4.c over `cells` at the paper's step, given alpha and v0."""
    target = Path(directory) / "rk4.so"
    source = Path(__file__).with_name("rk4.c")
    subprocess.run([compiler, *_FLAGS, "-shared", "-fPIC", str(source), "-o", str(target), "-lm"], check=True)
    run = ctypes.CDLL(str(target)).run
    vector = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")
    run.restype = ctypes.c_int64
    run.argtypes = [
        ctypes.c_int64, vector, vector, ctypes.POINTER(_Scene), ctypes.c_int64, ctypes.c_double, vector,
    ]  # fmt: skip
    amplitudes, half_angles = (np.array(column) for column in zip(*cells, strict=True))

    def call(alpha: float, v0: float) -> Any:
        scene = _Scene(
            *BODY.values(), RADIUS, GRAVITY, ROUGH["mu_s"], ROUGH["mu_k"], REST["mu_s"], REST["mu_k"], alpha, v0, 1e-3
        )
        out = np.empty((len(cells), _COLUMNS))
        if run(len(cells), amplitudes, half_angles, ctypes.byref(scene), PAPER_STEPS, SPAN, out) != _COLUMNS:
            raise MemoryError("rk4.c found no memory for the table of the drive")
        return out

    return call


def against_c(effort: Effort) -> None:
    """Section 5."""
    compiler = shutil.which("cc")
    heading("5. rk4 against rk4.c, one core")
    if compiler is None:
        print("skipped: there is no C compiler (cc) here")
        return
    said = subprocess.run([compiler, "--version"], check=True, capture_output=True, text=True).stdout.splitlines()[0]
    print(f"{said}; {' '.join(_FLAGS)}; both share one table of the drive among 64 cells of the family")
    amplitudes = np.geomspace(0.1, 10.0, 8)
    cells = [(float(a), float(h)) for a in amplitudes for h in np.radians(np.linspace(2.0, 60.0, 8))]
    with tempfile.TemporaryDirectory() as directory:
        by_hand = _hand_written(compiler, cells, directory)
        lines = []
        # The law of Fig. 29, and that of Fig. 25 for which the paper's step is short enough.
        for alpha, v0 in ((ALPHA, V0), (100.0, 0.2)):
            law = {"law": "bengisu-akay", "alpha": alpha, "v0": v0}
            ours = on_one_core(cells, "rk4", law=law, steps=PAPER_STEPS, certify=False)
            ours()
            contenders: dict[str, Callable[[], Any]] = {"ours": ours, "C": lambda a=alpha, v=v0: by_hand(a, v)}
            times, results = alternate(contenders, 5 * effort.rounds)
            found, theirs = results["ours"], results["C"]
            phi = np.abs(found.phi_end - theirs[:, _PHI_END])
            differ = np.isfinite(found.t_separation) != (theirs[:, _CONTACT] > 0.0)
            lines.append([
                f"alpha {alpha:g}, v0 {v0:g}", f"{median(times['ours'].wall) / found.steps.sum() * 1e9:.1f}",
                f"{median(times['C'].wall) / theirs[:, _STEPS].sum() * 1e9:.1f}",
                f"{times['ours'].ratio(times['C']):.2f}", str(int(differ.sum())),
                f"{np.median(phi):.0e}", f"{phi.max():.0e}",
                f"{np.abs(found.omega_end - theirs[:, _OMEGA_END]).max():.0e}",
            ])  # fmt: skip
        header = ["law", "ours, ns/step", "C, ns/step", "ours / C", "separations that differ"]
        table([*header, "phi_end by: median", "max", "omega_end by: max"], lines)
    print(
        "Where the step is too long for the stiction band (the first law) rk4 chatters and amplifies the last digit:\n"
        "there the two agree in kind only. Ours also keeps the stiffness of each step, which C does not."
    )


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description="Speed and error of the solvers.")
    parser.add_argument("--quick", action="store_true", help="fewer cells, rounds and steps: under a minute")
    effort = QUICK if parser.parse_args().quick else FULL
    # LSODA warns where a tolerance is loose; the table shows what came of it.
    warnings.filterwarnings("ignore", message="lsoda", category=UserWarning)
    begin = time.perf_counter()
    machine()
    for section in (error_against_time, ratio_to_rk4, ratio_to_scipy, compilation, against_c):
        section(effort)
    print(f"\n{time.perf_counter() - begin:.0f} s in all")


if __name__ == "__main__":
    main()
