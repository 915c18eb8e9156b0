"""Maps, histories and work-precision diagrams show what the dataset holds."""

import json
import os
import re
from concurrent.futures import ThreadPoolExecutor

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from refusals import refused

from ringsweep import plots
from ringsweep.errors import InputError
from ringsweep.quantities.flags import REGIMES
from ringsweep.quantities.variables import HISTORY, OUTCOMES

DRIVE = {"units": "rad s-1", "long_name": "amplitude of the drive"}
ANGLE = {"units": "rad", "long_name": "half-angle of the zone"}
FRICTION = {"units": "1", "long_name": "coefficient of kinetic friction"}


def make_sweep(shape: tuple[int, ...] = (12, 9)) -> xr.Dataset:
    """A sweep with regimes in diagonal bands and no warnings."""
    dims = ("drive_amplitude", "zone_half_angle", "friction_rough_mu_k", "friction_rest_mu_k", "initial_omega")
    values = [np.geomspace(0.1, 10, shape[0]), np.radians(np.linspace(2, 60, shape[1] if len(shape) > 1 else 1))]
    values += [np.linspace(0.1, 0.5, n) for n in shape[2:]]
    attributes = [DRIVE, ANGLE, FRICTION, FRICTION, {"units": "rad s-1"}]
    dims = dims[: len(shape)]
    index = sum(np.indices(shape))
    regime = (index * 5 // (index.max() + 1)).astype("int8")
    return xr.Dataset(
        {
            "regime": (dims, regime, OUTCOMES["regime"].attributes),
            "motion": (dims, np.minimum(regime, 2), OUTCOMES["motion"].attributes),
            "t_separation": (dims, np.where(regime == 3, index, np.nan), OUTCOMES["t_separation"].attributes),
            "certified": (dims, np.ones(shape, "int8"), OUTCOMES["certified"].attributes),
            "stiffness": (dims, np.ones(shape), OUTCOMES["stiffness"].attributes),
        },
        coords={dim: (dim, value, a) for dim, value, a in zip(dims, values, attributes, strict=False)},
    )


def make_points(count: int = 30) -> xr.Dataset:
    grid = make_sweep()
    random = np.random.default_rng(1)
    along = {dim: xr.DataArray(random.integers(0, size, count), dims="point") for dim, size in grid.sizes.items()}
    return grid.isel(along)


def make_history(count: int = 2000, ring: bool = True) -> xr.Dataset:
    t = np.linspace(0, 10, count)
    wave = {name: np.sin(t + k) for k, name in enumerate(HISTORY)}
    wave["mode"] = np.where(t % 3 < 1, 0, 1).astype("int8")
    wave["zone_1"], wave["zone_2"] = (t % 2 < 0.5).astype("int32"), (t % 5 < 0.5).astype("int32") * 2
    # A run without impact has no gaps.
    names = [name for name in HISTORY if not name.startswith("gap")]
    ds = xr.Dataset({name: ("time", wave[name], HISTORY[name].attributes) for name in names})
    ds = ds.assign_coords(time=("time", t, {"units": "s", "long_name": "time"}))
    if not ring:
        units = {"x": "m", "velocity": "m s-1", "friction_force": "N", "deflection": "m"}
        ds = ds[["time", "mode"]].assign({name: ("time", np.sin(t), {"units": unit}) for name, unit in units.items()})
    return ds


def make_work(methods: int = 3, settings: int = 4, cells: int = 5) -> xr.Dataset:
    """Errors of invented methods, which fall as run time grows."""
    k, j, i = np.meshgrid(range(methods), range(settings), range(cells), indexing="ij")
    error = 10.0 ** (-1.0 - 2 * j - 0.1 * k) * (1 + i) ** 2
    return xr.Dataset(
        {
            "time_per_run": ("contender", 10.0 ** (0.3 * j + k - 6)[..., 0].ravel(), {"units": "s"}),
            "error_end": (("contender", "cell"), error.reshape(-1, cells), {"units": "rad", "long_name": "error"}),
        },
        coords={"method": ("contender", [f"method {n}" for n in k[..., 0].ravel()])},
    )


def named_sweep(shape: tuple[int, ...] = (12, 9)) -> xr.Dataset:
    """A sweep with the long names of a true one, and what its file says of its runs."""
    ds = make_sweep(shape).assign_attrs(configuration=json.dumps({"scene": {"time": {"span": "10 s"}}}))
    ds["drive_amplitude"].attrs["long_name"] = "2/π of the ring's final angular velocity"
    ds["regime"] = ds["regime"].clip(max=3)
    return ds


def refined_sweep() -> xr.Dataset:
    ds = named_sweep().assign_attrs(audit_bound=0.068, audit_cells=100, cells_computed=36)
    origin = np.arange(ds["regime"].size).reshape(ds["regime"].shape) % 3 == 0
    return ds.assign(origin=(ds["regime"].dims, origin.astype("int8"), OUTCOMES["origin"].attributes))


def separated() -> xr.Dataset:
    """A history that contact 2 ends."""
    ds = make_history()
    ds["normal_2"][:] = np.linspace(1.0, 0.0, ds.sizes["time"])
    scalars = {"regime": REGIMES.index("separating"), "separating_contact": 2, "t_separation": 10.0}
    outcome = "separating (oscillatory), contact 2, t = 10.0000 s"
    return ds.assign({name: ((), value) for name, value in scalars.items()}).assign_attrs(outcome=outcome)


@pytest.fixture(autouse=True)
def usual_style():
    yield
    plots.style()


def panel() -> Axes:
    return Figure(layout="constrained").add_subplot()


def texts_drawn(figure: Figure) -> list[Text]:
    """Texts that a reader sees; ticks outside the limits of their axis are not drawn."""
    figure.draw_without_rendering()
    hidden = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            slack = 1e-9 * (low if axis.get_scale() == "log" else high - low)
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                if not low - slack <= tick.get_loc() <= high + slack:
                    hidden |= {tick.label1, tick.label2}
    seen = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]
    return [text for text in seen if text not in hidden]


def assert_readable(figure: Figure) -> None:
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts_drawn(figure)]
    page = figure.bbox
    for k, (text, box) in enumerate(boxes):
        over = max(page.x0 - box.x0, box.x1 - page.x1, page.y0 - box.y0, box.y1 - page.y1)
        assert over < 1, f"{text!r} is cut off"
        for other, place in boxes[k + 1 :]:
            across = min(box.x1, place.x1) - max(box.x0, place.x0)
            assert across <= 1 or min(box.y1, place.y1) - max(box.y0, place.y0) <= 1, f"{text!r} and {other!r} collide"


def mesh(figure: Figure, panel: int = 0) -> QuadMesh:
    return next(artist for artist in figure.axes[panel].collections if isinstance(artist, QuadMesh))


def entries(figure: Figure) -> list[str]:
    return [text.get_text().replace("\n", " ") for legend in legends(figure) for text in legend.get_texts()]


def legends(figure: Figure) -> list:
    return [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]


def title(figure: Figure) -> str:
    return figure.axes[0].get_title().replace("\n", " ")


def drawn_colours(figure: Figure, meaning: str) -> set[tuple[float, ...]]:
    handles = [h for h in legends(figure)[0].get_patches() if h.get_label().startswith(meaning)]
    return {to_rgb(h.get_facecolor()) for h in handles}


def hatched(figure: Figure) -> int:
    """Number of hatched cells in the first panel, white and black hatching together."""
    x, y = mesh(figure).get_coordinates()[0, :, 0], mesh(figure).get_coordinates()[:, 0, 1]
    area = 0
    for patch in figure.axes[0].patches:
        corners = patch.get_path().vertices.reshape(-1, 5, 2)
        width = np.searchsorted(x, corners[:, 1, 0]) - np.searchsorted(x, corners[:, 0, 0])
        assert np.isin(corners[..., 1], y).all()
        area += width.sum()
    return int(area)


def test_regimes_of_one_model_differ_in_greyscale():
    assert plots.REGIME_COLOURS.keys() == set(REGIMES)
    belt = {"stick-slip", "oscillatory", "sliding", "sticking", "riding", "failed"}
    for model in ({"resting", "oscillatory", "revolving", "separating", "jammed", "failed"}, belt):
        shades = sorted(np.dot([0.2126, 0.7152, 0.0722], to_rgb(plots.REGIME_COLOURS[name])) for name in model)
        assert min(np.diff(shades)) > 0.07


def test_cells_of_a_map_tile_the_plane_around_their_values():
    ds = make_sweep()
    corners = mesh(plots.regime_map(ds)).get_coordinates()
    x, y = corners[0, :, 0], corners[:, 0, 1]
    np.testing.assert_allclose(np.sqrt(x[1:] * x[:-1]), ds["drive_amplitude"], rtol=1e-12)
    np.testing.assert_allclose((y[2:] + y[1:-1]) / 2, np.degrees(ds["zone_half_angle"][1:]), rtol=1e-12)
    # An angle of no less than 0 has no cell below.
    assert y[0] == 0.0
    assert len(x) == 13
    assert len(y) == 10


def test_map_shows_each_regime_at_the_coordinates_of_its_cell():
    ds = make_sweep().isel(drive_amplitude=[3, 0, 2, 1])
    drawn = mesh(plots.regime_map(ds)).get_array()
    np.testing.assert_array_equal(drawn, ds["regime"].sortby("drive_amplitude").transpose())
    swapped = mesh(plots.regime_map(ds, x="zone.half_angle", y="drive.amplitude")).get_array()
    np.testing.assert_array_equal(swapped, drawn.T)


def test_map_axis_is_logarithmic_only_for_a_geometric_grid():
    axes = plots.regime_map(make_sweep()).axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")
    for values in ([1, 2], [1, 2, 3], [-1, -2, -4], [0, 1, 10]):
        ds = make_sweep((len(values), 3)).assign_coords(drive_amplitude=np.array(values, float))
        assert plots.regime_map(ds).axes[0].get_xscale() == "linear"


def test_units_of_parameters_look_like_units_of_variables():
    ds, minus = make_sweep(), "$^{-1}$"
    shown = {"rad/s": f"rad s{minus}", "m/s^2": "m s$^{-2}$", "kg m^2": "kg m$^{2}$", "s/m": f"s m{minus}", "kg": "kg"}
    for units, text in shown.items():
        ds["drive_amplitude"].attrs["units"] = units
        assert plots.regime_map(ds).axes[0].get_xlabel() == f"amplitude of the drive ({text})"


def written_sweep(**sweep) -> xr.Dataset:
    """A sweep of the drive and the radius, m, whose configuration is that given."""
    ds = make_sweep((5, 4)).rename(zone_half_angle="ring_radius")
    ds["ring_radius"] = "ring_radius", [0.02, 0.03, 0.04, 0.05], {"units": "m", "long_name": "radius"}
    for name in ("drive_amplitude", "ring_radius"):
        ds[name].attrs["path"] = name.replace("_", ".")
    scene = {"ring": {"radius": "30 mm"}, "drive": {"amplitude": 2.0}}
    return ds.assign_attrs(configuration=json.dumps({"scene": scene, "sweep": {"grid": sweep}}))


@pytest.mark.parametrize(
    ("written", "label", "last"),
    [
        ({"linspace": ["20 mm", "50 mm", 4]}, "radius (mm)", 50.0),
        (["2 cm", "3 cm", "4 cm", "5 cm"], "radius (cm)", 5.0),
        ([0.02, 0.03, 0.04, 0.05], "radius (mm)", 50.0),
        (["20 mm", "3 cm", "4 cm", "5 cm"], "radius (m)", 0.05),
    ],
    ids=["in the sweep", "listed", "in the scene", "in two units"],
)
def test_axis_has_the_unit_of_the_configuration_and_the_file_stays_si(written, label, last):
    ds = written_sweep(**{"ring.radius": written, "drive.amplitude": ["1 rpm", "2 rpm"]})
    before = ds.copy(deep=True)
    ax = plots.regime_map(ds).axes[0]
    assert ax.get_ylabel() == label
    assert ax.get_xlabel() == "amplitude of the drive (rpm)"
    rows = mesh(ax.figure).get_coordinates()[:, 0, 1]
    assert 0.5 * (rows[-1] + rows[-2]) == pytest.approx(last)
    columns = mesh(ax.figure).get_coordinates()[0, :, 0]
    assert np.sqrt(columns[-1] * columns[-2]) == pytest.approx(10.0 * 30.0 / np.pi)
    xr.testing.assert_identical(ds, before)


def test_lengths_of_runs_have_the_unit_of_the_lengths_in_the_scene():
    ds = written_sweep(**{"ring.radius": ["20 mm", "50 mm"], "drive.amplitude": ["1 rpm", "2 rpm"]})
    ds["gap_max"] = xr.full_like(ds["t_separation"], 0.002).assign_attrs(OUTCOMES["gap_max"].attributes)
    ax, bar = plots.regime_map(ds, var="gap_max").axes[:2]
    assert bar.get_ylabel().endswith("(mm)")
    np.testing.assert_allclose(mesh(ax.figure).get_array(), 2.0)


def test_unit_of_the_user_is_that_of_the_axis_and_a_wrong_one_is_refused():
    ds = written_sweep(**{"ring.radius": ["20 mm", "50 mm"]})
    assert plots.regime_map(ds, units={"ring.radius": "cm"}).axes[0].get_ylabel() == "radius (cm)"
    assert plots.regime_map(make_sweep(), units={"zone.half_angle": "rad"}).axes[0].get_ylabel().endswith("(rad)")
    bar = plots.regime_map(ds, var="t_separation", units={"t_separation": "min"}).axes[1]
    assert bar.get_ylabel() == "time of separation (min)"
    for units, told in (({"ring.radius": "kg"}, "wrong unit"), ({"radius": "mm"}, "did you mean ring_radius")):
        refused(told, plots.regime_map, ds, units=units)
    # The user has converted the coordinate.
    ds["ring_radius"].attrs["units"] = "1"
    assert plots.regime_map(ds).axes[0].get_ylabel() == "radius"


def boundary_at(axis: xr.DataArray, place: float) -> xr.Dataset:
    return xr.Dataset(
        {"line": ("vertex", [0])},
        {axis.name: ("vertex", [place], axis.attrs)},
        {"boundary_of": "separating", "boundary_tolerance": 1e-6},
    )


def test_boundary_lies_where_it_is_in_the_unit_of_the_axis():
    ds = written_sweep(**{"ring.radius": ["20 mm", "50 mm"]}).isel(drive_amplitude=0, drop=True)
    figure = plots.regime_map(ds, boundaries=boundary_at(ds["ring_radius"], 0.037))
    assert {float(x) for line in figure.axes[0].lines for x in line.get_xdata()} == {37.0}
    assert "± 0.001 mm" in " ".join(entries(figure))


def test_label_has_the_path_if_two_coordinates_share_a_long_name():
    ds = make_sweep((3, 3, 3, 3))
    figure = plots.regime_map(ds.isel(drive_amplitude=0, zone_half_angle=0))
    assert figure.axes[0].get_xlabel() == "coefficient of kinetic friction, friction_rough_mu_k"


def test_regime_has_the_same_colour_in_every_figure():
    ds = make_sweep()
    few = ds.where(ds["regime"] == 3, drop=True).assign(regime=lambda d: d["regime"].fillna(1))
    few["regime"].attrs = ds["regime"].attrs
    figures = [plots.regime_map(one) for one in (ds, few, make_points())]
    for name, pictures in (("separating", figures), ("oscillatory", [*figures, plots.regime_map(ds, var="motion")])):
        for figure in pictures:
            assert drawn_colours(figure, name) == {to_rgb(plots.REGIME_COLOURS[name])}


def test_title_and_legend_of_a_map_can_be_replaced_and_left_out():
    for draw in (plots.regime_map, lambda ds, **options: plots.map_panel(ds, ax=panel(), **options).figure):
        titles = [title(draw(make_sweep(), **given)) for given in ({}, {"title": "my map"}, {"title": False})]
        assert titles == ["regime of the run", "my map", ""]
        assert not legends(draw(make_sweep(), legend=False))


def test_missing_values_are_grey_and_in_the_legend():
    ds = make_sweep((10, 10))
    figure = plots.regime_map(ds, var="t_separation")
    assert entries(figure) == [f"no separation, {100 * float(ds['t_separation'].isnull().mean()):.1f} %"]
    assert to_rgb(mesh(figure).get_cmap().get_bad()) == to_rgb("#DDDDDD")
    ds["t_separation"][:] = np.nan
    assert entries(plots.regime_map(ds, var="t_separation")) == ["no separation, 100.0 %"]


@pytest.mark.parametrize(("span", "told"), [("10 s", "10 s"), (2.5, "2.5 s"), ("1 min", "1 min")])
def test_missing_time_of_separation_is_told_with_the_span(span, told):
    def entry(ds):
        return entries(plots.regime_map(ds, var="t_separation"))[0]

    ds = make_sweep((10, 10)).assign_attrs(configuration=json.dumps({"scene": {"time": {"span": span}}}))
    ds["regime"] = ds["regime"].clip(max=3)
    assert entry(ds).startswith(f"no separation within {told}, ")
    # Runs of several spans have no common one, and a run that jams or fails does not reach its span.
    swept = ds["drive_amplitude"].assign_attrs(path="time.span")
    assert entry(ds.assign_coords(drive_amplitude=swept)).startswith("no separation, ")
    ds["regime"][0, 0] = REGIMES.index("failed")
    assert entry(ds).startswith("no separation, ")


def test_missing_values_of_inferred_cells_and_bounds_are_told_as_such():
    ds = make_sweep((4, 4))
    ds["origin"] = ds["regime"].dims, np.full((4, 4), 1, "int8"), OUTCOMES["origin"].attributes
    ds = ds.assign(phi_max=ds["t_separation"] * np.nan, phi_max_error=ds["t_separation"])
    assert entries(plots.regime_map(ds, var="phi_max")) == ["inferred, not run, 100.0 %"]
    ds["origin"][:2] = 0
    assert entries(plots.regime_map(ds, var="phi_max")) == ["no value, or inferred, not run, 100.0 %"]
    assert entries(plots.regime_map(ds.drop_vars("origin"), var="phi_max_error"))[0].startswith("no bound, ")


def test_map_without_any_certificate_is_not_hatched_but_says_so():
    ds, points = (one.assign(certified=0 * one["certified"]) for one in (make_sweep((10, 10)), make_points()))
    figure = plots.regime_map(ds)
    assert not figure.axes[0].patches
    assert entries(figure)[-1] == "not certified, 100.0 %"
    off = ds.assign_attrs(solver=json.dumps({"method": "implicit", "certify": False}))
    assert entries(plots.regime_map(off))[-1] == "no cell is certified: certify is false"
    assert len(plots.regime_map(points).axes[0].collections) == 1


def test_map_hatches_only_cells_that_are_not_certified():
    ds = make_sweep((10, 10))
    ds["certified"][2:5, 3:7] = 0
    ds["certified"][9, 9] = 0
    figure = plots.regime_map(ds)
    assert hatched(figure) == 13
    assert "not certified, 13.0 %" in entries(figure)
    assert not plots.regime_map(ds, var="t_separation").axes[0].patches


def test_cells_beyond_the_stability_limit_have_another_hatch():
    ds = make_sweep((10, 10))
    ds["certified"][:3], ds["stiffness"][:2] = 0, 2.8
    figure = plots.regime_map(ds)
    assert {patch.get_hatch() for patch in figure.axes[0].patches} == {"//////", ".."}
    assert entries(figure)[-2:] == ["not certified, 30.0 %", "step beyond stability limit, 20.0 %"]
    ds["stiffness"][2] = 2.8
    figure = plots.regime_map(ds)
    assert {patch.get_hatch() for patch in figure.axes[0].patches} == {"//////"}
    assert entries(figure)[-1] == "not certified: step beyond stability limit, 30.0 %"


def test_notebook_shows_a_picture_without_the_inline_magic():
    assert plots.history(make_history())._repr_png_().startswith(b"\x89PNG")


def test_pyplot_shows_a_whole_figure_where_it_opens_windows():
    from matplotlib import pyplot

    def shown(backend, call=lambda function: function()):
        pyplot.switch_backend(backend)
        figures = call(lambda: [plots.regime_map(make_sweep()), plots.history(make_history())])
        return [figure.canvas.manager is not None for figure in figures]

    before = pyplot.get_backend()
    try:
        assert shown("webagg") == [True, True]
        with ThreadPoolExecutor(1) as threads:
            assert shown("webagg", lambda function: threads.submit(function).result()) == [False, False]
        # These draw files: a figure would only stay in memory.
        assert shown("agg") == [False, False]
    finally:
        pyplot.close("all")
        pyplot.switch_backend(before)


def test_map_axis_may_have_a_single_value():
    for ds in (make_sweep((1, 5)), make_sweep((5, 1)), make_sweep((1, 1))):
        assert mesh(plots.regime_map(ds)).get_array().shape == ds["regime"].transpose().shape
    at_zero = make_sweep((1, 3)).assign_coords(drive_amplitude=[0.0])
    assert np.ptp(mesh(plots.regime_map(at_zero)).get_coordinates()[0, :, 0]) == 1


def test_map_of_one_swept_quantity_is_a_strip_or_a_line():
    ds = make_sweep((12,))
    np.testing.assert_array_equal(mesh(plots.regime_map(ds)).get_array()[0], ds["regime"])
    axes = plots.regime_map(ds, var="t_separation").axes[0]
    np.testing.assert_array_equal(axes.lines[0].get_xydata()[:, 1], ds["t_separation"])
    assert axes.get_xscale() == "log"


def test_cells_of_a_strip_meet_at_the_boundary_drawn_over_them():
    ds = named_sweep((6,))
    ds["regime"][:] = [0, 0, 0, 3, 3, 3]
    values = ds["drive_amplitude"].values
    ax = plots.regime_map(ds, boundaries=boundary_at(ds["drive_amplitude"], 0.9 * values[3] + 0.1 * values[2])).axes[0]
    (drawn,) = {float(x) for line in ax.lines for x in line.get_xdata()}
    edges = mesh(ax.figure).get_coordinates()[0, :, 0]
    assert drawn == edges[3]
    assert values[1] < edges[2] < values[2]


def test_quantities_that_vary_together_make_one_map_axis():
    """Two zones of equal, varying width: the map is that of one zone."""
    ds = make_sweep((12, 9)).rename(zone_half_angle="width")
    widths = {f"zones_{k}_half_angle": ("width", ds["width"].values, ANGLE) for k in range(2)}
    together = ds.drop_vars("width").assign_coords(widths)
    np.testing.assert_array_equal(mesh(plots.regime_map(together)).get_array(), ds["regime"].transpose())


def test_path_that_gives_its_name_to_a_dimension_is_the_axis():
    ds = make_sweep((12, 9))
    ds["zone_half_angle"].attrs["path"] = "zone.half_angle"
    ds = ds.assign_coords(another=("zone_half_angle", ds["zone_half_angle"].values, {**ANGLE, "path": "another"}))
    upright, across = plots.regime_map(ds).axes[0], plots.regime_map(ds.isel(drive_amplitude=0)).axes[0]
    assert "half-angle" in upright.get_ylabel()
    assert across.get_xlabel() == upright.get_ylabel()


def test_map_axis_may_consist_of_friction_laws():
    ds = make_sweep((3, 4)).assign_coords(drive_amplitude=["stiction", "coulomb", "dahl"])
    figure = plots.regime_map(ds)
    assert [label.get_text() for label in figure.axes[0].get_xticklabels()] == ["stiction", "coulomb", "dahl"]
    np.testing.assert_array_equal(mesh(figure).get_array()[:, 2], ds["regime"].sel(drive_amplitude="dahl"))
    assert " = dahl" in title(plots.regime_map(ds, sel={"drive_amplitude": "dahl"}))


def test_map_holds_the_nearest_value_and_tells_it_by_title_and_warning(caplog):
    ds = make_sweep((12, 9, 3))
    figure = plots.regime_map(ds, sel={"friction.rough.mu_k": 0.32, "zone_half_angle": "2.5 deg"})
    np.testing.assert_array_equal(mesh(figure).get_array()[0], ds["regime"][:, 0, 1])
    assert "coefficient of kinetic friction = 0.3 (nearest to 0.32)" in title(figure)
    assert "half-angle of the zone = 2° (nearest to 2.5°)" in title(figure)
    assert "friction.rough.mu_k: 0.32 is not in the dataset: the nearest value is taken, 0.3" in caplog.messages
    # As many digits as differ.
    assert "= 2° (nearest to 2.00004°)" in title(plots.regime_map(make_sweep(), sel={"zone.half_angle": "2.00004 deg"}))
    assert "zone.half_angle: 2.00004° is not in the dataset: the nearest value is taken, 2°" in caplog.messages


@pytest.mark.parametrize(
    "value", ["2 deg", 60.0 * np.pi / 180, np.nextafter(np.radians(60.0), 0.0), "0.16666666666666666 turn"]
)
def test_value_of_the_dataset_needs_no_warning_and_may_have_a_unit(value, caplog):
    figure = plots.regime_map(make_sweep((12, 9)), sel={"zone.half_angle": value})
    assert not caplog.messages
    assert re.search("half-angle of the zone = (2|60)°$", title(figure))


def test_further_dimensions_become_panels_with_one_colour_scale():
    ds = make_sweep((6, 5, 2, 3))
    figure = plots.regime_map(ds, var="t_separation")
    panels = [axes for axes in figure.axes if axes.get_title()]
    assert len(panels) == 6
    held = panels[4].get_title().replace("\n", " ")
    assert held == "coefficient of kinetic friction = 0.5 coefficient of kinetic friction = 0.3"
    np.testing.assert_array_equal(mesh(figure, 4).get_array(), ds["t_separation"][:, :, 1, 1].transpose())
    assert len({mesh(figure, k).get_clim() for k in range(6)}) == 1


def test_too_many_panels_are_refused_and_the_message_says_what_to_hold():
    with pytest.raises(InputError, match=r"small multiples.*50 panels.*--sel friction_rough_mu_k=VALUE"):
        plots.regime_map(make_sweep((3, 3, 5, 5, 2)))


def test_large_grid_is_thinned_and_the_title_says_so():
    ds = make_sweep((3000, 1500))
    ds["regime"][:] = 1
    ds["regime"][0, 0] = 3
    figure = plots.regime_map(ds)
    assert mesh(figure).get_array().shape == (750, 1000)
    assert title(figure) == "regime of the run; 1 cell in 6 drawn"
    # Shares count the cells that are not drawn too.
    assert entries(figure) == ["oscillatory, > 99.9 %", "separating, < 0.1 %"]
    corners = mesh(figure).get_coordinates()
    assert corners[0, 0, 0] == pytest.approx(0.1, rel=0.01)
    assert corners[0, -1, 0] == pytest.approx(10.0, rel=0.01)


def sampled(*sizes: int) -> xr.Dataset:
    """Probabilities of two regimes along axes; one of them is never met in the first cell."""
    dims = ("drive_amplitude", "zone_half_angle")[: len(sizes)]
    share = np.linspace(0.0, 1.0, int(np.prod(sizes))).reshape(sizes) ** 8
    both = xr.DataArray(np.stack([share, 1.0 - share, 0.0 * share], -1), dims=(*dims, "word"))
    coords = {dim: make_sweep(sizes)[dim] for dim in dims} | {"word": ["separating", "oscillatory", "jammed"]}
    ends = {"probability_low": 0.9 * both, "probability_high": 0.1 + 0.9 * both}
    return xr.Dataset({"probability": both} | ends, coords)


def test_probability_along_one_axis_is_a_line_with_a_band_for_each_regime():
    ds = sampled(12)
    figure = plots.regime_map(ds)
    assert [ax.get_title() for ax in figure.axes] == ["separating", "oscillatory"]
    for ax, word in zip(figure.axes, ds["word"].values, strict=False):
        band = ax.collections[-1].get_paths()[0].vertices
        assert {0.9 * float(ds["probability"].sel(word=word).min()), 1.0} <= set(band[:, 1])
    # No cell has the colour of zeros.
    assert entries(figure) == []
    assert "separating" in title(plots.regime_map(ds.isel(word=[0])))


PICTURES = {
    "map": lambda: plots.regime_map(named_sweep()),
    "map of numbers": lambda: plots.regime_map(named_sweep(), var="t_separation"),
    "map with values held": lambda: plots.regime_map(named_sweep((5, 5, 2)), sel={"friction.rough.mu_k": 0.5}),
    "map of a refined sweep": lambda: plots.regime_map(refined_sweep()),
    "strip": lambda: plots.regime_map(named_sweep((12,))),
    "line": lambda: plots.regime_map(named_sweep((12,)), var="t_separation"),
    "points": lambda: plots.regime_map(make_points()),
    "small multiples": lambda: plots.regime_map(named_sweep((6, 5, 2, 2))),
    "small multiples of numbers": lambda: plots.regime_map(named_sweep((6, 5, 2, 2)), var="t_separation"),
    "history": lambda: plots.history(separated()),
    "history on a belt": lambda: plots.history(make_history(ring=False).assign(first_slip=4.0)),
    "work-precision": lambda: plots.work_precision(make_work()),
}


@pytest.mark.slow
@pytest.mark.parametrize("width", [85, 170])
@pytest.mark.parametrize("picture", PICTURES)
def test_texts_are_on_the_page_and_apart_from_each_other(picture, width):
    plots.style("print", width=width)
    figure = PICTURES[picture]()
    assert figure.get_figwidth() == pytest.approx(width / 25.4)
    assert_readable(figure)


class TestStyle:
    @pytest.mark.parametrize(
        ("arguments", "told"),
        [
            ({"name": "bright"}, "name: 'bright' is no style; choose from light, print, dark, transparent"),
            ({"angles": "grad"}, "angles: 'grad' is neither"),
            ({"width": 3.35}, "width: 3.35 is not between 20 and 2000: a width in mm"),
            ({"width": "85 mm"}, "a width in mm"),
        ],
    )
    def test_unknown_style_is_refused(self, arguments, told):
        refused(told, plots.style, **arguments)

    def test_style_can_be_taken_back_and_drawing_changes_no_setting(self):
        before = dict(matplotlib.rcParams)
        for name in ("dark", "print", "transparent"):
            plots.style(name, width=85, angles="rad")
            assert dict(matplotlib.rcParams) != before
        plots.style()
        assert plots.history(make_history()).axes[0].get_ylabel() == "angle\n(°)"
        plots.regime_map(make_sweep())
        assert dict(matplotlib.rcParams) == before

    def test_angles_are_in_degrees_in_all_pictures_or_in_radians_in_all(self):
        for unit, factor, name in (("deg", 180 / np.pi, "°"), ("rad", 1.0, "rad")):
            plots.style(angles=unit)
            ds = make_sweep().assign(phi_max=lambda ds: ds["t_separation"].assign_attrs(units="rad", long_name="angle"))
            figure = plots.regime_map(ds, var="phi_max")
            assert figure.axes[0].get_ylabel() == f"half-angle of the zone ({name})"
            assert figure.axes[1].get_ylabel() == f"angle ({name})"
            np.testing.assert_allclose(mesh(figure).get_array(), factor * ds["phi_max"].T)
            held = title(plots.regime_map(ds, sel={"zone.half_angle": "30 deg"}))
            nearest = float(ds["zone_half_angle"].sel(zone_half_angle=np.pi / 6, method="nearest"))
            assert f"= {factor * nearest:.4g}{name if name == '°' else ' rad'}" in held
            run = make_history()
            line = plots.history(run).axes[0].lines[0]
            np.testing.assert_allclose(line.get_ydata(), factor * run["phi"])


class TestPanels:
    """Functions that draw one picture draw in the axes given, and return them."""

    def test_panels_draw_in_the_axes_given(self):
        left, right, last = Figure(figsize=(16, 5)).subplots(1, 3)
        assert plots.map_panel(make_sweep(), ax=right) is right
        assert plots.precision_panel(make_work(), ax=last) is last
        assert not left.collections
        assert right.get_xlabel() == "amplitude of the drive (rad s$^{-1}$)"
        assert [text.get_text().split(",")[0] for text in right.get_legend().get_texts()] == list(REGIMES[:5])
        plots.map_panel(make_sweep(), var="t_separation", ax=left)
        assert left.figure.axes[-1].get_ylabel() == "time of separation (s)"

    def test_map_panel_of_three_dimensions_is_refused_with_what_to_hold(self):
        refused("friction_rough_mu_k: hold it, or draw regime_map", plots.map_panel, make_sweep((3, 3, 2)), ax=panel())
        held = plots.map_panel(make_sweep((3, 3, 2)), sel={"friction.rough.mu_k": 0.1}, ax=panel())
        assert "coefficient of kinetic friction = 0.1" in held.get_title().replace("\n", " ")

    def test_history_panel_also_shows_the_related_quantity(self):
        for var, lines in (("phi", 1), ("ring_omega", 2), ("normal_2", 2), ("epsilon", 1)):
            ax = panel()
            assert plots.history_panel(make_history(), var, ax) is ax
            assert len(ax.lines) == lines
            assert ax.get_xlabel() == "time (s)"
            assert "(" in ax.get_ylabel()
        refused("did you mean omega", plots.history_panel, make_history(), "omeg", panel())


def test_points_are_drawn_at_their_coordinates_in_colours_of_regimes():
    ds = make_points()
    ds["certified"][:4] = 0
    figure = plots.regime_map(ds, x="zone_half_angle", y="drive_amplitude")
    clouds = [artist for artist in figure.axes[0].collections if isinstance(artist, PathCollection)]
    expected = np.column_stack([np.degrees(ds["zone_half_angle"]), ds["drive_amplitude"]])
    np.testing.assert_allclose(clouds[0].get_offsets(), expected)
    for rgba, regime in zip(clouds[0].get_facecolors(), ds["regime"].values, strict=True):
        assert to_rgb(rgba) == pytest.approx(to_rgb(plots.REGIME_COLOURS[REGIMES[regime]]))
    assert sum(len(cloud.get_offsets()) for cloud in clouds[1:]) == 4


def test_points_and_a_grid_axis_make_a_scatter_plot():
    ds = make_sweep((6, 5)).isel(drive_amplitude=xr.DataArray([0, 3, 5], dims="point"))
    cloud = plots.regime_map(ds).axes[0].collections[0]
    assert len(cloud.get_offsets()) == 15


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ({"var": "regim"}, "var: 'regim' is not in the dataset.*did you mean regime"),
        ({"x": "drive_amplitud"}, "x: .*did you mean drive_amplitude"),
        ({"y": "nothing"}, "y: .*zone_half_angle"),
        ({"sel": {"zone_angle": 1}}, "sel: .*did you mean zone_half_angle"),
        ({"sel": {"zone_half_angle": "wide"}}, "sel.zone_half_angle: 'wide' is not a number"),
        ({"sel": {"zone.half_angle": 15}}, "sel.zone.half_angle: .*was `15 deg` meant"),
        ({"sel": {"zone.half_angle": "70 deg"}}, "at most 1.0473 rad"),
        ({"sel": {"zone.half_angle": "1 m"}}, "wrong unit"),
        ({"sel": {"drive_amplitude": 100.0}}, "at most 1"),
        ({"sel": {"drive_amplitude": float("nan")}}, "not finite"),
        ({"x": "zone_half_angle", "y": "zone_half_angle"}, "must differ"),
        ({"sel": {"zone_half_angle": 1, "drive_amplitude": 1}}, "a single cell has no map"),
        ({"var": "t_separation", "norm": "cubic"}, "norm: 'cubic' is none: it is linear or log"),
        ({"legend": "nowhere"}, r"legend: 'nowhere'.*below.*upper left"),
    ],
)
def test_wrong_map_arguments_are_refused_and_the_message_names_valid_ones(arguments, problem):
    refused(problem, plots.regime_map, make_sweep(), **arguments)


@pytest.mark.parametrize(
    ("ring", "labels", "lines"),
    [
        (True, ["angle (°)", "angular velocity (rad s$^{-1}$)", "angular acceleration (rad s$^{-2}$)",
                "normal reaction (N)"], [1, 2, 1, 2]),
        (False, ["displacement (m)", "velocity (m s$^{-1}$)", "friction force (N)"], [1, 1, 1]),
    ],
)  # fmt: skip
def test_history_has_panels_with_units_over_one_time_axis(ring, labels, lines):
    figure = plots.history(make_history(ring=ring).assign_attrs(outcome="as said"))
    panels = figure.axes[: len(labels)]
    assert [axes.get_ylabel().replace("\n", " ") for axes in panels] == labels
    assert [len(axes.lines) for axes in panels] == lines
    assert {axes.get_xlim() for axes in figure.axes} == {(0, 10)}
    assert (figure.axes[-1].get_xlabel(), figure.get_suptitle()) == ("time (s)", "as said")


def test_history_marks_the_separation_within_its_frame():
    def said(axes):
        return axes.get_legend().get_texts()[-1].get_text()

    figure = plots.history(separated())
    axes = figure.axes[3]
    (mark,) = (line for line in axes.lines if line.get_marker() == "o")
    assert mark.get_xydata().tolist() == [[10.0, 0.0]]
    assert said(axes) == "contact 2 separates, t = 10 s"
    assert axes.get_ylim()[0] < 0.0
    alone = plots.history_panel(separated(), "normal_1", panel())
    assert all(other.get_xlim()[1] > 10.1 for other in (*figure.axes, alone))
    assert "separates" in said(alone)
    # A part of the run that ends earlier does not separate.
    assert "separates" not in said(plots.history(separated().sel(time=slice(0, 5))).axes[3])


def test_a_small_displacement_is_drawn_in_millimetres():
    ds = make_history(ring=False)
    small = ds.assign(x=(1e-3 / abs(ds.x).max() * ds.x).assign_attrs(ds.x.attrs))
    assert [plots.history(run).axes[0].get_ylabel() for run in (ds, small)] == ["displacement (m)", "displacement (mm)"]


def test_history_of_many_cycles_is_a_band_with_the_last_cycles_beside_it():
    ds = make_history(40_000, ring=False)
    assert len(plots.history(make_history(ring=False)).axes) == 3
    t = np.linspace(0.0, 870 * 2 * np.pi, ds.sizes["time"])
    growing = "time", np.sin(t) * (1.0 + t / t[-1]), ds["velocity"].attrs
    figure = plots.history(ds.assign_coords(time=("time", t, ds["time"].attrs)).assign(velocity=growing))
    whole = [ax for ax in figure.axes if ax.get_xlim() == (t[0], t[-1])]
    beside = [ax for ax in figure.axes if ax not in whole]
    assert len(whole) == len(beside) == 3
    # The band is as high as the vibration at each time.
    assert not whole[1].lines
    (band,) = whole[1].collections
    corners = band.get_paths()[0].vertices
    near = corners[np.abs(corners[:, 0] - t[-1] / 2) < t[-1] / 50, 1]
    np.testing.assert_allclose([near.min(), near.max()], [-1.5, 1.5], atol=0.03)
    start, end = beside[1].get_xlim()
    assert 5 * 2 * np.pi <= end - start <= 6.1 * 2 * np.pi
    assert end == t[-1]
    assert any("stick" in text.get_text() for text in beside[0].get_legend().get_texts())


def test_history_shades_stick_for_its_duration():
    axes = plots.history(make_history()).axes[3]
    widths = [np.ptp(path.vertices[:, 0]) for path in axes.collections[0].get_paths()]
    np.testing.assert_allclose(widths, 1, atol=0.02)


def test_strip_shows_the_arc_under_each_contact():
    ds = make_history()
    drawn = mesh(plots.history(ds), -1)
    strip, widths = drawn.get_array(), np.diff(drawn.get_coordinates()[0, :, 0])
    shares = [(ds[z] > 0).mean() for z in ("zone_1", "zone_2")]
    np.testing.assert_allclose((strip > 0) @ widths / widths.sum(), shares, atol=2e-3)
    assert set(np.unique(strip[1])) == {0, 2}


def test_history_may_have_one_contact_or_one_sample():
    assert len(plots.history(make_history().drop_vars(["normal_2", "zone_2"])).axes[3].lines) == 1
    plots.history(make_history(1))


def test_acceleration_axis_is_clipped_at_outliers_and_its_title_says_so():
    ds = make_history()
    assert not plots.history(ds).axes[2].get_title(loc="right")
    ds["epsilon"][::400] = 1e6
    axes = plots.history(ds).axes[2]
    assert axes.get_ylim()[1] < 2
    assert axes.get_title(loc="right") == "axis clipped; values from \N{MINUS SIGN}1 to 10⁶"
    # Methods with variable steps take many where a value is large.
    dense = np.append(np.linspace(0, 1e-6, 1000), np.linspace(2e-6, 10, 1000))
    ds = make_history().assign_coords(time=("time", dense, ds.time.attrs))
    ds["epsilon"][:1000] = 1e6
    assert plots.history(ds).axes[2].get_ylim()[1] < 2


def test_long_history_makes_a_small_file_and_keeps_its_extremes(tmp_path):
    ds = make_history(1_000_000)
    ds["normal_2"][123_456] = -7
    figure = plots.history(ds)
    plots.save(figure, tmp_path / "history.pdf")
    assert (tmp_path / "history.pdf").stat().st_size < 100_000
    assert figure.axes[3].lines[1].get_ydata().min() == -7


class TestWorkPrecision:
    def test_curve_of_a_method_shows_the_median_error_and_bars_the_largest(self):
        ds = make_work()
        axes = plots.work_precision(ds).axes[0]
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
        curves = {line.get_label(): line for line in axes.lines if str(line.get_label()).startswith("method")}
        for name in ("method 0", "method 1", "method 2"):
            rows = ds["method"].values == name
            np.testing.assert_array_equal(curves[name].get_xdata(), ds["time_per_run"][rows])
            np.testing.assert_allclose(curves[name].get_ydata(), ds["error_end"][rows].median("cell"))
        tops = [path.vertices[1, 1] for bars in axes.collections for path in bars.get_paths()]
        np.testing.assert_allclose(tops, ds["error_end"].max("cell"))
        assert axes.get_ylabel() == "error (rad)"

    def test_zero_error_lies_on_a_floor_and_failure_on_a_ceiling(self):
        ds = make_work(1)
        ds["error_end"][3], ds["error_end"][0] = 0.0, np.inf
        axes = plots.work_precision(ds).axes[0]
        (curve,) = (line for line in axes.lines if line.get_label() == "method 0")
        drawn = curve.get_ydata()
        assert 0.0 < drawn[3] < ds["error_end"].values[2].min()
        assert np.isfinite(drawn[0])
        assert drawn[0] > ds["error_end"].values[1].max()
        words = [text.get_text() for text in axes.get_legend().get_texts()]
        assert words == ["method 0", "no error (at the floor)", "failed (at the ceiling)"]
        ds["error_end"][:] = 0.0
        assert (plots.work_precision(ds).axes[0].lines[0].get_ydata() > 0.0).all()

    def test_target_recommendation_and_wrong_regimes_are_shown_if_present(self):
        ds = make_work()
        plain = [text.get_text() for text in plots.work_precision(ds).axes[0].get_legend().get_texts()]
        assert plain == ["method 0", "method 1", "method 2"]
        names = [f"method: {k}" for k in range(ds.sizes["contender"])]
        ds = ds.assign_coords(solver=("contender", names)).assign_attrs(target=1e-4, recommended=names[6])
        ds["regime_wrong"] = ds["error_end"].dims, (ds["error_end"] > 1e-2).values.astype("int8")
        axes = plots.work_precision(ds).axes[0]
        words = [text.get_text().replace("\n", " ") for text in axes.get_legend().get_texts()]
        assert words[3:] == ["target, 0.0001", "hollow: a regime is wrong in some cell", "recommended: 6"]
        hollow = sum(len(line.get_xdata()) for line in axes.lines if line.get_markerfacecolor() == "white")
        assert hollow == (ds["regime_wrong"] == 1).any("cell").sum()
        (ring,) = (line for line in axes.lines if line.get_markerfacecolor() == "none" and line.get_markersize() > 10)
        np.testing.assert_array_equal(ring.get_xdata(), [ds["time_per_run"].values[6]])


def test_suffix_decides_the_format_of_a_saved_figure(tmp_path):
    for name, magic in (("map.png", b"\x89PNG"), ("map.PDF", b"%PDF"), ("map.svg", b"<?xml")):
        plots.save(plots.regime_map(make_sweep()), tmp_path / name)
        assert (tmp_path / name).read_bytes().startswith(magic)
    for name in ("map.xyz", "map"):
        refused(r"\.png", plots.save, Figure(), tmp_path / name)
    assert sorted(os.listdir(tmp_path)) == ["map.PDF", "map.png", "map.svg"]


class TestColoursOfNumbers:
    def test_periods_have_logarithmic_colours_and_zero_bounds_their_own_colour(self):
        ds = make_sweep((10, 10)).drop_vars("regime")
        shape = ds["t_separation"].dims
        ds["period"] = (shape, np.geomspace(0.1, 1000.0, 100).reshape(10, 10))
        ds["t_end_error"] = (shape, np.where(np.arange(100) < 20, 0.0, 1e-9 * np.arange(1, 101)).reshape(10, 10))
        colours = {}
        for var in ("period", "t_end_error"):
            figure = plots.regime_map(ds, var=var)
            colours[var] = figure.axes[0].collections[0].get_array().transpose(1, 0, 2).reshape(100, 4)
            texts = [text.get_text() for text in figure.axes[0].get_legend().get_texts()] if var != "period" else []
        assert texts == ["exactly 0, 20.0 %"]
        assert len(np.unique(colours["t_end_error"][:20], axis=0)) == 1
        assert not (colours["t_end_error"][20:] == colours["t_end_error"][0]).all(axis=1).any()
        # In a linear scale half of the periods would have the first colour.
        assert len(np.unique(colours["period"][:50], axis=0)) > 40
        assert plots.regime_map(ds, var="period", norm="linear").axes[0].collections[0].norm.vmax == 1000.0
        ds["impacts"] = (shape, np.append(np.zeros(10), np.linspace(10, 400, 90)).astype(int).reshape(10, 10))
        ds["gap_max"] = (shape, np.zeros((10, 10)))
        for var in ("impacts", "gap_max"):
            assert plots.regime_map(ds, var=var).axes[1].get_yscale() == "linear"

    def test_map_title_names_law_and_span_as_written_unless_they_were_swept(self):
        scene = {"friction": {"law": "dahl"}, "drive": {"law": "arctan", "amplitude": 2}, "time": {"span": "1 min"}}
        ds = make_sweep((10, 10)).assign_attrs(configuration=json.dumps({"scene": scene}))
        ds["drive_amplitude"].attrs["path"] = "drive.amplitude"
        assert title(plots.regime_map(ds)) == "regime of the run; dahl; drive arctan; span 1 min"


def test_pictures_refuse_datasets_of_another_kind_and_say_what_draws_them():
    one = xr.DataArray([[0.5]], name="phi_end")
    for draw, ds, told in (
        (plots.regime_map, make_history(), "history"),
        (plots.regime_map, make_work(), "work_precision"),
        (plots.regime_map, one, r"got one variable: regime_map\(ds, var='phi_end'\) draws it"),
        (plots.history, make_sweep(), "regime_map"),
        (plots.history, make_history()[["mode"]], "no variable that a history shows"),
        (plots.work_precision, make_sweep(), "has no contender, cell"),
        (lambda ds: plots.work_precision(ds, "error_and"), make_work(), "did you mean error_end"),
    ):
        refused(told, draw, ds)
