"""
Friction that ages
==================

A block of rock is dragged at 1 nm/s by a spring softer than the critical one, :math:`F_N (b - a)/D_c` (Ruina 1983). Its
contacts age for months and break loose within milliseconds: the sliding speed spans more than ten decades.
"""

import matplotlib.pyplot as plt

import ringsweep

scene = {
    "model": "belt",
    "body": {"mass": "1 kg"},
    "spring": {"stiffness": "500 N/m"},
    "belt": {"velocity": "1 nm/s"},
    "friction": {
        "law": "dieterich", "mu0": 0.6, "a": 0.010, "b": 0.015,
        "critical_distance": "10 um", "reference_velocity": "1 um/s",
    },
    "initial": {"x": "11.8 mm", "velocity": "0 m/s", "contact_age": "1000 s"},
    "time": {"span": 2e7},
}  # fmt: skip
run = ringsweep.simulate(scene)
days, speed = run.time / 86400.0, abs(run.velocity - run.belt_velocity)

figure, axes = plt.subplots(3, 1, sharex=True, figsize=(7.6, 7), layout="constrained")
axes[0].semilogy(days, speed)
axes[1].semilogy(days, run.contact_age)
axes[2].plot(days, abs(run.friction_force))
for ax, label in zip(axes, ("sliding speed in m/s", "age of the contacts in s", "friction in N"), strict=True):
    ax.set_ylabel(label)
axes[2].set_xlabel("time in days")
