"""The speed of every method, in units of Runge-Kutta 4 by hand, each beside its error.

    python -m benchmarks.speed            # about three minutes
    python -m benchmarks.speed --quick    # fewer cells and rounds

Two units: A is a step of `peers/plain.c`, the ring of the paper's Fig. 29 written down as the paper has it, in scalar C
with -O3 -march=native. (`peers/rk4.c` takes half the time, because it shares work between stages and has -ffast-math.)
B is a step of `peers/vector.cpp`, the same method vectorised by hand. The methods that locate events are given in A
under the law of Fig. 29. `rk4` is given in B under the same law, or under the smooth law if B does not have the law.
Without compilers there are no units.

Runs of the package and both units alternate within each round, on one core, compiled before. `event` and `implicit`
run with certificates; `rk4` runs without, and records the stiffness. Ratios are medians of the ratios within the
rounds.

Errors are the largest over the cells: of the angle at the end (rad), or of the place on the belt (m). Under the smooth
law `rk4` is compared with `plain.c` at the same step, which leaves rounding errors. The other references are methods of
the package at their tightest tolerance, which `benchmarks.work_precision` compares with other libraries.

Writes `speed.md`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from benchmarks._common import (
    PAPER_STEPS,
    Cell,
    Times,
    alternate,
    bare,
    command,
    configure,
    family,
    machine,
    one_core,
    publish,
    ring,
    shown,
)
from benchmarks.peers import in_c
from benchmarks.rows import belt
from benchmarks.work_precision import SCENES
from ringsweep.models import MODELS
from ringsweep.runs import sweep
from ringsweep.runs.executors import Execution

#: A column of the result files, the value at the end, by model.
ENDS = {"ring": "phi_end", "belt": "x_end"}

PLAIN = "plain.c, same step"

SMOOTH, STIFF, LIMIT = SCENES["smooth"], SCENES["stiff"], SCENES["limit"]
#: The ring under LuGre's law, and the belt under Bengisu and Akay's and under LuGre's.
RING_LUGRE = ring({"law": "lugre", "sigma0": 1e3, "sigma1": 30.0, "sigma2": 0.1, "v_s": 1e-2})
BELT = belt("bengisu-akay", alpha=100.0, v0=0.01)
BELT_LUGRE = belt("lugre", sigma0=1e5, sigma1=316.2, sigma2=0.4, v_s=1e-3)


class Effort(NamedTuple):
    """Amount of measurement: cells of `rk4` and of its unit, of other methods and of a sweep; share of steps."""

    lanes: int
    cells: int
    sweep: int
    steps: float
    rounds: int


FULL, QUICK = Effort(480, 256, 131072, 1.0, 9), Effort(96, 32, 8192, 0.2, 3)


@dataclass(frozen=True)
class Contender:
    """A method on a scene."""

    method: str
    scene: str
    call: Callable[[], Any]
    unit: str
    """Title of the unit of its speed."""
    cells: int
    steps: int | None
    """Steps of a cell, if the cost is that of a step and not of a run."""
    end: Callable[[Any], Any]
    """Values at the end, from what `call` returns."""
    exact: Callable[[], Any] | None
    """Values to compare with those at the end."""
    against: str
    """What these values are."""


# ---- contenders ----------------------------------------------------------------------------


def mild(count: int) -> list[Cell]:
    """Cells of the ring that run to the end of the span under every law."""
    half_angles = np.random.default_rng(1).permutation(np.radians(np.linspace(2.0, 60.0, count)))
    return list(zip(np.geomspace(0.1, 0.3, count).tolist(), half_angles.tolist(), strict=True))


def at(cells: Sequence[Cell]) -> dict[str, list[float]]:
    """Cells of the ring as points of a sweep."""
    amplitudes, half_angles = (list(column) for column in zip(*cells, strict=True))
    return {"drive.amplitude": amplitudes, "zone.half_angle": half_angles}


def own(
    scene: Mapping[str, Any],
    words: str,
    points: Mapping[str, Any],
    method: str,
    tightest: tuple[str, float],
    *,
    unit: str = "A",
    exact: tuple[Callable[[], Any], str] | None = None,
    **options: Any,
) -> Contender:
    """A method of the package, compared with a method at its tightest tolerance, or with `exact` values."""
    column = MODELS[scene["model"]].outcomes.index(ENDS[scene["model"]])

    def end(result: Any) -> Any:
        return result.rows[:, column]

    call = bare(configure(scene, points, method, **options))
    best, rtol = tightest
    reference = bare(configure(scene, points, best, rtol=rtol))
    values, against = exact or (lambda: end(reference()), f"`{best}`, rtol {rtol:.0e}")
    cells = len(next(iter(points.values())))
    return Contender(f"`{method}`", words, call, unit, cells, options.get("steps"), end, values, against)


def units(effort: Effort) -> list[Contender]:
    """The units, B under both laws of the ring; none without compilers."""
    if not (in_c.compiler("cc") and in_c.compiler("c++")):
        return []
    cells, steps = mild(effort.lanes), round(PAPER_STEPS * effort.steps)
    exact = in_c.plain(SMOOTH.law, cells, steps)

    def entry(title: str, words: str, call: Callable[[], Any], count: int, compared: bool = False) -> Contender:
        values, against = (lambda: exact().phi_end, PLAIN) if compared else (None, "")
        return Contender(title, words, call, title[0], count, steps, lambda found: found.phi_end, values, against)

    return [
        entry("A, plain.c", "ring, stiff", in_c.plain(STIFF.law, cells[:8], steps), 8),
        entry("B, vector.cpp", "ring, stiff", in_c.vector(STIFF.law, cells, steps), len(cells)),
        entry("B, vector.cpp", "ring, smooth", in_c.vector(SMOOTH.law, cells, steps), len(cells), compared=True),
    ]


def contenders(effort: Effort) -> list[Contender]:
    """Methods of the package."""
    paper = round(PAPER_STEPS * effort.steps)
    cells, smooth_exact = mild(effort.lanes), None
    if units(effort):
        plain = in_c.plain(SMOOTH.law, cells, paper)
        smooth_exact = (lambda: plain().phi_end), PLAIN
    points, velocities = at(cells), {"belt.velocity": np.linspace(0.05, 0.2, effort.lanes).tolist()}
    few = {"belt.velocity": np.linspace(0.05, 0.2, 64).tolist()}
    implicit, event = ("implicit", 1e-12), ("event", 1e-15)
    lugre = round(100_000 * max(effort.steps, 0.5))
    return [
        own(SMOOTH.scene, "ring, smooth", points, "rk4", implicit, unit="B", exact=smooth_exact, steps=paper),
        own(STIFF.scene, "ring, stiff", points, "rk4", implicit, unit="B", steps=paper),
        own(BELT, "belt, Bengisu-Akay", velocities, "rk4", implicit, unit="B", steps=PAPER_STEPS),
        own(BELT_LUGRE, "belt, LuGre", few, "rk4", implicit, unit="B", steps=lugre),
        own(RING_LUGRE, "ring, LuGre", points, "rk4", implicit, unit="B", steps=4 * paper),
        own(LIMIT.scene, "ring, stiction", at(LIMIT.cells(effort.cells)), "event", event, certify=True),
        own(STIFF.scene, "ring, stiff", at(STIFF.cells(effort.cells)), "implicit", implicit, certify=True),
        own(SMOOTH.scene, "ring, smooth", at(SMOOTH.cells(effort.cells)), "implicit", implicit, certify=True),
        own(BELT_LUGRE, "belt, LuGre", few, "implicit", implicit, certify=True),
    ]  # fmt: skip


# ---- rows ----------------------------------------------------------------------------------

HEADER = ["method", "scene", "time", "in units", "largest error", "compared with", "certified"]


def number(value: float) -> str:
    """Three digits of a number, without an exponent."""
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def rows(given: Sequence[Contender], others: Sequence[Contender], rounds: int) -> list[list[str]]:
    """Rows of the units and of other contenders, measured in turn."""
    entered = [*given, *others]
    for contender in entered:
        contender.call()
    with one_core():
        times, results = alternate(dict(enumerate(contender.call for contender in entered)), rounds)

    def each(key: int) -> Times:
        """Time of a step or of a run in each round."""
        count = entered[key].cells * (entered[key].steps or 1)
        return Times([wall / count for wall in times[key].wall])

    bases = {(one.unit, one.scene): key for key, one in enumerate(entered[: len(given)])}
    usual = {"A": ("A", "ring, stiff"), "B": ("B", "ring, smooth")}
    found = []
    for key, one in enumerate(entered):
        factor, what = (1e9, "ns a step") if one.steps else (1e6, "us a run")
        unit = bases.get((one.unit, one.scene), bases.get(usual[one.unit]))
        ratio = f"{number(each(key).ratio(each(unit)))} {one.unit}" if unit is not None else "-"
        error = f"{np.nanmax(abs(one.end(results[key]) - one.exact())):.0e}" if one.exact else "-"
        certified = f"{100.0 * results[key].certified.mean():.1f} %" if one.steps is None else "-"
        cost = f"{number(factor * each(key).median)} {what}"
        found.append([one.method, one.scene, cost, ratio, error, one.against or "-", certified])
    return found


def costly_last(scene: Mapping[str, Any], cells: int, method: str, **options: Any) -> Any:
    """Configuration of a whole family of cells, the most expensive ones last: there an idle core would have to wait."""
    points = at(family(round(cells**0.5)))
    steps = bare(configure(scene, points, method, **options))().steps
    order = np.argsort(steps, kind="stable")
    return configure(
        scene, {path: np.array(values)[order].tolist() for path, values in points.items()}, method, **options
    )


def two_cores(effort: Effort) -> list[list[str]]:
    """Rows of sweeps by two jobs, and of how much faster they are than one job."""
    found = []
    for scene, method, share in ((SMOOTH, "rk4", 1), (LIMIT, "event", 1), (STIFF, "implicit", 4)):
        options = {"steps": PAPER_STEPS} if method == "rk4" else {}
        configuration = costly_last(scene.scene, effort.sweep // share, method, **options)
        runs = {jobs: partial(sweep.compute, configuration, Execution(jobs, progress=False)) for jobs in (1, 2)}
        times, _ = alternate(runs, max(3, effort.rounds // 2))
        found.append([
            f"`{method}`, two jobs", f"{effort.sweep // share} cells", f"{times[2].median:.2f} s",
            f"{times[1].ratio(times[2]):.2f} x as fast as one job", "-", "-", "-",
        ])  # fmt: skip
    return found


def main() -> None:
    """Measure, print, write."""
    given = command(__doc__).parse_args()
    effort = QUICK if given.quick else FULL
    compilers = [in_c.compiler(name) or f"no compiler ({name}): no units" for name in ("cc", "c++")]
    where = "\n".join([machine(), *compilers, f"A: {' '.join(in_c.PLAIN_FLAGS)}", f"B: {' '.join(in_c.VECTOR_FLAGS)}"])
    print(where)
    found = [*rows(units(effort), contenders(effort), effort.rounds), *two_cores(effort)]
    publish(given, "speed", "Speed and error", where, f"{ABOUT}\n{shown('Speed and error', HEADER, found)}")


#: Explanation at the head of the report.
ABOUT = """
One core, compiled before; runs and units alternate. A is a step of Runge-Kutta 4 written down plainly in scalar C, B a
step of the same method vectorised by hand; `python -m benchmarks.speed --help` says more. `event` and `implicit` run
with certificates. `rk4` takes 5000 steps over 10 s on the ring and over 20 s on the belt; under LuGre's law 20 000 and
100 000. Errors are the largest over the cells: of the angle at the end (rad), or of the place on the belt (m). The
stiff law needs far smaller steps of `rk4` ([error against run time](work_precision.md)), and its row is about speed
alone.
"""


if __name__ == "__main__":
    main()
