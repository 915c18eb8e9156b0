"""Late and slow events: the millionth period is as exact as the first, and a pull may grow as slowly as it likes."""

from math import atanh

import numpy as np
import pytest
import xarray as xr
from belts import with_all_parts
from rings import particle

import ringsweep
from ringsweep.quantities.flags import REGIMES

STICTION = {"law": "stiction", "mu_s": 0.07, "mu_k": 0.05}

LAWS = [
    {"law": "coulomb", "mu_k": 0.05},
    STICTION,
    STICTION | {"law": "tustin", "alpha": 10.0},
    STICTION | {"law": "gaussian-stribeck", "v_s": 0.1},
    STICTION | {"law": "hyperbolic", "delta": 3.0},
    STICTION | {"law": "karnopp", "dead_band": 1e-3},
]


def forced(friction, *, frequency, **changes):
    """A body of 1 kg on a belt at rest, under a force of 1 N; it sticks twice in each period."""
    force = {"amplitude": 1.0, "frequency": frequency, "phase": "90 deg"}
    found = {"model": "belt", "body": {"mass": 1.0}, "spring": {"stiffness": 1.0}, "belt": {"velocity": 0.0}}
    return with_all_parts(found | {"friction": friction, "force": force, "time": {"span": 1.0}} | changes)


def runs(of, axes, **solver):
    """Runs whose axes vary together."""
    together = {path: xr.DataArray(np.asarray(values), dims="run") for path, values in axes.items()}
    return ringsweep.sweep(of, together, progress=False, solver={"method": "auto"} | solver)


class TestForcedBelts:
    def test_no_run_of_a_map_fails_late(self):
        frequency = np.append(0.0475, np.geomspace(0.02, 0.06, 7))
        found = runs(forced(LAWS[0], frequency=1.0), {"force.frequency": frequency, "time.span": 2e4 + 0.0 * frequency})
        assert (found.certified == 1).all()
        assert (found.stick_time > 1000.0).all()

    @pytest.mark.parametrize("unit", [1.0, 2.0**-13], ids=["hertz", "kilohertz"])
    def test_displacement_repeats_to_rounding_after_ten_thousand_periods(self, unit):
        """The spans are whole numbers of periods without rounding."""
        of = forced(LAWS[0], frequency=3.0 / 64.0 / unit, spring={"stiffness": unit**-2})
        found = runs(of, {"time.span": np.array([300.0, 600.0, 30000.0]) * 64.0 / 3.0 * unit})
        assert (found.certified == 1).all()
        np.testing.assert_allclose(found.x_end[1:], found.x_end[0], rtol=1e-13)

    @pytest.mark.slow
    @pytest.mark.parametrize("friction", LAWS, ids=lambda friction: friction["law"])
    def test_displacement_repeats_to_rounding_after_many_periods(self, friction):
        """Over 1e5 periods, and one law over nearly 1e6."""
        periods = np.array([300.0, 99999.0, 999999.0 if friction["law"] == "coulomb" else 99999.0 / 3.0])
        found = runs(forced(friction, frequency=3.0 / 64.0), {"time.span": periods * 64.0 / 3.0}, max_steps=100_000_000)
        assert (found.certified == 1).all()
        np.testing.assert_allclose(found.x_end[1:], found.x_end[0], rtol=1e-13)

    @pytest.mark.slow
    def test_narrow_pulse_after_a_long_rest_breaks_the_body_loose(self):
        """The pulse is up to 1e12 of its widths away; its time is known to the rounding of its largest term."""
        width, mu_s = 1e-3, 0.2
        of = forced(STICTION | {"mu_s": mu_s, "mu_k": 0.1}, frequency=1.0, gravity=10.0) | {
            "force": {"formula": "F*(1 + tanh((t - t0)/w))/2", "F": 3.0, "t0": 1.0, "w": width}
        }
        middle = 10.0 ** np.arange(10)
        found = runs(of, {"force.t0": middle, "time.span": middle + 5.0})
        assert (found.certified == 1).all()
        broken_loose = width * atanh(2.0 * mu_s * 10.0 / 3.0 - 1.0)
        np.testing.assert_allclose(found.first_slip - middle, broken_loose, atol=1e-16 * middle[-1])
        np.testing.assert_allclose(found.x_end, 4.0, rtol=1e-6)


class TestSlowPulls:
    """Ratios of the time of breakaway to that of an oscillation from 1e3 to 1e12."""

    RATIO = 10.0 ** np.arange(3, 13)
    FRICTION = STICTION | {"mu_s": 0.2, "mu_k": 0.1}

    def test_body_on_a_slow_belt_breaks_loose_where_friction_ends(self):
        stiffness = 10.0 ** np.linspace(-2.0, 8.0, 10)
        breaks = self.RATIO / np.sqrt(stiffness)
        axes = {"spring.stiffness": stiffness, "belt.velocity": 2.0 / (stiffness * breaks), "time.span": 1.5 * breaks}
        found = runs(forced(self.FRICTION, frequency=0.0, gravity=10.0, force={"amplitude": 0.0}), axes)
        assert {REGIMES[int(regime)] for regime in found.regime} == {"stick-slip"}
        np.testing.assert_allclose(found.first_slip, breaks, rtol=1e-13)

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("formula", "largest", "breaks"), [("c*t/T", 2.0, 1.0), ("c*(1 - cos(2*pi*t/T))", 2.0, 0.25)]
    )
    def test_slow_force_breaks_the_body_loose_where_friction_ends(self, formula, largest, breaks):
        of = forced(self.FRICTION, frequency=0.0, gravity=10.0, spring={"stiffness": 1e6})
        of["force"] = {"formula": formula, "c": largest, "T": 1.0}
        period = self.RATIO / 1e3
        found = runs(of, {"force.T": period, "time.span": 1.0001 * breaks * period})
        # Within the tolerance of a step; a series along a ramp has no error.
        np.testing.assert_allclose(found.first_slip, breaks * period, rtol=1e-11)

    def test_slips_count_however_short_they_are_beside_their_period(self):
        frequency = 10.0 ** np.arange(-13, -2)
        damped = forced(self.FRICTION, frequency=1.0, gravity=10.0, damper={"coefficient": 0.1})
        damped["force"]["amplitude"] = 3.0
        found = runs(damped, {"force.frequency": frequency, "time.span": 20.0 / frequency})
        assert {REGIMES[int(regime)] for regime in found.regime} == {"stick-slip"}
        np.testing.assert_array_equal(found.stops_per_cycle, 4.0)


PULSE = "F*(tanh((t - t0)/w) - tanh((t - t0)/w - 3))*cos(2*pi*f*(t - t0))"
BRISTLES = {"law": "lugre", "mu_s": 0.15, "mu_k": 0.1, "v_s": 1e-2, "sigma0": 1e4, "sigma1": 30.0, "sigma2": 0.01}


@pytest.mark.slow
@pytest.mark.parametrize("friction", [{"law": "tanh", "mu_k": 0.1, "v0": 1e-2}, BRISTLES], ids=lambda law: law["law"])
class TestLateImplicitSteps:
    """A fast pulse moves a body that has rested for up to thirty years, as it moves one that has just been launched."""

    LATE = np.array([2.0, 2.0**30])

    @staticmethod
    def assert_alike(found, names):
        assert (found.certified == 1).all()
        assert found.steps[1] < 1.5 * found.steps[0]
        for name in names:
            bound = found[f"{name}_error"].sum()
            assert abs(found[name][1] - found[name][0]) <= bound, name
            assert bound < 0.1 * abs(found[names[0]]).max() or name.endswith("_end"), name

    def test_belt_force(self, friction):
        of = forced(friction, frequency=1.0, gravity=10.0)
        of["force"] = {"formula": PULSE, "F": 30.0, "f": 100.0, "t0": 1.0, "w": 0.05}
        found = runs(of, {"force.t0": self.LATE, "time.span": self.LATE + 1.0})
        self.assert_alike(found, ("velocity_max", "x_max", "x_end", "velocity_end"))

    def test_ring_drive(self, friction):
        rest = {name: value for name, value in friction.items() if name.startswith("mu_")}
        friction = {name: value for name, value in friction.items() if name not in rest} | {"rest": rest}
        drive = {"law": "formula", "theta": PULSE, "F": 0.1, "f": 100.0, "t0": 1.0, "w": 0.05}
        of = particle(1.0, 1.0) | {"gravity": 10.0, "friction": friction, "drive": drive, "time": {"span": 1.0}}
        found = runs(of, {"drive.t0": self.LATE, "time.span": self.LATE + 1.0})
        self.assert_alike(found, ("omega_max", "phi_max", "phi_end", "omega_end"))
