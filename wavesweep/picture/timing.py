"""The picture of time: when each rate samples and computes, when its results are in place, and
how old a force's numbers are."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, floor
from typing import Any

from wavesweep.engine.errors import UsageError
from wavesweep.picture.ages import Life
from wavesweep.picture.moments import Lane, Moments, in_ms, in_words, moments, title_of
from wavesweep.program.plots.labels import as_it_stands
from wavesweep.program.plots.style import (
    GRID,
    MOST_DISTINCT,
    TWO_COLUMNS,
    distinct_look,
    family_looks,
    figure,
    is_narrow,
    note_below,
    wide,
)
from wavesweep.program.spec import Spec

# Inches of height: of a lane, of the plot of ages, of the texts of a panel, and of those of the
# figure.
LANE, AGE, HEAD, ENDS = 0.44, 0.8, 0.55, 0.25
COMPUTED, HELD = (0.08, 0.48), (0.52, 0.92)  # the bars of a number, from the top of its lane
HELD_ALONE = (0.3, 0.7)  # that of one that is in place at once
MOST_LANES = 6  # of a panel; a note says how many are not shown
BESIDE = 0.04  # share of the time shown that is drawn before and after it
OTHERS = 0.3  # share of a lane's colour in bars beside the number shown
PALE = 0.12  # the same while numbers are computed


def has_moments(spec: Spec) -> bool:
    """Whether anything of the loop of a spec runs in ticks."""
    return bool(moments(spec)[-1].lanes)


def timing(spec: Spec) -> Any:
    """Draw when the loop of a spec samples, computes and acts; gives a matplotlib `Figure`.

    Errors: UsageError for a loop in which nothing runs in ticks.
    """
    frames = moments(spec)
    if not has_moments(spec):
        raise UsageError(
            "the picture of time: expected a block that runs in ticks, found plants that act on each other alone"
        )
    width = max(_span(frames_shown) for frames_shown in frames)
    ages = [drawn.age * drawn.tick_ms for drawn in frames if drawn.age is not None]
    oldest = max(ages, default=0.0)
    heights = []
    for frames_shown in frames:
        heights.append(LANE * min(len(frames_shown.lanes), MOST_LANES))
        if frames_shown.shown:
            heights.append(AGE)
    with figure(TWO_COLUMNS, sum(heights) + HEAD * len(frames) + ENDS) as canvas:
        grid = canvas.subplots(len(heights), 1, squeeze=False, height_ratios=heights)
        left = grid.ravel().tolist()
        for frames_shown in frames:
            panel = Panel.of(frames_shown, width)
            lanes = below = left.pop(0)
            _draw_lanes(lanes, panel)
            if frames_shown.shown:
                below = left.pop(0)
                _draw_ages(below, panel, oldest)
                _mark(lanes, below, panel)
            for axes in (lanes, below):
                axes.set_xlim(*panel.edges)
        below.set_xlabel("time since the measurement (ms)" if frames_shown.shown else "time (ms)")
        title = f"{spec.name}, {spec.kind}: when it samples, computes and acts"
        canvas.suptitle(as_it_stands(title), fontsize=8)
        note_below(canvas, *_notes(spec, frames))
    return canvas


def _span(frames: Moments) -> float:
    """The time (ms) that is shown of frames: the life of a number or, without one, a frame of
    the loop."""
    return frames.tick_ms * (frames.ticks if frames.age is None else frames.age)


@dataclass(frozen=True, slots=True)
class Panel:
    """What is drawn of one kind of frames. lanes: those shown, with their colours. width: the
    time that panels show (ms)."""

    moments: Moments
    lanes: tuple[tuple[Lane, Any], ...]
    width: float

    @staticmethod
    def of(frames: Moments, width: float) -> "Panel":
        """The panel of frames."""
        if len(frames.lanes) > MOST_DISTINCT:
            looks = family_looks(len(frames.lanes))
        else:
            looks = [distinct_look(index) for index in range(len(frames.lanes))]
        coloured = list(zip(frames.lanes, (look.colour for look in looks), strict=True))
        if len(coloured) > MOST_LANES:
            coloured = [coloured[0], *coloured[1 - MOST_LANES :]]
        return Panel(frames, tuple(coloured), width)

    @property
    def edges(self) -> tuple[float, float]:
        """The times (ms) at the left and at the right of the panel."""
        return -BESIDE * self.width, (1 + BESIDE) * self.width

    @property
    def ticks(self) -> tuple[float, float]:
        """The ticks at the left and at the right of the panel."""
        start, stop = (time / self.moments.tick_ms for time in self.edges)
        first = self.moments.shown.measured if self.moments.shown else 0.0
        return first + start, first + stop

    def at(self, tick: float) -> float:
        """The time (ms) of a tick."""
        shown = self.moments.shown
        return (tick - shown.measured if shown else tick) * self.moments.tick_ms

    def lives(self, lane: Lane) -> Iterator[tuple[Life, bool]]:
        """Yield the numbers of a lane in the time shown, and whether each is lost; the number
        shown is held over these."""
        frames = self.moments
        begin, end = self.ticks
        for life in lane.lives:
            first = ceil((begin - life.end - frames.lost) / frames.ticks)
            last = floor((end - life.measured) / frames.ticks)
            for frame in range(first, last + 1):
                later = life.later(frame * frames.ticks)
                if lane is not frames.main or not frames.lost:
                    yield later, False
                elif later.run == frames.shown.run:
                    yield later.until(later.end + frames.lost), False
                else:
                    end_of_shown = frames.shown.end + frames.lost
                    yield later, frames.shown.start < later.start < end_of_shown


def _draw_lanes(axes: Any, panel: Panel) -> None:
    """Draw the lanes of a panel."""
    axes.set_ylim(len(panel.lanes), 0)
    names = []
    for level, (lane, colour) in enumerate(panel.lanes):
        names.append(as_it_stands(f"{lane.rate(panel.moments.tick_ms)}\n{_short(lane.block)}"))
        if level:
            axes.axhline(level, color="0.8", linewidth=0.5, zorder=0)
        shortest = min((life.end - life.start for life in lane.lives), default=0.0)
        # Share of a panel's width, below which a bar is a stroke.
        if shortest * panel.moments.tick_ms < 0.015 * panel.width:
            _draw_strokes(axes, panel, lane, level, colour)
        else:
            _draw_bars(axes, panel, lane, level, colour)
    axes.set_yticks([level + 0.5 for level in range(len(names))], names)
    axes.tick_params(axis="y", length=0)
    axes.set_title(as_it_stands(title_of(panel.moments)), loc="left", fontsize=8)


def _short(name: str) -> str:
    """A name of a block as there is room for it."""
    if len(name) <= 18:
        return name
    return f"{name[:17]}…"


def _draw_strokes(axes: Any, panel: Panel, lane: Lane, at: int, colour: Any) -> None:
    """Draw the runs of a lane as strokes, or as a strip if they are too many."""
    ticks = panel.moments.ticks
    begin, end = panel.ticks
    runs = []
    for frame in range(floor(begin / ticks), ceil(end / ticks) + 1):
        runs += [run + frame * ticks for run in lane.runs]
    runs = [run for run in runs if begin <= run <= end]
    top, bottom = (at + level for level in HELD_ALONE)
    if len(runs) > 120:  # strokes
        axes.add_patch(_bar(*panel.edges, top, bottom, blended(axes, colour, OTHERS)))
    else:
        axes.vlines([panel.at(run) for run in runs], top, bottom, color=colour, linewidth=0.9)


def _bar(start: float, stop: float, top: float, bottom: float, colour: Any, **more: Any) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((start, top), stop - start, bottom - top, facecolor=colour, **more)


def _draw_bars(axes: Any, panel: Panel, lane: Lane, lane_level: int, colour: Any) -> None:
    """Draw the numbers of a lane: from the measurement until they are in place, and while they
    are held."""
    edges = panel.edges
    # The panels have some 85 % of the width of a figure; inches of a ms.
    inches = 0.85 * wide(TWO_COLUMNS) / (edges[1] - edges[0])  # of a ms
    shown = panel.moments.shown if lane is panel.moments.main else None
    waits = any(life.start > life.measured for life in lane.lives)
    for life, lost in panel.lives(lane):
        stands_out = shown is not None and life.run == shown.run
        measured, start, end = (panel.at(tick) for tick in (life.measured, life.start, life.end))
        strong = colour if stands_out else blended(axes, colour, OTHERS)
        pale = blended(axes, colour, PALE)
        zorder = 3 if stands_out else 2
        if start > measured:
            top, bottom = (lane_level + level for level in COMPUTED)
            edge = {"edgecolor": strong, "linewidth": 0.9, "zorder": zorder}
            axes.add_patch(_bar(measured, start, top, bottom, pale, **edge))
            spans = max(measured, edges[0]), min(start, edges[1])
            texts = [f"on its way {in_ms(start - measured)} ms", f"{in_ms(start - measured)} ms"]
            _write(axes, spans, (top + bottom) / 2, texts if stands_out else [], inches, None)
        if lost:
            middle = lane_level + sum(COMPUTED) / 2
            axes.plot([start], [middle], "x", color=colour, markersize=5, zorder=5)
            continue
        top, bottom = (lane_level + level for level in (HELD if waits else HELD_ALONE))
        edge = {"edgecolor": axes.get_facecolor(), "linewidth": 0.9, "zorder": zorder}
        axes.add_patch(_bar(start, end, top, bottom, strong, **edge))
        spans = max(start, edges[0]), min(end, edges[1])
        texts = [f"held {in_ms(end - start)} ms", f"{in_ms(end - start)} ms"]
        _write(axes, spans, (top + bottom) / 2, texts if stands_out else [], inches, "white")
        if stands_out:
            level = lane_level + (COMPUTED if waits else HELD_ALONE)[0]
            axes.plot([measured], [level], "v", color=colour, markersize=5, zorder=5)


def _write(
    axes: Any,
    span: tuple[float, float],
    y: float,
    texts: Sequence[str],
    inches: float,
    colour: str | None,
) -> None:
    """Write the longest text that fits into a bar, if any does. inches: of a ms. colour: by
    default that of all texts."""
    from matplotlib import rcParams

    plain = rcParams["text.color"]
    for text in texts:
        if 0.058 * len(text) < inches * (span[1] - span[0]):  # inches of a letter in a bar
            axes.text(
                sum(span) / 2,
                y,
                text,
                fontsize=7,
                ha="center",
                va="center_baseline",
                color=colour or plain,
                zorder=6,
                clip_on=True,
            )
            return


def blended(axes: Any, colour: Any, share: float) -> tuple[float, ...]:
    """The colour that shows if this share of it covers the ground of a plot, or more of it if
    that is dark."""
    from matplotlib.colors import to_rgb

    ground = to_rgb(axes.get_facecolor())
    if sum(ground) < 1.5:  # sum of red, green and blue, below which a ground is dark
        share **= 0.6
    pairs = zip(to_rgb(colour), ground, strict=True)
    return tuple(share * over + (1 - share) * under for over, under in pairs)


def _draw_ages(axes: Any, panel: Panel, highest: float) -> None:
    """Draw the age of the numbers of each lane that act, up to `highest` ms: it rises until the
    next one takes their place."""
    frames = panel.moments
    for lane, colour in panel.lanes:
        lives = sorted(
            (life for life, lost in panel.lives(lane) if not lost), key=lambda life: life.start
        )
        times = []
        ages = []
        for life in lives:
            times += [panel.at(life.start), panel.at(life.end)]
            ages += [(tick - life.measured) * frames.tick_ms for tick in (life.start, life.end)]
        if lane is frames.main:
            axes.fill_between(times, ages, color=blended(axes, colour, PALE), linewidth=0, zorder=1)
        axes.plot(times, ages, color=colour, linewidth=1.2, zorder=2)
    youngest = (frames.shown.start - frames.shown.measured) * frames.tick_ms
    oldest = frames.age * frames.tick_ms
    axes.set_ylim(0, 1.12 * highest)
    if min(youngest, oldest - youngest) < 0.2 * highest:
        ages = [0.0, oldest]
    else:
        ages = [0.0, youngest, oldest]
    axes.set_yticks(ages, [in_ms(age) for age in ages])
    axes.set_ylabel("age (ms)")
    axes.grid(**GRID, axis="y")
    axes.set_axisbelow(True)


def _mark(lanes: Any, below: Any, panel: Panel) -> None:
    """Mark when the number shown is measured, in place and replaced, with lines and with the
    numbers below the panel."""
    shown = panel.moments.shown
    times = [0.0, panel.at(shown.start), _span(panel.moments)]
    for axes in (lanes, below):
        for time in times:
            axes.axvline(time, color="0.5", linewidth=0.6, linestyle=(0, (3, 2)), zorder=1.5)
    # Share of a panel's width, at least, between two numbers below it.
    apart = 0.14 * panel.width * (2 if is_narrow() else 1)
    numbers = [times[0], times[2]]
    if min(b - a for a, b in pairwise(times)) > apart:
        numbers = times
    below.set_xticks(numbers, [in_ms(time) for time in numbers])
    words = ["measured", "in place", "replaced"]
    if len(numbers) < len(words):
        words = ["measured" if times[1] else "measured, and in place", "replaced"]
    lanes.xaxis.tick_top()
    lanes.set_xticks(numbers, words, fontsize=7)
    lanes.tick_params(axis="x", length=2, pad=1)
    lanes.get_xticklabels()[0].set_ha("left")
    lanes.get_xticklabels()[-1].set_ha("right")


def _notes(spec: Spec, frames: Sequence[Moments]) -> Iterator[str]:
    """What is to be seen, and what is left out."""
    said = in_words(frames, "" if spec.drawing else "the force")
    if not said:
        yield (
            "No age is known: no number that these blocks give acts on a plant, or the frame is too long to be followed."
        )
        return
    last = frames[-1]
    frames_late = (last.shown.start - last.shown.measured) // last.main.every
    late = ""
    if frames_late:
        number = "one frame" if frames_late == 1 else f"{frames_late:.0f} frames"
        late = f": {last.main.block} answers {number} late"
    yield f"{said[0].upper()}{said[1:]}{late}.".replace(" ms", "\N{NO-BREAK SPACE}ms")
    yield "Outlined: on its way from the measurement. Filled: in place, and held. Paler: other results."
    hidden = len(frames[-1].lanes) - MOST_LANES
    if hidden > 0:
        yield f"{hidden} more rates are not shown."
