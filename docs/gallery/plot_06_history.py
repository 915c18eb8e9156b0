"""
The time history of a cell
==========================

``plots.cell`` gives the scene of one cell of a map, and ``simulate`` keeps its history.
"""

import ringsweep
from ringsweep import plots

maps = ringsweep.run("my-sweep.yaml", "my-sweep.nc", progress=False)
scene = plots.cell(maps, {"drive.amplitude": "4 rad/s", "zone.half_angle": "30 deg"})
run = ringsweep.simulate(scene)
figure = plots.history(run)
