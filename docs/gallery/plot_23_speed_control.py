"""
A speed controller that hunts
=============================

A slide is driven along a guide at a set speed by a controller with proportional and integral action. Seen from the set
place, where the integral of the error of the speed is the displacement, integral action is a spring, proportional
action is a damper, and the guide is a belt that moves backwards at the set speed. The slide starts at rest on the
guide: the integral winds up until static friction yields. Below about 0.1 m/s the slide stops again and again, whatever
the integral gain.
"""

import ringsweep
from ringsweep import plots

scene = {
    "model": "belt",
    "body": {"mass": "1 kg"},
    "spring": {"stiffness": "20 N/m"},  # integral gain, N/s for an error of 1 m/s
    "damper": {"coefficient": "4 N s/m"},  # proportional gain
    "belt": {"velocity": "-0.1 m/s"},  # minus the set speed
    "friction": {"law": "tustin", "mu_s": 0.3, "mu_k": 0.2, "alpha": "10 s/m"},
    "time": {"span": "120 s"},
}
axes = {
    "spring.stiffness": {"geomspace": ["1 N/m", "100 N/m", 48]},
    "belt.velocity": {"linspace": ["-0.3 m/s", "-0.005 m/s", 48]},
}
maps = ringsweep.run({"scene": scene, "sweep": {"grid": axes}}, progress=False)
figure = plots.regime_map(maps)

# %%
run = ringsweep.simulate(scene, set={"belt.velocity": "-0.05 m/s"})
figure = plots.history(run)
