"""Error against run time on the belt under LuGre's law: `implicit`, `rk4`, and SciPy's LSODA and Radau.

    python benchmarks/bristles.py            eight speeds of the belt, a few minutes
    python benchmarks/bristles.py --quick    two speeds, half a minute

The paper's values (sigma0 1e5 N/m), 30 s from rest on the belt. Errors are those of the displacement at the end, the
greatest over the speeds, against `implicit` at rtol 1e-12; SciPy integrates equations compiled by Numba, without
events, as a specialist would have it do. Contenders run in turn on one core; times are medians over the rounds.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from math import exp, sqrt
from statistics import median
from typing import Any

import numba
import numpy as np
from _common import alternate, heading, machine, table
from scipy.integrate import solve_ivp

from ringsweep import config, engine
from ringsweep.models import MODELS, batch
from ringsweep.solvers.rk4 import STABILITY_LIMIT

SPAN = 30.0
SCENE = {
    "model": "belt",
    "body": {"mass": 1.0},
    "spring": {"stiffness": 2.0},
    "friction": {
        "law": "lugre",
        "mu_s": 0.15,
        "mu_k": 0.1,
        "sigma0": 1e5,
        "sigma1": sqrt(1e5),
        "sigma2": 0.1,
        "v_s": 1e-3,
    },
    "time": {"span": SPAN},
}


@numba.njit(error_model="numpy")
def _rates(t: float, y: Any, v_b: float) -> Any:
    x, velocity, z = y
    v = velocity - v_b
    g = 9.81 * (0.1 + 0.05 * exp(-((v / 1e-3) ** 2)))
    rate = v - 1e5 * abs(v) * z / g
    force = 1e5 * z + 1e5**0.5 * rate + 0.1 * v
    return np.array([velocity, -2.0 * x - force, rate])


def ours(speeds: Any, method: str, **options: Any) -> Callable[[], Any]:
    """A call that runs all speeds in this thread; returns displacements, steps and stiffness."""
    sweep = {"grid": {"belt.velocity": speeds.tolist()}}
    c = config.load({"scene": SCENE, "sweep": sweep, "solver": {"method": method, "certify": False, **options}})
    names = MODELS["belt"].outcomes
    prepared = batch(c.scene.structure, engine.cells(c.scene, c.axes, np.arange(len(speeds))))

    def call() -> Any:
        result = c.solver.run(prepared, names)
        return result.rows[:, names.index("x_end")], result.steps, result.stiffness

    return call


def scipys(speeds: Any, method: str, rtol: float) -> Callable[[], Any]:
    """The same by SciPy."""

    def call() -> Any:
        found, steps = [], []
        for v_b in speeds:
            run = solve_ivp(
                _rates, (0.0, SPAN), [0.0, v_b, 0.0], method=method, rtol=rtol, atol=rtol * 1e-6, args=(v_b,)
            )
            found.append(run.y[0, -1] if run.success else np.nan)
            steps.append(len(run.t) - 1)
        return np.array(found), np.array(steps), None

    return call


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    speeds = np.geomspace(0.05, 0.4, 2 if quick else 8)
    machine()
    heading("LuGre on the belt: error against run time")
    exact, _, _ = ours(speeds, "implicit", rtol=1e-12)()
    contenders: dict[str, Callable[[], Any]] = {}
    for rtol in (1e-4, 3e-6, 1e-7, 1e-8, 1e-9):
        contenders[f"implicit, rtol {rtol:.0e}"] = ours(speeds, "implicit", rtol=rtol)
    for steps in (30_000, 300_000, 1_000_000, 3_000_000) if not quick else (300_000, 1_000_000):
        contenders[f"rk4, {steps} steps"] = ours(speeds, "rk4", steps=steps)
    for method in ("LSODA", "Radau"):
        for rtol in (1e-6, 1e-8) if quick or method == "Radau" else (1e-6, 1e-8, 1e-10):
            contenders[f"SciPy {method}, rtol {rtol:.0e}"] = scipys(speeds, method, rtol)
    for call in contenders.values():
        call()
    times, results = alternate(contenders, 2 if quick else 3)
    rows = []
    for name, (found, steps, stiffness) in results.items():
        error = np.nanmax(abs(found - exact)) if np.isfinite(found).all() else np.nan
        flagged = "" if stiffness is None else f"{np.mean(stiffness > STABILITY_LIMIT):.0%}"
        each = 1e3 * median(times[name].wall) / len(speeds)
        rows.append([name, f"{each:.3g}", f"{np.mean(steps):.0f}", f"{error:.1e}", flagged])
    table(["", "ms per run", "steps", "largest error, m", "beyond the limit of stability"], rows)


if __name__ == "__main__":
    main()
