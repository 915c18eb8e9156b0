"""Pictures of datasets.

``regime_map``, ``bifurcation``, ``history``, ``fit`` and ``work_precision`` return a new figure. If pyplot is imported
and opens windows, ``plt.show()`` shows it and ``plt.close(figure)`` frees it. Elsewhere it is no figure of pyplot:
there is no global state. A function with an argument ``ax`` draws one picture in these axes and returns them. Without
``ax`` it draws in pyplot's current axes. Every picture has an opaque white background, in dark notebooks too, unless
``style`` chooses another look.
"""

from __future__ import annotations

from ringsweep.plots.films import animation, save_animation
from ringsweep.plots.fits import fit
from ringsweep.plots.histories import history, history_panel
from ringsweep.plots.look import REGIME_COLOURS, style
from ringsweep.plots.maps import map_panel, regime_map
from ringsweep.plots.page import save_page
from ringsweep.plots.phase import friction_loop, phase_portrait
from ringsweep.plots.polar import polar_view
from ringsweep.plots.precision import precision_panel, work_precision
from ringsweep.plots.probability import probability_panel, sensitivity_panel, survival_panel
from ringsweep.plots.saving import SUFFIXES, save
from ringsweep.plots.sections import (
    bifurcation,
    bifurcation_panel,
    exponent_panel,
    multiplier_circle,
    multiplier_panel,
    section_panel,
)
from ringsweep.plots.selection import cell

__all__ = [
    "REGIME_COLOURS",
    "SUFFIXES",
    "animation",
    "bifurcation",
    "bifurcation_panel",
    "cell",
    "exponent_panel",
    "fit",
    "friction_loop",
    "history",
    "history_panel",
    "map_panel",
    "multiplier_circle",
    "multiplier_panel",
    "phase_portrait",
    "polar_view",
    "precision_panel",
    "probability_panel",
    "regime_map",
    "save",
    "save_animation",
    "save_page",
    "section_panel",
    "sensitivity_panel",
    "style",
    "survival_panel",
    "work_precision",
]
