"""How a run stands, or how it ended."""

from __future__ import annotations

#: How a run stands or ended.
RUNNING, COMPLETE, SEPARATED_1, SEPARATED_2, SEPARATED_BOTH, JAM, BROKEN = range(7)
