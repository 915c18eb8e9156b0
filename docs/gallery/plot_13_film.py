"""
A film
======

The body in the ring, the ring and all forces, over time. ``ringsweep animate my-sweep.yaml`` does the same.
"""

import ringsweep

run = ringsweep.simulate("my-sweep.yaml")
ringsweep.plots.save_animation(run, "film.gif", fps=10, duration=5)
