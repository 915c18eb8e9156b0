"""Scenes of a body in a ring, each from one line of numbers (SI) for its shape, its friction and its course."""

from copy import deepcopy
from functools import reduce

#: A configuration as it is typed: the scene of the paper's Fig. 29.
TYPED = """\
scene:
  model: ring
  body: {mass: 0.076 kg, inertia: 4.47e-5 kg m^2, half_distance: 25 mm, ball_radius: 10 mm}
  ring: {radius: 43.378 mm}
  friction:
    law: bengisu-akay
    rough: {mu_s: 0.5, mu_k: 0.3}
    rest: {mu_s: 0.2, mu_k: 0.1}
    alpha: 1.0e5
    v0: 2.0e-6
  zone:
    half_angle: 15 deg
  drive:
    law: arctan
    amplitude: 2.0
  time: {span: 10}
solver: {method: rk4, steps: 1000}
sweep:
  grid:
    drive.amplitude: {geomspace: [0.1, 10, 5]}
    zone.half_angle: [2 deg, 0.5]
"""


def edited(tree, **changes):
    """A configuration with some paths (double underscores for dots) replaced; None removes a key."""
    tree = deepcopy(tree)
    for path, value in changes.items():
        *parents, last = path.split("__")
        node = reduce(lambda node, key: node.setdefault(key, {}), parents, tree)
        node[last] = value
        if value is None:
            del node[last]
    return tree


#: Names of the numbers of a drive behind its amplitude.
_NUMBERS = {"power": ("exponent",), "sinusoidal": ("frequency", "phase")}


def _without(given):
    return {name: value for name, value in given.items() if value is not None}


def _zone(zone):
    half_angle, center = zone if isinstance(zone, tuple) else (zone, None)
    arc = _without({"half_angle": half_angle, "center": center})
    return {"zone": arc} if arc else {}


def particle(mass, radius, *, zone=None):
    """Body with one contact, ring, and a zone as in :func:`shape`."""
    return {"model": "ring-single-contact", "body": {"mass": mass}, "ring": {"radius": radius}} | _zone(zone)


def shape(mass, inertia, half_distance, ball_radius, radius, *, offset=None, zone=None):
    """Body with two balls, ring, and a zone: its half-angle, or half-angle and center."""
    body = {"mass": mass, "inertia": inertia, "half_distance": half_distance, "ball_radius": ball_radius}
    return {"model": "ring", "body": body | _without({"center_offset": offset}), "ring": {"radius": radius}} | _zone(
        zone
    )


def rubs(law, rest, rough=None, **parameters):
    """Friction law with pairs of a static and a kinetic coefficient."""
    pairs = {place: {"mu_s": pair[0], "mu_k": pair[1]} for place, pair in (("rest", rest), ("rough", rough)) if pair}
    return {"friction": {"law": law, **parameters, **pairs}}


def bump(rest, rough=None, *, vb, w, h):
    """Friction with a bump of the height h and the width w at the speed vb."""
    return rubs("formula", rest, rough, mu="mu_k + h*exp(-((v - vb)/w)**2)", at_rest="mu_s", vb=vb, w=w, h=h)


def course(drive, *numbers, phi=None, omega=None, span=None, e=None):
    """Drive with its numbers, launch, span and restitution."""
    driven = {"law": drive, **dict(zip(("amplitude", *_NUMBERS.get(drive, ())), numbers, strict=False))}
    parts = {"drive": driven, "initial": _without({"phi": phi, "omega": omega}), "time": _without({"span": span})}
    return {name: part for name, part in parts.items() if part} | ({} if e is None else {"impact": {"restitution": e}})
