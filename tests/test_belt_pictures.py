"""Phase portrait, friction loop and film of a body on a belt show places, velocities and forces of the run."""

import numpy as np
import pytest
from belts import on_belt
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.quiver import Quiver
from refusals import refused

import ringsweep
from ringsweep import plots
from ringsweep.plots import films
from ringsweep.plots.look import PAIR_COLOURS
from ringsweep.plots.phase import _MODE_STYLES

# m = 1 kg, k = 2 N/m, so the natural frequency is sqrt(2).
LOAD, STIFFNESS, BELT = 9.81, 2.0, 0.1
STICK = _MODE_STYLES[0]["color"]


def belt(friction, span=20.0, **changes):
    return on_belt({"mu_s": 0.15, "mu_k": 0.1} | friction, STIFFNESS, velocity=BELT, span=span) | changes


@pytest.fixture(scope="module")
def run():
    """Stick-slip: slip from x = 0.73575 m, at mu_k F_N/k = 0.4905 m below the apex of the orbit."""
    return ringsweep.simulate(belt({"law": "stiction"}))


@pytest.fixture(scope="module")
def rocking():
    """A body that sticks and slips on a belt that moves to and fro."""
    drive = {"law": "sinusoidal", "amplitude": 0.3, "frequency": 0.25}
    spring = {"stiffness": 10.0, "cubic": 0.0}
    return ringsweep.simulate({**belt({"law": "stiction"}), "belt": {}, "drive": drive, "spring": spring})


@pytest.fixture(scope="module")
def lugre():
    """The paper's law with bristles, from rest: the belt hits the bristles with 31 N."""
    law = {"law": "lugre", "v_s": 1e-3, "sigma0": 1e5, "sigma1": 316.2278, "sigma2": 0.1}
    return ringsweep.simulate(belt(law, initial={"velocity": 0.0}))


@pytest.fixture
def ax():
    return Figure(figsize=(7, 5)).add_subplot()


def drawn(ax, colour=None):
    """Points of the curves drawn for friction modes, without their gaps; by default of all modes."""
    colours = [style["color"] for style in _MODE_STYLES.values()] if colour is None else [colour]
    lines = [line for line in ax.lines if line.get_color() in colours and line.get_linestyle() == "-"]
    points = np.concatenate([line.get_xydata() for line in lines])
    return points[np.isfinite(points).all(axis=1)]


def energy(run):
    """Energy of body and spring, J."""
    return 0.5 * run.velocity**2 + 0.5 * STIFFNESS * run.x**2


class TestHistory:
    @pytest.mark.slow
    def test_history_has_place_and_velocity_of_the_belt(self, run, rocking):
        t = run.time.values
        np.testing.assert_allclose(run.belt_x, BELT * t, rtol=1e-14)
        np.testing.assert_allclose(run.belt_velocity, BELT, rtol=0)
        phase = 0.5 * np.pi * rocking.time.values
        np.testing.assert_allclose(rocking.belt_x, 0.3 * np.sin(phase), atol=1e-12)
        np.testing.assert_allclose(rocking.belt_velocity, 0.15 * np.pi * np.cos(phase), atol=1e-12)
        assert (run.belt_x.attrs["units"], run.belt_velocity.attrs["units"]) == ("m", "m s-1")

    def test_panel_of_the_velocity_shows_that_of_the_belt_too(self, rocking):
        _, belt = plots.history(rocking).axes[1].lines
        np.testing.assert_allclose(belt.get_ydata(), 0.15 * np.pi * np.cos(0.5 * np.pi * belt.get_xdata()), atol=5e-3)
        assert belt.get_label() == "belt"


class TestPortrait:
    def test_stick_lies_at_the_speed_of_the_belt_and_slip_on_a_circle(self, run, ax):
        plots.phase_portrait(run, ax=ax)
        stick = drawn(ax, STICK)
        np.testing.assert_allclose(stick[:, 1], BELT, atol=1e-12)
        assert stick[:, 0].max() == pytest.approx(0.15 * LOAD / STIFFNESS, rel=1e-9)
        slip = drawn(ax, _MODE_STYLES[-1]["color"])
        apart = np.hypot(slip[:, 0] - 0.1 * LOAD / STIFFNESS, slip[:, 1] / np.sqrt(STIFFNESS))
        np.testing.assert_allclose(apart, np.hypot(0.05 * LOAD / STIFFNESS, BELT / np.sqrt(STIFFNESS)), rtol=1e-6)
        (speed,) = {tuple(line.get_ydata()) for line in ax.lines if line.get_linestyle() == "--"}
        assert speed == (BELT, BELT)

    def test_stick_on_a_belt_of_changing_speed_lies_on_the_curve_of_the_belt(self, rocking, ax):
        plots.phase_portrait(rocking, ax=ax)
        assert {"stick", "slip forward", "slip backward"} <= {text.get_text() for text in ax.get_legend().get_texts()}
        curve = next(line for line in ax.lines if line.get_color() == PAIR_COLOURS[1]).get_xydata()
        np.testing.assert_array_equal(curve, np.column_stack([rocking.x, rocking.belt_velocity]))
        order = np.round(curve, 9).tolist()
        stick = np.round(drawn(ax, STICK), 9).tolist()
        assert set(map(tuple, stick)) <= set(map(tuple, order))

    def test_portrait_has_names_and_units_and_no_frame_of_a_ring(self, run, ax):
        plots.phase_portrait(run, ax=ax)
        assert ax.get_xlabel() == "displacement (m)"
        assert ax.get_ylabel() == "velocity (m s$^{-1}$)"
        small = run.assign({name: 1e-5 * run[name] for name in ("x", "velocity", "belt_velocity")})
        plots.phase_portrait(small, ax=(below := Figure().add_subplot()))
        assert below.get_xlabel() == "displacement (µm)"
        assert below.xaxis.get_major_formatter()(5e-6, 0) == "5"
        refused(r"frame: 'ring'.*belt", plots.phase_portrait, run, "ring", ax)


class TestFrictionLoop:
    def test_law_without_memory_gives_one_curve_and_a_vertical_line_in_stick(self, run, ax):
        plots.friction_loop(run, ax=ax)
        stick, slip = drawn(ax, STICK), drawn(ax, _MODE_STYLES[-1]["color"])
        np.testing.assert_allclose(stick[:, 0], 0.0, atol=1e-12)
        assert stick[:, 1].min() == pytest.approx(-0.15 * LOAD, rel=1e-9)
        np.testing.assert_allclose(slip[slip[:, 0] < -1e-9, 1], -0.1 * LOAD, rtol=1e-12)
        assert ax.get_xlabel() == "sliding velocity (m s$^{-1}$)"
        assert ax.get_ylabel() == "friction force (N)"

    def test_inset_shows_the_loop_of_bristles_and_is_absent_without_memory(self, run, lugre, ax):
        plots.friction_loop(lugre, ax=ax)
        (inset,) = ax.child_axes
        assert inset.get_xlim()[1] == pytest.approx(0.02 * np.abs(lugre.velocity - lugre.belt_velocity).max())
        assert inset.get_ylim() == ax.get_ylim()
        assert not plots.friction_loop(run, ax=Figure().add_subplot()).child_axes

    @pytest.mark.parametrize("name", ["run", "lugre"])
    def test_area_under_force_over_distance_is_the_energy_that_friction_takes(self, name, request, ax):
        run = request.getfixturevalue(name).sel(time=slice(5.0, 19.0))
        plots.friction_loop(run, "distance", ax)
        area = 0.0
        for line in ax.lines:
            if line.get_linestyle() == "-":
                across, up = line.get_xydata().T
                area += np.nansum(0.5 * (up[1:] + up[:-1]) * np.diff(across))
        # The belt puts in what friction does not take: m d2x/dt2 = -k x - F.
        work = -BELT * np.trapezoid(run.friction_force, run.time)
        assert area == pytest.approx(work - float(energy(run)[-1] - energy(run)[0]), rel=1e-4)
        assert area > 0.5
        assert ax.get_xlabel() == "distance slid on the belt (m)"

    def test_unknown_axis_and_a_ring_are_refused(self, run, ax):
        refused("neither 'velocity' nor 'distance'", plots.friction_loop, run, "place", ax)
        refused("there is no belt", plots.friction_loop, run.rename(x="phi"), ax=ax)


@pytest.mark.parametrize("draw", [plots.phase_portrait, plots.friction_loop, plots.animation])
def test_pictures_of_a_belt_refuse_runs_without_its_motion(run, draw):
    refused(r"no belt_velocity.*run it again", draw, run.drop_vars("belt_velocity"))


@pytest.fixture(scope="module")
def film(run):
    """250 frames over 20 s."""
    return films._Film(run, 25.0, 10.0)


class TestFilm:
    @pytest.mark.parametrize("k", [0, 60, 110, 200])
    def test_frame_shows_body_spring_belt_and_friction_at_its_instant(self, film, run, k):
        film.show_frame(k)
        time = 20.0 * k / 249
        x, velocity, force = (np.interp(time, run.time, run[name]) for name in ("x", "velocity", "friction_force"))
        above, below = film.body.ax, film.subfigs[0].axes[1]
        assert above.get_xlim() == below.get_xlim()
        body = max((patch for patch in above.patches if isinstance(patch, Rectangle)), key=lambda patch: patch.zorder)
        assert body.get_x() + 0.5 * body.get_width() == pytest.approx(x)
        spring = film.body.spring.get_xdata()
        assert spring[0] == film.body.wall < run.x.min()
        assert spring[-1] == pytest.approx(body.get_x())
        marks = film.body.marks.get_xdata()[::3]
        offset = (marks - BELT * time) / np.diff(marks).mean()
        np.testing.assert_allclose(offset, np.round(offset), atol=1e-9)
        (dot,) = film.body.dot.get_xydata()
        np.testing.assert_allclose(dot, [x, velocity], atol=1e-12)
        (arrow,) = (artist for artist in above.collections if isinstance(artist, Quiver))
        bar = next(line for line in above.lines if line.get_marker() == "|")
        newtons = next(float(text.get_text().split()[1]) for text in above.texts if text.get_text().endswith(" N"))
        assert arrow.U[0] / np.ptp(bar.get_xdata()) * newtons == pytest.approx(-force)
        assert above.get_title().startswith(f"t = {time:.4f} s, ")
        sign = "+" if velocity >= 0 else "\N{MINUS SIGN}"
        assert film.body.speeds.get_text() == f"body {sign}{abs(velocity):.3f} m s⁻¹, belt +0.100 m s⁻¹"
