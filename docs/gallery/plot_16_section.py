"""
A section in time
=================

The states of one motion at each period of the force, coloured by their order. A periodic motion is a few points; the
points of this one lie on a curve, so it never returns.
"""

import matplotlib.pyplot as plt

import ringsweep
from ringsweep import plots

scene = {
    "model": "belt",
    "gravity": 1.0,
    "body": {"mass": 1.0},
    "spring": {"stiffness": 1.0, "cubic": 1.0},
    "damper": {"coefficient": 0.02},
    "belt": {"velocity": 1.0},
    "friction": {"law": "tustin", "mu_s": 0.6, "mu_k": 0.2, "alpha": 3.0},
    "force": {"amplitude": 0.5, "frequency": 0.127},
    "initial": {"x": 0.1, "velocity": 0.0},
    "time": {"span": 16000.0},
}
run = ringsweep.run({"scene": scene, "record": {"section": {"at": "period", "keep": 2000}}}, progress=False)
figure, ax = plt.subplots(layout="constrained")
ax = plots.section_panel(run, ax)
