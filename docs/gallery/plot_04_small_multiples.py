"""
Three axes
==========

A sweep over more than two numbers makes small multiples.
"""

from pathlib import Path

import numpy as np
import yaml

import ringsweep

scene = yaml.safe_load(Path("my-sweep.yaml").read_text())["scene"]
axes = {
    "drive.amplitude": np.geomspace(0.1, 10, 24),
    "zone.half_angle": np.radians(np.linspace(2, 60, 24)),
    "friction.rough.mu_k": [0.2, 0.3, 0.4, 0.5],
}
figure = ringsweep.plots.regime_map(ringsweep.sweep(scene, axes, progress=False))
