"""
A number of every run
=====================

Any variable of a sweep can be drawn. Grey cells have no value: there nothing separates within the span.
"""

import ringsweep

maps = ringsweep.run("my-sweep.yaml", "my-sweep.nc", progress=False)
figure = ringsweep.plots.regime_map(maps, var="t_separation")

# %%
# With one coordinate fixed, the map becomes a line.

figure = ringsweep.plots.regime_map(maps, var="normal_min_2", sel={"zone.half_angle": "30 deg"})
