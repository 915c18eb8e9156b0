"""
Basins
======

Which motion a launch ends on: a body on a belt slides steadily, or sticks and slips, and the launch decides.
"""

import numpy as np

import ringsweep
from ringsweep import plots

scene = {
    "model": "belt",
    "gravity": 1.0,
    "body": {"mass": 1.0},
    "spring": {"stiffness": 1.0},
    "damper": {"coefficient": 0.1},
    "belt": {"velocity": 1.5},
    "friction": {"law": "tustin", "mu_s": 1.0, "mu_k": 0.5, "alpha": 2.0},
    "time": {"span": 600.0},
}
config = {
    "scene": scene,
    "record": {"section": {"at": "turn", "keep": 8}},
    "sweep": {"grid": {
        "initial.x": np.linspace(-1.95, 1.95, 40).tolist(),
        "initial.velocity": np.linspace(0.025, 1.975, 40).tolist(),
    }},
}  # fmt: skip
basins = ringsweep.attractors(ringsweep.run(config, progress=False))
figure = plots.regime_map(basins, var="attractor")

# %%
# The share of the launches on each motion, with its standard error:
print(basins[["share", "share_error"]].to_dataframe())
