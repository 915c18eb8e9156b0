"""A scene as numbers for the compiled reference."""

import math
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

TURN = 2.0 * math.pi

RING, SINGLE, BELT = range(3)
MODELS = ("ring", "ring-single-contact", "belt")

# The laws up to JUMP are set-valued at rest. From DAHL on, laws have bristles.
(
    COULOMB, STICTION, TUSTIN, BUMP, TENT, HUMP, JUMP, KARNOPP, THRELFALL, LINEAR, CUBIC, BENGISU, DAHL, LUGRE, ELASTO,
    RESET,
) = range(16)  # fmt: skip
LAWS = (
    "coulomb", "stiction", "tustin", "bump", "tent", "hump", "jump", "karnopp", "threlfall", "piecewise-linear",
    "piecewise-cubic", "bengisu-akay", "dahl", "lugre", "elasto-plastic", "reset-integrator",
)  # fmt: skip
#: Laws by formula. All of them hold with up to mu_s at rest.
FORMULAS = {
    "bump": "mu_k + h*exp(-((v - vb)/w)**2)",
    "tent": "mu_k + h*max(0, 1 - abs(v - vb)/w)",
    "hump": "max(mu_k, mu_s - ((v - vb)/w)**2)",
    "jump": "piecewise(v < vb, mu_s, mu_k)",
}

NONE, CONSTANT, ARCTAN, POWER, SINUSOIDAL, TABLE = range(6)
DRIVES = ("none", "constant", "arctan", "power", "sinusoidal", "table")


class Problem(NamedTuple):
    """A scene in SI units.

    The angles `edges` divide the ring into segments. Each segment reaches from its edge to the next edge and has the
    friction coefficients `mu_s` and `mu_k`. On the belt there is one segment, both coefficients and the height `h` of a
    law are forces in N, and the radius is 1. `unit` is the friction per unit of friction coefficient: 1, or the weight.
    The centre of mass is at a distance `offset` from the line of the balls, away from the axis; the sign of the
    distance changes when the contacts change places.
    """

    model: int
    law: int
    mass: float
    inertia: float
    xi: float
    beta: float
    radius: float
    half_distance: float
    ball_radius: float
    offset: float
    gravity: float
    stiffness: float
    cubic: float
    viscous: float
    force: float
    force_frequency: float
    force_phase: float
    edges: np.ndarray
    mu_s: np.ndarray
    mu_k: np.ndarray
    alpha: float
    v0: float
    v1: float
    v_s: float
    dead_band: float
    vb: float
    w: float
    h: float
    unit: float
    sigma0: float
    sigma1: float
    sigma2: float
    elastic: float
    drive: int
    amplitude: float
    exponent: float
    frequency: float
    phase: float
    knots: np.ndarray
    pieces: np.ndarray
    position: float
    speed: float
    at_rest: bool
    span: float
    epsilon: float
    restitution: float


def segments(arcs, rest):
    """Edges of the segments of the ring, and friction coefficients on each. Where zones overlap, the later zone holds.

    Parameters
    ----------
    arcs : list of (center, half_angle, mu_s, mu_k)
    rest : (mu_s, mu_k)

    """
    ends = [0.0] + [(c + side * h) % TURN for c, h, _, _ in arcs if 0.0 < h < math.pi for side in (-1.0, 1.0)]
    edges = np.unique([0.0 if end == TURN else end for end in ends])
    middles = 0.5 * (edges + np.append(edges[1:], TURN))
    values = []
    for x in middles:
        here = rest
        for center, half, mu_s, mu_k in arcs:
            if (x - center + half) % TURN < 2.0 * half:
                here = (mu_s, mu_k)
        values.append(here)
    return edges, *np.array(values).T.copy()


def coefficients(values):
    """Static and kinetic friction coefficient; laws without `mu_s` have `mu_k` for both."""
    mu_k = float(values["mu_k"])
    return float(values.get("mu_s", mu_k)), mu_k


def problem(scene, factor=1.0):
    """Problem of a scene, with all friction coefficients times `factor`.

    Parameters
    ----------
    scene : mapping
        As in a configuration, but with numbers only (SI).
    factor : float

    """
    body, friction, drive = scene["body"], scene["friction"], dict(scene.get("drive", {"law": "none"}))
    model, gravity = MODELS.index(scene["model"]), float(scene.get("gravity", 9.81))
    initial, mass, name = scene.get("initial", {}), float(body["mass"]), friction["law"]
    if name == "formula":
        name = next(key for key, text in FORMULAS.items() if text == friction["mu"])
    law, unit = LAWS.index(name), 1.0
    inertia = xi = beta = half = ball = offset = stiffness = 0.0
    radius = 1.0
    if model == RING:
        half, ball, inertia = float(body["half_distance"]), float(body["ball_radius"]), float(body["inertia"])
        radius = float(scene["ring"]["radius"]) if "ring" in scene else ball + half / math.sin(float(body["beta"]))
        beta = math.asin(half / (radius - ball))
        offset = float(body.get("center_offset", 0.0))
        xi = (radius - ball) * math.cos(beta) + offset
    elif model == SINGLE:
        radius = float(scene["ring"]["radius"])
    else:
        stiffness = float(scene["spring"]["stiffness"])
        if "belt" in scene:
            drive = {"law": "constant", "amplitude": scene["belt"]["velocity"]}
    if model == BELT:
        unit = mass * gravity
        edges, mu_s, mu_k = np.zeros(1), *(np.array([value * unit]) for value in coefficients(friction))
    else:
        arcs = [
            (float(arc.get("center", 0.0)), float(arc["half_angle"]), *coefficients(arc))
            for arc in scene.get("zones", [])
        ]
        if "zone" in scene:
            arcs = [
                (float(scene["zone"].get("center", 0.0)), float(scene["zone"]["half_angle"]),
                 *coefficients(friction["rough"]))
            ]  # fmt: skip
        edges, mu_s, mu_k = segments(arcs, coefficients(friction["rest"]))
    knots, pieces = np.zeros(2), np.zeros((4, 1))
    if drive["law"] == "table":
        spline = CubicSpline(np.asarray(drive["time"], float), np.asarray(drive["theta"], float), bc_type="not-a-knot")
        knots, pieces = np.ascontiguousarray(spline.x), np.ascontiguousarray(spline.c)
    number = {name: float(friction.get(name, 0.0)) for name in ("alpha", "v0", "v1", "v_s", "dead_band", "vb", "w")}
    bristles = {name: float(friction.get(name, 0.0)) for name in ("sigma0", "sigma1", "sigma2")}
    force = scene.get("force", {})
    position, speed = initial.get("phi", initial.get("x", 0.0)), initial.get("omega", initial.get("velocity"))
    at_rest = speed is None and model == BELT
    return Problem(
        model=model, law=law, mass=mass, inertia=inertia, xi=xi, beta=beta, radius=radius, half_distance=half,
        ball_radius=ball, offset=offset, gravity=gravity, stiffness=stiffness,
        cubic=float(scene.get("spring", {}).get("cubic", 0.0)),
        viscous=float(friction.get("viscous", 0.0)), force=float(force.get("amplitude", 0.0)),
        force_frequency=float(force.get("frequency", 0.0)), force_phase=float(force.get("phase", 0.0)),
        h=float(friction.get("h", 0.0)) * unit * factor, unit=unit * factor,
        edges=edges, mu_s=mu_s * factor, mu_k=mu_k * factor, **number, **bristles,
        elastic=float(friction.get("elastic_fraction", 0.7)), drive=DRIVES.index(drive["law"]),
        amplitude=float(drive.get("amplitude", 1.0)), exponent=float(drive.get("exponent", 0.0)),
        frequency=float(drive.get("frequency", 0.0)), phase=float(drive.get("phase", 0.0)), knots=knots, pieces=pieces,
        position=float(position), speed=float(speed or 0.0), at_rest=at_rest, span=float(scene["time"]["span"]),
        epsilon=float(scene.get("classify", {}).get("epsilon_omega", 1e-3)),
        restitution=float(scene.get("impact", {}).get("restitution", math.nan)),
    )  # fmt: skip
