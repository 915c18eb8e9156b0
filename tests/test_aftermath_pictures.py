"""Pictures of runs that go on after a contact is lost show the body off the race, its impacts and their words."""

import json

import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from matplotlib.quiver import Quiver
from matplotlib.text import Text

from ringsweep import plots
from ringsweep.plots.datasets import FLIGHT, PIVOT, phases
from ringsweep.plots.films import _Film
from ringsweep.plots.look import AFTERMATH_COLOURS
from ringsweep.plots.rig import ring_history
from ringsweep.quantities.flags import AFTERMATHS, OPEN, SEPARATING, TUMBLED
from ringsweep.quantities.variables import HISTORY, IMPACTS, OUTCOMES

MASS, INERTIA, RADIUS, BALL, HALF, OFFSET, GRAVITY = 0.076, 4.47e-5, 0.043378, 0.010, 0.025, 0.004, 9.81
SCENE = {
    "model": "ring",
    "body": {
        **{"mass": MASS, "inertia": INERTIA, "half_distance": HALF, "ball_radius": BALL},
        "center_offset": OFFSET,
    },
    "ring": {"radius": RADIUS},
    "friction": {"law": "stiction", "rough": {"mu_s": 0.5, "mu_k": 0.3}, "rest": {"mu_s": 0.2, "mu_k": 0.1}},
    "zone": {"half_angle": 0.3},
    "drive": {"law": "arctan", "amplitude": 2.0},
    "impact": {"restitution": 0.5},
    "time": {"span": 4.0},
}

#: Instants of impacts of the invented run.
IMPACT_TIMES = (2.0, 3.0, 3.5)


def place(radius, angle):
    return radius * np.array([np.sin(angle), -np.cos(angle)])


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def balls_of(psi, x, y):
    """Centres of both balls."""
    along, outwards = np.array([np.cos(psi), np.sin(psi)]), np.array([np.sin(psi), -np.cos(psi)])
    middle = np.array([x, y]) - OFFSET * outwards
    return middle - HALF * along, middle + HALF * along


def on_one_contact(psi, alpha):
    """Centre of mass of a body whose ball 1 touches the race at an angle."""
    own, _ = balls_of(psi, 0.0, 0.0)
    return place(RADIUS - BALL, alpha) - own


def invented() -> xr.Dataset:
    """A run in four parts of a second: closed and stuck, on contact 1, in flight, closed in slip."""
    t = np.unique(np.append(np.linspace(0.0, 4.0, 401), IMPACT_TIMES))
    t = np.sort(np.append(t, [1.0, *IMPACT_TIMES]))
    second = np.append(np.diff(t) == 0.0, False)
    part = np.minimum(np.floor(t), 3).astype(int) - (second & (t % 1.0 == 0.0))
    beta = np.arcsin(HALF / (RADIUS - BALL))
    columns = {name: np.zeros(len(t)) for name in HISTORY}
    columns["mode"] = np.where(part == 0, 0, -1)
    columns["omega"] = np.sin(t) + np.cumsum(np.append(0.0, np.diff(t) == 0.0))
    rng = np.random.default_rng(5)
    columns |= {name: rng.uniform(0.5, 2.0, len(t)) for name in ("normal_1", "normal_2")}
    columns["true_1"], columns["true_2"] = rng.uniform(-0.3, 0.3, (2, len(t)))
    for k, which in enumerate(part):
        psi = columns["phi"][k] = 0.8 * t[k]
        share = t[k] - which
        if which in (0, 3):
            x, y = place((RADIUS - BALL) * np.cos(beta) + OFFSET, psi)
        else:
            lift = 0.3 * share * (1.0 - share) if which == 1 else 0.0
            x, y = on_one_contact(psi + lift, psi - beta)
            psi = columns["phi"][k] = psi + lift
            if which == 2:
                x, y = (1.0 - 0.2 * share * (1.0 - share)) * np.array([x, y])
        columns["x"][k], columns["y"][k] = x, y
        for contact, centre in enumerate(balls_of(psi, x, y), start=1):
            gap = RADIUS - BALL - np.hypot(*centre)
            is_open = which == 2 or (which == 1 and contact == 2)
            columns[f"gap_{contact}"][k] = gap if is_open and 0.0 < share < 1.0 else 0.0
            if is_open:
                columns[f"normal_{contact}"][k] = columns[f"true_{contact}"][k] = 0.0
        _balance(columns, k, which in (0, 3))
    names = [name for name in HISTORY if not name.startswith(("belt", "velocity", "friction", "deflection"))]
    ds = xr.Dataset({name: ("time", columns[name], HISTORY[name].attributes) for name in names})
    ds = ds.assign_coords(time=("time", t, {"units": "s", "long_name": "time"}))
    ds = ds.assign({f"true_{k}": ("time", columns[f"true_{k}"]) for k in (1, 2)})
    values = {"impact_time": IMPACT_TIMES, "impact_contact": (2, 1, 3), "impact_speed": (0.4, 0.1, 1e-6)}
    values["impulse"] = (0.01, 0.002, 1e-8)
    impacts = {name: ("impact", np.array(values[name]), IMPACTS[name].attributes) for name in IMPACTS}
    scalars = {"regime": SEPARATING, "separating_contact": 2, "t_separation": 1.0, "aftermath": TUMBLED}
    attributes = {"configuration": json.dumps({"scene": SCENE}), "outcome": "separating"}
    return ds.assign(impacts | {name: ((), value) for name, value in scalars.items()}).assign_attrs(attributes)


def _balance(columns, k, both_closed):
    """Set accelerations by the momentum and the moment of momentum of the forces."""
    centre = np.array([columns["x"][k], columns["y"][k]])
    total, moment = np.array([0.0, -MASS * GRAVITY]), 0.0
    for contact, ball in enumerate(balls_of(columns["phi"][k], *centre), start=1):
        outwards = ball / np.hypot(*ball)
        forward = np.array([-outwards[1], outwards[0]])
        force = -columns[f"normal_{contact}"][k] * outwards + columns[f"true_{contact}"][k] * forward
        total = total + force
        moment += cross(ball + BALL * outwards - centre, force)
    columns["epsilon"][k] = moment / INERTIA
    if both_closed:
        # Such forces need this speed on the circle of the centre of mass.
        distance = np.hypot(*centre)
        columns["omega"][k] = np.sqrt(max(-(total @ centre) / (MASS * distance**2), 0.0))


@pytest.fixture(scope="module")
def run():
    return invented()


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
        phase, t = phases(run), run["time"].values
        middle = (t % 1.0 > 0.02) & (t % 1.0 < 0.98)
        for k, expected in enumerate((0, PIVOT, FLIGHT, -1)):
            assert set(phase[(np.floor(t) == k) & middle]) == {expected}
        touching = run.copy(deep=True)
        touching["gap_2"][150] = 0.0
        np.testing.assert_array_equal(phases(touching), phase)

    def test_closed_contacts_have_friction_by_accelerations_and_open_ones_none(self, run):
        found, _ = ring_history(run)
        # Where parts of the run meet, forces belong to one of them.
        ok = (run["time"].values % 1.0 > 0.02) & (run["time"].values % 1.0 < 0.98) & (run["omega"].values != 0.0)
        for k in (1, 2):
            np.testing.assert_allclose(found[f"friction_{k}"][ok], run[f"true_{k}"][ok], rtol=1e-6, atol=1e-9)
        assert ok.mean() > 0.9

    @pytest.mark.parametrize("time", [0.5, 1.5, 2.5, 3.7])
    def test_polar_view_has_balls_in_place_and_forces_at_closed_contacts_only(self, run, time):
        axes = ax()
        plots.polar_view(run, time, axes)
        now = run.isel(time=int(np.flatnonzero(run["time"] == time)[0]))
        balls = [patch for patch in axes.patches if isinstance(patch, Circle)]
        reactions, frictions, weight = (artist for artist in axes.collections if isinstance(artist, Quiver))
        centres = balls_of(float(now["phi"]), float(now["x"]), float(now["y"]))
        for k, (ball, centre) in enumerate(zip(balls, centres, strict=True), start=1):
            np.testing.assert_allclose(ball.center, centre, atol=1e-9)
            closed = float(now[f"gap_{k}"]) == 0.0
            assert (np.hypot(reactions.U[k - 1], reactions.V[k - 1]) > 0.0) == closed
            assert closed or np.hypot(frictions.U[k - 1], frictions.V[k - 1]) == 0.0
        np.testing.assert_allclose(weight.get_offsets()[0], [now["x"], now["y"]], atol=1e-12)
        assert axes.get_title().endswith({1.5: "one contact open", 2.5: "flight"}.get(time, axes.get_title()))

    def test_particle_in_flight_is_a_ball_a_gap_off_the_race_with_its_weight(self, run):
        scene = {name: SCENE[name] for name in ("ring", "friction", "zone", "drive", "impact", "time")}
        scene |= {"model": "ring-single-contact", "body": {"mass": MASS}}
        alone = run.drop_vars(["gap_2", "normal_2"]).assign_attrs(configuration=json.dumps({"scene": scene}))
        axes = ax()
        plots.polar_view(alone.assign(gap_1=("time", np.full(run.sizes["time"], 0.005))), 2.5, axes)
        (ball,) = (patch for patch in axes.patches if isinstance(patch, Circle))
        *_, weight = (artist for artist in axes.collections if isinstance(artist, Quiver))
        assert np.hypot(*ball.center) == pytest.approx(RADIUS - ball.radius - 0.005)
        np.testing.assert_allclose(weight.get_offsets()[0], ball.center)
        assert axes.get_title().endswith("flight")

    @pytest.mark.slow
    def test_film_moves_the_body_off_the_race_under_a_whole_title(self, run, tmp_path):
        words = (
            "separating (oscillatory), contact 2, t = 1.28478 s, then tumbled, with 8 losses of contact and 178 impacts"
        )
        run = run.assign_attrs(outcome=words)
        plots.save_animation(run, tmp_path / "film.gif", fps=2, duration=2, progress=False)
        assert (tmp_path / "film.gif").stat().st_size > 1000
        figure = _Film(run, 2.0, 1.0)
        figure.draw_without_rendering()
        (title,) = (text for text in figure.findobj(Text) if text.get_text().startswith("separating"))
        box = title.get_window_extent()
        assert figure.subfigs[1].bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1


class TestHistory:
    def test_panels_below_show_gaps_and_impacts_and_all_shade_open_contacts(self, run):
        figure = plots.history(run)
        gaps, impacts = figure.axes[4:6]
        assert gaps.get_ylabel() == "gap (mm)"
        assert impacts.get_ylabel().startswith("impact speed")
        assert impacts.get_yscale() == "log"
        assert len(plots.history_panel(run, "impact_speed", ax()).lines) == 2
        assert entries(figure.axes[0]) == ["stick", "one contact open", "flight"]
        marks = {line.get_label(): line.get_xydata().tolist() for line in impacts.lines}
        # The third impact is weaker than is shown.
        assert marks == {"contact 1": [[3.0, 0.1]], "contact 2": [[2.0, 0.4]]}
        for axes in figure.axes[:6]:
            spans = [path.get_extents() for shading in axes.collections for path in shading.get_paths()]
            found = sorted((round(span.x0, 1), round(span.x1, 1)) for span in spans if np.isfinite(span.x0))
            assert found == [(0.0, 1.0), (1.0, 2.0), (2.0, 3.0)]

    def test_separation_is_marked_where_it_is_and_a_part_after_it_has_no_mark(self, run):
        (mark,) = (line for line in plots.history(run).axes[3].lines if line.get_marker() == "o")
        assert mark.get_xdata().tolist() == [1.0]
        after = plots.history(run.sel(time=slice(1.5, 3.8))).axes
        assert not [line for line in after[3].lines if line.get_marker() == "o"]
        assert after[5].get_xlim() == (1.5, pytest.approx(3.8, abs=0.02))

    @pytest.mark.parametrize("width", [85, 170])
    def test_nothing_of_a_printed_history_is_cut_off(self, run, width):
        plots.style("print", width=width)
        figure = plots.history(run.assign(t_separation=1.285))
        figure.draw_without_rendering()
        plots.style()
        for axes in figure.axes:
            for artist in filter(None, [axes.xaxis.label, axes.yaxis.label, axes.get_legend()]):
                box = artist.get_window_extent()
                assert -1 < box.x0 <= box.x1 < figure.bbox.x1 + 1

    def test_laws_have_a_panel_for_the_gap_of_each_contact(self, run):
        one = run.drop_dims("impact").drop_vars(["aftermath", "regime"])
        both = xr.concat([one, one], xr.DataArray(["stiction", "coulomb"], dims="friction_law", name="friction_law"))
        titles = [axes.get_title(loc="left") for axes in plots.history(both).axes]
        assert titles.count("contact 1") == titles.count("contact 2") == 2


def test_phase_portrait_names_pivot_flight_and_velocity_jumps_at_impacts(run):
    axes = plots.phase_portrait(run, ax=ax())
    assert {"stick", "slip backward", "one contact open", "flight", "impact"} <= set(entries(axes))
    lines = [line for line in axes.lines if line.get_linewidth() == 0.6]
    (jumps,) = (line.get_xydata() for line in lines)
    jumps = jumps[np.isfinite(jumps).all(axis=1)].reshape(-1, 2, 2)
    # At an impact the angle holds and the velocity does not.
    assert (np.ptp(jumps[:, :, 0], axis=1) < 1e-9).sum() >= len(IMPACT_TIMES)
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
