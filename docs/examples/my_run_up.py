"""A drive with functions of its own, as a drive needs them that is no formula."""

from math import exp
from typing import Annotated, NamedTuple

from ringsweep.physics.drives import add_drive, expand, jerk, shape
from ringsweep.quantities.parameters import Leaf, Parameter


class RunUp(NamedTuple):
    """A ring that runs up to a constant speed: d theta/dt = amplitude (1 - exp(-t/tau))."""

    amplitude: Annotated[Leaf, Parameter("rad/s", "final angular velocity of the ring")]
    tau: Annotated[Leaf, Parameter("s", "time constant of the run-up", lower=0.0, open_lower=True)]


@shape.implements(RunUp)
def _shape(drive, t):
    rest = exp(-t / drive.tau)
    return t - drive.tau * (1.0 - rest), 1.0 - rest, rest / drive.tau


@expand.implements(RunUp)
def _expand(drive, t, order, theta, work):
    # Each term is the one before times -1/(k tau), but for the straight line t - tau.
    term = drive.amplitude * drive.tau * exp(-t / drive.tau)
    for k in range(order + 1):
        theta[k] = term
        term = -term / ((k + 1.0) * drive.tau)
    theta[0] += drive.amplitude * (t - drive.tau)
    theta[1] += drive.amplitude


@jerk.implements(RunUp)
def _jerk(drive, t):
    return -drive.amplitude / (drive.tau * drive.tau) * exp(-t / drive.tau)


add_drive("run-up", RunUp)
