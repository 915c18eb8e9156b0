"""
Multipliers in the unit circle
==============================

A small body on a ring that rocks. The frequency is followed up and down. The first picture shows its angle at each
period of the drive, its exponent, and the magnitudes of its Floquet multipliers. The second one shows the multipliers
in the complex plane: a pair runs around the circle while disturbances oscillate, and one is 0 where the body sticks in
each period. Near 1.4 Hz two motions exist side by side. Up to 1.5 Hz one multiplier of the smaller one is 1: the body
sticks to the ring for good, at any of many angles.
"""

import matplotlib.pyplot as plt

import ringsweep
from ringsweep import plots

scene = {
    "model": "ring-single-contact",
    "body": {"mass": 0.2},
    "ring": {"radius": 0.1},
    "friction": {"law": "stiction", "elsewhere": {"mu_s": 0.12, "mu_k": 0.08}},
    "drive": {"law": "sinusoidal", "amplitude": 1.0, "frequency": 1.0},
    "initial": {"phi": 0.4, "omega": 0.0},
    "time": {"span": 120.0},
}
config = {
    "scene": scene,
    "record": {"exponent": True, "section": {"at": "period", "keep": 32}},
    "sweep": {
        "grid": {"drive.frequency": {"linspace": [0.8, 2.4, 120]}},
        "follow": {"axis": "drive.frequency", "direction": "both"},
    },
}
rocking = ringsweep.run(config, progress=False)
figure = plots.bifurcation(rocking)

# %%
figure, ax = plt.subplots(layout="constrained")
ax = plots.multiplier_circle(rocking, ax=ax)
