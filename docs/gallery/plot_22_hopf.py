"""
Where steady sliding begins
===========================

A block on a belt that rises by 5 degrees is launched at steady slip. Its friction falls with the sliding speed, so the
damper decides: where it is weaker than the slope of friction, a small disturbance grows, and the balance is no more
than `transient`. The boundary of `steady`, by bisection, lies on the closed form of the Hopf bifurcation,
:math:`c = -F_N\\,\\mathrm{d}\\mu/\\mathrm{d}v` (red).
"""

import numpy as np

import ringsweep
from ringsweep import plots

scene = {
    "model": "belt",
    "body": {"mass": "1 kg"},
    "spring": {"stiffness": "20 N/m"},
    "damper": {"coefficient": "4 N s/m"},
    "belt": {"velocity": "0.2 m/s", "incline": "5 deg"},
    "friction": {"law": "tustin", "mu_s": 0.5, "mu_k": 0.3, "alpha": "5 s/m"},
    "initial": {"steady": "slip"},
    "time": {"span": "20 s"},
}
grid = {
    "belt.velocity": {"linspace": ["0.02 m/s", "0.8 m/s", 32]},
    "damper.coefficient": {"linspace": ["0 N s/m", "12 N s/m", 32]},
}
maps = ringsweep.run({"scene": scene, "record": {"exponent": True}, "sweep": {"grid": grid}}, progress=False)
boundary = ringsweep.boundary(maps, "steady", tolerance=1e-4)
figure = plots.regime_map(maps, var="long_run", boundaries=boundary)
speed = np.linspace(0.02, 0.8, 200)
slope = 9.81 * np.cos(np.radians(5.0)) * 5.0 * (0.5 - 0.3) * np.exp(-5.0 * speed)
figure.axes[0].plot(speed, slope, "r--", linewidth=1.0, zorder=9)
