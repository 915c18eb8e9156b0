"""The belt as a model: its parameters and its cells.

Nothing here runs in kernels. `structure` says which parts a scene has, `values` are its numbers in SI units by path,
of shape ``(cells,)``; see :mod:`ringsweep.models.scene`.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from math import inf
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ringsweep.compile import take
from ringsweep.errors import InputError
from ringsweep.models import section, tangent
from ringsweep.models.belt.force import coefficients
from ringsweep.models.belt.record import Outcome
from ringsweep.models.interface.variation import Exponent
from ringsweep.models.model import Continues, Model, period_of, phases
from ringsweep.models.parts import (
    GRAVITY,
    MASS,
    SPAN,
    by_formula,
    drive_of,
    law_of,
    surface_from,
    table_of,
    zone_parameters,
)
from ringsweep.models.scene import Structure, Values, require
from ringsweep.physics import belt, drives, forces, friction, ring, zones
from ringsweep.physics.friction.presliding import bristle, steady_deflection
from ringsweep.physics.friction.velocity import KINETIC, friction_at
from ringsweep.physics.functions_of_time import common_period
from ringsweep.quantities.parameters import Parameter, declared
from ringsweep.quantities.variables import Variable

# Relative error of a deflection at the loosest tolerance.
_LOOSEST = 1e-3

_INCLINE = Parameter(
    "rad",
    "angle by which the belt rises towards growing x (default: 0)",
    lower=-np.pi / 2.0,
    upper=np.pi / 2.0,
    open_lower=True,
    open_upper=True,
    optional=True,
)

_PERIOD = Parameter("m", "length of the belt after which its zones repeat", lower=0.0, open_lower=True, optional=True)

# Optional fields of the body, by path.
_OPTIONAL = {
    "cubic": "spring.cubic",
    "damping": "damper.coefficient",
    "normal_stiffness": "body.normal_stiffness",
}

# Beginnings of the paths of a load that varies.
_LOADS = "body.normal_stiffness", "body.load."


class Belt(Model, Continues):
    """A mass on a spring on a moving belt (the paper's Fig. 1)."""

    name: ClassVar[str] = "belt"
    ends: ClassVar[tuple[str, ...]] = ("x_end", "velocity_end")
    doc: ClassVar[str] = "a mass on a spring on a moving belt"
    reference: ClassVar[str] = (
        "K. Popp, P. Stelter, Stick-slip vibrations and chaos, Philosophical Transactions of the Royal Society A 332, "
        "89-105 (1990)"
    )
    outcomes: ClassVar[tuple[str, ...]] = Outcome._fields
    place: ClassVar[str] = "x"
    driven: ClassVar[tuple[str, ...]] = ("belt_x", "belt_velocity")
    drive_unit: ClassVar[str] = "m"
    own_variables: ClassVar[dict[str, Variable]] = {
        "jump_max": Variable("m/s^2", "largest jump of the acceleration of the body"),
        "zone_1": Variable("1", "zone under the body", dtype="int32"),
    }

    has_exponent: ClassVar[bool] = True
    sections: ClassVar[tuple[str, ...]] = "period", "turn"

    def columns(self, structure: Structure) -> tuple[str, ...]:
        """Outcomes, and after them exponent and multipliers, the deflection of bristles, the points of the section."""
        exponent = tangent.OUTCOMES if structure.exponent else ()
        law = friction.TRAITS[structure.law_type]
        memory = (f"{law.state}_end",) if law.family is friction.Dynamic else ()
        return (*self.outcomes, *exponent, *memory, *section.columns(structure.section, _point(structure)))

    def continued(self, structure: Structure, values: Values, ended: Values) -> dict[str, NDArray[np.float64]]:
        """Displacement, velocity, deflection and phases at the end of other runs.

        Bristles are not longer than those that start can be.
        """
        found = {"initial.x": ended["x_end"], "initial.velocity": ended["velocity_end"]}
        if "initial.deflection" in values:
            low, high = _extreme_deflections(structure, _on_incline(values))
            found["initial.deflection"] = np.clip(ended["deflection_end"], low, high)
        if friction.TRAITS[structure.law_type].state == "contact_age" and "contact_age_end" in ended:
            found["initial.contact_age"] = ended["contact_age_end"]
        return found | phases(("force", "drive"), values, ended)

    def obstacle(self, structure: Structure) -> str | None:
        """Why runs of this structure cannot go on: steady slip is a start of its own."""
        return "cannot stand beside initial.steady, which gives the start: leave one out" if structure.steady else None

    def forcing_period(self, structure: Structure, values: Values) -> NDArray[np.float64]:
        """Period of drive and force, s; infinite if there is none."""
        return np.asarray(self.build(structure, values).forcing_period)

    def regimes(self, paths: Collection[str]) -> tuple[str, ...]:
        """Regimes that runs can have; only a load that varies can fall to zero."""
        lost = ("separating",) if any(path.startswith(_LOADS) for path in paths) else ()
        return "stick-slip", "oscillatory", "sliding", "sticking", "riding", *lost, "failed"

    def scene_type(self, structure: Structure) -> type:
        """``BristleBelt`` for laws with bristles, else ``Belt``."""
        return belt.BristleBelt if friction.family_of(structure.law_type) is friction.Dynamic else belt.Belt

    def history(self, structure: Structure) -> tuple[str, ...]:
        """Names of the history variables, in the order of their columns."""
        names = "x", "velocity", "friction_force", friction.TRAITS[structure.law_type].state, "mode"
        return (*names, "zone_1") if structure.arcs else names

    def parameters(self, structure: Structure) -> dict[str, Parameter]:
        """Parameters of a scene of this structure, by path."""
        law = structure.law_type
        found = {
            "body.mass": MASS,
            "body.normal_stiffness": Parameter(
                "N/m", "growth of the normal reaction with the displacement (default: 0)", optional=True
            ),
            "spring.stiffness": Parameter("N/m", "stiffness of the spring, 0 without one", lower=0.0),
            "spring.cubic": Parameter("N/m^3", "cubic stiffness of the spring (default: 0)", optional=True),
            "damper.coefficient": Parameter(
                "N s/m", "coefficient of the damper to the wall (default: 0)", lower=0.0, optional=True
            ),
            "belt.velocity": Parameter("m/s", "velocity of the belt", optional=True),
            "belt.incline": _INCLINE,
        }
        if structure.arcs:
            found |= zone_parameters(structure, zones.Stretch, "the rest")
            if structure.frame == "belt":
                found["belt.period"] = _PERIOD
        else:
            found |= {f"friction.{name}": p for name, p in friction.coefficients_of(law).items()}
        for name, p in declared(law).items():
            # Laws have stiffness and damping of the bristles per unit of load; a belt scene has them in N/m and N s/m.
            per_load = name.startswith("sigma") and friction.family_of(law) is friction.Dynamic
            absolute = {"1/m": "N/m", "s/m": "N s/m"} if per_load else {}
            found[f"friction.{name}"] = replace(p, unit=absolute.get(p.unit, p.unit))
        if friction.family_of(law) is not friction.Dynamic:
            found["friction.viscous"] = Parameter("N s/m", "viscous friction (default: 0)", lower=0.0, optional=True)
        for name, p in declared(structure.drive_type).items():
            found[f"drive.{name}"] = _along_a_line(name, p) if structure.own_drive is None else p
        found["force.constant"] = forces.CONSTANT
        if structure.own_load is not None:
            for name, p in declared(structure.own_load).items():
                found[f"body.load.{name}"] = replace(p, long_name=f"parameter {name} of the load")
        elif structure.load is not None:
            found["body.load.amplitude"] = replace(forces.FACTOR, long_name="factor on the load of the table")
        if structure.own_force is not None:
            found |= {f"force.{name}": p for name, p in declared(structure.own_force).items()}
        elif structure.force is None:
            found |= {"force.amplitude": forces.AMPLITUDE, "force.frequency": forces.FREQUENCY}
            found["force.phase"] = forces.PHASE
        else:
            found["force.amplitude"] = forces.FACTOR
        return found | self._launch(structure) | {"time.span": SPAN, "gravity": GRAVITY}

    def _launch(self, structure: Structure) -> dict[str, Parameter]:
        """Numbers of the state at the launch: none at steady slip."""
        if structure.steady:
            return {}
        return {
            "initial.x": Parameter("m", "displacement of the body at the start", default=0.0),
            "initial.velocity": Parameter(
                "m/s", "velocity of the body at the start (default: that of the belt)", optional=True
            ),
            **self._initial_state(structure),
        }

    def _initial_state(self, structure: Structure) -> dict[str, Parameter]:
        """The initial deflection or age, if the law has one that describes its state."""
        law = structure.law_type
        if friction.family_of(law) is not friction.Dynamic or friction.TRAITS[law].snaps:
            return {}
        if friction.TRAITS[law].state == "contact_age":
            about = "age of the contacts at the start (default: that of steady sliding at the initial speed)"
            return {"initial.contact_age": Parameter("s", about, lower=0.0, open_lower=True, optional=True)}
        return {"initial.deflection": Parameter("m", "deflection of the bristles at the start", default=0.0)}

    def build(self, structure: Structure, values: Values) -> belt.Belt | belt.BristleBelt:
        """Cells that kernels run over; see :meth:`ringsweep.models.model.Model.build`."""
        values = _on_incline(values)
        law = structure.law_type
        surface, surfaces = _surface(structure, values)
        mu_s, mu_k = zones.roughest(surface)
        drive = self._drive(structure, values)
        sliding = np.zeros(len(values["time.span"]))
        if "initial.velocity" in values:
            launched = values["initial.velocity"]
            sliding = np.array([drives.relative_velocity(take(drive, i), v) for i, v in enumerate(launched)])
        mass, gravity = values["body.mass"], values["gravity"]
        forced = self._with_force(drive, structure, values)
        parts = {name: values[path] for name, path in _OPTIONAL.items() if path in values}
        if structure.own_load is not None or structure.load is not None:
            forced, parts["load"] = _with_load(forced, structure, values)
        acts = {"force"} if forced is not drive or "friction.viscous" in values else set()
        kind: Any = ring.variant(belt.OnBelt, {*_OPTIONAL, "load", "force"} - {*parts, *acts})
        fields: dict[str, Any] = {
            "body": ring.completed(kind(mass, gravity, values["spring.stiffness"], **parts, constants=())),
            "mu_s": mu_s,
            "mu_k": mu_k,
            "drive": forced,
            "initial_x": values.get("initial.x", np.zeros(len(mass))),
            "initial_v": sliding,
            "span": values["time.span"],
            "surface": surface if structure.arcs else (),
        }
        # A section may state a period of its own.
        period = np.broadcast_to(drives.period(forced), mass.shape)
        if structure.arcs and structure.frame == "belt":
            period = _among_zones(values, drive, forced, period)
        if structure.section is not None or not isinstance(forced, drives.Constant) or period.any():
            fields["excited"] = belt.Excited()
        if structure.section is not None:
            fields["section"] = section.field(structure.section, _point(structure), len(mass))
        fields |= _periods(structure, values, period)
        if structure.exponent:
            rate = 2.0 * np.pi / np.minimum(fields["forcing_period"], values["time.span"])
            natural = np.sqrt(abs(values["spring.stiffness"]) / mass)
            fields["asked"] = Exponent.of(np.maximum(natural, rate), int(friction.family_of(law) is friction.Dynamic))
        # Without a spring the motion has no speed of its own.
        stiffness = values["spring.stiffness"]
        largest = np.max([static for static, _ in surfaces], axis=0)
        speed = largest * gravity * np.sqrt(np.divide(mass, stiffness, out=np.zeros_like(mass), where=stiffness > 0.0))
        fields["viscous"] = values.get("friction.viscous", np.zeros(len(mass)))
        if friction.family_of(law) is not friction.Dynamic:
            viscous, load = fields["viscous"], mass * gravity
            for static, kinetic in surfaces if friction.TRAITS[law].dead_band else ():
                require(
                    kinetic * load + viscous * values["friction.dead_band"] <= static * load,
                    "friction.viscous",
                    viscous,
                    "{} N s/m is too large: friction at the edge of the dead band exceeds friction within it",
                )
            scene = belt.Belt(**fields, law=law_of(structure, values, surfaces, speed))
            return _at_steady_slip(structure, values, scene) if structure.steady else scene
        require(gravity > 0.0, "gravity", gravity, "{} m/s^2 is not allowed: a law with a memory needs a load")
        per_load = {
            path: value / (mass * gravity) for path, value in values.items() if path.startswith("friction.sigma")
        }
        deflection = values.get("initial.deflection", np.zeros(len(mass)))
        if deflection.any():
            low, high = _extreme_deflections(structure, values)
            for bound, side in ((low, -1.0), (high, 1.0)):
                beyond = np.flatnonzero(side * (deflection - bound * (1.0 + _LOOSEST)) > 0.0)
                if len(beyond):
                    given, limit = deflection[beyond[0]], bound[beyond[0]]
                    problem = f"{given:.6g} m is not allowed: friction at rest holds bristles up to {limit:.6g} m"
                    raise InputError("scene.initial.deflection", problem)
            # A run may end beyond the limit by its error.
            deflection = np.clip(deflection, low, high)
        fields["initial_z"] = deflection
        if friction.TRAITS[law].state == "contact_age":
            speed_0, distance = values["friction.reference_velocity"], values["friction.critical_distance"]
            # No age is steady at rest: there the contacts have that of the reference velocity.
            steady = distance / np.where(sliding == 0.0, speed_0, abs(sliding))
            fields["initial_z"] = np.log(speed_0 * values.get("initial.contact_age", steady) / distance)
        scene = belt.BristleBelt(**fields, law=law_of(structure, {**values, **per_load}, surfaces, speed))
        return _at_steady_slip(structure, values, scene) if structure.steady else scene

    def _drive(self, structure: Structure, values: Values) -> Any:
        """Drive of the belt, from ``belt.velocity`` or from ``drive``."""
        has_velocity = "belt.velocity" in values
        if has_velocity == (structure.drive != "none"):
            what = (
                "given together with drive: give only one of them"
                if has_velocity
                else "missing: give it, or give a drive"
            )
            raise InputError("scene.belt.velocity", what)
        if has_velocity:
            return drives.Constant(values["belt.velocity"])
        if friction.TRAITS[structure.law_type].dead_band and structure.drive != "constant":
            raise InputError("scene.drive", f"the dead band of law {structure.law} needs a belt of constant velocity")
        return drive_of(structure, values)

    def _with_force(self, drive: Any, structure: Structure, values: Values) -> Any:
        """Drive with the force on the body, if the scene has one."""
        given = [name for name in ("amplitude", "frequency", "phase") if f"force.{name}" in values]
        zero = np.zeros(len(values["time.span"]))
        constant = values.get("force.constant", zero)
        if structure.force is not None or structure.own_force is not None:
            force, ends = _given(structure.force, structure.own_force, "force", values)
            largest = abs(ends).max(axis=0)
        elif given:
            for name, example in (("amplitude", "1 N"), ("frequency", "1 Hz")):
                if name not in given:
                    problem = f"missing: a force with {given[0]} needs it (for example `{name}: {example}`)"
                    raise InputError(f"scene.force.{name}", problem)
            amplitude = values["force.amplitude"]
            force = drives.Sinusoidal(amplitude, values["force.frequency"], values.get("force.phase", zero))
            largest = abs(amplitude)
        elif "force.constant" in values:
            force, largest = drives.Still(), zero
        else:
            return drive
        return forces.Forced(drive, force, constant, abs(constant) + largest)


def _on_incline(values: Values) -> Values:
    """Values of a level belt on which the body moves alike: gravity presses it less, and pulls it along the belt."""
    if "belt.incline" not in values:
        return values
    gravity, incline = values["gravity"], values["belt.incline"]
    force = values.get("force.constant", 0.0) - values["body.mass"] * gravity * np.sin(incline)
    return {**values, "gravity": gravity * np.cos(incline), "force.constant": force}


def _at_steady_slip(structure: Structure, values: Values, scene: Any) -> Any:
    """Cells whose body rests in space, where friction balances the spring and the forces that do not vary."""
    where, law = "initial.steady", structure.law_type
    velocity = _constant_velocity(values)
    if structure.drive not in ("none", "constant") or velocity is None:
        raise InputError(f"scene.{where}", "needs a belt of constant velocity: give belt.velocity")
    if structure.own_load is not None or structure.load is not None:
        raise InputError(f"scene.{where}", "needs a normal load that does not vary in time: leave body.load out")
    bristles = friction.family_of(law) is friction.Dynamic
    if bristles and (friction.TRAITS[law].snaps or steady_deflection.body_of(law) is None):
        raise InputError(f"scene.{where}", f"bristles of friction law {structure.law} have no steady deflection")
    least = values.get("friction.dead_band", 0.0)
    require(abs(velocity) > least, where, velocity, "a belt at {} m/s does not slide along under a body at rest")
    found = np.array([_steady_friction(take(scene, i), -v) for i, v in enumerate(velocity)])
    K, deflection = -found.T
    body, growth = scene.body, values.get("body.normal_stiffness", 0.0)
    pull = K * body.mass * body.gravity + scene.viscous * velocity + values.get("force.constant", 0.0)
    x = _nearest_balance(pull, body.stiffness - K * growth, values.get("spring.cubic", np.zeros(len(K))))
    require(np.isfinite(x), where, pull, "there is none: the spring cannot hold the body against {} N")
    load = body.mass * body.gravity + growth * x
    require(load > 0.0, where, load, "there is none: the normal load would be {} N")
    return scene._replace(initial_x=x, initial_v=-velocity, **({"initial_z": -deflection} if bristles else {}))


def _constant_velocity(values: Values) -> Any:
    """Velocity of a belt that does not change it, m/s; None if it is not given as a number."""
    return values.get("belt.velocity", values.get("drive.amplitude"))


def _steady_friction(scene: Any, v: float) -> tuple[float, float]:
    """Friction per load, 1, and deflection of bristles, m, in steady sliding at the velocity `v`, m/s."""
    law, surface, sign = scene.law, coefficients(scene, v), np.copysign(1.0, v)
    if not isinstance(scene, belt.BristleBelt):
        return sign * friction_at(law, abs(v), surface)[0], 0.0
    z = steady_deflection(law, *surface, v)
    return bristle(law, *surface, v, z, sign, KINETIC)[3], z


def _nearest_balance(
    pull: NDArray[np.float64], stiffness: NDArray[np.float64], cubic: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Displacement nearest to 0 at which springs balance a pull, and bring the body back to it, m; NaN if none does."""
    x = np.full(len(pull), np.nan)
    for i, (p, k, k_3) in enumerate(zip(pull, stiffness, cubic, strict=True)):
        roots = np.roots([k_3, 0.0, k, -p])
        held = [root.real for root in roots if root.imag == 0.0 and k + 3.0 * k_3 * root.real**2 > 0.0]
        x[i] = min(held, key=abs, default=np.nan)
    return x - (stiffness * x + cubic * x**3 - pull) / (stiffness + 3.0 * cubic * x**2)


def _with_load(drive: Any, structure: Structure, values: Values) -> tuple[forces.Laden, NDArray[np.float64]]:
    """Drive with the normal load that varies in time, and the largest magnitude of that load, N."""
    zero = np.zeros(len(values["time.span"]))
    if not isinstance(drive, forces.Forced):
        drive = forces.Forced(drive, drives.Still(), zero, zero)
    load, ends = _given(structure.load, structure.own_load, "body.load", values)
    return forces.Laden(drive, load, drive.largest, ends.min(axis=0)), abs(ends).max(axis=0)


def _given(table: Any, own: Any, section: str, values: Values) -> tuple[Any, NDArray[np.float64]]:
    """Force or load of a section, by a table or else by a formula, and its least and greatest value, N."""
    if table is None:
        found = by_formula(own, section, "formula", values)
        return found, drives.extremes_of(found, values["time.span"])
    factor, (times, samples, interpolate) = values[f"{section}.amplitude"], table
    found = table_of(times, samples, interpolate, factor, section, values)
    return found, np.multiply.outer([samples.min(), samples.max()], factor)


# Cycles in a span if neither the forcing nor a spring has a period.
_CYCLES = 96


def _periods(structure: Structure, values: Values, period: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Fields of a cell for its cycles, from the period of drive and force, s: 0 if neither varies."""
    stiffness = values["spring.stiffness"]
    repeats = period_of(structure, np.where(period > 0.0, period, inf))
    with np.errstate(divide="ignore"):
        natural = 2.0 * np.pi * np.sqrt(values["body.mass"] / stiffness)
    natural = np.where(stiffness > 0.0, natural, values["time.span"] / _CYCLES)
    rises = [values[path] != 0.0 for path in ("spring.cubic", "body.normal_stiffness") if path in values]
    return {
        "forcing_period": repeats,
        "cycle": np.where((period > 0.0) & (repeats == inf), natural, repeats),
        "place_counts": np.logical_or.reduce([stiffness > 0.0, *rises]).astype(float),
    }


def _surface(structure: Structure, values: Values) -> Any:
    """Surface, and the friction coefficients of all its parts; see :func:`ringsweep.models.parts.surface_from`."""
    law, name = structure.law_type, structure.law
    if structure.two_way and friction.TRAITS[law].snaps:
        problem = f"not available with law {name}, whose bonds form alike both ways: give one number"
        raise InputError(f"scene.{structure.two_way[0]}", problem)
    if not structure.arcs:
        return surface_from(structure, values, None)
    if friction.TRAITS[law].dead_band:
        problem = f"not available with law {name}, which has a dead band: choose another law"
        raise InputError(f"scene.{structure.arcs[0]}", problem)
    if structure.steady:
        raise InputError("scene.initial.steady", "not available with zones: give initial.x and initial.velocity")
    period = None
    if structure.frame == "belt":
        problem = "missing: give the length after which the zones repeat, or friction.frame: space for zones in space"
        if "belt.period" not in values:
            raise InputError("scene.belt.period", problem)
        period = values["belt.period"]
        for arc in structure.arcs:
            length = values[f"{arc}.half_length"]
            require(length <= 0.5 * period, f"{arc}.half_length", length, "{} m is longer than half of belt.period")
    return surface_from(structure, values, zones.Stretch, period)


def _among_zones(values: Values, drive: Any, forced: Any, period: NDArray[np.float64]) -> NDArray[np.float64]:
    """Period of drive, force and load, s, if the zones move with the belt: they must return too; 0 if nothing moves."""
    if not isinstance(drive, drives.Constant):
        # The place of the belt must return, as the angle of a ring, not only its velocity.
        found = drives.force_period(drive)
        while forced is not drive:
            found, forced = common_period(found, drives.force_period(forced.added)), forced.motion
        return np.broadcast_to(found, period.shape)
    speed = np.abs(drive[0])
    turn = np.divide(values["belt.period"], speed, out=np.zeros(len(speed)), where=speed > 0.0)
    return np.broadcast_to(common_period(turn, period), period.shape)


def _point(structure: Structure) -> tuple[str, ...]:
    """Variables of a point of a section: displacement and velocity, and the state of a law with a memory."""
    return "x_section", "velocity_section", f"{friction.TRAITS[structure.law_type].state}_section"


def _extreme_deflections(structure: Structure, values: Values) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Deflections at which the bristles carry the static friction of a pull backwards and of one forwards, m."""
    mu_s, _ = zones.roughest(_surface(structure, values)[0])
    per_mu = values["body.mass"] * values["gravity"] / values["friction.sigma0"]
    return -getattr(mu_s, "backward", mu_s) * per_mu, getattr(mu_s, "forward", mu_s) * per_mu


class StopBelt(Belt):
    """A mass on a spring on a moving belt, between end stops."""

    outcomes: ClassVar[tuple[str, ...]] = (*Outcome._fields, "impacts", "impact_speed_max")

    def parameters(self, structure: Structure) -> dict[str, Parameter]:
        """Parameters of a scene of this structure, by path."""
        return super().parameters(structure) | {
            "stops.low": Parameter("m", "place of the lower stop (default: none)", optional=True),
            "stops.high": Parameter("m", "place of the upper stop (default: none)", optional=True),
            "stops.restitution": Parameter("1", "coefficient of restitution of the stops", lower=0.0, upper=1.0),
        }

    def continued(self, structure: Structure, values: Values, ended: Values) -> dict[str, NDArray[np.float64]]:
        """State at the end of other runs; stops that have moved take the body along."""
        found, (low, high) = super().continued(structure, values, ended), _stops(values)
        return found | {"initial.x": np.clip(found["initial.x"], low, high)}

    def build(self, structure: Structure, values: Values) -> belt.Belt:
        """Cells that kernels run over; see :meth:`ringsweep.models.model.Model.build`."""
        if "stops.low" not in values and "stops.high" not in values:
            raise InputError("scene.stops", "low or high is missing: give one of them or both, such as `high: 2 cm`")
        free, e = super().build(structure, values), values["stops.restitution"]
        (low, high), x, where = _stops(values), free.initial_x, "initial.steady" if structure.steady else "initial.x"
        require(low < high, "stops.low", low, "{} m is not below stops.high")
        require(x >= low, where, x, "{} m is below stops.low: the body must start between the stops")
        require(x <= high, where, x, "{} m is above stops.high: the body must start between the stops")
        if friction.TRAITS[structure.law_type].dead_band:
            # In the band a body moves with its belt, also against a stop.
            speed, band = abs(_constant_velocity(values)), values["friction.dead_band"]
            require((speed == 0.0) | (speed > band), "friction.dead_band", band, _TOO_WIDE)
        # Rebounds happen at one place, without a spring too.
        return free._replace(place_counts=np.ones(len(low)), stops=belt.Stops(low, high, e))


# Problem of a dead band beside stops.
_TOO_WIDE = "{} m/s must be less than the speed of the belt, which slides along under a body at a stop"

# Where no stop is.
_NOWHERE = 1e300


def _stops(values: Values) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places of both stops, m."""
    nowhere = np.full(len(values["time.span"]), _NOWHERE)
    return values.get("stops.low", -nowhere), values.get("stops.high", nowhere)


#: Words of the drives of a ring, and those of a belt, which moves along a line.
_ON_A_LINE = {
    "rad": "m",
    "rad/s": "m/s",
    "angular velocity of the ring": "velocity of the belt",
    "2/π of the ring's final angular velocity": "2/π of the belt's final velocity",
    "angle of the ring after one second": "displacement of the belt after one second",
    drives.PER_SECOND_P["rad"]: drives.PER_SECOND_P["m"],
    "amplitude of the rocking angle": "amplitude of the displacement",
}


def _along_a_line(name: str, p: Parameter) -> Parameter:
    """A parameter of a drive, in the words for a belt. A phase is an angle there too."""
    unit, about, in_words = (_ON_A_LINE.get(word, word) for word in (p.unit, p.long_name, p.unit_in_words))
    return p if name == "phase" else replace(p, unit=unit, long_name=about, unit_in_words=in_words)
