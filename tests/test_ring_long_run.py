"""What a rocking ring settles to: sections at each period of the drive, words, exponents and multipliers."""

from copy import deepcopy

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from rings import course, particle, rubs, shape
from solutions import growth, period_map

import ringsweep
from ringsweep import cli

GRAVITY, RADIUS = 9.81, 0.1

#: A small body that slips both ways on a ring with a rough zone, sticks for a part of each period, and crosses edges.
ROCKING = (
    particle(0.2, RADIUS, zone=0.3)
    | rubs("stiction", rest=(0.3, 0.2), rough=(0.8, 0.6))
    | course("sinusoidal", 1.0, 1.0, phi=0.4, omega=0.0, span=40.0)
)

#: Two balls on a rod, on a ring that rocks.
RIG = (
    shape(0.076, 4.47e-5, 0.025, 0.01, 0.043378, zone=0.26)
    | rubs("stiction", rest=(0.2, 0.1), rough=(0.5, 0.3))
    | course("sinusoidal", 0.6, 1.3, phi=0.3, omega=0.0, span=60.0 / 1.3)
)


def section(keep=8, exponent=True, **period):
    """A record of points at each period. With the exponent beside them, most runs share one kernel for each scene."""
    return {"section": {"at": "period", "keep": keep, **period}, "exponent": exponent}


def run(scene, record=None, **sections):
    record = section() if record is None else record
    return ringsweep.run(deepcopy({"scene": scene, "record": record, **sections}), jobs=1, progress=False)


def word(found, name="long_run"):
    return ringsweep.words(found[name]).item()


def ends(scene, spans, **initial):
    """Place and velocity at the ends of runs over some spans, or from some places and velocities."""
    points = {"time.span": spans} | {f"initial.{name}": values for name, values in initial.items()}
    sweep = {"points": {path: np.asarray(column).tolist() for path, column in points.items()}}
    found = run(scene, sweep=sweep, solver={"method": "event", "rtol": 1e-14, "certify": False})
    return np.array([found.phi_end, found.omega_end])


def test_points_are_states_at_whole_periods():
    found = run(ROCKING | {"time": {"span": 12.0}}, section(12))
    phi, omega = ends(ROCKING, np.arange(1.0, 13.0))
    assert 0.1 < found.stick_time.item() < 11.0
    np.testing.assert_allclose(found.phi_section, (phi + np.pi) % (2.0 * np.pi) - np.pi, atol=1e-8)
    np.testing.assert_allclose(found.omega_section, omega, atol=1e-7)


@pytest.mark.parametrize("rtol", [1e-10, 1e-12, 1e-14])
@pytest.mark.parametrize(("amplitude", "sticks"), [(1.0, True), (2.0, False)])
def test_multipliers_are_those_of_the_period_map(amplitude, sticks, rtol):
    """With stops, reversals and edges; stick erases one of two disturbances."""
    drive = {"law": "sinusoidal", "amplitude": amplitude, "frequency": 1.0}
    found = run(ROCKING | {"drive": drive}, solver={"method": "event", "rtol": rtol})
    assert word(found) == "periodic"
    assert found.period.item() == pytest.approx(1.0, rel=1e-12)
    assert (found.stick_time.item() > 1.0) == sticks
    scene = ROCKING | {"drive": drive}
    map_derivative = period_map(lambda at: ends(scene, np.ones(4), phi=at[0], omega=at[1]), ends(scene, [40.0]), 1e-6)
    exact = np.linalg.eigvals(map_derivative)
    values = np.sort(np.abs(exact))
    assert found.multiplier_1.item() == pytest.approx(values[1], rel=1e-6)
    assert found.multiplier_2.item() == pytest.approx(values[0], rel=1e-6, abs=1e-6)
    angles = np.abs(np.angle(exact[np.abs(exact) > 1e-3 * values[1]]))
    assert abs(found.multiplier_angle_1.item()) == pytest.approx(angles.max(), abs=1e-5)


def test_a_chain_of_equal_cells_is_one_run():
    """Three cells of 20 periods, and a run of 60: the angle of the ring, its zone and the body go on."""
    three = run(ROCKING | {"time": {"span": 20.0}}, sweep={
        "points": {"drive.amplitude": [1.0, 1.0, 1.0]}, "follow": "drive.amplitude",
    })  # fmt: skip
    assert ringsweep.words(three.started_from).values.tolist() == ["initial", *["end_of_the_cell_before"] * 2]
    one = run(ROCKING | {"time": {"span": 60.0}})
    for name in ("phi_end", "omega_end", "multiplier_1"):
        assert three[name].values[-1] == pytest.approx(one[name].item(), abs=1e-9)
    np.testing.assert_allclose(three.phi_section[-1], one.phi_section, atol=1e-9)


def test_rocking_ring_has_two_motions_at_one_frequency_chosen_by_the_past():
    """A pendulum swings farther as its frequency falls behind that of the drive, up to a fold; then it sticks."""
    slippery = rubs("stiction", rest=(0.12, 0.08), rough=(0.12, 0.08))
    found = run(ROCKING | slippery | {"time": {"span": 120.0}}, sweep={
        "grid": {"drive.frequency": [1.3, 1.34, 1.37, 1.4, 1.44]},
        "follow": {"axis": "drive.frequency", "direction": "both"},
    })  # fmt: skip
    assert set(ringsweep.words(found.long_run).values.ravel().tolist()) == {"periodic"}
    apart = np.abs(found.phi_section.sel(direction="up") - found.phi_section.sel(direction="down")).max("section")
    assert (apart.values > 0.1).tolist() == [False, False, False, True, False]


@pytest.mark.slow
@pytest.mark.parametrize("law", ["stiction", "bengisu-akay"])
def test_exponents_are_those_of_two_neighbouring_runs(law):
    """Pairs of runs of two balls on a rod, brought together again after each period, in random cells."""
    cells, periods = 24, 60
    rng = np.random.default_rng(30)
    frequency = rng.uniform(0.8, 2.0, cells)
    mu_k, rough = rng.uniform(0.03, 0.15, cells), rng.uniform(0.15, 0.4, cells)
    steep = {} if law == "stiction" else {"alpha": 5.0, "v0": 0.01}
    points = {
        "drive.frequency": frequency,
        "drive.amplitude": rng.uniform(0.2, 0.7, cells) / frequency,
        "friction.rest.mu_k": mu_k,
        "friction.rest.mu_s": 1.5 * mu_k,
        "friction.rough.mu_k": rough,
        "friction.rough.mu_s": 1.3 * rough,
        "zone.half_angle": rng.uniform(0.1, 0.6, cells),
        "initial.phi": rng.uniform(-0.5, 0.5, cells),
        "initial.omega": rng.uniform(-1.0, 1.0, cells),
    }
    scene = RIG | {"friction": {"law": law} | steep, "zone": {}}
    scene["drive"] = {"law": "sinusoidal"}

    def outcomes(points, record):
        sweep = {"points": {path: np.asarray(column).tolist() for path, column in points.items()}}
        return run(scene, record, sweep=sweep, solver={"method": "auto", "certify": False})

    found = outcomes(points | {"time.span": periods / frequency}, section(1))
    one_period = points | {"time.span": 1.0 / frequency}
    weight = np.maximum(2.0 * np.pi * frequency, np.sqrt(GRAVITY / 0.043378))
    kept = np.isfinite(found.lyapunov.values)
    used = growth(lambda both: outcomes(both, {}), one_period, ("phi", "omega"), weight, periods, 1e-7)
    used = used[periods // 4 :, kept]
    error = np.hypot(used.std(axis=0) / np.sqrt(len(used)), (found.lyapunov_error.values / frequency)[kept])
    difference = np.abs((found.lyapunov.values / frequency)[kept] - used.mean(axis=0))
    assert (np.abs(used.mean(axis=0)) > 0.1).sum() >= 5
    assert kept.sum() >= 18
    assert (difference <= 3.0 * error + 0.02).all()


@pytest.mark.slow
@pytest.mark.parametrize("law", ["lugre", "bengisu-akay"])
def test_points_of_laws_that_creep_are_states_at_whole_periods(law):
    """Each point is the end of a run over so many periods, and bristles bring both deflections."""
    parts = {
        "lugre": {"sigma0": 2000.0, "sigma1": 5.0, "sigma2": 0.0, "v_s": 0.01},
        "bengisu-akay": {"alpha": 50.0, "v0": 1e-3},
    }
    scene = RIG | {"friction": RIG["friction"] | {"law": law} | parts[law], "time": {"span": 2.0 / 1.3}}
    record = section(2, exponent=law != "lugre")
    found = run(scene, record)
    histories = ringsweep.simulate({"scene": scene, "record": record}, samples=600).drop_duplicates("time")
    for k, point in enumerate((1.0, 2.0)):
        names = {"phi": "phi_section", "omega": "omega_section"}
        if law == "lugre":
            names |= {"deflection_1": "deflection_1_section", "deflection_2": "deflection_2_section"}
        for name, points in names.items():
            at = np.interp(point / 1.3, histories.time, histories[name])
            scale = float(np.abs(histories[name]).max())
            assert found[points].values[k] == pytest.approx(at, abs=2e-3 * scale)
    assert found.phi_section.values[-1] == pytest.approx(found.phi_end.item(), abs=1e-12)
    assert ("deflection_1_section" in found) == (law == "lugre")


def measured(theta, period, periods):
    """A drive by the function `theta` over some periods, s, as a table."""
    time = np.linspace(0.0, periods * period, 1000 * periods + 1)
    return {"law": "table", "time": time.tolist(), "theta": theta(time).tolist()}


@pytest.mark.slow
def test_a_measured_drive_takes_the_period_that_is_stated():
    """Without stick, whose end depends on the third derivative of the drive: a spline has little of it."""
    drive = {"law": "sinusoidal", "amplitude": 2.0, "frequency": 1.0}
    table = measured(lambda t: 2.0 * np.sin(2.0 * np.pi * t), 1.0, 40)
    found, exact = run(ROCKING | {"drive": table}, section(6, period=1.0)), run(ROCKING | {"drive": drive})
    assert word(found) == word(exact) == "periodic"
    np.testing.assert_allclose(found.phi_section, exact.phi_section[-6:], atol=1e-5)
    assert found.multiplier_1.item() == pytest.approx(exact.multiplier_1.item(), abs=1e-6)


@pytest.mark.slow
def test_words_do_not_change_with_the_span():
    """A body that rocks, one that a ring turns round, one that sticks for good, at 60, 120 and 300 periods."""
    cells = 20
    rng = np.random.default_rng(3)
    frequency = np.tile(rng.uniform(0.7, 2.0, cells), 3)
    points = {
        "drive.frequency": frequency,
        "drive.amplitude": np.tile(rng.uniform(0.2, 0.8, cells), 3) / frequency,
        "zone.half_angle": np.tile(rng.uniform(0.1, 0.6, cells), 3),
        "initial.phi": np.tile(rng.uniform(-0.6, 0.6, cells), 3),
        "time.span": np.repeat([60.0, 120.0, 300.0], cells) / frequency,
    }
    sweep = {"points": {path: column.tolist() for path, column in points.items()}}
    scene = RIG | {"drive": {"law": "sinusoidal"}, "zone": {}}
    found = run(scene, sweep=sweep, solver={"method": "auto", "certify": False})
    words, settled = ringsweep.words(found.long_run).values.reshape(3, cells), found.settled.values.reshape(3, cells)
    period = found.period.values.reshape(3, cells)
    first = settled[0] == 1
    assert first.sum() >= cells // 2
    assert (words[1:, first] == words[0, first]).all()
    np.testing.assert_allclose(period[1:, first], np.broadcast_to(period[0, first], (2, first.sum())), rtol=1e-9)


@pytest.mark.slow
def test_full_turns_do_not_count():
    """A ring that turns once in each period carries the body round: the motion returns."""
    scene = ROCKING | rubs("stiction", rest=(0.9, 0.5), rough=(0.9, 0.5)) | {"gravity": 0.1}
    scene["drive"] = measured(lambda t: np.pi * t + 0.1 * np.sin(np.pi * t), 2.0, 30)
    scene |= {"initial": {"phi": 0.0, "omega": np.pi * 1.1}, "time": {"span": 60.0}}
    found = run(scene, section(period=2.0))
    assert found.phi_end.item() > 100.0
    assert np.abs(found.phi_section.values).max() <= np.pi
    assert word(found) == "periodic"
    assert found.period.item() == pytest.approx(2.0)


def test_attractors_of_a_ring_are_motions_on_a_circle():
    """Points just beyond either end of the range of angles are near to each other."""
    phi = np.array([[3.1415, 0.0] * 4, [-3.1415, 0.0] * 4, [2.9, 0.0] * 4])
    points = {
        "phi_section": (("initial_phi", "section"), phi),
        "omega_section": (("initial_phi", "section"), 0.1 * phi**2),
    }
    found = ringsweep.attractors(xr.Dataset(points))
    assert found.attractor.values.tolist() == [1, 1, 2]


def test_diagram_and_section_of_a_ring_are_drawn(tmp_path):
    grid = {"drive.amplitude": np.linspace(0.5, 2.0, 6).tolist()}
    record = {"section": {"at": "period", "keep": 8}, "exponent": True}
    sweep = {"scene": ROCKING, "record": record, "sweep": {"grid": grid}}
    ds = ringsweep.run(deepcopy(sweep), tmp_path / "ring.nc", jobs=1, progress=False)
    assert cli.main(["map", str(tmp_path / "ring.nc"), "-o", str(tmp_path / "ring.png")]) == 0
    assert (tmp_path / "ring.png").exists()
    figure = ringsweep.plots.bifurcation(ds)
    assert figure.axes[0].get_ylabel() == r"$\varphi$ (°)"
    drawn = figure.axes[0].collections[0].get_offsets()[:, 1]
    np.testing.assert_allclose(np.sort(drawn), np.sort(np.degrees(ds.phi_section.values.ravel())))
    ax = ringsweep.plots.section_panel(ds.isel(drive_amplitude=3))
    assert ax.get_ylabel().startswith(r"$\omega$")
    plt.close("all")
