"""
A ratchet
=========

A body on a floor with scales: it slides forwards more easily than backwards. A force of zero mean conveys it.
"""

import ringsweep
from ringsweep import plots

scene = {
    "model": "belt",
    "body": {"mass": "1 kg"},
    "spring": {"stiffness": 0.0},
    "belt": {"velocity": 0.0},
    "friction": {"law": "stiction", "mu_s": {"forward": 0.2}, "mu_k": {"forward": 0.15, "backward": 0.3}},
    "force": {"amplitude": "5 N", "frequency": "0.5 Hz"},
    "time": {"span": "40 s"},
}
grid = {
    "force.amplitude": {"linspace": ["1 N", "8 N", 40]},
    "friction.mu_s.backward": {"linspace": [0.3, 0.6, 40]},
}
maps = ringsweep.run({"scene": scene, "sweep": {"grid": grid}}, progress=False)
figure = plots.regime_map(maps, var="drift")

# %%
# One run: it slides forwards in every cycle, and backwards only under a force that exceeds the friction of that way.

run = ringsweep.simulate({**scene, "friction": {**scene["friction"], "mu_s": {"forward": 0.2, "backward": 0.4}}})
figure = plots.history(run)
