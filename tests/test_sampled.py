"""Uncertain parameters: probabilities, survival, quantiles and Sobol indices of sampled sweeps."""

import json
import logging
import re
from typing import Any

import numpy as np
import pytest
import xarray as xr
from belts import on_belt
from refusals import refused
from scipy.special import ndtr, ndtri
from xarray.testing import assert_identical

import ringsweep
from ringsweep import InputError
from ringsweep.cli import main
from ringsweep.config import load
from ringsweep.plots import probability_panel, regime_map, sensitivity_panel, survival_panel
from ringsweep.quantities.flags import REGIMES
from ringsweep.statistics import (
    clopper_pearson,
    distribution,
    quantiles,
    saltelli,
    share_interval,
    sobol_indices,
    sobol_sums,
    unit_points,
)

# A body on a belt rides until k v t = mu_s m g.
BELT = on_belt({"law": "stiction", "mu_s": 0.15, "mu_k": 0.05}, 2.0, velocity=0.1, gravity=9.81, span=7.0)
SAMPLE: dict[str, Any] = {"n": 256, "of": {"friction.mu_s": {"normal": [0.15, "10 %"]}}}


def config(scene: Any = BELT, grid: Any = None, solver: str = "auto", **sample: Any) -> dict[str, Any]:
    sweep = {"sample": SAMPLE | sample} | ({"grid": grid} if grid else {})
    return {"scene": scene, "sweep": sweep, "solver": solver}


@pytest.mark.parametrize(
    ("path", "text", "ends"),
    [
        ("friction.mu_s", "0.15 ± 10 %", (0.135, 0.165)),
        ("friction.mu_s", "0.15 +- 0.01", (0.14, 0.16)),
        ("friction.mu_s", "15 %+/-10%", (0.135, 0.165)),
        ("body.mass", "980 ± 20 g", (0.96, 1.0)),
        ("initial.velocity", "-0.1 ± 50 %", (-0.15, -0.05)),
    ],
)
def test_a_tolerance_is_the_uniform_distribution_between_its_bounds(path, text, ends):
    (factor,) = load(config(of={path: {"uniform": text}})).sample.factors
    assert (factor.kind, factor.numbers) == ("uniform", pytest.approx(ends))
    drawn = factor.draw(np.linspace(0.0, 1.0, 5))[path]
    assert (drawn.min(), drawn.max()) == pytest.approx(ends)


@pytest.mark.parametrize("model", ["ring", "ring-single-contact", "belt"])
def test_a_first_configuration_has_a_tolerance_to_uncomment(model, tmp_path):
    target = tmp_path / "my.yaml"
    main(["init", str(target), "--model", model])
    text = target.read_text(encoding="utf-8")
    target.write_text(re.sub(r"^  # (sample:|  )", r"  \1", text, flags=re.MULTILINE), encoding="utf-8")
    (factor,) = load(target).sample.factors
    low, high = factor.numbers
    assert (factor.kind, high / low) == ("uniform", pytest.approx(1.1 / 0.9))


def run(given: dict[str, Any], *args: Any, **options: Any) -> xr.Dataset:
    return ringsweep.run(given, *args, **({"jobs": 1, "progress": False} | options)).load()


def probability_of_riding(span: Any, mean: float = 0.15, deviation: float = 0.015) -> Any:
    return ndtr((mean - span * 2.0 * 0.1 / 9.81) / deviation)


def write(path: Any, given: dict[str, Any]) -> str:
    # A mapping in JSON is YAML too.
    path.write_text(json.dumps(given))
    return str(path)


# The designs and the estimators, alone


def test_a_distribution_has_its_mean_and_its_quantiles() -> None:
    u = (np.arange(200_000) + 0.5) / 200_000
    cases = {
        "normal": ((2.0, 0.5), 2.0, 0.5),
        "uniform": ((1.0, 3.0), 2.0, 2.0 / np.sqrt(12.0)),
        "lognormal": ((2.0, 0.5), 2.0, 0.5),
        "triangular": ((0.0, 1.0, 2.0), 1.0, np.sqrt(1.0 / 6.0)),
        "truncnormal": ((1.0, 1.0, 1.0, 40.0), 1.0 + np.sqrt(2.0 / np.pi), np.sqrt(1.0 - 2.0 / np.pi)),
    }
    for name, (numbers, mean, deviation) in cases.items():
        values = distribution(name, *numbers).ppf(u)
        assert values.mean() == pytest.approx(mean, rel=1e-4), name
        assert values.std() == pytest.approx(deviation, rel=1e-3), name
        assert (np.diff(values) >= 0.0).all()


@pytest.mark.parametrize("method", ["sobol", "random"])
def test_more_points_continue_the_points_before(method: str) -> None:
    few, many = (unit_points(method, count, 3, 5, 2) for count in (64, 256))
    assert (many[:64] == few).all()
    assert ((many > 0.0) & (many < 1.0)).all()
    assert (unit_points(method, 64, 3, 5, 3) != few).all()


def test_the_interval_of_clopper_and_pearson_is_that_of_tables() -> None:
    low, high = clopper_pearson([0, 3, 10], 10)
    # C. J. Clopper, E. S. Pearson, Biometrika 26, 1934; 3 of 10 from R's binom.test.
    assert low == pytest.approx([0.0, 0.06673951, 0.69150289], abs=1e-7)
    assert high == pytest.approx([0.30849711, 0.65245285, 1.0], abs=1e-7)


@pytest.mark.parametrize(("method", "dimension"), [("sobol", 1), ("sobol", 3), ("latin-hypercube", 2), ("random", 2)])
def test_intervals_cover_known_probabilities(method: str, dimension: int) -> None:
    """Half-spaces of normal numbers have known probabilities."""
    random, covered, count = np.random.default_rng(7), 0, 600
    designs = [np.stack([unit_points(method, 32, dimension, seed, r) for r in range(8)]) for seed in range(20)]
    for k in range(count):
        normal = random.normal(size=dimension)
        share = random.uniform(0.01, 0.99)
        inside = ndtri(designs[k % 20]) @ (normal / np.linalg.norm(normal)) < ndtri(share)
        low, high = share_interval(inside.sum(axis=-1), 32, method == "random")
        covered += bool(low <= share <= high)
    assert 0.935 <= covered / count <= 0.995


def test_equal_counts_are_not_taken_for_certainty() -> None:
    low, high = share_interval(np.full(8, 8), 32, independent=False)
    assert low < 0.25 - 0.2 / 32
    assert high > 0.25 + 0.2 / 32


def test_quantiles_of_a_normal_number_are_covered() -> None:
    random, levels, covered = np.random.default_rng(3), np.array([0.05, 0.5, 0.9]), np.zeros(3)
    for _ in range(100):
        values = random.normal(size=(8, 400))
        found = quantiles(values, levels, True)
        assert (found[0] == np.quantile(values, levels, method="inverted_cdf")).all()
        covered += (found[1] <= ndtri(levels)) & (ndtri(levels) <= found[2])
    assert (covered >= 91).all()


def test_a_quantile_that_most_runs_do_not_reach_is_infinite() -> None:
    values = np.where(np.arange(80).reshape(8, 10) % 10 < 3, 1.0, np.inf)
    value, low, high = quantiles(values, [0.1, 0.5], True)
    assert value.tolist() == [1.0, np.inf]
    assert high[1] == np.inf
    assert low[0] == 1.0


def ishigami(u: Any) -> Any:
    x = np.pi * (2.0 * u - 1.0)
    return np.sin(x[..., 0]) + 7.0 * np.sin(x[..., 1]) ** 2 + 0.1 * x[..., 2] ** 4 * np.sin(x[..., 0])


def g_function(u: Any) -> Any:
    a = np.array([0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0])
    return np.prod((np.abs(4.0 * u - 2.0) + a) / (1.0 + a), axis=-1)


def indices(function: Any, dimension: int, size: int, seed: int = 3) -> Any:
    rows = [function(saltelli(unit_points("sobol", size, 2 * dimension, seed, r))) for r in range(8)]
    return sobol_indices(np.stack([sobol_sums(one) for one in rows]), size)


def test_indices_of_functions_whose_indices_are_known() -> None:
    # T. Ishigami, T. Homma, 1990, and A. Saltelli, I. M. Sobol, 1995.
    first, total = indices(ishigami, 3, 1024)
    assert first[0] == pytest.approx([0.3139, 0.4424, 0.0], abs=0.01)
    assert total[0] - first[0] == pytest.approx([0.2437, 0.0, 0.2437], abs=0.01)
    first, _ = indices(g_function, 8, 1024)
    assert first[0] == pytest.approx([0.7162, 0.1790, 0.0237, 0.0072, 0.0001, 0.0001, 0.0001, 0.0001], abs=0.005)


def test_intervals_cover_known_indices() -> None:
    known = np.array([[0.3139, 0.4424, 0.0], [0.5576, 0.4424, 0.2437]])
    covered = np.zeros((2, 3))
    for seed in range(100):
        _, low, high = np.moveaxis(np.stack(indices(ishigami, 3, 64, seed)), 0, 1)
        covered += (low <= known) & (known <= high)
    assert (covered >= 88).all()


@pytest.mark.parametrize("missing", [False, True])
def test_indices_are_unknown_for_a_function_that_is_constant_or_has_gaps(missing: bool) -> None:
    rows = np.ones((8, 16, 4))
    if missing:
        rows += unit_points("random", 512, 1, 0, 0).reshape(rows.shape)
        rows[3, 5, 2] = np.nan
    first, total = sobol_indices(np.stack([sobol_sums(one) for one in rows]), 16)
    for found in (first, total):
        assert (found[0] == 0.0).all()
        assert (found[1] == 0.0).all()
        assert (found[2] == 1.0).all()


# Sweeps


@pytest.mark.parametrize("method", ["sobol", "latin-hypercube", "random"])
def test_the_probability_to_ride_is_that_of_the_closed_form(method: str) -> None:
    spans = [6.5, 7.0, 7.5, 8.0, 8.5]
    ds = run(config(grid={"time.span": spans}, method=method))
    known = probability_of_riding(np.array(spans))
    found = ds.sel(word="riding")
    assert (found.probability_low.values <= known).all()
    assert (known <= found.probability_high.values).all()
    assert ds.probability.sum("word").values == pytest.approx(1.0)
    assert ds.runs.sum(["replicate", "word", "certificate"]).values.tolist() == [256] * 5
    assert ds.word.values.tolist() == list(REGIMES)


def test_survival_and_quantiles_of_the_first_slip_equal_the_closed_form() -> None:
    times = np.linspace(5.0, 9.0, 9)
    ds = run(config(survival={"linspace": [5.0, 9.0, 9]}, quantiles={"first_slip": [0.05, 0.5]}, n=1024))
    known = np.where(times < 7.0, probability_of_riding(times), probability_of_riding(7.0))
    assert (ds.survival_low.values <= known).all()
    assert (known <= ds.survival_high.values).all()
    # Half of the bodies ride for longer than the span.
    median = 0.15 * 9.81 / 0.2
    assert ds.first_slip_quantile.values[1] == np.inf
    early = median * (1.0 + 0.1 * ndtri(0.05))
    assert ds.first_slip_quantile_low.values[0] <= early <= ds.first_slip_quantile_high.values[0]


def test_indices_of_the_way_of_a_body_that_rides_are_those_of_a_product() -> None:
    """x = v T with both uniform: shares of the variance of a product of independent numbers."""
    of = {"belt.velocity": {"uniform": [0.05, 0.15]}, "time.span": {"uniform": [1.0, 4.5]}}
    ds = run(config(of=of, n=1024, sensitivity={"of": ["x_end", "t_end"]}))
    assert ds.probability.sel(word="riding") == 1.0
    velocity, span, both = 2.75**2 * 0.1**2 / 12.0, 0.1**2 * 3.5**2 / 12.0, 0.1**2 / 12.0 * 3.5**2 / 12.0
    known = np.array([velocity, span]) / (velocity + span + both)
    assert ds.x_end_sobol_first.values == pytest.approx(known, abs=0.01)
    assert (ds.x_end_sobol_first_low <= known).all()
    assert (known <= ds.x_end_sobol_first_high).all()
    assert (ds.x_end_sobol_total - ds.x_end_sobol_first).values == pytest.approx(
        2 * [both / (velocity + span + both)], abs=0.01
    )
    assert ds.t_end_sobol_first.values == pytest.approx([0.0, 1.0], abs=0.01)
    # All ride: nothing is known of what the regime depends on.
    assert (ds.sobol_first_high == 1.0).all()


def test_indices_of_slip_by_a_time_are_those_of_runs_of_the_same_points() -> None:
    """The body slips by t if mu_s m g <= k v t, so its indicator follows from the points without a run."""
    of = {"friction.mu_s": {"uniform": [0.1, 0.2]}, "belt.velocity": {"uniform": [0.08, 0.12]}}
    times = np.array([5.0, 6.5])
    ds = run(config(of=of, n=256, survival=times.tolist(), sensitivity={"of": ["first_slip"]}))
    rows = np.stack([saltelli(unit_points("sobol", 32, 4, 0, r)) for r in range(8)])
    slip = (0.1 + 0.1 * rows[..., 0]) * 9.81 / (2.0 * (0.08 + 0.04 * rows[..., 1]))
    for k, time in enumerate(times):
        first, total = sobol_indices(np.stack([sobol_sums((one <= time).astype(float)) for one in slip]), 32)
        one = ds.isel(survival_time=k)
        assert np.stack([one[f"first_slip_sobol_first{end}"] for end in ("", "_low", "_high")]) == pytest.approx(first)
        assert np.stack([one[f"first_slip_sobol_total{end}"] for end in ("", "_low", "_high")]) == pytest.approx(total)
    assert (ds.first_slip_sobol_first.sel(parameter="friction.mu_s") > 0.3).all()


def test_runs_without_certificate_count_both_ways_and_are_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    scene = BELT | {"time": {"span": 7.3}}
    given = config(scene, n=64) | {"solver": {"method": "auto", "certify": False}}
    with caplog.at_level(logging.WARNING, "ringsweep"):
        ds = run(given)
    assert "100.0 % of the runs have no certificate" in caplog.text
    assert (ds.probability_low == 0.0).all()
    assert (ds.probability_high == 1.0).all()
    certified = run(config(scene, n=64))
    assert (ds.probability == certified.probability).all()
    assert (certified.probability_numerics == 0.0).all()
    alone = certified.probability_high - certified.probability_low
    assert ds.probability_numerics.values == pytest.approx(1.0 - alone.values)


def test_a_measured_sample_is_drawn_row_by_row(tmp_path: Any) -> None:
    (tmp_path / "runs.csv").write_text("friction.mu_s,friction.mu_k\n0.2,0.19\n0.1,0.09\n")
    given = config(of={"friction.mu_s, friction.mu_k": {"file": "runs.csv"}})
    write(tmp_path / "joint.yaml", given)
    ds = run(tmp_path / "joint.yaml", tmp_path / "joint.nc")
    # With mu_s = 0.1 it slips at 4.9 s, with 0.2 at 9.8 s. A row with the other's mu_k would not be allowed.
    assert ds.probability.sel(word="riding").item() == 0.5
    (tmp_path / "runs.csv").unlink()
    again = run(tmp_path / "joint.nc", tmp_path / "again.nc")
    assert (again.probability == ds.probability).all()


def test_a_ratio_to_an_axis_keeps_its_ratio() -> None:
    of = {"friction.mu_s": {"over": "friction.mu_k", "uniform": [1.0, 1.5]}}
    ds = run(config(of=of, grid={"friction.mu_k": [0.09, 0.12, 0.15]}))
    # It rides if mu_s > 0.1427.
    known = np.clip((1.5 - 0.2 * 7.0 / 9.81 / np.array([0.09, 0.12, 0.15])) / 0.5, 0.0, 1.0)
    assert ds.probability.sel(word="riding").values == pytest.approx(known, abs=0.01)


def test_a_sampled_sweep_that_is_stopped_goes_on_bit_for_bit(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from ringsweep.runs import probabilities

    given = config(grid={"belt.velocity": [0.05, 0.1, 0.2]}, sensitivity=True, survival=[3.0, 5.0])
    whole = run(given, tmp_path / "whole.nc")
    compute, done = probabilities.compute_parts, []

    def fail_later(*args: Any) -> Any:
        done.append(1)
        if len(done) > 2:
            raise RuntimeError("stop")
        return compute(*args)

    monkeypatch.setattr(probabilities, "compute_parts", fail_later)
    monkeypatch.setattr("ringsweep.runs.task_sizes.TaskSizes.max_cells", 1)
    with pytest.raises(RuntimeError):
        run(given, tmp_path / "part.nc")
    assert list((tmp_path / "part.nc.partial").glob("*.npz"))
    monkeypatch.setattr(probabilities, "compute_parts", compute)
    part = run(given, tmp_path / "part.nc", jobs=2)
    for name in whole.data_vars:
        assert_identical(part[name], whole[name])
    ringsweep.verify(tmp_path / "part.nc")
    memory = run(given)
    for name in whole.data_vars:
        assert (memory[name].values == whole[name].values).all()


def test_the_file_does_not_grow_with_the_sample(tmp_path: Any) -> None:
    sizes = []
    for n in (64, 2048):
        run(config(n=n), tmp_path / f"{n}.nc")
        sizes.append((tmp_path / f"{n}.nc").stat().st_size)
    assert sizes[1] <= sizes[0] + 200


def test_runs_that_are_kept_are_those_that_are_counted(tmp_path: Any) -> None:
    given = config(grid={"friction.mu_k": [0.05, 0.1]}, keep=True, sensitivity=True, n=64)
    given["sweep"]["sample"]["of"] = {
        "friction.mu_s": {"over": "friction.mu_k", "uniform": [1.0, 3.0]},
        "body.mass": {"normal": [1.0, "1 %"]},
    }
    ds = run(given, tmp_path / "kept.nc")
    assert ds.first_slip.dims == ("friction_mu_k", "replicate", "sample")
    assert ds.friction_mu_s.dims == ("friction_mu_k", "replicate", "sample")
    own = ds.isel(sample=[k for k in range(32) if k % 4 in (0, 3)])
    riding = ringsweep.words(own.regime) == "riding"
    assert (riding.mean(["replicate", "sample"]) == ds.probability.sel(word="riding")).all()
    slips = ds.friction_mu_s * 9.81 / 0.2 * ds.body_mass
    assert ds.first_slip.values == pytest.approx(slips.where(slips < 7.0).values, nan_ok=True, rel=1e-6)
    ringsweep.verify(tmp_path / "kept.nc")
    again = run(tmp_path / "kept.nc", tmp_path / "again.nc")
    assert (again.regime == ds.regime).all()
    assert main(["info", str(tmp_path / "kept.nc")]) == 0


# Samples that cannot be


def test_a_sample_takes_no_cells_of_another(tmp_path: Any) -> None:
    run(config(n=64), tmp_path / "few.nc")
    with pytest.raises(InputError, match="--reuse: a sampled sweep has no cells"):
        run(config(n=256), tmp_path / "many.nc", reuse=tmp_path / "few.nc")


def test_a_sampled_sweep_cannot_be_refined() -> None:
    with pytest.raises(InputError, match=r"sweep\.refine: cannot stand beside"):
        ringsweep.run(config(grid={"belt.velocity": [0.1, 0.2]}), refine=True)


# Commands and pictures


@pytest.mark.slow
def test_commands_work_on_a_sampled_sweep(tmp_path: Any, capsys: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    grid = {"belt.velocity": {"linspace": [0.08, 0.12, 4]}, "time.span": {"linspace": [6.0, 9.0, 4]}}
    write(tmp_path / "my.yaml", config(grid=grid, n=64, sensitivity=True, survival=[2.0, 6.0, 7.0]))
    assert main(["run", "my.yaml", "--dry-run", "--jobs", "1"]) == 0
    assert "cells: 16 (belt_velocity 4, time_span 4); 192 runs in each" in capsys.readouterr().out
    assert main(["run", "my.yaml", "--jobs", "1"]) == 0
    assert "riding: 0.00% to 100.00%" in capsys.readouterr().out
    write(tmp_path / "one.yaml", config(n=64, sensitivity=True))
    assert main(["run", "one.yaml", "--jobs", "1"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"riding: .*\n    total Sobol index: \S+ \d+% \(\d+% to \d+%\)", out)
    assert "sample: 64 points of each cell: 192 runs, 128 of them for the probabilities; sobol" in out
    assert (tmp_path / "my.png").exists()
    for arguments in (
        ["info", "my.nc"],
        ["verify", "my.nc"],
        ["run", "my.yaml", "--jobs", "1"],
        ["run", "my.nc", "-o", "again.nc", "--jobs", "1"],
        ["map", "my.nc", "--boundaries", "riding", "--tolerance", "1e-3", "-o", "boundary.png"],
        ["map", "my.nc", "--var", "survival", "-o", "survival.png"],
        ["map", "my.nc", "-o", "my.html"],
        ["plot", "my.nc", "-o", "both.png"],
        ["plot", "my.nc", "--sel", "belt.velocity=0.08", "--sel", "time.span=9"],
        ["plot", "my.nc", "--sel", "belt.velocity=0.08", "--sel", "time.span=9", "--kind", "survival", "-o", "s.pdf"],
        ["plot", "my.nc", "--sel", "belt.velocity=0.08", "--sel", "time.span=9", "--kind", "sensitivity"],
    ):
        assert main(arguments) == 0, arguments
    page = (tmp_path / "my.html").read_text(encoding="utf-8")
    assert '"value":"probability"' in page
    assert '"riding"]' in page
    assert '"jammed"]' not in page
    capsys.readouterr()
    for arguments, words in (
        (["map", "one.nc", "-o", "one.html"], "one.nc: a single cell has no map"),
        (["plot", "my.nc", "--kind", "survival"], "has several cells: hold belt_velocity (4), time_span (4)"),
        (["plot", "my.nc", "--kind", "phase"], "--kind phase: is not for a sampled sweep"),
        (["plot", "my.nc", "--word", "riding"], "--kind sensitivity"),
        (["map", "my.nc", "--sel", "word=ridin"], "did you mean riding?"),
        (["run", "my.yaml", "--refine"], "cannot stand beside sweep.sample"),
        (["precision", "my.yaml"], "leave sample out"),
        (["simulate", "my.yaml"], "wrote"),
    ):
        main(arguments)
        captured = capsys.readouterr()
        assert words in captured.err + captured.out, arguments
        assert "Traceback" not in captured.err


def test_the_boundary_at_the_medians_is_that_of_the_closed_form(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from ringsweep.runs.probabilities import nominal
    from ringsweep.runs.sweep import Execution, compute

    ds = run(config(grid={"time.span": [6.0, 7.0, 8.0]}, n=64))
    curves = ringsweep.boundary(compute(nominal(ds), Execution(1, progress=False)), "riding", 1e-5)
    assert curves.time_span.values == pytest.approx([0.15 * 9.81 / 0.2], abs=2e-5)


def test_pictures_show_intervals() -> None:
    ds = run(
        config(
            n=64, sensitivity=True, survival=[6.0, 6.5, 7.0], of=SAMPLE["of"] | {"body.mass": {"uniform": [0.9, 1.1]}}
        )
    )
    from matplotlib.figure import Figure

    bars = probability_panel(ds, Figure().add_subplot())
    shown = [text.get_text() for text in bars.get_yticklabels()]
    assert shown == [word for word in REGIMES if ds.probability.sel(word=word) > 0.0]
    ax = survival_panel(ds, Figure(figsize=(85 / 25.4, 55 / 25.4)).add_subplot())
    assert ax.get_ylabel().replace("\n", " ") == "body still rides"
    hangs = sensitivity_panel(ds, Figure().add_subplot(), word="riding")
    assert [text.get_text() for text in hangs.get_yticklabels()] == ["friction.mu_s", "body.mass"]
    refused("is no regime", sensitivity_panel, ds, Figure().add_subplot(), word="flying")
    refused("single cell", regime_map, ds.sel(word="riding"))


def test_a_table_has_a_row_for_each_cell_and_regime() -> None:
    ds = run(config(grid={"belt.velocity": [0.05, 0.1, 0.2]}, n=64, sensitivity=True, survival=[1.0, 2.0]))
    frame = ds.ringsweep.to_frame()
    assert len(frame) == 3 * len(REGIMES)
    assert frame.groupby("belt_velocity").probability.sum().tolist() == [1.0] * 3


@pytest.mark.slow
def test_friction_laws_and_points_may_be_beside_a_sample() -> None:
    given = config(grid={"friction.law": ["stiction", "coulomb"]}, n=64)
    given["sweep"]["points"] = {"belt.velocity": [0.05, 0.1], "body.mass": [1.0, 1.1]}
    ds = run(given)
    assert ds.probability.dims == ("point", "friction_law", "word")
    alone = run(config(BELT | {"belt": {"velocity": 0.1}, "body": {"mass": 1.1}}, n=64))
    assert (ds.probability.sel(friction_law="stiction")[1].values == alone.probability.values).all()
