"""A run as an animation: the body in the ring beside its history."""

from __future__ import annotations

import base64
import io
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, FuncAnimation
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray
from PIL import Image

from ringsweep.errors import InputError
from ringsweep.plots.histories import TOGETHER, draw_panel
from ringsweep.plots.ring import Rig, Stage, instants, run_of
from ringsweep.plots.style import SMALL, label_of
from ringsweep.storage import netcdf

#: Kinds of file that `save_animation` writes.
FILMS = (".mp4", ".gif", ".html")

# Even numbers of pixels, as video has them.
_SIZE, _DPI = (10.8, 5.4), 100


def animation(ds: xr.Dataset, *, fps: float = 25.0, duration: float = 10.0) -> FuncAnimation:
    """The body in the ring, with friction zones and reactions, beside its history as it runs.

    Frames are at equal times, the first at the beginning of the run and the last at its end. In a notebook
    ``IPython.display.HTML(animation(ds).to_jshtml())`` shows it; to write a file :func:`save_animation` is faster.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.simulate` on a ring.
    fps : float
        Frames per second.
    duration : float
        How long it lasts, s; the title says how much slower or faster than the run that is.

    Returns
    -------
    matplotlib.animation.FuncAnimation
        It must be kept in a variable for as long as it is to run.

    Raises
    ------
    InputError
        If the dataset is not the history of one run on a ring, or a number is not positive.

    Examples
    --------
    >>> import ringsweep
    >>> run = ringsweep.simulate("my-sweep.yaml")
    >>> "<img" in animation(run, fps=5, duration=1).to_jshtml()
    True
    """
    return _Film(ds, fps, duration).animation()


def save_animation(ds: xr.Dataset, path: str | os.PathLike[str], *, fps: float = 25.0, duration: float = 10.0) -> None:
    """Write the animation of a run, whole or not at all; see :func:`animation`.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.simulate` on a ring.
    path : path-like
        File to be written or replaced. Its suffix decides its kind: ``.mp4`` (which needs ffmpeg), ``.gif``, or
        ``.html``, a page with buttons that needs no other file.
    fps : float
        Frames per second.
    duration : float
        How long it lasts, s.

    Raises
    ------
    InputError
        If the suffix is unknown, ffmpeg is missing, `path` cannot be written, or as for :func:`animation`.

    Examples
    --------
    >>> import ringsweep
    >>> run = ringsweep.simulate("my-sweep.yaml")
    >>> save_animation(run, "run.mp3")
    Traceback (most recent call last):
    ringsweep.errors.InputError: run.mp3: animations end in .mp4, .gif, .html, not in '.mp3'
    """
    check_animation(path)
    film = _Film(ds, fps, duration)
    kind = Path(path).suffix.lower()
    with netcdf.replacing(path) as temporary, film.painted():
        film.animation().save(temporary, writer=_writer(kind, fps), dpi=_DPI)


def check_animation(path: str | os.PathLike[str]) -> None:
    """Make sure that an animation can be written to `path`, before a run is made for it.

    Raises
    ------
    InputError
        If its suffix is unknown, ffmpeg is missing, or the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FILMS:
        raise InputError(str(path), f"animations end in {', '.join(FILMS)}, not in {suffix or 'nothing'!r}")
    if suffix == ".mp4" and not FFMpegWriter.isAvailable():
        raise InputError(str(path), "ffmpeg, which writes .mp4, is not installed; .gif and .html do without it")
    netcdf.check_writable(path)


class _Screen(Figure):
    """A figure of which one picture can stand in for what does not move: a frame then takes a fraction of the time.

    Attributes
    ----------
    moving : list of Artist
        What is drawn on that picture.
    ground : ndarray of shape ``(height, width, 4)``, optional
        The picture.
    """

    moving: list[Artist]
    ground: NDArray[np.uint8] | None = None

    def draw(self, renderer: Any) -> None:
        """Draw all, or what moves on the ground."""
        if self.ground is None:
            super().draw(renderer)
            return
        context = renderer.new_gc()
        renderer.draw_image(context, 0, 0, self.ground)
        context.restore()
        for artist in sorted(self.moving, key=Artist.get_zorder):
            artist.draw(renderer)


class _Film:
    """An animation's figure, and what moves in it."""

    def __init__(self, ds: xr.Dataset, fps: float, duration: float):
        for name, value in (("fps", fps), ("duration", duration)):
            if not 0.0 < value < np.inf:
                raise InputError(name, f"{value!r} is not a number greater than 0")
        run = run_of(ds)
        self.fps = fps
        time = run["time"].values
        self.state = instants(run, np.linspace(time[0], time[-1], max(2, round(fps * duration))))
        self.figure = _Screen(figsize=_SIZE, dpi=_DPI, layout="constrained")
        parts: Any = self.figure.subfigures(1, 2, width_ratios=[1.0, 1.15])
        left, right = parts
        self.stage = Stage(run, Rig.of(ds))
        self.stage.build(left.add_subplot())
        look: dict[str, Any] = {"ncols": 3, "fontsize": SMALL, "frameon": False, "columnspacing": 1}
        left.legend(handles=self.stage.legend(), loc="outside lower center", **look)
        panels = list(right.subplots(3, 1, sharex=True))
        for panel, names in zip(panels, (["phi"], *map(list, TOGETHER)), strict=True):
            draw_panel(panel, run, [name for name in names if name in run])
        panels[-1].set_xlabel(label_of(run["time"], run))
        self.veils = [_veil(panel) for panel in panels]
        if time[-1] > time[0]:
            panels[0].set_xlim(time[0], time[-1])
        right.align_ylabels(panels)
        right.suptitle(str(ds.attrs.get("outcome", "")), fontsize=10)
        left.suptitle(_pace(float(time[-1] - time[0]), duration), fontsize=10)
        self.figure.moving = [*self.stage.moving, *self.veils]
        self.show(0)
        # Words change from frame to frame: places that followed them would tremble.
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")

    def show(self, k: int) -> list[Artist]:
        """Move all to the `k`-th frame."""
        self.stage.show(self.state, k)
        now = float(self.state["time"][k])
        for veil in self.veils:
            veil.set_x(now)
            veil.set_width(float(self.state["time"][-1]) - now)
        return self.figure.moving

    def animation(self) -> FuncAnimation:
        count = len(self.state["time"])
        return FuncAnimation(self.figure, self.show, frames=count, interval=1000.0 / self.fps)

    @contextmanager
    def painted(self) -> Iterator[None]:
        """Meanwhile only what moves is drawn anew."""
        shown = [artist for artist in self.figure.moving if artist.get_visible()]
        for artist in shown:
            artist.set_visible(False)
        buffer = io.BytesIO()
        self.figure.savefig(buffer, format="rgba", dpi=_DPI)
        for artist in shown:
            artist.set_visible(True)
        width, height = self.figure.canvas.get_width_height()
        # The renderer counts rows from below.
        self.figure.ground = np.frombuffer(buffer.getvalue(), np.uint8).reshape(height, width, 4)[::-1]
        try:
            yield
        finally:
            self.figure.ground = None


def _veil(panel: Axes) -> Rectangle:
    """What covers the part of a history that is yet to come."""
    veil = Rectangle((0.0, 0.0), 0.0, 1.0, transform=panel.get_xaxis_transform(), facecolor="white", alpha=0.8)
    veil.set(zorder=3, edgecolor="0.2", linewidth=1.0)
    panel.add_patch(veil)
    return veil


def _pace(span: float, duration: float) -> str:
    """How fast an animation of a run goes, in words."""
    factor = span / duration
    if abs(factor - 1.0) < 0.005:
        return "real time"
    return f"{factor:.3g} times faster than real" if factor > 1.0 else f"{1.0 / factor:.3g} times slower than real"


class _Frames(AbstractMovieWriter):
    """Frames of one palette, a byte to a pixel: what matplotlib's own writers keep takes several times as much."""

    def setup(self, fig: Figure, outfile: Any, dpi: float | None = None) -> None:
        super().setup(fig, outfile, dpi=dpi)
        self.frames: list[Image.Image] = []

    def grab_frame(self, **options: Any) -> None:
        buffer = io.BytesIO()
        self.fig.savefig(buffer, format="rgba", dpi=self.dpi, **options)
        frame = Image.frombytes("RGBA", self.frame_size, buffer.getvalue()).convert("RGB")
        if self.frames:
            self.frames.append(frame.quantize(palette=self.frames[0], dither=Image.Dither.NONE))
        else:
            self.frames.append(_few_colours(frame))


def _few_colours(frame: Image.Image) -> Image.Image:
    """A picture with a palette in which nothing is nearly, but not quite, of the colour of the ground."""
    few = frame.quantize(256, dither=Image.Dither.NONE)
    palette, ground = np.reshape(few.getpalette() or [], (-1, 3)), np.asarray(frame)[0, 0]
    # Pillow finds the entries of a given palette only about: a white page would come out grey.
    palette[np.abs(palette - ground.astype(int)).max(axis=1) < 8] = ground
    few.putpalette(palette.ravel().tolist())
    return few


class _Gif(_Frames):
    def finish(self) -> None:
        first, *others = self.frames
        first.save(self.outfile, save_all=True, append_images=others, duration=round(1000 / self.fps), loop=0)


class _Page(_Frames):
    """A page with buttons; that of matplotlib takes their signs from the net."""

    def finish(self) -> None:
        texts = []
        for frame in self.frames:
            buffer = io.BytesIO()
            frame.save(buffer, "png")
            texts.append(base64.b64encode(buffer.getvalue()).decode())
        page = (files("ringsweep.plots") / "animation.html").read_text(encoding="utf-8")
        values = {"width": self.frame_size[0], "interval": 1000 / self.fps, "frames": json.dumps(texts)}
        for name, value in values.items():
            page = page.replace(f"{{{name}}}", str(value))
        Path(self.outfile).write_text(page, encoding="utf-8")


def _writer(kind: str, fps: Any) -> AbstractMovieWriter:
    if kind == ".mp4":
        return FFMpegWriter(fps=fps, codec="h264")
    return _Gif(fps=fps) if kind == ".gif" else _Page(fps=fps)
