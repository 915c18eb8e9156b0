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
the rounds, ratios are medians of the ratios within the rounds. There are no certificates, because peers have none.

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
from statistics import median
from typing import Any, NamedTuple

import joblib
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from benchmarks._common import (
    PAPER_STEPS,
    REST,
    ROUGH,
    SPAN,
    Times,
    alternate,
    command,
    configure,
    family,
    folder_of,
    heading,
    machine,
    markdown,
    on_all_cores,
    on_one_core,
    one_core,
    publish,
    ring,
    table,
)
from benchmarks.peers import in_c
from benchmarks.peers.physics import Law
from ringsweep import plots
from ringsweep.quantities.flags import SEPARATING

SEED, SIDE = 181, 64
#: A setting with a larger error at the end is not compared.
CLOSE = 1e-3

#: Largest error at the end, rad or m, at which the documents compare methods.
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


class Outcome(NamedTuple):
    """Outcomes of a method in some cells; `regime` only for methods of the package."""

    end: Any
    separation: Any
    regime: Any = None


@dataclass(frozen=True)
class Scene:
    """One of the five scenes."""

    title: str
    scene: dict[str, Any]
    method: str
    """The method of the package, besides `rk4`, that handles the law."""
    law: Law | None
    """Law for the peers; None on the belt."""
    unit: str = "rad"

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
    "lugre": Scene("LuGre on the belt", _BELT, "implicit", None, "m"),
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
    side: int
    """Side of the family of cells whose throughput is measured."""


FULL = Effort(cells=32, few=8, fewest=4, rounds=3, finest=5, every=1, side=SIDE)
QUICK = Effort(cells=4, few=2, fewest=1, rounds=2, finest=3, every=2, side=16)


@dataclass(frozen=True)
class Contender:
    """A method at a setting. `make` compiles, and returns a function that runs cells."""

    method: str
    setting: str
    make: Callable[[Sequence[Any]], Callable[[], Any]]
    cells: int
    lanes: int
    """Runs in one call: more than `cells` if the call repeats cells."""


# ---- contenders ----------------------------------------------------------------------------


def own(scene: Scene, method: str, cells: Sequence[Any], **options: Any) -> Callable[[], Outcome]:
    """Function that runs a method of the package on cells."""
    call = on_one_core(scene.configuration(cells, method, **options))

    def outcome() -> Outcome:
        found = call()
        if scene.law is None:
            return Outcome(found["x_end"], np.full(len(cells), np.nan), found["regime"])
        return Outcome(found["phi_end"], found["t_separation"], found["regime"])

    return outcome


def contenders(scene: Scene, effort: Effort) -> tuple[list[Contender], list[str]]:
    """Contenders of a scene, and notes on those that are left out."""
    entered: list[Contender] = []
    skipped: list[str] = []
    belt = scene.law is None
    everything, few, fewest = (len(scene.cells(n)) for n in (effort.cells, effort.few, effort.fewest))

    def enter(method: str, setting: str, make: Any, cells: int, lanes: int | None = None) -> None:
        entered.append(Contender(method, setting, make, cells, lanes or cells))

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


def own_of(scene: Scene, method: str, cells: Sequence[Any], **options: Any) -> Callable[[], Outcome]:
    """As :func:`own`, compiled before."""
    call = own(scene, method, cells, **options)
    # Compiled code depends on types alone, so a short run is enough to compile.
    own(scene, method, cells[:1], **({"steps": 100} if method == "rk4" else options))()
    return call


def repeated(scene: Scene, steps: int, cells: Sequence[Any]) -> Callable[[], Outcome]:
    """Function that runs `rk4` on cells, repeated until the lanes are full."""
    times = -(-LANES // len(cells))
    call = own_of(scene, "rk4", list(cells) * times, steps=steps)

    def outcome() -> Outcome:
        found = call()
        return Outcome(*(column[: len(cells)] for column in found))

    return outcome


def of_peer(peer: Any, scene: Scene, *given: Any) -> Callable[[], Any]:
    """Function that runs a peer, compiled before; the last of `given` are the cells."""
    *options, cells = given

    def prepare(chosen: Sequence[Any]) -> Callable[[], Any]:
        return peer.belt(chosen, *options) if scene.law is None else peer.ring(scene.law, chosen, *options)

    if peer.LAZY:
        prepare(cells[:1])()
    return prepare(cells)


# ---- a scene -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Measured:
    """Results of a scene: errors in a dataset, times, and notes on the reference and on absent peers."""

    data: xr.Dataset
    times: dict[tuple[str, str], Times]
    words: list[str]

    def cells(self, key: tuple[str, str]) -> int:
        """Number of cells of a contender, of which the sample of another contender has the first ones."""
        return int(self._row(key).error_end.notnull().sum())

    def largest(self, key: tuple[str, str], cells: int | None = None) -> float:
        """Largest error of a contender at the end, in the first `cells` cells."""
        return float(self._row(key).error_end[:cells].max())

    def per_run(self, key: tuple[str, str]) -> float:
        """Time of one run, s."""
        return float(self._row(key).time_per_run)

    def ratio(self, slow: tuple[str, str], fast: tuple[str, str]) -> float:
        """How many times longer a run of `slow` takes than a run of `fast`: median over the rounds."""
        lanes = float(self._row(fast).lanes) / float(self._row(slow).lanes)
        return self.times[slow].ratio(self.times[fast]) * lanes

    def _row(self, key: tuple[str, str]) -> xr.Dataset:
        keys = list(zip(self.data.method.values, self.data.setting.values, strict=True))
        return self.data.isel(contender=keys.index(key))


def reference(scene: Scene, cells: Sequence[Any], effort: Effort) -> tuple[Outcome, str]:
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
        f"{np.median(by):.0e} {scene.unit} in the median, {by.max():.0e} at most"
    )
    if scene.law is not None:
        apart = abs(theirs.separation - found.separation[:count])
        differ = int((np.isfinite(theirs.separation) != np.isfinite(found.separation[:count])).sum())
        words += f", on the time of separation to {np.nanmax(apart):.0e} s, and on the regime in all but {differ}"
    return found, words + "."


def measure(scene: Scene, effort: Effort) -> Measured:
    """Run every contender of a scene."""
    cells = scene.cells(effort.cells)
    exact, agreement = reference(scene, cells, effort)
    entered, skipped = contenders(scene, effort)
    calls = {}
    for contender in entered:
        calls[contender.method, contender.setting] = contender.make(cells[: contender.cells])
    times, results = alternate(calls, effort.rounds)
    shape = len(entered), len(cells)
    columns = {name: np.full(shape, np.nan) for name in ("error_end", "error_separation", "regime_wrong")}
    for row, contender in enumerate(entered):
        found, count = Outcome(*results[contender.method, contender.setting]), contender.cells
        end, separation, regime = exact.end[:count], exact.separation[:count], exact.regime[:count]
        error = abs(found.end - end)
        columns["error_end"][row, :count] = np.where(np.isfinite(error), error, np.inf)
        columns["error_separation"][row, :count] = abs(found.separation - separation)
        if found.regime is not None:
            columns["regime_wrong"][row, :count] = found.regime != regime
        elif scene.law is not None:
            # A peer tells only whether the body separates, not how it moves.
            separates = np.isfinite(found.separation) != (regime == SEPARATING)
            columns["regime_wrong"][row, :count] = separates | ~np.isfinite(found.end)
    data = xr.Dataset(
        {name: (("contender", "cell"), column) for name, column in columns.items()},
        coords={
            "method": ("contender", [contender.method for contender in entered]),
            "setting": ("contender", [contender.setting for contender in entered]),
            "lanes": ("contender", [contender.lanes for contender in entered], {"long_name": "runs in one call"}),
        },
        attrs={"title": scene.title},
    )
    each = [times[c.method, c.setting].median / c.lanes for c in entered]
    data["time_per_run"] = "contender", each, {"units": "s", "long_name": "time per run, one core"}
    data["error_end"].attrs = {"units": scene.unit, "long_name": f"error of {'x' if scene.law is None else 'φ'}(T)"}
    data["error_separation"].attrs = {"units": "s", "long_name": "error of the time of separation"}
    data["regime_wrong"].attrs = {"units": "1", "long_name": "whether the regime is wrong"}
    return Measured(data, times, [agreement, *(f"Left out: {words}." for words in skipped)])


# ---- what is shown -------------------------------------------------------------------------

RATES = ["", "runs", "runs/s"]
BESIDE = ["peer", "largest error", "in cells", "times longer", "in the rounds", "than"]
HEADER = ["method", "setting", "cells", "ms per run", "error at T: median", "max", "t_sep: max", "regimes wrong"]


def lines(data: xr.Dataset) -> list[list[str]]:
    """Rows of the table of a scene."""
    found = []
    for k in range(data.sizes["contender"]):
        row = data.isel(contender=k)
        end = row.error_end.values[~np.isnan(row.error_end.values)]
        apart, wrong = (v[~np.isnan(v)] for v in (row.error_separation.values, row.regime_wrong.values))
        found.append([
            str(row.method.values), str(row.setting.values), str(len(end)), f"{1e3 * float(row.time_per_run):.3g}",
            f"{np.median(end):.0e}", f"{end.max():.0e}", f"{apart.max():.0e}" if len(apart) else "-",
            str(int(wrong.sum())) if len(wrong) else "-",
        ])  # fmt: skip
    return found


def draw(data: xr.Dataset, methods: list[str]) -> Figure:
    """Figure of a scene: the error at the end, that of the separation if there is one, and the share of wrong regimes.

    Parameters
    ----------
    data : xarray.Dataset
        Numbers of one scene.
    methods : list of str
        Methods of all scenes, so that a colour stands for the same method in all figures.
    """
    solvers = [f"{method}, {setting}" for method, setting in zip(data.method.values, data.setting.values, strict=True)]
    data = data.assign_coords(solver=("contender", solvers)).assign_attrs(methods=methods, target=TARGET)
    within = (data.error_end.max("cell") <= TARGET) & data.method.isin(["event", "implicit"])
    if within.any():
        data.attrs["recommended"] = solvers[int(np.nanargmin(data.time_per_run.where(within)))]
    errors = [name for name in ("error_end", "error_separation") if data[name].notnull().any()]
    columns = 2
    rows = -(-(len(errors) + 1) // columns)
    figure = Figure(figsize=(WIDTH, 2.5 * rows + 1.2), layout="constrained")
    axes = figure.subplots(rows, columns).ravel()
    for panel, error in zip(axes, errors, strict=False):
        plots.precision_panel(data, error, panel)
        panel.set_title("", loc="left")
    legend = axes[0].get_legend()
    handles, styles = legend.legend_handles, {line.get_label(): line for line in axes[0].get_lines()}
    labels = [text.get_text() for text in legend.get_texts()]
    for panel in axes[: len(errors)]:
        panel.get_legend().remove()
    shares = axes[len(errors)]
    for method in dict.fromkeys(map(str, data.method.values)):
        own_rows = data.isel(contender=data.method.values == method)
        share = 100.0 * own_rows.regime_wrong.mean("cell")
        line = styles[method]
        shares.plot(own_rows.time_per_run, share, color=line.get_color(), marker=line.get_marker(), markersize=4)
    shares.set(xscale="log", xlabel=axes[0].get_xlabel(), ylabel="regime wrong\n(% of cells)")
    shares.set_ylim(-4.0, 104.0)
    shares.tick_params(labelsize="small")
    shares.grid(True, color="#E6E6E6", linewidth=0.6)
    what = f"points: median of {data.sizes['cell']} cells, or of the fewer of a slow peer; bars: up to the largest"
    figure.suptitle(f"{data.attrs['title']}\n{what}", fontsize="medium")
    figure.align_ylabels(axes)
    style: dict[str, Any] = {"fontsize": "small", "frameon": False, "handlelength": 3}
    if free := axes[len(errors) + 1 :].tolist():
        free[0].set_axis_off()
        free[0].legend(handles, labels, loc="center", **style)
    else:
        figure.legend(handles, labels, loc="outside lower center", ncols=3, **style)
    return figure


def draw_all(scenes: dict[str, xr.Dataset], folder: Path) -> None:
    """Write a picture of each scene."""
    methods = list(dict.fromkeys(str(name) for data in scenes.values() for name in data.method.values))
    for name, data in scenes.items():
        draw(data, methods).savefig(folder / f"work_precision_{name}.png", dpi=150, metadata={"Software": None})


# ---- beside peers ---------------------------------------------------------------------------


def cheapest(found: Measured, method: str, error: float, cells: int | None = None) -> tuple[str, str] | None:
    """Fastest setting of a method whose largest error at the end, in the first `cells` cells, is at most `error`."""
    keys = [key for key in found.times if key[0] == method and found.largest(key, cells) <= error]
    return min(keys, key=found.per_run, default=None)


def beside_peers(scene: Scene, found: Measured) -> list[list[str]]:
    """Rows that compare each peer, at each setting, with the fastest setting of ours that errs no more."""
    rows = []
    for peer in found.times:
        theirs, cells = found.largest(peer), found.cells(peer)
        if peer[0] in ("rk4", scene.method) or not theirs < CLOSE:
            continue
        if (best := cheapest(found, scene.method, theirs, cells)) is None:
            ours = ["-", "-", "no setting errs as little"]
        else:
            each = sorted(a / b for a, b in zip(found.times[peer].wall, found.times[best].wall, strict=False))
            lanes = float(found.ratio(peer, best)) / median(each)
            spread = f"{number(lanes * each[0])} to {number(lanes * each[-1])}"
            ours = [
                number(found.ratio(peer, best)),
                spread,
                f"`{best[0]}`, {best[1]}: {found.largest(best, cells):.0e}",
            ]
        rows.append([", ".join(peer), f"{theirs:.0e}", str(cells), *ours])
    return rows


def at_target(measured: Mapping[str, Measured]) -> str:
    """Table of the documents: the fastest setting of each method, in each scene, that errs by `TARGET` at most."""
    methods = list(dict.fromkeys(key[0] for found in measured.values() for key in found.times))
    rows = []
    for method in ["event", "implicit", *(name for name in methods if name not in ("event", "implicit"))]:
        row = [f"`{method}`" if method in ("event", "implicit", "rk4") else method]
        for name, found in measured.items():
            own = cheapest(found, SCENES[name].method, TARGET)
            if (best := cheapest(found, method, TARGET)) is not None and own is not None:
                times = "" if best == own else f", {number(found.ratio(best, own))} x"
                row.append(f"{1e3 * found.per_run(best):.3g} ms{times} ({best[1]})")
            else:
                row.append("too inexact" if any(key[0] == method for key in found.times) else "-")
        rows.append(row)
    return markdown(["", *(SCENES[name].title for name in measured)], rows)


FRONT = ["method", "setting", "ms per run", "largest error of φ(T), rad", "regimes wrong"]
#: Rows of the table in the documents: what somebody would try on the stiff scene, from the default on.
CHOSEN = {"implicit": ["rtol 3e-06"], "numbalsoda LSODA": ["rtol 1e-09"], "SciPy LSODA": ["rtol 1e-08"],
          "rk4": ["1e+04 steps", "1e+06 steps", "1e+07 steps"]}  # fmt: skip


def front(data: xr.Dataset) -> list[list[str]]:
    """Rows of the table in the documents, from the stiff scene."""
    rows = []
    for method, setting, cells, cost, _, largest, _, wrong in lines(data):
        if setting in CHOSEN.get(method, []):
            few = f" ({cells} cells)" if int(cells) < data.sizes["cell"] else ""
            rows.append([f"{method}{few}", setting, cost, largest, wrong])
    return rows


def number(value: float) -> str:
    """Two digits of a number, without an exponent."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


def throughput(effort: Effort) -> list[list[str]]:
    """Rows of the runs per second on all cores."""
    cells = family(effort.side)
    smooth, stiff, limit = SCENES["smooth"], SCENES["stiff"], SCENES["limit"]
    cores = joblib.cpu_count()
    many: dict[str, tuple[int, Callable[[], Any]]] = {}
    for name, scene, method, options in (
        ("`event`, limit law, rtol 1e-10", limit, "event", {"rtol": 1e-10}),
        ("`implicit`, stiff, rtol 3e-06", stiff, "implicit", {"rtol": 3e-6}),
        ("`implicit`, smooth, rtol 3e-06", smooth, "implicit", {"rtol": 3e-6}),
        (f"`rk4`, smooth, {PAPER_STEPS} steps", smooth, "rk4", {"steps": PAPER_STEPS}),
    ):
        many[name] = len(cells), partial(on_all_cores, scene.configuration(cells, method, **options))
    try:
        numbalsoda = import_module("benchmarks.peers.with_numbalsoda")
        share = stiff.cells(min(64, len(cells)))
        parts = [of_peer(numbalsoda, stiff, 1e-9, share[k::cores]) for k in range(cores)]
        run = partial(joblib.Parallel(n_jobs=cores, prefer="threads"), [joblib.delayed(part)() for part in parts])
        many["numbalsoda, stiff, rtol 1e-09, in threads"] = len(share), run
    except ImportError:
        pass
    for _, call in many.values():
        call()
    times, _ = alternate({name: call for name, (_, call) in many.items()}, effort.rounds)
    return [[name, str(count), f"{count / times[name].median:.0f}"] for name, (count, _) in many.items()]


#: Explanation at the head of the report.
ABOUT = """
One core, compiled before, no certificates; medians over rounds in which contenders alternate. The table has the errors
of φ(T), or of x(T) on the belt, and of the time of separation. The regime of a peer only says whether the body
separates. The time of diffrax is the time of one lane of a full solve.
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
    measured: dict[str, Measured] = {}
    with one_core():
        for name in given.scene or SCENES:
            found = measured[name] = measure(SCENES[name], effort)
            heading(SCENES[name].title)
            print("\n".join(found.words))
            table(HEADER, lines(found.data))
            print(f"({time.perf_counter() - begin:.0f} s so far)")
            report += f"\n## {SCENES[name].title}\n\n![error against run time](work_precision_{name}.png)\n\n"
            report += "".join(f"- {words}\n" for words in found.words)
            report += "\n" + markdown(HEADER, lines(found.data))
            table(BESIDE, rows := beside_peers(SCENES[name], found))
            if rows:
                report += "\nHow many times longer a peer takes than ours at no larger error, in the same cells:\n\n"
                report += markdown(BESIDE, rows)
            else:
                report += f"\nEvery peer errs by more than {CLOSE:g} {found.data.error_end.units} in some cell.\n"
    write(folder, measured, where)
    if not given.scene:
        title, header, rows = f"Runs per second on all cores, T = {SPAN:g} s", RATES, throughput(effort)
        heading(title)
        table(header, rows)
        report += f"\n## {title}\n\n{markdown(header, rows)}"
        figures = {
            "stiff": markdown(FRONT, front(measured["stiff"].data)),
            "equal": at_target(measured),
            "cells": str(effort.cells),
        }
        publish(given, "work_precision", "Error against run time", where, report, figures)


def write(folder: Path, measured: dict[str, Measured], where: str) -> None:
    """Write the numbers (one NetCDF group for each scene) and the pictures."""
    for k, (name, found) in enumerate(measured.items()):
        found.data.attrs["machine"] = where
        found.data.to_netcdf(folder / "work_precision.nc", group=name, mode="a" if k else "w")
    draw_all({name: found.data for name, found in measured.items()}, folder)


if __name__ == "__main__":
    main()
