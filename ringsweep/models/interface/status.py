"""Status of a run: it goes on, or how it ended."""

from __future__ import annotations

#: The run goes on; it reached the end of the span; contact 1, contact 2 or both separated; the body jammed; a number is
#: not finite, or the run took too many steps.
RUNNING, COMPLETE, SEPARATED_1, SEPARATED_2, SEPARATED_BOTH, JAM, BROKEN = range(7)
