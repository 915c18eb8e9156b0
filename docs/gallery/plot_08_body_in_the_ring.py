"""
The body in the ring
====================

One instant of a run, to scale, with all forces.
"""

import matplotlib.pyplot as plt

import ringsweep
from ringsweep import plots

run = ringsweep.simulate("my-sweep.yaml")
figure, ax = plt.subplots(figsize=(6.6, 5.2), layout="constrained")
plots.polar_view(run, 1.1, ax=ax)
