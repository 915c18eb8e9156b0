"""Values of the classification of runs. They stand in machine code."""

from __future__ import annotations

#: Regimes in the order of their flag values.
REGIMES = (
    *("resting", "oscillatory", "revolving", "separating", "jammed", "failed", "stick-slip"),
    *("sliding", "sticking", "riding"),
)
RESTING, OSCILLATORY, REVOLVING, SEPARATING, JAMMED, FAILED, STICK_SLIP, SLIDING, STICKING, RIDING = range(10)
