"""A page holds the numbers of a sweep, and needs no other file; what it shows is made by the script in the page."""

import base64
import gzip
import html
import json
import re
import sys

import numpy as np
import pytest
import xarray as xr
from refusals import refused

from ringsweep import cli, plots
from ringsweep.errors import InputError
from ringsweep.models.ring.impact.record import OUTCOMES as IMPACT_ONLY
from ringsweep.quantities.variables import OUTCOMES
from ringsweep.storage import netcdf

BELT_ONLY = {
    *("x_end", "velocity_end", "x_min", "x_max", "velocity_max", "slips", "first_slip", "period", "force_max"),
    *("long_run", "lyapunov", "deflection_end", "started_from"),
    *(f"multiplier{angle}_{k}" for angle in ("", "_angle") for k in (1, 2)),
}


@pytest.fixture
def bokeh():
    """Tests that write a page need Bokeh; without it the other pictures must work."""
    return pytest.importorskip("bokeh")


def sweep(*sizes, points=False):
    """A sweep of a ring with invented numbers."""
    rng = np.random.default_rng(7)
    dims = ("point",) if points else ("drive_amplitude", "zone_half_angle", "initial_omega", "gravity")[: len(sizes)]
    units = ("rad s-1", "rad", "rad s-1", "m s-2")
    coords = {}
    for k, name in enumerate(("drive_amplitude", "zone_half_angle") if points else dims):
        values = rng.random(sizes[0]) if points else np.arange(1.0, sizes[k] + 1.0)
        attrs = {"units": units[k], "long_name": f"long name of {name}", "path": name.replace("_", ".", 1)}
        coords[name] = ("point" if points else name, values, attrs)
    numbers = {}
    for name, variable in OUTCOMES.items():
        if variable.flags is not None:
            values = rng.choice(list(variable.flags)[:3], sizes).astype("int8")
        else:
            values = rng.normal(size=sizes) if variable.dtype.startswith("f") else rng.integers(0, 9, sizes)
        values = np.abs(values) * 1e-9 if name.endswith("_error") else values
        if name.removesuffix("_error") not in BELT_ONLY | {"origin", "level", "stiffness", *IMPACT_ONLY}:
            numbers[name] = (dims, values.astype(variable.dtype), variable.attributes)
    return xr.Dataset(numbers, coords, {"title": "a sweep of <b>chance</b>"})


def page_of(ds, folder, **options):
    plots.save_page(ds, folder / "page.html", **options)
    return (folder / "page.html").read_text(encoding="utf-8")


def models(page, kind):
    """Models of a kind in the document of a page."""
    text = re.search(r'<script type="application/json"[^>]*>(.*?)</script>', page, re.S)[1]
    found = []

    def visit(node):
        if isinstance(node, dict):
            if node.get("name") == kind and "attributes" in node:
                found.append(node["attributes"])
            for child in node.values():
                visit(child)
        elif isinstance(node, list):
            for child in node:
                visit(child)

    visit(json.loads(html.unescape(text)))
    return found


def plain(node):
    """Values of a node of the document."""
    if isinstance(node, dict) and node.get("type") == "map":
        return {plain(key): plain(value) for key, value in node["entries"]}
    if isinstance(node, dict) and node.get("type") == "ndarray":
        raw = gzip.decompress(base64.b64decode(node["array"]["data"]))
        return np.frombuffer(raw, node["dtype"]).reshape(node["shape"])
    if isinstance(node, dict) and node.get("type") == "number":
        return float(node["value"])
    return [plain(one) for one in node] if isinstance(node, list) else node


def script(page):
    """What the script of a page works with."""
    (found,) = (one for one in models(page, "CustomJS") if "cells" in str(one["args"]))
    args = dict(found["args"]["entries"]) if "entries" in found["args"] else found["args"]
    names = ("cells", "variables", "coordinates", "columns", "rows", "size", "edges")
    values = {name: plain(args[name]) for name in names}
    for name, packed in values["cells"].items():
        if packed.dtype == np.uint8:
            unsigned = np.tensordot([1, 256, 65536], packed, 1)
            steps = np.where(unsigned % 2 == 1, -(unsigned + 1) // 2, unsigned // 2)
            values["cells"][name] = (np.cumsum(steps) << 9).astype(np.int32).view(np.float32)
    pixels = np.add.outer(values["rows"], values["columns"]).ravel()
    return values | {"pixels": pixels}


@pytest.mark.slow
def test_page_loads_nothing_from_elsewhere(bokeh, tmp_path):
    page = page_of(sweep(4, 3), tmp_path)
    around = re.sub(r"(<script[^>]*>).*?</script>", r"\1", page, flags=re.S)
    assert not re.findall(r"\bsrc\b|\bhref\b|https?:", around)
    assert "<b>chance" not in page


def test_page_holds_numbers_with_four_digits_and_no_bound_is_rounded_down(bokeh, tmp_path):
    ds = sweep(5, 4)
    ds["t_separation"][2, 1] = np.nan
    cells = script(page_of(ds, tmp_path))["cells"]
    assert set(cells) == set(ds.data_vars)
    for name in ds.data_vars:
        # Angles are shown in degrees.
        numbers = np.degrees(ds[name].T.values.ravel()) if ds[name].units == "rad" else ds[name].T.values.ravel()
        if name.endswith("_error"):
            assert (cells[name] >= numbers * (1 - 1e-7)).all(), name
            np.testing.assert_allclose(cells[name], numbers, rtol=0.01)
        elif "flag_values" not in ds[name].attrs:
            np.testing.assert_allclose(cells[name], numbers, rtol=5e-5)


@pytest.mark.slow
def test_classes_of_a_page_are_those_that_occur(bokeh, tmp_path):
    ds = sweep(5, 4)
    ds["regime"][:] = 3
    ds["regime"][1, 2] = 5
    ds["certified"][:] = 1
    ds["certified"][0, 0] = -1
    found = script(page_of(ds, tmp_path))
    assert found["variables"]["regime"]["words"] == ["separating", "failed"]
    assert found["variables"]["certified"]["words"] == ["certified"]
    np.testing.assert_array_equal(found["cells"]["regime"], ds["regime"].T.values.ravel() == 5)
    np.testing.assert_array_equal(found["cells"]["certified"], np.where(ds["certified"].T.values.ravel() == 1, 0, -1))


def test_slices_of_a_page_are_the_values_of_further_dimensions(bokeh, tmp_path):
    ds = sweep(5, 4, 3, 2)
    page = page_of(ds, tmp_path, x="gravity")
    variable, *slices = models(page, "Select")
    assert variable["value"] == "regime"
    assert [len(chooser["options"]) for chooser in slices] == [4, 3]
    assert slices[1]["options"][2] == ["2", "long name of initial_omega = 3 rad s⁻¹"]
    found = script(page)
    # Further dimensions first, then up, then across.
    values = ds["turns"].transpose("zone_half_angle", "initial_omega", "drive_amplitude", "gravity").values
    np.testing.assert_array_equal(found["cells"]["turns"], values.ravel())
    assert found["size"] == 10


def test_coordinates_of_a_cell_are_found_by_strides(bokeh, tmp_path):
    ds = sweep(5, 4, 3)
    found = script(page_of(ds, tmp_path))
    order = ds["turns"].transpose("initial_omega", "zone_half_angle", "drive_amplitude")
    for number, index in enumerate(np.ndindex(order.shape)):
        here = ds.isel(dict(zip(order.dims, index, strict=True)))
        for coordinate, (name, value) in zip(found["coordinates"], here.coords.items(), strict=True):
            ((stride, size),) = coordinate["along"]
            text = coordinate["texts"][number // stride % size]
            assert f"= {float(np.degrees(value) if 'angle' in name else value):.4g}" in text


def test_cells_on_an_uneven_axis_have_pixels_in_proportion_to_their_width(bokeh, tmp_path):
    ds = sweep(3, 2).assign_coords(drive_amplitude=("drive_amplitude", [9.0, 0.0, 1.0]))
    found = script(page_of(ds, tmp_path))
    assert found["edges"][0].tolist() == [0.0, 0.5, 5.0, 13.0]
    assert np.bincount(found["pixels"]).tolist() == [38, 347, 615] * 2
    np.testing.assert_array_equal(found["cells"]["turns"], ds["turns"].T.values[:, [1, 2, 0]].ravel())


@pytest.mark.parametrize("ds", [sweep(30, points=True), sweep(6)], ids=["points", "one axis"])
def test_page_of_points_and_of_one_axis_has_each_cell_once(bokeh, tmp_path, ds):
    found = script(page_of(ds, tmp_path, var="phi_max"))
    np.testing.assert_array_equal(found["pixels"], np.arange(len(ds["phi_max"])))
    np.testing.assert_allclose(found["cells"]["phi_max"], np.degrees(ds["phi_max"].values), rtol=5e-5)


def rare(ds, *cells):
    """The sweep with oscillatory cells, but for one revolving cell at each of these places."""
    ds["regime"][:] = 0
    for cell in cells:
        ds["regime"][cell] = 1
    return ds


def test_thinned_page_says_so_with_shares_of_the_file(bokeh, tmp_path):
    ds = rare(sweep(1026, 3)[["regime"]], (700, 1))
    geometric = "drive_amplitude", np.geomspace(0.1, 10.0, 1026), ds["drive_amplitude"].attrs
    page = page_of(ds.assign_coords(drive_amplitude=geometric), tmp_path)
    assert "1 cell in 3 shown" in page
    assert len(models(page, "LogTicker")) == 1
    found = script(page)
    about, words = found["variables"]["regime"], ds["regime"].attrs["flag_meanings"].split()
    assert (found["size"], about["words"]) == (342 * 3, words[:2])
    np.testing.assert_allclose(np.ravel(about["shares"]), [1 - 1 / 3078, 1 / 3078], rtol=1e-12)


def test_shares_of_a_page_are_those_of_each_slice(bokeh, tmp_path):
    ds = rare(sweep(6, 4, 2)[["regime"]], (1, 2, 1), (3, 2, 1))
    shares = script(page_of(ds, tmp_path))["variables"]["regime"]["shares"]
    np.testing.assert_allclose(shares, [[1.0, 22 / 24], [0.0, 2 / 24]])


def test_page_needs_bokeh_and_fewer_than_a_million_cells(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "bokeh", None)
    refused(r"pip install bokeh\); \.png", plots.save_page, sweep(2, 2), tmp_path / "page.html")
    assert not list(tmp_path.iterdir())
    monkeypatch.undo()
    pytest.importorskip("bokeh")
    regime = xr.DataArray(np.zeros((200, 200, 30), dtype="int8"), dims=("a", "b", "c"))
    with pytest.raises(InputError, match=r"a \(200\).*hold some of these: --sel"):
        plots.save_page(xr.Dataset({"regime": regime}), tmp_path / "page.html")


def test_map_writes_a_page_and_refuses_boundaries_in_it(bokeh, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    netcdf.save(sweep(4, 3).assign_attrs(Conventions="CF-1.11", ringsweep_version="0"), "my.nc")
    assert cli.main(["map", "my.nc", "-o", "my.html", "--var", "phi_max"]) == 0
    assert "wrote my.html" in capsys.readouterr().out
    assert models((tmp_path / "my.html").read_text(encoding="utf-8"), "Select")[0]["value"] == "phi_max"
    assert cli.main(["map", "my.nc", "-o", "my.html", "--boundaries", "separating"]) == 2
    assert "not for a page" in capsys.readouterr().err
