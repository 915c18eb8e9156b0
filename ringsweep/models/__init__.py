"""Models: which parameters a scene of each kind has, and how they become what kernels take."""

import ringsweep.models.ring_series
import ringsweep.models.ring_stiff  # noqa: F401  importing them gives the solvers their hooks
from ringsweep.models.belt import Belt
from ringsweep.models.ring import Ring, SingleContactRing

MODELS = {model.name: model for model in (Ring(), SingleContactRing(), Belt())}
