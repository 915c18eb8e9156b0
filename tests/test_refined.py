"""Refined sweeps: files, resumption, reuse and curves, against the full grid."""

import json

import numpy as np
import pytest
import xarray as xr
import yaml
from refusals import refused

import ringsweep
from benchmarks.hostile.attack import same_bits
from ringsweep import cli, plots
from ringsweep.quantities.variables import AUDITED, INFERRED, LABELS
from ringsweep.runs import sweep
from ringsweep.storage import netcdf
from ringsweep.storage.checkpoint import Checkpoint

AXES = {"drive.amplitude": np.geomspace(0.5, 8.0, 41), "zone.half_angle": np.radians(np.linspace(5.0, 40.0, 37))}
REFINE = {"stride": 8, "audit": 0.05}


@pytest.fixture(scope="module")
def config(scene, tmp_path_factory):
    """Configuration file of a refined sweep."""
    grid = {path: values.tolist() for path, values in AXES.items()}
    path = tmp_path_factory.mktemp("refined") / "sweep.yaml"
    path.write_text(yaml.safe_dump({"scene": scene, "sweep": {"grid": grid, "refine": REFINE}}))
    return path


@pytest.fixture(scope="module")
def full(scene, config):
    """File of the full grid."""
    path = config.with_name("full.nc")
    ringsweep.sweep(scene, AXES, path, progress=False).close()
    return path


@pytest.fixture(scope="module")
def refined(config):
    """File of the refined sweep."""
    path = config.with_name("refined.nc")
    ringsweep.run(config, path, progress=False).close()
    return path


@pytest.fixture
def ds(refined):
    return netcdf.load(refined)


@pytest.fixture
def stored(monkeypatch):
    """Positions of the cells that are stored."""
    cells = []
    put = Checkpoint.put
    monkeypatch.setattr(Checkpoint, "put", lambda self, p, *rest: (cells.extend(p), put(self, p, *rest)))
    return cells


class TestFile:
    def test_inferred_labels_differ_from_the_full_grid_within_the_bound(self, ds, full):
        wrong = np.zeros(ds.regime.shape, dtype=bool)
        with xr.open_dataset(full, decode_times=False) as whole:
            for name in set(LABELS) & set(ds.data_vars):
                assert ds[name].dtype == np.int8
                wrong |= ds[name].values != whole[name].values
        assert wrong.sum() <= ds.attrs["audit_bound"] * (ds.origin == INFERRED).sum()
        assert wrong.mean() < 0.005

    def test_numbers_and_certificates_are_missing_where_a_cell_is_inferred(self, ds):
        inferred = ds.origin.values == INFERRED
        others = set(ds.data_vars) - {*LABELS, "origin", "level"}
        assert {"t_end", "steps", "reversals", "certified", "t_end_error"} <= others
        for name in others:
            assert np.isnan(ds[name].values[inferred]).all(), name
        assert (ds.certified.values[~inferred] == 1).all()

    def test_origin_and_level_have_flags_and_the_audit_is_in_the_attributes(self, ds):
        assert ds.origin.dtype == ds.level.dtype == np.int8
        assert ds.origin.attrs["flag_meanings"] == "computed inferred audited"
        assert ds.attrs["audit_cells"] == (ds.origin == AUDITED).sum() > 0
        assert ds.attrs["cells_computed"] == (ds.origin != INFERRED).sum()
        assert ds.attrs["audit_corrected"] >= ds.attrs["audit_wrong_before"]
        assert 0.0 < ds.attrs["audit_bound"] < 0.2
        assert "at 95 % confidence" in ds.attrs["audit"]

    def test_info_and_map_tell_the_audit(self, refined, ds, capsys, tmp_path):
        assert cli.main(["info", str(refined)]) == 0
        out = capsys.readouterr().out
        assert ds.attrs["audit"] in out
        assert f"certified: 100.0% of the {np.count_nonzero(ds.origin != INFERRED)} cells run" in out
        title = plots.regime_map(ds).axes[0].get_title().replace("\n", " ")
        assert "of the cells run" in title
        assert "95 % confidence" in title
        # What is known of the whole is not known of a part.
        part = plots.regime_map(ds.isel(drive_amplitude=slice(3, None)))
        assert "confidence" not in part.axes[0].get_title()
        assert cli.main(["map", str(refined), "--var", "origin", "-o", str(tmp_path / "origin.png")]) == 0


@pytest.mark.slow
class TestContinuation:
    def test_stopped_sweep_computes_no_cell_twice(self, config, refined, tmp_path, monkeypatch, stored):
        monkeypatch.setattr(sweep, "_WRITE_INTERVAL", 0.0)
        put, calls = Checkpoint.put, iter(range(5))

        def stop(*arguments):
            if next(calls, None) is None:
                raise KeyboardInterrupt
            put(*arguments)

        with monkeypatch.context() as patch:
            patch.setattr(Checkpoint, "put", stop)
            with pytest.raises(KeyboardInterrupt):
                ringsweep.run(config, tmp_path / "out.nc", progress=False)
        before = len(stored)
        ringsweep.run(config, tmp_path / "out.nc", progress=False).close()
        assert 0 < before < len(stored)
        assert len(set(stored)) == len(stored)
        assert same_bits(tmp_path / "out.nc", refined)

    def test_refined_sweep_is_not_replaced_by_one_of_the_full_grid(self, config, refined, tmp_path):
        target = tmp_path / "out.nc"
        target.write_bytes(refined.read_bytes())
        assert cli.main(["run", str(config), "-o", str(target)]) == 0
        given = yaml.safe_load(config.read_text())
        del given["sweep"]["refine"]
        refused(r"sweep\.refine\.stride was 8, is absent", ringsweep.run, given, target, progress=False)


class TestReuse:
    def test_file_of_the_full_grid_is_not_replaced_by_its_own_refinement(self, full, tmp_path, monkeypatch, capsys):
        monkeypatch.chdir(tmp_path)
        target = tmp_path / "full.nc"
        target.write_bytes(full.read_bytes())
        for output in ([], ["-o", f"../{tmp_path.name}/full.nc"]):
            assert cli.main(["run", "full.nc", "--refine", *output]) == 2
            assert "full.nc: holds another sweep: sweep.refine.axes was absent" in capsys.readouterr().err
            assert target.read_bytes() == full.read_bytes()

    @pytest.mark.parametrize("source", ["refined", "full"])
    def test_full_and_refined_sweeps_take_cells_of_each_other(
        self, scene, source, refined, full, tmp_path, caplog, request
    ):
        options = {} if source == "refined" else {"refine": REFINE}
        other = full if source == "refined" else refined
        with caplog.at_level("INFO", logger="ringsweep"):
            ringsweep.sweep(
                scene, AXES, tmp_path / "new.nc", reuse=request.getfixturevalue(source), progress=False, **options
            ).close()
        assert same_bits(tmp_path / "new.nc", other)
        with xr.open_dataset(refined, decode_times=False) as ds:
            run = int((ds.origin != INFERRED).sum())
        assert f"{run} of {41 * 37} cells are taken from" in caplog.text


class TestConfiguration:
    def test_points_and_shared_dimensions_are_refused(self, scene):
        points = {"points": {"drive.amplitude": [1.0, 2.0]}, "grid": {"zone.half_angle": [0.1, 0.2]}, "refine": True}
        refused("only a grid can be refined", ringsweep.run, {"scene": scene, "sweep": points})
        shared = {"drive.amplitude": xr.DataArray([1.0, 2.0], dims="rig"), "zone.half_angle": [0.1, 0.2]}
        refused("only a grid can be refined", ringsweep.sweep, scene, shared, refine=True)
        refused("values go up and down", ringsweep.sweep, scene, {"drive.amplitude": [1.0, 3.0, 2.0]}, refine=True)
        refused("nothing can be refined", ringsweep.run, {"scene": scene}, refine=True)

    @pytest.mark.slow
    def test_command_line_option_gives_defaults_and_keeps_what_is_configured(self, config, tmp_path):
        output = tmp_path / "out.nc"
        assert cli.main(["run", str(config), "--refine", "-o", str(output)]) == 0
        with xr.open_dataset(output, decode_times=False) as found:
            assert json.loads(found.attrs["configuration"])["sweep"]["refine"] == REFINE
