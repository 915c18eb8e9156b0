"""Models: which parameters a scene of each kind has, and how they become what kernels take."""

import ringsweep.models.ring_series  # noqa: F401  registers the hooks of the piecewise-smooth ring
from ringsweep.models.ring import Ring, SingleContactRing

MODELS = {model.name: model for model in (Ring(), SingleContactRing())}
