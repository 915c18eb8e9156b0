"""A mass on a spring on a moving belt."""

# Import of these modules registers bodies for functions of `ringsweep.models.interface`.
from ringsweep.models import sliding  # noqa: F401
from ringsweep.models.belt import audit, bristles, creep, rk4, series, switch, variation  # noqa: F401
from ringsweep.models.belt.model import Belt, StopBelt

__all__ = ["Belt", "StopBelt"]
