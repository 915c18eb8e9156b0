"""
A phase portrait
================

The angular velocity of the body over its angle, seen from outside and in the frame of the ring.
"""

import matplotlib.pyplot as plt

import ringsweep
from ringsweep import plots

maps = ringsweep.run("my-sweep.yaml", "my-sweep.nc", progress=False)
scene = plots.cell(maps, {"drive.amplitude": "0.4 rad/s", "zone.half_angle": "30 deg"})
run = ringsweep.simulate(scene)

figure, axes = plt.subplots(2, 1, figsize=(7.6, 8), layout="constrained")
for ax, frame in zip(axes, ("space", "ring"), strict=True):
    plots.phase_portrait(run, frame, ax=ax)
