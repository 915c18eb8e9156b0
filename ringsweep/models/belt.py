"""The belt as a model: its parameters, the cells that kernels run over, and what is remembered of a run."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite, nan, sqrt
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ringsweep.errors import InputError
from ringsweep.jit import inlined, take
from ringsweep.models.common import GRAVITY, MASS, SPAN, drive_of, law_of, pair
from ringsweep.parameters import Parameter, declared
from ringsweep.physics import belt, drives, friction
from ringsweep.regimes import BROKEN
from ringsweep.scene import Structure, Values, require
from ringsweep.variables import FAILED, OSCILLATORY, RESTING, STICK_SLIP


class Outcome(NamedTuple):
    """A run on the belt in the numbers that a dataset holds, in the order of their columns."""

    regime: float
    motion: float
    t_end: float
    x_end: float
    velocity_end: float
    x_min: float
    x_max: float
    velocity_max: float
    stick_time: float
    slips: float
    first_slip: float
    period: float
    force_max: float


class Belt:
    """A mass on a spring on a moving belt (the paper's Fig. 1)."""

    name: ClassVar[str] = "belt"
    doc: ClassVar[str] = "a mass on a spring on a moving belt"
    outcomes: ClassVar[tuple[str, ...]] = Outcome._fields
    laws: ClassVar[dict[str, type]] = friction.LAWS
    absent: ClassVar[frozenset[str]] = frozenset()

    def history(self, structure: Structure) -> tuple[str, ...]:
        """Quantities of a time history, in the order of their columns."""
        return "x", "velocity", "friction_force", "deflection", "mode"

    def parameters(self, structure: Structure) -> dict[str, Parameter]:
        """Every numeric path of a scene of this structure."""
        law = self.laws[structure.law]
        found = {
            "body.mass": MASS,
            "spring.stiffness": Parameter("N/m", "stiffness of the spring", lower=0.0),
            "belt.velocity": Parameter("m/s", "velocity of the belt", optional=True),
        }
        found |= {f"friction.{name}": p for name, p in friction.coefficients_of(law).items()}
        for name, p in declared(law).items():
            # What bristles have per unit of the load, they have here under the weight of the body.
            absolute = {"1/m": "N/m", "s/m": "N s/m"} if name.startswith("sigma") else {}
            found[f"friction.{name}"] = replace(p, unit=absolute.get(p.unit, p.unit))
        if law not in friction.DYNAMIC:
            found["friction.viscous"] = Parameter("N s/m", "viscous friction", lower=0.0, default=0.0)
        for name, p in declared(drives.DRIVES[structure.drive]).items():
            found[f"drive.{name}"] = p.along_a_line()
        return found | {
            "initial.x": Parameter("m", "displacement of the body at the start", default=0.0),
            "initial.velocity": Parameter(
                "m/s", "velocity of the body at the start (default: that of the belt)", optional=True
            ),
            "time.span": SPAN,
            "gravity": GRAVITY,
        }

    def build(self, structure: Structure, values: Values) -> belt.Belt | belt.BristleBelt:
        """Cells of a sweep; see :func:`ringsweep.models.batch`."""
        if structure.arcs:
            raise InputError(f"scene.{structure.arcs[0]}", "a belt has no rough zones")
        law = self.laws[structure.law]
        mu_s, mu_k = pair(law, "friction", values)
        drive = self._drive(structure, values)
        velocity = values.get("initial.velocity")
        if velocity is None:
            velocity = np.array([drives.turn(take(drive, i), 0.0)[1] for i in range(len(mu_k))])
        mass, gravity = values["body.mass"], values["gravity"]
        given = {
            "mass": mass,
            "stiffness": values["spring.stiffness"],
            "gravity": gravity,
            "mu_s": mu_s,
            "mu_k": mu_k,
            "drive": drive,
            "initial_x": values["initial.x"],
            "initial_velocity": velocity,
            "span": values["time.span"],
        }
        if law not in friction.DYNAMIC:
            return belt.Belt(**given, law=law_of(law, values), viscous=values["friction.viscous"])
        require(gravity > 0.0, "gravity", gravity, "{} m/s^2 leaves the bristles of friction without a load")
        per_load = {
            path: value / (mass * gravity) for path, value in values.items() if path.startswith("friction.sigma")
        }
        return belt.BristleBelt(**given, law=law_of(law, {**values, **per_load}))

    def _drive(self, structure: Structure, values: Values) -> Any:
        """What moves the belt: a velocity of its own, or a drive."""
        given = "belt.velocity" in values
        if given == (structure.drive != "none"):
            what = "given beside drive: the belt moves by one or the other" if given else "missing: give it, or a drive"
            raise InputError("scene.belt.velocity", what)
        if given:
            return drives.Constant(values["belt.velocity"])
        if structure.law == "karnopp":
            raise InputError("scene.drive", "the dead band of law karnopp needs a belt of constant velocity")
        return drive_of(structure, values)


# ---- what is remembered of a run -------------------------------------------------------------


class Record(NamedTuple):
    """What is remembered of a run on the belt; lengths in m, times in s, forces in N.

    A cycle runs from one maximum of the displacement to the next. ``stuck_for`` is how long the
    body has stuck without a break, ``stuck_later`` how long in all since its first slip, ``stuck_now`` and
    ``stuck_last`` how long in this cycle and in the last complete one. ``low`` is the least displacement since the
    last maximum, and a swing the way from it to a maximum: the first, the last, and the greatest in the third and in
    the fourth quarter of the span.
    """

    velocity: float
    x_min: float
    x_max: float
    velocity_max: float
    force_max: float
    stick_time: float
    stuck_for: float
    stuck_later: float
    stuck_now: float
    stuck_last: float
    slips: int
    first_slip: float
    maxima: int
    first_maximum: float
    last_maximum: float
    low: float
    first_swing: float
    third_swing: float
    fourth_swing: float
    last_swing: float


# A stick shorter than this fraction of the span is a touch.
_TOUCH = 1e-9

# A stick shorter than this fraction of the cycle or the span does not make it a cycle of stick and slip.
_SHORT = 1e-6

# Swings must keep this much of themselves from one quarter of a run to the next for their amplitude to count as
# lasting, and be more than the tolerance makes of the displacement.
_LASTING, _ROUNDING = 0.95, 1e-6


@inlined
def begin(x, velocity, force):
    """Record of a run at its launch."""
    times = 0.0, 0.0, 0.0, 0.0, 0.0
    return Record(velocity, x, x, velocity, abs(force), *times, 0, nan, 0, nan, nan, x, nan, 0.0, 0.0, nan)


@inlined
def observe(r, scene, t, duration, x, velocity, force, stuck):
    """Record after `duration` seconds to the state at time `t`, in all of which the body stuck or slipped."""
    slips, first_slip, stuck_for, stuck_later = r.slips, r.first_slip, r.stuck_for, r.stuck_later
    stuck_now, stuck_last = r.stuck_now, r.stuck_last
    if stuck:
        stuck_for += duration
        stuck_now += duration
        if slips > 0:
            stuck_later += duration
    else:
        if stuck_for > _TOUCH * scene.span:
            slips += 1
            if slips == 1:
                first_slip = t - duration
        stuck_for = 0.0
    maxima, first_maximum, last_maximum = r.maxima, r.first_maximum, r.last_maximum
    low, first_swing, last_swing = min(r.low, x), r.first_swing, r.last_swing
    third_swing, fourth_swing = r.third_swing, r.fourth_swing
    if r.velocity > 0.0 and velocity <= 0.0:
        # Between two states the velocity is all but linear.
        maximum = t - duration * velocity / (velocity - r.velocity)
        maxima += 1
        if maxima == 1:
            first_maximum = maximum
        else:
            last_swing = x - low
            if maxima == 2:
                first_swing = last_swing
            if maximum > 0.75 * scene.span:
                fourth_swing = max(fourth_swing, last_swing)
            elif maximum > 0.5 * scene.span:
                third_swing = max(third_swing, last_swing)
        last_maximum = maximum
        low = x
        stuck_last, stuck_now = stuck_now, 0.0
    return Record(
        velocity,
        min(r.x_min, x),
        max(r.x_max, x),
        max(r.velocity_max, velocity),
        max(r.force_max, abs(force)),
        r.stick_time + (duration if stuck else 0.0),
        stuck_for,
        stuck_later,
        stuck_now,
        stuck_last,
        slips,
        first_slip,
        maxima,
        first_maximum,
        last_maximum,
        low,
        first_swing,
        third_swing,
        fourth_swing,
        last_swing,
    )


@inlined
def conclude(r, scene, status, t, x, velocity, band):
    """Outcome of a run that ended with `status` at time `t` in the state `(x, velocity)`.

    `band` is the sliding speed below which a contact counts as stuck, or zero.
    """
    cycle = (r.last_maximum - r.first_maximum) / (r.maxima - 1) if r.maxima >= 2 else nan
    # Irregular swings are judged by the greatest of a quarter, few ones by the first and the last.
    seen = r.third_swing > 0.0 and r.fourth_swing > 0.0
    before, after = (r.third_swing, r.fourth_swing) if seen else (r.first_swing, r.last_swing)
    # A harmonic that grazes the velocity of the belt is slower than the band for so long, and does not stick.
    curvature = (scene.stiffness / scene.mass) ** 1.5 * (r.x_max - r.x_min)
    graze = sqrt(32.0 * band / curvature) if curvature > 0.0 else 0.0
    if status == BROKEN or not (isfinite(x) and isfinite(velocity)):
        motion = FAILED
    elif r.slips > 0 and (
        r.stuck_last > max(_SHORT * cycle, graze) if r.maxima >= 2 else r.stuck_later > max(_SHORT * scene.span, graze)
    ):
        motion = STICK_SLIP
    elif after >= _LASTING * before and after > _ROUNDING * max(abs(r.x_min), abs(r.x_max)):
        motion = OSCILLATORY
    else:
        motion = RESTING
    return Outcome(
        float(motion),
        float(motion),
        t,
        x,
        velocity,
        r.x_min,
        r.x_max,
        r.velocity_max,
        r.stick_time,
        float(r.slips),
        r.first_slip,
        cycle,
        r.force_max,
    )
