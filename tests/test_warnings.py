"""Warnings about results reach users of Python and of the command line, once for each call."""

import logging
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml

import ringsweep
from ringsweep.config import load
from ringsweep.quantities.flags import FAILED, OSCILLATORY
from ringsweep.report.text import in_lines
from ringsweep.runs.warnings import warn_of_results
from ringsweep.storage import netcdf

SCENE = load(Path(__file__).parents[1] / "configs" / "regime_map.yaml").source["scene"] | {"time": {"span": "0.5 s"}}
FRICTION = {"rough": {"mu_s": 0.5, "mu_k": 0.3}, "rest": {"mu_s": 0.2, "mu_k": 0.1}}
RK4 = {"method": "rk4", "steps": 100}
AXES = {"drive.amplitude": [0.5, 2.0]}
#: Friction jumps at once, so the body falls off at the top.
AT_THE_TOP = SCENE | {"initial": {"phi": "180 deg"}}

STIFF, LAUNCH = "limit of stability of rk4", "at t = 0"


def config(scene=SCENE, solver=RK4, **sweep):
    return {"scene": scene, "solver": solver} | ({"sweep": {"grid": AXES}} if sweep.get("sweep") else {})


CALLS = {
    "run": lambda folder, **given: ringsweep.run(config(**given, sweep=True), progress=False),
    "run into a file": lambda folder, **given: ringsweep.run(
        config(**given, sweep=True), folder / "out.nc", progress=False
    ).close(),
    "sweep": lambda folder, scene=SCENE, solver=RK4: ringsweep.sweep(scene, AXES, solver=solver, progress=False),
    "simulate": lambda folder, **given: ringsweep.simulate(config(**given)),
}


@pytest.fixture
def warned(caplog):
    """Number of warnings that contain a text, since the test began."""
    caplog.set_level(logging.WARNING, logger="ringsweep")
    return lambda text: sum(text in record.getMessage() for record in caplog.records)


@pytest.mark.parametrize(
    ("given", "stiff", "at_once"),
    [({}, 1, 0), ({"scene": AT_THE_TOP, "solver": "auto"}, 0, 1), ({"solver": "auto"}, 0, 0)],
)
@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_each_call_gives_one_warning_and_none_about_good_runs(call, tmp_path, warned, given, stiff, at_once):
    call(tmp_path, **given)
    assert (warned(STIFF), warned(LAUNCH)) == (stiff, at_once)


def test_finished_file_gives_the_warning_again_without_computation(tmp_path, warned):
    for count in (1, 2):
        CALLS["run into a file"](tmp_path)
        assert warned(STIFF) == count


def test_reused_cells_give_the_warning_again(tmp_path, warned):
    CALLS["run into a file"](tmp_path)
    ringsweep.run(config(sweep=True), tmp_path / "again.nc", reuse=tmp_path / "out.nc", progress=False).close()
    assert warned(STIFF) == 2


SCRIPT = "import ringsweep; ringsweep.run('case.yaml', progress=False)"


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ["-m", "ringsweep", "run", "case.yaml"],
        ["-m", "ringsweep", "simulate", "case.yaml"],
        ["-m", "ringsweep", "simulate", "case.yaml", "-q"],
        ["-c", SCRIPT],
    ],
    ids=["run", "simulate", "quiet", "script without logging"],
)
def test_process_prints_the_warning_once(tmp_path, command):
    (tmp_path / "case.yaml").write_text(yaml.safe_dump(config(sweep=True)))
    done = subprocess.run([sys.executable, *command], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stderr.count(STIFF) == 1
    assert done.stderr.startswith("ringsweep: ") == ("-m" in command)
    assert done.stderr.count("\n") == 1 or "-m" in command


BELT = load(Path(__file__).parents[1] / "configs" / "belt_viscous.yaml").source["scene"] | {
    "friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.1}
}


def test_belts_give_the_share_of_riding_bodies(caplog):
    """The body of 1 kg on a spring of 2 N/m slips at 0.15 m g = 2 N/m v t."""
    of = BELT | {"body": {"mass": 1.0}, "spring": {"stiffness": 2.0}, "time": {"span": 7.0}, "initial": {"x": 0.0}}
    ringsweep.sweep(of | {"belt": {"velocity": 0.1}}, {"belt.velocity": [0.1, 0.05, 5.0]}, progress=False)
    assert "66.7% of the bodies ride: they have not broken loose" in caplog.text
    ringsweep.simulate(of | {"belt": {"velocity": 0.1}})
    assert "the body rides: it has not broken loose" in caplog.text


def test_warnings_of_a_belt_whose_weight_overflows_are_the_only_ones():
    """NumPy's own warnings are errors in these tests."""
    of = BELT | {"body": {"mass": 1e308}, "spring": {"stiffness": 2.0}, "belt": {"velocity": 0.1}}
    found = ringsweep.sweep(of, {"belt.velocity": [0.1]}, progress=False)
    assert found["regime"].size == 1


def test_belts_give_the_share_of_motions_that_have_not_settled(caplog, capsys):
    of = BELT | {"body": {"mass": 1.0}, "spring": {"stiffness": 2.0}, "belt": {"velocity": 0.1}, "initial": {"x": 0.0}}
    found = ringsweep.sweep(of, {"time.span": [12.0, 60.0]}, progress=False)
    assert "50.0% of the motions have not settled" in caplog.text
    print(in_lines(found))
    assert "not settled: 50.0% of the motions" in capsys.readouterr().out


def results(stiffness, t_end=1.0):
    """Outcomes of four million cells with a few values of the stiffness, and one time of the end."""
    values = np.resize(np.asarray(stiffness, dtype=float), (2000, 2000))
    return xr.Dataset(
        {"stiffness": (("a", "b"), values), "t_end": (("a", "b"), np.full_like(values, t_end))},
        attrs={"Conventions": "CF-1.11", "ringsweep_version": "0"},
    )


@pytest.mark.parametrize(
    ("stiffness", "message"),
    [
        ([0.0, 2.61], None),
        ([0.0, 5.22, 2.0, 2.0], "25.0 % of the cells exceed .* about 2e+02 steps are needed"),
        # A number of steps that is rounded down is too small.
        ([5.24, 2.0], "about 2.1e+02 steps are needed"),
        ([np.inf, 2.0], "50.0 % of the cells exceed .* no step is small enough"),
        ([5.22, np.nan], "100.0 % of the cells exceed .* no step is small enough"),
    ],
)
def test_warning_names_the_share_of_cells_and_the_remedy(caplog, stiffness, message):
    warn_of_results(results(stiffness), load(config()))
    (found,) = [record.getMessage() for record in caplog.records] or [None]
    assert found is message or all(part in found for part in message.split(".*"))


def test_map_that_one_word_fills_says_what_to_look_at(caplog):
    def told(regimes, scene=SCENE, **more):
        caplog.clear()
        found = more | {
            "regime": (("x", "y"), regimes),
            "t_end": (("x", "y"), np.linspace(1.0, 2.0, regimes.size).reshape(regimes.shape)),
        }
        with caplog.at_level("INFO", "ringsweep"):
            warn_of_results(xr.Dataset(found), load(config(scene)))
        return caplog.messages

    regimes = np.full((5, 5), OSCILLATORY, dtype="int8")
    assert told(regimes)[0].startswith("all 25 cells are oscillatory: do the axes reach far enough")
    assert not told(regimes, phi_section=(("x", "y", "section"), np.zeros((5, 5, 2))))
    assert not told(regimes[:3, :3])
    belt = {"model": "belt", "body": {"mass": 1.0}, "spring": {"stiffness": 2.0}, "belt": {"velocity": 0.1}}
    belt |= {"friction": {"law": "coulomb", "mu_k": 0.1}, "time": {"span": 1.0}}
    zoned = SCENE | {"zone": {"half_angle": 0.3}}
    assert ["zone" in told(regimes, scene)[0] for scene in (belt, zoned)] == [False, True]
    regimes[4, 4] = 0
    assert not told(regimes)


def test_run_that_is_given_up_is_named_with_its_coordinates_and_the_reason(tmp_path, warned):
    """A body that rests at one amplitude, and sticks and slips for 1e300 s at the other."""
    scene = BELT | {"body": {"mass": 1.0}, "spring": {"stiffness": 2.0}, "time": {"span": 1e300}}
    solver = {"method": "event", "max_steps": 2000}
    ringsweep.sweep(scene, {"belt.velocity": [0.1, 0.2]}, solver=solver, progress=False)
    assert warned("2 of 2 runs have failed; the first at belt_velocity = 0.1 m s-1: it was given up after 2000 steps")
    assert warned("of 1e+300 s, as events go on: a shorter time.span has a result")


@pytest.mark.parametrize(
    ("phi_end", "why"), [(np.nan, "a number was not finite"), (1.5, "no step succeeds at t = 2.5 s")]
)
def test_failed_run_with_finite_numbers_says_when_no_step_succeeded(caplog, phi_end, why):
    ends = {"phi_end": phi_end, "omega_end": 0.5, "t_end": 2.5}
    warn_of_results(xr.Dataset({"regime": np.int8(FAILED)} | ends), load(config()))
    assert caplog.messages[0].startswith(f"the run has failed: {why}")


def test_axis_that_changes_no_number_is_told(caplog):
    """In a ring that turns by 0.15 or 0.3 rad no ball meets a zone at the top; in one that turns by 6 rad both do."""
    scene = SCENE | {"time": {"span": "3 s"}, "friction": {"law": "stiction", **FRICTION}}
    axes = {"zone.half_angle": np.radians([5.0, 10.0, 20.0]), "drive.amplitude": [0.05, 0.1, 0.1001]}
    top = scene | {"zone": {"center": "180 deg"}}

    def told(swept):
        caplog.clear()
        with caplog.at_level("INFO", "ringsweep"):
            ringsweep.sweep(top, swept, progress=False)
        return [message for message in caplog.messages if "no number depends" in message]

    why = "no contact meets an edge of the zone, or friction is alike on both sides"
    assert told(axes) == [f"no number depends on zone_half_angle: {why}"]
    assert not told(axes | {"drive.amplitude": [2.0]})


@pytest.mark.slow
def test_warnings_and_summary_of_a_file_read_it_chunk_by_chunk(tmp_path, capsys, caplog):
    flags = {"flag_values": np.int8([0, 1]), "flag_meanings": "resting oscillatory"}
    ds = results([5.22, 2.0])
    one, cells, number = xr.ones_like(ds["t_end"]), ds["t_end"].dims, np.arange(2000)
    ds = ds.assign(
        regime=(cells, np.broadcast_to(number % 2, one.shape).astype("int8"), flags),
        certified=(cells, one.values.astype("int8"), flags),
        phi_end=one,
        phi_end_error=one * xr.DataArray(np.where(number % 100 == 0, 1e-9, np.nan), dims="b"),
    )
    netcdf.save(ds, tmp_path / "out.nc")
    loaded = load(config())
    with netcdf.open_dataset(tmp_path / "out.nc") as found:
        tracemalloc.start()
        warn_of_results(found, loaded)
        print(in_lines(found))
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    out = capsys.readouterr().out
    assert "50.0 % of the cells" in caplog.text
    assert "resting: 2000000 (50.0%)" in out
    assert "phi_end: 1.0e-09, 1.0e-09" in out
    assert "no bound where nearby runs diverge: 3960000 of the certified cells" in out
    # A variable has 32 MB.
    assert peak < 8e6
