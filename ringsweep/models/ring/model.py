"""The ring as a model: its parameters, their consistency, and its cells.

Nothing here runs in kernels. `structure` says which parts a scene has, `values` are its numbers in SI units by path,
of shape ``(cells,)``; see :mod:`ringsweep.models.scene`.
"""

from __future__ import annotations

from collections.abc import Collection
from math import inf, pi
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.models import section, tangent
from ringsweep.models.interface.variation import Exponent
from ringsweep.models.model import Continues, Model, period_of, phases
from ringsweep.models.parts import GRAVITY, MASS, SPAN, drive_of, law_of, surface_from, zone_parameters
from ringsweep.models.ring import long_run, record
from ringsweep.models.ring.series import HISTORY
from ringsweep.models.scene import Structure, Values, require
from ringsweep.physics import PAPER, contact, drives, friction, ring, zones
from ringsweep.physics.friction.presliding import steady_deflection
from ringsweep.quantities.parameters import Parameter, declared

#: Variables of a point of a section: angle and angular velocity, and under a law with bristles their deflections.
SECTION = "phi_section", "omega_section", "deflection_1_section", "deflection_2_section"

RADIUS = Parameter("m", "radius of the inner race", lower=0.0, open_lower=True)


def _is_recorded(structure: Structure) -> bool:
    """Whether a run records what its motion settles to."""
    return structure.exponent or structure.section is not None


# Variables that a body with one contact lacks.
_OF_CONTACT_2 = frozenset(
    {"normal_min_2", "normal_min_2_error", "normal_max_2", "normal_max_2_error", "normal_2", "zone_2", "deflection_2"}
)


class SingleContactRing(Model, Continues):
    """A small body on one contact with the ring (the paper's Fig. 13)."""

    name: ClassVar[str] = "ring-single-contact"
    doc: ClassVar[str] = "a small body in a rotating ring, one contact"
    reference: ClassVar[str] = PAPER
    outcomes: ClassVar[tuple[str, ...]] = record.Outcome._fields
    place: ClassVar[str] = "phi"
    ends: ClassVar[tuple[str, ...]] = ("phi_end", "omega_end")
    driven: ClassVar[tuple[str, ...]] = ("theta",)
    absent: ClassVar[frozenset[str]] = _OF_CONTACT_2
    body: ClassVar[dict[str, Parameter]] = {"body.mass": MASS, "ring.radius": RADIUS}
    has_exponent: ClassVar[bool] = True
    sections: ClassVar[tuple[str, ...]] = ("period",)
    contacts: ClassVar[int] = 1
    """Number of contacts: that of the balances of the body."""

    body_type: ClassVar[type] = ring.OneContact
    """Type of the body, which :func:`ring.body` declares."""

    def __init_subclass__(cls) -> None:
        """Take the number of contacts from the balances.

        Raises
        ------
        TypeError
            If the type of the body is not declared.
        """
        super().__init_subclass__()
        try:
            cls.contacts = ring.equations_of(cls.body_type).contacts
        except KeyError:
            raise TypeError(
                f"model {cls.name}: body_type {cls.body_type.__name__} is not declared by ring.body"
            ) from None
        if "absent" not in vars(cls):
            cls.absent = _OF_CONTACT_2 if cls.contacts == 1 else frozenset()

    def columns(self, structure: Structure) -> tuple[str, ...]:
        """Outcomes, and after them what is asked for: words of the long run, exponent and multipliers, the section."""
        words = long_run.OUTCOMES if _is_recorded(structure) else ()
        exponent = tangent.OUTCOMES if structure.exponent else ()
        return (*self.outcomes, *words, *exponent, *section.columns(structure.section, self._point))

    @property
    def _point(self) -> tuple[str, ...]:
        """Outcomes of a point of the section: angle, angular velocity, and the deflection at each contact."""
        return SECTION[: 2 + self.contacts]

    def obstacle(self, structure: Structure) -> str | None:
        """Why runs of this structure cannot go on: their state is more than angle and angular velocity."""
        if structure.impact:
            return "with impact, the state of a run is more than angle and angular velocity: leave impact out"
        if self._has_bristles(structure):
            return f"law {structure.law} has deflections, with which no run on a ring can start: choose another law"
        return None

    def continued(self, structure: Structure, values: Values, ended: Values) -> dict[str, NDArray[np.float64]]:
        """Angle without full turns, angular velocity and phase of the drive at the end of other runs."""
        phi = (ended["phi_end"] + pi) % (2.0 * pi) - pi
        return {"initial.phi": phi, "initial.omega": ended["omega_end"]} | phases(("drive",), values, ended)

    def forcing_period(self, structure: Structure, values: Values) -> NDArray[np.float64]:
        """Period of the drive, s; infinite if there is none."""
        drive, cells = drive_of(structure, values), len(values["time.span"])
        # Zones turn with the ring: its angle must return, not only its velocity.
        period = drives.force_period(drive) if structure.arcs else drives.period(drive)
        return period_of(structure, np.broadcast_to(np.where(period == 0.0, inf, period), cells).copy())

    def regimes(self, paths: Collection[str]) -> tuple[str, ...]:
        """Regimes that runs can have."""
        return "resting", "oscillatory", "revolving", "separating", "jammed", "failed"

    def takes(self, law: type) -> bool:
        """Laws without a dead band; those with a memory need bristles and ``steady_deflection``."""
        traits = friction.TRAITS[law]
        if traits.family is friction.Dynamic:
            return traits.state == "deflection" and steady_deflection.body_of(law) is not None
        return not traits.dead_band

    def scene_type(self, structure: Structure) -> type:
        """``BristleRing`` for laws with bristles, else ``Ring``."""
        return ring.BristleRing if self._has_bristles(structure) else ring.Ring

    def required(self, structure: Structure) -> dict[type, tuple[Any, ...]]:
        """Hooks of the recorder."""
        if self.contacts == 2 and contact.opening.body_of(self.body_type) is contact.opening.body_of(object):
            raise TypeError(
                f"model {self.name}: {self.body_type.__name__} has no contact.opening, which says which contact opens"
            )
        return super().required(structure)

    def _has_bristles(self, structure: Structure) -> bool:
        """Whether the friction law has bristles."""
        return friction.family_of(structure.law_type) is friction.Dynamic

    def history(self, structure: Structure) -> tuple[str, ...]:
        """Names of the history variables, in the order of their columns."""
        return (*HISTORY, "deflection_1", "deflection_2") if self._has_bristles(structure) else HISTORY

    def parameters(self, structure: Structure) -> dict[str, Parameter]:
        """Parameters of a scene of this structure, by path."""
        found = dict(self.body)
        found |= zone_parameters(structure, zones.Arc, "the rest of the ring")
        found |= {f"drive.{name}": p for name, p in declared(structure.drive_type).items()}
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
        """Cells that kernels run over; see :meth:`ringsweep.models.model.Model.build`."""
        surface, surfaces = surface_from(structure, values, zones.Arc)
        try:
            body = self.build_body(values)
        except KeyError as error:
            known = ", ".join(self.parameters(structure))
            raise InputError(
                "scene.model", f"{self.name}: no parameter {error} for its body (known: {known})"
            ) from None
        except InputError:
            raise
        except Exception as error:
            # Code of the user's own may fail in any way.
            hint = "values are arrays with one number for each cell, so use NumPy for functions of them"
            problem = f"{self.name}: build_body fails with {type(error).__name__}: {error} ({hint})"
            raise InputError("scene.model", problem) from error
        cells = len(values["time.span"])
        body = body._replace(
            **{name: np.full(cells, field) for name, field in body._asdict().items() if np.isscalar(field)}
        )
        try:
            body = ring.completed(body)
        except ValueError as error:
            raise InputError("scene.model", f"{self.name}: {error}") from None
        return self.scene_type(structure)(
            body=body,
            surface=surface,
            law=law_of(structure, values, surfaces, np.sqrt(body.gravity * body.radius)),
            drive=drive_of(structure, values),
            initial_phi=values["initial.phi"],
            initial_omega=values["initial.omega"],
            span=values["time.span"],
            epsilon_omega=values["classify.epsilon_omega"],
            **(self._recorded(structure, values, body) if _is_recorded(structure) else {}),
        )

    def _recorded(self, structure: Structure, values: Values, body: Any) -> dict[str, Any]:
        """Fields of a cell for what is asked for beyond the outcomes."""
        period, span = self.forcing_period(structure, values), values["time.span"]
        with np.errstate(divide="ignore"):
            pace = np.minimum(2.0 * pi * np.sqrt(body.radius / body.gravity), period)
        found: dict[str, Any] = {"forcing_period": period, "long_run": long_run.Asked(pace)}
        if structure.exponent:
            if self._has_bristles(structure):
                problem = (
                    f"friction law {structure.law} has none on a ring: choose a law without bristles, or leave it out"
                )
                raise InputError("record.exponent", problem)
            rate = np.maximum(np.sqrt(body.gravity / body.radius), 2.0 * pi / np.minimum(period, span))
            found["asked"] = Exponent.of(body.radius * rate)
        if structure.section is not None:
            found["section"] = section.field(structure.section, self._point, len(span))
        return found

    def build_body(self, values: Values) -> Any:
        """Bodies of the cells: a ``NamedTuple`` of type :attr:`body_type` with arrays of shape ``(cells,)``."""
        return ring.OneContact(values["body.mass"], values["ring.radius"], values["gravity"])


class Ring(SingleContactRing):
    """Two balls joined by a rod, sliding in the ring (the paper's Fig. 22)."""

    name = "ring"
    body_type = ring.TwoContacts
    doc = "a two-contact body in a rotating ring"
    body: ClassVar[dict[str, Parameter]] = {
        "body.mass": MASS,
        "body.inertia": Parameter("kg m^2", "central moment of inertia of the body", lower=0.0),
        "body.half_distance": Parameter(
            "m", "half the distance between the centres of the balls", lower=0.0, open_lower=True
        ),
        "body.ball_radius": Parameter("m", "radius of the balls", lower=0.0),
        "body.center_offset": Parameter(
            "m", "distance of the centre of mass from the line of the balls, away from the axis", default=0.0
        ),
        "body.beta": Parameter(
            "rad", "half the angle that the contacts subtend", 0.0, pi / 2, True, True, optional=True
        ),
        "ring.radius": Parameter("m", "radius of the inner race", lower=0.0, open_lower=True, optional=True),
    }

    def build_body(self, values: Values) -> ring.TwoContacts:
        """Bodies of the cells, from half distance, ball radius, and either ring radius or angle beta.

        Raises
        ------
        InputError
            If both ring radius and beta are missing or contradict each other, or if the ring is too small.
        """
        a, r = values["body.half_distance"], values["body.ball_radius"]
        given = "ring.radius" in values, "body.beta" in values
        if not any(given):
            require(False, "ring.radius", np.nan, "missing: give ring.radius or body.beta")
        if given[0]:
            R = values["ring.radius"]
            require(
                r + a < R,
                "ring.radius",
                R,
                "{} m is too small: it must exceed ball_radius + half_distance of the body",
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
        return ring.TwoContacts(
            mass=values["body.mass"],
            inertia=values["body.inertia"],
            radius=R,
            xi=(R - r) * cos_beta + values["body.center_offset"],
            beta=np.arcsin(sin_beta),
            sin_beta=sin_beta,
            cos_beta=cos_beta,
            gravity=values["gravity"],
        )
