"""
A pulsating brake
=================

The normal load of a pad on a disc oscillates. The body sticks while the load is large and slips while it is small;
where the oscillation exceeds the weight, the contact opens.
"""

import ringsweep
from ringsweep import plots

scene = {
    "model": "belt",
    "body": {"mass": "1 kg", "load": {"formula": "A*sin(2*pi*f*t)", "A": "6 N", "f": "1 Hz"}},
    "spring": {"stiffness": "40 N/m"},
    "damper": {"coefficient": "1 N s/m"},
    "belt": {"velocity": "0.2 m/s"},
    "friction": {"law": "stiction", "mu_s": 0.4, "mu_k": 0.3},
    "time": {"span": "60 s"},
}
grid = {"body.load.f": {"linspace": [0.2, 3.0, 40]}, "body.load.A": {"linspace": ["0.5 N", "12 N", 40]}}
maps = ringsweep.run({"scene": scene, "sweep": {"grid": grid}}, progress=False)
figure = plots.regime_map(maps)

# %%
# One run; the history holds the load that was applied:

run = ringsweep.simulate({**scene, "time": {"span": "6 s"}})
figure = plots.history(run)
