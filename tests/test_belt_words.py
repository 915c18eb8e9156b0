"""The word for what a motion on the belt settles to, and the numbers from its last cycles."""

from math import pi, sqrt
from typing import ClassVar

import numpy as np
import pytest
import xarray as xr
from belts import on_belt, with_all_parts
from tiers import mostly_slow

import ringsweep
from ringsweep.quantities.flags import REGIMES


def scene(law, *, k=2.0, drive=None, belt=None, x=0.0, velocity=None, span=60.0, **friction):
    """A body of 1 kg on a belt of constant velocity, or on one that moves as amplitude (m) times sin(2 pi f t)."""
    found = on_belt({"law": law, **friction}, k, span=span) | {
        "initial": {"x": x} | ({} if velocity is None else {"velocity": velocity})
    }
    if drive is not None:
        found["drive"] = {"law": "sinusoidal", "amplitude": drive[0], "frequency": drive[1]}
    else:
        found["belt"] = {"velocity": belt}
    # The kernel of this law for a belt with all parts is compiled in any case, for a force on the body.
    return with_all_parts(found) if drive is None and law == "bengisu-akay" else found


def runs(of, spans):
    return ringsweep.sweep(of, {"time.span": np.atleast_1d(spans).tolist()}, progress=False)


def words(found):
    return [REGIMES[int(regime)] for regime in found.regime]


class TestSticking:
    @pytest.mark.slow
    def test_body_that_sticks_for_good_to_an_oscillating_belt_is_sticking(self):
        """The load of a stuck body is largest at the extremes of the belt, and stays below breakaway there."""
        of = scene(
            *("tustin",), mu_s=0.5, mu_k=0.3, alpha=10.0, k=100.0, drive=(0.005, 0.5), x=0.1, velocity=0.0157079633
        )
        found = runs(of, [4.5, 10.0, 1000.0])
        assert words(found) == ["sticking"] * 3
        assert (found.slips == 1).all()
        assert (found.certified == 1).all()
        np.testing.assert_array_equal(found.stick_share, 1.0)
        np.testing.assert_allclose(found.stick_time - found.time_span, found.stick_time[2] - 1000.0, atol=1e-9)

    @pytest.mark.parametrize(
        ("law", "of_law"),
        mostly_slow([("stiction", {}), ("bengisu-akay", {"v0": 1e-4, "alpha": 1e4})], [("stiction", {})]),
    )
    def test_body_comes_to_stick_on_a_resting_belt_and_slips_on_a_moving_one(self, law, of_law):
        of = scene(law, mu_s=0.15, mu_k=0.1, belt=0.0, x=2.0, velocity=0.0, **of_law)
        found = ringsweep.sweep(of, {"belt.velocity": [0.0, 1e-3, -1e-3]}, progress=False)
        assert words(found) == ["sticking", "stick-slip", "stick-slip"]
        np.testing.assert_array_equal(found.settled, [1, 0, 0])


@pytest.mark.slow
class TestRounding:
    """Rounded laws have the word of the law that they round."""

    COULOMB: ClassVar = {"mu_s": 0.3, "mu_k": 0.3, "alpha": 20.0}

    @pytest.mark.parametrize("friction", [COULOMB, COULOMB | {"mu_s": 0.4}], ids=["coulomb", "tustin"])
    def test_rounding_never_changes_the_word(self, friction):
        rng = np.random.default_rng(3)
        speeds, places = 10.0 ** rng.uniform(-1.5, 0.5, 16), rng.uniform(-0.3, 0.3, 16)
        axes = {
            "drive.frequency": xr.DataArray(frequencies := 10.0 ** rng.uniform(-0.5, 0.8, 16), dims="case"),
            "drive.amplitude": xr.DataArray(speeds / (2.0 * pi * frequencies), dims="case"),
            "time.span": xr.DataArray(25.3 / frequencies, dims="case"),
            "initial.x": xr.DataArray(places, dims="case"),
        }
        exact = ringsweep.sweep(scene("tustin", k=30.0, drive=(0.1, 1.0), **friction), axes, progress=False)
        assert {"stick-slip", "oscillatory", "sticking"} <= set(words(exact))
        for share in (1e-3, 1e-4, 1e-6):
            rounded = ringsweep.sweep(
                scene("bengisu-akay", k=30.0, drive=(0.1, 1.0), v0=0.1, **friction),
                axes | {"friction.v0": xr.DataArray(share * speeds, dims="case")},
                progress=False,
            )
            assert words(rounded) == words(exact)
            np.testing.assert_array_equal(rounded.stops_per_cycle, exact.stops_per_cycle)
            np.testing.assert_allclose(rounded.stick_share, exact.stick_share, atol=8.0 * share + 1e-3)

    @pytest.mark.parametrize("share", [1e-3, 1e-6])
    def test_motion_that_grazes_the_speed_of_the_belt_does_not_stop(self, share):
        found = runs(scene("threlfall", mu_k=0.1, v0=0.1 * share, belt=0.1), [40.0])
        assert words(found) == ["oscillatory"]
        assert float(found.stops_per_cycle[0]) == 0.0
        assert float(found.period[0]) == pytest.approx(2.0 * pi / sqrt(2.0), rel=1e-3)


class TestSliding:
    @pytest.mark.parametrize("off", [1e-13, 1e-11, 1e-9])
    def test_what_is_left_of_a_damped_swing_is_no_oscillation(self, off):
        """Launched beside its equilibrium the body slides steadily: errors of the run are no motion."""
        of = scene("stiction", mu_s=0.4, mu_k=0.25, k=100.0, belt=1.0, x=0.25 * 9.81 / 100.0 + off, velocity=0.0) | {
            "damper": {"coefficient": 1.0}
        }
        found = ringsweep.sweep(
            of, {"belt.velocity": [0.5, 0.73, 1.1, 1.7], "time.span": [60.0, 300.0]}, progress=False
        )
        assert set(ringsweep.words(found.regime).values.flat) == {"sliding"}
        assert set(ringsweep.words(found.long_run).values.flat) == {"steady"}


class TestSpan:
    """Where the span ends does not matter."""

    @pytest.mark.slow
    @pytest.mark.parametrize("law", ["tustin", "bengisu-akay"])
    def test_longer_settled_runs_have_the_same_word_and_numbers(self, law):
        """Each of the random scenes is run again, longer by fractions of a period of the belt."""
        of_law = {"mu_s": 0.4, "alpha": 1e3} if law == "tustin" else {"mu_s": 0.3, "alpha": 10.0, "v0": 1e-3}
        rng = np.random.default_rng(7)
        frequencies, speeds = 10.0 ** rng.uniform(-0.8, 0.2, 10), 10.0 ** rng.uniform(-0.5, 0.5, 10)
        fractions = np.linspace(0.0, 1.0, 5)
        spans = (40.0 + fractions[:, np.newaxis]) / frequencies
        found = ringsweep.sweep(
            scene(law, mu_k=0.3, k=30.0, drive=(0.1, 1.0), **of_law),
            {
                "drive.frequency": xr.DataArray(frequencies, dims="case"),
                "drive.amplitude": xr.DataArray(speeds / (2.0 * pi * frequencies), dims="case"),
                "time.span": xr.DataArray(spans, dims=("more", "case")),
            },
            progress=False,
        ).transpose("more", "case")
        assert {"stick-slip", "oscillatory"} <= set(words(found.isel(more=0)))
        settled = found.settled.values[0] == 1
        assert settled.all()
        for name in ("regime", "period", "stick_share", "stops_per_cycle", "settled"):
            values = found[name].values[:, settled]
            np.testing.assert_allclose(values, values[:1].repeat(len(values), axis=0), rtol=5e-3, atol=5e-3)


@pytest.mark.slow
class TestPeriod:
    def test_undamped_body_that_is_driven_beside_its_resonance_does_not_return(self):
        """Without friction the free oscillation stays beside the forced one: no cycle repeats another."""
        of = scene("tustin", mu_s=0.0, mu_k=0.0, alpha=1.0, k=2.0, drive=(0.1, 0.37), x=1.0)
        found = runs(of, [40.0, 80.0])
        assert words(found) == ["oscillatory"] * 2
        np.testing.assert_array_equal(found.settled, 0)
        assert found.period.isnull().all()

    def test_motion_without_a_cycle_has_no_period(self):
        of = with_all_parts(scene("coulomb", mu_k=0.1, viscous=0.5, belt=0.1, velocity=0.0))
        found = runs(of, [30.0, 200.0])
        assert words(found) == ["sliding"] * 2
        assert found.period.isnull().all()
        assert found.settled.values.tolist() == [0, 1]


@pytest.mark.slow
def test_body_that_a_force_takes_through_the_band_has_not_stopped():
    """Under any method; one that the force does not take loose at once has."""
    of = with_all_parts(scene("bengisu-akay", k=1.0, mu_s=0.2, mu_k=0.1, alpha=10.0, v0=0.05, belt=0.5, span=2.0))
    force = 9.81 * np.concatenate((np.linspace(0.05, 0.19, 10), np.linspace(0.3, 0.6, 10)))
    axes = {"force.constant": np.concatenate((-force, force))}
    slips = [
        ringsweep.sweep(of, axes, solver=method, progress=False).slips
        for method in ({"method": "auto"}, {"method": "rk4", "steps": 20_000})
    ]
    np.testing.assert_array_equal(slips[1], slips[0])
    assert slips[0].max() == 1
    assert (slips[0][abs(slips[0].force_constant) > 2.0] == 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("law", ["bengisu-akay", "lugre"])
def test_a_body_under_which_its_belt_accelerates_at_launch_has_not_stopped(law):
    """Under any method: the body would need more than the breakaway force to keep up with the belt."""
    of_law = {
        "bengisu-akay": {"alpha": 10.0, "v0": 0.01},
        "lugre": {"sigma0": 1e3, "sigma1": 10.0, "sigma2": 0.1, "v_s": 0.01},
    }
    of = scene(law, k=1.0, drive=(1.0, 1.0), span=2.0, mu_s=0.3, mu_k=0.2, **of_law[law])
    rng = np.random.default_rng(1)
    axes = {"amplitude": rng.uniform(0.01, 2.0, 60), "frequency": rng.uniform(0.1, 2.0, 60), "phase": rng.random(60)}
    axes = {f"drive.{name}": xr.DataArray(column, dims="cell") for name, column in axes.items()}
    first, second = (
        ringsweep.sweep(of, axes, solver=method, progress=False)
        for method in ({"method": "auto"}, {"method": "rk4", "steps": 10_000})
    )
    np.testing.assert_array_equal(second.slips, first.slips)
    assert 10 < (first.slips == 0).sum() < 60


@pytest.mark.slow
class TestBreakingLoose:
    """A body launched at the belt's speed rides until k v t = mu_s F_N, at 0.5 s."""

    @pytest.mark.parametrize(
        "friction",
        [
            {"law": "coulomb", "mu_k": 0.5},
            {"law": "threlfall", "mu_k": 0.5, "v0": 1e-6},
            {"law": "lugre", "mu_s": 0.5, "mu_k": 0.3, "sigma0": 1e6, "sigma1": 100.0, "v_s": 0.01},
        ],
        ids=lambda friction: friction["law"],
    )
    def test_first_stick_counts_however_short_it_is(self, friction):
        of = oscillator(friction, belt={"velocity": 1.0})
        run = ringsweep.sweep(of, {"time.span": [0.3, 0.49, 3.0]}, progress=False)
        assert words(run) == ["riding", "riding", "stick-slip"]
        np.testing.assert_array_equal(np.isnan(run.first_slip), [True, True, False])
        assert float(run.first_slip[-1]) == pytest.approx(0.5, abs=0.02)

    @pytest.mark.parametrize("phase", ["-90 deg", "0 deg", "90 deg"])
    def test_force_that_only_touches_breakaway_lets_nothing_slip(self, phase):
        force = {"amplitude": 0.5, "frequency": 0.1, "phase": phase}
        coulomb = {"law": "coulomb", "mu_k": 0.5}
        of = with_all_parts(oscillator(coulomb, force=force))
        run = ringsweep.sweep(of, {"time.span": [10.0, 100.0]}, progress=False)
        assert words(run) == ["riding", "riding"]


STICTION = {"law": "stiction", "mu_s": 0.5, "mu_k": 0.3}


def oscillator(friction, **changes):
    """A belt with a mass, a stiffness and a gravity of 1."""
    ones = {"model": "belt", "body": {"mass": 1.0}, "spring": {"stiffness": 1.0}, "gravity": 1.0}
    return ones | {"belt": {"velocity": 0.0}, "friction": friction, "time": {"span": 1.0}} | changes


def test_cubic_spring_alone_pulls_a_stuck_body_loose_again_and_again():
    of = with_all_parts(oscillator(STICTION, spring={"stiffness": 0.0, "cubic": 1.0}, belt={"velocity": 0.1}))
    run = ringsweep.sweep(of, {"time.span": [5.0, 100.0, 103.0, 106.0]}, progress=False)
    assert words(run) == ["riding", *["stick-slip"] * 3]
    np.testing.assert_allclose(run.period[1:], 6.44443, atol=1e-5)


@pytest.mark.slow
def test_body_sliding_steadily_below_the_stiction_band_end_is_sliding():
    """Friction that grows with the speed cannot cause stick-slip."""
    friction = {"law": "bengisu-akay", "mu_s": 0.1, "mu_k": 0.1, "v0": 1.0, "alpha": 10.0}
    of = with_all_parts(oscillator(friction, belt={"velocity": 0.2}))
    run = ringsweep.sweep(of, {"time.span": [300.0, 400.0]}, progress=False)
    assert words(run) == ["sliding", "sliding"]
    assert run.settled[-1] == 1


class TestSteadySliding:
    """Errors of the steps around steady sliding are no oscillation; neither is a motion that decays."""

    SCENE: ClassVar = with_all_parts(scene("tustin", k=500.0, belt=0.1, span=20.0, mu_s=0.45, mu_k=0.25, alpha=10.0))
    AXES: ClassVar = {"belt.velocity": np.geomspace(0.02, 1.0, 8).tolist(), "damper.coefficient": [5.0, 10.0, 20.0]}

    def test_certified_word_at_a_loose_tolerance_is_that_at_a_tight_one(self):
        tight = ringsweep.sweep(self.SCENE, self.AXES, solver={"method": "event", "rtol": 1e-10}, progress=False)
        assert {"sliding", "stick-slip"} <= set(words_of(tight).ravel())
        for rtol in (1e-4, 1e-5):
            loose = ringsweep.sweep(self.SCENE, self.AXES, solver={"method": "event", "rtol": rtol}, progress=False)
            trusted = loose.certified.values == 1
            assert trusted.any()
            np.testing.assert_array_equal(words_of(loose)[trusted], words_of(tight)[trusted])

    def test_fast_decaying_oscillation_is_sliding_and_not_settled_at_first(self):
        stiff = with_all_parts({**self.SCENE, "spring": {"stiffness": 1e7}, "damper": {"coefficient": 14.3}})
        found = runs(stiff, [2.0, 30.0])
        assert words(found) == ["sliding", "sliding"]
        assert found.swing[0] > 10.0 * found.swing[1]

    @pytest.mark.slow
    def test_swing_of_a_free_vibration_without_friction_is_twice_its_amplitude(self):
        found = runs(scene("coulomb", belt=0.1, x=0.2, velocity=0.0, span=60.0, mu_s=0.0, mu_k=0.0), 60.0)
        assert words(found) == ["oscillatory"]
        assert found.swing.item() == pytest.approx(0.4, rel=1e-9)
        assert found.settled.item() == 1

    @pytest.mark.slow
    def test_forced_oscillation_without_a_spring_is_certified(self):
        of = scene("tustin", k=0.0, drive=(1.0, 2.0), span=20.0, mu_s=0.01, mu_k=0.01, alpha=1.0)
        found = runs(of, 20.0)
        assert words(found) == ["oscillatory"]
        assert found.certified.item() == 1


def words_of(found):
    return ringsweep.words(found.regime).values


@pytest.mark.slow
def test_rounding_never_makes_a_cycle_of_less_than_one():
    """At its greatest displacement the velocity may change its sign twice, by rounding."""
    body, spring = {"mass": 0.669988738335861, "normal_stiffness": 0.255742034069238}, 1.4693504666457644
    friction = {"law": "stiction", "mu_s": 0.18089926280769536, "mu_k": 0.10697760337822579}
    start = 0.25994065960544027 * (1.0 + 1e-13 * np.random.default_rng(1).standard_normal(300))
    of = on_belt(friction, spring, gravity=8.650839141651959, start=(0.0, 0.0), span=3.5798752769840103) | {
        "body": body, "drive": {"law": "constant", "amplitude": 0.35822866047986557},
        "force": {"constant": -3.3880418085353217},
    }  # fmt: skip
    found = ringsweep.sweep(of, {"initial.velocity": xr.DataArray(start, dims="case")}, progress=False)
    assert set(words(found)) == {"sliding"}


@pytest.mark.slow
def test_body_that_creeps_on_a_vibrating_belt_has_the_period_of_the_belt():
    """Its creep decides by rounding, otherwise in the mirror image, whether its states return."""
    mu = 0.1981514541993127
    law = {"mu_s": mu, "mu_k": mu, "alpha": 4.2553050639334655, "v0": 1.4168732722499053e-05}
    of = scene("bengisu-akay", k=7.750528083630341, drive=(1.0, 1.8576954655811841), span=6.922351069132515, **law)
    of |= {"body": {"mass": 0.8611921598818996}, "drive": of["drive"] | {"phase": 0.12382374096225914}}
    numbers = {"drive.amplitude": -0.010128983327254756, "initial.x": -0.0867180405246526}
    numbers |= {"initial.velocity": 0.64417358309192}
    both = {path: xr.DataArray([number, -number], dims="image") for path, number in numbers.items()}
    found = ringsweep.sweep(of, both, progress=False)
    assert words(found) == ["sticking", "sticking"]
    np.testing.assert_allclose(found.period, 1.0 / of["drive"]["frequency"], rtol=1e-14)
