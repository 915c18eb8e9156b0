"""
Maps in a figure of your own
============================

``map_panel`` draws into axes of yours. Here one sweep is computed twice: by Runge-Kutta 4 with 5000 steps, and with all
events located. The maps differ in kind. No cell of the left map is certified: its legend says so.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import yaml

import ringsweep

scene = yaml.safe_load(Path("my-sweep.yaml").read_text())["scene"]
scene["friction"] |= {"law": "bengisu-akay", "alpha": "1e5 s/m", "v0": "2e-6 m/s"}
axes = {"drive.amplitude": np.geomspace(0.1, 10, 32), "zone.half_angle": np.radians(np.linspace(2, 60, 32))}

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), sharey=True, layout="constrained")
for ax, solver in ((left, {"method": "rk4", "steps": 5000}), (right, {"method": "auto"})):
    maps = ringsweep.sweep(scene, axes, solver=solver, progress=False)
    ringsweep.plots.map_panel(maps, ax=ax).set_title(solver["method"])
