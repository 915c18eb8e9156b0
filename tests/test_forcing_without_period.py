"""Belts under forcing without a common period: nothing repeats, no shift of time is a disturbance, and words hold."""

from math import sqrt

import numpy as np
import pytest
from belts import on_belt, with_all_parts, with_exponent

import ringsweep
from ringsweep.physics import drives
from ringsweep.physics.forces import Forced

#: A body of 1 kg on a spring of 1 N/m, with a damper of 4 N s/m.
DAMPED = on_belt({"law": "coulomb", "mu_k": 0.0}, cubic=0.0, damping=4.0, velocity=0.0, span=500.0)

#: Two forces in a ratio of the golden mean, and other parts.
TWO_FORCES = {
    **DAMPED,
    "friction": {"law": "tustin", "mu_s": 0.3, "mu_k": 0.2, "alpha": 1.0},
    "force": {"formula": "A*sin(w*t + phase) + B*sin(u*t)", "A": 1.0, "B": 1.0, "w": 1.0, "u": 1.0, "phase": 0.0},
    "initial": {"x": 0.0, "velocity": 0.0},
}

# Powers of mass, length and time in the unit of each number.
_DIMENSIONS = {
    "body.mass": (1, 0, 0),
    "spring.stiffness": (1, 0, -2),
    "spring.cubic": (1, -2, -2),
    "damper.coefficient": (1, 0, -1),
    "belt.velocity": (0, 1, -1),
    "friction.mu_s": (0, 0, 0),
    "friction.mu_k": (0, 0, 0),
    "friction.alpha": (0, -1, 1),
    "initial.x": (0, 1, 0),
    "initial.velocity": (0, 1, -1),
    "force.A": (1, 1, -2),
    "force.B": (1, 1, -2),
    "force.w": (0, 0, -1),
    "force.u": (0, 0, -1),
    "force.phase": (0, 0, 0),
    "time.span": (0, 0, 1),
    "gravity": (0, 1, -2),
}


def of_table(friction, tmp_path):
    t = np.linspace(0.0, 600.0, 6001)
    np.savetxt(tmp_path / "force.csv", np.c_[t, np.sin(0.2 * np.pi * t)], delimiter=",", header="t,force", comments="")
    return DAMPED | {"friction": friction, "force": {"file": str(tmp_path / "force.csv")}}


def random_points(cells, seed):
    rng = np.random.default_rng(seed)
    points = {
        "body.mass": 10.0 ** rng.uniform(-0.5, 0.5, cells),
        "spring.stiffness": 10.0 ** rng.uniform(-0.5, 1.0, cells),
        "spring.cubic": rng.uniform(0.0, 1.0, cells) * (rng.random(cells) < 0.3),
        "damper.coefficient": rng.uniform(0.02, 0.3, cells),
        "belt.velocity": rng.normal(0.0, 0.4, cells) * (rng.random(cells) < 0.6),
        "friction.mu_s": rng.uniform(0.2, 0.6, cells),
        "friction.alpha": 10.0 ** rng.uniform(0.0, 2.0, cells),
        "initial.x": rng.uniform(-0.5, 0.5, cells),
        "initial.velocity": rng.normal(0.0, 0.5, cells),
        "force.A": rng.uniform(0.1, 2.0, cells),
        "force.B": rng.uniform(0.1, 1.0, cells),
        "force.w": 2.0 * np.pi * 10.0 ** rng.uniform(-1.0, 0.3, cells),
        "force.phase": rng.uniform(0.0, 6.0, cells),
        "gravity": np.full(cells, 1.0),
    }
    points["friction.mu_k"] = points["friction.mu_s"] * rng.uniform(0.3, 1.0, cells)
    points["force.u"] = points["force.w"] * (sqrt(5.0) - 1.0) / 2.0
    points["time.span"] = rng.integers(80, 160, cells) / points["force.w"] * 2.0 * np.pi
    return points


def test_period_of_parts_that_repeat_and_of_parts_that_do_not():
    class Ramp(drives.Sinusoidal):
        """A drive of one's own, of which no period is known."""

    def period(motion, force):
        return drives.period(Forced(motion, force, 0.0, 1.0))

    constant, ramp = drives.Constant(0.1), Ramp(1.0, 1.0, 0.0)
    assert period(constant, drives.Still()) == 0.0
    assert period(constant, drives.Sinusoidal(0.0, 2.0, 0.0)) == 0.0
    assert period(constant, ramp) == np.inf
    assert period(drives.Sinusoidal(1.0, 2.0, 0.0), ramp) == np.inf
    assert period(drives.Sinusoidal(1.0, 2.0, 0.0), drives.Sinusoidal(1.0, 2.0 * sqrt(2.0), 0.0)) == np.inf


@pytest.mark.slow
def test_exponent_under_a_table_is_the_slower_rate_of_a_damped_oscillator(tmp_path):
    """Without friction disturbances decay like exp((sqrt(3) - 2) t) and exp(-(sqrt(3) + 2) t)."""
    found = with_exponent(of_table({"law": "coulomb", "mu_k": 0.0}, tmp_path), certify=True)
    assert found.certified.item() == 1
    assert found.lyapunov.item() == pytest.approx(sqrt(3.0) - 2.0, abs=1e-9)
    assert np.isnan([found[name].item() for name in ("period", "multiplier_1", "multiplier_2")]).all()
    assert ringsweep.words(found.long_run).item() == "quasi-periodic"
    assert found.settled.item() == 1


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
def test_words_under_two_incommensurate_forces_have_no_units_and_no_side():
    points = random_points(40, 5)
    signed = "belt.velocity", "initial.x", "initial.velocity", "force.A", "force.B"
    found = with_exponent(TWO_FORCES, points, certify=True)
    assert {"quasi-periodic", "transient"} <= set(ringsweep.words(found.long_run).values.tolist())
    assert found.period.isnull().all()
    assert found.multiplier_1.isnull().all()

    def in_units(*factors):
        powers = {path: np.prod(np.power(factors, _DIMENSIONS[path])) for path in points}
        return {path: column * powers[path] for path, column in points.items()}

    changes = {
        "mirror image": points | {path: -points[path] for path in signed},
        "powers of two": in_units(4.0, 0.5, 8.0),
        "other units": in_units(3.7, 0.13, 1.9),
        "longer": points | {"time.span": 4.3 * points["time.span"]},
    }
    for name, changed in changes.items():
        other = with_exponent(TWO_FORCES, changed, certify=True)
        same = (found.certified.values == 1) & (other.certified.values == 1)
        same &= (found.settled.values == 1) | (name != "longer")
        assert same.sum() >= 20
        for word in ("regime", "long_run", "settled"):
            np.testing.assert_array_equal(other[word].values[same], found[word].values[same], name)
        if name != "longer":
            for number in ("stick_share", "stops_per_cycle"):
                np.testing.assert_allclose(other[number].values[same], found[number].values[same], atol=1e-6)


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
