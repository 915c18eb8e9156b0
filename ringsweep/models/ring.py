"""The ring as a model: its parameters, their consistency, and the cells that kernels run over."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isfinite, isnan, pi
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ringsweep import hooks, regimes
from ringsweep.compile import inlined
from ringsweep.models.common import GRAVITY, MASS, SPAN, drive_of, largest_eigenvalue, law_of, pair
from ringsweep.numerics.functions import any_of, select, sine_cosine, sine_cosine_near
from ringsweep.numerics.memory import Several
from ringsweep.physics import contact, drives, friction, ring, zones
from ringsweep.physics.friction.velocity import met, steepest, stiction_band
from ringsweep.quantities.parameters import Parameter, declared
from ringsweep.regimes import BROKEN, ENDS, JAM, RUNNING
from ringsweep.scene import Structure, Values, require

RADIUS = Parameter("m", "radius of the inner race", lower=0.0, open_lower=True)


class SingleContactRing:
    """A small body on one contact with the ring (the paper's Fig. 13)."""

    name: ClassVar[str] = "ring-single-contact"
    doc: ClassVar[str] = "a small body in a rotating ring, one contact"
    outcomes: ClassVar[tuple[str, ...]] = regimes.Outcome._fields
    laws: ClassVar[dict[str, type]] = {
        name: law for name, law in friction.LAWS.items() if name not in ("karnopp", "reset-integrator", "bristle")
    }
    absent: ClassVar[frozenset[str]] = frozenset({"normal_min_2", "normal_2", "zone_2", "deflection_2"})
    body: ClassVar[dict[str, Parameter]] = {"body.mass": MASS, "ring.radius": RADIUS}

    def history(self, structure: Structure) -> tuple[str, ...]:
        """Quantities of a time history, in the order of their columns."""
        names = "phi", "omega", "epsilon", "normal_1", "normal_2", "ring_omega", "zone_1", "zone_2", "mode"
        return (*names, "deflection_1", "deflection_2") if self.laws[structure.law] in friction.DYNAMIC else names

    def parameters(self, structure: Structure) -> dict[str, Parameter]:
        """Every numeric path of a scene of this structure."""
        law = self.laws[structure.law]
        found = dict(self.body)
        places = {"friction.rest": "the rest of the ring"}
        if structure.arcs == ("zone",):
            places["friction.rough"] = "the rough zone"
        else:
            places |= {arc: f"rough arc {number}" for number, arc in enumerate(structure.arcs, start=1)}
        for place, where in places.items():
            for name, p in friction.coefficients_of(law).items():
                found[f"{place}.{name}"] = replace(p, long_name=f"{p.long_name} of {where}")
        found |= {f"friction.{name}": p for name, p in declared(law).items()}
        for arc in structure.arcs:
            for name, p in declared(zones.Arc).items():
                whose = places.get(arc, "the rough zone")
                found[f"{arc}.{name}"] = replace(p, long_name=p.long_name.replace("the rough zone", whose))
        found |= {f"drive.{name}": p for name, p in declared(drives.DRIVES[structure.drive]).items()}
        return found | {
            "initial.phi": Parameter("rad", "angle of the body at launch", default=0.0),
            "initial.omega": Parameter("rad/s", "angular velocity of the body at launch", default=0.0),
            "time.span": SPAN,
            "gravity": GRAVITY,
            "classify.epsilon_omega": Parameter(
                "rad/s", "angular velocity beyond which a change of sign is a reversal", lower=0.0, default=1e-3
            ),
        }

    def build(self, structure: Structure, values: Values) -> ring.Ring | ring.BristleRing:
        """Cells of a sweep; see :func:`ringsweep.models.batch`."""
        law = self.laws[structure.law]
        rough = "friction.rough" if structure.arcs == ("zone",) else None
        arcs = [
            zones.Arc(values[f"{arc}.center"], values[f"{arc}.half_angle"], *pair(law, rough or arc, values))
            for arc in structure.arcs
        ]
        surface = zones.cut(arcs, *pair(law, "friction.rest", values))
        return (ring.BristleRing if law in friction.DYNAMIC else ring.Ring)(
            body=self.build_body(values),
            surface=surface,
            law=law_of(law, values),
            drive=drive_of(structure, values),
            initial_phi=values["initial.phi"],
            initial_omega=values["initial.omega"],
            span=values["time.span"],
            epsilon_omega=values["classify.epsilon_omega"],
        )

    def build_body(self, values: Values) -> Any:
        """The body's cells."""
        return ring.OneContact(values["body.mass"], values["ring.radius"], values["gravity"])


class Ring(SingleContactRing):
    """Two balls joined by a rod, sliding in the ring (the paper's Fig. 22)."""

    name = "ring"
    doc = "a two-contact body in a rotating ring"
    absent = frozenset()
    body: ClassVar[dict[str, Parameter]] = {
        "body.mass": MASS,
        "body.inertia": Parameter("kg m^2", "central moment of inertia of the body", lower=0.0),
        "body.half_distance": Parameter(
            "m", "half the distance between the centres of the balls", lower=0.0, open_lower=True
        ),
        "body.ball_radius": Parameter("m", "radius of the balls", lower=0.0),
        "body.beta": Parameter(
            "rad", "half the angle that the contacts subtend", 0.0, pi / 2, True, True, optional=True
        ),
        "ring.radius": Parameter("m", "radius of the inner race", lower=0.0, open_lower=True, optional=True),
    }

    def build_body(self, values: Values) -> ring.TwoContacts:
        """The body's cells, from (a, r, R) or from (a, r, beta)."""
        a, r = values["body.half_distance"], values["body.ball_radius"]
        given = "ring.radius" in values, "body.beta" in values
        if not any(given):
            require(False, "ring.radius", np.nan, "missing: give ring.radius, or body.beta in its place")
        if given[0]:
            R = values["ring.radius"]
            require(
                r + a < R,
                "ring.radius",
                R,
                "{} m is too small: the ring must be larger than ball_radius + half_distance of the body",
            )
            sin_beta = a / (R - r)
            if given[1]:
                require(
                    np.abs(np.arcsin(sin_beta) - values["body.beta"]) < 2e-4,
                    "body.beta",
                    values["body.beta"],
                    "{} rad contradicts ring.radius: sin(beta) = half_distance / (radius - ball_radius); give one",
                )
        else:
            sin_beta = np.sin(values["body.beta"])
            R = r + a / sin_beta
        cos_beta = np.sqrt((1.0 - sin_beta) * (1.0 + sin_beta))
        return ring.TwoContacts.of(
            mass=values["body.mass"],
            inertia=values["body.inertia"],
            radius=R,
            xi=(R - r) * cos_beta,
            sin_beta=sin_beta,
            cos_beta=cos_beta,
            gravity=values["gravity"],
        )


class Inspection(NamedTuple):
    """A state of the ring seen from within: what a step needs and what ends a run.

    ``slope`` is how the acceleration depends on the angular velocity by way of the friction coefficients; ``by_phi``
    and ``by_omega`` how it depends on angle and angular velocity with these held.
    """

    rates: tuple[float, float]
    v: float
    normal_1: float
    normal_2: float
    D: float
    inertia: float
    slope: float
    by_phi: float
    by_omega: float
    phi: float
    sin_phi: float
    cos_phi: float
    omega: float


@hooks.lanes.implements(ring.Ring)
def _lanes(scene):
    return Several()


@hooks.launch.implements(ring.Ring)
def _launch(scene):
    return scene.initial_phi, scene.initial_omega


@hooks.rates.implements(ring.Ring)
def _rates(scene, now, y, drive_at, drive_rate):
    phi, omega = y
    _, K1, K2, _, _ = ring.friction(scene, phi, omega, drive_at, drive_rate)
    sin_phi, cos_phi = sine_cosine_near(phi, now.phi, now.sin_phi, now.cos_phi)
    return omega, ring.acceleration(scene.body, K1, K2, sin_phi, cos_phi, omega)[0]


@hooks.inspect.implements(ring.Ring)
def _inspect(scene, y, drive_at, drive_rate):
    phi, omega = y
    v, K1, K2, slope_1, slope_2 = ring.friction(scene, phi, omega, drive_at, drive_rate)
    sin_phi, cos_phi = sine_cosine(phi)
    epsilon, D, inertia = ring.acceleration(scene.body, K1, K2, sin_phi, cos_phi, omega)
    normal_1, normal_2 = ring.reactions(scene.body, K1, K2, sin_phi, cos_phi, omega, epsilon)
    slope = ring.acceleration_slope(scene.body, K1, K2, slope_1, slope_2, sin_phi, cos_phi, omega)
    by_phi, by_omega = ring.acceleration_gradient(scene.body, K1, K2, sin_phi, cos_phi, omega)
    return Inspection(
        (omega, epsilon), v, normal_1, normal_2, D, inertia, slope, by_phi, by_omega, phi, sin_phi, cos_phi, omega
    )


@hooks.holds.implements(ring.Ring, ring.BristleRing)
def _holds(scene, now):
    # Of a NaN every comparison is false.
    supported = (now.D > 0.0) & (now.inertia > 0.0) & (now.normal_1 > 0.0) & (now.normal_2 > 0.0)
    return supported & (abs(now.rates[1]) < inf) & (abs(now.omega) < inf)


@hooks.verdict.implements(ring.Ring, ring.BristleRing)
def _verdict(scene, before, now):
    if not (now.D > 0.0 and now.inertia > 0.0):
        return (BROKEN if isnan(now.inertia) else JAM), 1.0
    if not (isfinite(now.rates[1]) and isfinite(now.omega)):
        return BROKEN, 1.0
    first, second = _zero(before.normal_1, now.normal_1), _zero(before.normal_2, now.normal_2)
    fraction = min(first, second)
    if fraction > 1.0:
        return RUNNING, 1.0
    return ENDS[contact.lost(scene.body, first == fraction, second == fraction)], fraction


@inlined
def _zero(before, now):
    """Where a straight line from `before` to `now` vanishes, as a fraction of the way; 2 if it does not."""
    if now > 0.0:
        return 2.0
    return before / (before - now) if before > now else 0.0


@hooks.stiffness.implements(ring.Ring)
def _stiffness(scene, before, now, h):
    # The stages reach about as far as the acceleration at the beginning takes the body in one step.
    radius = scene.body.radius
    ring_gains = (radius * now.omega - now.v) - (radius * before.omega - before.v)
    ahead = before.v + h * radius * before.rates[1] - ring_gains
    band = stiction_band(scene.law)
    friction = _steeper(before.slope, now.slope)
    # A step that jumps the band, or its edge, never samples the slope there, and is the one that is
    # wrong in kind: it has met it all the same.
    low, high = min(min(before.v, now.v), ahead), max(max(before.v, now.v), ahead)
    if any_of((low <= band) & (high >= -band)):
        rest, edge, _ = met(scene.law, before.v, now.v, ahead)
        mu_s, mu_k = zones.roughest(scene.surface)
        (rest_s, rest_k), (edge_s, edge_k) = steepest(scene.law)
        scale = -radius * ring.grip(scene.body, now.cos_phi, now.omega)
        friction = _steeper(friction, select(rest, scale * (rest_s * mu_s + rest_k * mu_k), 0.0))
        friction = _steeper(friction, select(edge, scale * (edge_s * mu_s + edge_k * mu_k), 0.0))
    # Even without friction the body swings, and under friction its speed loads the contacts.
    return largest_eigenvalue(friction + now.by_omega, -now.by_phi) * h


@inlined
def _steeper(a, b):
    """The one of two slopes that is the larger in magnitude."""
    return select(abs(b) > abs(a), b, a)


@hooks.slack.implements(ring.Ring, ring.BristleRing)
def _slack(scene, before, now):
    first = min(before.normal_1, now.normal_1) - 0.25 * abs(now.normal_1 - before.normal_1)
    second = min(before.normal_2, now.normal_2) - 0.25 * abs(now.normal_2 - before.normal_2)
    return min(first, second)


@hooks.stride.implements(ring.Ring, ring.BristleRing)
def _stride(scene, now, h):
    return abs(now.v) * h / (scene.body.radius * zones.narrowest(scene.surface))


@hooks.falls.implements(ring.Ring, ring.BristleRing)
def _falls(scene, before, now, h):
    first = before.normal_1 - now.normal_1 if now.normal_1 <= 0.0 else 0.0
    second = before.normal_2 - now.normal_2 if now.normal_2 <= 0.0 else 0.0
    return max(first, second) / h


@hooks.begin.implements(ring.Ring, ring.BristleRing)
def _begin(scene, y, now):
    return regimes.begin(y[0], y[1], now.normal_1, now.normal_2, scene.epsilon_omega)


@hooks.observe.implements(ring.Ring)
def _observe(scene, record, y, before, now, t, h):
    # Whether the step lay in the stiction band or jumped across it.
    stuck = (abs(before.v) < stiction_band(scene.law)) | (before.v * now.v < 0.0)
    stuck_for = select(stuck, h, 0.0)
    return regimes.observe(record, y[0], y[1], now.normal_1, now.normal_2, stuck_for, scene.epsilon_omega)


@hooks.conclude.implements(ring.Ring, ring.BristleRing)
def _conclude(scene, record, status, t, y):
    return regimes.conclude(record, status, t, y[0], y[1])


@hooks.describe.implements(ring.Ring)
def _describe(scene, y, drive_at, drive_rate):
    now = hooks.inspect(scene, y, drive_at, drive_rate)
    band = stiction_band(scene.law)
    mode = 0.0 if abs(now.v) < band or now.v == 0.0 else 1.0 if now.v > 0.0 else -1.0
    offset = ring.contact_offset(scene.body)
    rho = y[0] - drive_at
    zone_1 = zones.coefficients(scene.surface, zones.segment(scene.surface, rho - offset))[2]
    zone_2 = zones.coefficients(scene.surface, zones.segment(scene.surface, rho + offset))[2]
    return y[0], y[1], now.rates[1], now.normal_1, now.normal_2, drive_rate, zone_1, zone_2, mode
