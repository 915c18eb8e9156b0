"""
After a contact is lost
=======================

With ``impact`` in its scene a run goes on after a separation: the body pivots, flies and hits the ring again. The map
shows how far a contact lifts, on a logarithmic scale. The history shows a part of one run.
"""

from pathlib import Path

import numpy as np
import yaml

import ringsweep
from ringsweep import plots

scene = yaml.safe_load(Path("my-sweep.yaml").read_text())["scene"] | {"impact": {"restitution": 0.5}}
axes = {"drive.amplitude": np.geomspace(0.1, 10, 32), "zone.half_angle": np.radians(np.linspace(2, 60, 32))}
maps = ringsweep.sweep(scene, axes, progress=False)
figure = plots.regime_map(maps, var="gap_max")

# %%
# On a fast ring the body tumbles.
run = ringsweep.simulate(scene | {"drive": {"law": "arctan", "amplitude": "10 rad/s"}})
figure = plots.history(run.sel(time=slice(3.3, 4.0)))
