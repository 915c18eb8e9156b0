"""Pictures of sections: diagrams in both directions, the points of one motion, multipliers and exponents."""

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import PathCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from refusals import refused

from ringsweep import InputError, cli, plots
from ringsweep.accessor import Accessor
from ringsweep.plots.look import PAIR_COLOURS

mpl.use("Agg")


@pytest.fixture
def diagram():
    """Two branches over three frequencies: one point up, two points down."""
    x = np.empty((3, 2, 4))
    x[:, 0], x[:, 1] = 1.0, [0.0, 2.0, 0.0, 2.0]
    dims = "force_frequency", "direction"
    flags = {"flag_values": [0, 1], "flag_meanings": "stick-slip oscillatory"}
    return xr.Dataset(
        {
            "x_section": ((*dims, "section"), x, {"units": "m"}),
            "velocity_section": ((*dims, "section"), 0.0 * x, {"units": "m s-1"}),
            "regime": (dims, np.array([[0, 0], [0, 1], [1, 1]], dtype=np.int8), flags),
            "lyapunov": (dims, [[-0.1, -np.inf], [0.2, -0.3], [0.1, -0.2]], {"units": "s-1"}),
            "lyapunov_error": (dims, np.full((3, 2), 0.01), {"units": "s-1"}),
            "multiplier_1": (dims, [[0.5, 0.2], [1.5, 0.3], [0.9, 0.1]], {"units": "1"}),
        },
        coords={
            "force_frequency": ("force_frequency", [0.3, 0.1, 0.2], {"units": "Hz", "path": "force.frequency"}),
            "direction": ["up", "down"],
        },
        attrs={"Conventions": "CF-1.11", "ringsweep_version": "0.1.0"},
    )


def points(ax):
    return [one for one in ax.collections if isinstance(one, PathCollection)]


def test_up_and_down_are_rasterised_in_two_colours_under_a_regime_strip(diagram):
    ax = plots.bifurcation_panel(diagram, ax=Figure().subplots())
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["up", "down", "stick-slip", "oscillatory"]
    up, down = points(ax)
    assert [to_hex(one.get_facecolor()[0]).upper() for one in (up, down)] == list(PAIR_COLOURS)
    assert set(up.get_offsets()[:, 1]) == {1.0}
    assert set(down.get_offsets()[:, 1]) == {0.0, 2.0}
    assert up.get_rasterized()
    assert down.get_rasterized()


def test_exponent_and_multipliers_stand_below_on_the_same_axis(diagram):
    figure = plots.bifurcation(diagram)
    assert len(figure.axes) == 3
    assert len({ax.get_xlim() for ax in figure.axes}) == 1
    assert [ax.get_xlabel() != "" for ax in figure.axes] == [False, False, True]
    # A multiplier outside the unit circle is within the picture.
    assert figure.axes[2].get_ylim()[1] > 1.5
    bare = diagram.drop_vars(["lyapunov", "multiplier_1"])
    assert len(plots.bifurcation(bare).axes) == 1


def test_a_section_shows_its_points_in_time(diagram):
    one = diagram.isel(force_frequency=0, direction=1)
    (drawn,) = points(plots.section_panel(one, Figure().subplots()))
    assert drawn.get_array().tolist() == [1, 2, 3, 4]
    refused("choose a cell", plots.section_panel, diagram)


@pytest.fixture
def multipliers():
    """A pair that turns around, one on the way out at -1, and one that stick has erased; no periodic motion at last."""
    numbers = {
        "multiplier_1": ("speed", [0.5, 1.5, 0.8, np.nan], {"units": "1"}),
        "multiplier_2": ("speed", [0.5, 0.1, 0.0, np.nan], {"units": "1"}),
        "multiplier_angle_1": ("speed", [1.0, np.pi, 0.0, np.nan], {"units": "rad"}),
        "multiplier_angle_2": ("speed", [-1.0, np.pi, 0.0, np.nan], {"units": "rad"}),
    }
    return xr.Dataset(numbers, coords={"speed": ("speed", [4.0, 1.0, 2.0, 3.0], {"units": "m s-1"})})


def test_multipliers_stand_in_the_complex_plane_with_the_unit_circle(multipliers):
    ax = plots.multiplier_circle(multipliers, ax=Figure().subplots())
    first, second = points(ax)
    place = first.get_offsets()[[0, 1, 3]]
    pair = [0.5 * np.cos(1.0), 0.5 * np.sin(1.0)]
    np.testing.assert_allclose(place, [[-1.5, 0.0], [0.8, 0.0], pair], atol=1e-12)
    np.testing.assert_allclose(second.get_offsets()[3], [pair[0], -pair[1]])
    # One outside the unit circle is within the picture.
    assert ax.get_xlim()[0] < -1.5
    assert ax.get_aspect() == 1.0
    refused("exponent: true", plots.multiplier_circle, multipliers.drop_vars("multiplier_angle_1"))


def test_circle_tells_up_from_down_by_its_marks_and_the_command_draws_it(multipliers, diagram, tmp_path):
    both = xr.concat([multipliers, multipliers], xr.DataArray(["up", "down"], dims="direction", name="direction"))
    ax = plots.multiplier_circle(both, ax=Figure().subplots())
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["up", "down"]
    assert len({one.get_paths()[0].vertices.tobytes() for one in points(ax)}) == 2
    multipliers.assign_attrs(diagram.attrs).to_netcdf(tmp_path / "one.nc")
    assert cli.main(["map", str(tmp_path / "one.nc"), "--var", "multiplier_1"]) == 0
    assert (tmp_path / "one-multiplier_1.png").exists()


def test_all_ways_to_a_picture_choose_the_diagram(diagram):
    accessor = Accessor(diagram)
    drawn = [plots.regime_map(diagram), accessor.map(), accessor.map("x_section")]
    assert [[ax.get_ylabel() for ax in figure.axes] for figure in drawn] == [
        ["x (m)", "exponent (s$^{-1}$)", "multipliers"]
    ] * 3
    # What only a map has makes it a map, and so does its variable.
    for options in ({"y": "direction"}, {"var": "regime"}, {"title": "mine"}):
        assert "x (m)" not in [ax.get_ylabel() for ax in plots.regime_map(diagram, **options).axes]
    several = xr.concat([diagram, diagram], xr.DataArray([1.0, 2.0], dims="belt_velocity", name="belt_velocity"))
    refused("a diagram has one axis", plots.regime_map, several, var="x_section")
    with pytest.raises(InputError, match=r"points of sections: plots\.bifurcation draws them"):
        plots.map_panel(diagram, var="x_section", ax=Figure().subplots())
