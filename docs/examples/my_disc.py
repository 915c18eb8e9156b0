"""A body that moves round an axis, on one contact."""

from math import pi
from typing import NamedTuple

import numpy as np

from ringsweep.models import add_model
from ringsweep.models.ring import SingleContactRing
from ringsweep.physics import ring
from ringsweep.quantities.parameters import Leaf, Parameter


@ring.body(
    balances=("N1 = mass*press", "mass*radius*phi_dd = K1*N1 - mass*pull*sin_phi"),
    energy="mass*radius*(0.5*radius*omega**2 - pull*cos_phi)",
)
class OnDisc(NamedTuple):
    """A body on an inclined disc; `press` is g cos(slope), `pull` is g sin(slope), m/s^2."""

    mass: Leaf
    radius: Leaf
    gravity: Leaf
    press: Leaf
    pull: Leaf
    constants: tuple[Leaf, ...] = ()


class Disc(SingleContactRing):
    """A body on the arm of a rotating inclined disc with zones."""

    name = "disc"
    doc = "a body on a rotating inclined disc"
    body_type = OnDisc
    slope = Parameter("rad", "angle between the disc and the horizontal", lower=0.0, upper=0.5 * pi)
    body = SingleContactRing.body | {"disc.slope": slope}

    def build_body(self, values):
        gravity, slope = values["gravity"], values["disc.slope"]
        press, pull = gravity * np.cos(slope), gravity * np.sin(slope)
        return OnDisc(values["body.mass"], values["ring.radius"], gravity, press, pull)


add_model(Disc())
