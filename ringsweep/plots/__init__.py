"""Pictures of datasets.

``regime_map``, ``bifurcation``, ``history``, ``fit`` and ``work_precision`` return a new figure. If pyplot is imported
and opens windows, ``plt.show()`` shows it and ``plt.close(figure)`` frees it. Elsewhere it is no figure of pyplot:
there is no global state. A function with an argument ``ax`` draws one picture in these axes and returns them. Without
``ax`` it draws in pyplot's current axes. Every picture has an opaque white background, in dark notebooks too, unless
``style`` chooses another look.
"""

import inspect

from ringsweep.plots.films import animation as animation
from ringsweep.plots.films import save_animation as save_animation
from ringsweep.plots.fits import fit as fit
from ringsweep.plots.histories import history as history
from ringsweep.plots.histories import history_panel as history_panel
from ringsweep.plots.look import REGIME_COLOURS as REGIME_COLOURS
from ringsweep.plots.look import style as style
from ringsweep.plots.maps import map_panel as map_panel
from ringsweep.plots.maps import regime_map as regime_map
from ringsweep.plots.page import save_page as save_page
from ringsweep.plots.phase import friction_loop as friction_loop
from ringsweep.plots.phase import phase_portrait as phase_portrait
from ringsweep.plots.polar import polar_view as polar_view
from ringsweep.plots.precision import precision_panel as precision_panel
from ringsweep.plots.precision import work_precision as work_precision
from ringsweep.plots.probability import probability_panel as probability_panel
from ringsweep.plots.probability import sensitivity_panel as sensitivity_panel
from ringsweep.plots.probability import survival_panel as survival_panel
from ringsweep.plots.saving import SUFFIXES as SUFFIXES
from ringsweep.plots.saving import save as save
from ringsweep.plots.sections import bifurcation as bifurcation
from ringsweep.plots.sections import bifurcation_panel as bifurcation_panel
from ringsweep.plots.sections import exponent_panel as exponent_panel
from ringsweep.plots.sections import multiplier_circle as multiplier_circle
from ringsweep.plots.sections import multiplier_panel as multiplier_panel
from ringsweep.plots.sections import section_panel as section_panel
from ringsweep.plots.selection import cell as cell

# All that is imported above.
__all__ = sorted(name for name, part in globals().items() if name[0] != "_" and not inspect.ismodule(part))
