"""Belts under forcing without a common period: nothing repeats, no shift of time is a disturbance, and words hold."""

from math import sqrt

import numpy as np
import pytest
from belts import on_belt, with_all_parts, with_exponent

import ringsweep

#: A body of 1 kg on a spring of 1 N/m, with a damper of 4 N s/m.
DAMPED = on_belt({"law": "coulomb", "mu_k": 0.0}, cubic=0.0, damping=4.0, velocity=0.0, span=500.0)


def of_table(friction, tmp_path):
    t = np.linspace(0.0, 600.0, 6001)
    np.savetxt(tmp_path / "force.csv", np.c_[t, np.sin(0.2 * np.pi * t)], delimiter=",", header="t,force", comments="")
    return DAMPED | {"friction": friction, "force": {"file": str(tmp_path / "force.csv")}}


@pytest.mark.slow
def test_exponent_under_a_table_is_the_slower_rate_of_a_damped_oscillator(tmp_path):
    """Without friction disturbances decay like exp((sqrt(3) - 2) t) and exp(-(sqrt(3) + 2) t)."""
    spans = {"time.span": [330.0, 420.0, 500.0]}
    found = with_exponent(of_table({"law": "coulomb", "mu_k": 0.0}, tmp_path), spans, certify=True)
    assert (found.certified == 1).all()
    assert found.lyapunov.values == pytest.approx(sqrt(3.0) - 2.0, abs=1e-9)
    assert np.isnan([found[name].values for name in ("period", "multiplier_1", "multiplier_2")]).all()
    assert ringsweep.words(found.long_run).values.tolist() == ["quasi-periodic"] * 3
    assert (found.settled == 1).all()


@pytest.mark.slow
def test_exponent_of_stick_slip_under_a_table_is_that_under_the_same_sine(tmp_path):
    """Stick erases one disturbance of two; that of x outlives the stop, and its growth is finite."""
    friction = {"law": "coulomb", "mu_k": 0.02}
    table = with_exponent(of_table(friction, tmp_path))
    sine = with_exponent(DAMPED | {"friction": friction, "force": {"amplitude": 1.0, "frequency": 0.1}})
    assert sine.stops_per_cycle.item() == 2.0
    assert sine.lyapunov.item() == pytest.approx(np.log(sine.multiplier_1.item()) / 10.0, rel=1e-12)
    assert table.lyapunov.item() == pytest.approx(sine.lyapunov.item(), abs=3.0 * table.lyapunov_error.item())
    assert table.lyapunov_error.item() < 1e-3
    # Shares do not depend on what counts as a cycle.
    assert table.stick_share.item() == pytest.approx(sine.stick_share.item(), abs=2e-3)


@pytest.mark.slow
def test_body_that_a_fading_force_has_left_stuck_rests():
    """Once it sticks for half of the record, it rests; the force does not repeat, so nothing is periodic."""
    force = {"formula": "A*exp(-t/tau)*sin(w*t)", "A": 5.0, "tau": 5.0, "w": 1.0}
    fading = DAMPED | {"friction": {"law": "coulomb", "mu_k": 0.1}, "force": force, "damper": {"coefficient": 0.1}}
    spans = np.array([15.0, 100.0, 1000.0])
    found = with_exponent(fading, {"time.span": spans}, exponent=False)
    assert ringsweep.words(found.regime).values.tolist() == ["oscillatory", "sticking", "sticking"]
    assert ringsweep.words(found.long_run).values.tolist() == ["transient", "rest", "rest"]
    assert found.period.isnull().all()


def test_amplitude_zero_leaves_a_motion_free():
    free = with_all_parts(DAMPED | {"damper": {"coefficient": 0.0}, "initial": {"x": 1.0, "velocity": 0.0}})
    found = with_exponent(free | {"force": {"amplitude": 0.0, "frequency": 0.3}})
    assert ringsweep.words(found.long_run).item() == "periodic"
    assert found.period.item() == pytest.approx(2.0 * np.pi, rel=1e-9)
