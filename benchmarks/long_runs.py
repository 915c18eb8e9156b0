"""Whether words of long runs of a forced belt are right, in random scenes.

    python -m benchmarks.long_runs [--count 2000] [--seed 30]

The scenes are those of the family `belt forced` of :mod:`benchmarks.brute_force`: stiction, Coulomb and Tustin
friction, belts that move or stand still, linear and stiffening springs, forces around resonance. Each scene runs over
300, 617 and 1000 periods of the force. Of the certified runs that are `settled` at 300 periods, how many keep
`long_run`, `period` and `regime` in the longer runs? A judgement of its own takes the last 128 points of the longest
run, one per period of the force: the motion has the period n if each point is where the n-th before it was. It shares
the integration with the package, but not its evidence.

Writes `long_runs.md`.
"""

from __future__ import annotations

import logging
from collections import Counter
from time import perf_counter
from typing import Any

import numpy as np

import ringsweep
from benchmarks import _common
from benchmarks.brute_force import draw, families, nest

PERIODS = (300, 617, 1000)
COUNT, QUICK, SEED = 2000, 90, 30
#: Points of the judgement, the longest period that it looks for, in periods of the force, and distance of points that
#: are the same, in ranges of all points.
KEPT, LONGEST, SAME = 128, 32, 1e-3

Points = dict[str, np.ndarray]


def scenes(kind: Any, count: int, rng: np.random.Generator) -> tuple[Points, np.ndarray]:
    """Random scenes of a kind, by paths, and the periods of their forces, s."""
    drawn = [draw(rng, kind) for _ in range(count)]
    points = {path: np.array([values[path] for values in drawn]) for path in drawn[0]}
    return points, 1.0 / points["force.frequency"]


def run(kind: Any, points: Points, **record: Any) -> Any:
    """Certified runs of scenes."""
    scene = nest(kind, {path: float(column[0]) for path, column in points.items()})
    sweep = {"points": {path: column.tolist() for path, column in points.items()}}
    return ringsweep.run({"scene": scene, "sweep": sweep} | ({"record": record} if record else {}), progress=False)


def own_periods(x: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Period of each motion in periods of the force, from its section; 0 if none is found."""
    found = np.zeros(len(x), int)
    scale = np.hypot(np.ptp(x, axis=1), 1e-9 + np.abs(x).max(axis=1))[:, None]
    fast = np.hypot(np.ptp(velocity, axis=1), 1e-9 + np.abs(velocity).max(axis=1))[:, None]
    for n in range(LONGEST, 0, -1):
        away = np.maximum(np.abs(x[:, n:] - x[:, :-n]) / scale, np.abs(velocity[:, n:] - velocity[:, :-n]) / fast)
        found[away.max(axis=1) <= SAME] = n
    return found


def words(kind: Any, points: Points, period: np.ndarray, tally: Counter[str]) -> list[str]:
    """Count which words hold in longer runs; returns a line for each scene whose words differ."""
    runs = [run(kind, points | {"time.span": n * period}) for n in PERIODS[:-1]]
    runs.append(run(kind, points | {"time.span": PERIODS[-1] * period}, section={"at": "period", "keep": KEPT}))
    long_run, regime = ([ringsweep.words(one[name]).values for one in runs] for name in ("long_run", "regime"))
    own = own_periods(runs[-1]["x_section"].values, runs[-1]["velocity_section"].values)
    told = np.round(runs[0]["period"].values / period)
    lines = []
    for k in range(len(period)):
        tally["scenes"] += 1
        if not all(int(one["certified"][k]) for one in runs) or not int(runs[0]["settled"][k]):
            tally["not certified" if int(runs[0]["settled"][k]) else "not settled"] += 1
            continue
        tally["settled"] += 1
        tally[f"as {long_run[0][k]}"] += 1
        faults = []
        if len({one[k] for one in long_run}) > 1:
            faults.append("long_run")
        if len({one[k] for one in regime}) > 1:
            faults.append("regime")
        if long_run[0][k] == "periodic":
            periods = np.round([one["period"].values[k] / period[k] for one in runs])
            if np.ptp(periods[np.isfinite(periods)]) > 0.0:
                faults.append("period")
            # What returns each time has a period that the true one divides.
            if (told[k] % own[k] if own[k] else told[k] <= LONGEST) != 0:
                faults.append("own judgement")
        elif long_run[0][k] in ("chaotic", "quasi-periodic") and own[k] != 0:
            faults.append("own judgement")
        for fault in faults:
            tally[f"other {fault}"] += 1
        if faults:
            lines.append(
                f"{', '.join(faults)}: {[str(one[k]) for one in long_run]}, {[str(one[k]) for one in regime]}, "
                f"periods {[float(np.round(one['period'].values[k] / period[k], 3)) for one in runs]}, own {own[k]}: "
                f"{kind.law}, {scene_of(points, k)}"
            )
    return lines


def scene_of(points: Points, k: int) -> dict[str, float]:
    """Numbers of one scene by paths."""
    return {path: float(column[k]) for path, column in points.items()}


WORDS = ["scenes", "not settled", "not certified", "settled", "other long_run", "other period", "other regime",
         "other own judgement"]  # fmt: skip


def main() -> None:
    """Draw, compare, print, write."""
    parser = _common.command(__doc__)
    parser.add_argument("--count", type=int, help=f"scenes (default {COUNT}; {QUICK} with --quick)")
    parser.add_argument("--seed", type=int, default=SEED)
    given = parser.parse_args()
    logging.getLogger("ringsweep").setLevel(logging.ERROR)
    print(where := _common.machine())
    kinds = families()["belt forced"]
    count = (given.count or (QUICK if given.quick else COUNT)) // len(kinds)
    tally: Counter[str] = Counter()
    begin = perf_counter()
    for k, kind in enumerate(kinds):
        points, period = scenes(kind, count, np.random.default_rng([given.seed, k]))
        for line in words(kind, points, period, tally):
            print(line)
    seconds = perf_counter() - begin
    title = "Words over 300, 617 and 1000 periods"
    body = f"## {title}\n\n{_common.shown(title, WORDS, [[str(tally[name]) for name in WORDS]])}\n"
    settled = ", ".join(f"{n} {word[3:]}" for word, n in sorted(tally.items()) if word.startswith("as "))
    body += f"Settled: {settled}. {seconds:.0f} s, seed {given.seed}.\n"
    print(settled)
    _common.publish(given, "long_runs", "Long runs of a forced belt", where, body)


if __name__ == "__main__":
    main()
