"""Cells of a sweep as configurations, and the map that draws the history of the cell clicked."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from matplotlib.backend_bases import KeyEvent, MouseEvent
from matplotlib.backends.backend_agg import FigureCanvasAgg

import ringsweep
from ringsweep import plots
from ringsweep.config import load
from ringsweep.errors import InputError
from ringsweep.quantities.flags import REGIMES
from ringsweep.quantities.variables import OUTCOMES
from ringsweep.runs import sweep

AXES = {"drive.amplitude": [0.5, 2.0, 8.0], "zone.half_angle": ["10 deg", "20 deg", "40 deg", "60 deg"]}


def mapped(scene, axes, points=False):
    """Dataset of a sweep with invented regimes, without computing it."""
    config = load({"scene": scene, "sweep": {"points" if points else "grid": axes}})
    ds = sweep._frame(config, None)
    shape = tuple(config.axes.sizes.values())
    regime = (np.arange(np.prod(shape)) % 3).astype("int8").reshape(shape)
    return ds.assign(regime=(tuple(config.axes.sizes), regime, OUTCOMES["regime"].attributes))


@pytest.fixture
def maps(scene):
    return mapped(scene, AXES)


@pytest.fixture
def asked(monkeypatch):
    """Values of the scenes that are simulated; every simulation returns one invented history."""
    found = []
    time = np.linspace(0.0, 1.0, 20)
    history = xr.Dataset(dict.fromkeys(("phi", "omega", "epsilon", "normal_1"), ("time", time)), {"time": time})

    def simulate(configuration):
        found.append(load(configuration).scene.values)
        return history.assign_attrs(outcome=f"history {len(found)}")

    monkeypatch.setattr("ringsweep.runs.simulate.simulate", simulate)
    return found


def click(figure, x, y, button=1, ax=None):
    FigureCanvasAgg(figure).draw()
    ax = ax or figure.axes[0]
    at = ax.transData.transform((x, y))
    figure.canvas.callbacks.process("button_press_event", MouseEvent("button_press_event", figure.canvas, *at, button))


def press(figure, *keys):
    for key in keys:
        figure.canvas.callbacks.process("key_press_event", KeyEvent("key_press_event", figure.canvas, key))


class TestCell:
    def test_cell_is_the_configuration_with_the_values_of_the_cell(self, maps, caplog):
        found = plots.cell(maps, {"drive.amplitude": 1.9, "zone_half_angle": np.radians(39.0)})
        assert "sweep" not in found
        values = load(found).scene.values
        assert values["drive.amplitude"] == 2.0
        assert values["zone.half_angle"] == float(maps["zone_half_angle"][2])
        assert caplog.messages == [
            "drive.amplitude: 1.9 rad s⁻¹ is not in the dataset: the nearest value is taken, 2 rad s⁻¹",
            "zone_half_angle: 39° is not in the dataset: the nearest value is taken, 40°",
        ]

    def test_cell_accepts_a_dataset_already_selected_with_xarray(self, maps):
        found = plots.cell(maps.isel(drive_amplitude=2).sel(zone_half_angle=0.3, method="nearest"))
        values = load(found).scene.values
        assert (values["drive.amplitude"], values["zone.half_angle"]) == (8.0, float(maps["zone_half_angle"][1]))

    def test_cell_of_points_is_selected_by_number(self, scene):
        ds = mapped(scene, {"drive.amplitude": [0.5, 2.0, 8.0], "initial.omega": [3.0, 1.0, 2.0]}, points=True)
        values = load(plots.cell(ds, {"point": 1})).scene.values
        assert (values["drive.amplitude"], values["initial.omega"]) == (2.0, 1.0)

    def test_cell_may_be_selected_by_law_and_by_a_number_of_an_arc(self, scene):
        bare = {name: part for name, part in scene.items() if name != "zone"}
        bare["friction"] = {"rest": scene["friction"]["rest"]}
        bare["zones"] = [{"half_angle": "10 deg", "mu_s": 0.5, "mu_k": 0.3}]
        ds = mapped(bare, {"friction.law": ["coulomb", "stiction"], "zones.0.mu_k": [0.2, 0.25]})
        found = plots.cell(ds, {"friction.law": "coulomb", "zones.0.mu_k": 0.25})
        assert found["scene"]["friction"]["law"] == "coulomb"
        assert found["scene"]["zones"][0]["mu_k"] == 0.25

    def test_run_of_a_cell_gives_the_result_of_the_sweep(self, scene):
        ds = ringsweep.sweep(scene, {"drive.amplitude": [0.5, 8.0], "zone.half_angle": ["15 deg", "40 deg"]})
        for i, j in ((0, 1), (1, 0)):
            one = ds.isel(drive_amplitude=i, zone_half_angle=j)
            run = ringsweep.simulate(plots.cell(one))
            assert REGIMES[int(run["regime"])] == REGIMES[int(one["regime"])]
            assert float(run["phi_end"]) == float(one["phi_end"])

    def test_cell_refuses_incomplete_selections_and_datasets_without_configuration(self, maps):
        with pytest.raises(InputError, match=r"zone_half_angle \(4\) is left"):
            plots.cell(maps, {"drive.amplitude": 2.0})
        with pytest.raises(InputError, match="did you mean drive_amplitude"):
            plots.cell(maps, {"drive.amplitud": 2.0})
        with pytest.raises(InputError, match="no attribute configuration"):
            plots.cell(maps.isel(drive_amplitude=0, zone_half_angle=0).drop_attrs())


class TestExplore:
    def test_explore_draws_the_map_and_the_history_of_the_middle_cell(self, maps, asked):
        figure = plots.explore(maps)
        assert [axes.get_ylabel().replace("\n", " ") for axes in figure.axes[:2]] == [
            "half-angle of the zone (°)",
            "angle",
        ]
        assert asked[0]["drive.amplitude"] == 2.0
        assert asked[0]["zone.half_angle"] == pytest.approx(np.radians(40.0))
        assert figure.subfigs[1].get_suptitle().endswith("history 1")

    def test_explore_starts_with_the_cell_given(self, maps, asked):
        plots.explore(maps, at={"drive.amplitude": 8.0, "zone.half_angle": 0.18})
        assert asked[0]["drive.amplitude"] == 8.0
        assert asked[0]["zone.half_angle"] == pytest.approx(np.radians(10.0))

    @pytest.mark.slow
    @pytest.mark.parametrize(("x", "y"), [(0.5, 10.0), (8.0, 20.0), (1.3, 48.0)])
    def test_click_draws_and_marks_the_cell_under_the_pointer(self, maps, asked, x, y):
        figure = plots.explore(maps)
        click(figure, x, y)
        near = min(AXES["drive.amplitude"], key=lambda value: abs(np.log(value / x)))
        assert len(asked) == 2
        assert asked[1]["drive.amplitude"] == near
        assert asked[1]["zone.half_angle"] == pytest.approx(np.radians({10.0: 10, 20.0: 20, 48.0: 40}[y]))
        assert figure.subfigs[1].get_suptitle().endswith("history 2")
        assert f"angular velocity = {near:g} rad s" in figure.subfigs[1].get_suptitle()
        mark = figure.axes[0].lines[-1].get_xydata()[0]
        np.testing.assert_allclose(mark, [near, np.degrees(asked[1]["zone.half_angle"])])

    def test_other_buttons_and_clicks_outside_the_map_draw_nothing(self, maps, asked):
        figure = plots.explore(maps)
        click(figure, 2.0, 20.0, button=3)
        click(figure, 0.5, 0.5, ax=figure.axes[1])
        figure.canvas.callbacks.process("button_press_event", MouseEvent("button_press_event", figure.canvas, 1, 1, 1))
        assert len(asked) == 1

    def test_explore_uses_pyplot_only_with_an_interactive_backend(self, maps, asked, monkeypatch):
        from matplotlib import pyplot

        pyplot.close("all")
        plots.explore(maps)
        assert not pyplot.get_fignums()
        monkeypatch.setattr("matplotlib.get_backend", lambda: "widget")
        try:
            figure = plots.explore(maps)
            assert figure is pyplot.figure(pyplot.get_fignums()[0])
        finally:
            pyplot.close("all")

    def test_live_figure_as_the_value_of_a_cell_of_a_notebook_shows_no_second_picture(self, maps, asked, monkeypatch):
        """Under ipympl pyplot shows the live canvas; IPython would add a picture of the figure, which is dead."""
        formatters = pytest.importorskip("IPython.core.formatters")
        from IPython.core.pylabtools import select_figure_formats
        from matplotlib import pyplot

        # Older IPython knows ipympl by this name only.
        monkeypatch.setattr("matplotlib.get_backend", lambda: "module://ipympl.backend_nbagg")
        monkeypatch.setattr(FigureCanvasAgg, "toolbar_position", "left", raising=False)
        shown = []
        monkeypatch.setattr("IPython.display.display", shown.append)
        shell = SimpleNamespace(display_formatter=formatters.DisplayFormatter())
        # A notebook's, where a terminal's shows text only.
        shell.display_formatter.active_types = shell.display_formatter.format_types
        # What `%matplotlib widget` does.
        select_figure_formats(shell, {"png"})
        format_of = shell.display_formatter.format
        try:
            assert "image/png" in format_of(pyplot.subplots()[0])[0]
            figure = plots.explore(maps)
            with pyplot.ion():
                assert format_of(figure) == ({}, {})
            assert shown == []
            with pyplot.ioff():
                assert format_of(figure) == ({}, {})
            assert shown == [figure.canvas]
        finally:
            pyplot.close("all")

    @pytest.mark.slow
    def test_explore_may_exchange_axes_and_hold_others(self, scene, asked):
        maps = mapped(scene, AXES | {"friction.rough.mu_k": [0.25, 0.3]})
        with pytest.raises(InputError, match="friction_rough_mu_k"):
            plots.explore(maps)
        figure = plots.explore(maps, x="zone.half_angle", y="drive.amplitude", sel={"friction.rough.mu_k": 0.26})
        click(figure, 20.0, 8.0)
        assert asked[1]["friction.rough.mu_k"] == 0.25
        assert asked[1]["drive.amplitude"] == 8.0

    def test_click_among_points_draws_the_nearest_on_the_screen(self, scene, asked):
        axes = {"drive.amplitude": [0.5, 2.0, 8.0, 8.0], "initial.omega": [3.0, 1.0, 2.0, 0.0]}
        figure = plots.explore(mapped(scene, axes, points=True))
        click(figure, 7.0, 1.8)
        assert (asked[1]["drive.amplitude"], asked[1]["initial.omega"]) == (8.0, 2.0)

    def test_click_on_an_axis_of_laws_draws_the_run_of_that_law(self, scene, asked):
        ds = mapped(scene, {"drive.amplitude": [0.5, 2.0], "friction.law": ["coulomb", "stiction"]})
        figure = plots.explore(ds)
        click(figure, 2.0, 0.0)
        assert "friction law = coulomb" in figure.subfigs[1].get_suptitle()

    def test_explore_accepts_a_sweep_over_one_axis(self, scene, asked):
        figure = plots.explore(mapped(scene, {"drive.amplitude": [0.5, 2.0, 8.0]}))
        click(figure, 8.0, 0.5)
        assert asked[1]["drive.amplitude"] == 8.0

    def test_arrow_keys_move_to_the_next_cell_and_stop_at_the_end(self, maps, asked):
        figure = plots.explore(maps, at={"drive.amplitude": 2.0, "zone.half_angle": "20 deg"})
        press(figure, "right", "right", "up", "down", "down", "down", "left", "escape")
        angles = [round(np.degrees(values["zone.half_angle"])) for values in asked]
        assert [values["drive.amplitude"] for values in asked] == [2.0, 8.0, 8.0, 8.0, 8.0, 2.0]
        assert angles == [20, 20, 40, 20, 10, 10]
        np.testing.assert_allclose(figure.axes[0].lines[-1].get_xydata()[0], [2.0, 10.0])

    def test_arrow_keys_among_points_move_to_the_next_value(self, scene, asked):
        axes = {"drive.amplitude": [0.5, 2.0, 8.0, 8.0], "initial.omega": [3.0, 1.0, 2.0, 0.0]}
        figure = plots.explore(mapped(scene, axes, points=True), at={"drive.amplitude": 2.0})
        press(figure, "up", "right", "left", "left", "left", "left")
        found = [(values["drive.amplitude"], values["initial.omega"]) for values in asked]
        assert found == [(2.0, 1.0), (8.0, 2.0), (8.0, 0.0), (2.0, 1.0), (0.5, 3.0)]

    def test_pointer_tells_coordinates_regime_certificate_and_error(self, maps, asked):
        shape = dict(maps.sizes)
        maps["certified"] = (
            tuple(shape),
            np.ones(tuple(shape.values()), dtype="int8"),
            OUTCOMES["certified"].attributes,
        )
        for name, value in (("phi_max", np.radians(80.0)), ("phi_max_error", np.radians(2.01e-9))):
            maps[name] = (tuple(shape), np.full(tuple(shape.values()), value), OUTCOMES[name].attributes)
        told = plots.explore(maps).axes[0].format_coord(2.0, 20.0)
        place = "amplitude of the ring's angular velocity = 2 rad s⁻¹, half-angle of the zone = 20°"
        assert told == f"{place}, revolving, certified"
        told = plots.explore(maps, var="phi_max").axes[0].format_coord(2.0, 20.0)
        assert told.endswith(
            "revolving, greatest angle of the body (°): 80, error at most 2.1\N{MULTIPLICATION SIGN}10⁻⁹, certified"
        )

    def test_map_and_history_stand_side_by_side(self, maps, asked):
        figure = plots.explore(maps)
        FigureCanvasAgg(figure).draw()
        left, right = (subfigure.bbox.extents for subfigure in figure.subfigs)
        assert left[2] <= right[0]
        assert figure.get_figwidth() * figure.dpi < 1000
