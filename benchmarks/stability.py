"""Where each solver is right, wrong and not certified, or wrong and certified: stiff and extreme cases.

    python -m benchmarks.stability            # about five minutes
    python -m benchmarks.stability --quick    # coarser maps, the same extremes
    python -m benchmarks.stability --redraw   # only the picture, from the stored numbers

Every run is put into one of four classes against a reference:

- ``right``: regime, motion and separating contact agree with the reference, the angle at the end to 1e-3 rad, the time
  of separation to 1e-3 s (on the belt: the displacement to 1e-3 of the largest displacement);
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
from dataclasses import dataclass, field
from math import asin, cos, pi, radians, sin, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from benchmarks._common import (
    ALPHA,
    BODY,
    GRAVITY,
    RADIUS,
    REST,
    ROUGH,
    V0,
    command,
    folder_of,
    machine,
    markdown,
    publish,
)
from ringsweep import config
from ringsweep.quantities.flags import REGIMES
from ringsweep.runs import sweep
from ringsweep.runs.executors import Execution
from ringsweep.solvers.rk4 import STABILITY_LIMIT
from ringsweep.storage import netcdf

#: Allowed error of phi_end (rad), of t_separation (s), and of x_end relative to the largest displacement.
CLOSE = 1e-3

CLASSES = ("right", "wrong_and_flagged", "wrong_and_silent", "failed")
RIGHT, FLAGGED, SILENT, FAILED = range(4)
#: Colours of the classes (palette of Okabe and Ito).
COLOURS = ("#56B4E9", "#F0E442", "#D55E00", "#7F7F7F")

BETA = asin(BODY["half_distance"] / (RADIUS - BODY["ball_radius"]))
XI = (RADIUS - BODY["ball_radius"]) * cos(BETA)
ABOUT_AXIS = BODY["inertia"] + BODY["mass"] * XI * XI


# ---- scenes and runs -------------------------------------------------------------------------


def changed(scene: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A scene with other values by dotted path; None removes a value."""
    found = copy.deepcopy(dict(scene))
    for path, value in changes.items():
        *parents, last = path.split(".")
        node = found
        for parent in parents:
            node = node.setdefault(parent, {})
        if value is None:
            node.pop(last, None)
        else:
            node[last] = value
    return found


FIG_29: dict[str, Any] = {
    "model": "ring",
    "body": BODY,
    "ring": {"radius": RADIUS},
    "friction": {"law": "bengisu-akay", "rough": ROUGH, "rest": REST, "alpha": ALPHA, "v0": V0},
    "zone": {"center": 0.0, "half_angle": radians(15.0)},
    "drive": {"law": "arctan", "amplitude": 2.0},
    "initial": {"phi": 0.0, "omega": 0.0},
    "time": {"span": 10.0},
    "gravity": GRAVITY,
}
#: Scenes of the maps, by name. They share one structure, and so one kernel.
SCENES: dict[str, dict[str, Any]] = {
    "fig29": FIG_29,
    "fig25": changed(FIG_29, {"drive.amplitude": 0.2, "friction.rest": {"mu_s": 0.3, "mu_k": 0.1}}),
    "fig33": changed(
        FIG_29,
        {
            "drive.amplitude": 0.0,
            "initial.omega": 100.0,
            "time.span": 1.0,
            "friction.rough": {"mu_s": 0.2, "mu_k": 0.15},
            "friction.rest": {"mu_s": 0.15, "mu_k": 0.1},
        },
    ),
}


def with_law(scene: Mapping[str, Any], law: str, **parameters: float | None) -> dict[str, Any]:
    """A scene under another friction law."""
    given = {"alpha": None, "v0": None} | parameters
    return changed(scene, {"friction.law": law} | {f"friction.{name}": value for name, value in given.items()})


def run(scene: Mapping[str, Any], solver: Mapping[str, Any], points: Mapping[str, Any] | None = None) -> xr.Dataset:
    """Outcomes of one run, or of a run for each of the `points`."""
    tree: dict[str, Any] = {"scene": copy.deepcopy(dict(scene)), "solver": dict(solver)}
    if points:
        tree["sweep"] = {"points": {path: np.asarray(column).tolist() for path, column in points.items()}}
    return sweep.compute(config.load(tree), Execution(progress=False))


def difference(found: xr.Dataset, reference: Mapping[str, Any]) -> tuple[Any, Any]:
    """Whether each run differs in kind from the reference, and its largest error in units of the allowed error.

    A quantity that the reference lacks is not compared.
    """
    kinds = [found[name] != reference[name] for name in ("regime", "motion", "separating_contact") if name in reference]
    errors = [np.zeros(found["regime"].shape)]
    for name in ("phi_end", "t_separation"):
        if name in reference:
            errors.append(np.nan_to_num(np.abs(np.asarray(found[name]) - np.asarray(reference[name]))) / CLOSE)
    if "x_end" in reference:
        size = float(max(abs(found["x_min"]), abs(found["x_max"]), 1e-300))
        errors.append(np.abs(np.asarray(found["x_end"]) - np.asarray(reference["x_end"])) / (CLOSE * size))
    return np.any([np.asarray(kind) for kind in kinds], axis=0), np.max(errors, axis=0)


def classify(found: xr.Dataset, reference: Mapping[str, Any]) -> Any:
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
    law = {"alpha": ALPHA} if map_.law == "tustin" else {"alpha": ALPHA, "v0": V0}
    scene = with_law(scene, map_.law, **law)
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
        put("steps", [found["steps"] for found, _ in both], "int64", long_name="steps of the integration")
        put("reference_certified", [ref["certified"].broadcast_like(found["regime"]) for found, ref in both], "int8",
            long_name="whether the reference agrees with itself at thirty times its tolerance")  # fmt: skip
        if "stiffness" in both[0][0]:
            put("stiffness", [found["stiffness"] for found, _ in both], "float64",
                long_name="largest |eigenvalue| times step")  # fmt: skip
        print(f"{map_.name}: {time.perf_counter() - begin:.1f} s", flush=True)
    return xr.Dataset(variables, coords), chosen


# ---- extremes --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Extreme:
    """An extreme scene, its expected outcomes, and their source."""

    name: str
    scene: Mapping[str, Any]
    check: str = "tighter"
    """Source of the expected outcomes; ``tighter``: the same method at its tightest useful tolerance."""
    expected: Mapping[str, Any] = field(default_factory=dict)
    """Outcomes from a closed form; if empty, a run of `solver` gives them."""
    twin: Mapping[str, Any] | None = None
    """Another scene that must have the same outcomes, if the check is a run of that scene."""
    solver: Mapping[str, Any] = field(default_factory=dict)
    """Solver of the checking run, if it is not the default."""


def _regime(regime: str, motion: str | None = None, contact: int = 0, **more: float) -> dict[str, Any]:
    return {
        "regime": REGIMES.index(regime),
        "motion": REGIMES.index(motion or regime),
        "separating_contact": contact,
        **more,
    }


def _pendulum(omega: float, span: float) -> float:
    """Angle of the body, launched from the bottom as a pendulum, from Jacobi's elliptic function, rad."""
    from scipy.special import ellipj

    own = sqrt(BODY["mass"] * GRAVITY * XI / ABOUT_AXIS)
    k = omega / (2.0 * own)
    sn, _, _, _ = ellipj(own * span, k * k)
    return float(2.0 * np.arcsin(k * sn))


def extremes() -> list[Extreme]:
    """The extreme scenes, smooth law first; each name says what is extreme."""
    smooth, stick = FIG_29, with_law(FIG_29, "stiction")
    bare = {"friction.rough": {"mu_s": 0.0, "mu_k": 0.0}, "friction.rest": {"mu_s": 0.0, "mu_k": 0.0}}
    level = {"friction.rough": {"mu_s": 0.3, "mu_k": 0.3}, "friction.rest": {"mu_s": 0.1, "mu_k": 0.1}}
    still = {"drive.amplitude": 0.0}
    power = {"drive.law": "power", "drive.exponent": 1.1}
    on_edge = {"initial.phi": radians(15.0) - BETA}
    tiny = {"body.inertia": 4.47e-17, "body.half_distance": 2.5e-8, "body.ball_radius": 1e-8, "ring.radius": 4.3378e-8}
    # Uniform friction coefficient at which the effective inertia vanishes.
    jam = sqrt(ABOUT_AXIS * cos(BETA) / (BODY["mass"] * RADIUS * XI - ABOUT_AXIS * cos(BETA)))
    round_ = {"zone.half_angle": 0.0, "initial.omega": 10.0, "time.span": 1e-3, **still}

    def uniform(mu: float) -> dict[str, Any]:
        return {"friction.rest": {"mu_s": mu, "mu_k": mu}, **round_}

    both: list[tuple[str, Mapping[str, Any], dict[str, Any]]] = [
        ("μ = 0 everywhere, at rest", bare | still, {"check": "rests", "expected": _regime("resting", phi_end=0.0)}),
        ("μ = 0 everywhere, launched at 10 rad/s", bare | still | {"initial.omega": 10.0},
         {"check": "elliptic sine", "expected": _regime("oscillatory", phi_end=_pendulum(10.0, 10.0))}),
        ("μs = μk", level, {}),
        ("μ rough 3: beyond Painlevé on the zone", {"friction.rough": {"mu_s": 3.0, "mu_k": 3.0}}, {}),
        (f"uniform μ = {0.999 * jam:.5g}, just below jamming", uniform(0.999 * jam), {}),
        (f"uniform μ = {1.001 * jam:.5g}, just above jamming", uniform(1.001 * jam),
         {"check": "effective inertia", "expected": {"regime": REGIMES.index("jammed")}}),
        ("half_angle 0", {"zone.half_angle": 0.0}, {}),
        ("half_angle 180 deg", {"zone.half_angle": pi}, {}),
        ("half_angle 180 deg, rest μ = 3 (nowhere)", {"zone.half_angle": pi, "zone.center": 1.0, "initial.omega": 20.0,
         "friction.rest": {"mu_s": 3.0, "mu_k": 3.0}}, {}),
        ("half_angle 1e-6 rad, narrower than a step", {"zone.half_angle": 1e-6}, {}),
        ("half_angle 1e-15 rad", {"zone.half_angle": 1e-15}, {}),
        ("launch on the edge of a zone, outwards", on_edge | {"initial.omega": 16.0}, {}),
        ("launch on the edge of a zone, inwards", on_edge | {"initial.omega": -16.0}, {}),
        ("at rest on the edge of a zone", on_edge, {}),
        ("launch at 1e4 rad/s", {"initial.omega": 1e4}, {}),
        ("launch at 1e6 rad/s", {"initial.omega": 1e6}, {}),
        ("at rest on top, φ = π", {"initial.phi": pi, **still},
         {"check": "the contacts would have to pull", "expected": {"regime": REGIMES.index("separating"),
          "t_separation": 0.0}}),
        ("at equilibrium", still, {"check": "rests", "expected": _regime("resting", phi_end=0.0)}),
        ("drive amplitude 1e-12", {"drive.amplitude": 1e-12}, {}),
        ("drive amplitude 1e4 rad/s", {"drive.amplitude": 1e4}, {}),
        ("power law, exponent 1.1, θ'' infinite at t = 0", power | {"drive.amplitude": 2.0, "time.span": 2.0}, {}),
        ("span 1e-9 s", {"time.span": 1e-9}, {"check": "rests", "expected": _regime("resting", phi_end=0.0)}),
        ("span 1e4 s, amplitude 0.2 rad/s", {"time.span": 1e4, "drive.amplitude": 0.2}, {}),
        ("mass 1e-9 kg", {"body.mass": 1e-9}, {}),
        ("mass 1e9 kg", {"body.mass": 1e9}, {}),
        ("inertia 0", {"body.inertia": 0.0}, {}),
        ("inertia 1e6 kg m²", {"body.inertia": 1e6}, {}),
        ("all lengths times 1e-6", tiny, {}),
        ("radius 100 m (beta 0.25 mrad)", {"ring.radius": 100.0}, {}),
        ("beta 1e-6 rad", {"ring.radius": None, "body.beta": 1e-6}, {}),
        ("beta 89.999 deg", {"ring.radius": None, "body.beta": radians(89.999)}, {}),
        ("gravity 0, at rest", {"gravity": 0.0, **still},
         {"check": "no load at all", "expected": {"regime": REGIMES.index("separating"), "t_separation": 0.0}}),
        ("gravity 0, launched at 10 rad/s", {"gravity": 0.0, "initial.omega": 10.0}, {}),
        ("gravity 1e6 m/s²", {"gravity": 1e6, "time.span": 1.0}, {}),
    ]  # fmt: skip
    flat = {f"friction.{place}.mu_k": mu["mu_s"] for place, mu in (("rough", ROUGH), ("rest", REST))}
    found = [
        Extreme("v0 = 1e-9 m/s", changed(smooth, {"friction.v0": 1e-9})),
        Extreme("v0 = 1e-12 m/s", changed(smooth, {"friction.v0": 1e-12}), "limit v0 → 0 (tustin, event)",
                solver={"method": "event", "rtol": 1e-14}),
        Extreme("v0 = 1e3 m/s", changed(smooth, {"friction.v0": 1e3}), "rk4, 1e6 steps",
                solver={"method": "rk4", "steps": 1_000_000}),
        Extreme("v0 = 1e9 m/s", changed(smooth, {"friction.v0": 1e9}), "rk4, 1e6 steps",
                solver={"method": "rk4", "steps": 1_000_000}),
        Extreme("alpha = 0", changed(smooth, {"friction.alpha": 0.0}), "μk = μs", twin=changed(smooth, flat)),
        Extreme("alpha = 1e9 s/m", changed(smooth, {"friction.alpha": 1e9})),
    ]  # fmt: skip
    for law, scene in (("bengisu-akay", smooth), ("stiction", stick)):
        found += [Extreme(f"{law}: {name}", changed(scene, changes), **more) for name, changes, more in both]
    return found + _breakaways(stick) + _belts()


def _breakaways(stick: Mapping[str, Any]) -> list[Extreme]:
    """Stick at its limit, and a reaction that touches zero."""
    found = []
    # With one coefficient under both contacts the body stays at rest up to this angle.
    mu = 0.2
    repose = _root(lambda phi: _balances(phi, 0.0, mu, mu)[0], 0.0, 0.7)
    slope = {"zone.half_angle": 0.0, "drive.amplitude": 0.0, "friction.rest": {"mu_s": mu, "mu_k": 0.1}}
    for side, phi in (("below", repose - 1e-9), ("above", repose + 1e-9)):
        expected = _regime("resting", phi_end=phi) if side == "below" else {}
        scene = changed(stick, slope | {"initial.phi": phi})
        check = "balance of forces" if expected else "tighter"
        found.append(Extreme(f"stiction: at rest 1e-9 rad {side} the angle of repose", scene, check, expected))
    # Initial angular velocity, without friction, at which a reaction touches zero on the way up.
    touch = _root(_least_reaction, 1.0, 30.0)
    bare = {f"friction.{place}": {"mu_s": 0.0, "mu_k": 0.0} for place in ("rough", "rest")}
    for side, omega in (("below", touch * (1.0 - 1e-6)), ("above", touch * (1.0 + 1e-6))):
        expected = _regime("oscillatory") if side == "below" else _regime("separating", "resting", 2)
        scene = changed(stick, bare | {"drive.amplitude": 0.0, "initial.omega": omega})
        name = f"mu = 0: launch a millionth {side} the speed at which a reaction touches zero"
        found.append(Extreme(name, scene, "energy and balances", expected))
    return found


def _balances(phi: Any, omega: Any, K1: float, K2: float) -> tuple[Any, Any, Any]:
    """Angular acceleration and both reactions, from the balances of momentum, in closed form."""
    mass, sine, cosine = BODY["mass"], sin(BETA), cos(BETA)
    lever = mass * XI * RADIUS / ABOUT_AXIS - cosine
    a11, a12, b1 = cosine - K1 * sine, cosine + K2 * sine, mass * (GRAVITY * np.cos(phi) + XI * omega * omega)
    a21, a22 = K1 * lever - sine, K2 * lever + sine
    b2 = -mass * GRAVITY * np.sin(phi) * (1.0 - mass * XI * XI / ABOUT_AXIS)
    determinant = a11 * a22 - a12 * a21
    N1, N2 = (b1 * a22 - a12 * b2) / determinant, (a11 * b2 - a21 * b1) / determinant
    return (RADIUS * (K1 * N1 + K2 * N2) - mass * GRAVITY * XI * np.sin(phi)) / ABOUT_AXIS, N1, N2


def _root(falling: Callable[[float], float], low: float, high: float) -> float:
    """Zero of a falling function, by bisection."""
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if falling(middle) > 0.0 else (low, middle)
    return low


def _least_reaction(omega: float) -> float:
    """Least reaction of contact 2 on the way up from the bottom without friction, N."""
    own = BODY["mass"] * GRAVITY * XI / ABOUT_AXIS
    highest = np.arccos(max(-1.0, 1.0 - omega**2 / (2.0 * own)))
    way = highest * np.sin(np.linspace(0.0, 0.5 * pi, 20_001))
    speeds = np.sqrt(np.maximum(omega**2 - 2.0 * own * (1.0 - np.cos(way)), 0.0))
    return float(_balances(way, speeds, 0.0, 0.0)[2].min())


def _belts() -> list[Extreme]:
    """Extreme scenes of the paper's belt."""
    belt: dict[str, Any] = {
        "model": "belt",
        "body": {"mass": 1.0},
        "spring": {"stiffness": 2.0},
        "belt": {"velocity": 0.1},
        "friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.1},
        "time": {"span": 30.0},
        "gravity": GRAVITY,
    }
    lugre = {"law": "lugre", "mu_s": 0.15, "mu_k": 0.1, "sigma0": 1e5, "sigma1": sqrt(1e5), "sigma2": 0.1, "v_s": 1e-3}
    hold = 0.1 * GRAVITY
    fine = {"method": "implicit", "rtol": 1e-10}
    return [
        Extreme("belt: velocity 0, at rest", changed(belt, {"belt.velocity": 0.0}), "rests",
                expected={"regime": REGIMES.index("riding"), "x_end": 0.0}),
        Extreme("belt: spring 1e-6 N/m", changed(belt, {"spring.stiffness": 1e-6}), "x = v t, stuck",
                expected={"regime": REGIMES.index("riding"), "x_end": 3.0}),
        Extreme("belt: spring 1e9 N/m", changed(belt, {"spring.stiffness": 1e9, "time.span": 1e-3})),
        Extreme("belt: LuGre sigma0 = 1e5 N/m", changed(belt, {"friction": lugre}), solver=fine),
        Extreme("belt: LuGre sigma0 = 1e9 N/m", changed(belt, {"friction": {**lugre, "sigma0": 1e9, "sigma1": 3e4}}),
                solver=fine),
        Extreme("belt: grazing, μs = μk",
                changed(belt, {"friction.mu_s": 0.1, "time.span": 20.0}), "harmonic after breakaway",
                expected={"x_end": hold / 2.0 + 0.1 / sqrt(2.0) * np.sin(sqrt(2.0) * (20.0 - hold / 0.2))}),
    ]  # fmt: skip


_TIGHT = {"event": {"method": "event", "rtol": 1e-14}, "implicit": {"method": "implicit", "rtol": 1e-10}}


def _reference(extreme: Extreme) -> Mapping[str, Any]:
    """Expected outcomes of an extreme scene, from its closed form or from the checking run."""
    if extreme.expected:
        return extreme.expected
    smooth = extreme.scene["friction"]["law"] not in ("stiction", "coulomb", "tustin")
    solver = dict(extreme.solver or _TIGHT["implicit" if smooth else "event"])
    scene = extreme.twin or extreme.scene
    if solver["method"] == "event" and smooth:
        scene = changed(scene, {"friction.law": "tustin", "friction.v0": None})
    if solver["method"] != "rk4":
        solver["max_steps"] = 300_000
    names = "regime", "motion", "separating_contact", "t_separation", "phi_end", "x_end"
    found = run(scene, solver)
    return {name: found[name].item() for name in names if name in found}


def _said(found: xr.Dataset) -> str:
    regime, motion = REGIMES[int(found["regime"])], REGIMES[int(found["motion"])]
    contact = f" {int(found['separating_contact'])}" if regime == "separating" else ""
    return f"{regime}{contact}" + (f" ({motion})" if motion != regime else "")


def try_extremes() -> tuple[xr.Dataset, list[list[str]]]:
    """Run every extreme scene under `auto` and `rk4`; returns a dataset and the rows of a table."""
    chosen = extremes()
    classes = np.full((len(chosen), 2), -1, dtype=np.int8)
    numbers = {name: np.full((len(chosen), 2), np.nan) for name in ("certified", "steps", "seconds", "error")}
    lines = []
    for i, extreme in enumerate(chosen):
        reference = _reference(extreme)
        line = [extreme.name, extreme.check]
        for j, solver in enumerate(({"method": "auto", "max_steps": 300_000}, {"method": "rk4", "steps": 15_000})):
            begin = time.perf_counter()
            found = run(extreme.scene, solver)
            took = time.perf_counter() - begin
            classes[i, j] = classify(found, reference)
            values = float(found["certified"]), float(found["steps"]), took, float(difference(found, reference)[1])
            for name, value in zip(numbers, values, strict=True):
                numbers[name][i, j] = value
            line += [_said(found), "yes" if found["certified"] else "no", f"{int(found['steps'])}",
                     f"{took * 1e3:.0f}", CLASSES[classes[i, j]].replace("_", " ")]  # fmt: skip
            if j == 1:
                line.append(f"{float(found['stiffness']):.2g}")
        lines.append(line)
    dims = "extreme", "method"
    variables = {
        "extreme_class": (dims, classes, {"long_name": "class of the run", "units": "1",
                          "flag_values": np.arange(4, dtype=np.int8), "flag_meanings": " ".join(CLASSES)}),
        "extreme_certified": (dims, numbers["certified"].astype(np.int8), {"long_name": "certified", "units": "1"}),
        "extreme_steps": (dims, numbers["steps"].astype(np.int64), {"long_name": "steps", "units": "1"}),
        "extreme_seconds": (dims, numbers["seconds"], {"long_name": "time taken, first compilation included",
                            "units": "s"}),
        "extreme_error": (dims, numbers["error"] * CLOSE, {"long_name": "largest error against the reference",
                          "units": "1"}),
    }  # fmt: skip
    coords = {
        "extreme": ("extreme", [one.name for one in chosen], {"long_name": "what is extreme"}),
        "method": ("method", ["auto", "rk4"], {"long_name": "solver"}),
    }
    return xr.Dataset(variables, coords), lines


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
    parser = command(__doc__)
    parser.add_argument("--redraw", action="store_true", help="only draw the stored numbers again")
    given = parser.parse_args()
    folder = folder_of(given)
    if given.redraw:
        picture(xr.load_dataset(folder / "stability.nc"), maps(given.quick), folder / "stability.png")
        return
    begin = time.perf_counter()
    where = machine()
    print(where, flush=True)
    ds, chosen = draw_maps(given.quick)
    wild, lines = try_extremes()
    print(f"extremes: {time.perf_counter() - begin:.0f} s", flush=True)
    ds = ds.merge(wild)
    ds.attrs = {
        "Conventions": "CF-1.11",
        "title": "ringsweep: where solvers are right, flagged, silent or failed",
        "close": CLOSE,
        "machine": where,
    }
    netcdf.save(ds, folder / "stability.nc")
    picture(ds, chosen, folder / "stability.png")
    sections = [
        ("Maps", markdown(
            ["map", "runs", *(name.replace("_", " ") for name in CLASSES), "silent in kind",
             "certified beyond the limit", "reference uncertified"], counts(ds, chosen))),
        ("Extremes", markdown(
            ["extreme", "check", "auto", "certified", "steps", "ms", "class", "rk4, 15000 steps", "certified", "steps",
             "ms", "class", "λh"], lines)),
    ]  # fmt: skip
    text = f"Wrong: another regime, motion or contact, or an error of more than {CLOSE:g} rad or s.\n{REFERENCE}"
    text += "".join(f"\n## {title}\n\n{body}" for title, body in sections)
    print(text)
    classes = {one.name: ds[f"{one.name}_class"].values for one in chosen}
    silent = {method: sum(int((found == SILENT).sum()) for name, found in classes.items() if ("rk4" in name) == rk4)
              for method, rk4 in (("rk4", True), ("others", False))}  # fmt: skip
    figures = {"runs": str(sum(found.size for found in classes.values())), "silent_rk4": str(silent["rk4"])}
    figures |= {"silent_others": str(silent["others"]), "silent_in_kind": str(silent_in_kind(ds, chosen))}
    publish(given, "stability", "Numerical stability", where, text, figures)


if __name__ == "__main__":
    main()
