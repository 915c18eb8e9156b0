"""Where each solver is right, wrong and not certified, or wrong and certified under stiff laws.

    python -m benchmarks.stability            # about five minutes
    python -m benchmarks.stability --quick    # coarser maps

Every run is put into one of four classes against a reference:

- ``right``: regime, motion and separating contact agree with the reference, the angle at the end to 1e-3 rad, the time
  of separation to 1e-3 s;
- ``wrong_and_flagged``: not right, and not certified;
- ``wrong_and_silent``: not right, but certified;
- ``failed``: the solver gave up and said so.

A cell of a map has the worst class of three scenes, so that no result depends on one lucky scene. The reference of
the maps is the piecewise method at a tolerance five decades below its default. ``benchmarks.brute_force`` compares
this method with a reference that shares no code with the package.

Writes ``stability.nc``, ``stability.png`` and ``stability.md``.
"""

from __future__ import annotations

import copy
import textwrap
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from benchmarks._common import ALPHA, REST, ROUGH, V0, command, folder_of, machine, markdown, publish, ring
from ringsweep import config
from ringsweep.quantities.flags import REGIMES
from ringsweep.runs import sweep
from ringsweep.runs.executors import Execution
from ringsweep.solvers.rk4 import STABILITY_LIMIT
from ringsweep.storage import netcdf

#: Allowed error of phi_end (rad) and of t_separation (s).
CLOSE = 1e-3

CLASSES = ("right", "wrong_and_flagged", "wrong_and_silent", "failed")
RIGHT, FLAGGED, SILENT, FAILED = range(4)
#: Colours of the classes (palette of Okabe and Ito).
COLOURS = ("#56B4E9", "#F0E442", "#D55E00", "#7F7F7F")


# ---- scenes and runs -------------------------------------------------------------------------


def changed(scene: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A scene with other values by dotted path."""
    found = copy.deepcopy(dict(scene))
    for path, value in changes.items():
        *parents, last = path.split(".")
        node = found
        for parent in parents:
            node = node[parent]
        node[last] = value
    return found


_LAST = {"rough": {"mu_s": 0.2, "mu_k": 0.15}, "rest": {"mu_s": 0.15, "mu_k": 0.1}}
#: Scenes of the maps, by name, without their law. Under one law they share one kernel.
SCENES: dict[str, dict[str, Any]] = {
    "fig29": ring({}),
    "fig25": changed(ring({}), {"drive.amplitude": 0.2, "friction.rest": {"mu_s": 0.3, "mu_k": 0.1}}),
    "fig33": changed(ring({}), {"drive.amplitude": 0.0, "initial.omega": 100.0, "time.span": 1.0, "friction": _LAST}),
}


def run(scene: Mapping[str, Any], solver: Mapping[str, Any], points: Mapping[str, Any]) -> xr.Dataset:
    """Outcomes of a run for each of the `points`."""
    columns = {path: np.asarray(column).tolist() for path, column in points.items()}
    tree = {"scene": scene, "solver": dict(solver), "sweep": {"points": columns}}
    return sweep.compute(config.load(tree), Execution(progress=False))


def difference(found: xr.Dataset, reference: xr.Dataset) -> tuple[Any, Any]:
    """Whether each run differs in kind from the reference, and its largest error in units of the allowed error."""
    kinds = [found[name].values != reference[name].values for name in ("regime", "motion", "separating_contact")]
    errors = [np.abs(found[name].values - reference[name].values) for name in ("phi_end", "t_separation")]
    return np.any(kinds, axis=0), np.nan_to_num(errors).max(axis=0) / CLOSE


def classify(found: xr.Dataset, reference: xr.Dataset) -> Any:
    """Class of each run, int8."""
    kind, error = difference(found, reference)
    wrong = kind | (error > 1.0)
    classes = np.where(wrong, np.where(found["certified"] == 1, SILENT, FLAGGED), RIGHT)
    # If the reference fails too, failure is the right answer.
    gave_up = (found["regime"] == REGIMES.index("failed")) & wrong
    return np.where(gave_up, FAILED, classes).astype(np.int8)


# ---- maps ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Axis:
    """An axis of a map: a path of the scene, or an option of the solver."""

    name: str
    label: str
    values: Any
    units: str = "1"
    option: str = ""
    """Name of the option of the solver, if the axis is one."""
    paths: Callable[[Any], dict[str, Any]] | None = None
    """Values by path that the axis changes in the scene."""


@dataclass(frozen=True)
class Map:
    """Classes of one method over two axes."""

    name: str
    title: str
    law: str
    solver: Mapping[str, Any]
    reference: Mapping[str, Any]
    x: Axis
    y: Axis


def axis(name: str, label: str, values: Any, units: str) -> Axis:
    """An axis over one parameter of the friction law."""
    return Axis(name, label, values, units, paths=lambda column: {f"friction.{name}": column})


def maps(quick: bool) -> list[Map]:
    """The six maps."""
    fine = 0.45 if quick else 1.0

    def spaced(low: float, high: float, count: int) -> Any:
        return np.geomspace(low, high, max(3, round(fine * count)))

    v0 = axis("v0", "half-width of the stiction band v0 (m/s)", spaced(1e-12, 10.0, 27), "m s-1")
    alpha = axis("alpha", "decay of friction alpha (s/m)", spaced(1.0, 1e9, 19), "s m-1")

    def by_ratio(column: Any) -> dict[str, Any]:
        return {f"friction.{place}.mu_s": column * mu["mu_k"] for place, mu in (("rough", ROUGH), ("rest", REST))}

    ratio = Axis("mu_ratio", "μs / μk at both surfaces (1)", np.linspace(1.0, 5.0, len(v0.values)), paths=by_ratio)
    rtol = Axis("rtol", "tolerance rtol (1)", np.geomspace(1e-12, 1e-3, 10)[:: 2 if quick else 1], option="rtol")
    most = 5 if quick else 6
    steps = Axis(
        "step_count", "steps (1)", np.geomspace(100, 10**most, most * 2 - 3).round().astype(int), option="steps"
    )
    smooth = {"method": "implicit", "rtol": 1e-11}
    exact = {"method": "event", "rtol": 1e-14}
    return [
        Map("auto", "auto, Bengisu-Akay", "bengisu-akay", {"method": "auto"}, smooth, v0, alpha),
        Map("rk4", "rk4, 15000 steps", "bengisu-akay", {"method": "rk4", "steps": 15000}, smooth, v0, alpha),
        Map("event", "auto, Tustin", "tustin", {"method": "auto"}, exact, ratio, alpha),
        Map("implicit_rtol", "implicit, alpha = 1e5 s/m", "bengisu-akay", {"method": "implicit"}, smooth, v0, rtol),
        Map("rk4_by_steps", "rk4, alpha = 1e5 s/m", "bengisu-akay", {"method": "rk4"}, smooth, v0, steps),
        Map("event_rtol", "event, Tustin, alpha = 1e5 s/m", "tustin", {"method": "event"}, exact, ratio, rtol),
    ]


def cells_of(map_: Map) -> dict[str, Any]:
    """Values by path of every cell, `y` outermost; an axis over an option of the solver has no path."""
    y, x = (grid.ravel() for grid in np.meshgrid(map_.y.values, map_.x.values, indexing="ij"))
    return {
        path: column
        for one, values in ((map_.y, y), (map_.x, x))
        if one.paths is not None
        for path, column in one.paths(values).items()
    }


def settle(map_: Map, scene: Mapping[str, Any], known: dict[Any, Any]) -> tuple[xr.Dataset, xr.Dataset]:
    """Outcomes of the method, and of the reference, in every cell of a map in one scene."""
    shape = {"y": len(map_.y.values), "x": len(map_.x.values)}
    law = {"law": map_.law, "alpha": ALPHA} | ({} if map_.law == "tustin" else {"v0": V0})
    scene = changed(scene, {f"friction.{name}": value for name, value in law.items()})
    if map_.y.option:
        assert map_.x.paths is not None
        columns = map_.x.paths(map_.x.values)
        rows = [run(scene, {**map_.solver, map_.y.option: value.item()}, columns) for value in map_.y.values]
        found = xr.concat(rows, "y", data_vars="all", coords="minimal", compat="override", join="override")
        found = found.rename({"point": "x"})
    else:
        columns = cells_of(map_)
        found = _grid(run(scene, map_.solver, columns), shape)
    # Maps of two methods share their reference.
    key = str(scene), map_.reference["method"], *((path, column.tobytes()) for path, column in columns.items())
    if key not in known:
        known[key] = run(scene, map_.reference, columns)
    reference = known[key]
    if map_.y.option:
        return found, reference.rename({"point": "x"}).expand_dims(y=shape["y"])
    return found, _grid(reference, shape)


def _grid(flat: xr.Dataset, shape: Mapping[str, int]) -> xr.Dataset:
    """Reshape points in a row to cells of a map."""
    sizes = tuple(shape.values())
    return xr.Dataset({name: (tuple(shape), data.values.reshape(sizes)) for name, data in flat.items()})


def draw_maps(quick: bool) -> tuple[xr.Dataset, list[Map]]:
    """Every map as a dataset with the dimension `scene`."""
    chosen = maps(quick)
    known: dict[Any, Any] = {}
    flags = {"flag_values": np.arange(4, dtype=np.int8), "flag_meanings": " ".join(CLASSES)}
    variables: dict[str, Any] = {}
    coords: dict[str, Any] = {"scene": ("scene", list(SCENES), {"long_name": "scene of the paper"})}
    for map_ in chosen:
        begin = time.perf_counter()
        both = [settle(map_, scene, known) for scene in SCENES.values()]
        dims = "scene", map_.y.name, map_.x.name
        for one in (map_.y, map_.x):
            coords[one.name] = (one.name, one.values, {"long_name": one.label.rpartition(" (")[0], "units": one.units})

        def put(name: str, values: Sequence[Any], dtype: str, map_=map_, dims=dims, **attributes: Any) -> None:
            stacked = np.stack([np.asarray(value) for value in values]).astype(dtype)
            attributes["long_name"] = f"{map_.title}: {attributes['long_name']}"
            variables[f"{map_.name}_{name}"] = (dims, stacked, {"units": "1"} | attributes)

        put("class", [classify(*pair) for pair in both], "int8", long_name="class of the run", **flags)
        put("wrong_in_kind", [difference(*pair)[0] for pair in both], "int8",
            long_name="another regime, motion or contact than the reference")  # fmt: skip
        put("error", [difference(*pair)[1] * CLOSE for pair in both], "float64",
            long_name="larger of the errors of phi_end (rad) and t_separation (s)")  # fmt: skip
        put("certified", [found["certified"] for found, _ in both], "int8", long_name="certified")
        put("reference_certified", [ref["certified"].broadcast_like(found["regime"]) for found, ref in both], "int8",
            long_name="whether the reference agrees with itself at thirty times its tolerance")  # fmt: skip
        if "stiffness" in both[0][0]:
            put("stiffness", [found["stiffness"] for found, _ in both], "float64",
                long_name="largest |eigenvalue| times step")  # fmt: skip
        print(f"{map_.name}: {time.perf_counter() - begin:.1f} s", flush=True)
    return xr.Dataset(variables, coords), chosen


# ---- output ----------------------------------------------------------------------------------


def picture(ds: xr.Dataset, chosen: Sequence[Map], path: Path) -> None:
    """Draw the maps in which a run is wrong; each cell has its worst scene. A sentence names the other maps."""
    # Wrong and certified is worst, worse than a failure that the solver reports.
    badness = np.array([0, 1, 3, 2])
    plain = [one for one in chosen if (ds[f"{one.name}_class"] == RIGHT).all()]
    drawn = [one for one in chosen if one not in plain]
    columns = 2
    rows = -(-len(drawn) // columns)
    figure = Figure(figsize=(6.69, 2.9 * rows + 1.4), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel, map_ in zip(axes, drawn, strict=False):
        classes = ds[f"{map_.name}_class"].values
        x, y = map_.x.values, map_.y.values
        # Of several scenes of the same class the one with the largest step in units of its limit.
        stiff = ds[f"{map_.name}_stiffness"].values if f"{map_.name}_stiffness" in ds else np.zeros(classes.shape)
        shown = np.argmax(badness[classes] + 0.5 * (stiff > STABILITY_LIMIT), axis=0)[None]
        worst, stiff = (np.take_along_axis(one, shown, axis=0)[0] for one in (classes, stiff))
        panel.pcolormesh(
            x, y, worst, cmap=ListedColormap(COLOURS), vmin=-0.5, vmax=3.5, shading="nearest",
            edgecolors="white", linewidth=0.3,
        )  # fmt: skip
        beyond = np.ma.masked_where(stiff <= STABILITY_LIMIT, stiff)
        panel.pcolor(x, y, beyond, shading="nearest", hatch=".....", facecolor="none", edgecolor="black", linewidth=0)
        panel.set_title(_typeset(map_.title), fontsize="medium")
        panel.set(xscale="linear" if map_.x.name == "mu_ratio" else "log", yscale="log")
        panel.set(xlabel=map_.x.label, ylabel=map_.y.label)
        panel.tick_params(labelsize="small")
        for axis in (panel.xaxis, panel.yaxis):
            axis.label.set_size("small")
    for panel in axes[len(drawn) :]:
        panel.set_axis_off()
    handles = _legend(ds, drawn)
    if plain:
        names = "; ".join(f"{_typeset(one.title)} ({ds[f'{one.name}_class'].size} runs)" for one in plain)
        words = textwrap.fill(f"right in every cell, so not drawn: {names}", 46)
        handles.append(Patch(facecolor=COLOURS[RIGHT], label=words))
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize="small", frameon=False)
    figure.suptitle("Worst class of three scenes (Figs. 25, 29, 33) in every cell")
    figure.savefig(path, dpi=150, metadata={"Software": None})


def _typeset(title: str) -> str:
    """A title with symbols."""
    return title.replace("1e5", "10⁵").replace("alpha", "\N{GREEK SMALL LETTER ALPHA}")


def _legend(ds: xr.Dataset, drawn: Sequence[Map]) -> list[Artist]:
    """Entries for the classes, with what a silent error is here, and for the limit of stability."""
    silent = [ds[f"{one.name}_class"].values == SILENT for one in drawn]
    errors = np.concatenate([ds[f"{one.name}_error"].values[where] for one, where in zip(drawn, silent, strict=True)])
    kinds = (ds[f"{one.name}_wrong_in_kind"].values[where] for one, where in zip(drawn, silent, strict=True))
    in_kind = sum(int((kind == 1).sum()) for kind in kinds)
    if len(errors):
        what = f"regime wrong in {in_kind} of {len(errors)} runs" if in_kind else "regime right"
        what += f",\nerror above {CLOSE:g}, up to {np.nanmax(errors):.1g} (rad, s)"
    else:
        what = ""
    names = ["right", "wrong and flagged: not certified", f"wrong and silent: certified; {what}", "failed"]
    entries: list[Artist] = [
        Patch(facecolor=colour, label=name)
        for k, (colour, name) in enumerate(zip(COLOURS, names, strict=True))
        if any((ds[f"{one.name}_class"] == k).any() for one in drawn)
    ]
    beyond = Patch(facecolor="white", edgecolor="black", hatch=".....", linewidth=0.0)
    limit = f"|λ|h > {STABILITY_LIMIT:g}"
    beyond.set_label(f"dotted: beyond the limit of stability of rk4,\n{limit}; without dots: within it")
    return [*entries, beyond]


def silent_in_kind(ds: xr.Dataset, chosen: Sequence[Map]) -> int:
    """Number of certified runs with another regime, motion or contact."""
    found = (ds[f"{one.name}_class"].values == SILENT for one in chosen)
    kinds = (ds[f"{one.name}_wrong_in_kind"].values == 1 for one in chosen)
    return sum(int((silent & kind).sum()) for silent, kind in zip(found, kinds, strict=True))


def counts(ds: xr.Dataset, chosen: Sequence[Map]) -> list[list[str]]:
    """Rows with the number of runs of each map in each class, and of runs certified beyond the limit of stability."""
    rows = []
    for map_ in chosen:
        classes = ds[f"{map_.name}_class"].values
        in_kind = silent_in_kind(ds, [map_])
        beyond = "-"
        if f"{map_.name}_stiffness" in ds:
            over = ds[f"{map_.name}_stiffness"] > STABILITY_LIMIT
            beyond = str(int((over & (ds[f"{map_.name}_certified"] == 1)).sum()))
        each = (str(int((classes == k).sum())) for k in range(4))
        uncertified = int((ds[f"{map_.name}_reference_certified"] == 0).sum())
        rows.append([map_.title, str(classes.size), *each, str(in_kind), beyond, str(uncertified)])
    return rows


#: What the reference of the maps is.
REFERENCE = """
The reference of a map is `implicit` at rtol 1e-11, or `event` at 1e-14. Where it takes the same steps at thirty times
this tolerance, that both agree shows nothing: it is uncertified there, and runs are compared with it all the same.
"""


def main() -> None:
    """Run the benchmark and write its results."""
    given = command(__doc__).parse_args()
    folder = folder_of(given)
    print(where := machine(), flush=True)
    ds, chosen = draw_maps(given.quick)
    ds.attrs = {
        "Conventions": "CF-1.11",
        "title": "ringsweep: where solvers are right, flagged, silent or failed",
        "close": CLOSE,
        "machine": where,
    }
    netcdf.save(ds, folder / "stability.nc")
    picture(ds, chosen, folder / "stability.png")
    header = ["map", "runs", *(name.replace("_", " ") for name in CLASSES), "silent in kind"]
    header += ["certified beyond the limit", "reference uncertified"]
    text = f"Wrong: another regime, motion or contact, or an error of more than {CLOSE:g} rad or s.\n{REFERENCE}"
    text += f"\n## Maps\n\n{markdown(header, counts(ds, chosen))}"
    print(text)
    classes = {one.name: ds[f"{one.name}_class"].values for one in chosen}
    silent = {method: sum(int((found == SILENT).sum()) for name, found in classes.items() if ("rk4" in name) == rk4)
              for method, rk4 in (("rk4", True), ("others", False))}  # fmt: skip
    figures = {"runs": str(sum(found.size for found in classes.values())), "silent_rk4": str(silent["rk4"])}
    figures |= {"silent_others": str(silent["others"]), "silent_in_kind": str(silent_in_kind(ds, chosen))}
    publish(given, "stability", "Numerical stability", where, text, figures)


if __name__ == "__main__":
    main()
