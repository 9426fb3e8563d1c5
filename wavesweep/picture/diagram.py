"""The picture of a loop: its blocks with type, rate and phase, sums, ports, and wires with their
gains; colours are rates."""

from functools import lru_cache
from typing import Any

from wavesweep.engine.errors import UsageError
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.picture.layout import ROW, Box, Routes, dots, lay_out
from wavesweep.picture.wiring import CONTINUOUS, Terms, Wiring, WiringPart, wiring_of_drawing
from wavesweep.program.number_words import in_time
from wavesweep.program.plots.labels import as_it_stands
from wavesweep.program.plots.style import MOST_DISTINCT, distinct_look, family_looks, figure, paler
from wavesweep.program.spec import Spec

PICTURE_MARGIN = 0.12  # inch
TITLE, NAME, SMALL = 9.0, 8.0, 7.0  # points
PILL, ARROW = 0.15, 0.14  # inch: of a sum before a port, and of the wire from it
LONGEST_GAIN = 34  # characters of a gain
PLAIN_PORTS = ("", "u", "y")
NO_RATE = "0.35"
BETWEEN = "continuous: acts between ticks too, as physics does"
MOST_WIRES = 500  # beyond which a picture is a black area that takes minutes


def diagram(spec: Spec) -> Any:
    """Draw the loop of a spec, a controller's or a drawn one; gives a matplotlib `Figure`."""
    drawing = spec.drawing or loop_drawing(spec.values)
    loop = wiring_of_drawing(drawing, spec.values)
    frame = f"{loop.ticks} tick{'' if loop.ticks == 1 else 's'}"
    title = f"{spec.name}, {spec.kind}: frame of {frame}, {in_time(loop.ticks * loop.tick_s)}"
    if drawing.wall:
        named = [
            f"{part} {name.rpartition('.')[2]}"
            for part, name in zip(("stiffness", "damping"), drawing.wall, strict=False)
        ]
        title += f"; wall of {' and '.join(named)}"
    return wiring(loop, as_it_stands(title))


def wiring(loop: Wiring, title: str) -> Any:
    """Draw the wiring of a loop under a title; gives a matplotlib `Figure`.

    Columns go from the hand's force to the right; if they are too many for one row, the next row
    goes on below.
    """
    boxes, routes = placed(loop)
    rates = sorted({part.every for part in loop.parts} - {0})
    colours = {0: NO_RATE}  # of ports
    if len(rates) > MOST_DISTINCT:
        looks = family_looks(len(rates))
    else:
        looks = [distinct_look(number) for number in range(len(rates))]
    for rate, look in zip(rates, looks, strict=True):
        colours[rate] = look.colour
    legend = {every: f"{_when(every)}: {1 / (every * loop.tick_s):.6g} Hz" for every in rates}
    note = BETWEEN if _acts_continuously(loop) else ""
    head = 0.24 + 0.2 * (len(legend) + bool(note))
    of_texts = max(_width(title, TITLE), _width(note, SMALL)) + PICTURE_MARGIN
    width = max(routes.width, of_texts, 4.5) + 2 * PICTURE_MARGIN  # inch
    height = routes.height + head + 2 * PICTURE_MARGIN
    with figure(width, height) as canvas:
        canvas.set_layout_engine("none")
        axes = canvas.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.set(
            xlim=(-PICTURE_MARGIN, width - PICTURE_MARGIN),
            ylim=(height - PICTURE_MARGIN - head, -PICTURE_MARGIN - head),
        )
        axes.text(0, 0.02 - head, title, fontsize=TITLE, va="center")
        for n, (every, text) in enumerate(legend.items()):
            y = 0.26 + 0.2 * n - head
            axes.add_patch(_rectangle((0.02, y - 0.06, 0.2, 0.12), colours[every]))
            axes.text(0.3, y, text, fontsize=SMALL, va="center")
        axes.text(0, 0.26 + 0.2 * len(legend) - head, note, fontsize=SMALL, va="center")
        _draw_loop(axes, loop, boxes, routes, colours)
    return canvas


def _acts_continuously(loop):
    """Whether some gain of the loop does."""
    for part in loop.parts:
        for _, terms in part.inputs:
            if any(gain.startswith(CONTINUOUS) for _, gain in terms):
                return True
    return False


def _draw_loop(axes, loop, boxes, routes, colours):
    """Draw wires, their branches and the boxes in the colours of their rates."""
    wires = {}
    for part in loop.parts:
        for _, signal in part.outputs:
            wires[signal] = colours[part.every]
    for net, a, b, c, d in routes.lines:
        axes.plot(
            [a, c], [b, d], color=wires[net], linewidth=1.0, solid_capstyle="projecting", zorder=1
        )
    for net, x, y in dots(routes.lines):
        axes.plot([x], [y], "o", color=wires[net], markersize=3.2, zorder=2)
    for number, part in enumerate(loop.parts):
        _draw(axes, part, boxes[number], routes, number, wires, colours[part.every])


def placed(loop: Wiring) -> tuple[list[Box], Routes]:
    """The boxes of the parts, and the places and routes of the picture.

    Errors: UsageError for more than MOST_WIRES wires.
    """
    wires = sum(len(terms) for box in loop.parts for _, terms in box.inputs)
    if wires > MOST_WIRES:
        raise UsageError(
            f"the picture of the loop: expected at most {MOST_WIRES} wires, which can be read, found {wires}"
        )
    boxes = [_box(box) for box in loop.parts]
    # Inch: the smallest letters have ten pixels at a width of 1280.
    return boxes, lay_out(boxes, 10.5 - 2 * PICTURE_MARGIN)


def _when(every, phase=0):
    text = "every tick" if every == 1 else f"every {every:.6g} ticks"
    if phase:
        return f"{text}, from {phase:.6g}"
    return text


def _texts(part: WiringPart) -> list[tuple[str, float, str]]:
    """The lines of a part: text, size in points and weight."""
    name = part.name
    if part.kind != "block":
        return [(name, SMALL, "normal")]
    return [
        (name, NAME, "bold"),
        (part.type, SMALL, "normal"),
        ("plant" if part.plant else _when(part.every, part.phase), SMALL, "normal"),
    ]


def _box(part: WiringPart) -> Box:
    rows = sum(max(1, len(terms)) for _, terms in part.inputs)
    height = max(rows, len(part.outputs), 3 if part.kind == "block" else 1)
    inputs = []
    first = (height - rows) // 2
    for _, terms in part.inputs:
        for row, (signal, gain) in enumerate(terms, first):
            inputs.append((row, signal, 0.16 + _width(_gain(terms, gain), SMALL)))
        first += max(1, len(terms))
    above = (height - len(part.outputs)) // 2
    outputs = [(row, signal) for row, (_, signal) in enumerate(part.outputs, above)]
    width = (
        _sum_width(part)
        + sum(_port_widths(part))
        + max(_width(*text) for text in _texts(part))
        + 0.16
    )
    return Box(width, height, tuple(inputs), tuple(outputs))


def _sum_width(part: WiringPart) -> float:
    """Width of the sums before a block."""
    if any(len(terms) > 1 for _, terms in part.inputs):
        return PILL + ARROW
    return 0.0


def _port_widths(part: WiringPart) -> tuple[float, float]:
    """Widths of the names of the input and output ports within a block."""
    return _names_width(part.inputs), _names_width(part.outputs)


def _names_width(ports):
    widths = [_width(name, SMALL) + 0.08 for name, _ in ports if name not in PLAIN_PORTS]
    return max(widths, default=0.0)


def _gain(terms: Terms, gain: str) -> str:
    """A gain as it stands at a wire: a sign alone for one, and nothing at a wire that is not
    summed."""
    if gain == "1":
        return "" if len(terms) == 1 else "+"
    if gain == "-1":
        return "\N{MINUS SIGN}"
    text = gain if len(gain) <= LONGEST_GAIN else f"{gain[: LONGEST_GAIN - 1]}…"
    return text.replace("**", "^").replace("*", "·").replace("-", "\N{MINUS SIGN}")


@lru_cache(maxsize=4096)  # texts of users
def _width(text: str, size: float, weight: str = "normal") -> float:
    """Width of a text in inches."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(family="DejaVu Sans", weight=weight, size=size)
    return text_to_path.get_text_width_height_descent(text, font, ismath=False)[0] / 72


def _rectangle(bounds, colour, shade=0.18, radius=0.04):
    """A box with rounded corners; bounds: left, top, width and height."""
    from matplotlib.patches import FancyBboxPatch

    style = f"round,pad=0,rounding_size={radius}"
    pale = paler(colour, shade)
    left, top, width, height = bounds
    return FancyBboxPatch(
        (left, top),
        width,
        height,
        boxstyle=style,
        facecolor=pale,
        edgecolor=colour,
        linewidth=1.0,
        zorder=3,
    )


def _draw(axes, part, box, routes, number, wires, colour):
    """Draw a part at its place, with the ends of its wires. wires: colour of each signal.
    colour: of the part."""
    x, y = routes.places[number]
    sums = _sum_width(part)
    left = x + sums
    width = box.width - sums
    rows = iter(box.inputs)
    levels = []
    for _, terms in part.inputs:
        at = left if len(terms) == 1 else x
        ys = []
        for signal, gain in terms:
            row, _, _ = next(rows)
            ys.append(_end(axes, routes.ends[number, row], at, wires[signal], _gain(terms, gain)))
        levels.append(ys)
    inset = 0.03 if part.kind == "block" else 0.0
    shade = 0.18 if part.kind == "block" else 0.05
    bounds = (left, y + inset, width, ROW * box.rows - 2 * inset)
    axes.add_patch(_rectangle(bounds, colour, shade))
    ports_in, ports_out = _port_widths(part)
    middle = left + ports_in + (width - ports_in - ports_out) / 2
    texts = _texts(part)
    in_middle = {"ha": "center", "va": "center", "zorder": 5}
    for n, (text, size, weight) in enumerate(texts):
        level = y + ROW * box.rows / 2 + 0.145 * (n - (len(texts) - 1) / 2)
        axes.text(middle, level, as_it_stands(text), fontsize=size, weight=weight, **in_middle)
    of_port = {"fontsize": SMALL, "va": "center", "color": "0.25", "zorder": 5}
    free = iter(range(box.rows))
    for (name, terms), ys in zip(part.inputs, levels, strict=True):
        level = sum(ys) / len(ys) if ys else y + ROW * (next(free) + 0.5)
        if len(terms) > 1:  # a sum of several wires
            low = min(ys) - 0.075
            high = max(ys) + 0.075
            axes.add_patch(_rectangle((x, low, PILL, high - low), colour, 0.0, PILL / 2))
            axes.text(x + PILL / 2, (low + high) / 2, "Σ", fontsize=SMALL, **in_middle)
            axes.annotate("", (left, level), (x + PILL, level), arrowprops=_arrow(colour), zorder=4)
        if name not in PLAIN_PORTS:
            axes.text(left + 0.05, level, as_it_stands(name), **of_port)
    for (row, _), (name, _) in zip(box.outputs, part.outputs, strict=True):
        if name not in PLAIN_PORTS:
            level = y + ROW * (row + 0.5)
            right = left + width - 0.05
            axes.text(right, level, as_it_stands(name), ha="right", **of_port)


def _end(axes, end, x, colour, text):
    """Draw the end of a wire with its gain; gives its level."""
    start, level = end
    if x > start:
        axes.plot([start, x], [level, level], color=colour, linewidth=1.0, zorder=1)
    axes.annotate("", (x, level), (x - 0.1, level), arrowprops=_arrow(colour), zorder=4)
    axes.text(
        start - 0.12,
        level - 0.02,
        as_it_stands(text),
        fontsize=SMALL,
        ha="right",
        va="bottom",
        zorder=5,
    )
    return level


def _arrow(colour):
    return {
        "arrowstyle": "-|>,head_width=0.16,head_length=0.28",
        "color": colour,
        "linewidth": 1.0,
        "shrinkA": 0,
        "shrinkB": 0,
    }
