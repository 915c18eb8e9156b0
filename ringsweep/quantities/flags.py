"""Values of the classifications of runs. Kernels and solvers use them; names and meanings are in ``variables``."""

from __future__ import annotations

#: Regimes in the order of their flag values.
REGIMES = (
    *("resting", "oscillatory", "revolving", "separating", "jammed", "failed", "stick-slip"),
    *("sliding", "sticking", "riding"),
)
RESTING, OSCILLATORY, REVOLVING, SEPARATING, JAMMED, FAILED, STICK_SLIP, SLIDING, STICKING, RIDING = range(10)

#: What a motion settles to, in the order of the flag values.
LONG_RUNS = ("rest", "steady", "periodic", "quasi-periodic", "chaotic", "unbounded", "transient")
REST, STEADY, PERIODIC, QUASI_PERIODIC, CHAOTIC, UNBOUNDED, TRANSIENT = range(7)

#: Why a cell has no certificate: flag values of `DOUBTS`.
CERTIFIED, NOT_ASKED, NO_RESULT, ANSWERS_DIFFER, LAW_NOT_OBEYED = range(5)
CLOSE_CALL, NOT_FINITE, SAME_STEPS, DIVERGES, COARSE = range(5, 10)

#: What becomes of a run after a contact is lost, in the order of the flag values.
AFTERMATHS = ("held", "recovered", "open", "tumbled")
HELD, RECOVERED, OPEN, TUMBLED = range(4)
