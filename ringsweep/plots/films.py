"""Animations of runs: the body in the ring or on the belt beside its history."""

from __future__ import annotations

import os
import re
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.animation import FFMpegWriter, FuncAnimation, HTMLWriter, PillowWriter
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.figure import Figure
from PIL import Image

from ringsweep.errors import InputError
from ringsweep.plots import datasets, look
from ringsweep.plots.histories import draw_panel, time_limits
from ringsweep.plots.labels import axis_label
from ringsweep.plots.polar import BeltArtists, RingArtists, states_at
from ringsweep.plots.rig import belt_history, ring_history
from ringsweep.plots.saving import suffix_of
from ringsweep.storage.files import check_writable, replacing

# By suffix what writes a film. A page holds all of its frames, without limit.
_WRITERS: dict[str, Any] = {".mp4": partial(FFMpegWriter, codec="h264"), ".gif": PillowWriter}
_WRITERS[".html"] = partial(HTMLWriter, embed_frames=True, embed_limit=np.inf)

# What a page would load from the internet: a style sheet and icons; signs on the buttons take their place.
_ICONS = re.compile('<link[^>]*>|<i class="fa fa-([^"]*)"></i>')
_SIGNS = {None: '<meta charset="utf-8">', "minus": "\N{MINUS SIGN}", "plus": "+", "pause": "⏸", "play": "▶"}
_SIGNS |= {"play fa-flip-horizontal": "◀", "fast-backward": "⏮", "step-backward": "◁"}
_SIGNS |= {"step-forward": "▷", "fast-forward": "⏭"}

# Inches, dots per inch, and colours of a frame of a page. Codecs of mp4 need even numbers of pixels.
_SIZE, _DPI, _COLOURS = (10.8, 5.4), 100, 128


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
    film = _Film(ds, fps, duration)
    return FuncAnimation(film, film.show_frame, frames=len(film.states["time"]), interval=1000.0 / fps)


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
    from ringsweep.runs.executors import progress_bar

    check_animation(path)
    film, suffix = animation(ds, fps=fps, duration=duration), Path(path).suffix.lower()
    bar = progress_bar(max(2, round(fps * duration)), progress, unit="frame")
    with replacing(path) as temporary, TemporaryDirectory() as folder, bar:
        made = Path(folder, f"film{suffix}")
        film.save(made, writer=_WRITERS[suffix](fps=fps), dpi=_DPI, progress_callback=lambda *_: bar.update())
        if suffix == ".html":
            page = re.sub(_ICONS, lambda icon: _SIGNS[icon[1]], made.read_text(encoding="utf-8"))
            made.write_text(page, encoding="utf-8")
        temporary.write_bytes(made.read_bytes())


def check_animation(path: str | os.PathLike[str]) -> None:
    """Check that an animation can be written to `path`. Call it before a long run.

    Raises
    ------
    InputError
        If the suffix is unknown, ffmpeg is missing, or the file cannot be written.
    """
    if suffix_of(path, tuple(_WRITERS), "animations") == ".mp4" and not FFMpegWriter.isAvailable():
        raise InputError(str(path), "ffmpeg, which writes .mp4, is not installed; .gif and .html need no ffmpeg")
    check_writable(path)


class _Film(Figure):
    """The body beside its history. A frame draws the moving artists on a stored picture of all others."""

    def __init__(self, ds: xr.Dataset, fps: float, duration: float):
        for name, value in (("fps", fps), ("duration", duration)):
            if not 0.0 < value < np.inf:
                raise InputError(name, f"{value!r} is not a number greater than 0")
        super().__init__(figsize=_SIZE, dpi=_DPI, layout="constrained")
        subfigures: Any = self.subfigures(1, 2, width_ratios=[1.0, 1.15])
        left, right = subfigures
        if datasets.on_ring(datasets.require_history(ds)):
            run, rig = ring_history(ds)
            self.body: RingArtists | BeltArtists = RingArtists(left.add_subplot(), run, rig)
        else:
            run = belt_history(ds)
            self.body = BeltArtists(left.subplots(2, 1, height_ratios=[1.0, 1.6]), run)
        first, last = run["time"].values[[0, -1]]
        self.states = states_at(run, np.linspace(first, last, max(2, round(fps * duration))))
        left.legend(handles=self.body.entries, loc="outside lower center", ncols=3, columnspacing=1, **look.LEGEND)
        left.suptitle(_speed(float(last - first), duration), fontsize="medium")
        shown = [names for names in datasets.panels_of(run) if names not in (("epsilon",), ("impact_speed",))]
        panels = right.subplots(len(shown), 1, sharex=True)
        for panel, names in zip(panels, shown, strict=True):
            draw_panel(panel, run, names)
            if len(shown) > 3:
                panel.yaxis.label.set_fontsize(look.SMALL)
        panels[-1].set_xlabel(axis_label(run["time"], run))
        if last > first:
            panels[0].set_xlim(*time_limits(run))
        right.align_ylabels(panels)
        right.suptitle(look.folded([datasets.outcome(run)], _SIZE[0] * 1.15 / 2.15), fontsize="medium")
        self.until = time_limits(run)[1]
        # Translucent, above the marks of a history.
        cover: dict[str, Any] = {"facecolor": look.page_colour(), "edgecolor": look.on_page("0.2"), "alpha": 0.8}
        self.futures = [panel.axvspan(first, self.until, linewidth=1.0, zorder=6, **cover) for panel in panels]
        self.moving = sorted([*self.body.moving, *self.futures], key=Artist.get_zorder)
        self.show_frame(0)
        # Texts change from frame to frame: a layout that followed them would shake.
        self.draw_without_rendering()
        self.set_layout_engine("none")
        for artist in self.moving:
            artist.set_animated(True)
        self.pixels = RendererAgg(*self.bbox.size, _DPI)
        self.draw(self.pixels)
        self.background = self.pixels.copy_from_bbox(self.bbox)

    def show_frame(self, k: int) -> list[Artist]:
        """Move all moving artists to the `k`-th frame."""
        self.body.show(self.states, k)
        now, is_last = float(self.states["time"][k]), k + 1 == len(self.states["time"])
        for cover in self.futures:
            # At the end nothing of the future is left to cover.
            cover.set(x=now, width=0.0 if is_last else self.until - now)
        return self.moving

    def savefig(self, fname: Any, *, transparent: bool | None = None, **options: Any) -> None:
        """Write a picture; a frame of a film several times as fast, with few colours, since pages hold every frame."""
        kind = options.get("format")
        if kind not in ("png", "rgba") or options.get("dpi") != _DPI:
            super().savefig(fname, transparent=transparent, **options)
            return
        self.pixels.restore_region(self.background)
        for artist in self.moving:
            artist.draw(self.pixels)
        frame = Image.fromarray(np.asarray(self.pixels.buffer_rgba())).convert("RGB")
        if kind == "png":
            frame.quantize(_COLOURS, dither=Image.Dither.NONE).save(fname, "png")
        else:
            fname.write(frame.convert("RGBA").tobytes())


def _speed(span: float, duration: float) -> str:
    """Speed of an animation of `duration` seconds relative to a run of `span` seconds."""
    factor = span / duration
    if abs(factor - 1.0) < 0.005:
        return "real time"
    return f"{factor:.3g} times faster than real" if factor > 1.0 else f"{1.0 / factor:.3g} times slower than real"
