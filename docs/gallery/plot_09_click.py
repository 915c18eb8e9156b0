"""
A map that you can click
========================

In a notebook with ``%matplotlib widget``, or in a window, a click on a cell draws its time history beside the map.
"""

import ringsweep

maps = ringsweep.run("my-sweep.yaml", "my-sweep.nc", progress=False)
figure = ringsweep.plots.explore(maps, at={"drive.amplitude": "4 rad/s", "zone.half_angle": "30 deg"})
