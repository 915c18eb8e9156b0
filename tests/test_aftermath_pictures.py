"""Pictures of runs that go on after a contact is lost show the body off the race, its impacts and their words."""

import json

import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from matplotlib.quiver import Quiver
from rings import course, particle, rubs, shape

import ringsweep
from ringsweep import plots
from ringsweep.plots.datasets import FLIGHT, PIVOT, phases
from ringsweep.plots.look import AFTERMATH_COLOURS
from ringsweep.quantities.flags import AFTERMATHS, OPEN, TUMBLED
from ringsweep.quantities.variables import OUTCOMES

RADIUS, BALL, HALF, OFFSET = 0.043378, 0.010, 0.025, 0.004
SCENE = (
    shape(0.076, 4.47e-5, HALF, BALL, RADIUS, offset=OFFSET, zone=0.3)
    | rubs("stiction", rest=(0.2, 0.1), rough=(0.5, 0.3))
    | course("arctan", 2.0, omega=40.0, span=1.0, e=0.5)
)


@pytest.fixture(scope="module")
def run():
    """A body that sticks, slips, loses its contacts again and again, flies and tumbles."""
    return ringsweep.simulate(SCENE, samples=4000)


def balls_of(psi, x, y):
    """Centres of both balls."""
    along, outwards = np.array([np.cos(psi), np.sin(psi)]), np.array([np.sin(psi), -np.cos(psi)])
    middle = np.array([x, y]) - OFFSET * outwards
    return middle - HALF * along, middle + HALF * along


def amid(run, phase):
    """Index of a sample of a run in the middle of its longest part in a phase."""
    inside = np.append(0, np.where(phases(run) == phase, 1, 0))
    lengths = np.zeros(len(inside), dtype=int)
    for k in range(1, len(inside)):
        lengths[k] = (lengths[k - 1] + 1) * inside[k]
    end = int(lengths.argmax()) - 1
    return end - int(lengths.max()) // 2


def sweep_of(**numbers) -> xr.Dataset:
    """A square sweep of variables, whose values are given row by row."""
    side = int(np.sqrt(len(next(iter(numbers.values())))))
    data = {}
    for name, values in numbers.items():
        cells = np.asarray(values, dtype=OUTCOMES[name].dtype).reshape(side, side)
        data[name] = (("a", "b"), cells, OUTCOMES[name].attributes)
    return xr.Dataset(data, {"a": np.arange(1.0, side + 1), "b": np.arange(1.0, side + 1)})


def ax() -> object:
    return Figure(figsize=(7, 5), layout="constrained").add_subplot()


def entries(axes) -> list[str]:
    return [text.get_text() for text in axes.get_legend().get_texts()]


class TestOffTheRace:
    def test_phases_are_those_of_the_gaps_and_an_instant_of_touch_ends_none(self, run):
        phase = phases(run)
        opened = (run.gap_1.values > 0.0).astype(int) + (run.gap_2.values > 0.0)
        steady = (opened[1:-1] == opened[:-2]) & (opened[1:-1] == opened[2:])
        for count, expected in ((1, PIVOT), (2, FLIGHT)):
            here = steady & (opened[1:-1] == count)
            assert here.sum() > 10
            assert (phase[1:-1][here] == expected).all()
        touching = run.copy(deep=True)
        touching["gap_2"][amid(run, FLIGHT)] = 0.0
        np.testing.assert_array_equal(phases(touching), phase)

    @pytest.mark.parametrize("phase", [1, PIVOT, FLIGHT])
    def test_polar_view_has_balls_in_place_and_forces_at_closed_contacts_only(self, run, phase):
        axes = ax()
        now = run.isel(time=amid(run, phase))
        plots.polar_view(run, float(now.time), axes)
        balls = [patch for patch in axes.patches if isinstance(patch, Circle)]
        reactions, frictions, weight = (artist for artist in axes.collections if isinstance(artist, Quiver))
        centres = balls_of(float(now["phi"]), float(now["x"]), float(now["y"]))
        for k, (ball, centre) in enumerate(zip(balls, centres, strict=True), start=1):
            np.testing.assert_allclose(ball.center, centre, atol=1e-6)
            closed = float(now[f"gap_{k}"]) == 0.0
            assert (np.hypot(reactions.U[k - 1], reactions.V[k - 1]) > 0.0) == closed
            assert closed or np.hypot(frictions.U[k - 1], frictions.V[k - 1]) == 0.0
        np.testing.assert_allclose(weight.get_offsets()[0], [now["x"], now["y"]], atol=1e-6)
        assert axes.get_title().endswith({PIVOT: "one contact open", FLIGHT: "flight"}.get(phase, "slip forward"))

    def test_particle_in_flight_is_a_ball_a_gap_off_the_race_with_its_weight(self, run):
        scene = {name: part for name, part in SCENE.items() if name not in ("model", "body", "ring")}
        scene |= particle(0.076, RADIUS)
        alone = run.drop_vars(["gap_2", "normal_2"]).assign_attrs(configuration=json.dumps({"scene": scene}))
        axes = ax()
        plots.polar_view(alone.assign(gap_1=("time", np.full(run.sizes["time"], 0.005))), 0.2, axes)
        (ball,) = (patch for patch in axes.patches if isinstance(patch, Circle))
        *_, weight = (artist for artist in axes.collections if isinstance(artist, Quiver))
        assert np.hypot(*ball.center) == pytest.approx(RADIUS - ball.radius - 0.005)
        np.testing.assert_allclose(weight.get_offsets()[0], ball.center, rtol=1e-6)
        assert axes.get_title().endswith("flight")


class TestHistory:
    def test_panels_below_show_gaps_and_impacts_and_all_shade_open_contacts(self, run):
        figure = plots.history(run)
        gaps, impacts = figure.axes[4:6]
        assert gaps.get_ylabel() == "gap (mm)"
        assert impacts.get_ylabel().startswith("impact speed")
        assert impacts.get_yscale() == "log"
        assert len(plots.history_panel(run, "impact_speed", ax()).lines) == 2
        assert entries(figure.axes[0]) == ["stick", "one contact open", "flight"]
        hardest = int(np.argmax(run.impact_speed.values))
        marks = {line.get_label(): line.get_xydata().tolist() for line in impacts.lines}
        mark = [float(run.impact_time[hardest]), float(run.impact_speed[hardest])]
        assert mark in marks[f"contact {int(run.impact_contact[hardest])}"]
        for axes in figure.axes[:6]:
            widths = [
                np.nan_to_num([path.get_extents().width for path in shading.get_paths()]).sum()
                for shading in axes.collections
            ]
            times = run.stick_time, run.open_time - run.flight_time, run.flight_time
            np.testing.assert_allclose(widths, [float(time) for time in times], atol=0.02)

    def test_separation_is_marked_where_it_is_and_a_part_after_it_has_no_mark(self, run):
        (mark,) = (line for line in plots.history(run).axes[3].lines if line.get_marker() == "o")
        assert mark.get_xdata().tolist() == [run.t_separation]
        after = plots.history(run.sel(time=slice(0.2, 0.9))).axes
        assert not [line for line in after[3].lines if line.get_marker() == "o"]
        assert after[5].get_xlim() == (pytest.approx(0.2, abs=0.01), pytest.approx(0.9, abs=0.01))

    def test_laws_have_a_panel_for_the_gap_of_each_contact(self, run):
        one = run.drop_dims(["impact", "event"]).drop_vars(["aftermath", "regime"])
        both = xr.concat([one, one], xr.DataArray(["stiction", "coulomb"], dims="friction_law", name="friction_law"))
        titles = [axes.get_title(loc="left") for axes in plots.history(both).axes]
        assert titles.count("contact 1") == titles.count("contact 2") == 2


def test_phase_portrait_names_pivot_flight_and_velocity_jumps_at_impacts(run):
    axes = plots.phase_portrait(run, ax=ax())
    assert {"stick", "slip forward", "one contact open", "flight", "impact"} <= set(entries(axes))
    lines = [line for line in axes.lines if line.get_linewidth() == 0.6]
    (jumps,) = (line.get_xydata() for line in lines)
    jumps = jumps[np.isfinite(jumps).all(axis=1)].reshape(-1, 2, 2)
    # At an impact the angle holds and the velocity does not.
    assert (np.ptp(jumps[:, :, 0], axis=1) < 1e-9).sum() > 3
    assert (np.ptp(jumps[:, :, 1], axis=1) > 0.0).all()


class TestMaps:
    def test_words_differ_in_greyscale_and_a_map_hatches_what_is_not_certified(self):
        assert tuple(AFTERMATH_COLOURS) == AFTERMATHS
        shades = [float(np.dot([0.2126, 0.7152, 0.0722], to_rgb(colour))) for colour in AFTERMATH_COLOURS.values()]
        assert (np.diff(shades) < -0.1).all()
        ds = sweep_of(aftermath=np.arange(16) % 4, certified=np.arange(16) % 4 != TUMBLED)
        axes = plots.regime_map(ds, var="aftermath").axes[0]
        assert entries(axes) == [*(f"{word}, 25.0 %" for word in AFTERMATHS), "not certified, 25.0 %"]
        handles = dict(zip(entries(axes), axes.get_legend().get_patches(), strict=True))
        assert isinstance(handles["open, 25.0 %"], Rectangle)
        assert handles["open, 25.0 %"].get_facecolor()[:3] == to_rgb(AFTERMATH_COLOURS[AFTERMATHS[OPEN]])

    def test_a_run_without_recovery_is_told_in_the_legend(self):
        ds = sweep_of(t_recovered=np.where(np.arange(16) < 4, np.nan, 1.0 + np.arange(16)))
        assert entries(plots.regime_map(ds, var="t_recovered").axes[0]) == ["none lost, or open at the end, 25.0 %"]
