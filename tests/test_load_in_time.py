"""A normal load on the belt that varies in time."""

import numpy as np
import pytest
from belts import on_belt, outcome
from test_functions_of_time import cells_of

import ringsweep


def braked(load, friction=None, **rest):
    """A body of 1 kg on the belt with a load beside its weight."""
    friction = friction or {"law": "stiction", "mu_s": 0.3, "mu_k": 0.2}
    scene = on_belt(friction, **({"stiffness": 2.0, "velocity": 0.0, "span": 6.0} | rest))
    return scene | {"body": {"mass": 1.0, "load": load}}


def falling(rate):
    """A load that falls from 0 N."""
    return {"formula": "-rate*t", "rate": f"{rate} N/s"}


def pulsating(amplitude, frequency):
    """A load that oscillates about 0 N."""
    return {"formula": "A*sin(2*pi*f*t)", "A": f"{amplitude} N", "f": f"{frequency} Hz"}


def test_stuck_body_breaks_loose_as_the_load_falls_to_its_pull():
    run = outcome(braked(falling(2.0), start=(0.6, 0.0)))
    assert run.first_slip.item() == pytest.approx((9.81 - 2.0 * 0.6 / 0.3) / 2.0, rel=1e-13)
    assert run.certified.item() == 1


def test_contact_opens_where_the_load_has_taken_the_weight_away():
    run = outcome(braked(falling(2.0)))
    assert ringsweep.quantities.flags.REGIMES[run.regime.item()] == "separating"
    assert run.t_end.item() == pytest.approx(9.81 / 2.0, rel=1e-13)


@pytest.mark.parametrize("amplitude", [4.0, 9.81])
def test_a_body_that_slides_on_is_driven_by_a_pulsating_load(amplitude):
    """A load of the amplitude of the weight touches zero in each period, and is not lost."""
    mu, k, t, frequencies = 0.2, 2.0, 6.0, np.linspace(0.31, 1.9, 40)
    scene = braked(pulsating(amplitude, 0.7), velocity=5.0, start=(0.0, 0.0))
    run = ringsweep.sweep(scene, {"body.load.f": frequencies}, progress=False)
    own, omega = np.sqrt(k), 2.0 * np.pi * frequencies
    forced = mu * amplitude / (k - omega**2)
    x = mu * 9.81 / k * (1.0 - np.cos(own * t)) + forced * (np.sin(omega * t) - omega / own * np.sin(own * t))
    assert run.x_end.values == pytest.approx(x, abs=1e-10)
    assert (run.stick_time == 0.0).all()
    assert run.certified.all()


@pytest.mark.slow
def test_a_load_that_stays_zero_is_lost_as_it_becomes_zero():
    table = {"time": [0, 2, 3, 10], "load": [0, -9.81, 0, 0], "interpolate": "step"}
    for scene, end in ((braked(table), 2.0), (braked(table | {"load": [-9.81, 0, 0, 0]}), 0.0)):
        run = outcome(scene)
        assert ringsweep.quantities.flags.REGIMES[run.regime.item()] == "separating"
        assert run.t_end.item() == end


def test_the_table_of_a_load_has_a_factor():
    table = {"time": [0, 2, 10], "load": [1, 4, -5], "interpolate": "step", "amplitude": 1.5}
    cells = cells_of(braked(table))
    assert cells.drive.added.knots[0, 0, 1].tolist() == [0.0, 1.0, 4.0, -5.0]
    assert (cells.drive.added.amplitude, cells.drive.least_load) == (1.5, -7.5)
