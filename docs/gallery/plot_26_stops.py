"""
Between end stops
=================

A force shakes a body between two stops on a belt. The map shows the hardest impact. The history shows rebounds that end
in a rest at the stop.
"""

import numpy as np

import ringsweep
from ringsweep import plots

scene = {
    "model": "belt",
    "body": {"mass": "1 kg"},
    "spring": {"stiffness": "10 N/m"},
    "belt": {"velocity": "0.2 m/s"},
    "friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.1},
    "force": {"amplitude": "4 N", "frequency": "0.4 Hz"},
    "stops": {"low": "-10 cm", "high": "20 cm", "restitution": 0.6},
    "time": {"span": "60 s"},
}
axes = {"force.frequency": np.linspace(0.1, 2.0, 32), "force.amplitude": np.linspace(0.5, 8.0, 32)}
maps = ringsweep.sweep(scene, axes, progress=False)
figure = plots.regime_map(maps, var="impact_speed_max")

# %%
run = ringsweep.simulate(scene)
figure = plots.history(run.sel(time=slice(0.0, 6.0)))
