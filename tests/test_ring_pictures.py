"""Polar view, phase portrait and animation show positions and forces of the run."""

import base64
import io
import json
import os
import re

import matplotlib
import numpy as np
import pytest
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Wedge
from matplotlib.quiver import Quiver
from PIL import Image
from refusals import refused

import ringsweep
from ringsweep import plots
from ringsweep.cli import main
from ringsweep.models import MODELS
from ringsweep.plots import films
from ringsweep.plots.rig import ring_history

RADIUS, BALL, HALF_DISTANCE = 0.043378, 0.010, 0.025
BETA = np.arcsin(HALF_DISTANCE / (RADIUS - BALL))
WEIGHT = 0.076 * 9.81


@pytest.fixture(scope="module")
def run(scene):
    """Run of the paper's Fig. 29 with law `stiction`: it sticks and slips until contact 2 separates."""
    return ringsweep.simulate(scene)


@pytest.fixture
def other(run):
    """The run with a changed scene in its attribute `configuration`."""

    def change(**changes):
        scene = json.loads(run.attrs["configuration"])["scene"]
        scene = {name: part for name, part in (scene | changes).items() if part is not None}
        return run.assign_attrs(configuration=json.dumps({"scene": scene}))

    return change


@pytest.fixture
def ax():
    return Figure(figsize=(7, 5)).add_subplot()


def at(run, time):
    """Values of the first sample at or after a time, by variable."""
    k = int(np.searchsorted(run["time"], time))
    return {name: float(data[k]) for name, data in run.items() if data.dims == ("time",)} | {"time": float(run.time[k])}


def arrows(ax):
    """Starts and vectors of the arrows of reactions, friction forces and weight."""
    found = [artist for artist in ax.collections if isinstance(artist, Quiver)]
    return [(np.asarray(q.get_offsets()), np.column_stack([q.U, q.V])) for q in found]


def scale_bars(ax):
    """What each scale bar is for, and newtons or millimetres for each metre of the picture."""
    for line in ax.lines:
        if line.get_marker() == "|":
            (left, right), (y, _) = line.get_data()
            near = [text for text in ax.texts if text.get_position()[0] == pytest.approx((left + right) / 2)]
            above, below = sorted(near, key=lambda text: -text.get_position()[1])
            assert above.get_position()[1] > y > below.get_position()[1]
            yield below.get_text(), float(above.get_text().split()[0]) / (right - left)


def place(angle, radius=RADIUS):
    return radius * np.array([np.sin(angle), -np.cos(angle)])


class TestHistory:
    def test_history_has_the_angle_of_the_ring(self, run):
        t = run["time"].values
        np.testing.assert_allclose(run["theta"], 2.0 * (t * np.arctan(t) - 0.5 * np.log1p(t * t)), rtol=1e-12)
        assert run["theta"].attrs["units"] == "rad"

    def test_friction_forces_obey_the_law_in_slip_and_in_stick(self, run):
        found, _ = ring_history(run)
        for k in (1, 2):
            zone, mode = found[f"zone_{k}"].values, found["mode"].values
            friction, normal = found[f"friction_{k}"].values, found[f"normal_{k}"].values
            slips = mode != 0
            expected = -mode * np.where(zone > 0, 0.3, 0.1) * normal
            # An event may store two states of one instant, but only one of them has the mode.
            agrees = np.isclose(friction, expected, rtol=1e-6, atol=1e-9)[slips]
            assert agrees.mean() > 0.99
            sticks = np.abs(friction)[~slips] <= (np.where(zone > 0, 0.5, 0.2) * normal)[~slips] + 1e-9
            assert sticks.mean() > 0.99


class TestPolarView:
    TIMES = (0.3, 1.2, 2.6, 3.4)

    @pytest.mark.parametrize("time", TIMES)
    def test_body_ring_and_forces_are_where_the_run_has_them(self, run, ax, time):
        now = at(run, time)
        plots.polar_view(run, now["time"], ax)
        balls = [patch for patch in ax.patches if isinstance(patch, Circle)]
        # The balls touch the ring.
        for ball, side in zip(balls, (-1, 1), strict=True):
            np.testing.assert_allclose(ball.center, place(now["phi"] + side * BETA, RADIUS - BALL), atol=1e-9)
            assert ball.radius == BALL
        *_, arc = (patch for patch in ax.patches if isinstance(patch, Wedge))
        # Matplotlib counts angles from the horizontal.
        ends = np.degrees(now["theta"]) + np.array([-15.0, 15.0])
        np.testing.assert_allclose([arc.theta1 + 90.0, arc.theta2 + 90.0], ends, atol=1e-9)
        (begin, reach), (same, friction), (centre, weight) = arrows(ax)
        # Reactions point inwards and have the scale of the weight.
        scale = -weight[0, 1] / WEIGHT
        assert weight[0, 0] == 0.0
        np.testing.assert_allclose(centre[0], place(now["phi"], (RADIUS - BALL) * np.cos(BETA)), atol=1e-9)
        np.testing.assert_array_equal(begin, same)
        for k, side in ((1, -1), (2, 1)):
            angle = now["phi"] + side * BETA
            np.testing.assert_allclose(begin[k - 1], place(angle), atol=1e-9)
            np.testing.assert_allclose(reach[k - 1], -place(angle, scale * now[f"normal_{k}"]), atol=1e-9)
            assert friction[k - 1] @ reach[k - 1] == pytest.approx(0.0, abs=1e-12)

    def test_friction_arrows_oppose_slip_and_have_the_scale_of_their_bar(self, run, ax):
        backward = at(run.isel(time=run["mode"] == -1), 1.0)
        plots.polar_view(run, backward["time"], ax)
        (begin, _), (_, friction), _ = arrows(ax)
        (_, bar), *_ = (one for one in scale_bars(ax) if one[0].startswith("$F$ ("))
        for k in (0, 1):
            forwards = np.array([-begin[k, 1], begin[k, 0]]) / RADIUS
            assert friction[k] @ forwards > 0.0
        mu = 0.3 if backward["zone_1"] else 0.1
        newtons = np.linalg.norm(friction[0]) * bar
        assert newtons == pytest.approx(mu * backward["normal_1"], rel=1e-6)

    def test_scale_bars_have_the_scale_of_arrows_and_lengths(self, run, ax):
        plots.polar_view(run, 1.0, ax)
        (_, _), _, (_, weight) = arrows(ax)
        bars = dict(scale_bars(ax))
        assert bars["$N$, $Mg$"] == pytest.approx(WEIGHT / -weight[0, 1])
        assert bars[""] == pytest.approx(1000.0)
        # The bar of friction tells how much longer its arrows are.
        (text,) = (name for name in bars if name.startswith("$F$"))
        assert bars["$N$, $Mg$"] / bars[text] == pytest.approx(float(re.search(r"(\d+)\)", text)[1]))

    def test_mark_is_at_the_angle_of_the_ring_and_an_arrow_shows_its_rotation(self, run, ax):
        for time, sense in ((1.2, 1.0), (1.2, -1.0), (1.2, 0.0)):
            ax.clear()
            plots.polar_view(run.assign(ring_omega=abs(run["ring_omega"]) * sense), time, ax)
            theta = float(np.interp(time, run["time"], run["theta"]))
            mark, head = (patch for patch in ax.patches if isinstance(patch, Polygon))
            np.testing.assert_allclose(mark.get_xy()[0], place(theta, 1.12 * RADIUS), atol=1e-12)
            assert head.get_visible() == (sense != 0.0)
            if sense:
                ahead = place(theta + np.pi / 2) @ head.get_xy()[0]
                assert np.sign(ahead) == sense

    def test_title_has_time_and_mode_and_the_time_may_have_a_unit(self, run, ax):
        stick = at(run.isel(time=run["mode"] == 0), 0.5)
        assert plots.polar_view(run, stick["time"], ax).get_title() == f"t = {stick['time']:.4f} s, stick"
        assert plots.polar_view(run, "1200 ms", ax).get_title().startswith("t = 1.2000 s")
        for time, told in (
            ("3 m", "has the wrong unit: time is in s"),
            *((time, "not within the run") for time in (-0.1, 3.9, np.nan)),
        ):
            refused(told, plots.polar_view, run, time, ax)


class TestPhasePortrait:
    def test_portrait_shows_the_curves_of_ring_and_body(self, run, ax):
        assert plots.phase_portrait(run, ax=ax) is ax
        lines = {line.get_label(): line for line in ax.get_legend().get_lines()}
        assert {"speed of the ring", "slip backward", "stick", "a contact on zone", "start", "end"} <= set(lines)
        drawn = [line.get_xydata() for line in ax.lines]
        ring = np.column_stack([np.degrees(run["phi"]), run["ring_omega"]])
        assert any(len(points) == len(ring) and np.allclose(points, ring) for points in drawn)
        body = np.column_stack([np.degrees(run["phi"]), run["omega"]])[run["mode"] == 0]
        stick = next(line for line in ax.lines if line.get_linewidth() > 2 and line.get_color() == "black")
        shown = stick.get_xydata()[~np.isnan(stick.get_xydata()[:, 1])]
        assert {tuple(point) for point in body} <= {tuple(point) for point in shown}

    def test_bands_of_a_portrait_agree_with_the_zones_of_the_history(self, run, ax):
        plots.phase_portrait(run, "ring", ax)
        psi = np.degrees(run["phi"] - run["theta"]).values
        under = np.zeros((2, len(psi)), dtype=bool)
        for patch in ax.patches:
            if patch.get_hatch():
                own = (patch.get_x() <= psi) & (psi < patch.get_x() + patch.get_width())
                under[int("/" not in patch.get_hatch())] |= own
        for row, zone in zip(under, ("zone_1", "zone_2"), strict=True):
            assert np.mean(row == (run[zone].values > 0)) > 0.995

    def test_portrait_of_many_turns_is_wrapped_without_lines_across(self, run, ax):
        spun = run.assign(phi=run["phi"] * 20.0)
        plots.phase_portrait(spun, ax=ax)
        assert ax.get_xlim() == (-180.0, 180.0)
        for line in ax.lines:
            if line.get_linestyle() not in ("None", ""):
                steps = np.abs(np.diff(line.get_xdata()))
                assert not (steps > 180.0).any()

    def test_portrait_of_a_ring_at_rest_has_bands_in_space(self, run, other, ax):
        still = other().assign(theta=run["theta"] * 0.0, ring_omega=run["ring_omega"] * 0.0)
        plots.phase_portrait(still, ax=ax)
        assert any(patch.get_hatch() for patch in ax.patches)
        assert not any(isinstance(artist, PolyCollection) for artist in ax.collections)

    @pytest.mark.parametrize(("angles", "name", "unit"), [("deg", "(°)", np.pi / 180.0), ("rad", "(rad)", 1.0)])
    def test_portrait_axes_have_names_and_units_in_both_frames(self, run, angles, name, unit):
        plots.style(angles=angles)
        for frame, start in (("space", run["phi"][0]), ("ring", run["phi"][0] - run["theta"][0])):
            drawn = plots.phase_portrait(run, frame, Figure().add_subplot())
            assert drawn.get_xlabel().endswith(name)
            assert "(rad s$^{-1}$)" in drawn.get_ylabel()
            begins = next(line for line in drawn.lines if line.get_marker() == "s").get_xdata()[0]
            assert begins * unit == pytest.approx(float(start))
        plots.style()
        (slide,) = drawn.child_axes
        assert slide.get_ylabel() == "sliding velocity (m s$^{-1}$)"
        refused("neither 'space' nor 'ring'", plots.phase_portrait, run, "body")


@pytest.mark.parametrize(
    "draw",
    [plots.phase_portrait, lambda ds: plots.polar_view(ds, 1.0), plots.animation],
    ids=["phase", "polar", "film"],
)
def test_pictures_of_a_ring_refuse_other_datasets(run, draw):
    for ds, told in (
        (run.drop_vars("phi"), r"has no x|belt"),
        (run.isel(time=0), "history of a run"),
        (run.drop_vars("theta"), r"theta.*run it again"),
        (run.drop_attrs(), "configuration"),
        (run.expand_dims(friction_law=["coulomb", "dahl"]), r"coulomb, dahl: choose one.*sel\(friction_law"),
    ):
        refused(told, draw, ds)


class Recorder(AbstractMovieWriter):
    """Keeps title, reactions and time covered of each frame."""

    def setup(self, fig, outfile, dpi=None):
        super().setup(fig, outfile, dpi)
        self.frames = []

    def grab_frame(self, **_):
        (ax,) = (axes for axes in self.fig.axes if axes.get_title())
        (_, reach), *_ = arrows(ax)
        cover = self.fig.axes[-1].patches[-1]
        self.frames.append((ax.get_title(), reach.copy(), cover.get_x()))

    def finish(self):
        pass


class TestAnimation:
    def test_animation_has_frames_at_equal_times_over_the_whole_run(self, run, tmp_path):
        film, recorder = plots.animation(run, fps=5, duration=2.0), Recorder()
        film.save(tmp_path / "film", writer=recorder)
        times = np.linspace(0.0, float(run["time"][-1]), 10)
        assert len(recorder.frames) == 10
        scale = np.linalg.norm(recorder.frames[0][1][0]) / float(run["normal_1"][0])
        for (title, reach, covered), time in zip(recorder.frames, times, strict=True):
            assert title.startswith(f"t = {time:.4f} s, ")
            assert covered == time
            assert np.linalg.norm(reach[0]) / scale == pytest.approx(np.interp(time, run["time"], run["normal_1"]))

    def test_animation_says_how_fast_it_is_and_changes_no_global_setting(self, run):
        before = dict(matplotlib.rcParams)
        film = films._Film(run, 25.0, 2.0 * float(run["time"][-1]))
        assert dict(matplotlib.rcParams) == before
        assert film.subfigs[0].get_suptitle() == "2 times slower than real"
        assert films._speed(4.0, 4.0) == "real time"
        assert films._speed(30.0, 10.0) == "3 times faster than real"

    @pytest.mark.slow
    def test_frame_of_a_film_equals_the_whole_picture(self, run, tmp_path):
        plots.save_animation(run, tmp_path / "run.gif", fps=5, duration=1.0)
        film, whole = films._Film(run, 5.0, 1.0), io.BytesIO()
        film.show_frame(3)
        Figure.savefig(film, whole, format="png", dpi=100)
        with Image.open(tmp_path / "run.gif") as frames, Image.open(whole) as picture:
            assert (frames.n_frames, frames.info["duration"]) == (5, 200)
            frames.seek(3)
            pixels = [np.asarray(one.convert("RGB")).astype(int) for one in (frames, picture)]
        assert np.mean(np.abs(pixels[0] - pixels[1]) > 40) < 2e-3

    def test_animation_is_written_as_a_page_that_needs_no_other_file(self, run, tmp_path):
        plots.save_animation(run, tmp_path / "run.HTML", fps=10, duration=0.3)
        page = (tmp_path / "run.HTML").read_text(encoding="utf-8")
        frames = re.findall(r'"data:image/png;base64,([^"]*)"', page)
        assert len(frames) == 3
        with Image.open(io.BytesIO(base64.b64decode(frames[0].replace("\\", "")))) as frame:
            assert (frame.size, frame.convert("RGB").getpixel((0, 0))) == ((1080, 540), (255, 255, 255))
        assert not re.search("https?:|<link|<i ", page)
        assert all(sign in page for sign in "▶⏸⏮⏭")
        assert os.listdir(tmp_path) == ["run.HTML"]

    @pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason="ffmpeg is not installed")
    def test_animation_is_written_as_mp4(self, run, tmp_path):
        plots.save_animation(run, tmp_path / "run.mp4", fps=10, duration=0.3)
        assert (tmp_path / "run.mp4").read_bytes()[4:8] == b"ftyp"

    def test_animation_refuses_wrong_files_rates_and_durations(self, run, tmp_path, monkeypatch):
        monkeypatch.setattr(FFMpegWriter, "isAvailable", lambda: False)
        refused(r"ffmpeg.*not installed; \.gif and \.html", plots.save_animation, run, tmp_path / "run.mp4")
        for name in ("run.avi", "run", "nowhere/run.gif"):
            refused(r"run", plots.save_animation, run, tmp_path / name)
        for wrong in ({"fps": 0}, {"duration": -1.0}, {"duration": np.inf}):
            refused("not a number greater than 0", plots.animation, run, **wrong)


class TestCommand:
    @pytest.fixture
    def folder(self, scene, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "case.yaml").write_text(json.dumps({"scene": scene}))
        return tmp_path

    def test_animate_refuses_before_the_run(self, scene, folder, monkeypatch, capsys):
        monkeypatch.setattr("ringsweep.runs.simulate.history", lambda config: pytest.fail("the run was made"))
        for output in ("run.avi", "nowhere/run.gif"):
            assert main(["animate", "case.yaml", "-o", output]) == 2
            assert output in capsys.readouterr().err
        assert os.listdir(folder) == ["case.yaml"]
        laws = {"sweep": {"grid": {"friction.law": ["stiction", "coulomb"]}}}
        (folder / "laws.yaml").write_text(json.dumps({"scene": scene} | laws))
        assert main(["animate", "laws.yaml"]) == 2
        assert "--set friction.law=" in capsys.readouterr().err
        monkeypatch.setattr(type(MODELS["ring"]), "driven", ())
        assert main(["animate", "case.yaml"]) == 2
        assert "ring: no ring or belt to animate" in capsys.readouterr().err
