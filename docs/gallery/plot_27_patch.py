"""
A patch on the belt
===================

A belt with a rough patch in every metre drags a body on a spring. Which motion follows, over speed and length of the
patch?
"""

import ringsweep
from ringsweep import plots

scene = {
    "model": "belt",
    "body": {"mass": "1 kg"},
    "spring": {"stiffness": "40 N/m"},
    "damper": {"coefficient": "1 N s/m"},
    "belt": {"period": "1 m"},
    "friction": {
        "law": "stiction",
        "rough": {"mu_s": 0.6, "mu_k": 0.3},
        "elsewhere": {"mu_s": 0.3, "mu_k": 0.2},
    },
    "zone": {"center": "0.5 m"},
    "time": {"span": "60 s"},
}
grid = {
    "belt.velocity": {"linspace": ["0.02 m/s", "0.8 m/s", 60]},
    "zone.half_length": {"linspace": ["0 m", "0.5 m", 60]},
}
maps = ringsweep.run({"scene": scene, "sweep": {"grid": grid}}, progress=False)
figure = plots.regime_map(maps)

# %%
# A belt that is alike everywhere (the lowest and the highest row) drags the body into steady sliding if it is fast
# enough; a patch of any other length keeps it swinging. Below about 0.09 m/s the body sticks in every period, however
# long the patch is. Beyond, tongues of stick-slip reach to higher speeds where patches pass the body at a fraction of
# its natural frequency, 1 Hz: near 0.31 m/s about a third of it, if the patch covers about half of the belt.
