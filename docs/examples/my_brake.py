"""A body on two contacts: the shoes of a drum brake, each pressed on or lifted by the friction of the other."""

from math import copysign
from typing import NamedTuple

from ringsweep.models import add_model
from ringsweep.models.ring import SingleContactRing
from ringsweep.physics import contact, ring
from ringsweep.quantities.parameters import Leaf, Parameter


@ring.body(
    balances=(
        "N1 = force + onto_1*K2*N2",
        "N2 = force + onto_2*K1*N1",
        "mass*radius*phi_dd = K1*N1 + K2*N2 - mass*gravity*sin_phi",
    ),
    energy="mass*radius*(0.5*radius*omega**2 - gravity*cos_phi)",
    offset="apart",
)
class Shoes(NamedTuple):
    """Two shoes: `force` presses on each one, N; the friction of the other one adds `onto` times its value."""

    mass: Leaf
    radius: Leaf
    gravity: Leaf
    force: Leaf
    onto_1: Leaf
    onto_2: Leaf
    apart: Leaf
    constants: tuple[Leaf, ...] = ()


@contact.opening.implements(Shoes)
def _opening(body, friction, static, slides, motion, epsilon):
    K1, K2 = friction
    if slides == 0:
        # At rest `friction` has magnitudes. A shoe that is alone holds the body, or slips in the way it is pulled.
        needed = body.mass * (body.gravity * motion[0] + body.radius * epsilon) / body.force
        K1 = needed if abs(needed) <= static[0] else copysign(K1, needed)
        K2 = needed if abs(needed) <= static[1] else copysign(K2, needed)
    # A shoe opens if the other one, alone under its force, lifts it.
    opens_1, opens_2 = 1.0 + body.onto_1 * K2 <= 0.0, 1.0 + body.onto_2 * K1 <= 0.0
    if opens_1:
        return contact.OPEN_BOTH if opens_2 else contact.OPEN_1
    return contact.OPEN_2 if opens_2 else contact.IMPOSSIBLE


class Brake(SingleContactRing):
    """The shoes of a drum brake."""

    name = "brake"
    doc = "two shoes in a drum"
    body_type = Shoes
    body = SingleContactRing.body | {
        "shoes.force": Parameter("N", "force on each shoe", lower=0.0, open_lower=True),
        "shoes.onto_1": Parameter("1", "load of shoe 1 for each newton of friction at shoe 2"),
        "shoes.onto_2": Parameter("1", "load of shoe 2 for each newton of friction at shoe 1"),
        "shoes.apart": Parameter("rad", "half the angle between the shoes"),
    }

    def build_body(self, values):
        names = "body.mass", "ring.radius", "gravity", "shoes.force", "shoes.onto_1", "shoes.onto_2", "shoes.apart"
        return Shoes(*(values[name] for name in names))


add_model(Brake())
