"""Certified answers against an independent reference, over the whole space of scenes.

    python -m benchmarks.brute_force [--count 10000] [--families stiction "belt dahl" ...]

Draws random scenes by families. `ringsweep.sweep` answers them in batches, :mod:`benchmarks.reference` answers them
one by one. Each core works on a batch of its own. The benchmark prints a table with a row for each family:

- contradicted: certified, but the reference finds another regime, motion or separating contact. Each such scene is
  printed so that it can be run again, with the answer of the reference;
- off: certified, and regime, motion and contact are right, but the error at the end (radians or seconds) exceeds both
  1e-3 and the stated bound;
- uncertified: the sweep gives no certificate;
- ambiguous: the runs of the reference, at other tolerances or with all thresholds shifted by a millionth, do not agree,
  or several contacts could separate. Not compared;
- unresolved: the reference did not finish within its limits. Not compared;
A second table has a row for each kind of end of a certified run on two contacts. It says how often a body on compliant
contacts, :mod:`benchmarks.reference.compliant`, confirmed or contradicted the end, or left it undecided. Contradicted
ends are printed so that they can be run again. Of the runs whose contacts hold, every twentieth is looked at, where the
reference finds the least reaction. After a lost contact the column "shared impact" counts bodies on springs that end
otherwise since they part from the rigid body in an impact at one contact while the other holds: both give way there, in
an order that a rigid body does not know.

Some families aim at what package and reference once had wrong together, or what neither had met: narrow bodies with
friction coefficients up to 2 (`painleve`), laws with narrow features at random speeds (`features`), launches without
friction under one contact or both (`ice`), numbers at the ends of their ranges (`far`), and a belt with a force over
300 periods (`belt forced`).

On the belt, displacements at the end are compared and not regimes. A scene is contradicted if the error exceeds both
the stated bound and a thousandth of the length scale (stick length mu_s m g / k, plus the path of the belt in a short
run). It is ambiguous if two tolerances of the reference differ by more than a hundredth of that. Under a force, nothing
is compared where the package gives no bound and so claims no number. There are a tenth as many of these long runs, and
three tenths as many of `far`. The law `bristle` is left out, because its random bonds cannot be repeated independently.

Writes `brute_force.md`, or `brute_force_impact.md`, for example, if one family was asked for. `--quick` draws from
three.

``--csv PATH`` writes the 500 scenes of ``tests/test_brute_force.py`` instead: the scene (SI units, on the paper's
rig); regime, motion, contact and time of separation; least reaction in weights of the body; whether the runs of the
reference agree in kind; what the compliant body says of the end.

``--impacts PATH`` writes the scenes of ``tests/test_impacts_by_reference.py``: the scene by paths (SI),
regime, contact and aftermath, and the numbers of what follows, of which the reference is sure.
"""

import csv
import math
import multiprocessing
import pprint
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr
from tqdm import tqdm

import ringsweep
from benchmarks import _common
from benchmarks.reference import go_on, judge, rattling
from benchmarks.reference.aftermath import MOST_EVENTS
from benchmarks.reference.compliant import opinion
from benchmarks.reference.problem import FORMULAS, problem
from benchmarks.reference.run import drive

COUNT, QUICK, SEED = 10_000, 300, 181
#: Families of a quick run, with the first kind of each: every kind of scene compiles a kernel.
FEW = ("stiction", "belt lugre", "impact")
#: Of the certified runs whose contacts hold, the compliant body is asked about one in this many.
HELD_EVERY = 20
#: Of the certified runs that lose a contact and go on, the compliant body is asked about one in this many.
LOST_EVERY = 5
RIG = {
    "body.mass": 0.076,
    "body.inertia": 4.47e-5,
    "body.half_distance": 0.025,
    "body.ball_radius": 0.010,
    "ring.radius": 0.043378,
}
ONE = ("mu_k",)
BOTH = ("mu_s", "mu_k")
#: Friction coefficients and parameters of each law.
LAWS = {
    "coulomb": (ONE, ()),
    "stiction": (BOTH, ()),
    "tustin": (BOTH, ("alpha",)),
    "threlfall": (ONE, ("v0",)),
    "piecewise-linear": (BOTH, ("v0", "v1")),
    "piecewise-cubic": (BOTH, ("v0", "v1")),
    "bengisu-akay": (BOTH, ("alpha", "v0")),
    "dahl": (ONE, ("sigma0",)),
    "lugre": (BOTH, ("sigma0", "sigma1", "sigma2", "v_s")),
    "elasto-plastic": (BOTH, ("sigma0", "sigma1", "sigma2", "v_s")),
    "karnopp": (BOTH, ("dead_band",)),
    "reset-integrator": (BOTH, ("sigma0", "sigma1")),
    "bump": (BOTH, ("vb", "w")),
    "tent": (BOTH, ("vb", "w")),
    "hump": (BOTH, ("vb", "w")),
    "jump": (BOTH, ("vb",)),
}
BRISTLES = ("dahl", "lugre", "elasto-plastic", "reset-integrator")
NAMED_LAWS = tuple(name for name in LAWS if name not in FORMULAS)
RING_LAWS = tuple(name for name in NAMED_LAWS if name not in ("karnopp", "reset-integrator"))
IMPACT_LAWS = (*(name for name in RING_LAWS if name not in BRISTLES), "bump", "jump")
DRIVES = ("none", "constant", "arctan", "power", "sinusoidal", "table")
#: Samples of the drive `table`: s, rad (m on the belt).
TABLE_TIME = np.linspace(0.0, 3.2, 17)
TABLE_THETA = np.round(0.4 * np.sin(2.1 * TABLE_TIME) + 0.15 * np.sin(5.3 * TABLE_TIME + 0.7) - 0.0966, 6)


@dataclass(frozen=True)
class Kind:
    """Common properties of the scenes of a batch, which share one compiled kernel."""

    model: str
    law: str
    drive: str
    arcs: int = 0
    launch: str = "mixed"
    friction: str = "usual"
    shape: str = "usual"
    force: bool = False
    impact: bool = False
    far: bool = False


def families():
    """Kinds of scenes by family."""
    table = {}
    others = ("sinusoidal", "power", "constant", "none", "table")
    for i, law in enumerate(RING_LAWS):
        table[law] = [Kind("ring", law, "arctan", 1), Kind("ring", law, others[i % 5])]
    for i, law in enumerate(RING_LAWS):
        drives = ("arctan", "none", "sinusoidal", "power", "constant", "table")
        table.setdefault("one contact", []).append(Kind("ring-single-contact", law, drives[i % 6], i % 2))
    for law in ("coulomb", "stiction", "tustin", "piecewise-linear", "bengisu-akay", "lugre"):
        table.setdefault("several zones", []).extend(Kind("ring", law, "arctan", n) for n in (2, 5))
        table.setdefault("high friction", []).append(Kind("ring", law, "arctan", 1, friction="high"))
        table.setdefault("geometry", []).append(Kind("ring", law, "arctan", 1, shape="any"))
    for law in ("stiction", "bengisu-akay"):
        table.setdefault("drives", []).extend(Kind("ring", law, name, 1) for name in DRIVES)
        table.setdefault("launches", []).extend(
            Kind("ring", law, name, 1, launch=how) for name in ("none", "constant") for how in ("at rest", "any")
        )
    for law in ("coulomb", "stiction"):
        table["launches"].append(Kind("ring", law, "none", 0, launch="at rest", friction="high", shape="any"))
        table["launches"].append(Kind("ring", law, "arctan", 1, launch="at rest", friction="high", shape="any"))
    for law in ("coulomb", "stiction", "tustin"):
        table.setdefault("painleve", []).extend(
            Kind("ring", law, name, 1, launch=how, friction="highest", shape="narrow")
            for name, how in (("none", "any"), ("arctan", "mixed"), ("sinusoidal", "at rest"))
        )
    for law in FORMULAS:
        table.setdefault("features", []).append(Kind("ring", law, "none", int(law != "hump"), launch="any"))
        table["features"].append(Kind("ring", law, "arctan", int(law != "hump"), shape="any"))
        table["features"].append(Kind("belt", law, "sinusoidal"))
    for law in ("coulomb", "stiction"):
        table.setdefault("ice", []).extend(
            Kind("ring", law, name, 1, launch="at rest", friction="ice") for name in ("arctan", "power", "sinusoidal")
        )
    for i, law in enumerate(IMPACT_LAWS):
        for j, model in enumerate(("ring", "ring", "ring", "ring-single-contact")):
            name, launch = DRIVES[(i + j) % 6], ("mixed", "any", "at rest", "any")[j]
            shape = "any" if (i + j) % 2 else "usual"
            table.setdefault("impact", []).append(
                Kind(model, law, name, int(law not in ("hump", "jump") or j < 2), launch, shape=shape, impact=True)
            )
    for law in ("stiction", "tustin", "bengisu-akay", "lugre"):
        name = "sinusoidal" if law in ("stiction", "lugre") else "arctan"
        table.setdefault("far", []).append(Kind("ring", law, name, 1, "mixed", "high", "far", far=True))
        table["far"].append(Kind("belt", law, "sinusoidal" if law == "tustin" else "", far=True))
    table["far"].append(Kind("ring", "stiction", "arctan", 1, shape="far", impact=True, far=True))
    for law in ("coulomb", "stiction", "tustin"):
        table.setdefault("belt forced", []).append(Kind("belt", law, "", force=True))
    for i, law in enumerate(NAMED_LAWS):
        table[f"belt {law}"] = [Kind("belt", law, ""), Kind("belt", law, DRIVES[1:][i % 5])]
    return table


def pick(rng, *choices):
    """One of several (weight, value) pairs."""
    weights = np.array([weight for weight, _ in choices], float)
    return choices[rng.choice(len(choices), p=weights / weights.sum())][1]


def log(rng, low, high):
    """Log-uniform between powers of ten."""
    return 10.0 ** rng.uniform(low, high)


def parameters(rng, law, belt, weight=1.0):
    """Random parameters of a law; on the belt, per weight of the body."""
    v0, vb = log(rng, -9, 0), log(rng, -2, 0.5) * (0.3 if belt else 1.0)
    values = {
        "vb": vb,
        "w": vb * log(rng, -2, -0.8),
        "alpha": log(rng, 0, 7),
        "v0": v0,
        "v1": v0 * (1.0 + log(rng, -1, 2)),
        "v_s": log(rng, -3, -1),
        "dead_band": log(rng, -4, -1.5),
        "sigma0": weight * (log(rng, 1.0, 3.7) if belt else log(rng, 1.5, 4.3)),
        "sigma1": weight * pick(rng, (1, 0.0), (4, log(rng, -2, 0.7))),
        "sigma2": weight * pick(rng, (1, 0.0), (1, rng.uniform(0.0, 0.05))),
    }
    if belt and law in ("threlfall", "piecewise-linear", "piecewise-cubic", "bengisu-akay"):
        values["v0"] = log(rng, -6, -1)
        values["v1"] = values["v0"] * (1.0 + log(rng, -1, 2))
    return {f"friction.{name}": values[name] for name in LAWS[law][1]}


def coefficients(rng, law, prefix, scale):
    """Random friction coefficients by path."""
    mu_k = rng.uniform(0.02, 0.5) * scale
    mu_s = mu_k + pick(rng, (1, 0.0), (9, rng.uniform(0.0, 0.4))) * scale
    if law in FORMULAS:
        # A law that begins with less than mu_s at rest.
        mu_s = mu_k + rng.uniform(0.02, 0.4)
    return {f"{prefix}.{name}": {"mu_s": mu_s, "mu_k": mu_k}[name] for name in LAWS[law][0]}


def height(rng, law, values):
    """Random height of the feature of a law by path; friction stays positive."""
    if law not in ("bump", "tent"):
        return {}
    least = min(value for path, value in values.items() if path.endswith("mu_k"))
    return {"friction.h": pick(rng, (1, -rng.uniform(0.1, 0.9) * least), (1, rng.uniform(0.05, 0.6)))}


def driven(rng, name, belt):
    """Random parameters of a drive by path."""
    sign = rng.choice([-1.0, 1.0])
    values = {
        "none": {},
        "constant": {"amplitude": sign * log(rng, -1, 1.3)},
        "arctan": {"amplitude": sign * log(rng, -1, 1.3)},
        "power": {"amplitude": sign * log(rng, -1, 1.3), "exponent": rng.uniform(1.05, 3.0)},
        "sinusoidal": {
            "amplitude": sign * log(rng, -1.3, 0.3),
            "frequency": rng.uniform(0.3, 5.0),
            "phase": pick(rng, (1, 0.0), (1, 0.5 * math.pi), (2, rng.uniform(-math.pi, math.pi))),
        },
        "table": {"amplitude": sign * log(rng, -1, 1)},
    }[name]
    if belt and "amplitude" in values:
        values["amplitude"] *= 0.1
    return {f"drive.{key}": value for key, value in values.items()}


def ring_scene(rng, kind):
    """A random scene of a ring by paths."""
    two = kind.model == "ring"
    values = dict(RIG) if two else {"body.mass": 0.076, "ring.radius": rng.uniform(0.03, 0.2)}
    if two and (kind.shape != "usual" or rng.random() < 0.3):
        angles = {"any": (5.0, 85.0), "far": (2.0, 89.0), "narrow": (5.0, 25.0), "usual": (25.0, 65.0)}
        beta = math.radians(rng.uniform(*angles[kind.shape]))
        radius, ball = rng.uniform(0.03, 0.1), rng.uniform(0.1, 0.4)
        half, mass = radius * (1.0 - ball) * math.sin(beta), rng.uniform(0.02, 0.5)
        values = {
            "body.mass": mass,
            "body.inertia": mass * (half * rng.uniform(0.4, 1.3)) ** 2,
            "body.half_distance": half,
            "body.ball_radius": radius * ball,
            "ring.radius": radius,
        }
    # Some scenes almost without friction, so that the body revolves; some so rough that it can jam.
    scale = pick(rng, (2, 0.02), (8, 1.0), (1, 2.2))
    if kind.friction == "high":
        scale = pick(rng, (1, 1.0), (3, 2.2))
    if kind.friction == "highest":
        scale = pick(rng, (1, 1.0), (3, 2.2), (3, 4.0))
    ice = pick(rng, (1, ("rest",)), (1, ("rough",)), (1, ("rest", "rough"))) if kind.friction == "ice" else ()
    values |= coefficients(rng, kind.law, "friction.rest", scale)
    values |= parameters(rng, kind.law, False)
    for i in range(kind.arcs):
        single = kind.arcs == 1
        here = pick(rng, (1, 0.02), (5, scale))
        values |= coefficients(rng, kind.law, "friction.rough" if single else f"zones.{i}", here)
        path = "zone" if single else f"zones.{i}"
        half = pick(rng, (1, 0.0), (1, math.pi), (4, log(rng, -4, -1)), (20, rng.uniform(0.0, math.pi)))
        values[f"{path}.half_angle"] = half if single else min(half, pick(rng, (1, math.pi), (4, 0.8)))
        values[f"{path}.center"] = pick(rng, (1, 0.0), (1, math.pi), (8, rng.uniform(-math.pi, math.pi)))
    for path in values:
        if path.startswith("friction.") and path.split(".")[1] in ice:
            values[path] = 0.0
    values |= height(rng, kind.law, values)
    values |= driven(rng, kind.drive, False)
    values["time.span"] = rng.uniform(0.2, 3.0)
    phi = pick(rng, (6, 0.0), (3, rng.uniform(-0.8, 0.8)), (1, rng.uniform(-math.pi, math.pi)))
    omega = pick(rng, (5, 0.0), (3, rng.uniform(-30.0, 30.0)), (2, rng.uniform(-120.0, 120.0)))
    if kind.launch == "at rest" or (kind.launch == "mixed" and rng.random() < 0.15):
        phi, omega = rng.uniform(-1.0, 1.0) * pick(rng, (2, 1.5), (1, math.pi)), "ring"
    elif kind.launch == "any":
        phi = rng.uniform(-math.pi, math.pi)
    values["initial.phi"], values["initial.omega"] = phi, omega
    if kind.impact:
        values["impact.restitution"] = pick(rng, (1, 0.0), (1, 1.0), (8, rng.uniform(0.0, 0.95)))
        if two:
            # The centre of mass stays between the axis and the race, on either side of the line of the balls.
            half, reach = values["body.half_distance"], values["ring.radius"] - values["body.ball_radius"]
            line = math.sqrt(reach * reach - half * half)
            values["body.center_offset"] = pick(rng, (3, 0.0), (1, line * rng.uniform(-0.4, 0.4)))
    return values


def belt_scene(rng, kind):
    """A random scene of the belt by paths."""
    mass, stiffness, span = log(rng, -0.5, 0.5), log(rng, 0, 1.5), rng.uniform(2.0, 20.0)
    values = {"body.mass": mass, "spring.stiffness": stiffness}
    if kind.drive:
        values |= driven(rng, kind.drive, True)
        span = min(span, 3.0) if kind.drive == "table" else span
    else:
        values["belt.velocity"] = rng.choice([-1.0, 1.0]) * log(rng, -2, 0)
    values["time.span"] = span
    values |= coefficients(rng, kind.law, "friction", pick(rng, (4, 0.3), (1, 1.0)))
    values |= parameters(rng, kind.law, True, 9.81 * mass)
    values |= height(rng, kind.law, values)
    if kind.force:
        # Around resonance, over 300 periods; a stiffening spring makes some motions chaotic.
        frequency = math.sqrt(stiffness / mass) / (2.0 * math.pi) * log(rng, -0.5, 0.3)
        values["belt.velocity"] = pick(rng, (1, 0.0), (1, values["belt.velocity"]))
        values["spring.cubic"] = pick(rng, (1, 0.0), (1, stiffness * log(rng, -1, 1.5)))
        values["force.amplitude"] = values["friction.mu_k"] * 9.81 * mass * log(rng, -0.2, 1.0)
        values["force.frequency"], values["force.phase"] = frequency, rng.uniform(-math.pi, math.pi)
        values["time.span"] = span = 300.0 / frequency
    if kind.law in BRISTLES:
        values["time.span"] = min(span, 8.0)
    else:
        # Under Karnopp's law friction at the edge of the dead band must not exceed friction within it.
        most = math.inf
        if kind.law == "karnopp":
            drop = values["friction.mu_s"] - values["friction.mu_k"]
            most = 0.9 * drop * 9.81 * mass / values["friction.dead_band"]
        values["friction.viscous"] = min(most, pick(rng, (1, 0.0), (1, log(rng, -2, 0))))
    values["initial.x"] = pick(rng, (1, 0.0), (2, rng.uniform(-1.0, 1.0)))
    values["initial.velocity"] = pick(rng, (1, "ring"), (1, rng.uniform(-1.0, 1.0)))
    return values


def nest(kind, values):
    """Scene of a kind, from values by path."""
    scene = {"model": kind.model, "friction": {"law": kind.law}}
    if kind.law in FORMULAS:
        scene["friction"] = {"law": "formula", "mu": FORMULAS[kind.law], "at_rest": "mu_s"}
    if kind.model != "belt" or kind.drive:
        scene["drive"] = {"law": kind.drive}
        if kind.drive == "table":
            scene["drive"] |= {"time": TABLE_TIME.tolist(), "theta": TABLE_THETA.tolist()}
    for path, value in values.items():
        names = path.split(".")
        if names[0] == "zones":
            arcs = scene.setdefault("zones", [{} for _ in range(kind.arcs)])
            arcs[int(names[1])][names[2]] = value
            continue
        place = scene
        for name in names[:-1]:
            place = place.setdefault(name, {})
        place[names[-1]] = value
    return scene


#: Numbers that scenes of the family `far` push to the ends of their ranges: powers of ten, SI units.
FAR = {
    "friction.v0": (-12, 1),
    "friction.alpha": (0, 9),
    "friction.sigma0": (1, 12),
    "drive.frequency": (0, 5),
    "gravity": (-4, 5),
    "time.span": (-9, 4),
    "body.mass": (-6, 6),
}


def pushed(rng, values):
    """A scene with two numbers far from the usual; the span holds fifty periods of a fast drive or fall at most."""
    values["gravity"] = 9.81
    own = [path for path in FAR if path in values]
    for k in rng.choice(len(own), 2, replace=False):
        values[own[k]] = log(rng, *FAR[own[k]])
    if values.get("friction.sigma1"):
        values["friction.sigma1"] = math.sqrt(values["friction.sigma0"] * values["body.mass"])
    length = values["ring.radius"] if "ring.radius" in values else values["body.mass"] / values["spring.stiffness"]
    rate = max(math.sqrt(values["gravity"] / length), values.get("drive.frequency", 0.0))
    values["time.span"] = min(values["time.span"], max(50.0 / rate, 1.0) if rate < 50.0 else 50.0 / rate)
    return values


def draw(rng, kind):
    """A random scene of a kind by paths, rounded to six digits."""
    values = (belt_scene if kind.model == "belt" else ring_scene)(rng, kind)
    if kind.far:
        values = pushed(rng, values)
    values = {k: v if v == "ring" or abs(v) == math.pi or v == 0.5 * math.pi else float(f"{v:.6g}")
              for k, v in values.items()}  # fmt: skip
    for path, value in values.items():
        if value == "ring":
            # The body starts at the speed of the ring or belt.
            values[path] = 0.0
            values[path] = float(drive(problem(nest(kind, values)), 0.0)[1]) + 0.0
    return values


@dataclass
class Count:
    """Counts of one batch or of one family, and the scenes to be printed."""

    tally: Counter = field(default_factory=Counter)
    ends: Counter = field(default_factory=Counter)
    seconds: Counter = field(default_factory=Counter)
    listings: list = field(default_factory=list)
    #: Number of the batch in its family: of many small batches as many runs are asked about as of a large one.
    number: int = 0

    def add(self, other):
        """Add the counts of a batch."""
        self.tally.update(other.tally)
        self.ends.update(other.ends)
        self.seconds.update(other.seconds)

    def list_scene(self, word, scene, why, said):
        """Keep a scene with the answers of the reference and of the package."""
        listing = pprint.pformat(scene, width=120, sort_dicts=False)
        self.listings.append(f"\n# {word}; reference: {why}\n# ringsweep: {said}\n{listing}")


def answers(kind, batch, solver="auto"):
    """Dataset of the package for a batch of scenes of one kind."""
    axes = {path: xr.DataArray([values[path] for values in batch], dims="run") for path in batch[0]}
    return ringsweep.sweep(nest(kind, batch[0]), axes, solver=solver, jobs=1, progress=False)


def scales(scene):
    """Length scale of a belt scene, m: stick length, plus the path of the belt in a run shorter than 1 s."""
    p = problem(scene)
    return p.mu_s[0] / p.stiffness + abs(drive(p, p.span)[0] - drive(p, 0.0)[0]) * (p.span < 1.0)


def second_opinion(scene, regime, contact, t, verdict, count):
    """Ask the compliant body about the end of a certified run on two contacts."""
    word = regime if regime in ("separating", "jammed") else "held"
    if word == "held":
        count.tally["held"] += 1
        if (count.tally["held"] + count.number) % HELD_EVERY or not verdict.runs:
            return
        t = verdict.runs[0]["t_least"]
    begin = time.process_time()
    found = opinion(problem(scene), word, contact, t)
    count.seconds["compliant"] += time.process_time() - begin
    end = f"{word} {contact}" if word == "separating" else word
    count.ends[end, found.word] += 1
    if found.word == "contradicted":
        count.list_scene(f"{found.word} by the compliant body", scene, found.why, f"{end}, {t:.9g} s")


def aftermath_opinion(scene, word, verdict, count):
    """Ask the compliant body what follows a lost contact, in every few runs."""
    if word == "held" or verdict.state != "clear" or verdict.runs[0]["t_end"] < scene["time"]["span"]:
        return
    count.tally["lost"] += 1
    if (count.tally["lost"] + count.number) % LOST_EVERY:
        return
    begin = time.process_time()
    p, t = problem(scene), verdict.numbers["t_separation"]
    found, said = rattling.opinion(p, word, t), ""
    if found.word == "contradicted":
        log = go_on(scene, keep=MOST_EVENTS)[1]

        def rigid(until):
            return go_on(scene | {"time": {"span": float(until)}})[0]

        said = rattling.why_apart(p, t, rigid, log)
    count.seconds["compliant"] += time.process_time() - begin
    count.ends[f"lost, {word}", said or found.word] += 1
    if said == "contradicted":
        count.list_scene(f"{said} by the compliant body", scene, f"{found.why}; {verdict.why}", word)


def compare(kind, batch, data, count):
    """Add the runs of a batch to its count."""
    belt = kind.model == "belt"
    words = [] if belt else list(zip(*(ringsweep.words(data[n]).values for n in ("regime", "motion")), strict=True))
    for i, values in enumerate(batch):
        scene = nest(kind, values)
        begin = time.process_time()
        verdict = judge(scene)
        count.seconds["reference"] += time.process_time() - begin
        certified = int(data.certified[i]) == 1
        state, spread = verdict.state, verdict.spread
        if certified and kind.impact:
            aftermath_opinion(scene, str(ringsweep.words(data.aftermath[i]).values), verdict, count)
        elif certified and kind.model == "ring":
            contact, t_end = int(data.separating_contact[i]), float(data.t_end[i])
            second_opinion(scene, str(words[i][0]), contact, t_end, verdict, count)
        scale = scales(scene) if belt else 1.0
        if belt and state == "clear" and not spread["x_end"] < 1e-5 * scale:
            state = "ambiguous"
        count.tally["runs"] += 1
        count.tally[state] += 1
        count.tally["certified" if certified else "uncertified"] += 1
        if state != "clear" or not certified:
            continue
        if kind.force and not math.isfinite(float(data.x_end_error[i])):
            count.tally["no bound"] += 1
            continue
        count.tally["compared"] += 1
        errors = {n: abs(float(data[n][i]) - verdict.numbers[n]) for n in verdict.numbers if n in data}
        if belt:
            said = f"x_end {float(data.x_end[i]):.9g}"
            stated = float(data.x_end_error[i]) if "x_end_error" in data else 0.0
            if not errors["x_end"] < max(1e-3 * scale, stated):
                count.tally["contradicted"] += 1
                count.list_scene("contradicted", scene, verdict.why, said)
                continue
        else:
            kind_said = (str(words[i][0]), str(words[i][1]), int(data.separating_contact[i]))
            if kind.impact:
                kind_said = (*kind_said, str(ringsweep.words(data.aftermath[i]).values))
            said = f"{kind_said}, t_end {float(data.t_end[i]):.9g}, phi_end {float(data.phi_end[i]):.6g}"
            if kind_said != verdict.kind:
                count.tally["contradicted"] += 1
                count.list_scene("contradicted", scene, f"{verdict.kind}: {verdict.why}", said)
                continue
            stated = {n: float(data[f"{n}_error"][i]) if f"{n}_error" in data else 0.0 for n in ("phi_end", "t_end")}
            places = [n for n in stated if not errors[n] < max(1e-3, 1e3 * spread[n], stated[n])]
            if places:
                count.tally["off"] += 1
                why = f"{verdict.why}; phi_end {verdict.numbers['phi_end']:.9g}, t_end {verdict.numbers['t_end']:.9g}"
                count.list_scene("off", scene, why, said)


def run_batch(task):
    """Count of about `many` scenes of a kind; a task is kind, `many` and seed."""
    kind, many, seed = task
    rng, count = np.random.default_rng(seed), Count(number=seed[-1])
    # Long runs, or runs that cost the reference much.
    share = many * (0.1 if kind.force else 0.3 if kind.far else 1.0)
    batch = [draw(rng, kind) for _ in range(max(1, round(share)))]
    begin = time.process_time()
    data = answers(kind, batch)
    count.seconds["package"] += time.process_time() - begin
    compare(kind, batch, data, count)
    return count


HEADER = ["family", "runs", "certified", "compared", "contradicted", "off", "uncertified", "ambiguous", "unresolved"]


def row(name, count):
    """Row of the table for one family."""
    tally = count.tally
    share = f" ({100.0 * tally['uncertified'] / max(tally['runs'], 1):.1f} %)"
    return [name, *(str(tally[column]) + (share if column == "uncertified" else "") for column in HEADER[1:])]


OPINIONS = ("confirmed", "contradicted", "undecided", rattling.SHARED)
END_HEADER = ["end", "asked", *OPINIONS]


def end_rows(ends):
    """Rows of the table of opinions."""
    names = sorted({end for end, _ in ends})
    counts = [[ends[name, word] for word in OPINIONS] for name in names]
    return [[name, str(sum(row)), *map(str, row)] for name, row in zip(names, counts, strict=True)]


def main():
    parser = _common.command(__doc__)
    parser.add_argument("--count", type=int, help=f"scenes (default {COUNT}; {QUICK} with --quick)")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--families", nargs="+", metavar="NAME", help=", ".join(families()))
    parser.add_argument("--csv", type=Path, help="write the 500 scenes of the tests instead")
    parser.add_argument("--impacts", type=Path, help="write the scenes with impacts of the tests instead")
    arguments = parser.parse_args()
    if arguments.csv:
        write_csv(arguments.csv)
        return
    if arguments.impacts:
        write_impacts(arguments.impacts)
        return
    asked = arguments.families or (FEW if arguments.quick else families())
    chosen = {name: kinds[: 1 if arguments.quick else None] for name, kinds in families().items() if name in asked}
    heading = _common.machine()
    print(heading)
    counts, total = {name: Count() for name in chosen}, Count()
    many = (arguments.count or (QUICK if arguments.quick else COUNT)) / len(chosen)
    batches = [(name, k, kind) for name, kinds in chosen.items() for k, kind in enumerate(kinds)]
    tasks = [(kind, many / len(chosen[name]), [arguments.seed, *name.encode(), k]) for name, k, kind in batches]
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn")) as pool:
        for (name, k, _), count in zip(tqdm(batches, disable=None), pool.map(run_batch, tasks), strict=True):
            counts[name].add(count)
            total.add(count)
            for listing in count.listings:
                tqdm.write(listing)
            if k == len(chosen[name]) - 1:
                tqdm.write(" | ".join(row(name, counts[name])))
    rows = [row(name, count) for name, count in (counts | {"all": total} if len(counts) > 1 else counts).items()]
    title, ends = "Certified answers against an independent reference", "What a body on springs says of certified ends"
    said = _common.shown(title, HEADER, rows), _common.shown(ends, END_HEADER, end_rows(total.ends))
    cost = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in total.seconds.items())
    print(f"CPU of all cores: {cost} (compilation included), seed {arguments.seed}")
    if len(chosen) == 1 or not arguments.families:
        text = f"Seed {arguments.seed}; {cost}.\n\n{said[0]}\n## {ends}\n\n{said[1]}"
        name = "brute_force" if len(chosen) > 1 else f"brute_force_{next(iter(chosen)).replace(' ', '_')}"
        runs = f"{total.tally['runs']:,}".replace(",", " ")
        figures = {"runs": runs, "contradictions": str(total.tally["contradicted"])}
        _common.publish(arguments, name, title, heading, text, figures)


# The 500 scenes of the tests.
CSV_COUNT, CSV_SEED = 500, 181


def draw_csv(rng):
    """A random scene on the paper's rig: law of the drive, and values by path, rounded to six digits."""

    def pair(place):
        mu_k = rng.uniform(0.02, 0.4) * level
        mu_s = mu_k + rng.choice([0.0, rng.uniform(0.0, 0.4)], p=[0.1, 0.9]) * level
        return {f"friction.{place}.mu_s": mu_s, f"friction.{place}.mu_k": mu_k}

    # Some scenes almost without friction, so that the body revolves; some so rough that it can jam.
    level = rng.choice([0.1, 1.0, 3.0], p=[0.15, 0.8, 0.05])
    surfaces = pair("rough") | pair("rest")
    scene = {
        "drive.amplitude": rng.choice([-1, 1]) * 10.0 ** rng.uniform(-1, 1.3),
        "drive.exponent": rng.uniform(1.1, 3.0),
        "zone.center": rng.choice([0.0, rng.uniform(-math.pi, math.pi)]),
        "zone.half_angle": rng.choice([0.0, math.pi, rng.uniform(0, math.pi)], p=[0.04, 0.04, 0.92]),
        **surfaces,
        "friction.alpha": 10.0 ** rng.uniform(0, 7),
        "friction.v0": 10.0 ** rng.uniform(-9, 0),
        "initial.omega": rng.choice([0.0, rng.uniform(-30, 30), rng.uniform(-120, 120)], p=[0.5, 0.35, 0.15]),
        "time.span": rng.uniform(0.5, 3.0),
    }
    scene = {name: value if value == math.pi else float(f"{value:.6g}") for name, value in scene.items()}
    return str(rng.choice(["arctan", "power"])), scene


def write(path, rows):
    """Write rows, mappings with the same keys, to a file."""
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def write_csv(path):
    """Write the 500 scenes and the answers of the reference."""
    rng, rows = np.random.default_rng(CSV_SEED), []
    for _ in tqdm(range(CSV_COUNT), disable=None):
        law, values = draw_csv(rng)
        given = {name: value for name, value in values.items() if law == "power" or name != "drive.exponent"}
        scene = nest(Kind("ring", "bengisu-akay", law, 1), RIG | {"initial.phi": 0.0} | given)
        verdict = judge(scene)
        regime, motion, contact = verdict.kind or ("unresolved", "unresolved", 0)
        apart, held = regime == "separating", regime in ("resting", "oscillatory", "revolving")
        first = verdict.runs[0]
        word, t = ("held", first["t_least"]) if held else (regime, first["t_end"])
        rows.append({
            "drive": law, **values, "regime": regime, "motion": motion, "contact": contact,
            "t_separation": f"{verdict.numbers['t_separation']:.8g}" if apart else "",
            "normal_min": f"{min(first['least_1'], first['least_2']):.2g}" if held else "",
            "agrees": int(verdict.state == "clear"),
            "compliant": opinion(problem(scene), word, contact, t).word,
        })  # fmt: skip
    write(path, rows)


#: Scenes with impacts of the tests, which share one compiled kernel.
IMPACTS = Kind("ring", "stiction", "arctan", 1, impact=True)
IMPACTS_COUNT, IMPACTS_NUMBERS = 100, (
    "t_separation", "t_end", "phi_end", "omega_end", "open_time", "flight_time", "gap_max", "impact_speed_max",
    "impact_loss", "tumbles", "t_recovered",
)  # fmt: skip


def write_impacts(path):
    """Write scenes that lose a contact, of which the reference is sure, and its answers."""
    rng, rows = np.random.default_rng(CSV_SEED), []
    while len(rows) < IMPACTS_COUNT:
        values = draw(rng, IMPACTS)
        verdict = judge(nest(IMPACTS, values))
        numbers = {name: verdict.numbers.get(name) for name in IMPACTS_NUMBERS}
        # Where the row of impacts magnifies rounding, nothing can be compared.
        if verdict.state != "clear" or verdict.kind[0] != "separating" or not verdict.spread["omega_end"] < 1e-6:
            continue
        regime, _, contact, word = verdict.kind
        numbers = {name: f"{value:.9g}" for name, value in numbers.items()}
        rows.append(values | {"regime": regime, "contact": contact, "aftermath": word} | numbers)
    write(path, rows)


if __name__ == "__main__":
    main()
