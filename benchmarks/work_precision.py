"""Error against run time on five scenes: `rk4`, `event`, `implicit`, and other libraries (peers).

    python -m benchmarks.work_precision                  all, about ten minutes
    python -m benchmarks.work_precision --quick          fewer cells and settings, under two minutes
    python -m benchmarks.work_precision --scene stiff    one scene (smooth, stiff, limit, lugre, impact); repeatable
    python -m benchmarks.work_precision --redraw         only the pictures, from the stored numbers

Scenes: a seeded sample of the Fig. 29 family (two-contact ring, T = 10 s) under Bengisu and Akay's law, smooth (alpha
100, v0 0.2) and stiff (alpha 1e5, v0 2e-6), and under its limit, stiction; the belt under LuGre's law; and the ring
under Coulomb's law, on after lost contacts, beside Moreau and Jean's time stepping. Peers share no formula with the
package. If a peer is not installed, the benchmark says so and skips it (`pip install '.[bench]'`). All contenders are
compiled before, pinned to one core, and run in turn within each round, forwards and backwards. Times are medians over
the rounds. There are no certificates, because peers have none.

Writes `work_precision.{md,nc}` and a picture of each scene, `work_precision_smooth.png` for example.
"""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from benchmarks._common import (
    REST,
    ROUGH,
    command,
    configure,
    family,
    folder_of,
    heading,
    machine,
    markdown,
    on_one_core,
    one_core,
    publish,
    ring,
    table,
)
from benchmarks.peers import in_c
from benchmarks.peers.physics import Law
from ringsweep import plots
from ringsweep.report.precision import table as rows_of
from ringsweep.runs.contenders import Answer, Contender, compete, fastest

SEED, SIDE = 181, 64

#: Largest error at the end (rad, m) and of the separation (s) at which the documents compare methods.
TARGET = 1e-6

#: Runs that `rk4` computes side by side at most.
LANES = 32

#: Width of a picture, inches: that of a page.
WIDTH = 6.69

_BELT = {
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
    "time": {"span": 30.0},
}


@dataclass(frozen=True)
class Scene:
    """One of the five scenes."""

    title: str
    scene: dict[str, Any]
    method: str
    """The method of the package, besides `rk4`, that handles the law."""
    law: Law | None
    """Law for the peers; None on the belt."""

    @property
    def place(self) -> str:
        """Name of the coordinate whose error at the end counts."""
        return "x" if self.law is None else "phi"

    def cells(self, count: int) -> list[Any]:
        """A sample of cells. Every call gives the same cells, and a longer sample starts with the shorter one."""
        if self.law is None:
            # From the slowest and the fastest inwards.
            return np.geomspace(0.05, 0.4, 8)[[0, 7, 3, 5, 1, 6, 2, 4]][:count].tolist()
        everything = family(SIDE)
        order = np.random.default_rng(SEED).permutation(len(everything))
        return [everything[k] for k in order[:count]]

    def configuration(self, cells: Sequence[Any], method: str, **options: Any) -> Any:
        """Configuration of a run of the package over cells."""
        if self.law is None:
            return configure(self.scene, {"belt.velocity": list(cells)}, method, **options)
        amplitudes, half_angles = (list(column) for column in zip(*cells, strict=True))
        points = {"drive.amplitude": amplitudes, "zone.half_angle": half_angles}
        return configure(self.scene, points, method, **options)


_BENGISU_AKAY = {"law": "bengisu-akay"}
_COULOMB = {"law": "coulomb", "rough": {"mu_k": ROUGH["mu_s"]}, "rest": {"mu_k": REST["mu_s"]}}
RESTITUTION = 0.5
SCENES = {
    "smooth": Scene(
        "Smooth: alpha = 100 s/m, v0 = 0.2 m/s",
        ring(_BENGISU_AKAY | {"alpha": 100.0, "v0": 0.2}),
        "implicit",
        Law(100.0, 0.2),
    ),
    "stiff": Scene(
        "Stiff: alpha = 1e5 s/m, v0 = 2e-6 m/s",
        ring(_BENGISU_AKAY | {"alpha": 1e5, "v0": 2e-6}),
        "implicit",
        Law(1e5, 2e-6),
    ),
    "limit": Scene("Limit law: stiction", ring({"law": "stiction"}), "event", Law(0.0, 0.0)),
    "lugre": Scene("LuGre on the belt", _BELT, "implicit", None),
    "impact": Scene(
        f"With impacts: Coulomb, restitution {RESTITUTION}",
        ring(_COULOMB) | {"friction": _COULOMB, "impact": {"restitution": RESTITUTION}},
        "event",
        Law(0.0, 0.0),
    ),
}


@dataclass(frozen=True)
class Effort:
    """Amount of measurement."""

    cells: int
    few: int
    """Cells of slow contenders."""
    fewest: int
    """Cells of the slowest."""
    rounds: int
    finest: int
    """Decades of steps of `rk4` above the coarsest setting."""
    every: int
    """Every how many of the tolerances is measured."""


FULL = Effort(cells=32, few=8, fewest=4, rounds=3, finest=5, every=1)
QUICK = Effort(cells=4, few=2, fewest=1, rounds=2, finest=3, every=2)


# ---- contenders ----------------------------------------------------------------------------


def own(scene: Scene, method: str, cells: Sequence[Any], **options: Any) -> Callable[[], Answer]:
    """Function that runs a method of the package on cells."""
    call = on_one_core(scene.configuration(cells, method, **options))
    nowhere = np.full(len(cells), np.nan)

    def answer() -> Answer:
        found = call()
        return Answer(found[f"{scene.place}_end"], found.get("t_separation", nowhere), found["regime"][:, np.newaxis])

    return answer


def contenders(scene: Scene, effort: Effort) -> tuple[list[Contender], list[str]]:
    """Contenders of a scene, and notes on those that are left out."""
    entered: list[Contender] = []
    skipped: list[str] = []
    belt = scene.law is None
    everything, few, fewest = (len(scene.cells(n)) for n in (effort.cells, effort.few, effort.fewest))

    def enter(method: str, setting: str, make: Any, cells: int, lanes: int | None = None) -> None:
        """Enter a contender; `make` compiles, and returns a function that runs the cells that it gets."""
        entered.append(Contender(method, setting, make(scene.cells(cells)), lanes or cells))

    def peer(module: str, label: str, tolerances: Sequence[float], cells: int, *given: Any) -> None:
        try:
            loaded = import_module(f"benchmarks.peers.with_{module}")
        except ImportError as missing:
            skipped.append(f"{label}: {missing}")
            return
        for rtol in tolerances[:: effort.every]:
            lanes = loaded.lanes_of(given[0], cells) if module == "diffrax" else None
            enter(label, f"rtol {rtol:.0e}", partial(of_peer, loaded, scene, *given, rtol), cells, lanes)

    tolerances = {
        "event": [1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13],
        "implicit": [1e-3, 1e-4, 1e-5, 3e-6, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10],
    }
    for rtol in tolerances[scene.method]:
        enter(scene.method, f"rtol {rtol:.0e}", partial(own_of, scene, scene.method, rtol=rtol), everything)
    if scene is SCENES["impact"]:
        counts = {2_000: everything, 20_000: everything, 200_000: few, 2_000_000: fewest}
        for steps, count in list(counts.items())[: effort.finest - 1] if in_c.compiler() else ():
            enter("C, Moreau-Jean", f"{steps:.0e} steps", partial(moreau_jean, steps), count)
        skipped.append("rk4 and the other peers: they end where a contact is lost")
        return entered, skipped
    # The decades in which `rk4` goes from useless to its best accuracy, which differ between scenes.
    coarsest = 1e3 if scene is SCENES["stiff"] else 1e4 if belt else 1e2
    for steps in [round(coarsest * 10**k) for k in range(effort.finest + 1)]:
        if belt and steps > 10**7:
            break
        count = everything if steps <= 10**6 else fewest
        # Full vector registers, as in a map: lanes that are left repeat the cells.
        enter("rk4", f"{steps:.0e} steps", partial(repeated, scene, steps), everything, max(everything, LANES))
        if scene.law is not None and scene.law.v0 > 0.0 and steps <= 10**7 and in_c.compiler():
            enter("C, rk4", f"{steps:.0e} steps", lambda c, n=steps: in_c.ring(scene.law, c, n), count)
    if not in_c.compiler():
        skipped.append("C: no compiler (cc) is installed")

    loose, tight = [1e-4, 1e-6, 1e-8], [1e-6, 1e-8, 1e-10]
    stiff = scene is SCENES["stiff"] or belt
    if stiff:
        skipped.append("SciPy DOP853, diffrax Tsit5: these methods are explicit, and the scene is stiff")
    else:
        peer("scipy", "SciPy DOP853", tight, few, "DOP853")
    peer("scipy", "SciPy LSODA", tight, few, "LSODA")
    peer("scipy", "SciPy Radau", loose[:2] if belt else loose, fewest, "Radau")
    if scene is SCENES["limit"]:
        skipped.append("numbalsoda, diffrax: they cannot switch between modes, which a set-valued law requires")
    else:
        peer("numbalsoda", "numbalsoda LSODA", [1e-6, 1e-8, 1e-9, 1e-10], everything)
        method, cells = ("Kvaerno5", few) if stiff else ("Tsit5", everything)
        peer("diffrax", f"diffrax {method}", loose[: 2 if scene is SCENES["stiff"] else 3], cells, method)
    if scene is SCENES["stiff"]:
        skipped.append("heyoka: its Taylor method is explicit, and a creeping contact would take millions of steps")
    else:
        # On the belt heyoka has an error of 1e-6 m at tolerances of 1e-14 and below, and is right at 1e-13.
        tightest = 1e-13 if belt else 1e-15
        peer("heyoka", "heyoka", [1e-3, 1e-6, 1e-9, 1e-12, tightest], few if belt else everything)
    return entered, skipped


def moreau_jean(steps: int, cells: Sequence[Any]) -> Callable[[], Any]:
    """Function that runs Moreau and Jean's time stepping on cells."""
    return in_c.moreau_jean(RESTITUTION, cells, steps)


def own_of(scene: Scene, method: str, cells: Sequence[Any], **options: Any) -> Callable[[], Answer]:
    """As :func:`own`, compiled before."""
    call = own(scene, method, cells, **options)
    # Compiled code depends on types alone, so a short run is enough to compile.
    own(scene, method, cells[:1], **({"steps": 100} if method == "rk4" else options))()
    return call


def repeated(scene: Scene, steps: int, cells: Sequence[Any]) -> Callable[[], Answer]:
    """Function that runs `rk4` on cells, repeated until the lanes are full."""
    times = -(-LANES // len(cells))
    call = own_of(scene, "rk4", list(cells) * times, steps=steps)

    return lambda: Answer(*(column[: len(cells)] for column in call()[:3]))


def of_peer(peer: Any, scene: Scene, *given: Any) -> Callable[[], Any]:
    """Function that runs a peer, compiled before; the last of `given` are the cells."""
    *options, cells = given

    def prepare(chosen: Sequence[Any]) -> Callable[[], Any]:
        return peer.belt(chosen, *options) if scene.law is None else peer.ring(scene.law, chosen, *options)

    if peer.LAZY:
        prepare(cells[:1])()
    return prepare(cells)


# ---- a scene -------------------------------------------------------------------------------


def reference(scene: Scene, cells: Sequence[Any], effort: Effort) -> tuple[Answer, str]:
    """The package's run at the tightest tolerance, and its difference from the tightest run of a peer."""
    rtol = {"event": 1e-15, "implicit": 1e-12}[scene.method]
    found = own(scene, scene.method, cells, rtol=rtol)()
    words = f"Reference: `{scene.method}` at rtol {rtol:.0e}"
    if scene is SCENES["impact"]:
        return found, words + "."
    stiff = scene is SCENES["stiff"]
    count, name, *given = (
        (effort.few, "scipy", "Radau", 1e-10)
        if stiff
        else (len(cells), "heyoka", 1e-13 if scene.law is None else 1e-15)
    )
    try:
        peer = import_module(f"benchmarks.peers.with_{name}")
    except ImportError:
        return found, f"{words}; no peer is installed to check it."
    chosen = cells[:count]
    theirs = of_peer(peer, scene, *given, chosen)()
    by = abs(theirs.end - found.end[:count])
    words += (
        f". {'SciPy Radau' if stiff else 'heyoka'} at {given[-1]:.0e} agrees with it in {len(chosen)} cells to "
        f"{np.median(by):.0e} {'m' if scene.law is None else 'rad'} in the median, {by.max():.0e} at most"
    )
    if scene.law is not None:
        apart = abs(theirs.separation - found.separation[:count])
        differ = int((np.isfinite(theirs.separation) != np.isfinite(found.separation[:count])).sum())
        words += f", on the time of separation to {np.nanmax(apart):.0e} s, and on the regime in all but {differ}"
    return found, words + "."


def measure(scene: Scene, effort: Effort) -> tuple[xr.Dataset, list[str]]:
    """Times and errors of every contender of a scene, and notes on the reference and on absent peers."""
    exact, agreement = reference(scene, scene.cells(effort.cells), effort)
    entered, skipped = contenders(scene, effort)
    data = compete(entered, exact, f"{scene.place}_end", effort.rounds).assign_attrs(title=scene.title)
    return data, [agreement, *(f"Left out: {words}." for words in skipped)]


# ---- what is shown -------------------------------------------------------------------------


def draw(data: xr.Dataset, methods: list[str]) -> Figure:
    """Figure of a scene: the error at the end, and that of the separation if there is one.

    Parameters
    ----------
    data : xarray.Dataset
        Numbers of one scene.
    methods : list of str
        Methods of all scenes, so that a colour stands for the same method in all figures.
    """
    solvers = [f"{method}, {setting}" for method, setting in zip(data.method.values, data.setting.values, strict=True)]
    data = data.assign_coords(solver=("contender", solvers)).assign_attrs(methods=methods, target=TARGET)
    if (best := fastest(data, TARGET, "event", "implicit")) is not None:
        data.attrs["recommended"] = solvers[best]
    errors = [name for name in ("error_end", "error_separation") if data[name].notnull().any()]
    figure = Figure(figsize=(WIDTH, 5.0), layout="constrained")
    axes = figure.subplots(1, len(errors), squeeze=False).ravel()
    handles: dict[str, Any] = {}
    for panel, error in zip(axes, errors, strict=True):
        legend = plots.precision_panel(data, error, panel).get_legend()
        handles |= dict(zip((text.get_text() for text in legend.get_texts()), legend.legend_handles, strict=True))
        legend.remove()
        panel.set_title("", loc="left")
    style: dict[str, Any] = {"fontsize": "small", "frameon": False, "handlelength": 3}
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=3, **style)
    what = f"points: median of {data.sizes['cell']} cells, or of the fewer of a slow peer; bars: up to the largest"
    figure.suptitle(f"{data.attrs['title']}\n{what}", fontsize="medium")
    return figure


def draw_all(scenes: dict[str, xr.Dataset], folder: Path) -> None:
    """Write a picture of each scene."""
    methods = list(dict.fromkeys(str(name) for data in scenes.values() for name in data.method.values))
    for name, data in scenes.items():
        draw(data, methods).savefig(folder / f"work_precision_{name}.png", dpi=150, metadata={"Software": None})


def at_target(measured: Mapping[str, xr.Dataset]) -> str:
    """Table of the documents: the fastest setting of each method, in each scene, that errs by `TARGET` at most."""
    methods = dict.fromkeys(["event", "implicit", *(name for data in measured.values() for name in data.method.values)])
    rows = []
    for method in methods:
        row = [f"`{method}`" if method in ("event", "implicit", "rk4") else method]
        for name, data in measured.items():
            ours, best = (fastest(data, TARGET, one) for one in (SCENES[name].method, method))
            if ours is None or best is None:
                row.append("too inexact" if method in data.method.values else "-")
                continue
            seconds = data.time_per_run.values
            times = "" if best == ours else f", {number(seconds[best] / seconds[ours])} x"
            row.append(f"{1e3 * seconds[best]:.3g} ms{times} ({data.setting.values[best]})")
        rows.append(row)
    return markdown(["", *(SCENES[name].title for name in measured)], rows)


def number(value: float) -> str:
    """Two digits of a number, without an exponent."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


#: Explanation at the head of the report.
ABOUT = """
One core, compiled before, no certificates; medians over rounds in which contenders alternate. The table has the errors
of φ(T), or of x(T) on the belt, and of the time of separation. The regime of a peer only says whether the body
separates. The time of diffrax is the time of one lane of a full solve.
"""

AT_TARGET = """
## What an error of at most 1e-6 costs

Of each method the fastest setting that reaches it in every cell (rad; m on the belt), the time of a run, and how many
times longer this is than ours. Certificates, about as much again, are left out.
"""

# ---- the command ---------------------------------------------------------------------------


def main() -> None:
    """Measure, print, write."""
    parser = command(__doc__)
    parser.add_argument("--scene", action="append", choices=SCENES, help="only this scene; repeatable")
    parser.add_argument("--redraw", action="store_true", help="only draw the stored numbers again")
    given = parser.parse_args()
    folder = folder_of(given)
    if given.redraw:
        stored = folder / "work_precision.nc"
        draw_all({name: xr.load_dataset(stored, group=name) for name in SCENES}, folder)
        return
    effort = QUICK if given.quick else FULL
    # XLA reads this when JAX is imported, which happens when a scene asks for diffrax.
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    # LSODA warns if a tolerance is loose; the table shows the resulting error.
    warnings.filterwarnings("ignore", message="lsoda", category=UserWarning)
    begin = time.perf_counter()

    where = machine(("numbalsoda", "diffrax", "jax", "heyoka", "xarray")) + f"\n{in_c.compiler() or 'no C compiler'}"
    print(where)
    report = ABOUT
    measured: dict[str, xr.Dataset] = {}
    with one_core():
        for name in given.scene or SCENES:
            data, words = measure(SCENES[name], effort)
            measured[name] = data.assign_attrs(machine=where)
            heading(SCENES[name].title)
            print("\n".join(words))
            header, *rows = rows_of(data)
            table(header, rows)
            print(f"({time.perf_counter() - begin:.0f} s so far)")
            report += f"\n## {SCENES[name].title}\n\n![error against run time](work_precision_{name}.png)\n\n"
            report += "".join(f"- {line}\n" for line in words) + "\n" + markdown(header, rows)
    for k, (name, data) in enumerate(measured.items()):
        data.to_netcdf(folder / "work_precision.nc", group=name, mode="a" if k else "w")
    draw_all(measured, folder)
    if not given.scene:
        report = report.replace(ABOUT, f"{ABOUT}\n{AT_TARGET}\n{at_target(measured)}", 1)
        publish(given, "work_precision", "Error against run time", where, report)


if __name__ == "__main__":
    main()
