"""The cost of each thing in a scene: from the simplest scene to the fullest, each row of the table adds one thing.

    python -m benchmarks.scenes            # about ten minutes, most of it compilation
    python -m benchmarks.scenes --quick    # fewer cells and rounds

Each row is measured under `rk4`, and under `event` or `implicit`, whichever handles its law, on one core, compiled
before, without certificates. All rows run in turn within each round. A ratio is the median of the ratios within the
rounds. Compilation is measured in CPU seconds, which do not grow with other load on the
machine, in a new process for each kernel.

Writes `scenes.md`.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import radians
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba.core import event

from benchmarks._common import (
    PAPER_STEPS,
    SPAN,
    Times,
    alternate,
    bare,
    command,
    configure,
    machine,
    one_core,
    publish,
    shown,
)
from ringsweep.physics.friction import LAWS, SetValued, coefficients_of, family_of
from ringsweep.solvers import automaton, rk4

ROOT = Path(__file__).parent.parent

#: Functions of the C library that a kernel may call.
CALLS = ("exp", "atan", "log1p", "log", "pow", "sin", "cos")

#: Modules of things that most scenes lack, under ``ringsweep.``
OPTIONAL = {
    "impact": ("models.ring.impact", "physics.impact"),
    "exponent": ("models.tangent", "solvers.variation"),
    "section": ("models.section",),
    "bristles": ("models.belt.bristles", "models.ring.bristles", "physics.friction.bristles"),
}


#: Names under which times are stored: `rk4`, and `event` or `implicit`, whichever handles the law.
METHODS = ("rk4", "piecewise")


# ---- scenes --------------------------------------------------------------------------------


class Rung(NamedTuple):
    """A scene, the name of the scene that it is compared with, and the swept path with its limits."""

    scene: dict[str, Any]
    before: str | None
    swept: str = "initial.phi"
    between: tuple[float, float] = (0.05, 0.3)
    record: Mapping[str, Any] | None = None

    @property
    def methods(self) -> list[str]:
        """Names of METHODS: `rk4` goes on after no impact, and locates no events."""
        return [name for name in METHODS if name != "rk4" or not (self.record or "impact" in self.scene)]

    @property
    def piecewise(self) -> str:
        """`event` or `implicit`, whichever handles the law."""
        friction = self.scene["friction"]
        return "event" if "at_rest" in friction or family_of(LAWS[friction["law"]]) is SetValued else "implicit"

    def configuration(self, method: str, cells: int, **options: Any) -> Any:
        """Configuration of a sweep over `cells` cells."""
        if method == "rk4":
            options.setdefault("steps", PAPER_STEPS)
        values = np.linspace(*self.between, cells).tolist()
        return configure(self.scene, {self.swept: values}, method, record=self.record, **options)


def on_ring(law: str = "coulomb", *, contacts: int = 2, drive: Any = None, arcs: int = 0, rough: Any = None) -> Any:
    """Scene of a ring; `rough` holds the friction coefficients of its zones."""
    pair = {"mu_s": 0.2, "mu_k": 0.1}
    rough = rough or {"mu_s": 0.3, "mu_k": 0.15}
    if "mu_s" not in coefficients_of(LAWS[law]):
        pair, rough = {"mu_k": pair["mu_k"]}, {"mu_k": rough["mu_k"]}
    more = {"tustin": {"alpha": 100.0}, "bengisu-akay": {"alpha": 100.0, "v0": 0.2}}.get(law, {})
    body = {"mass": 0.076}
    if contacts == 2:
        body |= {"inertia": 4.47e-5, "half_distance": 0.025, "ball_radius": 0.01}
    scene: dict[str, Any] = {
        "model": "ring" if contacts == 2 else "ring-single-contact",
        "body": body,
        "ring": {"radius": 0.043378},
        "friction": {"law": law, "rest": pair, **more},
        "drive": drive or {"law": "none"},
        "initial": {"omega": 5.0},
        "time": {"span": SPAN},
    }
    if arcs:
        places = [(k - 1) * radians(60.0) for k in range(arcs)] if arcs > 1 else [0.0]
        scene["zones"] = [{"center": place, "half_angle": radians(15.0), **rough} for place in places]
    return scene


def on_belt(law: str) -> Any:
    """Scene of a mass on a belt."""
    pair = {"mu_k": 0.1} if "mu_s" not in coefficients_of(LAWS[law]) else {"mu_s": 0.15, "mu_k": 0.1}
    more = {"sigma0": 1e3, "sigma1": 30.0, "sigma2": 0.1, "v_s": 1e-2} if law == "lugre" else {}
    return {
        "model": "belt",
        "body": {"mass": 1.0},
        "spring": {"stiffness": 2.0},
        "friction": {"law": law, **pair, **more},
        "time": {"span": SPAN},
    }


_REST = {"mu_s": 0.2, "mu_k": 0.1}
_CONSTANT, _ARCTAN = {"law": "constant", "amplitude": 2.0}, {"law": "arctan", "amplitude": 2.0}
_BELT = ("belt.velocity", (0.05, 0.2))
#: The arctan drive and the friction law `tustin`, as a user writes them.
_WRITTEN = {"law": "formula", "theta": "A*(t*atan(t/tau) - tau*log(1 + (t/tau)**2)/2)*2/pi", "A": 2.0, "tau": 1.0}
_LAW = {"law": "formula", "mu": "mu_k + (mu_s - mu_k)*exp(-alpha*v)", "at_rest": "mu_s", "alpha": 100.0}

LADDER: dict[str, Rung] = {
    "one contact, Coulomb, immobile uniform ring": Rung(on_ring(contacts=1), None),
    "+ second contact": Rung(on_ring(), "one contact, Coulomb, immobile uniform ring"),
    "+ constant drive": Rung(on_ring(drive=_CONSTANT), "+ second contact"),
    "+ arctan drive in its place": Rung(on_ring(drive=_ARCTAN), "+ constant drive"),
    "+ a zone": Rung(on_ring(drive=_ARCTAN, arcs=1), "+ arctan drive in its place"),
    "+ two more zones": Rung(on_ring(drive=_ARCTAN, arcs=3), "+ a zone"),
    "+ stiction": Rung(on_ring("stiction", drive=_ARCTAN, arcs=3), "+ two more zones"),
    "+ exponential tail (tustin)": Rung(on_ring("tustin", drive=_ARCTAN, arcs=3), "+ stiction"),
    "+ stiction band (bengisu-akay)": Rung(
        on_ring("bengisu-akay", drive=_ARCTAN, arcs=3), "+ exponential tail (tustin)"
    ),
    "tustin as a formula": Rung(
        on_ring("tustin", drive=_ARCTAN, arcs=3) | {"friction": _LAW | {"rest": _REST}}, "+ exponential tail (tustin)"
    ),
    "drive as a formula": Rung(on_ring("stiction", drive=_WRITTEN, arcs=3), "+ stiction"),
    "+ impact": Rung(on_ring("stiction", drive=_ARCTAN, arcs=3) | {"impact": {"restitution": 0.5}}, "+ stiction"),
    "belt, Coulomb": Rung(on_belt("coulomb"), None, *_BELT),
    "belt + stiction": Rung(on_belt("stiction"), "belt, Coulomb", *_BELT),
    "belt + section": Rung(on_belt("stiction"), "belt + stiction", *_BELT, {"section": {"at": "turn", "keep": 64}}),
    "belt + exponent": Rung(on_belt("stiction"), "belt + stiction", *_BELT, {"exponent": True}),
    "belt + bristles (lugre)": Rung(on_belt("lugre"), "belt + stiction", *_BELT),
}

# ---- measurements in a new process; each returns what JSON can hold ------------------------


def compile_one(name: str, method: str) -> dict[str, Any]:
    """CPU seconds to compile one kernel that is not in the cache, and facts about its code."""
    rung = LADDER[name]
    run = bare(rung.configuration(method, 2, **({"steps": 4} if method == "rk4" else {})))
    begin = time.process_time(), time.perf_counter()
    with event.install_recorder("numba:compile") as compiled:
        run()
    took = time.process_time() - begin[0], time.perf_counter() - begin[1]
    rk4_kernels = (rk4._tabulate, rk4._start, rk4._advance_block)
    kernels = rk4_kernels if method == "rk4" else (automaton._integrate,)
    found = {"cpu": took[0], "wall": took[1]}
    if any(kernel.stats.cache_hits for kernel in kernels[-2:]):
        # Another scene has the same types, and a kernel loaded from the cache has no assembly text.
        return found | {"instructions": "the same", "calls": ["the same"], "optional": {}}
    functions = {one.data["dispatcher"].py_func for _, one in compiled.buffer}
    return (
        found
        | {"optional": optional_in(functions)}
        | code_of("".join(kernel.inspect_asm(kernel.signatures[-1]) for kernel in kernels))
    )


def optional_in(functions: Iterable[Any]) -> dict[str, int]:
    """Number of functions that belong to each optional thing."""
    found = dict.fromkeys(OPTIONAL, 0)
    for one in functions:
        for thing, modules in OPTIONAL.items():
            found[thing] += any(f"{one.__module__}.".startswith(f"ringsweep.{name}.") for name in modules)
    return found


def codes(names: Sequence[str], method: str) -> dict[str, Any]:
    """Facts about the code of the kernels of several scenes, compiled in turn."""
    return {name: compile_one(name, method) for name in names}


def code_of(assembly: str) -> dict[str, Any]:
    """Number of instructions in an assembly text, and the functions of the C library that they call."""
    instructions = re.findall(r"^\t[a-z].*", assembly, re.MULTILINE)
    # A function may be called by its name, or through its address: "movabsq $exp, %rax".
    named = {name for line in instructions for name in re.findall(r"[\s$](\w+)", line)}
    return {"instructions": len(instructions), "calls": [name for name in CALLS if name in named]}


def step_times(cells: int, few: int, rounds: int) -> dict[str, Any]:
    """Seconds of every scene under both methods in each round, and numbers of steps and runs."""
    found: dict[str, Any] = {}
    with one_core():
        for own in (False, True):
            calls = {
                name: bare(rung.configuration(rung.piecewise if own else "rk4", few if own else cells))
                for name, rung in LADDER.items()
                if METHODS[own] in rung.methods
            }
            for call in calls.values():
                call()
            times, results = alternate(calls, rounds)
            for name in calls:
                found[f"{name}, {METHODS[own]}"] = {
                    "wall": times[name].wall,
                    "steps": float(results[name].steps.sum()),
                    "runs": len(results[name].steps),
                }
    return found


# ---- processes -----------------------------------------------------------------------------


def in_child(function: Callable[..., Any], *args: Any, cache: Path) -> Any:
    """Call a function of this module in a new process, with a folder for compiled code."""
    code = f"import json; from benchmarks import scenes; print(json.dumps(scenes.{function.__name__}(*{args!r})))"
    done = subprocess.run([sys.executable, "-c", code], env=environment(cache), stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def environment(cache: Path) -> dict[str, str]:
    """Environment of a process that finds the package and keeps compiled code in a folder."""
    found = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    return {**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": found}


def size_of(folder: Path) -> int:
    """Bytes of the files in a folder."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


# ---- the command ---------------------------------------------------------------------------


HEADER = [
    "scene", "compared with", "", "rk4, ns per step", "x", "us per run", "steps per run", "us per run, x",
    "ns per step, x", "compile rk4, CPU s", "other", "cache rk4, KiB", "other", "instructions rk4", "other",
    "calls of rk4", "other",
]  # fmt: skip


def ladder(found: Mapping[str, Any], compiled: Mapping[tuple[str, str], Any]) -> list[list[str]]:
    """Rows of the table of scenes."""
    lines = []
    for name, rung in LADDER.items():

        def ratio(method: str, per: str, name: str = name, rung: Rung = rung) -> str:
            return (
                f"{over(found, name, rung.before, method, per):.2f}" if rung.before and method in rung.methods else "-"
            )

        times, own = (found.get(f"{name}, {method}") for method in METHODS)
        both = [compiled.get((name, method)) for method in ("rk4", rung.piecewise)]
        lines.append([
            name, rung.before or "-", rung.piecewise,
            f"{1e9 * Times(times['wall']).median / times['steps']:.1f}" if times else "-", ratio("rk4", "steps"),
            f"{1e6 * Times(own['wall']).median / own['runs']:.1f}", f"{own['steps'] / own['runs']:.0f}",
            ratio("piecewise", "runs"), ratio("piecewise", "steps"),
            *(f"{one['cpu']:.1f}" if one else "-" for one in both),
            *(f"{one['cache'] / 1024:.0f}" if one else "-" for one in both),
            *(str(one["instructions"]) if one else "-" for one in both),
            *(" ".join(one["calls"]) or "none" if one else "-" for one in both),
        ])  # fmt: skip
    return lines


def over(found: Mapping[str, Any], name: str, other: str, method: str, per: str = "runs") -> float:
    """Time of a scene over the time of another scene, for each run or for each step."""
    one, two = found[f"{name}, {method}"], found[f"{other}, {method}"]
    return Times(one["wall"]).ratio(Times(two["wall"])) * two[per] / one[per]


def main() -> None:
    """Measure, print, write."""
    given = command(__doc__).parse_args()
    cells, few, rounds = (64, 16, 3) if given.quick else (512, 128, 5)
    where = machine()
    print(where)

    compiled: dict[tuple[str, str], Any] = {}
    sections: list[tuple[str, Sequence[str], list[list[str]]]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shared = folder / "shared"
        shared.mkdir()
        for rung_name, rung in LADDER.items():
            for method in ("rk4", rung.piecewise)[2 - len(rung.methods) :]:
                # One cache for all scenes: code that a scene shares with an earlier scene is not compiled again.
                before = size_of(shared)
                one = in_child(compile_one, rung_name, method, cache=shared)
                compiled[rung_name, method] = one | {"cache": size_of(shared) - before}
                print(f"{rung_name}, {method}: compiled in {one['cpu']:.1f} s ({one['wall']:.1f} s)", flush=True)

        found = in_child(step_times, cells, few, rounds, cache=shared)
        sections.append(("From the simplest scene to the fullest", HEADER, ladder(found, compiled)))
        parts = [[name, method, *(str(one["optional"][thing]) for thing in OPTIONAL)]
                 for (name, method), one in compiled.items() if one["optional"]]  # fmt: skip
        sections.append((LEFT_OUT, ["scene", "method", *OPTIONAL], parts))
    report = ABOUT
    for title, header, rows in sections:
        report += f"\n## {title}\n\n{shown(title, header, rows)}"
    publish(given, "scenes", "The cost of each thing in a scene", where, report)


LEFT_OUT = "Functions of optional things in a kernel"

#: Explanation at the head of the report.
ABOUT = f"""
One core, compiled before, no certificates, T = {SPAN:g} s, {PAPER_STEPS} steps of `rk4`. x is the ratio to the scene
that a row is compared with. An addition may also change the motion: if the number of steps changes, the ratio per step
gives the cost of the addition itself. Instructions are those of the whole kernel, with its set-up and its ends. Calls
are calls of the C library; they make the table of the drive, once for all cells of a task. The kernel has no code for
what a scene lacks: the last columns, and the table of optional things, which counts the compiled functions of each.
Uncertain parameters (`sweep.sample`) take the kernels of the plain sweep. `tests/test_scenes.py` checks this.
"""


if __name__ == "__main__":
    main()
