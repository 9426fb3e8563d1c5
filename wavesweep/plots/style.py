"""The common style of all figures: sizes for a paper, fonts, colours for the colour-blind, and names of axes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.results import fields

ONE_COLUMN = 3.5  # inches: the column of a two-column paper
TWO_COLUMNS = 7.0
DOTS_PER_INCH = 200
IDEAL = "black"
DOUBTFUL = "#d62728"
UNKNOWN = {"facecolor": "none", "edgecolor": "0.75", "hatch": "/////", "linewidth": 0, "zorder": 0}

# Okabe and Ito's colours without black, which is the ideal's, and without yellow, which is faint on white.
_DISTINCT = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
_SYMBOLS = {
    "K_VE": r"$K_\mathrm{VE}$",
    "B_VE": r"$B_\mathrm{VE}$",
    "K_LM": r"$K_\mathrm{LM}$",
    "B_LM": r"$B_\mathrm{LM}$",
    "Kp": r"$K_p$",
    "b": r"$b$",
}
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
    "lines.linewidth": 1.2,
    "figure.constrained_layout.h_pad": 0.03,
    "figure.constrained_layout.w_pad": 0.03,
}


def incomplete(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Rows of slices that are only partly known; figures hatch them outside the known stable intervals."""
    from wavesweep.analysis.doubt import INCOMPLETE

    searched = np.isin(columns["hand"].astype(str), ("passive", "box", "port")) if "hand" in columns else False
    return np.isin(columns["doubt"].astype(str), INCOMPLETE) & ~np.asarray(searched)


@contextmanager
def figure(path: Path, width: float, height: float) -> Iterator[Any]:
    """Give a figure to draw in, and write it as PNG to `path` at the end; `width` and `height` in inches.

    The same drawing gives the same bytes: neither a date nor a program's version goes into the file.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    # No matplotlibrc is read, so that a figure looks the same everywhere.
    with matplotlib.rc_context({**matplotlib.rcParamsDefault, **_STYLE, "backend": "agg"}):
        canvas = Figure(figsize=(width, height), dpi=DOTS_PER_INCH, layout="constrained")
        agg = FigureCanvasAgg(canvas)
        yield canvas
        _settle(canvas)
        agg.draw()
        pixels = Image.frombuffer("RGBA", agg.get_width_height(), agg.buffer_rgba())
        # A palette of 256 colours is plenty for lines and flat areas, and takes a third of the bytes.
        palette = pixels.convert("RGB").quantize(256, dither=Image.Dither.NONE)
        palette.save(path, format="png", dpi=(DOTS_PER_INCH, DOTS_PER_INCH), optimize=True)


def _settle(canvas: Any) -> None:
    """Lay the figure out once and round the positions of its panels.

    The layout's solver has rounding errors that may differ between runs, and the shade of a pixel can depend on them.
    """
    canvas.draw_without_rendering()
    canvas.set_layout_engine("none")
    for axes in canvas.axes:
        axes.set_position([round(float(edge), 4) for edge in axes.get_position().bounds])


def family_colours(number: int) -> list[Any]:
    """Return colours for an ordered family, dark to light; the yellow end of the map is left out, as it is faint on white."""
    from matplotlib import colormaps

    if number == 1:
        return [_DISTINCT[0]]
    return [colormaps["viridis"](0.85 * index / (number - 1)) for index in range(number)]


def distinct_colour(index: int) -> str:
    """Return the colour number `index` of a set without an order; colours repeat after six."""
    return _DISTINCT[index % len(_DISTINCT)]


def symbol(name: str) -> str:
    """The name of an axis as a paper prints it."""
    return _SYMBOLS.get(name, name)


def label(name: str, facts: Mapping[str, Any] | None = None) -> str:
    """The name of an axis with its unit. `facts` of the run describe the numbers of a drawn loop."""
    unit = next(field.unit for field in fields("zwidth", [name], facts=facts) if field.name == name)
    return symbol(name) if unit in ("", "1") else f"{symbol(name)} ({unit.replace('*', '·')})"
