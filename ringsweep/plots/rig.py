"""The ring or belt and the body of a run: their measures, and the run as pictures of them need it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from ringsweep.compile import take
from ringsweep.config import load
from ringsweep.errors import InputError
from ringsweep.models import model_of
from ringsweep.physics import ring
from ringsweep.plots.datasets import configuration, on_ring, require_history, require_one_run
from ringsweep.quantities.variables import MODES


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
    """

    body: Any
    radius: float
    ball: float
    beta: float
    contacts: tuple[int, ...]
    arcs: tuple[tuple[float, float], ...]

    @classmethod
    def of(cls, ds: xr.Dataset) -> Rig:
        """Measures of the scene in the attribute ``configuration`` of a dataset."""
        scene = load(configuration(ds)).scene
        model: Any = model_of(scene.structure)
        bodies = model.build_body({path: np.array([value]) for path, value in scene.values.items()})
        body = take(ring.completed(bodies), 0)
        arcs = tuple((scene.values[f"{a}.center"], scene.values[f"{a}.half_angle"]) for a in scene.structure.arcs)
        beta = float(ring.contact_offset(body))
        # A body without a radius, or with a tiny one, is drawn as a ball that can be seen.
        ball = max(scene.values.get("body.ball_radius", 0.07 * body.radius), 0.02 * body.radius)
        return cls(body, float(body.radius), float(ball), beta, (1, 2) if beta else (1,), arcs)

    def offset(self, contact: int) -> float:
        """Angle from the body to a contact, rad."""
        return -self.beta if contact == 1 else self.beta


def ring_history(ds: xr.Dataset) -> tuple[xr.Dataset, Rig]:
    """The history of one run on a ring, and its rig.

    Returns
    -------
    xarray.Dataset
        The history up to the end of the run, with the friction forces ``friction_1`` and ``friction_2``, N, positive
        the way phi grows.
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
    phi, first = ds["phi"].values, ds["normal_1"].values
    omega = ds["omega"].values
    _, _, *forces = ring.held(rig.body, 1.0, np.sin(phi), np.cos(phi), omega, omega**2, ds["epsilon"].values, first)
    return ds.assign({f"friction_{k}": ("time", values) for k, values in enumerate(forces, start=1)}), rig


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


def mode_name(mode: float) -> str:
    """Name of a mode for readers: stick, slip forward or slip backward."""
    return MODES[int(mode)].replace("_", " ")
