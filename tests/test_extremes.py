"""Least and greatest numbers of a run: no instant of its history exceeds them, and they are those of closed forms."""

from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from belts import on_belt, with_all_parts
from rings import course, rubs, shape
from tiers import mostly_slow

import ringsweep
from ringsweep.models.turn import Interval, turn_within

G = 9.81

#: Parameters that the laws need besides coefficients of friction; speeds in units of that of the scene.
LAWS = {
    "stiction": {},
    "tustin": {"alpha": 30.0},
    "karnopp": {"dead_band": 1e-2},
    "bengisu-akay": {"v0": 1e-2, "alpha": 30.0},
    "andersson": {"v_s": 3e-2, "k_t": 300.0},
    "lugre": {"sigma0": 2e3, "sigma1": 30.0, "sigma2": 0.0, "v_s": 1e-2},
}

#: Laws whose kernels other tests need too.
COMMON = ("stiction", "bengisu-akay", "lugre")


def belt(law, **changes):
    """A body of 1 kg on a spring of 4 N/m, on a belt at rest."""
    scene = on_belt({"law": law, "mu_s": 0.4, "mu_k": 0.25, **LAWS[law]}, 4.0, velocity=0.0, span=20.0)
    return with_all_parts(scene | changes)


def exceeds(run, name, values, greatest=True):
    """By how much values of a history exceed a number of the run, in units of its bound.

    The history is a run of its own, with other steps, and has errors too.
    """
    beyond = values.max() - run[name] if greatest else run[name] - values.min()
    own = 1e-13 if '"event"' in run.attrs["solver"] else 3e-7
    return float(beyond / (run[f"{name}_error"] + own * abs(values).max()))


def of_belt(run):
    """Excess of the history of a belt over each number that is called greatest or least."""
    return {
        "force_max": exceeds(run, "force_max", abs(run.friction_force)),
        "velocity_max": exceeds(run, "velocity_max", run.velocity),
        "x_max": exceeds(run, "x_max", run.x),
        "x_min": exceeds(run, "x_min", run.x, greatest=False),
    }


def of_ring(run):
    """The same of a ring."""
    reactions = {f"normal_{end}_{i}": (f"normal_{i}", end) for i in (1, 2) for end in ("min", "max")}
    motion = {f"{name}_{end}": (name, end) for name in ("phi", "omega") for end in ("min", "max")}
    return {name: exceeds(run, name, run[of], end == "max") for name, (of, end) in (reactions | motion).items()}


class TestForce:
    @pytest.mark.parametrize("law", mostly_slow(("stiction", "tustin", "karnopp"), ("stiction",)))
    @pytest.mark.parametrize("phase", [0.3, 2.0])
    def test_force_on_a_body_that_is_held_is_that_of_a_whole_period(self, law, phase):
        force = {"amplitude": 1.0, "frequency": 0.05, "phase": phase}
        run = ringsweep.sweep(belt(law, force=force), {"time.span": [20.0]}, progress=False)
        assert run.certified == 1
        assert float(run.force_max[0]) == pytest.approx(1.0, abs=1e-14)
        assert run.force_max_error < 1e-7

    @pytest.mark.parametrize("law", mostly_slow(LAWS, COMMON))
    def test_no_instant_of_a_history_exceeds_what_is_called_greatest(self, law):
        rng = np.random.default_rng(48)
        for _ in range(6):
            force = {
                "amplitude": rng.uniform(2.0, 8.0),
                "frequency": rng.uniform(0.05, 0.8),
                "phase": rng.uniform(0, 6),
            }
            speed = {"velocity": rng.choice([0.0, 1.0]) * rng.uniform(-1.0, 1.0)}
            run = ringsweep.simulate(belt(law, force=force, belt=speed, damper={"coefficient": 0.2}), samples=3000)
            assert max(of_belt(run).values()) <= 3.0
            # Nor is the number far from what the history shows.
            assert abs(run.friction_force).max() == pytest.approx(float(run.force_max), rel=2e-3)

    @pytest.mark.parametrize("law", mostly_slow(("bengisu-akay", "andersson"), ("bengisu-akay",)))
    def test_force_of_a_smooth_law_is_greatest_at_the_speed_of_most_friction(self, law):
        """A body passes that speed within one step."""
        scene = belt(law, force={"frequency": 0.2})
        scene["friction"] |= {"v_s": 1e-3, "mu_k": 0.05} if law == "andersson" else {}
        runs = ringsweep.sweep(scene, {"force.amplitude": np.linspace(6.0, 8.0, 9)}, progress=False)
        v = np.linspace(0.0, 2e-3, 200_001)
        greatest = {
            "bengisu-akay": 0.4,
            "andersson": ((0.05 + 0.35 * np.exp(-((v / 1e-3) ** 2))) * np.tanh(300.0 * v)).max(),
        }[law]
        assert runs.force_max.values == pytest.approx(greatest * G, rel=1e-9)
        assert (abs(runs.force_max - greatest * G) <= runs.force_max_error).all()


RING = (
    shape(0.076, 4.47e-5, 0.025, 0.01, 0.043378, zone="15 deg")
    | rubs("bengisu-akay", rest=(0.2, 0.1), rough=(0.5, 0.3))
    | course("arctan", 0.4, span=4.0)
)


class TestReactions:
    @pytest.mark.parametrize("v0", [1e-5, 0.05])
    def test_no_instant_of_a_history_exceeds_the_extremes(self, v0):
        friction = RING["friction"] | {"v0": v0, "alpha": 100.0}
        run = ringsweep.simulate(RING | {"friction": friction, "initial": {"phi": 0.6}}, samples=4000)
        assert run.certified == 1
        assert max(of_ring(run).values()) <= 3.0

    @pytest.mark.slow
    def test_contact_that_holds_in_a_pivot_has_its_least_reaction_there(self):
        scene = RING | rubs("stiction", rest=(0.2, 0.1), rough=(0.5, 0.3)) | {"impact": {"restitution": 0.4}}
        least = []
        for omega in np.linspace(20.0, 40.0, 9):
            run = ringsweep.simulate(scene | {"initial": {"phi": 0.5, "omega": omega}}, samples=4000)
            assert max(of_ring(run).values()) <= 3.0
            least += [float(run.normal_min_1), float(run.normal_min_2)]
            gap = np.maximum(run.gap_1, run.gap_2)
            assert exceeds(run, "gap_max", gap) <= 3.0
        assert max(least) > 0.0


class TestFold:
    """Where both roots of stick meet, reactions fall at an infinite rate: a little before, they are much greater."""

    @pytest.mark.slow
    @pytest.mark.parametrize("e", [None, 0.5])
    def test_least_reactions_at_the_end_of_stick_are_those_of_the_mirror_image(self, e):
        """The first body loses a contact there, the other one slides on."""
        bounds, least = [], []
        for sign in (1.0, -1.0):
            scene = shape(0.5, 1.72e-4, 0.0221, 0.0077, 0.031, zone=0.033)
            scene |= rubs("stiction", (0.52, 0.48), (0.35, 0.035))
            scene |= course("sinusoidal", 1.0, 2.5, np.pi / 2.0, phi=0.0, omega=0.0, span=1.0, e=e)
            numbers = {"initial.phi": [0.65, 0.85], "drive.amplitude": [2.6, 2.7]}
            axes = {path: xr.DataArray(sign * np.array(column), dims="cell") for path, column in numbers.items()}
            axes["time.span"] = xr.DataArray([0.12, 0.21], dims="cell")
            found = ringsweep.sweep(scene, axes, progress=False)
            assert found.certified.all()
            names = ("normal_min_1", "normal_min_2")[:: int(sign)]
            least.append([found[name].values for name in names])
            bounds.append([found[f"{name}_error"].values for name in names])
        assert (np.abs(least[0] - np.array(least[1])) <= np.sum(bounds, axis=0)).all()


@pytest.mark.slow
def test_greatest_velocity_within_a_long_step_is_as_exact_as_its_end():
    """The body creeps with the ring, in steps of a quarter of a period, and is fastest within one of them."""
    scene = shape(0.076, 4.47e-5, 0.025, 0.01, 0.043378, zone=1.4457)
    scene |= course("sinusoidal", 0.3412, 0.2382, phi=0.1688, omega=0.0)
    scene["friction"] = {"law": "tanh", "v0": 4.495e-5, "rough": {"mu_k": 0.4833}, "rest": {"mu_k": 0.1869}}
    found, exact = (
        ringsweep.sweep(scene, {"time.span": [8.0]}, solver={"method": "implicit", "rtol": rtol}, progress=False)
        for rtol in (3e-6, 1e-10)
    )
    assert abs(found.omega_max - exact.omega_max).item() < 1e-8


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("rounding", [0.0, 1e-18, -1e-18])
def test_turn_of_a_hop_that_begins_at_rest_is_its_top(side, rounding):
    """In one step from rest to the top and in one to the landing; the velocity at the top is rounding."""
    course = [
        Interval(t, 1.0, side * x, side * v) for t, x, v in ((0.0, 0.0, 0.0), (1.0, 0.5, rounding), (2.0, 0.0, -1.0))
    ]
    turns = [turn_within(last, now) for last, now in pairwise(course)]
    tops = [turn.x for turn in turns if (turn.is_greatest if side > 0.0 else turn.is_least)]
    assert side * max(tops, key=abs) == pytest.approx(0.5)
