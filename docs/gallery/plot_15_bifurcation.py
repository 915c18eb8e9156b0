"""
A bifurcation diagram
=====================

The frequency of the force is followed up and down. Each run starts from the state in which the one before ended. Where
the two colours differ, two motions exist side by side. The exponent and the magnitudes of the multipliers stand below.
"""

import ringsweep
from ringsweep import plots

scene = {
    "model": "belt",
    "gravity": 1.0,
    "body": {"mass": 1.0},
    "spring": {"stiffness": 1.0, "cubic": 1.0},
    "damper": {"coefficient": 0.1},
    "belt": {"velocity": 0.3},
    "friction": {"law": "tustin", "mu_s": 0.3, "mu_k": 0.1, "alpha": 3.0},
    "force": {"amplitude": 0.6, "frequency": 0.25},
    "time": {"span": 300.0},
}
config = {
    "scene": scene,
    "record": {"exponent": True, "section": {"at": "period", "keep": 32}},
    "sweep": {
        "grid": {"force.frequency": {"linspace": [0.15, 0.4, 60]}},
        "follow": {"axis": "force.frequency", "direction": "both"},
    },
}
diagram = ringsweep.run(config, progress=False)
figure = plots.bifurcation(diagram)
