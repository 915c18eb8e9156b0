"""Datasets into pictures.

``regime_map``, ``history`` and ``work_precision`` make a figure of their own and return it, without pyplot: no global
state, no display, safe in threads. Functions that take an ``ax`` draw one picture there and return it, as seaborn's
do; without it they draw in pyplot's current axes. Every picture has an opaque white ground, in dark notebooks too.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ringsweep.plots.style import REGIME_COLOURS, SUFFIXES, save

if TYPE_CHECKING:
    from ringsweep.plots.histories import history, history_panel
    from ringsweep.plots.interactive import cell, explore
    from ringsweep.plots.maps import map_panel, regime_map
    from ringsweep.plots.motion import animation, save_animation
    from ringsweep.plots.precision import precision_panel, work_precision
    from ringsweep.plots.ring import phase_portrait, polar_view

__all__ = [
    "REGIME_COLOURS",
    "SUFFIXES",
    "animation",
    "cell",
    "explore",
    "history",
    "history_panel",
    "map_panel",
    "phase_portrait",
    "polar_view",
    "precision_panel",
    "regime_map",
    "save",
    "save_animation",
    "work_precision",
]

_HOMES = {
    "regime_map": "maps",
    "map_panel": "maps",
    "history": "histories",
    "history_panel": "histories",
    "work_precision": "precision",
    "precision_panel": "precision",
    "phase_portrait": "ring",
    "polar_view": "ring",
    "animation": "motion",
    "save_animation": "motion",
    "cell": "interactive",
    "explore": "interactive",
}


def __getattr__(name: str) -> Any:
    # A map needs neither the ring's geometry nor what writes films.
    if name in _HOMES:
        return getattr(import_module(f"ringsweep.plots.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'ringsweep.plots' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*globals(), *_HOMES]
