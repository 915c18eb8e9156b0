"""
A fit to a measured history
===========================

The friction of the zone is fitted to a measured angle, here an invented one with noise of half a degree.
"""

import numpy as np

import ringsweep
from ringsweep import plots
from ringsweep.runs.fit import dataset

t = np.linspace(0.0, 3.0, 151)
run = ringsweep.simulate("my-sweep.yaml", set={"friction.rough.mu_k": 0.27})
measured = run.ringsweep.at(t).phi.values + np.radians(0.5) * np.random.default_rng(1).standard_normal(t.size)
found = ringsweep.fit("my-sweep.yaml", {"t": t, "phi": measured}, "friction.rough.mu_k=0.1..0.4")
figure = plots.fit(dataset(found))
print(found.params["friction_rough_mu_k"])
