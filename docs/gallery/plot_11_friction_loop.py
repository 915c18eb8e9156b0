"""
A friction loop
===============

The friction force over the sliding velocity, and over the distance slid, under LuGre's law. The belt is at rest, and
a force shakes the body.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import yaml

import ringsweep
from ringsweep import plots

scene = yaml.safe_load(Path("belt.yaml").read_text())["scene"]
scene["friction"] = {
    "law": "lugre", "mu_s": 0.15, "mu_k": 0.1,
    "v_s": "1 cm/s", "sigma0": "1e3 N/m", "sigma1": "30 N s/m", "sigma2": "0.1 N s/m",
}  # fmt: skip
scene["belt"]["velocity"] = 0
scene["force"] = {"amplitude": "2 N", "frequency": "0.1 Hz"}
scene["time"] = {"span": "30 s"}
run = ringsweep.simulate(scene)

figure, axes = plt.subplots(2, 1, figsize=(7.6, 7), layout="constrained")
for ax, over in zip(axes, ("velocity", "distance"), strict=True):
    plots.friction_loop(run, over, ax=ax)
