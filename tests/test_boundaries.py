"""Boundaries of a map as curves, and their uncertainty exponent."""

import re

import numpy as np
import pytest
import xarray as xr
from refusals import refused

import ringsweep
from ringsweep import cli, plots
from ringsweep.errors import InputError
from ringsweep.quantities.variables import INFERRED
from ringsweep.runs import boundaries
from ringsweep.storage import netcdf

AXES = {"drive.amplitude": np.geomspace(0.5, 8.0, 17), "zone.half_angle": np.radians(np.linspace(5.0, 40.0, 13))}


@pytest.fixture(scope="module")
def ds(scene):
    return ringsweep.sweep(scene, AXES, refine={"stride": 4, "audit": 0.0}, progress=False)


@pytest.fixture(scope="module")
def curves(ds):
    return ringsweep.boundary(ds, "separating", 1e-4)


class TestBoundary:
    @pytest.mark.slow
    def test_regime_changes_within_the_stated_error(self, scene, ds, curves):
        assert curves.sizes["vertex"] > 10
        assert (curves.error <= 1e-4).all()
        flag = ds.regime.attrs["flag_meanings"].split().index("separating")
        for k in range(0, curves.sizes["vertex"], 5):
            one = curves.isel(vertex=k)
            name = curves.axis.attrs["flag_meanings"].split()[int(one.axis)]
            found = []
            for sign in (-1.0, 1.0):
                at = {path: [float(one[path.replace(".", "_")])] for path in AXES}
                at[name.replace("_", ".", 1)][0] += sign * float(one.error) * (1 + 1e-9)
                found.append(ringsweep.sweep(scene, at, progress=False).regime.item())
            assert (found[0] == flag) != (found[1] == flag)
            assert int(one.beyond) in found

    def test_every_edge_between_the_regimes_is_on_one_curve(self, ds, curves):
        separating = ds.regime.values == ds.regime.attrs["flag_meanings"].split().index("separating")
        edges = (separating[1:] != separating[:-1]).sum() + (separating[:, 1:] != separating[:, :-1]).sum()
        assert curves.sizes["vertex"] == edges
        assert (np.diff(curves.line) >= 0).all()
        # Neighbours along a curve lie in one square of four cells.
        rows = np.interp(curves.drive_amplitude, ds.drive_amplitude, np.arange(17))
        columns = np.interp(curves.zone_half_angle, ds.zone_half_angle, np.arange(13))
        together = np.diff(curves.line) == 0
        assert (np.abs(np.diff(rows))[together] <= 1.0 + 1e-9).all()
        assert (np.abs(np.diff(columns))[together] <= 1.0 + 1e-9).all()

    def test_line_of_cells_has_points_in_place_of_curves(self, ds):
        one = ringsweep.boundary(ds.isel(zone_half_angle=4), "separating", 1e-6)
        assert one.sizes["vertex"] >= 1
        assert (one.error <= 1e-6).all()
        assert (one.zone_half_angle == ds.zone_half_angle[4]).all()

    def test_cell_that_is_not_certified_never_pins_a_boundary(self, ds, curves):
        beside = ds.copy(deep=True)
        beside["certified"][:, 4] = 0
        fewer = ringsweep.boundary(beside, "separating", 1e-1)
        assert 0 < fewer.sizes["vertex"] < curves.sizes["vertex"]
        assert not np.isclose(fewer.zone_half_angle[fewer.axis == 0], ds.zone_half_angle[4].item()).any()

    def test_run_that_is_not_certified_leaves_the_place_uncertain(self, ds, monkeypatch, caplog):
        run = boundaries.run_points

        def uncertified(*arguments):
            found = run(*arguments)
            return found.assign(certified=found.certified * 0)

        monkeypatch.setattr(boundaries, "run_points", uncertified)
        found = ringsweep.boundary(ds, "separating", 1e-4)
        assert (found.error > 1e-4).all()
        assert "not certified" in caplog.text

    def test_axis_along_which_two_numbers_vary_is_refused(self, ds):
        """A run halfway between two cells would have the one number from there, and the other from a cell."""
        dim = str(ds["regime"].dims[0])
        both = ds.assign_coords(another=(dim, ds[dim].values, {"path": "gravity", "units": "m s-2"}))
        refused(f"another varies along {dim}", ringsweep.boundary, both, "separating", 1e-3)

    @pytest.mark.parametrize(
        ("change", "problem"),
        [
            (lambda ds: ds.isel(zone_half_angle=4, drop=True), "no coordinate for zone.half_angle"),
            (lambda ds: ds.assign_coords(zone_half_angle=np.degrees(ds.zone_half_angle)), "which its sweep has not"),
            (lambda ds: ds.assign(regime=ds.regime[:, ::-1].variable), "other regimes than runs of its configuration"),
        ],
        ids=["dropped", "other units", "other scene"],
    )
    def test_dataset_whose_cells_are_not_those_of_its_configuration_is_refused(self, ds, change, problem):
        changed = change(ds)
        if "zone_half_angle" in changed.coords:
            changed["zone_half_angle"].attrs = ds["zone_half_angle"].attrs
        refused(problem, ringsweep.boundary, changed, "separating")

    def test_regime_without_cells_has_no_curve_and_a_warning(self, ds, tmp_path, capsys, caplog):
        netcdf.save(ds, tmp_path / "my.nc")
        assert cli.main(["map", str(tmp_path / "my.nc"), "--boundaries", "jammed"]) == 0
        assert "no boundary of jammed" in capsys.readouterr().err + caplog.text
        assert cli.main(["info", str(tmp_path / "my-jammed.nc")]) == 0
        assert "boundary of jammed: 0 curves, 0 points" in capsys.readouterr().out

    @pytest.mark.parametrize(
        ("options", "problem"),
        [(("--x", "x"), "'x'"), (("--var", "nonsense"), "nonsense"), (("-o", "no/where.png"), "does not exist")],
    )
    def test_what_cannot_be_drawn_is_told_before_a_boundary_is_located(
        self, ds, tmp_path, monkeypatch, capsys, options, problem
    ):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(boundaries, "boundary", lambda *_: pytest.fail("the boundary was located"))
        netcdf.save(ds, "my.nc")
        assert cli.main(["map", "my.nc", "--boundaries", "separating", *options]) == 2
        assert problem in capsys.readouterr().err
        assert [path.name for path in tmp_path.iterdir()] == ["my.nc"]

    def test_boundary_does_not_replace_a_sweep(self, ds, tmp_path, monkeypatch, capsys):
        monkeypatch.chdir(tmp_path)
        for name in ("my.nc", "my-separating.nc"):
            netcdf.save(ds, name)
        assert cli.main(["map", "my.nc", "--boundaries", "separating"]) == 2
        assert "my-separating.nc: holds a result of another kind" in capsys.readouterr().err

    @pytest.mark.parametrize(
        ("regime", "tolerance", "problem"),
        [
            ("seperating", 1e-3, r"regime: .*not a regime; did you mean `separating`\?"),
            ("stick-slip", 1e-3, "regime: 'stick-slip' is not a regime of this scene .*known: resting, .*, failed"),
            ("separating", 0.0, "tolerance: "),
            ("separating", True, "tolerance: "),
            ("separating", "narrow", "tolerance: "),
        ],
    )
    def test_mistake_is_refused(self, ds, regime, tolerance, problem):
        refused(problem, ringsweep.boundary, ds, regime, tolerance)

    @pytest.mark.slow
    def test_curves_are_drawn_over_the_map_and_written(self, ds, curves, tmp_path, capsys):
        figure = plots.regime_map(ds, boundaries=curves)
        lines = figure.axes[0].lines
        drawn = np.concatenate([line.get_xydata() for line in lines])
        points = np.column_stack([curves.drive_amplitude, np.degrees(curves.zone_half_angle)])
        assert {tuple(point) for point in np.round(points, 9)} <= {tuple(point) for point in np.round(drawn, 9)}
        legend = " ".join(text.get_text() for text in figure.axes[0].get_legend().get_texts())
        assert "boundary of separating" in legend
        # The error is told in the units of the axes: the same number of radians is a greater number of degrees.
        tolerance = curves.attrs["boundary_tolerance"]
        told = {unit: float(number) for number, unit in re.findall(r"([\d.]+) ?(rad s|°)", legend)}
        assert told["°"] == pytest.approx(np.degrees(tolerance), rel=0.05)
        assert told["rad s"] == pytest.approx(tolerance, rel=0.05)
        netcdf.save(ds, tmp_path / "my.nc")
        assert cli.main(["map", str(tmp_path / "my.nc"), "--boundaries", "separating", "--tolerance", "1e-2"]) == 0
        assert {path.name for path in tmp_path.iterdir()} == {"my.nc", "my-separating.nc", "my-separating.png"}
        written = netcdf.load(tmp_path / "my-separating.nc")
        assert written.sizes == curves.sizes
        assert cli.main(["info", str(tmp_path / "my-separating.nc")]) == 0
        assert "boundary of separating: " in capsys.readouterr().out
        assert cli.main(["map", str(tmp_path / "my.nc"), "--tolerance", "1e-2"]) == 2


class TestDrawnCurves:
    """Cells of 1 by 1 with a boundary at the edges of those inside; columns are `drive_amplitude`."""

    def drawn(self, inside, *points):
        rows, columns = inside.shape
        places = {"drive_amplitude": np.arange(1.0, columns + 1), "mass": np.arange(1.0, rows + 1)}
        regime = xr.DataArray(inside.astype("int8"), places, ("mass", "drive_amplitude"))
        regime.attrs = {"flag_values": np.array([0, 1], "int8"), "flag_meanings": "oscillatory revolving"}
        ds = xr.Dataset({"regime": regime})
        x, y, axis = zip(*points, strict=True)
        about = {"flag_values": np.array([0, 1], "int8"), "flag_meanings": "mass drive_amplitude"}
        curves = xr.Dataset(
            {"line": ("vertex", [0] * len(x)), "axis": ("vertex", list(axis), about)},
            {"drive_amplitude": ("vertex", list(x)), "mass": ("vertex", list(y))},
            {"boundary_of": "revolving", "boundary_tolerance": 1e-6},
        )
        (line,) = plots.regime_map(ds, boundaries=curves, x="drive_amplitude", y="mass").axes[0].lines
        return line.get_xydata().tolist()

    @pytest.mark.parametrize(
        ("side", "cells", "points", "ends"),
        [
            # Around an island; out of the map, up to its frame; open where cells without a certificate interrupt it.
            (5, np.s_[2, 2], [(3.0, 2.4, 0), (2.4, 3.0, 1), (3.0, 3.6, 0), (3.6, 3.0, 1)], [[3.0, 2.4]] * 2),
            (5, np.s_[:2, 2], [(2.4, 1.0, 1), (2.4, 2.0, 1), (3.0, 2.6, 0), (3.6, 2.0, 1), (3.6, 1.0, 1)],
             [[2.4, 0.5], [3.6, 0.5]]),
            (7, np.s_[2:5, 2:5], [(3.0, 2.5, 0), (4.0, 2.5, 0), (5.0, 2.5, 0), (5.5, 3.0, 1), (5.5, 4.0, 1)],
             [[3.0, 2.5], [5.5, 4.0]]),
        ],
    )  # fmt: skip
    def test_curve_is_closed_or_ends_at_the_frame_or_where_it_is_unknown(self, side, cells, points, ends):
        inside = np.zeros((side, side), dtype=bool)
        inside[cells] = True
        drawn = self.drawn(inside, *points)
        assert [drawn[0], drawn[-1]] == ends
        assert set(map(tuple, drawn)) == {point[:2] for point in points} | set(map(tuple, ends))


class TestValueThatTheMapLacks:
    """The map has cells at 13.75 and at 16.67 deg."""

    ASKED = ("--sel", "zone.half_angle=15 deg", "--boundaries", "separating", "--tolerance", "1e-9")

    @pytest.fixture
    def folder(self, ds, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        netcdf.save(ds, "my.nc")
        return netcdf

    @pytest.mark.slow
    def test_boundary_is_that_at_the_value_asked_for(self, folder, scene, caplog):
        assert cli.main(["map", "my.nc", *self.ASKED]) == 0
        assert "zone.half_angle: 15° is not in the dataset: the cells there are run" in caplog.messages
        found = folder.load("my-zone-half_angle-15deg-separating.nc")
        assert found.sizes["vertex"] >= 1
        assert (found.error <= 1e-9).all()
        np.testing.assert_allclose(found.zone_half_angle, np.radians(15.0), rtol=1e-15)
        at = scene | {"zone": {"half_angle": "15 deg"}}
        for place in found.drive_amplitude.values:
            sides = ringsweep.sweep(at, {"drive.amplitude": [place - 1.1e-9, place + 1.1e-9]}, progress=False)
            assert (sides.certified == 1).all()
            assert (sides.ringsweep.words() == "separating").sum() == 1

    def test_map_below_the_curves_is_that_at_the_value_asked_for(self, folder, monkeypatch):
        drawn = []
        monkeypatch.setattr(plots, "save", lambda figure, path: drawn.append(figure))
        assert cli.main(["map", "my.nc", *self.ASKED]) == 0
        assert "half-angle of the zone = 15°" in drawn[0].axes[0].get_title()
        assert "nearest" not in drawn[0].axes[0].get_title()

    def test_value_outside_the_axis_is_refused(self, folder, capsys):
        assert cli.main(["map", "my.nc", "--sel", "zone.half_angle=42 deg", *self.ASKED[2:]]) == 2
        assert "half-angle of the zone must be" in capsys.readouterr().err

    def test_value_that_a_run_cannot_have_alone_is_refused(self, ds, folder, capsys):
        paired = ds.assign_coords(another=("zone_half_angle", np.arange(13.0), {"path": "gravity", "units": "m s-2"}))
        folder.save(paired, "my.nc")
        assert cli.main(["map", "my.nc", *self.ASKED]) == 2
        assert "zone_half_angle is no axis of one number: give 13.75°" in capsys.readouterr().err

    def test_line_of_a_refined_map_of_which_no_cell_was_run_is_run(self, ds):
        line = ds.isel(zone_half_angle=3)
        inferred = line.assign(origin=line.origin * 0 + INFERRED, certified=line.certified * np.nan)
        assert ringsweep.boundary(inferred, "separating").sizes["vertex"] == 0
        there = boundaries.run_at(inferred, {"zone_half_angle": np.radians(15.0)}, "separating")
        assert ringsweep.boundary(there, "separating", 1e-3).sizes["vertex"] >= 1

    def test_curves_are_not_drawn_over_another_slice(self, ds):
        curves = ringsweep.boundary(ds.isel(zone_half_angle=4), "separating", 1e-3)
        with pytest.raises(InputError, match=r"another map: this one has half-angle of the zone = 13\.75°"):
            plots.regime_map(ds, sel={"zone.half_angle": "15 deg"}, boundaries=curves)
