"""An independent answer to a scene, and how reliable it is. This package uses nothing of ringsweep.

It has its own balances of momentum and integrates them with Radau IIA. At rest, and wherever friction jumps, it tries
all modes of the contacts. It runs each scene on the ring four times:

- with tight tolerances;
- with tolerances a hundred times as wide;
- twice more with these wide tolerances and with shifted thresholds, up and down by a millionth: all friction
  coefficients, the reaction at which a contact is lost (in weights of the body), the full turn and, shifted by a
  thousandth, the angular velocity of a reversal.

If the drive has an infinite acceleration at t = 0, a body at rest is followed through the first instant, in which
accelerations fall and velocities hardly grow: in the upward shift from 0 on, in the others from 1e-14 s on. If the
runs do not agree in kind, the scene is ambiguous. A scene on the belt is run twice, at the two tolerances. Under a
force the run is long: both tolerances are a hundred times as wide, and if the runs differ it is run once more with the
tight tolerance.

A scene with `impact` goes on after a lost contact (:mod:`benchmarks.reference.aftermath`), in four variations too; the
shift then changes restitution and friction, and not the reaction at which a contact is lost.

:mod:`benchmarks.reference.compliant` gives a second opinion on the end of a run. It shares no criterion with this one.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from benchmarks.reference.aftermath import follow
from benchmarks.reference.physics import JAMMED, OPEN_1, OPEN_2, OPEN_BOTH, SEVERAL
from benchmarks.reference.problem import problem
from benchmarks.reference.run import UNRESOLVED, run

TIGHT, LOOSE, SHIFT = 1e-9, 1e-7, 1e-6
MOST_STEPS = 60_000
#: Variations of a scene: tolerance, and shift of all thresholds.
VARIATIONS = ((TIGHT, 0.0), (LOOSE, 0.0), (LOOSE, SHIFT), (LOOSE, -SHIFT))
#: Relative shift of friction and restitution that stands for rounding.
ROUNDING = 1e-12
#: Closing speed below which an impact is plastic, m/s, at a tolerance of a step.
REST = {TIGHT: 1e-6, LOOSE: 1e-5}
#: Numbers of what follows a lost contact.
NUMBERS = ("open_time", "flight_time", "gap_max", "separations", "impacts", "impact_speed_max", "impulse_max",
           "impact_loss", "tumbles", "t_recovered")  # fmt: skip


@dataclass(frozen=True)
class Verdict:
    """Answer of the reference to a scene.

    Attributes
    ----------
    state : str
        ``clear``, ``ambiguous`` or ``unresolved``.
    kind : tuple or None
        Regime, motion and separating contact, and with `impact` the aftermath; None on the belt.
    numbers : dict
        Outcomes by name.
    spread : dict
        Difference between the runs at the two tolerances, by name.
    why : str
        Explanation for a reader.
    runs : list
        Results of all runs, see :data:`benchmarks.reference.run.RESULT`.
    """

    state: str
    kind: tuple | None
    numbers: dict
    spread: dict
    why: str
    runs: list = field(repr=False, default_factory=list)


def _kind(found):
    motion = "revolving" if found["turned"] else "oscillatory" if found["reversals"] else "resting"
    end = found["end"]
    if end in (OPEN_1, OPEN_2, OPEN_BOTH):
        return "separating", motion, int(end - OPEN_1) + 1
    return ("jammed" if end in (JAMMED, SEVERAL) else motion), motion, 0


def _numbers(found, belt):
    if belt:
        return {"x_end": found["position"], "velocity_end": found["speed"], "t_end": found["t_end"]}
    apart = found["end"] in (OPEN_1, OPEN_2, OPEN_BOTH)
    return {
        "t_end": found["t_end"],
        "phi_end": found["position"],
        "omega_end": found["speed"],
        "t_separation": found["t_end"] if apart else float("nan"),
    }


def go_on(scene, rtol=TIGHT, shift=0.0, keep=0):
    """Run of a scene with `impact`: outcomes by name, and the first `keep` events."""
    p = problem(scene, 1.0 + shift)
    p = p._replace(restitution=min(1.0, p.restitution * (1.0 + shift)))
    exchanged = p._replace(offset=-p.offset, xi=p.xi - 2.0 * p.offset)
    log = np.zeros((keep, 5))
    found = follow(p, exchanged, rtol, REST[rtol], MOST_STEPS, log)
    return found, log[: found["events"]]


def word(found, single):
    """Word for what followed a lost contact."""
    if found["separations"] == 0:
        return "held"
    if found["tumbles"] > 0:
        return "tumbled"
    return "recovered" if found["closed"] == (1 if single else 3) else "open"


def judge(scene):
    """Verdict on a scene, a mapping as in a configuration, but with numbers only (SI)."""
    belt, forced = scene["model"] == "belt", "force" in scene
    runs, most_steps, wider = [], MOST_STEPS * (20 if forced else 1), 100.0 if forced else 1.0
    for rtol, shift in VARIATIONS[: 2 if belt else 4]:
        found = run(problem(scene, 1.0 + shift), wider * rtol, shift, shift, most_steps)
        runs.append(found)
        if found["end"] == UNRESOLVED:
            why = f"stopped at {found['t_end']:.6g} s after {found['steps']} steps and {found['events']} events"
            return Verdict("unresolved", None, {}, {}, why, runs)
    if "impact" in scene:
        return _judge_aftermath(scene, runs)
    first, second = runs[:2]
    if forced and not abs(first["position"] - second["position"]) < 1e-8:
        # Errors may grow over hundreds of periods.
        third = run(problem(scene), TIGHT, 0.0, 0.0, most_steps)
        if third["end"] != UNRESOLVED:
            first, second = third, first
    numbers, other = _numbers(first, belt), _numbers(second, belt)
    spread = {name: abs(numbers[name] - other[name]) for name in numbers}
    if belt:
        return Verdict("clear", None, numbers, spread, f"ends at {numbers['x_end']:.9g} m", runs)
    kinds = [_kind(found) for found in runs]
    if first["end"] in (OPEN_1, OPEN_2, OPEN_BOTH):
        why = f"contact {kinds[0][2]} separates at {first['t_end']:.9g} s, {first['position']:.6g} rad"
        why = why.replace("contact 3 separates", "both contacts separate")
    elif first["end"] in (JAMMED, SEVERAL):
        why = f"jams at {first['t_end']:.9g} s, {first['position']:.6g} rad"
    else:
        why = f"both contacts hold, least reactions in slip {first['least_1']:.3g} and {first['least_2']:.3g} weights"
    if any(kind != kinds[0] for kind in kinds):
        return Verdict("ambiguous", kinds[0], numbers, spread, " / ".join(map(str, dict.fromkeys(kinds))), runs)
    if any(found["end"] == SEVERAL for found in runs):
        return Verdict("ambiguous", kinds[0], numbers, spread, "several contacts could separate", runs)
    return Verdict("clear", kinds[0], numbers, spread, f"{why}; {first['reversals']:.0f} reversals", runs)


def _judge_aftermath(scene, runs):
    """Verdict on a scene with `impact`, from the runs up to the first loss."""
    # The wide tolerance with a shift of the size of rounding, which a row of impacts may magnify.
    found = [go_on(scene, rtol, shift or (rtol == LOOSE) * ROUNDING)[0] for rtol, shift in VARIATIONS]
    kinds = [
        (*_kind(run), word(after, scene["model"] == "ring-single-contact"))
        for run, after in zip(runs, found, strict=True)
    ]
    numbers, other = (
        {"t_end": after["t_end"], "phi_end": after["position"], "omega_end": after["speed"]}
        | {"t_separation": run["t_end"] if kind[0] == "separating" else math.nan}
        | {name: after[name] for name in NUMBERS}
        for run, after, kind in zip(runs[:2], found, kinds, strict=False)
    )
    spread = {name: abs(numbers[name] - other[name]) for name in numbers}
    for after in found:
        if after["end"] == UNRESOLVED:
            why = f"stopped at {after['t_end']:.6g} s after {after['steps']} steps and {after['events']} events"
            return Verdict("unresolved", None, numbers, spread, why, found)
    first = found[0]
    why = (
        f"{kinds[0][3]}; lost at {numbers['t_separation']:.9g} s, {first['impacts']} impacts, open for "
        f"{first['open_time']:.6g} s and up to {first['gap_max']:.4g} m, ends at {first['t_end']:.9g} s"
    )
    if any(kind != kinds[0] for kind in kinds) or any(after["end"] == SEVERAL for after in found):
        return Verdict("ambiguous", kinds[0], numbers, spread, " / ".join(map(str, dict.fromkeys(kinds))), found)
    if len({after["end"] for after in found}) > 1:
        return Verdict("ambiguous", kinds[0], numbers, spread, "jams, or not", found)
    return Verdict("clear", kinds[0], numbers, spread, why, found)
