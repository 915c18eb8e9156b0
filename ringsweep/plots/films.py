"""Animations of runs: the body in the ring or on the belt beside its history."""

from __future__ import annotations

import base64
import io
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
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
from ringsweep.plots.belt import BeltArtists
from ringsweep.plots.datasets import on_ring, outcome, panels_of, require_history
from ringsweep.plots.histories import draw_panel, time_limits
from ringsweep.plots.labels import axis_label
from ringsweep.plots.polar import RingArtists, states_at
from ringsweep.plots.rig import belt_history, ring_history
from ringsweep.plots.saving import suffix_of
from ringsweep.plots.style import LEGEND, SMALL, folded, on_page, page_colour
from ringsweep.runs.executors import progress_bar
from ringsweep.storage.files import check_writable, replacing

#: Suffixes of the files that `save_animation` writes.
FILMS = (".mp4", ".gif", ".html")

# Inches and dots per inch. Codecs of mp4 need even numbers of pixels.
_SIZE, _DPI = (10.8, 5.4), 100

# Number in a palette that stands for "as before".
_CLEAR = 255

# In a page every so many frames there is a whole picture; the frames between hold only what changes.
_WHOLE = 50


def animation(ds: xr.Dataset, *, fps: float = 25.0, duration: float = 10.0) -> FuncAnimation:
    """Animate the body beside its history.

    In a ring the body is shown with zones and forces, on a belt with the friction force and the phase portrait.
    Frames are at equal times from the start to the end of the run. In a notebook
    ``IPython.display.HTML(animation(ds).to_jshtml())`` shows the animation. To write a file,
    :func:`save_animation` is faster.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.simulate`.
    fps : float
        Frames per second.
    duration : float
        Duration of the animation, s. Its title says how much slower or faster than the run it is.

    Returns
    -------
    matplotlib.animation.FuncAnimation
        Keep it in a variable for as long as it runs.

    Raises
    ------
    InputError
        If the dataset is not the history of one run on a ring or a belt, or a number is not positive.

    Examples
    --------
    >>> import ringsweep
    >>> run = ringsweep.simulate("my-sweep.yaml")
    >>> "<img" in animation(run, fps=5, duration=1).to_jshtml()
    True
    """
    return _Film(ds, fps, duration).animation()


def save_animation(
    ds: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    fps: float = 25.0,
    duration: float = 10.0,
    progress: bool = True,
) -> None:
    """Write the animation of a run to a file; see :func:`animation`.

    If writing fails, an older file of that name stays as it was.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.simulate`.
    path : path-like
        File to write or replace. Its suffix decides the format: ``.mp4``, which needs ffmpeg, ``.gif``, or ``.html``,
        a page with buttons that needs no other file.
    fps : float
        Frames per second.
    duration : float
        Duration of the animation, s.
    progress : bool
        Whether to show a progress bar in a terminal or a notebook.

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
    writers: dict[str, Any] = {".mp4": partial(FFMpegWriter, codec="h264"), ".gif": _GifWriter, ".html": _HtmlWriter}
    bar = progress_bar(len(film.states["time"]), progress, unit="frame")
    with replacing(path) as temporary, film.fixed_background(), bar:
        writer = writers[Path(path).suffix.lower()](fps=fps)
        film.animation().save(temporary, writer=writer, dpi=_DPI, progress_callback=lambda *_: bar.update())


def check_animation(path: str | os.PathLike[str]) -> None:
    """Check that an animation can be written to `path`. Call it before a long run.

    Raises
    ------
    InputError
        If the suffix is unknown, ffmpeg is missing, or the file cannot be written.
    """
    if suffix_of(path, FILMS, "animations") == ".mp4" and not FFMpegWriter.isAvailable():
        raise InputError(str(path), "ffmpeg, which writes .mp4, is not installed; .gif and .html need no ffmpeg")
    check_writable(path)


class _FilmFigure(Figure):
    """A figure that can draw its moving artists on a stored picture of all others, several times as fast.

    Attributes
    ----------
    moving : list of Artist
        Artists that change from frame to frame.
    background : ndarray of shape ``(height, width, 4)``, optional
        Picture of the other artists; without it everything is drawn.
    """

    moving: list[Artist]
    background: NDArray[np.uint8] | None = None

    def draw(self, renderer: Any) -> None:
        """Draw everything, or the moving artists on the background."""
        if self.background is None:
            super().draw(renderer)
            return
        context = renderer.new_gc()
        renderer.draw_image(context, 0, 0, self.background)
        context.restore()
        for artist in sorted(self.moving, key=Artist.get_zorder):
            artist.draw(renderer)


class _Film:
    """The figure of an animation and the states that it goes through."""

    def __init__(self, ds: xr.Dataset, fps: float, duration: float):
        for name, value in (("fps", fps), ("duration", duration)):
            if not 0.0 < value < np.inf:
                raise InputError(name, f"{value!r} is not a number greater than 0")
        self.fps = fps
        self.figure = _FilmFigure(figsize=_SIZE, dpi=_DPI, layout="constrained")
        subfigures: Any = self.figure.subfigures(1, 2, width_ratios=[1.0, 1.15])
        left, right = subfigures
        self.body: RingArtists | BeltArtists
        if on_ring(require_history(ds)):
            run, rig = ring_history(ds)
            self.body = RingArtists(left.add_subplot(), run, rig)
        else:
            run = belt_history(ds)
            above, below = left.subplots(2, 1, height_ratios=[1.0, 1.6])
            self.body = BeltArtists(above, below, run)
        time = run["time"].values
        self.states = states_at(run, np.linspace(time[0], time[-1], max(2, round(fps * duration))))
        entries = self.body.legend_entries()
        left.legend(handles=entries, loc="outside lower center", ncols=3, columnspacing=1, **LEGEND)
        shown = [names for names in panels_of(run) if names not in (("epsilon",), ("impact_speed",))]
        panels = list(right.subplots(len(shown), 1, sharex=True))
        for panel, names in zip(panels, shown, strict=True):
            draw_panel(panel, run, names)
            if len(shown) > 3:
                panel.yaxis.label.set_fontsize(SMALL)
        panels[-1].set_xlabel(axis_label(run["time"], run))
        self.futures = [_cover_of_future(panel) for panel in panels]
        if time[-1] > time[0]:
            panels[0].set_xlim(*time_limits(run))
        self.until = time_limits(run)[1]
        right.align_ylabels(panels)
        right.suptitle(folded([outcome(run)], _SIZE[0] * 1.15 / 2.15), fontsize="medium")
        left.suptitle(_speed(float(time[-1] - time[0]), duration), fontsize="medium")
        self.figure.moving = [*self.body.moving, *self.futures]
        self.show(0)
        # Texts change from frame to frame: a layout that followed them would shake.
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")

    def show(self, k: int) -> list[Artist]:
        """Move all moving artists to the `k`-th frame."""
        self.body.show(self.states, k)
        now = float(self.states["time"][k])
        for cover in self.futures:
            cover.set_x(now)
            # At the end nothing of the future is left to cover.
            cover.set_width(self.until - now if k + 1 < len(self.states["time"]) else 0.0)
        return self.figure.moving

    def animation(self) -> FuncAnimation:
        """The animation of matplotlib."""
        count = len(self.states["time"])
        return FuncAnimation(self.figure, self.show, frames=count, interval=1000.0 / self.fps)

    @contextmanager
    def fixed_background(self) -> Iterator[None]:
        """While this context is open, a frame draws only the moving artists anew."""
        visible = [artist for artist in self.figure.moving if artist.get_visible()]
        for artist in visible:
            artist.set_visible(False)
        pixels = _rgba(self.figure, _DPI)
        for artist in visible:
            artist.set_visible(True)
        width, height = self.figure.canvas.get_width_height()
        # The renderer counts rows from the bottom.
        self.figure.background = np.frombuffer(pixels, np.uint8).reshape(height, width, 4)[::-1]
        try:
            yield
        finally:
            self.figure.background = None


def _rgba(figure: Figure, dpi: float, **options: Any) -> bytes:
    """Pixels of a figure, four bytes each, from the top left."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="rgba", dpi=dpi, **options)
    return buffer.getvalue()


def _cover_of_future(panel: Axes) -> Rectangle:
    """Translucent cover of the part of a history that comes after the frame."""
    cover = Rectangle((0.0, 0.0), 0.0, 1.0, transform=panel.get_xaxis_transform(), facecolor=page_colour(), alpha=0.8)
    # Above the marks of a history.
    cover.set(zorder=6, edgecolor=on_page("0.2"), linewidth=1.0)
    panel.add_patch(cover)
    return cover


def _speed(span: float, duration: float) -> str:
    """Speed of an animation of `duration` seconds relative to a run of `span` seconds."""
    factor = span / duration
    if abs(factor - 1.0) < 0.005:
        return "real time"
    return f"{factor:.3g} times faster than real" if factor > 1.0 else f"{1.0 / factor:.3g} times slower than real"


class _PaletteWriter(AbstractMovieWriter):
    """Keeps frames with a common palette, one byte a pixel; matplotlib's own writers keep several times as much."""

    def setup(self, fig: Figure, outfile: Any, dpi: float | None = None) -> None:
        super().setup(fig, outfile, dpi=dpi)
        self.frames: list[Image.Image] = []

    def grab_frame(self, **options: Any) -> None:
        pixels = _rgba(self.fig, self.dpi, **options)
        frame = Image.frombytes("RGBA", self.frame_size, pixels).convert("RGB")
        # The first frame too: colours of its own would make the second one differ everywhere.
        palette = self.frames[0] if self.frames else _with_palette(frame)
        self.frames.append(frame.quantize(palette=palette, dither=Image.Dither.NONE))


def _with_palette(frame: Image.Image) -> Image.Image:
    """A frame with a palette of 255 colours, in which colours close to the background are the background."""
    reduced = frame.quantize(_CLEAR, dither=Image.Dither.NONE)
    palette = np.resize(reduced.getpalette() or [], (256, 3))
    # Without a colour of its own this number would be black.
    palette[_CLEAR] = palette[0]
    background = np.asarray(frame)[0, 0]
    # Pillow only approximates colours of a given palette: a white page would turn grey.
    palette[np.abs(palette - background.astype(int)).max(axis=1) < 8] = background
    reduced.putpalette(palette.ravel().tolist())
    return reduced


class _GifWriter(_PaletteWriter):
    def finish(self) -> None:
        first, *others = self.frames
        first.save(self.outfile, save_all=True, append_images=others, duration=round(1000 / self.fps), loop=0)


class _HtmlWriter(_PaletteWriter):
    """Writes a page with buttons; matplotlib's own page loads icons from the internet."""

    def finish(self) -> None:
        pictures: list[list[Any]] = []
        colours = np.reshape(self.frames[0].getpalette() or [], (-1, 3))
        before = None
        for k, frame in enumerate(self.frames):
            now = np.asarray(frame)
            now = np.where(now == _CLEAR, np.uint8(0), now)
            changed = np.full(now.shape, True) if k % _WHOLE == 0 else now != before
            before = now
            rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
            # A frame in which nothing changes has one clear pixel.
            top, left = (int(found[0]) if len(found) else 0 for found in (rows, columns))
            part = np.s_[top : rows[-1] + 1, left : columns[-1] + 1] if len(rows) else np.s_[:1, :1]
            # Colours that a frame does not use would take a tenth of the page.
            used, numbers = np.unique(np.where(changed, now, np.uint8(_CLEAR))[part], return_inverse=True)
            picture = Image.fromarray(numbers.reshape(now[part].shape).astype(np.uint8))
            picture.putpalette(colours[used].ravel().tolist())
            buffer = io.BytesIO()
            picture.save(buffer, "png", **({"transparency": len(used) - 1} if used[-1] == _CLEAR else {}))
            pictures.append([base64.b64encode(buffer.getvalue()).decode(), left, top])
        page = (files("ringsweep.plots") / "animation.html").read_text(encoding="utf-8")
        width, height = self.frame_size
        values: dict[str, Any] = {"width": width, "height": height, "interval": 1000 / self.fps, "whole": _WHOLE}
        values["frames"] = json.dumps(pictures)
        for name, value in values.items():
            page = page.replace(f"{{{name}}}", str(value))
        Path(self.outfile).write_text(page, encoding="utf-8")
