"""The models of a body in the ring that goes on after a contact is lost.

Nothing here runs in kernels. A scene with the section ``impact`` takes these models in place of those of the ring.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ringsweep.errors import InputError
from ringsweep.models.parts import drive_of
from ringsweep.models.ring import record as of_ring
from ringsweep.models.ring.impact.record import OUTCOMES
from ringsweep.models.ring.impact.rows import EVENT, HISTORY
from ringsweep.models.ring.model import Ring, SingleContactRing
from ringsweep.models.scene import Structure, Values, require
from ringsweep.physics import friction, ring
from ringsweep.physics.impact import Balls, ImpactRing
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.variables import Variable

RESTITUTION = Parameter("1", "coefficient of restitution", lower=0.0, upper=1.0)

# For certificates only.
_HIDDEN = frozenset({"word", "impact_violation"})


class SingleContactImpact(SingleContactRing):
    """A small body on one contact with the ring that falls back on it."""

    outcomes: ClassVar[tuple[str, ...]] = (*of_ring.Outcome._fields, *OUTCOMES)
    absent: ClassVar[frozenset[str]] = SingleContactRing.absent | _HIDDEN | {"gap_2"}
    own_variables: ClassVar[dict[str, Variable]] = {
        "x": Variable("m", "place of the centre of mass to the right of the axis")
    }

    def scene_type(self, structure: Structure) -> type:
        """``ImpactRing``; without impact that of the closed ring."""
        return ImpactRing if structure.impact else super().scene_type(structure)

    def history(self, structure: Structure) -> tuple[str, ...]:
        """Names of the history variables, in the order of their columns; then those of the last event."""
        return (*HISTORY, *(f"event_{name}" for name in EVENT))

    def parameters(self, structure: Structure) -> dict[str, Parameter]:
        """Parameters of a scene of this structure, by path."""
        return super().parameters(structure) | {"impact.restitution": RESTITUTION}

    def build(self, structure: Structure, values: Values) -> Any:
        """Cells that kernels run over; see :meth:`ringsweep.models.model.Model.build`."""
        for path in structure.by_direction:
            problem = "friction cannot depend on the direction of sliding beside impact: leave one of them out"
            raise InputError(f"scene.{path}", problem)
        # First, since the drive of a ring without impact may jump.
        drive = drive_of(structure, values)
        closed: Any = super().build(replace(structure, impact=False), values)
        balls = self.balls(values, closed.body)
        return ImpactRing(
            closed=closed,
            turned=closed._replace(body=self.turned(closed.body, balls)),
            law=closed.law,
            drive=drive,
            span=closed.span,
            balls=balls,
            restitution=values["impact.restitution"],
            has_kinetic=np.full(len(closed.span), float("mu_k" in friction.coefficients_of(structure.law_type))),
        )

    def balls(self, values: Values, body: Any) -> Balls:
        """Shapes of the bodies."""
        nothing = np.zeros(len(body.radius))
        return Balls(body.radius, nothing, nothing, nothing)

    def turned(self, body: Any, balls: Balls) -> Any:
        """Bodies whose contacts have changed places."""
        return body


class RingImpact(SingleContactImpact, Ring):
    """Two balls joined by a rod that fall back on the ring."""

    absent = Ring.absent | _HIDDEN

    def balls(self, values: Values, body: Any) -> Balls:
        """Shapes of the bodies."""
        require(
            values["body.inertia"] > 0.0,
            "body.inertia",
            values["body.inertia"],
            "{} kg m^2: a body without inertia cannot turn on one contact; it must be greater than 0 beside impact",
        )
        r = values["body.ball_radius"]
        return Balls(body.radius - r, r, values["body.half_distance"], values["body.center_offset"])

    def turned(self, body: Any, balls: Balls) -> Any:
        """Bodies whose contacts have changed places: seen from the body, the axis is on the other side."""
        xi = balls.offset - balls.reach * body.cos_beta
        return ring.completed(body._replace(xi=xi, beta=np.pi - body.beta, cos_beta=-body.cos_beta))
