"""The figure of margins: Nyquist curve, open-loop Bode plot and step response of a loop that is
broken at a signal."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.response import Step
from wavesweep.margins.marked_steps import MARK, draw_others, draw_step
from wavesweep.program.analyses.claim_words import scope_in_words
from wavesweep.program.analyses.claims import of_rows
from wavesweep.program.columns import Columns
from wavesweep.program.number_words import rounded_down, rounded_up
from wavesweep.program.plots.figure_layout import MOST_MEMBERS
from wavesweep.program.plots.labels import assumption, valued
from wavesweep.program.plots.style import (
    GRID,
    TWO_COLUMNS,
    Look,
    family_looks,
    figure,
    fitting,
    is_narrow,
    note_below,
    paler,
    wide,
)
from wavesweep.program.spec import Axis, Spec

LOWEST_SHOWN = 1e-4  # of the largest frequency, the lowest one of the Bode plot
ALMOST = 0.999  # of it, up to which its axes show gains whole; L may be 0 there
LEAST_GAIN = -100.0  # dB, below which an axis shows margins alone: a zero on the circle has none
FIRST_ANGLES = 600  # angles to begin with
CURVE_STEP = 0.03  # change of ln L between neighbours, at most
# of L, up to which the Nyquist plot follows it, about -1 and the circle of the gain 1
FARTHEST_SHOWN = 4.0
OFF_CURVE = "Margins are of the lifted L, at its eigenvalues: over frequency they need not lie on the curve of L itself."
_CURVE, _DISK = "#0072B2", "#D55E00"
_MARKS = {"gain_up": "^", "gain_down": "v", "phase": "o", "delay": "D", "delay_frames": "D"}
Family = Sequence[tuple[str, Spec]]
_CIRCLE = np.exp(1j * np.linspace(0, 2 * np.pi, 721))


@dataclass(frozen=True, eq=False)
class OpenLoop:
    """L of a loop that is broken at a signal, over its frequencies (Hz), with its margins.

    several: whether the values of L are the eigenvalues of a lifted one, which have no order.
    table: value, omega (rad/s) and strongest line (Hz) of each margin. marks: the value of L at
    which each of those that `_MARKS` names is set. rate: of the signal, Hz. bode: frequencies up to
    half of that and L of the signal's rate, which a lifted signal has besides.
    """

    hertz: np.ndarray
    L: np.ndarray
    several: bool
    table: Mapping[str, tuple[float, float, float]]
    marks: Mapping[str, complex]
    rate: float
    bode: tuple[np.ndarray, np.ndarray]

    def place(self, name: str) -> float:
        """The frequency (Hz) of a margin: of a lifted signal that at which its samples show the
        strongest line."""
        _, omega, hz = self.table[name]
        if self.several:
            return abs((hz + self.rate / 2) % self.rate - self.rate / 2)
        return omega / (2 * np.pi)

    @property
    def style(self) -> dict[str, Any]:
        """The style of the curve, or of the points."""
        if self.several:
            return {"linestyle": "none", "marker": ".", "markersize": 1.5}
        return {"linewidth": 1.2}

    def drawn(self, look: Look, points: bool) -> dict[str, Any]:
        """The style of the curve as a member of a family, or of its points."""
        return {
            "color": look.colour,
            "zorder": 1.9,
            **(self.style if points else {"linestyle": look.line, "linewidth": 0.9}),
        }

    @property
    def disk(self) -> np.ndarray | None:
        """The disk about -1 that L leaves free, with the gains `gain` and 1/gain at its ends;
        None if there is no limit."""
        gain, omega, _ = self.table.get("disk_gain", (np.nan,) * 3)
        return None if np.isnan(omega) else disk_of(gain)


def disk_of(gain: float) -> np.ndarray:
    """The rim of the disk about -1 with the gains `gain` and 1/gain at its ends."""
    return -(gain + 1 / gain) / 2 + (gain - 1 / gain) / 2 * _CIRCLE


def _margin_rows(columns):
    """The margins of the spec and those for all of [for_all]: by their names, value, omega
    (rad/s) and frequency (Hz)."""
    guarantee = np.asarray(columns.get("guarantee", np.full(len(columns["cut"]), "spec")))
    names = "margin", "value", "omega", "hz"
    margins_of = {}
    for word in ("spec", "for_all"):
        rows = zip(*(columns[name][guarantee == word].tolist() for name in names), strict=True)
        margins_of[word] = {name: tuple(sizes) for name, *sizes in rows}
    return margins_of


def margins(columns: Columns, facts: Mapping[str, Any], family: Family = ()) -> Any:
    """Draw a `margins` table: L over the frequencies of the frame, the point -1, the circle of the
    gain 1, and the disk margin.

    Beside it are gain (dB) and phase of L over frequency, see `draw_bode`, with the margins as
    lines between the curve and its limit, and below it the closed loop's response to a step of the
    signal. All of this is computed from the spec of the table, the curves so densely that no step
    shows. family: names and specs of other loops, which have a curve in each panel and no margins;
    by default those at the ends of the ranges of [for_all], see `ends_of_ranges`, with the disk
    that is proved for all of them.
    """
    from wavesweep.program.spec import load

    spec = load(facts["spec"])
    cut = facts["cut"]
    tables = _margin_rows(columns)
    loop = open_loop(spec, cut, tables["spec"])
    proved = () if family else tables["for_all"].get("disk_gain", ())
    family = family or ends_of_ranges(spec)
    looks = family_looks(len(family))
    other_loops = [
        (open_loop(member, cut, {}), look, name)
        for (name, member), look in zip(family, looks, strict=True)
    ]
    own_step = _closed_step(spec, cut)
    other_steps = [_closed_step(member, cut) for _, member in family]
    mosaic, ratios, height = _panels(with_step=bool(own_step))
    with figure(TWO_COLUMNS, height) as canvas:
        panels = canvas.subplot_mosaic(mosaic, height_ratios=ratios)
        cut_off = draw_nyquist(panels["nyquist"], loop, cut, other_loops)
        if len(proved) and proved[0] < np.inf:
            rim = disk_of(proved[0])
            disk = rounded_down(tables["for_all"]["disk"][0], 3)
            said = f"disk margin {disk}, proved {scope_in_words(of_rows(facts, 'for_all').scope)}"
            panels["nyquist"].plot(
                rim.real, rim.imag, color=_DISK, linewidth=1.0, zorder=1.8, label=said
            )
        draw_bode(panels["gain"], panels["phase"], loop, other_loops)
        handles, labels = panels["nyquist"].get_legend_handles_labels()
        if own_step:
            for handle, words in draw_step(panels["step"], own_step):
                handles.append(handle)
                labels.append(words)
            drawn = [
                step_and_look
                for step_and_look in zip(other_steps, looks, strict=True)
                if step_and_look[0]
            ]
            draw_others(panels["step"], drawn)
        across = fitting(labels, wide(TWO_COLUMNS), 7)
        canvas.set_figheight(canvas.get_figheight() + 0.13 * -(-len(labels) // across))
        canvas.legend(handles, labels, loc="outside upper center", ncols=across, fontsize=7)
        off_curve = OFF_CURVE if loop.several and loop.marks else ""
        slow = [name for (name, _), step in zip(family, other_steps, strict=True) if not step]
        too_slow = ""
        if slow:
            too_slow = f"Unstable, or too slow for a step response: {'; '.join(slow)}."
        note_below(canvas, cut_off, off_curve, too_slow, assumption(facts))
    return canvas


def _panels(*, with_step: bool) -> tuple[list[list[str]], list[int], float]:
    """The panels of the figure in rows, the ratios of their heights, and its height (inches)."""
    if is_narrow():
        below = ["step"] if with_step else []
        rows = [[name] for name in ("nyquist", "gain", "phase", *below)]
        ratios = [2, 1, 1, *(1 for _ in below)]
        height = 6.0
    else:
        rows = [["nyquist", "gain"], ["step" if with_step else "nyquist", "phase"]]
        ratios = [1, 1]
        height = 3.6
    return rows, ratios, height + 1.3 * with_step


def ends_of_ranges(spec: Spec) -> list[tuple[str, Spec]]:
    """The spec at the ends of the ranges of [for_all], named: in all combinations or, if these are
    many, each by itself.

    Numbers that change from frame to frame are left out, since they make no loop of their own.
    """
    unknown = spec.for_all.unknown if spec.for_all else ()
    axes = [axis for axis in unknown if axis.start < axis.stop]
    if 2 ** len(axes) <= MOST_MEMBERS:
        names = [axis.name for axis in axes]
        corners = product(*map(_ends, axes))
        places = [dict(zip(names, ends, strict=True)) for ends in corners]
    else:
        places = [{axis.name: end} for axis in axes for end in _ends(axis)][:MOST_MEMBERS]
    return named_specs(spec, [place for place in places if place])


def _ends(axis: Axis) -> tuple[float, float]:
    return axis.start, axis.stop


def named_specs(spec: Spec, places: Sequence[Mapping[str, float]]) -> list[tuple[str, Spec]]:
    """The spec with other numbers, and these in words; places: their names, as axes have them,
    and values."""
    facts = {"spec": spec.tables()}
    named = []
    for place in places:
        said = ", ".join(valued(name, value, facts) for name, value in place.items())
        changes = {spec.names.find(name).path: value for name, value in place.items()}
        named.append((said, spec.with_values(changes)))
    return named


def _closed_step(spec: Spec, cut: str) -> Step | None:
    """The response of T = L/(1 + L) to a step; None of a loop that comes to rest too slowly, or
    not at all."""
    from wavesweep.margins.broken_loops import with_block
    from wavesweep.program.analyses.steps import step_at

    try:
        step = step_at(*with_block(spec, cut))
    except UsageError:
        return None
    return replace(step, value=-step.value, final=-step.final)


def open_loop(spec: Any, cut: str, table: Mapping[str, tuple[float, float, float]]) -> OpenLoop:
    """L of the spec's own loop, broken at a signal, with the margins of `table`, see `OpenLoop`."""
    from wavesweep.margins.broken_loops import broken_at

    loop = broken_at(spec, cut)
    hertz, L = response_of(loop)
    return OpenLoop(
        hertz,
        L,
        loop.times > 1,
        table,
        marks_of(loop, table),
        loop.times / loop.period,
        bode_of(loop, hertz, L),
    )


def bode_of(loop: Any, hertz: np.ndarray, L: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies up to half the rate of the signal, and L there, see `LiftedLoop.at_line`.

    hertz, L: those of a signal that is made once per frame.
    """
    if loop.times == 1:
        return hertz, L
    angles = loop.times * dense_angles(
        lambda angle: loop.at_line(loop.times * angle), CURVE_STEP, FIRST_ANGLES
    )
    return angles / loop.period / (2 * np.pi), loop.at_line(angles)


def response_of(
    loop: Any,
    step: float = CURVE_STEP,
    first: int = FIRST_ANGLES,
    loci: int = 500,  # angles, at which eigenvalues of a lifted L are drawn as points
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (Hz) of a broken loop and L there, so densely that no step shows; of a lifted one
    its eigenvalues.

    step, first: change of ln L between two of them, and the number to begin with; loci: their
    number for a lifted one.
    """
    if loop.times == 1:
        angles = dense_angles(loop.response, step, first)
    else:
        angles = np.geomspace(LOWEST_SHOWN, 1.0, loci) * np.pi
    return np.repeat(angles, loop.times) / loop.period / (2 * np.pi), np.ravel(
        loop.response(angles)
    )


def marks_of(loop: Any, table: Mapping[str, Sequence[float]]) -> dict[str, complex]:
    """The value of L, or the eigenvalue of a lifted one, that the factor of each margin brings
    to -1."""
    from wavesweep.margins.broken_loops import factor_at

    marks = {}
    for name in _MARKS:
        value, omega = table.get(name, (np.nan, np.nan))[:2]
        factor = factor_at(name, value, omega, loop)
        if factor is not None:
            marks[name] = -1 / complex(factor)
    return marks


def dense_angles(
    response: Callable[[np.ndarray], np.ndarray], step: float, first: int
) -> np.ndarray:
    """Angles up to pi between which ln L changes little, so that neither plot shows a step at a
    resonance."""
    angles = (
        np.concatenate(
            [np.geomspace(1e-6, 1e-2, first // 3, endpoint=False), np.linspace(1e-2, 1.0, first)]
        )
        * np.pi
    )
    values = response(angles)
    for _ in range(24):  # rounds in which angles are put between neighbours, at most
        with np.errstate(divide="ignore", invalid="ignore"):
            turned = np.abs(np.log(values[1:] / values[:-1]))
        # Neighbours within 1e-10 rad get none between them.
        wide_steps = (turned > step) & np.isfinite(turned) & (np.diff(angles) > 1e-10)
        if not wide_steps.any():
            break
        between = (angles[:-1] + angles[1:])[wide_steps] / 2
        order = np.argsort(np.concatenate([angles, between]), kind="stable")
        angles, values = (
            np.concatenate(pair)[order] for pair in ((angles, between), (values, response(between)))
        )
    return angles


Others = Sequence[tuple[OpenLoop, Look, str]]


def draw_nyquist(axes: Any, loop: OpenLoop, cut: str, other_loops: Others) -> str:
    """Draw L of a loop that is broken at `cut`, with what limits it, and L of others, in the
    neighbourhood of -1.

    Gives a sentence on what is cut off, empty without any.
    """
    L = loop.L
    disk = loop.disk
    axes.plot(
        _CIRCLE.real, _CIRCLE.imag, color="0.6", linewidth=0.8, linestyle="--", label="gain 1"
    )
    said = f"eigenvalues of L at {cut}" if loop.several else f"L at {cut}"
    if other_loops:
        said += ", nominal"
    axes.plot(L.real, L.imag, color=_CURVE, label=said, **loop.style)
    for member, look, name in other_loops:
        axes.plot(member.L.real, member.L.imag, label=name, **member.drawn(look, member.several))
    if loop.several:
        of_negative = loop.style
    else:
        of_negative = {"linewidth": 0.6, "linestyle": ":"}
    axes.plot(L.real, -L.imag, color=_CURVE, **of_negative)
    axes.plot([-1], [0], "+", color=MARK, markersize=8)
    if disk is not None:
        said = f"disk margin {rounded_down(loop.table['disk'][0], 3)}"
        axes.fill(
            disk.real,
            disk.imag,
            facecolor=paler(_DISK, 0.25),
            edgecolor=paler(_DISK, 0.25),
            linewidth=0.8,
            label=said,
        )
    for name, mark in loop.marks.items():
        said = in_words(name, *loop.table[name])
        axes.plot(
            [mark.real],
            [mark.imag],
            _MARKS[name],
            color=MARK,
            markersize=4,
            markerfacecolor=_face(name),
            label=said,
        )
    point_sets = {
        "L": np.concatenate([L, *(member.L for member, *_ in other_loops)]),
        "the disk": disk if disk is not None else _CIRCLE,
    }
    for name, mark in loop.marks.items():
        point_sets[f"the mark of {name.replace('_', ' ')}"] = np.array([mark])
    marks = np.array([-1, *(mark for mark in loop.marks.values() if abs(mark) <= FARTHEST_SHOWN)])
    near_disk = point_sets["the disk"][np.abs(point_sets["the disk"]) <= FARTHEST_SHOWN]
    limiting = np.concatenate([_CIRCLE, marks, near_disk])
    near_curve = point_sets["L"][np.abs(point_sets["L"]) <= 1.15 * np.abs(limiting).max()]
    _show_square(axes, np.concatenate([limiting, near_curve]))
    axes.set_aspect("equal")
    axes.set(xlabel="real part of L", ylabel="imaginary part of L")
    axes.grid(**GRID)
    far = [name for name, points in point_sets.items() if _reach_outside(axes, points)]
    if not far:
        return ""
    reach = "reaches" if len(far) == 1 else "reach"
    return f"The Nyquist plot is cut off around -1: {' and '.join(far)} {reach} farther."


def _show_square(axes: Any, points: np.ndarray) -> None:
    """Show the square around points, since a strip shows little."""
    size = max(np.ptp(points.real), 2 * np.abs(points.imag).max())
    half = (0.5 + 0.08) * size  # room beyond what the plot has to show
    middle = (points.real.min() + points.real.max()) / 2
    axes.set_xlim(middle - half, middle + half)
    axes.set_ylim(-half, half)


def _reach_outside(axes: Any, points: np.ndarray) -> bool:
    """Whether some of the points, or of their conjugates, are not shown."""
    leftmost, rightmost = axes.get_xlim()
    low, high = axes.get_ylim()
    beyond = (
        (points.real < leftmost)
        | (points.real > rightmost)
        | (np.abs(points.imag) > max(high, -low))
    )
    return bool(beyond[np.isfinite(points)].any())


def _face(name: str) -> str:
    return "none" if name.startswith("delay") else MARK  # it often lies where the phase margin does


def in_words(name: str, value: float, omega: float, hz: float) -> str:
    """A margin as the legend has it, rounded to the safe side, with the line that a spectrum shows
    of its crossing."""
    inside = rounded_up if name == "gain_down" else rounded_down
    if np.isclose(2 * np.pi * hz, omega, rtol=1e-6):
        once = ""
    else:
        once = f" (once a frame {omega / (2 * np.pi):.4g} Hz)"
    sizes = {
        "phase": f"{inside(value, 3)}°",
        "delay": f"{inside(1e3 * value, 4)} ms",
        "delay_frames": inside(value, 4),
    }
    decibels = 20 * np.log10(value) if value > 0 else -np.inf
    size = sizes.get(name) or f"{inside(value, 3)} ({inside(decibels, 3)} dB)"
    return f"{name.replace('_', ' ')} {size} at {hz:.4g} Hz{once}"


def decibels_and_degrees(L: np.ndarray, several: bool) -> tuple[np.ndarray, np.ndarray]:
    """Gain (dB) and phase of L, which goes on at -180 degrees and begins at most at 180; of
    eigenvalues that of one turn."""
    if several:
        degrees = -(-np.degrees(np.angle(L)) % 360)
    else:
        degrees = np.degrees(np.unwrap(np.angle(L)))
    degrees -= 360 * np.ceil(np.max(degrees, where=np.isfinite(degrees), initial=-360) / 360 - 0.5)
    with np.errstate(divide="ignore"):
        return 20 * np.log10(np.abs(L)), degrees


def _draw_marks(
    axes: Any, loop: OpenLoop, degrees: np.ndarray, lowest: float, *, of_gain: bool
) -> list[float]:
    """Draw the margins of a loop into the panel of its gain or phase; gives their levels. degrees:
    the phase at the frequencies of `loop.bode`. lowest: frequency that is shown."""
    hertz, L = loop.bode
    levels = []
    for name, mark in loop.marks.items():
        place = max(loop.place(name), lowest)  # 0 Hz is at the left edge
        beside = L[np.argmin(np.abs(hertz - place))]
        # The line is that of the eigenvalue or of its conjugate.
        nearer = abs(mark - beside) <= abs(mark.conjugate() - beside)
        turned = np.degrees(np.angle(mark if nearer else mark.conjugate()))
        turned += 360 * np.round((np.interp(place, hertz, degrees) - turned) / 360)
        end = 0.0 if of_gain else -180 + 360 * np.round((turned + 180) / 360)
        level = 20 * np.log10(abs(mark)) if of_gain else turned
        if of_gain == name.startswith("gain"):  # from the curve to the limit: the margin
            axes.plot([place, place], [level, end], color=MARK, linewidth=1.0)
        face = _face(name)
        style = {"color": MARK, "markersize": 4, "markerfacecolor": face, "clip_on": False}
        axes.plot([place], [level], _MARKS[name], **style)
        levels.append(level)
    return levels


def draw_bode(gain: Any, phase: Any, loop: OpenLoop, other_loops: Others = ()) -> None:
    """Draw gain (dB) and phase of L over the frequencies of the signal, up to half its rate.

    Margins of a lifted signal are those of eigenvalues, which L of the signal's rate meets as far
    as what comes back of a sine is a sine of its frequency.
    """
    hertz, L = loop.bode
    both = decibels_and_degrees(L, False)
    top = loop.rate / 2
    lowest = LOWEST_SHOWN * top
    family_seen = ([], [])
    shown = (hertz >= lowest) & (hertz <= ALMOST * top) & np.isfinite(both[0])
    for member, look, _ in other_loops:
        values_of = decibels_and_degrees(member.bode[1], False)
        f = member.bode[0]
        half = member.rate / 2
        inside = (f >= LOWEST_SHOWN * half) & (f <= ALMOST * half) & np.isfinite(values_of[0])
        for axes, values, seen_values in zip((gain, phase), values_of, family_seen, strict=True):
            axes.plot(member.bode[0], values, **member.drawn(look, points=False))
            seen_values.append(values[inside])
    for row, axes, values, limit in ((0, gain, both[0], 0.0), (1, phase, both[1], -180.0)):
        axes.plot(hertz, values, color=_CURVE, linewidth=1.2)
        axes.axhline(limit, color="0.6", linewidth=0.8, linestyle="--")
        marked = _draw_marks(axes, loop, both[1], lowest, of_gain=axes is gain)
        axes.set_xscale("log")
        axes.set_xlim(lowest, top)
        seen_values = np.concatenate([values[shown], *family_seen[row], np.array(marked)])
        low = min(limit, *seen_values)
        if axes is gain:
            low = max(low, min([LEAST_GAIN, *marked]))
        high = max(limit, *seen_values)
        axes.set_ylim(low - 0.05 * (high - low), high + 0.05 * (high - low))
        axes.grid(**GRID)
    gain.set_ylabel("gain of L (dB)")
    gain.tick_params(labelbottom=False)
    until = f"up to half the {'signal' if loop.several else 'frame'}'s rate"
    phase.set(xlabel=f"frequency (Hz), {until}", ylabel="phase of L (deg)")
    _mark_by(gain, (5, 10, 20, 40, 60))
    _mark_by(phase, (15, 45, 90, 180, 360))


def _mark_by(axes: Any, steps: Sequence[float]) -> None:
    """Put marks on the upright axis at the least of these steps that makes at most seven, or the last."""
    from matplotlib.ticker import MultipleLocator

    low, high = axes.get_ylim()
    step = next((step for step in steps if high - low <= 7 * step), steps[-1])
    axes.yaxis.set_major_locator(MultipleLocator(step))
