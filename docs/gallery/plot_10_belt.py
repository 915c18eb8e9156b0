"""
A map of the belt
=================

The regimes of a belt say what the motion settles to.
"""

import ringsweep

maps = ringsweep.run("belt.yaml", "belt.nc", progress=False)
figure = ringsweep.plots.regime_map(maps)

# %%
# The share of a cycle in which the body sticks:

figure = ringsweep.plots.regime_map(maps, var="stick_share")
