"""Sections of the motion on the belt: states at each period of force or drive, and at each turn."""

from copy import deepcopy

import numpy as np
import pytest
from belts import by_scipy, on_belt, with_all_parts

import ringsweep
from ringsweep import cli
from ringsweep.runs.task_sizes import TaskSizes
from ringsweep.storage.checkpoint import Checkpoint

#: It sticks, slips, and passes the speed of the belt, under a force with the period 4.
FORCED = on_belt(
    {"law": "tustin", "mu_s": 0.6, "mu_k": 0.2, "alpha": 3.0},
    damping=0.02, velocity=0.3, gravity=1.0, force=(0.5, 0.25), start=(0.1, 0.0), span=48.0,
)  # fmt: skip

LUGRE = {"law": "lugre", "mu_s": 0.15, "mu_k": 0.1, "sigma0": 100.0, "sigma1": 2.0, "sigma2": 0.1, "v_s": 0.05}
BRISTLES = on_belt(LUGRE, velocity=0.1, gravity=1.0, force=(0.05, 0.2), span=20.0)


def run(scene, section, output=None, **sweep):
    """Outcomes of a scene with a section."""
    config = {"scene": with_all_parts(scene), **({"record": {"section": section}} if section else {}), **sweep}
    return ringsweep.run(deepcopy(config), output, jobs=1, progress=False)


@pytest.mark.slow
@pytest.mark.parametrize("scene", [FORCED, BRISTLES], ids=["tustin", "lugre"])
def test_points_at_each_force_period_are_the_ends_of_runs_over_so_many(scene):
    ds = run(scene, {"at": "period", "keep": 16})
    spans = (np.arange(1, 17) / scene["force"]["frequency"])[: int(scene["time"]["span"] * scene["force"]["frequency"])]
    ends = run(scene, None, sweep={"grid": {"time.span": spans.tolist()}})
    assert ds.slips > 3 or scene is BRISTLES
    assert ("deflection_section" in ds) == (scene is BRISTLES)
    for name in ("x", "velocity", "deflection")[: 3 if scene is BRISTLES else 2]:
        np.testing.assert_allclose(ds[f"{name}_section"][: len(spans)], ends[f"{name}_end"], atol=1e-7)
        assert np.isnan(ds[f"{name}_section"][len(spans) :]).all()
        assert ds[f"{name}_section"].units == ends[f"{name}_end"].units


@pytest.mark.slow
def test_points_at_each_turn_are_the_maxima_of_an_independent_integration():
    maxima = np.array([y[0] for part, _ in by_scipy(FORCED) for y in part.y_events[1]])
    ds = run(FORCED, {"at": "turn"})
    np.testing.assert_allclose(ds.x_section[: len(maxima)], maxima, atol=1e-9)
    assert np.isnan(ds.x_section[len(maxima) :]).all()
    assert np.isnan(ds.velocity_section[len(maxima) :]).all()
    np.testing.assert_array_equal(ds.velocity_section[: len(maxima)], 0.0)


@pytest.mark.slow
def test_the_last_points_are_kept_in_their_order_and_nothing_else_changes():
    spans = {"sweep": {"grid": {"time.span": [3.0, 7.0, 23.0, 44.0, 48.0]}}}
    every, few = (run(FORCED, {"at": "period", "keep": keep}, **spans) for keep in (64, 5))
    for i, count in enumerate([0, 1, 5, 11, 12]):
        assert np.isfinite(every.x_section[i]).sum() == count
        for name in ("x_section", "velocity_section"):
            last = every[name][i, max(count - 5, 0) : count].values
            np.testing.assert_array_equal(few[name][i, : len(last)], last)
            assert np.isnan(few[name][i, len(last) :]).all()
    plain = run(FORCED, None, **spans)
    assert every.drop_dims("section").equals(plain)


@pytest.fixture(scope="module")
def swept():
    return {"sweep": {"grid": {"force.frequency": np.linspace(0.1, 0.3, 5).tolist(), "force.amplitude": [0.2, 0.4]}}}


@pytest.mark.slow
def test_files_resume_and_reuse_hold_the_points(tmp_path, monkeypatch, swept):
    section, target = {"at": "period", "keep": 16384}, tmp_path / "out.nc"
    whole = run(FORCED, section, **swept)
    assert whole.x_section.dims == ("force_frequency", "force_amplitude", "section")
    monkeypatch.setattr(TaskSizes, "max_cells", 3)
    put, stored = Checkpoint.put, []

    def stop_after_one(self, positions, *rest):
        if stored:
            raise RuntimeError("stopped")
        stored.append(len(positions))
        put(self, positions, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, "put", stop_after_one)
        with pytest.raises(RuntimeError):
            run(FORCED, section, target, **swept)
    assert (tmp_path / "out.nc.partial").exists()
    with run(FORCED, section, target, **swept) as file:
        assert file.drop_attrs().equals(whole.drop_attrs())
        assert file.x_section.encoding["chunksizes"] == (1, 2, 16384)
    ringsweep.verify(target)
    part = deepcopy(swept)
    part["sweep"]["grid"]["force.amplitude"] = [0.4]
    config = {"scene": with_all_parts(FORCED), "record": {"section": section}, **part}
    again = ringsweep.run(config, reuse=target, progress=False)
    np.testing.assert_array_equal(again.x_section, whole.x_section[:, 1:])
    assert cli.main(["info", str(target)]) == 0
    assert len(whole.ringsweep.to_frame()) == 10


@pytest.mark.slow
def test_sweep_over_laws_has_no_deflection_where_the_law_has_no_bristles():
    scene = deepcopy(FORCED)
    scene["friction"] |= {"sigma0": 100.0, "sigma1": 2.0, "sigma2": 0.1, "v_s": 0.05}
    ds = run(scene, {"at": "period", "keep": 4}, sweep={"grid": {"friction.law": ["tustin", "lugre"]}})
    assert np.isnan(ds.deflection_section[0]).all()
    assert np.isfinite(ds.deflection_section[1]).all()
    assert np.isfinite(ds.x_section).all()
