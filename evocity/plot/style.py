"""One style for all plots: colours, frames, maps with metres and attribution.

No global setting of matplotlib is changed, and pyplot is not used: a figure lives as long as its
axes.
"""

import io
import math
import re
import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import ScaledTranslation
from PIL import Image

from evocity.errors import EvocityError, spell
from evocity.pictures.colours import FAINT, GROUND, INK, NOTHING, PAPER, ramp


def colour_of(rgb: Sequence[int]) -> str:
    return "#" + bytes(rgb).hex()


#: The colours of pictures and of the report.
INKS, FAINTS, PAPERS, GROUNDS, GREY = map(colour_of, (INK, FAINT, PAPER, GROUND, NOTHING))
#: Colours of the living and the front; the first population; other births; broken constraints.
LIVING, FIRST, OTHERS, BROKEN = "#b0403f", "#3f74a3", "#b9b1a4", "#80796f"
#: Letters of texts, points.
SMALL, PLAIN, TITLE = 7.5, 8.5, 10.0
#: Arguments of small texts.
INK_TEXT = {"fontsize": SMALL, "color": INKS}
FAINT_TEXT = {"fontsize": SMALL, "color": FAINTS}
_TOO_TALL = 1.5  # inches
#: Pixels of an inch where a notebook shows a figure.
DPI = 100


class Panel(Axes):
    """Axes that a notebook shows with their whole figure, without pyplot."""

    def _repr_png_(self) -> bytes:
        return _png(self.figure)


class Panels(np.ndarray):
    """Several `Panel` of one ``figure``, which a notebook shows together."""

    @property
    def figure(self) -> Figure:
        """The figure of all of them. Raises AttributeError if there are none."""
        if not self.size:
            raise AttributeError("no axes, and so no figure")
        return self.flat[0].figure

    def _repr_png_(self) -> bytes | None:
        return _png(self.figure) if self.size else None


def _png(figure: Figure) -> bytes:
    kept = io.BytesIO()
    quick = {"compress_level": 3}  # a sixth less time, for 2 % more bytes
    figure.savefig(kept, format="png", dpi=DPI, pil_kwargs=quick)
    return kept.getvalue()


def panel(ax: Axes | None, width: float = 7.0, height: float = 4.5) -> Axes:
    """Return ``ax``, or the axes of a new figure of ``width`` × ``height`` inches."""
    return panels(1, ax, width=width, height=height)[0]


def panels(
    count: int, ax: object = None, *, columns: int = 2, width: float = 9.0, height: float = 2.6
) -> Panels:
    """Return ``(count,)`` axes: those of ``ax``, or of a new figure ``width`` inches wide, with
    rows of ``height`` inches. Raises `EvocityError` for another number than ``count``."""
    if ax is None:
        columns = max(1, min(columns, count))
        rows = max(1, -(-count // columns))
        figure = Figure((width, rows * height), dpi=DPI, facecolor=PAPERS, layout="constrained")
        figure.get_layout_engine().set(w_pad=0.08, h_pad=0.08)
        places = range(1, count + 1)
        axes = [figure.add_subplot(rows, columns, n, axes_class=Panel) for n in places]
    else:
        axes = list(np.ravel(np.asarray(ax, dtype=object)))
        if len(axes) != count or not all(isinstance(one, Axes) for one in axes):
            raise EvocityError(
                f"ax = {spell(ax) if len(axes) == 1 else f'{len(axes)} objects'}",
                "one of matplotlib's axes" if count == 1 else f"{count} of matplotlib's axes",
                "leave it out for a new figure, or make axes: "
                f"matplotlib.pyplot.subplots({'' if count == 1 else count})[1]",
            )
    for one in axes:
        _dress(one)
    result = np.empty(count, dtype=object).view(Panels)
    result[:] = axes
    return result


def _dress(ax: Axes) -> None:
    for side, spine in ax.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(FAINTS)
    ax.set_facecolor(PAPERS)
    ax.tick_params(colors=FAINTS, labelcolor=INKS, labelsize=SMALL, length=3)
    ax.grid(True, color="#e8e3d9", linewidth=0.7)
    ax.set_axisbelow(True)
    for axis in (ax.xaxis, ax.yaxis):  # a common factor would stand in the legend
        axis.set_major_formatter("{x:.6g}")


def name_axes(ax: Axes, x: str = "", y: str = "", title: str = "") -> None:
    """Label the axes, in the common size; a title stands left."""
    ax.set_xlabel(x, fontsize=PLAIN, color=INKS)
    ax.set_ylabel(y, fontsize=PLAIN, color=INKS)
    if title:
        ax.set_title(title, fontsize=TITLE, color=INKS, loc="left")


def whole_numbers(ax: Axes) -> None:
    """Make the ticks of x whole numbers, for generations."""
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=9, min_n_ticks=1))


def note(ax: Axes, text: str) -> None:
    ax.text(0.5, 0.5, text, ha="center", va="center", fontsize=PLAIN, color=FAINTS,
            transform=ax.transAxes, wrap=True)  # fmt: skip


def key(ax: Axes, handles: Sequence, columns: int = 1, **place) -> None:
    """Draw a legend without a frame, beside the axes unless ``place`` says where."""
    where = place or {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0)}
    ax.legend(handles=list(handles), fontsize=SMALL, labelcolor=INKS, frameon=False, ncols=columns,
              borderaxespad=0, handlelength=1.6, **where)  # fmt: skip


def shared_key(axes: Panels, handles: Sequence) -> None:
    """Draw a legend for several axes: above all of them in a figure of ours, else in the first."""
    if isinstance(axes[0], Panel):
        axes[0].figure.legend(handles=list(handles), fontsize=SMALL, labelcolor=INKS, ncols=4,
                              frameon=False, loc="outside upper left")  # fmt: skip
    else:
        key(axes[0], handles, loc="best")
        legend = axes[0].get_legend()
        legend.set_frame_on(True)
        legend.get_frame().set(facecolor=PAPERS, alpha=0.85, linewidth=0)


def fold(name: str, width: int = 22) -> str:
    """Break a long name into lines of about ``width`` letters, at the ends of words."""
    lines = [""]
    for word in re.findall(r"[^_.@ ]*[_.@ ]*", name):
        if lines[-1] and len(lines[-1]) + len(word.rstrip()) > width:
            lines.append("")
        lines[-1] += word
    cut = [one.strip() for one in lines]
    lines = [one if len(one) <= 2 * width else one[: 2 * width - 1] + "…" for one in cut]
    return plain("\n".join(lines))


def short(name: str, width: int = 28) -> str:
    """Cut a name to at most ``width`` letters."""
    return plain(name if len(name) <= width else name[: width - 1] + "…")


def plain(text: str) -> str:
    """Escape a ``text`` for matplotlib: dollars begin no formula."""
    return text.replace("$", r"\$")


def fit(ax: Axes) -> Axes:
    """Cut surplus room beneath a figure of ours, and make room for a wide key; return ``ax``."""
    figure = ax.figure
    if isinstance(ax, Panel):
        figure.set_figheight(figure.get_figheight() + _TOO_TALL)
        figure.get_layout_engine().execute(figure)
        box, wide = figure.get_tightbbox(), figure.get_figwidth()
        figure.set_figheight(box.height + 0.25)
        if box.x1 > wide:
            figure.set_figwidth(box.x1 + 0.1)
    return ax


# -- maps -------------------------------------------------------------------------------------


def bare(ax: Axes) -> None:
    """Make axes for pictures: no ticks, no lines, equal units to the east and to the south."""
    ax.grid(False)
    ax.set_xticks([])
    ax.set_yticks([])
    ax.set_aspect("equal", anchor="NW")
    for spine in ax.spines.values():
        spine.set_visible(False)


def lay(ax: Axes, picture: Image.Image | np.ndarray, place: Sequence[float]) -> AxesImage:
    """Draw a picture at a ``place`` (left, top, width, height) of axes whose y runs to the
    south."""
    left, top, width, height = place
    extent = (left, left + width, top + height, top)
    image = ax.imshow(np.asarray(picture), extent=extent, interpolation="antialiased")
    image.set_in_layout(False)  # it lies within the axes: layout need not measure it
    return image


def map_on(ax: Axes, colours: np.ndarray, side: float, title: str = "") -> AxesImage:
    """Draw a map's ``colours`` ``(H, W, 3)``, ``side`` metres per pixel, with a scale bar."""
    bare(ax)
    height, width = (n * side for n in colours.shape[:2])
    ax.set_xlim(0, width)
    ax.set_ylim(height, 0)
    image = lay(ax, colours, (0, 0, width, height))
    scale_bar(ax, 0, width, 1.0)
    if title:
        name_axes(ax, title=title)
    return image


def scale_bar(ax: Axes, left: float, width: float, metres: float, below: float = 9) -> None:
    """Draw a round length of at most a quarter of a map ``width`` units wide, ``below`` points
    beneath."""
    most = width * metres / 4
    power = 10.0 ** math.floor(math.log10(most))
    length = next(m * power for m in (5, 2, 1) if m * power <= most)
    trans = ax.get_xaxis_transform() + ScaledTranslation(0, -below / 72, ax.figure.dpi_scale_trans)
    ends = [left, left + length / metres]
    ax.add_line(Line2D(ends, [0, 0], transform=trans, color=INKS, linewidth=2.5, clip_on=False,
                       solid_capstyle="butt", gid="scale bar"))  # fmt: skip
    ax.annotate(f"{length:g} m", (ends[1], 0), (4, -below), xycoords=ax.get_xaxis_transform(),
                textcoords="offset points", fontsize=SMALL, color=INKS, va="center")  # fmt: skip


def credit(ax: Axes, attribution: str, below: float = 16, label: str = "") -> None:
    """Write the attribution ``below`` points beneath axes of maps; or beneath a ``label`` of their
    x."""
    inches = ax.get_position().width * ax.figure.get_figwidth()
    letters = max(30, int(inches * 72 / (0.5 * SMALL)))
    text = plain("\n".join(textwrap.wrap(attribution, letters)))
    if not label:
        ax.set_xlabel(text, fontsize=SMALL, color=FAINTS, loc="left", labelpad=below)
        return
    ax.annotate(text, (0, 0), (0, -40), "axes fraction", "offset points", va="top",
                fontsize=SMALL, color=FAINTS)  # fmt: skip


def colour_scale(ax: Axes, colours: np.ndarray, low: float, high: float, label: str) -> Axes:
    """Draw a scale of ``colours`` ``(n, 3)`` from ``low`` to ``high``, beside axes."""
    tall = ax.get_position().height * ax.figure.get_figheight()
    share = min(0.6, 2.6 / tall)
    strip = ax.inset_axes([1.02, 0.9 - share, 0.022, share])
    strip.imshow(colours[::-1, None], extent=(0, 1, low, high), aspect="auto")
    strip.set_xticks([])
    strip.yaxis.tick_right()
    strip.tick_params(colors=FAINTS, labelcolor=INKS, labelsize=SMALL, length=3)
    for spine in strip.spines.values():
        spine.set_color(FAINTS)
        spine.set_linewidth(0.6)
    strip.set_title(label, fontsize=SMALL, color=INKS, loc="left", pad=5)
    return strip


def height_scale(ax: Axes, highest: float) -> Axes:
    heights = np.linspace(0, highest, 256, dtype=np.float32)[None]
    return colour_scale(ax, ramp(heights, highest)[0], 0, highest, "height, m")
