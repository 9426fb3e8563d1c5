"""The picture of a loop: its blocks with type, rate and phase, sums, ports, and wires with their gains; colours are rates."""

from functools import lru_cache
from typing import Any

from wavesweep.engine.errors import UsageError
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.picture.layout import ROW, Box, Routes, dots, lay_out
from wavesweep.picture.wiring import CONTINUOUS, Terms, Wiring, WiringPart, wiring_of_drawing
from wavesweep.program.plots.labels import as_it_stands
from wavesweep.program.plots.style import distinct_look, family_looks, figure, paler
from wavesweep.program.spec import Spec

WIDEST = 10.5  # inch: the smallest letters have ten pixels at a width of 1280
NARROWEST = 4.5
MARGIN = 0.12
TITLE, NAME, SMALL = 9.0, 8.0, 7.0  # points
PILL, ARROW = 0.15, 0.14  # inch: of a sum before a port, and of the wire from it
LONGEST = 34  # characters of a gain
PLAIN_PORTS = ("", "u", "y")
NO_RATE = "0.35"
BETWEEN = "continuous: acts between ticks too, as physics does"
MOST_WIRES = 500  # beyond which a picture is a black area that takes minutes


def diagram(spec: Spec) -> Any:
    """Draw the loop of a spec, a controller's or a drawn one; gives a matplotlib `Figure`."""
    drawing = spec.drawing or loop_drawing(spec.values)
    loop = wiring_of_drawing(drawing, spec.values)
    frame = f"{loop.ticks} tick{'' if loop.ticks == 1 else 's'}"
    title = f"{spec.name}, {spec.kind}: frame of {frame}, {1e3 * loop.ticks * loop.tick_s:.6g} ms"
    wall = zip(("stiffness", "damping"), drawing.wall or (), strict=False)
    named = " and ".join(f"{wall_part} {name.rpartition('.')[2]}" for wall_part, name in wall)
    return wiring(loop, as_it_stands(f"{title}; wall of {named}" if named else title))


def wiring(loop: Wiring, title: str) -> Any:
    """Draw the wiring of a loop under a title; gives a matplotlib `Figure`.

    Columns go from the hand's force to the right; if they are too many for one row, the next row goes on below.
    """
    boxes, routes = placed(loop)
    rates = sorted({box.every for box in loop.parts} - {0})
    looks = family_looks(len(rates)) if len(rates) > 5 else [distinct_look(n) for n in range(len(rates))]
    colours = {0: NO_RATE} | {rate: look.colour for rate, look in zip(rates, looks, strict=True)}  # ports are grey
    legend = {every: f"{_when(every)}: {1 / (every * loop.tick_s):.6g} Hz" for every in rates}
    gains = [gain for box in loop.parts for _, terms in box.inputs for _, gain in terms]
    note = BETWEEN * any(gain.startswith(CONTINUOUS) for gain in gains)
    head = 0.24 + 0.2 * (len(legend) + bool(note))
    wide = max(routes.width, _width(title, TITLE) + MARGIN, _width(note, SMALL) + MARGIN, NARROWEST)
    size = wide + 2 * MARGIN, routes.height + head + 2 * MARGIN
    with figure(*size) as canvas:
        canvas.set_layout_engine("none")
        axes = canvas.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.set(xlim=(-MARGIN, size[0] - MARGIN), ylim=(size[1] - MARGIN - head, -MARGIN - head))
        axes.text(0, 0.02 - head, title, fontsize=TITLE, va="center")
        for n, (every, text) in enumerate(legend.items()):
            y = 0.26 + 0.2 * n - head
            axes.add_patch(_rectangle(0.02, y - 0.06, 0.2, 0.12, colours[every]))
            axes.text(0.3, y, text, fontsize=SMALL, va="center")
        axes.text(0, 0.26 + 0.2 * len(legend) - head, note, fontsize=SMALL, va="center")
        _draw_loop(axes, loop, boxes, routes, colours)
    return canvas


def _draw_loop(axes, loop, boxes, routes, colours):
    """Draw wires, their branches and the boxes in the colours of their rates."""
    wires = {signal: colours[box.every] for box in loop.parts for _, signal in box.outputs}
    for net, a, b, c, d in routes.lines:
        axes.plot([a, c], [b, d], color=wires[net], linewidth=1.0, solid_capstyle="projecting", zorder=1)
    for net, x, y in dots(routes.lines):
        axes.plot([x], [y], "o", color=wires[net], markersize=3.2, zorder=2)
    for number, box in enumerate(loop.parts):
        _draw(axes, box, boxes[number], routes, number, wires, colours[box.every])


def placed(loop: Wiring) -> tuple[list[Box], Routes]:
    """The boxes of the parts, and the places and routes of the picture.

    Errors: UsageError for more than MOST_WIRES wires.
    """
    wires = sum(len(terms) for box in loop.parts for _, terms in box.inputs)
    if wires > MOST_WIRES:
        raise UsageError(f"the picture of the loop: expected at most {MOST_WIRES} wires, which can be read, found {wires}")
    boxes = [_box(box) for box in loop.parts]
    return boxes, lay_out(boxes, WIDEST - 2 * MARGIN)


def _when(every, phase=0):
    text = "every tick" if every == 1 else f"every {every:.6g} ticks"
    return f"{text}, from {phase:.6g}" if phase else text


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
    rows, inputs = 0, []
    for _, terms in part.inputs:
        inputs += [(rows + n, signal, 0.16 + _width(_gain(terms, gain), SMALL)) for n, (signal, gain) in enumerate(terms)]
        rows += max(1, len(terms))
    texts = _texts(part)
    height = max(rows, len(part.outputs), 3 if part.kind == "block" else 1)
    shift, below = (height - rows) // 2, (height - len(part.outputs)) // 2
    wide = _sum_width(part) + sum(_port_widths(part)) + max(_width(*text) for text in texts) + 0.16
    return Box(
        wide,
        height,
        tuple((row + shift, net, label) for row, net, label in inputs),
        tuple((row + below, net) for row, (_, net) in enumerate(part.outputs)),
    )


def _sum_width(part: WiringPart) -> float:
    """Width of the sums before a block."""
    return PILL + ARROW if any(len(terms) > 1 for _, terms in part.inputs) else 0.0


def _port_widths(part: WiringPart) -> tuple[float, float]:
    """Widths of the names of the input and output ports within a block."""
    sides = (part.inputs, part.outputs)
    widths = ([_width(name, SMALL) for name, _ in side if name not in PLAIN_PORTS] for side in sides)
    return tuple(max((width + 0.08 for width in side), default=0.0) for side in widths)


def _gain(terms: Terms, gain: str) -> str:
    """A gain as it stands at a wire: a sign alone for one, and nothing at a wire that is not summed."""
    text = gain if len(gain) <= LONGEST else f"{gain[: LONGEST - 1]}…"
    if gain in ("1", "-1"):
        text = "" if gain == "1" and len(terms) == 1 else "+" if gain == "1" else "-"
    return text.replace("**", "^").replace("*", "·").replace("-", "\N{MINUS SIGN}")


@lru_cache(maxsize=4096)  # texts of users
def _width(text: str, size: float, weight: str = "normal") -> float:
    """Width of a text in inches."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(family="DejaVu Sans", weight=weight, size=size)
    return text_to_path.get_text_width_height_descent(text, font, ismath=False)[0] / 72


def _rectangle(x, y, width, height, colour, shade=0.18, radius=0.04):
    from matplotlib.patches import FancyBboxPatch

    style, pale = f"round,pad=0,rounding_size={radius}", paler(colour, shade)
    return FancyBboxPatch((x, y), width, height, boxstyle=style, facecolor=pale, edgecolor=colour, linewidth=1.0, zorder=3)


def _draw(axes, part, box, routes, number, wires, colour):
    """Draw a part at its place, with the ends of its wires. wires: colour of each signal. colour: of the part."""
    (x, y), sums = routes.places[number], _sum_width(part)
    left, width = x + sums, box.width - sums
    rows = iter(box.inputs)
    levels = []
    for _, terms in part.inputs:
        ys = []
        for signal, gain in terms:
            row, _, _ = next(rows)
            ys.append(_end(axes, routes.ends[number, row], left if len(terms) == 1 else x, wires[signal], _gain(terms, gain)))
        levels.append(ys)
    inset, shade = (0.03, 0.18) if part.kind == "block" else (0.0, 0.05)
    axes.add_patch(_rectangle(left, y + inset, width, ROW * box.rows - 2 * inset, colour, shade))
    ports_in, ports_out = _port_widths(part)
    middle = left + ports_in + (width - ports_in - ports_out) / 2
    texts = _texts(part)
    for n, (text, size, weight) in enumerate(texts):
        level = y + ROW * box.rows / 2 + 0.145 * (n - (len(texts) - 1) / 2)
        axes.text(middle, level, as_it_stands(text), fontsize=size, weight=weight, ha="center", va="center", zorder=5)
    free = iter(range(box.rows))
    for (name, terms), ys in zip(part.inputs, levels, strict=True):
        level = sum(ys) / len(ys) if ys else y + ROW * (next(free) + 0.5)
        if len(terms) > 1:  # a sum of several wires
            low, high = min(ys) - 0.075, max(ys) + 0.075
            axes.add_patch(_rectangle(x, low, PILL, high - low, colour, 0.0, PILL / 2))
            axes.text(x + PILL / 2, (low + high) / 2, "Σ", fontsize=SMALL, ha="center", va="center", zorder=5)
            axes.annotate("", (left, level), (x + PILL, level), arrowprops=_arrow(colour), zorder=4)
        if name not in PLAIN_PORTS:
            axes.text(left + 0.05, level, as_it_stands(name), fontsize=SMALL, va="center", color="0.25", zorder=5)
    for (row, _), (name, _) in zip(box.outputs, part.outputs, strict=True):
        if name not in PLAIN_PORTS:
            level = y + ROW * (row + 0.5)
            axes.text(
                left + width - 0.05, level, as_it_stands(name), fontsize=SMALL, va="center", ha="right", color="0.25", zorder=5
            )


def _end(axes, end, x, colour, text):
    """Draw the end of a wire with its gain; gives its level."""
    start, level = end
    if x > start:
        axes.plot([start, x], [level, level], color=colour, linewidth=1.0, zorder=1)
    axes.annotate("", (x, level), (x - 0.1, level), arrowprops=_arrow(colour), zorder=4)
    axes.text(start - 0.12, level - 0.02, as_it_stands(text), fontsize=SMALL, ha="right", va="bottom", zorder=5)
    return level


def _arrow(colour):
    return {"arrowstyle": "-|>,head_width=0.16,head_length=0.28", "color": colour, "linewidth": 1.0, "shrinkA": 0, "shrinkB": 0}
