"""Branches: along an axis each cell starts from the end of the one before, and the run of a file goes on."""

import json
from copy import deepcopy

import numpy as np
import pytest
import refusals
import xarray as xr
from belts import on_belt, with_all_parts

import ringsweep
from ringsweep import InputError, cli
from ringsweep.config import load
from ringsweep.models import batch
from ringsweep.quantities.flags import REGIMES
from ringsweep.quantities.variables import OUTCOMES
from ringsweep.storage import netcdf
from ringsweep.storage.checkpoint import Checkpoint

#: A spring that hardens, under a force: near 0.35 Hz a large and a small motion exist side by side.
HARDENING = on_belt(
    {"law": "tustin", "mu_s": 1e-6, "mu_k": 1e-6, "alpha": 1.0},
    cubic=1.0,
    damping=0.1,
    velocity=50.0,
    span=199.0,
    gravity=1.0,
    force=(0.5, 0.25),
    start=(0.0, 0.0),
)

LUGRE = with_all_parts(
    on_belt(
        {"law": "lugre", "mu_s": 0.15, "mu_k": 0.1, "sigma0": 100.0, "sigma1": 2.0, "sigma2": 0.1, "v_s": 0.05},
        velocity=0.1,
        span=7.0,
        gravity=1.0,
        force=(0.05, 0.2),
    )
)

FREQUENCIES = [0.21, 0.24, 0.27, 0.3, 0.33, 0.36]

NAMES = "x_end", "velocity_end", "t_end", "swing", "certified", "started_from"


def run(scene, output=None, jobs=1, **sections):
    return ringsweep.run({"scene": deepcopy(scene), **deepcopy(sections)}, output, jobs=jobs, progress=False)


def branches(output=None, jobs=1, **options):
    follow = {"axis": "force.frequency", "direction": "both"}
    grid = {"force.amplitude": [0.4, 0.5], "force.frequency": FREQUENCIES}
    return run(HARDENING, output, jobs, sweep={"grid": grid, "follow": follow}, **options)


@pytest.fixture(scope="module")
def both():
    return branches().load()


@pytest.mark.parametrize(("way", "frequency", "begun"), [("up", 0.21, 0), ("up", 0.33, 1), ("down", 0.24, 1)])
def test_history_of_a_followed_cell_begins_where_the_cell_before_ended(both, way, frequency, begun):
    cell = {"force.amplitude": 0.5, "force.frequency": frequency, "direction": way}
    history = both.ringsweep.simulate(cell)
    here = both.sel(force_amplitude=0.5, direction=way)
    before = here.sel(force_frequency=frequency + (-0.03 if way == "up" else 0.03), method="nearest")
    here = here.sel(force_frequency=frequency)
    assert history.x[0] == (before.x_end if begun else 0.0)
    for name in ("t_end", "x_end", "velocity_end", "regime"):
        assert history[name].item() == here[name].item()


def test_cell_of_a_part_of_a_followed_sweep_is_refused(both):
    with pytest.raises(InputError, match="is a part of a sweep that follows an axis"):
        both.isel(force_frequency=[2, 3]).ringsweep.simulate(force_frequency=0.3, force_amplitude=0.5, direction="up")


def test_swing_of_a_followed_cell_is_that_of_a_run_from_the_same_state():
    """Where the span is a whole number of periods but for rounding, its last period counts."""
    frequencies = np.linspace(0.2, 0.36, 24)
    sweep = {"grid": {"force.frequency": frequencies.tolist()}, "follow": "force.frequency"}
    scene, solver = HARDENING | {"time": {"span": 30.0}}, {"method": "auto", "certify": False}
    followed = run(scene, sweep=sweep, solver=solver)
    points = {
        "force.frequency": frequencies.tolist(),
        "initial.x": [0.0, *followed.x_end.values[:-1].tolist()],
        "initial.velocity": [0.0, *followed.velocity_end.values[:-1].tolist()],
        "time.span": (np.round(followed.t_end.values * frequencies) / frequencies).tolist(),
    }
    single = run(scene, sweep={"points": points}, solver=solver)
    assert (single.t_end.values != followed.t_end.values).any()
    np.testing.assert_allclose(single.swing.values, followed.swing.values, rtol=1e-9)


def changed(scene, section, **values):
    scene = deepcopy(scene)
    scene.setdefault(section, {}).update(values)
    return scene


class TestBranches:
    def test_up_and_down_find_both_motions_of_a_hardening_spring(self, both):
        up, down = (both.swing.sel(force_amplitude=0.5, direction=way) for way in ("up", "down"))
        assert (abs(up / down - 1.0) > 0.5).any()
        # Below and above the fold there is one motion.
        assert abs(up / down - 1.0)[0] < 1e-3

    def test_spans_are_whole_periods_so_that_sections_can_be_compared(self, both):
        periods = both.t_end * both.force_frequency
        assert np.allclose(periods, np.round(periods), rtol=0, atol=1e-9)
        assert (both.t_end >= 199.0).all()
        assert (both.t_end < 199.0 + 1.0 / 0.21).all()

    def test_only_the_first_cell_of_a_chain_starts_from_initial(self, both):
        expected = np.ones((2, 6, 2))
        expected[:, 0, 0] = expected[:, -1, 1] = 0
        assert np.array_equal(both.started_from, expected)

    @pytest.mark.slow
    def test_the_same_cells_three_times_are_one_run_of_three_spans(self):
        points = {"points": {"force.frequency": [0.2] * 3}, "follow": "force.frequency"}
        scene = changed(LUGRE, "time", span=10.0)
        chain, whole = run(scene, sweep=points), run(changed(LUGRE, "time", span=30.0))
        for name in "x_end", "velocity_end", "deflection_end":
            assert np.isclose(chain[name][-1], whole[name], rtol=1e-5, atol=1e-9)

    def test_after_a_run_that_failed_the_chain_starts_from_initial_again(self):
        sweep = {"grid": {"time.span": [20.0, 40.0, 2000.0]}, "follow": {"axis": "time.span", "direction": "down"}}
        ds = run(HARDENING, sweep=sweep, solver={"method": "event", "max_steps": 500})
        assert ringsweep.words(ds.regime).values.tolist() == ["oscillatory", "oscillatory", "failed"]
        assert ds.started_from.values.tolist() == [1, 0, 0]


class TestTheSameBits:
    def test_with_two_jobs_and_from_a_file(self, both, tmp_path):
        found = branches(tmp_path / "a.nc", jobs=2)
        for name in NAMES:
            assert np.array_equal(found[name], both[name], equal_nan=True), name
        assert found.direction.values.tolist() == ["up", "down"]

    def test_after_an_interruption(self, both, tmp_path, monkeypatch):
        put, calls = Checkpoint.put, []

        def interrupted(self, *args):
            put(self, *args)
            calls.append(1)
            if len(calls) == 2:
                raise KeyboardInterrupt

        monkeypatch.setattr(Checkpoint, "put", interrupted)
        with pytest.raises(KeyboardInterrupt):
            branches(tmp_path / "a.nc")
        monkeypatch.setattr(Checkpoint, "put", put)
        found = branches(tmp_path / "a.nc")
        for name in NAMES:
            assert np.array_equal(found[name], both[name], equal_nan=True), name


@pytest.mark.slow
class TestAFileGoesOn:
    @pytest.mark.parametrize("simulated", [False, True])
    def test_two_runs_are_one_run_of_both_spans(self, simulated, tmp_path):
        file = tmp_path / "first.nc"
        if simulated:
            ringsweep.simulate(deepcopy(LUGRE)).to_netcdf(file)
        else:
            run(LUGRE, file).close()
        second = run(changed(LUGRE, "initial", **{"from": str(file)}))
        whole = run(changed(LUGRE, "time", span=14.0))
        for name in "x_end", "velocity_end", "deflection_end":
            assert np.isclose(second[name], whole[name], rtol=1e-4, atol=1e-7), name

    def test_a_deflection_is_a_number_of_the_scene(self):
        # The bristles alone pull: m a = -sigma0 z at the first instant.
        scene = changed(LUGRE, "initial", deflection=1e-3, x=0.0)
        scene["friction"] |= {"sigma1": 0.0, "sigma2": 0.0}
        history = ringsweep.simulate(scene)
        assert history.deflection[0] == 1e-3
        assert np.isclose(history.friction_force[0], 100.0 * 1e-3)


def test_a_deflection_beyond_the_limit_of_its_own_cell_is_refused():
    scene = load({"scene": changed(LUGRE, "initial", deflection=0.0)}).scene
    columns = {path: np.full(3, value) for path, value in scene.values.items()}
    limit = (
        scene.values["friction.mu_s"]
        * scene.values["body.mass"]
        * scene.values["gravity"]
        / scene.values["friction.sigma0"]
    )
    columns["friction.mu_s"] = scene.values["friction.mu_s"] * np.array([0.8, 1.0, 2.0])
    # A run under `dahl` ends up to a thousandth of a percent beyond the limit, which is its error.
    columns["initial.deflection"] = limit * np.array([0.05, -1.0 - 1e-5, 2.0])
    np.testing.assert_array_equal(batch(scene.structure, columns).initial_z, limit * np.array([0.05, -1.0, 2.0]))
    columns["initial.deflection"][2] = 2.5 * limit
    with pytest.raises(InputError, match=f"{2.5 * limit:.6g} m is not allowed: .* up to {2 * limit:.6g} m"):
        batch(scene.structure, columns)


class TestFilesThatDoNotGoOn:
    """Files of runs as `run` writes them, made by hand."""

    @pytest.fixture
    def file(self, tmp_path):
        def write(name="first.nc", regime="oscillatory", runs=(), scene=LUGRE, **changed):
            numbers = {"t_end": 7.0, "x_end": 0.01, "velocity_end": 0.1, "deflection_end": 1e-3} | changed
            columns = {"regime": np.int8(REGIMES.index(regime))} | numbers
            ds = xr.Dataset({n: (("run",) * len(runs), np.full(runs, v)) for n, v in columns.items()})
            ds["regime"].attrs = OUTCOMES["regime"].attributes
            attributes = {
                "Conventions": "CF-1.11",
                "ringsweep_version": "0",
                "configuration": json.dumps({"scene": scene}),
            }
            netcdf.save(ds.assign_attrs(attributes), tmp_path / name)
            return tmp_path / name

        return write

    def refused(self, file, words):
        error = refusals.refused(None, load, {"scene": changed(LUGRE, "initial", **{"from": str(file)})})
        assert (error.path, words in error.problem) == ("scene.initial.from", True), error

    def test_sound_file_goes_on(self, file):
        assert load({"scene": changed(LUGRE, "initial", **{"from": str(file())})}).scene.values["initial.x"] == 0.01

    @pytest.mark.parametrize(
        ("about", "problem"),
        [
            *(({"regime": regime}, f"is {regime}: it has no state") for regime in ("failed", "separating", "jammed")),
            ({"x_end": np.nan}, "is not the result of a run that can go on"),
            ({"x_end": "far"}, "is not the result of a run that can go on"),
            ({"runs": (2,)}, "holds 2 runs"),
        ],
    )
    def test_what_is_no_state_that_could_go_on(self, file, about, problem):
        self.refused(file(**about), problem)

    @pytest.mark.parametrize("damage", ["changed", "cut"])
    def test_damaged_bytes(self, file, damage):
        path = file()
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 1
        path.write_bytes(content if damage == "changed" else content[:-2000])
        self.refused(path, "damaged")

    def test_configuration_that_names_itself(self, tmp_path):
        path = tmp_path / "loop.yaml"
        path.write_text(json.dumps({"scene": changed(LUGRE, "initial", **{"from": "loop.yaml"})}))
        self.refused(path, "is no result file")
        self.refused(tmp_path / "absent.nc", "does not exist")

    def test_results_that_name_each_other(self, file, tmp_path):
        for one, other in (("a.nc", "b.nc"), ("b.nc", "a.nc")):
            file(one, scene=changed(LUGRE, "initial", **{"from": str(tmp_path / other)}))
        self.refused(tmp_path / "a.nc", "a result holds its initial values")
        assert cli.main(["run", str(tmp_path / "a.nc"), "--dry-run"]) == 2
