"""Random scenes of all features, and the relations between runs that hold for each of them without a reference.

A relation changes the numbers of a scene, and says how the outcomes change. Units come from the parameters of the
scene and from the variables of its dataset, so a new parameter or outcome takes part without an edit here. What has a
sign must stand in a table: :func:`parity` refuses a number that it does not know.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

import ringsweep
from ringsweep.config.own import TABLES, drive_type, force_type
from ringsweep.models import parameters
from ringsweep.models.scene import Structure
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import _parsed, _registry

Numbers = dict[str, Any]

#: Forces and drives by formulas, of which the clock may be set; the second one has no period.
CLOCKED = "amplitude*sin(2*pi*frequency*(t + shift) + phase)"
TWO_TONES = "amplitude*(sin(2*pi*frequency*t) + cos(2*pi*frequency*1.618033988749895*t + phase))"

#: A force and a drive that jump: the second one in its velocity.
SQUARE = "amplitude*(sign(sin(2*pi*frequency*(t + shift))) + max(0, sin(2*pi*frequency*(t + shift) + phase)))"
BOUNCING = "amplitude*abs(sin(pi*frequency*(t + shift)))"

FORMULAS = {"clocked": CLOCKED, "two-tones": TWO_TONES, "square": SQUARE, "bouncing": BOUNCING}

_TIMES = np.linspace(0.0, 32.0, 41)
_COURSE = 0.4 * np.sin(1.3 * _TIMES) + 0.15 * np.sin(3.1 * _TIMES + 0.7) - 0.15 * np.sin(0.7)


@dataclass(frozen=True)
class Kind:
    """Scenes that share one compiled kernel.

    Attributes
    ----------
    model, law, drive : str
        As in a scene; the drives `clocked`, `two-tones` and `bouncing` are formulas.
    arcs : int
        Zones; one alone is the section ``zone``.
    force : str
        ``harmonic``, ``constant``, ``clocked``, ``two-tones``, ``square``, ``table``, or none.
    parts : tuple of str
        Optional parameters that the scenes give.
    impact : bool
        On a belt: whether it has stops.
    solver, record : str or mapping
    span : tuple of float
        Least and greatest span, s.
    fixed : mapping of str to float
        Numbers that all cells share, by path.
    two_way : tuple of str
        Paths of the friction coefficients that depend on the direction of sliding.
    load : bool
        Whether the normal load varies in time.
    frame : str
        Frame of the zones of a belt.
    """

    model: str
    law: str
    drive: str = "none"
    arcs: int = 0
    force: str = ""
    parts: tuple[str, ...] = ()
    impact: bool = False
    solver: Any = "auto"
    record: Any = None
    span: tuple[float, float] = (0.2, 3.0)
    fixed: Mapping[str, float] = field(default_factory=dict)
    two_way: tuple[str, ...] = ()
    load: bool = False
    frame: str = "belt"

    @property
    def scene(self) -> dict[str, Any]:
        """The scene without its numbers."""
        found: dict[str, Any] = {"model": self.model, "friction": {"law": self.law}}
        if self.drive != "none":
            found["drive"] = {"law": self.drive}
        if formula := FORMULAS.get(self.drive):
            found["drive"] = {"law": "formula", "theta": formula}
        if self.drive == "table":
            found["drive"] |= {"time": _TIMES.tolist(), "theta": _COURSE.tolist()}
        if formula := FORMULAS.get(self.force):
            found["force"] = {"formula": formula}
        if self.load:
            found["body"] = {"load": {"formula": CLOCKED}}
        if self.frame != "belt":
            found["friction"]["frame"] = self.frame
        if self.force == "table":
            found["force"] = {"time": _TIMES.tolist(), "force": (4.0 * _COURSE).tolist()}
        if self.arcs:
            found |= {"zone": {}} if self.arcs == 1 else {"zones": [{} for _ in range(self.arcs)]}
        return found | ({"stops" if self.model == "belt" else "impact": {}} if self.impact else {})

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Parameters of the scenes, by path."""
        scene = self.scene
        arcs = ("zone",) if self.arcs == 1 else tuple(f"zones.{i}" for i in range(self.arcs))
        structure = Structure(
            self.model,
            self.law,
            self.drive if "law" not in scene.get("drive", {}) else scene["drive"]["law"],
            arcs,
            impact=self.impact,
            own_drive=drive_type(self.model, scene.get("drive", {})),
            own_force=force_type(scene.get("force")),
            own_load=force_type(scene["body"]["load"], "body.load") if self.load else None,
            force=(_TIMES, _COURSE) if self.force == "table" else None,
            two_way=self.two_way,
            frame=self.frame,
        )
        of_force = {"harmonic": ("amplitude", "frequency", "phase"), "constant": ("constant",)}.get(self.force, ())
        given = {*self.parts, *(f"force.{name}" for name in of_force)}
        given |= {"ring.radius"} if self.model == "ring" else set()
        given |= {"initial.velocity"} if self.model == "belt" else set()
        given |= {"stops.low", "stops.high"} if self.model == "belt" and self.impact else set()
        given |= {"belt.velocity"} if self.model == "belt" and self.drive == "none" else set()
        return {path: p for path, p in parameters(structure).items() if not p.optional or path in given}


@dataclass(frozen=True)
class Run:
    """Cells of a kind: their numbers by path, of shape ``(cells,)``, and the scene without them."""

    kind: Kind
    numbers: Numbers
    scene: dict[str, Any]

    def outcomes(self, **options: Any) -> xr.Dataset:
        """Outcomes along the dimension ``cell``."""
        axes = {path: xr.DataArray(column, dims="cell") for path, column in self.numbers.items()}
        own = {"solver": self.kind.solver, "record": self.kind.record, "jobs": 1, "progress": False}
        return ringsweep.sweep(self.scene, axes, **(own | options))


def placed(run: Run, cell: int, *without: str) -> dict[str, Any]:
    """The scene of one cell, with its numbers except those at the paths `without`."""
    scene = deepcopy(run.scene)
    for path, column in run.numbers.items():
        *sections, name = path.split(".")
        place = scene
        for section in sections:
            place = place[int(section)] if isinstance(place, list) else place.setdefault(section, {})
        if path not in without:
            place[name] = float(column[cell])
    return scene


# ---- random scenes ---------------------------------------------------------------------------

#: Least and greatest magnitude of a number, in SI units, by the end of its path, with or without the model before it;
#: the first that fits counts. The logarithms of the numbers are uniform. Numbers that may be negative have either sign.
MAGNITUDES: dict[str, tuple[float, float]] = {
    r"gravity": (9.81, 9.81),
    r"classify.epsilon_omega": (1e-3, 1e-3),
    r"belt body.mass": (0.3, 3.0),
    r"belt spring.stiffness": (1.0, 30.0),
    r"spring.cubic": (0.1, 30.0),
    r"damper.coefficient|friction.viscous": (0.01, 0.5),
    r"body.normal_stiffness": (0.1, 3.0),
    r"belt drive.amplitude": (0.005, 0.5),
    r"belt.velocity": (0.01, 1.0),
    r"belt (drive|force|body.load).frequency": (0.1, 2.0),
    r"body.load.amplitude": (0.1, 3.0),
    r"force.(amplitude|constant)": (0.2, 8.0),
    r"belt.incline": (0.01, 1.0),
    r"initial.x|initial.velocity": (0.05, 1.0),
    r"initial.deflection": (1e-7, 1e-6),
    r"ring\S* body.mass": (0.02, 0.5),
    r"drive.frequency": (0.3, 5.0),
    r"drive.exponent": (1.05, 3.0),
    r"phase|center": (0.05, np.pi),
    r"half_angle": (0.02, np.pi),
    r"initial.phi": (0.01, 3.0),
    r"initial.omega": (0.1, 60.0),
    r"drive.amplitude": (0.1, 20.0),
    r"ring.radius": (0.03, 0.2),
    r"mu_[sk](.\w+)?": (0.02, 0.5),
    r"mu0": (0.2, 0.8),
    r"friction.[ab]": (3e-3, 0.05),
    r"critical_distance": (1e-5, 1e-3),
    r"reference_velocity": (1e-6, 1e-3),
    r"contact_age": (1e-3, 10.0),
    r"alpha": (1.0, 1e4),
    r"delta": (0.1, 100.0),
    r"k_t": (1.0, 1e4),
    r"v_[st]": (1e-3, 0.1),
    r"v[01]": (1e-5, 0.1),
    r"dead_band": (1e-4, 1e-2),
    r"belt friction.sigma0": (100.0, 3e4),
    r"belt friction.sigma1": (0.1, 10.0),
    r"belt friction.sigma2": (0.01, 0.5),
    r"sigma0": (30.0, 1e4),
    r"sigma1": (0.01, 5.0),
    r"sigma2": (0.001, 0.05),
    r"elastic_fraction": (0.3, 0.95),
    r"seed": (1.0, 1.0),
    r"restitution": (0.1, 0.95),
    r"stops.(low|high)": (0.03, 1.0),
    r"belt.period": (1.0, 3.0),
    r"half_length": (0.02, 0.5),
    r"shift": (0.01, 1.0),
}

#: Shares of the cells in which a number is 0.
NOUGHT = {
    r"initial.(x|phi|omega|velocity|deflection)": 0.3,
    r"half_angle": 0.05,
    r"center": 0.1,
    r"phase": 0.2,
    r"center_offset": 0.5,
    r"restitution": 0.1,
    r"sigma[12]": 0.2,
}


def _first(table: Mapping[str, Any], key: str, otherwise: Any) -> Any:
    return next((value for pattern, value in table.items() if re.search(rf"(^|[ .])({pattern})$", key)), otherwise)


def random_scenes(kind: Kind, count: int, rng: np.random.Generator) -> Run:
    """Random cells of a kind."""
    numbers: Numbers = {}
    for path, parameter in kind.parameters.items():
        key = f"{kind.model} {path}"
        low, high = kind.span if path == "time.span" else _first(MAGNITUDES, key, (0.1, 1.0))
        column = np.exp(rng.uniform(np.log(low), np.log(high), count))
        if parameter.lower < 0.0 and path != "spring.cubic":
            column *= rng.choice([-1.0, 1.0], count)
        column[rng.random(count) < _first(NOUGHT, key, 0.0)] = 0.0
        numbers[path] = column
    # What one number of a scene asks of another.
    for path in numbers:
        if "mu_s" in path:
            numbers[path] = numbers[path.replace("mu_s", "mu_k")] + rng.choice([0.0, 1.0, 1.0], count) * numbers[path]
    if "friction.v1" in numbers:
        numbers["friction.v1"] += numbers["friction.v0"]
    if kind.model == "ring":
        reach = numbers["ring.radius"] * rng.uniform(0.6, 0.95, count)
        beta = np.radians(rng.uniform(10.0, 80.0, count))
        half = reach * np.sin(beta)
        numbers["body.ball_radius"], numbers["body.half_distance"] = numbers["ring.radius"] - reach, half
        numbers["body.ball_radius"] = np.minimum(numbers["body.ball_radius"], 0.999 * (numbers["ring.radius"] - half))
        numbers["body.inertia"] = numbers["body.mass"] * (half * rng.uniform(0.4, 1.3, count)) ** 2
        numbers["body.center_offset"] *= 0.3 * reach * np.cos(beta)
    if "friction.dead_band" in numbers and "friction.viscous" in numbers:
        drop = (numbers["friction.mu_s"] - numbers["friction.mu_k"]) * numbers["body.mass"] * numbers["gravity"]
        numbers["friction.viscous"] = np.minimum(
            numbers["friction.viscous"], 0.9 * drop / numbers["friction.dead_band"]
        )
    if "stops.low" in numbers:
        low, high = (abs(numbers[f"stops.{name}"]) for name in ("low", "high"))
        numbers["stops.low"], numbers["stops.high"] = -low, high
        numbers["initial.x"] = np.clip(numbers["initial.x"], -low, high)
    # Half of the bodies that are launched at rest in space are launched at rest on the belt or ring.
    if kind.model == "belt" and "belt.velocity" in numbers:
        numbers["initial.velocity"] = np.where(
            rng.random(count) < 0.4, numbers["belt.velocity"], numbers["initial.velocity"]
        )
    numbers |= {path: np.full(count, value) for path, value in kind.fixed.items()}
    return Run(kind, numbers, kind.scene)


# ---- change of units --------------------------------------------------------------------------


def powers(unit: str) -> dict[str, float]:
    """Powers of mass, length and time in a unit; angles have none."""
    found = _registry().Quantity(1.0, _parsed(unit)).dimensionality if unit not in ("", "1") else {}
    return {name: float(found.get(f"[{name}]", 0.0)) for name in ("mass", "length", "time")}


def factor(unit: str, scales: Mapping[str, float]) -> float:
    """Factor on numbers in `unit` if numbers of mass, length and time are multiplied by `scales`."""
    return float(np.prod([scales.get(name, 1.0) ** power for name, power in powers(unit).items()]))


def in_units(run: Run, **scales: float) -> Run:
    """The same cells in other units: all numbers of mass, length and time are multiplied by `scales`."""
    numbers = {}
    for path, parameter in run.kind.parameters.items():
        by: Any = factor(parameter.unit, scales)
        if parameter.unit_in_words and path == "drive.amplitude":
            length = scales.get("length", 1.0) if run.kind.model == "belt" else 1.0
            by = length * scales.get("time", 1.0) ** -run.numbers["drive.exponent"]
        numbers[path] = by * run.numbers[path]
    return Run(run.kind, numbers, _with_tables(run, lambda unit, column: factor(unit, scales) * column))


def _with_tables(run: Run, change: Callable[[str, np.ndarray], np.ndarray]) -> dict[str, Any]:
    """The scene of a run with changed columns of its tables."""
    scene = dict(run.scene)
    for section, columns in TABLES.items():
        given = scene.get(section, {})
        for name, parameter in columns.items():
            if isinstance(given.get(name), list):
                # Angles of a drive are displacements of a belt.
                unit = "m" if (run.kind.model, parameter.unit) == ("belt", "rad") else parameter.unit
                given = given | {name: change(unit, np.array(given[name])).tolist()}
        if given:
            scene[section] = given
    return scene


# ---- mirror image -----------------------------------------------------------------------------

#: Numbers of a scene that may be negative, by the end of their paths: -1 if they change their sign in a mirror image.
#: A center_offset lies along the line of symmetry.
PARITY = {
    r"belt.(velocity|incline)|initial.(x|velocity|deflection|phi|omega)": -1,
    r"center|(drive|force).(amplitude|constant)": -1,
    r"body.normal_stiffness|stops.(low|high)": -1,
    r"spring.cubic|phase|body.center_offset|shift|frequency|body.load.amplitude": 1,
}

#: Outcomes that change their sign; extremes change places besides.
ODD = r"(x|phi|velocity|omega|deflection(_[12])?)_(end|min|max|section)|drift"

#: Outcomes that a mirror image does not tell: it would need the least velocity, or turns at the other side.
_UNTOLD = r"velocity_max.*"


def parity(path: str, parameter: Parameter) -> int:
    """Factor on a number of a scene in a mirror image."""
    if parameter.lower >= 0.0:
        return 1
    found = _first(PARITY, path, None)
    assert found is not None, f"{path} may be negative: does it change its sign in a mirror image?"
    return int(found)


def mirrored(run: Run) -> Run:
    """The mirror image of cells: forwards and backwards are exchanged."""
    other = {"stops.low": "stops.high", "stops.high": "stops.low"}
    numbers = {path: parity(path, p) * run.numbers[other.get(path, path)] for path, p in run.kind.parameters.items()}
    for path in run.kind.two_way:
        numbers[f"{path}.forward"], numbers[f"{path}.backward"] = (
            numbers[f"{path}.backward"],
            numbers[f"{path}.forward"],
        )
    return Run(run.kind, numbers, run.scene)


def mirror_of(ds: xr.Dataset) -> xr.Dataset:
    """Outcomes as the mirror image has them: left and right, and the contacts, are exchanged."""
    found = {}
    for name in map(str, ds.data_vars):
        other, odd = name, re.match(ODD, name)
        if not name.startswith("multiplier"):
            other = re.sub(r"_([12])(?=$|_)", lambda found: f"_{3 - int(found[1])}", name)
        if odd:
            other = re.sub("_(min|max)", lambda found: {"_min": "_max", "_max": "_min"}[found[0]], other)
        if other in ds and not re.match(_UNTOLD, name):
            found[name] = -ds[other] if odd and not name.endswith("_error") else ds[other]
    if "normal_min_2" in found:
        contact = found["separating_contact"]
        found["separating_contact"] = contact.copy(data=np.array([0, 2, 1, 3])[contact.values])
    return xr.Dataset(found)


# ---- other relations --------------------------------------------------------------------------


def later(run: Run, turns: int) -> Run:
    """The same cells, launched so many periods of the forcing later: of force, drive and load, each of its own."""
    numbers = dict(run.numbers)
    for part in ("drive", "force", "body.load"):
        if f"{part}.shift" in numbers:
            numbers[f"{part}.shift"] = numbers[f"{part}.shift"] + turns / numbers[f"{part}.frequency"]
        elif f"{part}.phase" in numbers:
            numbers[f"{part}.phase"] = numbers[f"{part}.phase"] + 2.0 * np.pi * turns
    return Run(run.kind, numbers, run.scene)


def in_order(run: Run, order: np.ndarray) -> Run:
    """Cells of a run in another order, or some of them."""
    return Run(run.kind, {path: column[order] for path, column in run.numbers.items()}, run.scene)


# ---- comparison -------------------------------------------------------------------------------

#: What is said of a run beside its outcomes. It may depend on the resolution that a certificate asked for.
EFFORT = ("steps", "stiffness", "uncertified_because")


def in_first_units(ds: xr.Dataset, scales: Mapping[str, float]) -> xr.Dataset:
    """Outcomes of cells in other units, in the first ones."""
    return ds.map(lambda data: data / factor(data.attrs.get("units", "1"), scales), keep_attrs=True)


def sure(*runs: xr.Dataset) -> np.ndarray:
    """Cells that are certified in all runs."""
    return np.logical_and.reduce([ds.certified.values == 1 for ds in runs])


def differing(first: xr.Dataset, second: xr.Dataset) -> dict[str, np.ndarray]:
    """Cells, certified in both runs, whose outcomes differ: words at all, numbers by more than threefold bounds.

    Numbers without a bound may differ by a millionth of the greatest of their unit in the cell, or by ten times the
    bounds on the others. Where nearby runs diverge, so that the end has no bound, words alone are compared.
    """
    cells = sure(first, second)
    names = [str(name) for name in first.data_vars if name in second and name not in EFFORT]
    bounds = {name: 3.0 * (first[name] + second[name]).values for name in names if name.endswith("_error")}
    largest: dict[str, Any] = {}
    for name in names:
        if first[name].dtype == "float64":
            sizes = np.nan_to_num(abs(first[name].values), posinf=0.0).reshape(len(cells), -1).max(axis=1)
            largest[first[name].units] = np.maximum(largest.get(first[name].units, 1e-300), sizes)
    shares = [bound / largest[first[name].units] for name, bound in bounds.items()]
    loose = 1e-6 + 10.0 * np.nan_to_num(shares).max(axis=0)
    steady = np.isfinite([bound for name, bound in bounds.items() if name in ("x_end_error", "phi_end_error")]).all(0)
    found = {}
    for name in names:
        data, one, other = first[name], first[name].values.T, second[name].values.T
        wrong = (one != other) & ~((one != one) & (other != other))
        if data.dtype == "float64":
            bound = bounds.get(f"{name}_error", loose * largest[data.units]) + 1e-12 * abs(one)
            with np.errstate(invalid="ignore"):
                # Where the bound alone is missing, they need not agree.
                wrong &= ~(abs(one - other) <= bound) & ~(np.isnan(bound) & np.isfinite(one) & np.isfinite(other))
        if "flag_values" not in data.attrs:
            wrong &= steady
        wrong = wrong.reshape(-1, len(cells)).any(axis=0) & cells
        if wrong.any() and name not in bounds:
            found[name] = np.flatnonzero(wrong)
    return found


def unequal(first: xr.Dataset, second: xr.Dataset) -> dict[str, np.ndarray]:
    """Cells whose outcomes differ in a bit."""
    found = {}
    for name, data in first.data_vars.items():
        one, other = data.values, second[name].values
        same = (one == other) | ((one != one) & (other != other))
        if not same.all():
            found[str(name)] = np.flatnonzero(~same.reshape(len(same), -1).all(axis=1))
    return found
