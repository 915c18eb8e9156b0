"""
Probabilities and what they depend on
=====================================

Friction is known to 10 % only. The first picture shows how likely a contact is lost, with the lines of 5, 50 and 95 %.
The others show one cell: the probability of each regime, what it depends on, and how long both contacts hold.
"""

import matplotlib.pyplot as plt
import numpy as np
import yaml

import ringsweep
from ringsweep import plots

with open("my-sweep.yaml") as file:
    scene = yaml.safe_load(file)["scene"]
of = {f"friction.{place}.mu_k": {"uniform": f"{mu} ± 10 %"} for place, mu in (("rough", 0.3), ("elsewhere", 0.1))}
of["zone.half_angle"] = {"uniform": "15 deg ± 10 %"}
grid = {"drive.amplitude": np.geomspace(0.5, 8, 16).tolist(), "time.span": np.linspace(1, 10, 10).tolist()}
config = {"scene": scene, "sweep": {"grid": grid, "sample": {"n": 64, "of": of}}}
figure = plots.regime_map(ringsweep.run(config, progress=False), sel={"word": "separating"})

# %%
# Sobol indices and survival are further parts of a sample.
sample = {"n": 256, "of": of, "sensitivity": True, "survival": np.linspace(0, 10, 51).tolist()}
one = ringsweep.run({"scene": scene | {"drive": {"law": "arctan", "amplitude": 0.75}}, "sweep": {"sample": sample}})
other, panels = plt.subplots(3, 1, figsize=(6.4, 9), layout="constrained")
for draw, ax in zip((plots.probability_panel, plots.sensitivity_panel, plots.survival_panel), panels, strict=True):
    draw(one, ax)
