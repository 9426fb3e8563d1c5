"""The common style of all figures: sizes for a paper, fonts, colours for the colour-blind,
notes, and names of axes."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from itertools import pairwise
from math import ceil
from pathlib import Path
from threading import RLock
from typing import Any

from wavesweep.capabilities import COMMAND_OF_FIGURE
from wavesweep.engine.errors import UsageError

ONE_COLUMN = 3.5  # inches: the column of a two-column paper
TWO_COLUMNS = 2 * ONE_COLUMN
DOTS_PER_INCH = 200
LINE_OF_NOTES = 0.12  # inches
PANELS_APART = 8.0  # points, at least, between those of neighbouring panels
IDEAL = "black"
DOUBTFUL = "#d62728"
MOST_DISTINCT = 5  # colours that are told apart by their hue
FAINT_COLOUR = 0.35  # share of its colour that the curve of an unstable loop has
UNKNOWN = {"facecolor": "none", "edgecolor": "0.75", "hatch": "/////", "linewidth": 0, "zorder": 0}
UNPROVED = {
    "facecolor": "white",
    "hatch": "ooo",
    "linewidth": 0,
}  # stable, but not certified; in the colour of its region
GRID = {"visible": True, "color": "0.9", "linewidth": 0.5}
LINES = (
    "-",
    (0, (7, 1.5)),
    (0, (5, 1.2, 1, 1.2)),
    (0, (3, 1)),
    (0, (8, 1.2, 1, 1.2, 1, 1.2)),
    (0, (1.5, 0.8)),
)

# Okabe and Ito's colours without black, which is the ideal's, and without yellow, which is faint on
# white.
_DISTINCT = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
_STYLE = {
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "axes.linewidth": 0.6,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.title_fontsize": 8,
    "legend.frameon": False,
    "legend.handlelength": 2.8,  # a whole period of the dashes
    "lines.linewidth": 1.2,
    "figure.constrained_layout.h_pad": 0.03,
    "figure.constrained_layout.w_pad": 0.03,
    "hatch.linewidth": 0.5,
    "ps.fonttype": 42,
    "pdf.fonttype": 42,  # TrueType: journals refuse Type 3
    "svg.fonttype": "none",  # texts that can be searched, and changed by hand
    "svg.hashsalt": "wavesweep",
}
_ALONE = RLock()  # held while the settings are those of a figure
_WIDTH: ContextVar[float | None] = ContextVar("width", default=None)  # inches, if one is asked for
_INTO: ContextVar[Any] = ContextVar(
    "into", default=None
)  # axes or a part of a figure, in whose place the next one is drawn
_LEGEND: ContextVar[bool] = ContextVar("legend", default=True)
_CAPTION: ContextVar[bool] = ContextVar("caption", default=True)


@contextmanager
def as_asked(width: float | None) -> Iterator[None]:
    """Draw figures this wide (inches)."""
    before = _WIDTH.set(width)
    try:
        yield
    finally:
        _WIDTH.reset(before)


def wide(width: float) -> float:
    """The width of a figure, inches: the one that was asked for, or else `width`."""
    return _WIDTH.get() or width


def is_narrow() -> bool:
    """Whether a figure of two columns has to fit into one."""
    # Inches: panels of a narrower figure stand one below the other; its texts have the same size.
    return wide(TWO_COLUMNS) < 5.0


def drawn_into(
    ax: Any, draw: Callable[[], Any], *, legend: bool = True, caption: bool = True
) -> Any:
    """The figure that `draw` makes or, with `ax`, that of these axes, in whose place it is drawn as
    a `SubFigure`.

    ax: a `SubFigure` is drawn in. legend, caption: whether it has these; a warning stays. Errors:
    UsageError for axes that are not part of a grid of panels.
    """
    with _shown(legend, caption):
        if ax is None:
            return draw()
        return _drawn_in_place(ax, draw)


@contextmanager
def _shown(legend: bool, caption: bool) -> Iterator[None]:
    """Draw figures with or without a legend and the notes below."""
    legend_before = _LEGEND.set(legend)
    caption_before = _CAPTION.set(caption)
    try:
        yield
    finally:
        _LEGEND.reset(legend_before)
        _CAPTION.reset(caption_before)


def _drawn_in_place(ax: Any, draw: Callable[[], Any]) -> Any:
    """The figure of these axes, in whose place `draw` draws."""
    is_figure = hasattr(ax, "add_subfigure")
    if not is_figure and (not hasattr(ax, "get_subplotspec") or ax.get_subplotspec() is None):
        raise UsageError(
            f"ax: expected axes of a grid, as matplotlib.pyplot.subplots gives them, found {ax!r:.60}"
        )
    before = _INTO.set(ax)
    try:
        draw()
    finally:
        _INTO.reset(before)
    return ax.figure


@contextmanager
def figure(width: float, height: float) -> Iterator[Any]:
    """Give a matplotlib `Figure` to draw in, `width` by `height` inches, and settle its layout at
    the end.

    A width that was asked for, see `as_asked`, is taken in place of `width`; a wider figure is
    higher too. The figure belongs to no window, and leaves no settings behind. A notebook shows it.
    Within `drawn_into` it is a part of another.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with style():
        if (place := _INTO.get()) is not None:
            if not hasattr(place, "add_subfigure"):
                place.set_axis_off()
                place = place.figure.add_subfigure(place.get_subplotspec())
            # A part lacks some methods of a figure: its size and layout are those of the whole.
            place.get_figwidth, place.get_figheight = (
                (lambda: place.bbox.width / place.dpi),
                (lambda: place.bbox.height / place.dpi),
            )
            place.set_figheight = place.set_layout_engine = lambda *_: None
            yield place
            _without_legend(place)
            place.get_figure(root=True).draw_without_rendering()  # which gives panels their sizes
            for axes in place.axes:
                _wrapped(axes)
            _fit_notes(place)
            return
        height *= max(1.0, wide(width) / width) ** 0.5
        canvas = Figure(figsize=(wide(width), height), dpi=DOTS_PER_INCH, layout="constrained")
        FigureCanvasAgg(canvas)
        yield canvas
        _without_legend(canvas)
        _settle(canvas)
    canvas._repr_png_ = partial(png, canvas, {})  # the name that notebooks ask a value for


@contextmanager
def style() -> Iterator[None]:
    """The settings of every figure. No matplotlibrc is read, so that it looks alike everywhere.

    The settings are those of the process, so one thread after the other draws, and the user's are
    there again afterwards.
    """
    import matplotlib
    from matplotlib.font_manager import fontManager

    if not any(
        font.name == "DejaVu Sans" for font in fontManager.ttflist
    ):  # its stored list of fonts is empty
        for path in Path(matplotlib.get_data_path(), "fonts", "ttf").glob("*.ttf"):
            fontManager.addfont(path)
    with (
        _ALONE,
        matplotlib.rc_context({**matplotlib.rcParamsDefault, **_STYLE, "backend": "agg"}),
    ):
        yield


def png(canvas: Any, about: Mapping[str, str]) -> bytes:
    """A figure as PNG with a palette; about: see `save`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image, PngImagePlugin

    with style():
        agg = FigureCanvasAgg(canvas)
        agg.draw()
    pixels = Image.frombuffer("RGBA", agg.get_width_height(), agg.buffer_rgba())
    # A palette of 256 colours is plenty for lines and flat areas, and takes a third of the bytes.
    palette = pixels.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    texts = PngImagePlugin.PngInfo()
    for name, text in about.items():
        texts.add_text(name, text)
    file = BytesIO()
    palette.save(file, format="png", dpi=(DOTS_PER_INCH, DOTS_PER_INCH), pnginfo=texts)
    return file.getvalue()


def about_figure(kind: str, facts: Mapping[str, Any]) -> dict[str, str]:
    """The texts of a figure's metadata: title, program, command, and the spec with its digest."""
    texts = {
        "Title": f"wavesweep {kind}",
        "Software": f"wavesweep {facts.get('tool_version', '')}".rstrip(),
    }
    texts["Command"] = f"wavesweep {COMMAND_OF_FIGURE.get(kind, kind)}"
    if "spec_name" in facts:
        texts |= {"Title": f"{kind} of {facts['spec_name']}", "Spec": str(facts["spec_name"])}
    if "spec_sha256" in facts:
        texts["Spec SHA-256"] = str(facts["spec_sha256"])
    return texts


def _settle(canvas: Any) -> None:
    """Lay the figure out and round the positions of its panels.

    A panel whose axes have the same unit gets its shape when it is drawn, so that the texts around
    it are then placed anew. The layout's solver has rounding errors that may differ between runs,
    and the shade of a pixel can depend on them.
    """
    _lay_out(canvas)
    for _ in range(4):  # with more lines of one name the panels are smaller
        wrapped = [_wrapped(axes) for axes in canvas.axes]
        if not any(wrapped):
            break
        _lay_out(canvas)
    again = [
        axes
        for axes in canvas.axes
        if _thinned(axes) or _cut_off(axes) or axes.get_aspect() != "auto"
    ]
    close = _closest(canvas.axes) < PANELS_APART * canvas.dpi / 72
    if close:
        pad = _STYLE["figure.constrained_layout.w_pad"] + PANELS_APART / 2 / 72
        canvas.get_layout_engine().set(w_pad=pad)
    if again or close:
        _lay_out(canvas)
    if _fit_notes(canvas):
        _lay_out(canvas)
    canvas.set_layout_engine(None)  # with "none" `savefig` would draw it once more before
    for axes in canvas.axes:
        axes.set_position([round(float(edge), 4) for edge in axes.get_position().bounds])


def _lay_out(canvas: Any) -> None:
    """Place all panels, with their texts as they will be drawn: what a drawing does first."""
    if canvas.axes:
        canvas.get_layout_engine().execute(canvas)


def _without_legend(canvas: Any) -> None:
    """Remove the legends if none were asked for."""
    from matplotlib.legend import Legend

    if not _LEGEND.get():
        for legend in canvas.findobj(Legend):
            legend.remove()


def _closest(panels: Sequence[Any]) -> float:
    """The least distance (pixels) between the numbers below a panel and those below the next one
    beside it.

    Infinite if there are no such panels.
    """
    spans = []  # bottom and left of the panel, left and right of its numbers
    for axes in panels:
        panel = axes.bbox
        boxes = [
            box
            for box in _numbers_below(axes)
            if panel.x0 - 1 <= (box.x0 + box.x1) / 2 <= panel.x1 + 1
        ]
        if boxes:
            leftmost = min(box.x0 for box in boxes)
            right = max(box.x1 for box in boxes)
            spans.append((panel.y0, panel.x0, leftmost, right))
    least = float("inf")
    for bottom, x0, _, right in spans:
        for bottom_of_next, x0_of_next, left_of_next, _ in spans:
            if abs(bottom - bottom_of_next) < 1 and x0 < x0_of_next:
                least = min(least, left_of_next - right)
    return least


def _numbers_below(axes: Any) -> list[Any]:
    """The boxes (pixels) of the numbers below a panel."""
    shown = [text for text in axes.get_xticklabels() if text.get_visible() and text.get_text()]
    return [text.get_window_extent() for text in shown]


def _wrapped(axes: Any) -> bool:
    """Whether a title, or the name of an axis, was longer than its panel; it has more lines
    then."""
    from textwrap import fill

    longer = False
    across = axes.bbox.width
    at_left = axes._left_title  # noqa: SLF001 - matplotlib names the title in the middle alone
    texts = [(text, across) for text in (axes.title, at_left, axes.xaxis.label)]
    texts.append((axes.yaxis.label, axes.bbox.height))
    for text, room in texts:
        box = text.get_window_extent()
        length = box.height if text.get_rotation() == 90 else box.width
        lines = text.get_text().splitlines()
        if text.get_visible() and length > room and any(" " in line for line in lines):
            letters = max(1, int(max(map(len, lines)) * room / length))
            wrapped = "\n".join(fill(line, letters, break_long_words=False) for line in lines)
            longer |= wrapped != text.get_text()
            text.set_text(wrapped)
    return longer


def _cut_off(axes: Any) -> bool:
    """Whether the name of a panel's axis sticks out, as the panel's new size has given it wider
    numbers; these stay then."""
    out = bool(axes.get_ylabel()) and bool(axes.yaxis.label.get_window_extent().x0 < 0)
    if out:
        for panel in axes.figure.axes:
            low, high = sorted(panel.get_ylim())
            panel.set_yticks([tick for tick in panel.get_yticks() if low <= tick <= high])
    return out


def _thinned(axes: Any) -> bool:
    """Whether the numbers below a panel touched each other; there are fewer then."""
    if axes.get_xscale() != "linear":
        return False
    spans = sorted((box.x0, box.x1) for box in _numbers_below(axes))
    apart = 1.5 * axes.figure.dpi / 72  # 1.5 points, at least, between two numbers below a panel
    crowded = any(left_of_next < right + apart for (_, right), (left_of_next, _) in pairwise(spans))
    if crowded:
        axes.locator_params(axis="x", nbins=max(1, len(spans) // 2))
    return crowded


@dataclass(frozen=True)
class Look:
    """Colour and style of a line; the style makes it out in grey as well."""

    colour: Any
    line: Any = "-"


def paler(colour: Any, share: float) -> tuple[float, ...]:
    """The colour that shows if this share of it covers white. No part of a figure is
    transparent, as EPS has none."""
    from matplotlib.colors import to_rgb

    return tuple(1 - share * (1 - channel) for channel in to_rgb(colour))


def family_looks(number: int) -> list[Look]:
    """Return the looks of an ordered family, dark to light.

    The yellow end of the map is left out, as it is faint on white.
    """
    if number == 1:
        return [Look(_DISTINCT[0])]
    colours = family_map()
    return [
        Look(colours(index / (number - 1)), LINES[index % len(LINES)]) for index in range(number)
    ]


def family_map() -> Any:
    """The map of the colours of families, without its yellow end."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps["viridis"]([0.85 * index / 255 for index in range(256)]))


def distinct_colour(index: int) -> str:
    """Return the colour number `index` of a set without an order; colours repeat after six."""
    return _DISTINCT[index % len(_DISTINCT)]


def distinct_look(index: int) -> Look:
    """Return that colour with a style of line of its own."""
    return Look(distinct_colour(index), LINES[index % len(LINES)])


def note_below(canvas: Any, *sentences: str, axis: str = "") -> None:
    """Write notes below the panels as one text, in which only their own breaks begin a line, and
    above them the name of an axis that they share. They are wrapped once panels have their widths.

    The notes are lines of the label of an axis, below an empty one: the layout makes room for that,
    and for nothing that is placed by hand.
    """
    notes = " ".join(filter(None, sentences)).splitlines() if _CAPTION.get() else []
    above = [axis] * bool(axis) + [""] * bool(axis and notes)
    lines = [*above, *notes]
    if lines:
        canvas.set_figheight(canvas.get_figheight() + LINE_OF_NOTES * (len(lines) - bool(axis)))
        canvas.supxlabel("\n".join(lines), fontsize=7 if notes else 8)


def _fit_notes(canvas: Any) -> bool:
    """Wrap the notes below the panels to the width of these, with lines of about one length, and
    whether there are any. The figure grows with the lines."""
    from textwrap import wrap

    notes = canvas._supxlabel  # noqa: SLF001 - matplotlib returns it once, as it is made
    panels = [axes.bbox for axes in canvas.axes if axes.get_visible()]
    if notes is None or not panels:
        return False
    leftmost = min(panel.x0 for panel in panels)
    right = max(panel.x1 for panel in panels)
    before = notes.get_text().split("\n")
    wrapped: list[str] = []
    for paragraph in before:
        lines = [paragraph]
        letters = len(paragraph)
        notes.set_text(paragraph)
        while notes.get_window_extent().width > right - leftmost:
            letters = int(0.95 * letters)
            lines = wrap(paragraph, letters, break_on_hyphens=False)
            notes.set_text("\n".join(lines))
        narrower = lines
        while len(narrower) == len(lines) > 1:
            lines = narrower
            letters -= 1
            narrower = wrap(paragraph, letters, break_on_hyphens=False)
        wrapped += lines
    notes.set_text("\n".join(wrapped))
    notes.set_x((leftmost + right) / 2 / canvas.bbox.width)
    canvas.set_figheight(canvas.get_figheight() + LINE_OF_NOTES * (len(wrapped) - len(before)))
    return True


def warn_above(canvas: Any, text: str) -> None:
    """Write a warning above the panels."""
    from textwrap import fill

    if text:
        canvas.suptitle(
            # 16 letters in an inch.
            fill(text, int(16 * canvas.get_figwidth())),
            fontsize=8,
            color=DOUBTFUL,
        )


def fitting(texts: Sequence[str], width: float, size: float = 8.0) -> int:
    """How many columns a legend with these texts, of `size` points, has room for in `width` inches.

    All of its rows have about the same number of entries.
    """
    if not texts:
        return 1
    letters = [0, 0]
    for text in texts:
        printed = re.sub(r"\\mathrm|[$_{}^\\]", "", text)
        letters.append(max(map(len, printed.split("\n"))))
    *_, second, longest = sorted(letters)
    width_of_second = size * (5 + 0.52 * second)
    width_of_longest = size * (5 + 0.52 * longest)
    columns = max(1, 1 + int((72 * width - width_of_longest) / width_of_second))
    rows = ceil(len(texts) / columns)
    return ceil(len(texts) / rows)
