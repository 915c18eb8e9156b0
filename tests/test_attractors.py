"""Attractors: cells that end on the same motion have one label, and shares have their sampling error."""

import numpy as np
import pytest
import xarray as xr
from belts import on_belt, with_all_parts
from refusals import refused

import ringsweep


def sections(x, velocity=None, dims=("initial_x",), **variables):
    """Dataset of cells with these sections."""
    x = np.asarray(x, dtype=float)
    velocity = np.zeros_like(x) if velocity is None else np.asarray(velocity, dtype=float)
    points = {"x_section": ((*dims, "section"), x), "velocity_section": ((*dims, "section"), velocity)}
    return xr.Dataset(points | {name: (dims, value) for name, value in variables.items()})


def flags(values, meanings):
    return xr.DataArray(values, dims="initial_x", attrs={"flag_values": range(len(meanings.split())),
                                                         "flag_meanings": meanings})  # fmt: skip


def henon(start, count, b=0.3):
    """Points of the map of Henon, after a transient: a chaotic attractor at a = 1.4."""
    x, y, found = *start, []
    for k in range(count + 500):
        x, y = 1.0 - 1.4 * x * x + y, b * x
        if k >= 500:
            found.append((x, y))
    return np.array(found).T


def labels(ds, **options):
    return ringsweep.attractors(ds, **options).attractor.values.tolist()


class TestLabels:
    def test_periodic_motions_are_the_same_from_any_point_on(self):
        lap = [0.0, 1.0, 3.0]
        ds = sections([lap * 4, np.roll(lap, 1).tolist() * 4, [0.0, 3.0, 1.0] * 4, [0.0] * 12])
        # The same three points in another order are another motion.
        assert labels(ds) == [1, 1, 2, 3]

    def test_old_points_of_a_transient_do_not_count(self):
        motion = np.tile([0.0, 1.0], 16)
        late = motion + np.where(np.arange(32) < 8, 0.3, 0.0)
        assert labels(sections([motion, late])) == [1, 1]

    def test_points_that_differ_by_less_than_the_tolerance_are_the_same(self):
        ds = sections([[0.0, 1.0] * 4, [0.0, 1.0 + 1e-4] * 4, [0.0, 1.0 + 1e-2] * 4])
        assert labels(ds) == [1, 1, 2]
        assert labels(ds, tolerance=0.1) == [1, 1, 1]

    def test_a_chaotic_motion_is_one_cloud_wherever_its_runs_start(self):
        clouds = [henon((0.1 * k, 0.0), 64) for k in range(4)]
        other = clouds[0] + np.array([[0.0], [1.0]])
        x, velocity = np.stack([*clouds, other]).transpose(1, 0, 2)
        assert labels(sections(x, velocity)) == [1, 1, 1, 1, 2]

    def test_steady_slip_is_a_point_whatever_its_section_kept(self):
        x = [[0.5, 0.3, 0.2, 0.15], [np.nan] * 4, [2.0, 0.0, 2.0, 0.0]]
        regime = flags([1, 1, 0], "oscillatory sliding")
        ds = sections(x, x_end=[0.1, 0.1, 0.7], velocity_end=[0.0, 0.0, 0.2]).assign(regime=regime)
        found = ringsweep.attractors(ds)
        assert ringsweep.words(found.attractor).values.tolist() == ["sliding_1", "sliding_1", "oscillatory_2"]

    def test_cells_that_have_not_settled_have_none(self):
        x = [[0.0, 1.0] * 4] * 4
        long_run = flags([0, 1, 0, 2], "periodic transient unbounded")
        assert labels(sections(x).assign(long_run=long_run)) == [1, 0, 1, 0]
        assert labels(sections(x, settled=[1, 1, 0, 1])) == [1, 1, 0, 1]

    def test_the_most_frequent_motion_is_the_first(self):
        assert labels(sections([[5.0] * 4, [1.0] * 4, [1.0] * 4])) == [2, 1, 1]


@pytest.mark.slow
class TestShares:
    def spread(self, found, exact):
        return np.std([(one.share[2] - exact) / one.share_error[2] for one in found])

    def test_errors_of_random_cells_are_those_of_draws(self):
        draw, found = np.random.default_rng(1), []
        for _ in range(200):
            hit = draw.uniform(size=300) < 0.2
            # Of the two motions the first one is the more frequent.
            found.append(ringsweep.attractors(sections(np.where(hit, 1.0, 0.0)[:, None] * np.ones(4), dims=("point",))))
        assert 0.8 < self.spread(found, 0.2) < 1.2

    def test_errors_of_a_grid_are_those_of_an_area(self):
        draw, found, side = np.random.default_rng(2), [], 24
        for _ in range(100):
            offset = draw.uniform(size=2)
            i, j = (np.arange(side) + offset[:, None]) / side
            # The disc lies within the square wherever the grid does.
            inside = np.hypot(i[:, None] - 1.04 * 0.5, j[None] - 1.04 * 0.5) < 0.3
            x = np.where(inside, 1.0, 0.0)[..., None] * np.ones(4)
            found.append(ringsweep.attractors(sections(x, dims=("initial_x", "initial_velocity"))))
        assert 0.3 < self.spread(found, np.pi * 0.09) < 1.5


def test_a_sweep_without_a_section_is_refused():
    refused("record", ringsweep.attractors, xr.Dataset({"regime": ("a", [1])}))
    refused("tolerance", ringsweep.attractors, sections([[1.0]]), tolerance=0.0)


def belt(velocity, law=None, **sections):
    """Friction oscillator of Stender and Hoffmann, bSTAB, Nonlinear Dyn. 107 (2022)."""
    scene = on_belt(
        law or {"law": "tustin", "mu_s": 1.0, "mu_k": 0.5, "alpha": 2.0},
        damping=0.1,
        velocity=velocity,
        span=600.0,
        gravity=1.0,
    )
    scene = with_all_parts(scene | sections.pop("scene", {}))
    return ringsweep.run({"scene": scene, **sections}, jobs=1, progress=False)


def basin(velocity, side=24, law=None):
    """Attractors of launches from the middles of equal parts of -2 < x < 2, 0 < v < 2."""
    at = (np.arange(side) + 0.5) / side
    grid = {"initial.x": (4.0 * at - 2.0).tolist(), "initial.velocity": (2.0 * at).tolist()}
    record = {"section": {"at": "turn", "keep": 8}}
    return ringsweep.attractors(belt(velocity, law, record=record, sweep={"grid": grid}))


@pytest.mark.slow
@pytest.mark.parametrize(("velocity", "published"), [(1.325, 0.1378), (1.5, 0.312), (1.55, 0.3636), (1.775, 0.5552)])
def test_share_of_steady_sliding_is_that_of_the_published_basin(velocity, published):
    """Of launches at random, the share of 1.5 has a standard error of 0.007."""
    found = basin(velocity)
    names = [name.split("_")[0] for name in found.label.values]
    assert sorted(names) == ["none", "sliding", "stick-slip"]
    slides = names.index("sliding")
    share, error = found.share.values[slides], found.share_error.values[slides]
    assert abs(share - published) < 3.0 * np.hypot(error, 0.007)
    # Beside the boundary, and a little above the speed of the Hopf bifurcation, a few launches settle slowly.
    assert found.share.values[0] < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("law", [None, {"law": "lugre", "mu_s": 0.6, "mu_k": 0.5, "sigma0": 1e3, "v_s": 0.1}])
def test_where_all_launches_end_on_steady_slip_it_has_one_label(law):
    """Ends differ by what is left of the decay, which is the whole range of them."""
    found = basin(1.85, 6, law)
    assert found.label.values.tolist() == ["none", "sliding_1"]
    assert found.share.values.tolist() == [0.0, 1.0]


@pytest.mark.slow
class TestBranchesOfTheFrictionOscillator:
    def follow(self, velocities, direction, **initial):
        sweep = {
            "grid": {"belt.velocity": velocities.tolist()},
            "follow": {"axis": "belt.velocity", "direction": direction},
        }
        scene = {"initial": initial, "time": {"span": 2000.0}}
        return belt(1.0, scene=scene, record={"exponent": True}, sweep=sweep)

    def test_the_cycle_ends_where_it_has_been_published(self):
        """1.83660: beyond, no launch from stick sticks again."""
        velocities = 1.8366 + np.arange(-10, 11) * 2e-5
        ds = self.follow(velocities, "up", x=1.0, velocity=velocities[0])
        sticks = ringsweep.words(ds.regime).values == "stick-slip"
        last = np.flatnonzero(sticks).max()
        assert sticks[: last + 1].all()
        assert velocities[last] == pytest.approx(1.8366, abs=5e-5)
        assert set(ringsweep.words(ds.long_run).values[last + 1 :]) == {"steady"}
