"""Factors of the signal at a cut with which a loop that has a margin there is stable, as numbers.

A loop has a margin if it is stable with every factor of a set. Gains are real. The set of a
phase is an arc; phases below 0 are conjugates. Those of a disk margin a and of a peak sensitivity S
are the images of `|e| <= a/2` and `|e| <= 1/S` by `k = (1 + c e)/(1 - e)`, c = 1 and 0: `1 + k L = 0`
where 1/|e| is the distance of `1/(1 + L)` from 1/2, or from 0. Where frames are polynomials in k they
are analytic in e, and a spectral radius has no peak inside: the rim is enough.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from wavesweep.engine.drawing import BLOCK, GAIN, path_of
from wavesweep.engine.errors import UsageError
from wavesweep.engine.expressions import Tree, parse
from wavesweep.engine.frames import frames_where_solvable
from wavesweep.engine.loop import Loops
from wavesweep.program.analyses.cuts import fault_of_cut
from wavesweep.program.reading.axes import Axis

PATH = "sweep.require"
CIRCLE = (
    "(1 + (c - 1)*p*cos(psi) - c*p*p)/(1 - 2*p*cos(psi) + p*p)",
    "(c + 1)*p*sin(psi)/(1 - 2*p*cos(psi) + p*p)",
)
TWO_VALUES = np.array([0.5, 2.0])  # of the factor: what differs with them depends on it


def with_factors(
    loops: Loops, margins: Mapping[str, Any], varied: Mapping[str, Sequence[float]]
) -> Iterator[tuple[Loops, list[Axis]]]:
    """Yield the loops with the factor of each margin that is asked at a cut, and the ranges of the
    numbers that it follows from.

    margins: cut, and some of gain, phase_deg, disk and Ms. varied: path -> ends of other numbers of the
    loops. Errors: UsageError for a cut at which there is no such factor.
    """
    cut = margins["cut"]
    if fault := fault_of_cut(loops.drawing, cut):
        raise UsageError(f"{PATH}.margins.cut: expected {fault[0]}, found {fault[1]}")
    if "gain" in margins:
        gain = _range(f"gain at {cut}", 1 / margins["gain"], margins["gain"])
        yield loops.with_gain_at(cut, gain.name), [gain]
    turned = loops.with_gain_at(cut)
    if "phase_deg" in margins:
        turn = _range(f"phase_deg at {cut}", 0.0, margins["phase_deg"])
        angle = _angle(turn)
        parts = Tree("cos", (angle,)), Tree("sin", (angle,))
        yield _with_turned(turned, parts, [turn]), [turn]
    if "disk" in margins:
        yield _with_circle(turned, f"disk at {cut}", margins["disk"] / 2, 1.0, varied)
    if "Ms" in margins:
        yield _with_circle(turned, f"Ms at {cut}", 1 / margins["Ms"], 0.0, varied)


def on_circle(size: Tree, angle: Tree, c: float) -> tuple[Tree, Tree]:
    """Return the real and imaginary part of the factor k of the module's text, of `e = size e^(j
    angle)`, the angle in rad."""
    trees = {"p": size, "psi": angle, "c": Tree.number(c)}
    re, im = (parse(text).with_trees(trees) for text in CIRCLE)
    return re, im


def comes_back_at_once(loops: Loops, varied: Mapping[str, Sequence[float]]) -> bool:
    """Whether the signal of loops with a gain at a cut comes back in the tick in which it is made, so
    that frames have poles in its factor and the rim of a circle is not enough; varied: see
    `with_factors`."""
    # What depends on the factor anywhere does so at a place that nobody has chosen.
    shares = np.sqrt(np.arange(2, 2 + len(varied))) % 1
    place = {
        path: np.full(2, low + share * (high - low))
        for (path, (low, high)), share in zip(varied.items(), shares, strict=True)
    }
    two = loops.changed({**place, path_of(GAIN): TWO_VALUES})
    pivots = frames_where_solvable(two, two.drift_of_frames(), (2,)).pivots
    return bool((pivots[0] != pivots[1]).any())


def _range(name: str, low: float, high: float) -> Axis:
    """The range of a number of no spec."""
    return Axis(name, path_of(name), (), low, high, structural=False)


def _angle(turn: Axis) -> Tree:
    """The angle (rad) of a number in degrees."""
    return parse("pi/180*turn").with_trees({"turn": Tree.name(turn.name)})


def _with_turned(loops: Loops, parts: tuple[Tree, Tree], sides: Sequence[Axis]) -> Loops:
    """Loops, cut at a signal, with a complex factor there, whose numbers have the ends of their
    ranges."""
    return loops.with_complex_factor(*parts).changed({side.path: side.stop for side in sides})


def _with_circle(
    loops: Loops, name: str, radius: float, c: float, varied: Mapping[str, Sequence[float]]
) -> tuple[Loops, list[Axis]]:
    """Loops with the factors k of the module's text, `|e| <= radius`, and the ranges of e: of its
    angle on the rim alone, if the signal comes back in no tick at once."""
    runs = next(block for block in loops.drawn().placed if block.block.name == BLOCK)
    if np.count_nonzero(runs.runs(loops.drawn().ticks)) > 1:
        margin, _, cut = name.partition(" at ")
        expected = "a signal that is made once in a frame"
        raise UsageError(
            f"{PATH}.margins.{margin}: expected {expected} beside [for_all], found {cut}"
        )
    turn = _range(f"degrees of turn for {name}", 0.0, 180.0)
    sides = [turn]
    size = Tree.number(radius)
    if comes_back_at_once(loops, varied):
        sides.append(_range(f"size for {name}", 0.0, radius))
        size = Tree.name(sides[1].name)
    return _with_turned(loops, on_circle(size, _angle(turn), c), sides), sides
