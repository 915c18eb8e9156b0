"""A bifurcation diagram of a stick-slip oscillator under a force, beside a loop over SciPy.

    python -m benchmarks.diagram            # two minutes
    python -m benchmarks.diagram --quick    # fewer frequencies

The diagram has 400 frequencies, each run up and down over 2000 s from the end of the one before, and 64 points of each
run, one per period of the force. It is certified, on all cores. The loop is what one writes by hand: `solve_ivp` with
DOP853 from event to event, in slip and in stick, on one core, for a few of these cells. Each starts where the package
started. The points of both are compared where the motion is periodic, so that an error dies out. Compilation is not
counted.

Writes `diagram.md`.
"""

from __future__ import annotations

import logging
from math import copysign, cos, inf, pi
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import ringsweep
from benchmarks._common import alternate, command, heading, machine, markdown, publish, table

SPAN, KEPT, ROUNDS = 2000.0, 64, 3
#: Static friction coefficient, its fall (s/m) towards the kinetic one, belt (m/s), amplitude of the force (N).
MU_S, MU_K, DELTA, BELT, FORCE = 0.4, 0.1, 3.0, 0.2, 0.3
#: Relative tolerances of SciPy; the absolute one is a hundredth.
TOLERANCES = 1e-6, 1e-10


def diagram(count: int) -> Any:
    """Dataset of the diagram; mass, stiffness and gravity are 1."""
    scene = {
        "model": "belt",
        "gravity": 1.0,
        "body": {"mass": 1.0},
        "spring": {"stiffness": 1.0},
        "belt": {"velocity": BELT},
        "friction": {"law": "hyperbolic", "mu_s": MU_S, "mu_k": MU_K, "delta": DELTA},
        "force": {"amplitude": FORCE, "phase": "90 deg"},
        "initial": {"x": 0.0, "velocity": 0.0},
        "time": {"span": SPAN},
    }
    sweep = {
        "grid": {"force.frequency": {"linspace": [0.05, 0.4, count]}},
        "follow": {"axis": "force.frequency", "direction": "both"},
    }
    record = {"section": {"at": "period", "keep": KEPT}}
    return ringsweep.run({"scene": scene, "record": record, "sweep": sweep}, progress=False)


def by_scipy(frequency: float, state: tuple[float, float], end: float, rtol: float) -> np.ndarray:
    """The last points of a run from event to event, shape ``(KEPT, 2)``."""
    rate = 2.0 * pi * frequency
    times = np.minimum((round(end * frequency) - np.arange(KEPT)[::-1]) / frequency, end)
    points, t, y = [], 0.0, np.array(state)

    def load(t: float, x: float) -> float:
        return FORCE * cos(rate * t) - x

    def slip(t: float, y: np.ndarray, sign: float) -> tuple[float, float]:
        v = abs(y[1] - BELT)
        return y[1], load(t, y[0]) - sign * (MU_K + (MU_S - MU_K) / (1.0 + DELTA * v))

    def sticks(t: float, y: np.ndarray, sign: float) -> float:
        return sign * (y[1] - BELT)

    def stick(t: float, y: np.ndarray, sign: float) -> tuple[float, float]:
        return BELT, 0.0

    def breaks(t: float, y: np.ndarray, sign: float) -> float:
        return MU_S - abs(load(t, y[0]))

    for event in (sticks, breaks):
        event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
    stuck, sign = y[1] == BELT, copysign(1.0, y[1] - BELT)
    while t < end:
        motion, event = (stick, breaks) if stuck else (slip, sticks)
        # Steps no longer than this do not pass over two events.
        found = solve_ivp(motion, (t, end), y, "DOP853", events=event, rtol=rtol, atol=0.01 * rtol, args=(sign,),
                          dense_output=True, max_step=0.05 / frequency if stuck else inf)  # fmt: skip
        inside = times[(times > t) & (times <= found.t[-1])]
        if len(inside):
            points.extend(found.sol(inside).T)
        t, y = found.t[-1], found.y[:, -1].copy()
        if found.status == 1:
            y[1] = BELT
            force = load(t, y[0])
            # In the end of a slip the load decides whether the body sticks; at breakaway it gives the direction.
            stuck = not stuck and abs(force) < MU_S
            sign = copysign(1.0, force)
            if not stuck:
                # One step off the belt, or the event would be met at once.
                y[1] += sign * 1e-12
    return np.array(points)


def chosen(ds: Any, count: int) -> list[int]:
    """Cells on the way up that are periodic and stop in each cycle, evenly spread; the cell before each has a state."""
    up = ds.sel(direction="up")
    periodic = ringsweep.words(up["long_run"]).values == "periodic"
    good = np.flatnonzero(periodic & (up["stops_per_cycle"].values > 0.0))
    good = good[good > 0]
    return good[np.linspace(0, len(good) - 1, count).round().astype(int)].tolist()


def main() -> None:
    """Measure, print, write."""
    given = command(__doc__).parse_args()
    logging.getLogger("ringsweep").setLevel(logging.ERROR)
    print(where := machine())
    count, few = (60, 2) if given.quick else (400, 8)
    ds = diagram(count)
    up, which = ds.sel(direction="up"), chosen(ds, few)
    starts = [(float(up["x_end"][k - 1]), float(up["velocity_end"][k - 1])) for k in which]

    def loop(rtol: float) -> list[np.ndarray]:
        return [
            by_scipy(float(up["force_frequency"][k]), start, float(up["t_end"][k]), rtol)
            for k, start in zip(which, starts, strict=True)
        ]

    contenders = {"ringsweep, certified": lambda: diagram(count)}
    contenders |= {f"SciPy, rtol {rtol:g}": lambda rtol=rtol: loop(rtol) for rtol in TOLERANCES}
    times, results = alternate(contenders, ROUNDS, patience=inf)
    ours, cells = times["ringsweep, certified"], 2 * count
    header = ["", "cells", "time", "per cell", "ratio", "largest difference of x"]
    rows = [
        ["ringsweep, certified", str(cells), f"{ours.median:.2f} s", f"{1e3 * ours.median / cells:.2f} ms", "1", ""]
    ]
    reference = np.stack([up["x_section"].values[k] for k in which])
    for rtol in TOLERANCES:
        name = f"SciPy, rtol {rtol:g}"
        away = max(float(np.abs(a[:, 0] - b).max()) for a, b in zip(results[name], reference, strict=True))
        ratio = times[name].ratio(ours) * cells / few
        per_cell = f"{1e3 * times[name].median / few:.0f} ms"
        rows.append([name, str(few), f"{times[name].median:.2f} s", per_cell, f"{ratio:.0f}", f"{away:.1e} m"])
    heading(f"{count} frequencies, up and down, {KEPT} points of each run")
    table(header, rows)
    certified, words = int(ds["certified"].sum()), ringsweep.words(ds["long_run"]).values.ravel()
    settled = ", ".join(f"{(words == word).sum()} {word}" for word in np.unique(words))
    text = f"Of {cells} runs {certified} are certified; they are {settled}. Medians of {ROUNDS} rounds, in turn."
    print(text)
    publish(given, "diagram", "A bifurcation diagram", where, f"{markdown(header, rows)}\n{text}")


if __name__ == "__main__":
    main()
