"""The ring or belt and the body of a run: their measures, and the run as pictures of them need it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots.datasets import on_ring, open_contacts, phases, require_history, require_one_run
from ringsweep.quantities.variables import configuration_of


@dataclass(frozen=True)
class Rig:
    """Measures of ring and body in SI units.

    Attributes
    ----------
    body : NamedTuple
        The body as :mod:`ringsweep.physics.ring` has it.
    radius, ball : float
        Radius of the inner race and of the balls, m.
    beta : float
        Half the angle between the contacts, rad; 0 for a single contact.
    contacts : tuple of int
        ``(1,)`` or ``(1, 2)``.
    arcs : tuple of (float, float)
        Centre and half-angle of each zone in the frame of the ring, rad. Where zones overlap, the later one holds.
    half_distance, center_offset : float
        Half the distance between the centres of the balls, and that of the centre of mass from their line, m.
    """

    body: Any
    radius: float
    ball: float
    beta: float
    contacts: tuple[int, ...]
    arcs: tuple[tuple[float, float], ...]
    half_distance: float
    center_offset: float

    @classmethod
    def of(cls, ds: xr.Dataset) -> Rig:
        """Measures of the scene in the attribute ``configuration`` of a dataset."""
        # Models are slow to import, and most pictures need none.
        from ringsweep.compile import take
        from ringsweep.config import load
        from ringsweep.models import model_of
        from ringsweep.physics import ring

        scene = load(configuration_of(ds)).scene
        model: Any = model_of(scene.structure)
        bodies = model.build_body({path: np.array([value]) for path, value in scene.values.items()})
        body = take(ring.completed(bodies), 0)
        arcs = tuple((scene.values[f"{a}.center"], scene.values[f"{a}.half_angle"]) for a in scene.structure.arcs)
        beta = float(ring.contact_offset(body))
        # A body without a radius, or with a tiny one, is drawn as a ball that can be seen.
        ball = max(scene.values.get("body.ball_radius", 0.07 * body.radius), 0.02 * body.radius)
        lengths = (scene.values.get(f"body.{name}", 0.0) for name in ("half_distance", "center_offset"))
        return cls(body, float(body.radius), float(ball), beta, (1, 2) if beta else (1,), arcs, *map(float, lengths))

    def offset(self, contact: int) -> float:
        """Angle from the body to a contact, rad."""
        return -self.beta if contact == 1 else self.beta


def ring_history(ds: xr.Dataset) -> tuple[xr.Dataset, Rig]:
    """The history of one run on a ring, and its rig.

    Returns
    -------
    xarray.Dataset
        The history up to the end of the run, with the friction forces ``friction_1`` and ``friction_2``, N, positive
        the way phi grows; the angles ``alpha_1`` and ``alpha_2`` of the centres of the balls, rad; and the place ``x``,
        ``y`` of the centre of mass, m. While a contact is open, ``mode`` is ``PIVOT`` or ``FLIGHT``.
    Rig

    Raises
    ------
    InputError
        If the dataset is not the history of one run on a ring, or has no ``theta`` or no ``configuration``.
    """
    if not on_ring(require_history(ds)):
        raise InputError("ds", "is the history of a body on a belt: there is no ring to draw")
    ds = require_one_run(ds, ("phi", "theta"))
    rig = Rig.of(ds)
    if "mode" in ds:
        ds = ds.assign(mode=("time", phases(ds)))
    found = _off_race(ds, rig) if "gap_2" in ds else _on_race(ds, rig)
    return ds.assign({name: ("time", values) for name, values in found.items()}), rig


def _on_race(ds: xr.Dataset, rig: Rig) -> dict[str, NDArray[Any]]:
    """Forces and places of a body whose contacts all hold, or of one with a single contact."""
    phi, omega = ds["phi"].values, ds["omega"].values
    forces = _friction(rig.body, phi, omega, ds["epsilon"].values, [ds[f"normal_{k}"].values for k in rig.contacts])
    distance = getattr(rig.body, "xi", rig.radius - rig.ball)
    if "gap_1" in ds:
        # A particle is drawn as a ball within the race.
        distance = distance - ds["gap_1"].values
    found = {"x": distance * np.sin(phi), "y": -distance * np.cos(phi)}
    for k, force in enumerate(forces, start=1):
        found[f"friction_{k}"] = np.where(open_contacts(ds)[0], 0.0, force) if "gap_1" in ds else force
        found[f"alpha_{k}"] = phi + rig.offset(k)
    return found


def _friction(body: Any, phi: Any, omega: Any, epsilon: Any, normals: list[Any]) -> list[Any]:
    """Friction at each contact, N: that at contact 2 follows from the reactions, which are linear in it."""
    from ringsweep.physics import contact, ring

    *at_zero, first = ring.held(body, 1.0, (np.sin(phi), np.cos(phi), omega), omega**2, epsilon, 0.0)
    if len(normals) == 1:
        return [first]
    *by_F2, first_by_F2 = contact.by_friction(body)
    squares = sum(by * by for by in by_F2)
    # Where the reactions do not tell the contacts' friction apart, all of it is drawn at contact 1.
    second = sum(by * (normal - zero) for by, normal, zero in zip(by_F2, normals, at_zero, strict=True))
    second = second / squares if squares > 1e-20 else 0.0 * first
    return [first + first_by_F2 * second, second]


def _off_race(ds: xr.Dataset, rig: Rig) -> dict[str, NDArray[Any]]:
    """Forces and places of two balls that may be off the race.

    The moments about the centre of mass give the friction of the one contact that holds. If both hold, the balance
    along the line from the axis to the centre of mass is the second equation.
    """
    names = ("phi", "omega", "epsilon", "x", "y")
    psi, omega, epsilon, x, y = (ds[name].values for name in names)
    mass, distance = rig.body.mass, np.hypot(x, y)
    moment = rig.body.inertia * epsilon
    radial = -mass * distance * omega**2 + mass * rig.body.gravity * y / distance
    found, levers, shares = {}, [], []
    for k, a in ((1, rig.half_distance), (2, -rig.half_distance)):
        # From the centre of mass to the centre of the ball.
        across = -rig.center_offset * np.sin(psi) - a * np.cos(psi)
        up = rig.center_offset * np.cos(psi) - a * np.sin(psi)
        alpha = np.unwrap(np.arctan2(x + across, -y - up))
        sine, cosine = np.sin(alpha), np.cos(alpha)
        normal = ds[f"normal_{k}"].values
        moment = moment - normal * (across * cosine + up * sine)
        radial = radial - normal * (cosine * y - sine * x) / distance
        levers.append(rig.body.radius - x * sine + y * cosine)
        shares.append((cosine * x + sine * y) / distance)
        found[f"alpha_{k}"] = alpha
    (l1, l2), (s1, s2), (open_1, open_2) = levers, shares, open_contacts(ds)
    both = ~(open_1 | open_2)
    whole = np.where(both, l1 * s2 - l2 * s1, 1.0)
    found["friction_1"] = np.where(both, (moment * s2 - radial * l2) / whole, np.where(open_1, 0.0, moment / l1))
    found["friction_2"] = np.where(both, (radial * l1 - moment * s1) / whole, np.where(open_2, 0.0, moment / l2))
    return found


def belt_history(ds: xr.Dataset) -> xr.Dataset:
    """The history of one run on a belt, up to its end.

    Raises
    ------
    InputError
        If the dataset is not the history of one run on a belt, or lacks a variable.
    """
    if on_ring(require_history(ds)):
        raise InputError("ds", "is the history of a body in a ring: there is no belt to draw")
    return require_one_run(ds, ("x", "velocity", "friction_force", "belt_x", "belt_velocity", "mode"))


def has_spring(ds: xr.Dataset) -> bool:
    """Whether the body of a run on a belt hangs on a spring."""
    from ringsweep.config import load

    values = load(configuration_of(ds)).scene.values
    return any(value for path, value in values.items() if path.startswith("spring."))
