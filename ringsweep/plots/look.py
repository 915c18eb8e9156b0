"""Colours, line styles, sizes and legends that all pictures share, and the switch between looks of a picture."""

from __future__ import annotations

import io
import math
import re
import sys
import textwrap
import threading
from collections.abc import Callable
from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib import colors, transforms
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends import backend_registry
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotParams
from matplotlib.legend import Legend
from numpy.typing import NDArray

from ringsweep.errors import InputError

#: The colour of each regime in every picture. These are the colours of Okabe and Ito, which colour-blind readers tell
#: apart. Their lightness is changed so that the regimes of one model differ in greyscale too.
REGIME_COLOURS: dict[str, str] = {
    "resting": "#F0E442",
    "oscillatory": "#84CAF2",
    "revolving": "#00507F",
    "separating": "#CC5500",
    "jammed": "#D086B1",
    "failed": "#1A1A1A",
    "stick-slip": "#008C66",
    "sliding": "#F0E442",
    "sticking": "#6A3D9A",
    "riding": "#B48FD0",
}

#: The colour of each word for what follows a lost contact. Their lightness falls from calm to wild.
AFTERMATH_COLOURS: dict[str, str] = {
    "held": "#EFEBD0",
    "recovered": "#84CAF2",
    "open": "#CC5500",
    "tumbled": "#00507F",
}

#: Curves of friction laws and of methods, which may cover each other. The numbers of colours and of styles have no
#: common factor, so a pair of the two returns only after 35 curves.
CURVE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
CURVE_STYLES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (8, 3)))

#: Cells without a value.
NO_VALUE = "#DDDDDD"

#: Classes that are not regimes, and zones.
CLASS_COLOURS = ("#BBBBBB", "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9", "#F0E442")

#: The body and the ring, or contact 1 and contact 2.
PAIR_COLOURS = ("#0072B2", "#D55E00")
PAIR_STYLES = ("-", "--")

#: Shading of times at which the body sticks.
STICK = "#E6E6E6"

#: Times at which a contact is open. Shading with it is translucent: once for one of two contacts, more for all.
OPEN = "#6A3D9A"

#: Surface of the ring outside the zones.
REST = "#F2F2F2"

#: Lines behind curves.
GRID = "#E6E6E6"

#: Font size of ticks, legends and notes. Labels and titles have the size of the text.
SMALL = "small"

#: Width that ticks and label of the vertical axis take, inches.
MARGIN = 0.7

# Figures and cells of a grid of axes that are narrower have their legend below, not beside, inches.
_NARROW = 4.6

#: Look of every legend.
LEGEND: dict[str, Any] = {"fontsize": SMALL, "frameon": False}

# Letters of a legend in the room of a letter of the text.
_LETTERS = 1.2

_NO_BREAK = "\N{NO-BREAK SPACE}"

# Settings that are the colour of the page, and that of all lines and texts.
_PAGES = ("axes.facecolor", "figure.facecolor")
_INKS = ("text.color", "axes.labelcolor", "axes.edgecolor", "axes.titlecolor", "xtick.color", "ytick.color")

# Settings of matplotlib by style. A style resets the settings of all others to the defaults of matplotlib.
_STYLES: dict[str, dict[str, Any]] = {
    "light": {},
    "print": {
        "font.size": 8.0,
        "axes.linewidth": 0.6,
        **{f"{axis}tick.{kind}.width": 0.6 for axis in "xy" for kind in ("major", "minor")},
        "savefig.dpi": 300.0,
        # Letters stay letters: publishers refuse fonts of type 3.
        "pdf.fonttype": 42,
    },
    "dark": dict.fromkeys(_PAGES, "#1E1E1E") | dict.fromkeys(_INKS, "#E8E8E8"),
    "transparent": dict.fromkeys(_PAGES, "none"),
}

_angles: Literal["deg", "rad"] = "deg"


def style(
    name: Literal["light", "print", "dark", "transparent"] = "light",
    *,
    width: float | None = None,
    angles: Literal["deg", "rad"] = "deg",
) -> None:
    """Choose the look of all pictures that are drawn from now on.

    The look consists of settings of matplotlib (``matplotlib.rcParams``), so other figures get it too. Pictures follow
    these settings, whoever makes them: the size of the text (``font.size``), the colours of page and text, and the
    width of a figure (``figure.figsize``).

    Parameters
    ----------
    name : {"light", "print", "dark", "transparent"}
        ``"light"`` is the default look, with a white page. ``"print"`` has text of 8 points, thinner axes and 300 dots
        per inch. ``"dark"`` has light text on a dark page. ``"transparent"`` has no page: what lies behind the picture
        shows through.
    width : float, optional
        Width of a figure, mm, for example 85 or 170 for one or two columns of a journal; by default 162.56 mm, the 6.4
        inches of matplotlib. In pictures of 85 mm all text can be read; small multiples need 170 mm.
    angles : {"deg", "rad"}
        Unit of angles. Angular velocities and accelerations are always in rad s⁻¹ and rad s⁻².

    Raises
    ------
    InputError
        If an argument is none of these.

    Examples
    --------
    >>> style("print", width=85)
    >>> style()
    """
    global _angles
    if name not in _STYLES:
        raise InputError("name", f"{name!r} is no style; choose from {', '.join(_STYLES)}")
    if angles not in ("deg", "rad"):
        raise InputError("angles", f"{angles!r} is neither 'deg' nor 'rad'")
    given: Any = width
    if not (given is None or (isinstance(given, int | float) and 20.0 <= given <= 2000.0)):
        raise InputError("width", f"{width!r} is not between 20 and 2000: a width in mm")
    usual: Any = matplotlib.rcParamsDefault
    settings = {key: usual[key] for chosen in _STYLES.values() for key in chosen}
    ratio = usual["figure.figsize"][1] / usual["figure.figsize"][0]
    inches = usual["figure.figsize"][0] if width is None else width / 25.4
    matplotlib.rcParams.update(settings | _STYLES[name] | {"figure.figsize": (inches, ratio * inches)})
    _angles = angles


def angle_unit() -> tuple[float, str]:
    """Size of the unit of angles, as a factor from radians, and its symbol."""
    return (180.0 / math.pi, "°") if _angles == "deg" else (1.0, "rad")


def figure_width() -> float:
    """Width of a new figure, inches."""
    return float(matplotlib.rcParams["figure.figsize"][0])


def on_page(colour: Any) -> Any:
    """A colour as it is drawn on the page: on a dark page greys are inverted, and other colours are lighter."""
    ink, page = np.array(colors.to_rgb(matplotlib.rcParams["text.color"])), np.array(colors.to_rgb(page_colour()))
    if page.mean() > ink.mean():
        return colour
    given = np.array(colors.to_rgb(colour))
    mixed = ink + given.mean() * (page - ink) if np.ptp(given) < 0.02 else 0.6 * given + 0.4
    return tuple(map(float, mixed))


def pair(k: int) -> Any:
    """Colour on the page of the first (0) or the second (1) of two: body and ring, or the contacts."""
    return on_page(PAIR_COLOURS[k])


def page_colour() -> Any:
    """Colour of the page; of a transparent one, the colour on which its text can be read."""
    for key in ("axes.facecolor", "figure.facecolor"):
        if (colour := matplotlib.rcParams[key]) != "none":
            return colour
    return "white" if np.mean(colors.to_rgb(matplotlib.rcParams["text.color"])) < 0.5 else "black"


def arcs(count: int) -> list[tuple[str, str]]:
    """Name and colour of each of `count` zones, the same in every picture."""
    colours = CLASS_COLOURS[2:]
    return [("zone" if count == 1 else f"zone {k + 1}", colours[k % len(colours)]) for k in range(count)]


class Picture(Figure):
    """A figure that a notebook shows as a picture, also before ``%matplotlib inline``."""

    def _repr_png_(self) -> bytes:
        written = io.BytesIO()
        self.savefig(written, format="png")
        return written.getvalue()


def picture(width: float, height: float) -> Figure:
    """A new figure of this size, inches. If pyplot is imported and opens windows, it is one of pyplot's figures.

    So ``plt.show()`` shows it. Elsewhere pyplot would only keep it in memory.
    """
    size: dict[str, Any] = {"figsize": (width, height), "layout": "constrained"}
    pyplot: Any = sys.modules.get("matplotlib.pyplot")
    # Windows belong to the main thread.
    if pyplot is not None and threading.current_thread() is threading.main_thread():
        _, framework = backend_registry.resolve_backend(matplotlib.get_backend())
        # A notebook shows a picture by itself.
        if framework not in (None, "nbagg", "ipympl"):
            return pyplot.figure(FigureClass=Picture, **size)
    return Picture(**size)


def panel(draw: Callable[..., Any], result: Any, height: float = 4.2, **options: Any) -> Figure:
    """A new figure with one picture."""
    figure = picture(7.6, height)
    draw(result, ax=figure.add_subplot(), **options)
    return figure


def axes_or_current(ax: Axes | None, height: float) -> Axes:
    """`ax`, or pyplot's current axes if it is None, with small labels of their ticks.

    A new figure has this height, as a multiple of its width.
    """
    if ax is None:
        # Importing pyplot chooses a backend, which may fail on a machine without a display.
        from matplotlib import pyplot

        if not pyplot.get_fignums():
            pyplot.figure(figsize=(figure_width(), height * figure_width()), layout="constrained")
        ax = pyplot.gca()
    small_ticks(ax)
    return ax


#: Sides of a grid of axes whose places a user may have chosen.
_ENDS = ("left", "right", "bottom", "top")


def make_room(ax: Axes) -> None:
    """Let the layout make room for labels and legend, in a figure about whose layout nothing was said."""
    figure: Any = ax.figure
    spec = ax.get_subplotspec()
    own = figure.get_figure(root=True)
    usual = vars(own.subplotpars) == vars(SubplotParams())
    placed = spec is None or any(getattr(spec.get_gridspec(), end, None) is not None for end in _ENDS)
    if own.get_layout_engine() is None and usual and not placed:
        own.set_layout_engine("constrained")


def size_of(ax: Axes) -> tuple[float, float]:
    """Width and height that the layout of the figure has for the axes with their labels and legend, inches."""
    figure: Any = ax.figure
    across, up = ax.get_position().size
    if spec := ax.get_subplotspec():
        across, up = len(spec.colspan) / spec.get_gridspec().ncols, len(spec.rowspan) / spec.get_gridspec().nrows
    return float(across * figure.bbox.width / figure.dpi), float(up * figure.bbox.height / figure.dpi)


def width_of(ax: Axes) -> float:
    """Width that the layout of the figure has for the axes with their labels and legend, inches."""
    return size_of(ax)[0]


def is_narrow(inches: float) -> bool:
    """Whether axes of this width have their legend below."""
    return inches < _NARROW


def label_axes(ax: Axes, x: str, y: str) -> None:
    """Write the labels of both axes, in as many lines as their widths need."""
    width, height = size_of(ax)
    # Ticks and the label of the vertical axis take a part of the width.
    ax.set_xlabel(folded([x], width - MARGIN))
    # A legend below narrow axes takes a part of the height.
    ax.set_ylabel(folded([y], (0.5 if is_narrow(width) else 0.75) * height))


def letters(inches: float) -> int:
    """Number of letters of the size of the text in a line."""
    return max(12, int(72.0 * inches / (0.53 * matplotlib.rcParams["font.size"])))


def folded(texts: list[str], inches: float) -> str:
    """Texts separated by semicolons, in lines of at most this width; a unit in brackets stays in one line."""
    lines = [""]
    for text in filter(None, texts):
        if lines[-1] and _length(lines[-1]) + _length(text) + 2 > letters(inches):
            lines[-1] += ";"
            lines.append("")
        lines[-1] += ("; " if lines[-1] else "") + text
    whole = (re.sub(r"\([^()]*\)$", lambda unit: unit[0].replace(" ", _NO_BREAK), line) for line in lines)
    filled = (textwrap.fill(line, letters(inches) + len(line) - _length(line)) for line in whole)
    return "\n".join(filled).replace(_NO_BREAK, " ")


def _length(text: str) -> int:
    """Number of letters as drawn: without the marks of an exponent."""
    return len(text.replace("$", "").replace("^{", "").replace("}", ""))


def place_legend(ax: Axes, handles: list[Artist], where: bool | str = True, **options: Any) -> None:
    """Put a legend where it hides no data, or where the user wants it.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Axes with their labels.
    handles : list of Artist
        Entries; without any there is no legend.
    where : bool or str
        ``"beside"`` (to the right of the axes), ``"below"``, or a location of matplotlib within the axes. True chooses
        between the first two by the width that there is; False draws no legend.
    **options
        Further options of a legend beside the axes.

    Raises
    ------
    InputError
        If `where` is none of these.
    """
    if where is False or not handles:
        return
    if where is True:
        where = "below" if is_narrow(width_of(ax)) else "beside"
    common: dict[str, Any] = LEGEND | {"handles": handles}
    common |= {name: value for name, value in options.items() if name.startswith("handle")}
    if where == "beside":
        ax.legend(**common | {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)} | options)
    elif where == "below":
        size, lines = matplotlib.rcParams["font.size"], 1 + ax.get_xlabel().count("\n")
        figure: Any = ax.figure
        # Below ticks, their labels, and the label of the axis.
        below = transforms.ScaledTranslation(0.0, -(8.0 + (1.0 + 1.25 * lines) * size) / 72.0, figure.dpi_scale_trans)
        columns = columns_of(handles, width_of(ax))
        at: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "columnspacing": 1.2}
        ax.legend(**common, **at, bbox_transform=ax.transAxes + below, ncols=columns)
    elif where in Legend.codes:
        ax.legend(**common | {"frameon": True, "loc": where})
    else:
        allowed = ", ".join(["beside", "below", *Legend.codes])
        raise InputError("legend", f"{where!r} is no place of a legend; choose True, False, or one of {allowed}")


def columns_of(handles: list[Artist], inches: float) -> int:
    """Columns of a legend of this width; its labels are then in one line."""
    for handle in handles:
        handle.set_label(str(handle.get_label()).replace("\n", " "))
    longest = max(_length(str(handle.get_label())) for handle in handles)
    return max(1, min(len(handles), int(_LETTERS * letters(inches)) // (longest + 6)))


def legend_width(handles: list[Artist]) -> float:
    """Width of a legend of one column, inches."""
    if not handles:
        return 0.0
    longest = max(_length(line) for handle in handles for line in str(handle.get_label()).split("\n"))
    # A handle with its margins is as wide as eight letters.
    return 10.0 * (longest + 8) / letters(10.0) / _LETTERS


def legend_above(ax: Axes, handles: list[Artist] | None = None) -> None:
    """Put a legend above the axes, to the right, in as many lines as it needs; by default with all that has a label."""
    handles = list(ax.get_legend_handles_labels()[0]) if handles is None else handles
    if handles:
        # A line, the space around it, and the label.
        needed = sum(_length(str(handle.get_label())) + 6 for handle in handles)
        lines = math.ceil(needed / (_LETTERS * letters(width_of(ax) - 0.5 * MARGIN)))
        columns = math.ceil(len(handles) / lines)
        style = LEGEND | {"columnspacing": 1.2, "borderaxespad": 0.1, "borderpad": 0.1, "handlelength": 1.8}
        ax.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, **style)


def band(ax: Axes, x: NDArray[Any], low: NDArray[Any], high: NDArray[Any], colour: Any, **style: Any) -> None:
    """Draw the band of an interval around a curve."""
    ax.fill_between(x, low, high, color=colour, alpha=0.3, linewidth=0, **style)


def colour_bar(drawn: Any, panels: list[Axes], label: str, ticks: Any = None) -> Any:
    """Draw one colour bar beside panels."""
    figure: Any = panels[0].figure
    bar = figure.colorbar(drawn, ax=panels, label=label, ticks=ticks)
    small_ticks(bar.ax)
    return bar


def small_ticks(*axes: Axes) -> None:
    """Give the labels of ticks the size of legends and notes."""
    for ax in axes:
        ax.tick_params(labelsize=SMALL, which="both")


def true_ranges(mask: NDArray[Any]) -> NDArray[np.intp]:
    """First index and index after the last of each unbroken range of True, shape ``(ranges, 2)``."""
    steps = np.diff(np.concatenate([[0], np.asarray(mask, dtype=np.int8), [0]]))
    return np.column_stack([np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)])


def is_dark(rgba: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether marks on these colours, shape ``(..., 4)``, must be white."""
    return np.asarray(rgba[..., :3] @ [0.299, 0.587, 0.114] < 0.45)
