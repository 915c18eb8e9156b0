"""Errors at the default tolerances, and how well the stated bounds cover them, over random scenes.

    python -m benchmarks.errors            # four minutes, most of it compilation
    python -m benchmarks.errors --quick    # fewer scenes

Draws scenes as :mod:`benchmarks.brute_force` does. Errors are differences from the same method at a much smaller
tolerance: errors of resolution, not mistakes in the model. The table has those of the angle at the end (rad), or of
the displacement over the displacement at which a stuck body breaks loose. All numbers that have a bound count in the
share that is covered, and in the median of bound over error.

Writes `errors.md`.
"""

from __future__ import annotations

import logging
import math

import numpy as np
import xarray as xr

from benchmarks._common import command, machine, one_core, publish, shown
from benchmarks.brute_force import Kind, answers, draw, nest, scales
from ringsweep.physics.friction import LAWS, SetValued, family_of
from ringsweep.solvers.event import Event, Implicit

SEED, COUNT, QUICK = 40, 300, 30
#: Kinds of scenes by title.
KINDS = {
    "ring, `coulomb`": Kind("ring", "coulomb", "arctan", 1),
    "ring, `stiction`": Kind("ring", "stiction", "arctan", 1),
    "ring, `stiction`, table drive": Kind("ring", "stiction", "table", 1),
    "ring, `tustin`": Kind("ring", "tustin", "sinusoidal", 1),
    "ring, `bengisu-akay`": Kind("ring", "bengisu-akay", "arctan", 1),
    "ring, `lugre`": Kind("ring", "lugre", "arctan", 1),
    "ring, `stiction`, with impacts": Kind("ring", "stiction", "arctan", 1, impact=True),
}
KINDS |= {f"belt, `{law}`": Kind("belt", law, "") for law in (
    "stiction", "tustin", "threlfall", "bengisu-akay", "dahl", "lugre", "elasto-plastic", "reset-integrator",
)}  # fmt: skip
HEADER = ["scenes", "method", "default `rtol`", "median error", "99 %", "largest", "bounds", "covered", "stated/true"]


def method_of(law: str) -> tuple[str, float, float]:
    """Method that `auto` takes for a law, its default tolerance, and one that shows its errors."""
    if family_of(LAWS[law]) is SetValued:
        return "event", Event().rtol, 1e-14
    return "implicit", Implicit().rtol, 1e-10


def measure(title: str, kind: Kind, count: int) -> list[str]:
    """Row of the table for scenes of a kind."""
    rng, (method, usual, tight) = np.random.default_rng([SEED, *title.encode()]), method_of(kind.law)
    batch = [draw(rng, kind) for _ in range(count)]
    found, exact = (answers(kind, batch, {"method": method, "rtol": rtol}) for rtol in (usual, tight))
    end = "x_end" if kind.model == "belt" else "phi_end"
    scale = np.array([scales(nest(kind, values)) if kind.model == "belt" else 1.0 for values in batch])
    alike = ((found.certified == 1) & (found.regime == exact.regime) & (found.motion == exact.motion)).values
    errors = (np.abs(found[end] - exact[end]).values / scale)[alike & found[f"{end}_error"].notnull().values]
    ratios = np.concatenate([ratios_of(found, exact, name)[alike] for name in found if f"{name}_error" in found])
    ratios = ratios[~np.isnan(ratios)]
    each = (f"{value:.0e}" for value in (np.median(errors), np.quantile(errors, 0.99), errors.max()))
    covered = f"{100.0 * (ratios >= 1.0).mean():.1f} %"
    bounded = str(len(ratios)), covered, f"{np.median(ratios):.0f}"
    return [title, f"`{method}`", f"{usual:.0e}", *each, *bounded]


def ratios_of(found: xr.Dataset, exact: xr.Dataset, name: str) -> np.ndarray:
    """Stated bounds of a number over its true errors; NaN where it has none, or where the error is rounding."""
    values, bounds = exact[name].values, found[f"{name}_error"].values
    true = np.abs(found[name].values - values)
    rounding = 4.0 * np.spacing(np.abs(values))
    known = np.isfinite(bounds) & np.isfinite(true) & (true > rounding)
    return np.divide(bounds + rounding, true, out=np.full(len(true), math.nan), where=known)


def main() -> None:
    """Measure, print, write."""
    given = command(__doc__).parse_args()
    print(where := machine())
    logging.getLogger("ringsweep").setLevel(logging.ERROR)
    rows = []
    with one_core():
        for title, kind in KINDS.items():
            rows.append(measure(title, kind, QUICK if given.quick else COUNT))
            print(*rows[-1], flush=True)
    title = "Errors at the default tolerances, and bounds"
    publish(given, "errors", title, where, shown(title, HEADER, rows))


if __name__ == "__main__":
    main()
