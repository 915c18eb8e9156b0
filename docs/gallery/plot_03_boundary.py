"""
A boundary as a curve
=====================

Certified runs locate the boundary of a regime by bisection. The map has 32 x 32 cells. The error
of the curves is at most 1e-4 rad/s and 1e-4 rad.
"""

import ringsweep

maps = ringsweep.run("my-sweep.yaml", "my-sweep.nc", progress=False)
curves = ringsweep.boundary(maps, "separating", tolerance=1e-4)
figure = ringsweep.plots.regime_map(maps, boundaries=curves)
