"""The cost of a certificate: a run, a second run at a looser tolerance, and the check of the law.

    python -m benchmarks.certificates            # a minute, most of it compilation
    python -m benchmarks.certificates --quick    # fewer cells and rounds

Runs the map of `configs/regime_map.yaml` under its own law and under stiction, its limit, on one core, compiled
before. Three runs alternate within each round: a run, a run with the check of the law, and a run at the looser
tolerance. Ratios are medians of the ratios within the rounds. The table also gives, of the angle at the end, the
largest error, against a run at a tolerance a thousand times tighter; the share of the errors that the stated bounds
cover; and the median of bound over error.

Writes `certificates.md`.
"""

from __future__ import annotations

from dataclasses import replace
from statistics import median

import numpy as np

from benchmarks._common import (
    ALPHA,
    V0,
    alternate,
    command,
    family,
    heading,
    machine,
    markdown,
    one_core,
    publish,
    ring,
    table,
)
from ringsweep import config
from ringsweep.models import MODELS, batch
from ringsweep.runs import cells
from ringsweep.solvers.certificate import with_errors
from ringsweep.solvers.event import Event, Implicit

NAMES = MODELS["ring"].outcomes
LAWS = {
    "bengisu-akay": ({"law": "bengisu-akay", "alpha": ALPHA, "v0": V0}, Implicit()),
    "stiction": ({"law": "stiction"}, Event()),
}
HEADER = [
    "law",
    "",
    "us per run",
    "largest error, rad",
    "bounded",
    "stated/true",
    "certificate with the law / without it",
]


def measure(law: str, side: int, rounds: int) -> list[str]:
    """Row of the table for one law."""
    friction, method = LAWS[law]
    amplitudes, half_angles = map(list, zip(*family(side), strict=True))
    points = {"drive.amplitude": amplitudes, "zone.half_angle": half_angles}
    made = config.load({"scene": ring(friction), "sweep": {"points": points}})
    prepared = batch(made.scene.structure, cells.values_of_cells(made.scene, made.axes, np.arange(side * side)))
    width, looser = len(NAMES), method.looser()
    calls = {
        "run": lambda: method.integrate(prepared, width, audit=False),
        "held": lambda: method.integrate(prepared, width, audit=True),
        "witness": lambda: method.integrate(prepared, width, audit=False, tolerances=looser),
    }
    for call in calls.values():
        call()
    with one_core():
        times, results = alternate(calls, rounds)
    exact = replace(method, rtol=max(1e-3 * method.rtol, 1e-14)).integrate(prepared, width, audit=False)[0]
    end = NAMES.index("phi_end")
    rows, stated = results["run"][0], method.run(prepared, NAMES).errors
    bounds = stated[:, with_errors(NAMES).index("phi_end")]
    true = np.abs(rows[:, end] - exact[:, end])
    ratio = median(
        (held + witness) / (run + witness)
        for run, held, witness in zip(*(times[name].wall for name in ("run", "held", "witness")), strict=True)
    )
    parts = " + ".join(f"{1e6 * times[name].median / side**2:.0f}" for name in ("held", "witness"))
    known = np.isfinite(bounds) & (true > 0.0)
    over, covered = np.median(bounds[known] / true[known]), 100.0 * (bounds[known] >= true[known]).mean()
    return [law, method.name, parts, f"{np.nanmax(true):.1e}", f"{covered:.1f} %", f"{over:.0f}", f"{ratio:.3f}"]


def main() -> None:
    """Measure, print and write."""
    given = command(__doc__).parse_args()
    print(where := machine())
    rows = [measure(law, 16 if given.quick else 64, 3 if given.quick else 9) for law in LAWS]
    heading("What a certificate costs")
    table(HEADER, rows)
    publish(given, "certificates", "What a certificate costs", where, markdown(HEADER, rows))


if __name__ == "__main__":
    main()
