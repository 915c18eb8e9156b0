"""Zones of other friction on the belt, and in space."""

import numpy as np
import pytest
import xarray as xr
from belts import on_belt, outcome, with_exponent
from solutions import period_map
from test_functions_of_time import cells_of
from tiers import mostly_slow

import ringsweep

G = 9.81


def with_zones(zones, elsewhere, frame="belt", period=1.0, law="stiction", **rest):
    """Body on a belt with zones ``(center, half_length, mu_s, mu_k)``; all parts are there, so kernels are shared."""
    friction = {"law": law, "frame": frame, "elsewhere": dict(zip(("mu_s", "mu_k"), elsewhere, strict=True))}
    scene = on_belt(friction, **({"velocity": 0.0, "stiffness": 0.0, "force": (0.0, 0.5), "span": 4.0} | rest))
    scene["zones"] = [dict(zip(("center", "half_length", "mu_s", "mu_k"), zone, strict=True)) for zone in zones]
    if frame == "belt":
        scene["belt"]["period"] = period
    return scene


def on_bristles(law, frame, zones=((0.1, 0.12, 0.25, 0.2), (-0.2, 0.05, 0.5, 0.4)), elsewhere=(0.4, 0.3), **rest):
    """Body with bristles on a belt with zones, whose kernel all tests of a law and a frame share."""
    scene = with_zones(zones, elsewhere, frame, law=law, **({"stiffness": 8.0, "force": (3.0, 0.4)} | rest))
    of_law = {"sigma0": 1000.0} | ({} if law in ("dahl", "bristle") else {"sigma1": 5.0})
    scene["friction"] |= of_law | ({"sigma2": 0.2, "v_s": 0.05} if law in ("lugre", "elasto-plastic") else {})
    if law in ("dahl", "bristle"):
        for place in (scene["friction"]["elsewhere"], *scene["zones"]):
            del place["mu_s"]
    return scene


def where_it_stops(energy, low, high, period, rough, rest):
    """Way along which friction takes an energy by mass and g, over patches from `low` to `high` in each period."""
    x, edges = 0.0, [(n * period + e, mu) for n in range(99) for e, mu in ((low, rest), (high, rough))]
    for edge, mu in edges:
        if energy <= mu * (edge - x):
            return x + energy / mu
        energy, x = energy - mu * (edge - x), edge
    raise AssertionError


@pytest.mark.parametrize(("frame", "period"), [("belt", 0.7), ("space", 1e9)])
def test_friction_over_patches_takes_the_energy_of_the_launch(frame, period):
    scene = with_zones([(0.3, 0.1, 0.5, 0.4)], (0.2, 0.1), frame, 0.7)
    speeds = np.linspace(0.3, 3.0, 15)
    run = ringsweep.sweep(scene, {"initial.velocity": np.append(speeds, -1.0)}, progress=False)
    stops = [where_it_stops(v * v / (2.0 * G), 0.2, 0.4, period, 0.4, 0.1) for v in speeds]
    assert run.x_end.values[:-1] == pytest.approx(stops, rel=1e-12)
    assert run.certified.all()
    # Backwards the next patch begins a period less 0.4 m away, or there is none.
    behind = where_it_stops(1.0 / (2.0 * G), period - 0.4, period - 0.2, period, 0.4, 0.1)
    assert run.x_end.values[-1] == pytest.approx(-behind, rel=1e-12)


LAWS = ("stiction", "dahl", "lugre", "elasto-plastic", "reset-integrator", "bristle")


@pytest.mark.parametrize("law", mostly_slow(["stiction", "dahl", "reset-integrator"], ["stiction"]))
def test_patches_move_with_their_belt(law):
    """Seen from the belt a body slides as on one at rest; under stiff bristles nearly as far as under Coulomb's law."""
    rest = {"velocity": 0.4, "stiffness": 0.0, "force": (0.0, 0.5), "start": (0.0, 2.4), "span": 4.0}
    patch = [(0.3, 0.1, 0.4, 0.4)], (0.1, 0.1)
    scene = with_zones(*patch, **rest) if law == "stiction" else on_bristles(law, "belt", *patch, **rest)
    scene["friction"] |= {} if law == "stiction" else {"sigma0": 1e6}
    stop = where_it_stops(2.0 / G, 0.2, 0.4, 1.0, 0.4, 0.1)
    assert outcome(scene).x_end.item() - 0.4 * 4.0 == pytest.approx(stop, rel=1e-12 if law == "stiction" else 1e-4)


@pytest.mark.parametrize("law", mostly_slow(LAWS, ["stiction"]))
def test_a_patch_of_the_whole_period_is_no_patch(law):
    axes = {"belt.velocity": np.linspace(0.05, 0.6, 6)}
    rest = {"stiffness": 8.0, "force": (1.0, 0.4), "start": (0.1, 0.3)}
    names = ["x_end", "velocity_end", "stick_time", "force_max", "x_max"]
    patch = [(0.2, 0.5, 0.4, 0.2)], (0.9, 0.8)
    scene = with_zones(*patch, **rest) if law == "stiction" else on_bristles(law, "belt", *patch, **rest)
    # Steps of series end to rounding, implicit ones to their tolerance.
    solver, share = ("auto", 1e-11) if law == "stiction" else ({"method": "implicit", "rtol": 1e-11}, 1e-8)
    one = ringsweep.sweep(scene, axes, solver=solver, progress=False)
    friction = {name: value for name, value in scene["friction"].items() if name not in ("frame", "elsewhere")}
    friction |= {name: mu for name, mu in scene["zones"][0].items() if name.startswith("mu")}
    none = ringsweep.sweep(on_belt(friction, span=4.0, **rest), axes, solver=solver, progress=False)
    for name in names:
        assert one[name].values == pytest.approx(none[name].values, rel=share, abs=share)
    assert (one.regime == none.regime).all()


@pytest.mark.slow
@pytest.mark.parametrize("law", ["lugre", "tanh"])
def test_multipliers_over_patches_are_those_of_neighbouring_runs(law):
    """A smooth law creeps over edges in implicit steps, and slips in series."""
    names = ("x", "velocity", "deflection")[: 3 if law == "lugre" else 2]
    if law == "lugre":
        rest = {"velocity": 0.25, "stiffness": 20.0, "force": (12.0, 0.5), "start": (0.1, 0.0), "span": 200.0}
        scene = on_bristles("lugre", "space", **rest)
    else:
        friction = {"law": "tanh", "v0": 2e-4, "frame": "space", "elsewhere": {"mu_k": 0.2}}
        rest = {"damping": 0.05, "velocity": 0.05, "gravity": 1.0, "force": (0.1, 0.25, 0.3), "span": 400.0}
        scene = on_belt(friction, 2.0, start=(0.1, 0.0), **rest)
        scene["zones"] = [
            {"center": 0.1, "half_length": 0.12, "mu_k": 0.1},
            {"center": -0.2, "half_length": 0.05, "mu_k": 0.3},
        ]
    period = 1.0 / scene["force"]["frequency"]

    def ends(spans, **start):
        columns = {"time.span": spans} | {f"initial.{name}": column for name, column in start.items()}
        axes = {path: xr.DataArray(column, dims="run") for path, column in columns.items()}
        tight = {"method": "implicit", "rtol": 1e-11, "certify": False}
        last = ringsweep.sweep(scene, axes, solver=tight, progress=False)
        return np.array([last[f"{name}_end"] for name in names])

    def one_period(at):
        return ends(np.full(2 * len(names), period), **dict(zip(names, at, strict=True)))

    found = with_exponent(scene, certify=True)
    multipliers = np.sort(np.abs(np.linalg.eigvals(period_map(one_period, ends([50.0 * period]), 1e-6))))[::-1]
    assert found.certified.item() == 1
    pair = [found.multiplier_1.item(), found.multiplier_2.item()]
    assert pair == pytest.approx(multipliers[:2], rel=1e-4, abs=1e-9)


def test_a_belt_carries_a_stuck_body_to_the_edge_of_a_smooth_stretch():
    # It breaks loose at the edge, 0.1 m on: the spring pulls less than friction before it and more than behind it.
    scene = with_zones([(0.3, 0.2, 0.05, 0.02)], (0.5, 0.4), "space", velocity=0.5, stiffness=10.0)
    run = outcome(scene)
    assert run.first_slip.item() == pytest.approx(0.1 / 0.5, rel=1e-12)
    assert run.certified.item() == 1


def test_a_stuck_body_on_a_patch_of_the_belt_stays_on_it():
    # It breaks loose at the static friction of its patch, where it is in space.
    scene = with_zones([(0.0, 0.1, 0.3, 0.2)], (0.1, 0.1), velocity=0.5, stiffness=10.0)
    assert outcome(scene).first_slip.item() == pytest.approx(0.3 * G / 10.0 / 0.5, rel=1e-12)


def test_the_millionth_period_of_a_belt_is_as_exact_as_the_first():
    start = 700_000.0
    run = outcome(with_zones([(0.3, 0.1, 0.5, 0.4)], (0.2, 0.1), period=0.7, start=(start, 3.0)))
    stop = where_it_stops(9.0 / (2.0 * G), 0.2, 0.4, 0.7, 0.4, 0.1)
    assert run.x_end.item() - start == pytest.approx(stop, abs=4.0 * np.spacing(start))


def test_bounds_tell_the_rounding_of_edges_of_narrow_patches_far_away():
    start, period, width, mu, speeds = 500.0, 1e-3, 1e-9, 100.0, np.linspace(0.6, 1.2, 8)
    scene = with_zones([(0.5 * period, 0.5 * width, mu, mu)], (0.0, 0.0), period=period, start=(start, 1.0), span=1.0)
    run = ringsweep.sweep(scene, {"initial.velocity": speeds}, progress=False)
    patches = np.floor((run.x_end.values - start) / period + 0.5)
    left = np.sqrt(speeds**2 - 2.0 * mu * G * width * patches)
    assert (abs(run.velocity_end.values - left) <= run.velocity_end_error.values).all()
    assert run.certified.all()


def test_a_large_ring_near_its_bottom_is_a_belt():
    radius = 1e7
    friction = {"law": "stiction", "rough": {"mu_s": 0.5, "mu_k": 0.4}, "elsewhere": {"mu_s": 0.2, "mu_k": 0.1}}
    ring = {
        "model": "ring-single-contact",
        "body": {"mass": 1.0},
        "ring": {"radius": radius},
        "friction": friction,
        "zone": {"center": 0.3 / radius, "half_angle": 0.1 / radius},
        "initial": {"omega": 1.5 / radius},
        "time": {"span": 1.0},
        "classify": {"epsilon_omega": 0.0},
    }
    belt = with_zones([(0.3, 0.1, 0.5, 0.4)], (0.2, 0.1), period=2.0 * np.pi * radius, start=(0.0, 1.5), span=1.0)
    assert outcome(ring).phi_end.item() * radius == pytest.approx(outcome(belt).x_end.item(), rel=1e-6)


def test_history_tells_the_zone_and_the_edges():
    run = ringsweep.simulate(with_zones([(0.3, 0.1, 0.5, 0.4)], (0.2, 0.1), "space", start=(0.0, 2.0)))
    inside = (run.x > 0.2 + 1e-9) & (run.x < 0.4 - 1e-9)
    assert (run.zone_1.values[inside.values] == 1).all()
    assert inside.any()
    edges = run.event_time.values[ringsweep.words(run.event_kind).values == "edge"]
    before, after = (np.sqrt(4.0 - 2.0 * G * work) for work in (0.1 * 0.2, 0.1 * 0.2 + 0.4 * 0.2))
    assert edges == pytest.approx([(2.0 - before) / 0.1 / G, (2.0 - before) / 0.1 / G + (before - after) / 0.4 / G])


def test_a_run_that_goes_on_finds_the_zones_where_they_are_by_then(tmp_path):
    zones = [(0.2, 0.15, 0.6, 0.3), (-0.3, 0.1, 0.1, 0.05)]
    scene = with_zones(zones, (0.4, 0.25), period=1.3, stiffness=8.0, velocity=0.3, force=(3.0, 0.4), start=(0.1, 0.3))
    whole, first = outcome(scene | {"time": {"span": 4.0}}), tmp_path / "first.nc"
    ringsweep.run({"scene": scene | {"time": {"span": 2.3}}}, first, jobs=1, progress=False).close()
    del scene["initial"]
    rest = outcome(scene | {"initial": {"from": str(first)}, "time": {"span": 1.7}})
    np.testing.assert_allclose([rest.x_end, rest.velocity_end], [whole.x_end, whole.velocity_end], atol=1e-9)


@pytest.mark.parametrize("load", [None, {"formula": "Q*sin(u*t)", "Q": "1 N", "u": f"{np.pi} rad/s"}])
def test_a_rocking_belt_with_zones_shares_its_period_with_force_and_load(load):
    scene = with_zones([(0.3, 0.1, 0.5, 0.4)], (0.2, 0.1), force=(1.0, 0.5))
    scene["belt"].pop("velocity")
    scene["drive"] = {"law": "sinusoidal", "amplitude": 0.1, "frequency": 1.5}
    scene["body"] |= {"load": load} if load else {}
    assert cells_of(scene).forcing_period == pytest.approx(2.0)
