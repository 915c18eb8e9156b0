"""The belt as a model: its parameters, the cells that kernels run over, and the hooks of all solvers.

The state is ``(x, velocity)`` for steps of constant length and ``(x, v)``, with the sliding
velocity itself, for the piecewise-smooth system.
"""

from __future__ import annotations

from math import inf, isfinite, nan
from typing import Any, ClassVar, NamedTuple

from ringsweep import hooks
from ringsweep.errors import InputError
from ringsweep.jit import inlined
from ringsweep.models.common import GRAVITY, MASS, SPAN, drive_of, pair
from ringsweep.parameters import Parameter, declared
from ringsweep.physics import belt, drives, friction
from ringsweep.physics.friction import BAND, CLEAN
from ringsweep.regimes import BROKEN, RUNNING
from ringsweep.scene import Structure, Values
from ringsweep.series import INVERSE, ORDER, ascending, crossings, reach, value, variation
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
        return "x", "velocity", "friction_force", "mode"

    def parameters(self, structure: Structure) -> dict[str, Parameter]:
        """Every numeric path of a scene of this structure."""
        law = friction.LAWS[structure.law]
        found = {
            "body.mass": MASS,
            "spring.stiffness": Parameter("N/m", "stiffness of the spring", lower=0.0),
        }
        found["belt.velocity"] = Parameter("m/s", "velocity of the belt", optional=True)
        found |= {f"friction.{name}": p for name, p in friction.coefficients_of(law).items()}
        found |= {f"friction.{name}": p for name, p in declared(law).items()}
        for name, p in declared(drives.DRIVES[structure.drive]).items():
            found[f"drive.{name}"] = p.along_a_line()
        return found | {
            "initial.x": Parameter("m", "displacement of the body at the start", default=0.0),
            "initial.velocity": Parameter("m/s", "velocity of the body at the start", default=0.0),
            "time.span": SPAN,
            "gravity": GRAVITY,
        }

    def build(self, structure: Structure, values: Values) -> belt.Belt:
        """Cells of a sweep; see :func:`ringsweep.models.batch`."""
        if structure.arcs:
            raise InputError(f"scene.{structure.arcs[0]}", "a belt has no rough zones")
        law = friction.LAWS[structure.law]
        mu_s, mu_k = pair(law, "friction", values)
        given = "belt.velocity" in values
        if given == (structure.drive != "none"):
            what = "given beside drive: the belt moves by one or the other" if given else "missing: give it, or a drive"
            raise InputError("scene.belt.velocity", what)
        if given:
            drive: Any = drives.Constant(values["belt.velocity"])
        else:
            drive = drive_of(structure, values)
        return belt.Belt(
            mass=values["body.mass"],
            stiffness=values["spring.stiffness"],
            gravity=values["gravity"],
            mu_s=mu_s,
            mu_k=mu_k,
            law=law(*(values[f"friction.{name}"] for name in declared(law))),
            drive=drive,
            initial_x=values["initial.x"],
            initial_velocity=values["initial.velocity"],
            span=values["time.span"],
        )


# ---- what is remembered of a run -------------------------------------------------------------


class Record(NamedTuple):
    """What is remembered of a run on the belt; lengths in m, times in s, forces in N.

    A cycle runs from one maximum of the displacement to the next. ``stuck_for`` is how long the
    body has stuck without a break, ``stuck_later`` how long in all since its first slip, and
    ``low`` the least displacement since the last maximum.
    """

    velocity: float
    x: float
    x_min: float
    x_max: float
    velocity_max: float
    force_max: float
    stick_time: float
    stuck_for: float
    stuck_later: float
    slips: int
    first_slip: float
    maxima: int
    first_maximum: float
    last_maximum: float
    low: float
    first_swing: float
    last_swing: float


# A stick shorter than this fraction of the span is a touch.
_TOUCH = 1e-9


@inlined
def _begin_record(x, velocity, force):
    return Record(
        velocity, x, x, x, velocity, abs(force), 0.0, 0.0, 0.0, 0, nan, 0, nan, nan, x, nan, nan
    )  # fmt: skip


@inlined
def _observe_record(r, scene, t, duration, x, velocity, force, stuck):
    """Record after `duration` seconds to the state at time `t`, in all of which the body stuck or slipped."""
    slips, first_slip, stuck_for, stuck_later = r.slips, r.first_slip, r.stuck_for, r.stuck_later
    if stuck:
        stuck_for += duration
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
        last_maximum = maximum
        low = x
    return Record(
        velocity,
        x,
        min(r.x_min, x),
        max(r.x_max, x),
        max(r.velocity_max, velocity),
        max(r.force_max, abs(force)),
        r.stick_time + (duration if stuck else 0.0),
        stuck_for,
        stuck_later,
        slips,
        first_slip,
        maxima,
        first_maximum,
        last_maximum,
        low,
        first_swing,
        last_swing,
    )


@inlined
def _conclude_record(r, scene, status, t, x, velocity):
    if status == BROKEN or not (isfinite(x) and isfinite(velocity)):
        motion = FAILED
    elif r.stuck_later > 1e-6 * scene.span:
        motion = STICK_SLIP
    elif r.maxima >= 2 and r.last_swing >= 0.95 * r.first_swing and r.last_swing > 0.0:
        motion = OSCILLATORY
    else:
        motion = RESTING
    period = (r.last_maximum - r.first_maximum) / (r.maxima - 1) if r.maxima >= 2 else nan
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
        period,
        r.force_max,
    )


# ---- constant step ---------------------------------------------------------------------------


class Inspection(NamedTuple):
    """A state of the belt seen from within."""

    rates: tuple[float, float]
    v: float
    force: float
    slope: float


@inlined
def _force(scene, v):
    """Friction force, N, and its derivative by the sliding velocity, N s/m."""
    w_s, w_k, dw_s, dw_k = friction.weights(scene.law, abs(v))
    load = scene.mass * scene.gravity
    sign = 1.0 if v > 0.0 else -1.0 if v < 0.0 else 0.0
    return sign * load * (w_s * scene.mu_s + w_k * scene.mu_k), load * (dw_s * scene.mu_s + dw_k * scene.mu_k)


@hooks.launch.implements(belt.Belt)
def _launch(scene):
    return scene.initial_x, scene.initial_velocity


@hooks.rates.implements(belt.Belt)
def _rates(scene, y, drive_at, drive_rate):
    force, _ = _force(scene, y[1] - drive_rate)
    return y[1], -(scene.stiffness * y[0] + force) / scene.mass


@hooks.inspect.implements(belt.Belt)
def _inspect(scene, y, drive_at, drive_rate):
    v = y[1] - drive_rate
    force, slope = _force(scene, v)
    return Inspection((y[1], -(scene.stiffness * y[0] + force) / scene.mass), v, force, slope)


@hooks.verdict.implements(belt.Belt)
def _verdict(scene, before, now):
    return (RUNNING if isfinite(now.rates[1]) and isfinite(now.rates[0]) else BROKEN), 1.0


@hooks.stiffness.implements(belt.Belt)
def _stiffness(scene, before, now, h):
    crossed = before.v * now.v < 0.0
    slow, fast = min(abs(before.v), abs(now.v)), max(abs(before.v), abs(now.v))
    band = friction.stiction_band(scene.law)
    if crossed and band == 0.0:
        # A discontinuous law has no slope that any step could follow.
        return inf
    met = abs(now.slope)
    # A step that jumps the band, or its edge, never samples the slope there, but has met it.
    if crossed:
        met = max(met, abs(_force(scene, 0.0)[1]))
    if crossed or slow < band <= fast:
        met = max(met, abs(_force(scene, band)[1]))
    return met / scene.mass * h


@hooks.begin.implements(belt.Belt)
def _begin(scene, y, now):
    return _begin_record(y[0], y[1], now.force)


@hooks.observe.implements(belt.Belt)
def _observe(scene, record, y, before, now, t, h):
    stuck = abs(before.v) < friction.stiction_band(scene.law) or before.v * now.v < 0.0
    return _observe_record(record, scene, t, h, y[0], y[1], now.force, stuck)


@hooks.conclude.implements(belt.Belt)
def _conclude(scene, record, status, t, y):
    return _conclude_record(record, scene, status, t, y[0], y[1])


@hooks.describe.implements(belt.Belt)
def _describe(scene, y, drive_at, drive_rate):
    v = y[1] - drive_rate
    mode = 0.0 if abs(v) < friction.stiction_band(scene.law) or v == 0.0 else 1.0 if v > 0.0 else -1.0
    return y[0], y[1], _force(scene, v)[0], mode


# ---- piecewise-smooth system -----------------------------------------------------------------

# Rows of the series; the guards last.
X, V, VELOCITY, SPEED, STATIC, KINETIC, FORCE, SHIFT = range(8)
SLOW, FAST = range(8, 10)


class Mode(NamedTuple):
    """Sign of the sliding velocity (0: stick), region of the law, guard that is zero on entry or -1."""

    sign: int
    region: int
    fresh: int


@hooks.onward.implements(Mode)
def _onward(mode):
    return Mode(mode.sign, mode.region, -1)


@hooks.embark.implements(belt.Belt)
def _embark(scene):
    t = drives.beginning(scene.drive)
    return t, (scene.initial_x, scene.initial_velocity - drives.turn(scene.drive, t)[1])


@hooks.rows.implements(belt.Belt)
def _rows(scene):
    return FAST + 1, SLOW


@inlined
def _pull(scene, t, x):
    """Force that friction must overcome to hold the body to the belt, N; positive forwards."""
    return -scene.stiffness * x - scene.mass * drives.turn(scene.drive, t)[2]


@hooks.enter.implements(belt.Belt)
def _enter(scene, t, y):
    x, v = y
    if v == 0.0:
        if friction.stiction_band(scene.law) == 0.0:
            return RUNNING, _settle(scene, t, x)
        return RUNNING, Mode(1 if _pull(scene, t, x) >= 0.0 else -1, BAND, SLOW)
    return RUNNING, Mode(1 if v > 0.0 else -1, friction.region_at(scene.law, abs(v)), -1)


@inlined
def _settle(scene, t, x):
    """Mode of a set-valued law where the sliding velocity is zero."""
    pull = _pull(scene, t, x)
    bound = friction.holding(scene.law, scene.mu_s, scene.mu_k) * scene.mass * scene.gravity
    if abs(pull) <= bound and bound > 0.0:
        return Mode(0, CLEAN, -1)
    return Mode(1 if pull >= 0.0 else -1, friction.region_at(scene.law, 0.0), SLOW)


@hooks.switch.implements(belt.Belt)
def _switch(scene, mode, guard, t, y):
    x, _ = y
    sign, region = mode.sign, mode.region
    if sign == 0:
        return RUNNING, Mode(1 if guard == SLOW else -1, friction.region_at(scene.law, 0.0), SLOW), (x, 0.0)
    low, high = friction.region_bounds(scene.law, region)
    if guard == FAST:
        return RUNNING, Mode(sign, region - 1, SLOW), (x, sign * high)
    if low > 0.0:
        return RUNNING, Mode(sign, region + 1, FAST), (x, sign * low)
    if region == BAND:
        return RUNNING, Mode(-sign, BAND, SLOW), (x, 0.0)
    return RUNNING, _settle(scene, t, x), (x, 0.0)


@hooks.expand.implements(belt.Belt)
def _expand(scene, mode, t, y, tolerance, c):
    drives.expand(scene.drive, t, ORDER + 2, c[SHIFT])
    load = scene.mass * scene.gravity
    rate = scene.stiffness / scene.mass
    c[X, 0], c[V, 0] = y
    c[VELOCITY, 0] = y[1] + c[SHIFT, 1]
    if mode.sign == 0:
        bound = friction.holding(scene.law, scene.mu_s, scene.mu_k) * load
        for k in range(ORDER + 1):
            c[V, k] = 0.0
            c[VELOCITY, k] = (k + 1.0) * c[SHIFT, k + 1]
            if k > 0:
                c[X, k] = c[SHIFT, k]
            c[FORCE, k] = -scene.stiffness * c[X, k] - scene.mass * (k + 1.0) * (k + 2.0) * c[SHIFT, k + 2]
            c[SLOW, k], c[FAST, k] = -c[FORCE, k], c[FORCE, k]
        c[SLOW, 0] += bound
        c[FAST, 0] += bound
    else:
        for k in range(ORDER + 1):
            c[SPEED, k] = mode.sign * c[V, k]
            friction.expand_weights(scene.law, mode.region, c[SPEED], k, c[STATIC], c[KINETIC])
            c[FORCE, k] = mode.sign * load * (c[STATIC, k] * scene.mu_s + c[KINETIC, k] * scene.mu_k)
            if k < ORDER:
                c[X, k + 1] = c[VELOCITY, k] * INVERSE[k + 1]
                c[VELOCITY, k + 1] = -(rate * c[X, k] + c[FORCE, k] / scene.mass) * INVERSE[k + 1]
                c[V, k + 1] = c[VELOCITY, k + 1] - (k + 2.0) * c[SHIFT, k + 2]
        low, high = friction.region_bounds(scene.law, mode.region)
        for k in range(1, ORDER + 1):
            c[SLOW, k], c[FAST, k] = c[SPEED, k], -c[SPEED, k]
        c[SLOW, 0] = 0.0 if mode.fresh == SLOW else c[SPEED, 0] - low
        c[FAST, 0] = 0.0 if mode.fresh == FAST else high - c[SPEED, 0]
        # Breakaway of a law without a drop of friction is tangential: what is left of the slope is rounding.
        terms = rate * abs(c[X, 0]) + abs(c[FORCE, 0]) / scene.mass
        if mode.fresh == SLOW and low == 0.0 and abs(c[V, 1]) <= 1e-12 * terms:
            c[SLOW, 1] = 0.0
    # Lengths are measured by the way that the belt, the body or the load could go in the spring's own time.
    length = abs(c[X, 0]) + _length(scene, abs(c[VELOCITY, 0]) + abs(c[SHIFT, 1]))
    speed = length * (rate**0.5 if rate > 0.0 else 1.0)
    if mode.region == BAND:
        # Noise that is large for the band would keep the creep from ever settling.
        speed = min(speed, 1e3 * friction.stiction_band(scene.law))
    last = max(abs(c[X, ORDER]) / length, abs(c[V, ORDER]) / speed)
    previous = max(abs(c[X, ORDER - 1]) / length, abs(c[V, ORDER - 1]) / speed)
    return reach(last / tolerance, previous / tolerance)


@inlined
def _length(scene, velocity):
    """A length to measure errors by, m."""
    push = scene.mu_s * scene.gravity * scene.mass
    if scene.stiffness > 0.0:
        return velocity * (scene.mass / scene.stiffness) ** 0.5 + push / scene.stiffness + 1e-300
    return velocity + push / scene.mass + 1e-300


@hooks.start.implements(belt.Belt)
def _start(scene, c):
    return _begin_record(c[X, 0], c[VELOCITY, 0], c[FORCE, 0])


@hooks.land.implements(belt.Belt)
def _land(scene, mode, c, t, s):
    return value(c[X], s), value(c[V], s)


@hooks.watch.implements(belt.Belt)
def _watch(scene, record, mode, c, t, s, work):
    count = 0
    if abs(c[VELOCITY, 0]) <= variation(c[VELOCITY], s):
        count = crossings(c[VELOCITY], s, work, count)
    if mode.sign != 0:
        # Extremes of the velocity are zeros of the net force.
        for k in range(ORDER + 1):
            c[SHIFT, k] = scene.stiffness * c[X, k] + c[FORCE, k]
        count = crossings(c[SHIFT], s, work, count)
    ascending(work[0], count)
    before = 0.0
    stuck = mode.sign == 0 or mode.region == BAND
    for j in range(count + 1):
        now = work[0, j] if j < count else s
        velocity = value(c[VELOCITY], now)
        if abs(velocity) <= 1e-15 * (abs(c[VELOCITY, 0]) + variation(c[VELOCITY], s)):
            # A maximum is met where the velocity vanishes, not where its rounding changes sign.
            velocity = 0.0
        record = _observe_record(
            record, scene, t + now, now - before, value(c[X], now), velocity, value(c[FORCE], now), stuck
        )
        before = now
    return record


@hooks.sample.implements(belt.Belt)
def _sample(scene, mode, c, t, s):
    mode_now = 0.0 if mode.region == BAND else float(mode.sign)
    return value(c[X], s), value(c[VELOCITY], s), value(c[FORCE], s), mode_now


@hooks.finish.implements(belt.Belt)
def _finish(scene, record, status, t, y):
    return _conclude_record(record, scene, status, t, y[0], y[1] + drives.turn(scene.drive, t)[1])


# ---- creep in the stiction band --------------------------------------------------------------


@hooks.creeps.implements(belt.Belt)
def _creeps(scene, mode):
    return mode.region == BAND


@hooks.is_stiff.implements(belt.Belt)
def _is_stiff(scene, mode, y, line):
    (_, push), (_, _, _, decay), _ = line
    own = (scene.stiffness / scene.mass) ** 0.5
    return -decay > 50.0 * own and abs(push) < 0.01 * -decay * friction.stiction_band(scene.law)


# The displacement relative to the belt, so that nothing large cancels in a creep.
@hooks.to_stiff.implements(belt.Belt)
def _to_stiff(scene, t, y):
    return y[0] - drives.turn(scene.drive, t)[0], y[1]


@hooks.from_stiff.implements(belt.Belt)
def _from_stiff(scene, t, x):
    return x[0] + drives.turn(scene.drive, t)[0], x[1]


@hooks.stiff_scales.implements(belt.Belt)
def _stiff_scales(scene, tolerance):
    return tolerance * _length(scene, abs(drives.turn(scene.drive, scene.span)[1])), tolerance * friction.stiction_band(
        scene.law
    )


@hooks.forcing.implements(belt.Belt)
def _forcing(scene, t):
    return drives.turn(scene.drive, t)


@hooks.stiff_rates.implements(belt.Belt)
def _stiff_rates(scene, mode, force, x):
    shift, _, belt_acceleration = force
    drag, _ = _force(scene, x[1])
    return x[1], -(scene.stiffness * (x[0] + shift) + drag) / scene.mass - belt_acceleration


@hooks.linearise.implements(belt.Belt)
def _linearise(scene, mode, t, x):
    shift, belt_velocity, belt_acceleration = drives.turn(scene.drive, t)
    drag, slope = _force(scene, x[1])
    rate = scene.stiffness / scene.mass
    push = -rate * (x[0] + shift) - drag / scene.mass - belt_acceleration
    return (
        (x[1], push),
        (0.0, 1.0, -rate, -slope / scene.mass),
        (0.0, -rate * belt_velocity - drives.jerk(scene.drive, t)),
    )


@hooks.stiff_view.implements(belt.Belt)
def _stiff_view(scene, mode, t, x):
    shift, belt_velocity, _ = drives.turn(scene.drive, t)
    force, _ = _force(scene, x[1])
    speed = mode.sign * x[1]
    # In the order of the rows of the series: SLOW, FAST.
    return (speed, friction.stiction_band(scene.law) - speed), (x[0] + shift, x[1] + belt_velocity, force)


@hooks.stiff_velocity.implements(belt.Belt)
def _stiff_velocity(scene, t, x):
    return x[1] + drives.turn(scene.drive, t)[1]


@hooks.stiff_watch.implements(belt.Belt)
def _stiff_watch(scene, record, view, t, duration):
    _, (x, velocity, force) = view
    return _observe_record(record, scene, t, duration, x, velocity, force, True)


@hooks.stiff_sample.implements(belt.Belt)
def _stiff_sample(scene, mode, t, x):
    _, (position, velocity, force) = hooks.stiff_view(scene, mode, t, x)
    return position, velocity, force, 0.0
