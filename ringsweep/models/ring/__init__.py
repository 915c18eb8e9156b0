"""A body that slides in a rotating ring, on two contacts or on one."""

# Import of these modules registers bodies for functions of `ringsweep.models.interface`.
from ringsweep.models.ring import audit, bristles, creep, jam, rk4, series, variation  # noqa: F401
from ringsweep.models.ring.impact import audit as _audit  # noqa: F401
from ringsweep.models.ring.impact import creep as _creep  # noqa: F401
from ringsweep.models.ring.impact import jam as _jam  # noqa: F401
from ringsweep.models.ring.impact.model import RingImpact, SingleContactImpact
from ringsweep.models.ring.model import Ring, SingleContactRing

__all__ = ["Ring", "RingImpact", "SingleContactImpact", "SingleContactRing"]
