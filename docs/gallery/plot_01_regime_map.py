"""
A regime map
============

Every cell is one run. Its colour is the regime of the run.
"""

import ringsweep

maps = ringsweep.run("my-sweep.yaml", "my-sweep.nc", progress=False)
figure = ringsweep.plots.regime_map(maps)
