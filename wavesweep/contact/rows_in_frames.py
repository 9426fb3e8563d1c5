"""Walls that push and never pull while frames vary: the numbers of a wall for which every motion is
proved to come to rest, whatever frames come."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.checker import balls, contact, file, form
from wavesweep.contact.motions import motion_at, motion_beyond
from wavesweep.contact.stored_search import Graph, Stored, WallSamples, find_stored
from wavesweep.contact.stretches import RESOLVED
from wavesweep.contact.sums_of_squares import balls_of
from wavesweep.contact.wall_loop import WallLoop, WallsAlong
from wavesweep.engine.drawing import path_of
from wavesweep.engine.frames import Bounded
from wavesweep.engine.poles import count_outside
from wavesweep.program.tables.refuters import LINEAR_WALL

LEAST_SHARE = 0.001  # of a wall that a proof goes down in a piece
LONGER, SHORTER = 1.5, 0.4  # times the share after a piece that is proved, or is not
MOST_PIECES = 60  # that are tried in a proof
KNOWN_FRAMES = 3  # nodes know fewer of the last frames than this
MOST_EDGES = 150  # of a graph whose nodes know some


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Walls between which all are proved, the stiffest first, by forms on a graph of frames."""

    walls: tuple[tuple[float, float], ...]
    graph: Graph
    stored: Stored


@dataclass(frozen=True, slots=True, eq=False)
class InFrames:
    """A loop without its wall in all frames that may come.

    samples: frames in doubles, in units in which states, forces and rests are about 1; scale: these units, of
    states, x, v and u of the last sample. graphs: on which forms are looked for. frames: see `WallFrames`,
    in these units, None if the loop is not that of the engine.
    """

    samples: WallSamples
    scale: np.ndarray
    graphs: tuple[Graph, ...]
    frames: Any = None

    @staticmethod
    def in_doubles(samples: WallSamples) -> InFrames:
        """Return the loop of frames in any units, without bounds."""
        samples, units, unit = samples.in_units()
        scale = np.array([*units, unit, unit, 1.0])
        return InFrames(samples, scale, graphs_of(samples.follows))

    @property
    def unit(self) -> float:
        """That of what the wall reads."""
        return float(self.scale[-2])

    @staticmethod
    def of(frames: Any) -> InFrames:
        """Return the loop."""
        n = frames.changes.shape[-1] - 1
        moved = frames.changes[:, :n] + np.eye(n, n + 1)
        slide = frames.changes[:, n]
        samples = WallSamples(moved, frames.rows, slide, frames.drifts, frames.follows)
        loop = InFrames.in_doubles(samples)
        unit = loop.unit
        columns = np.append(loop.scale[:n], 1.0)
        row = 1 / np.append(loop.scale[:n], unit)[:, None]
        scaled = replace(
            frames,
            changes=frames.changes * row * columns,
            changes_error=frames.changes_error * row * columns,
            rows=frames.rows * columns / unit,
            rows_error=frames.rows_error * columns / unit,
        )
        return replace(loop, frames=scaled)

    def found(self, graph: Graph, *walls: tuple[float, float]) -> Piece | None:
        """Forms for a wall (K, B), or for two and all walls between them; None if none are found."""
        in_units = [(K * self.unit, B * self.unit) for K, B in walls]
        stored = find_stored(self.samples, graph, in_units)
        return Piece(walls, graph, stored) if stored else None

    def serves(self, piece: Piece) -> bool:
        """Whether (3) of `checker/contact.py` is proved for all loops within the bounds of this one."""
        size = piece.stored.L.shape[-1]
        signs = [1] * size
        h = Fraction(piece.stored.h)
        for (K, B), roots in zip(piece.walls, piece.stored.L, strict=True):
            frames = self._sampled(
                Fraction(K) * Fraction(self.unit), Fraction(B) * Fraction(self.unit)
            )
            forms = []
            for L in roots:
                rows = [[repr(x) for x in row] for row in L.tolist()]
                forms.append(file.form_from({"L": rows}, balls.POINT, signs).parts[()])
            steps = zip(piece.graph.edges.tolist(), piece.stored.weights.tolist(), strict=True)
            for (source, frame, target), (g, a) in steps:
                weights = h, Fraction(g), Fraction(a)
                left = contact.left_over_of(frames[frame], forms[source], forms[target], weights)
                if not form.positive(left):
                    return False
        return True

    def _sampled(self, K: Fraction, B: Fraction) -> list[contact.Sampled]:
        """The frames at a wall as the inequality has them."""
        of = self.frames
        n = of.changes.shape[-1] - 1
        identity = Bounded.exact(np.eye(n, n + 1))
        x = Bounded.exact(np.eye(n + 3)[n : n + 2])
        found = []
        for change, change_error, rows, rows_error in zip(
            of.changes, of.changes_error, of.rows, of.rows_error, strict=True
        ):
            changes = Bounded(change, change_error)
            read = Bounded(rows, rows_error)
            last = Bounded.joined([read.part([0]) - changes.part([n]), read.part([1])], -2)
            moved = Bounded.joined([changes.part(slice(n)) + identity, last], -2)
            rows_of = [_wide(each) for each in (moved, read)]
            risen = rows_of[1] - x
            rise, now = (_at_wall(balls_of(each), K, B) for each in (risen, rows_of[1]))
            found.append(contact.Sampled(balls_of(rows_of[0]), rise, None if of.drifts else now))
        return found

    @property
    def unstable(self) -> str:
        """That the loop without its wall is proved to be unstable in frames of one length, in words;
        empty if it is not."""
        found = (
            f"in frames of {frame} {each.without_wall}"
            for frame, each in self.constant()
            if each.unstable
        )
        return next(found, "")

    def constant(self) -> list[tuple[str, WallLoop]]:
        """The loop in frames of one kind for ever, with the names of these."""
        found = []
        own = np.flatnonzero(np.diagonal(self.frames.follows))
        for i in own.tolist():
            n = self.frames.changes.shape[-1] - 1
            change = Bounded(self.frames.changes[i], self.frames.changes_error[i])
            E = change.part(slice(n), slice(n))
            B = change.part(slice(n), n)
            omega = np.zeros(n)
            residue = 0.0
            if self.frames.drifts:
                omega = np.linalg.solve(-E.value.T, change.value[n, :n])
                residue = change.value[n, n] + omega @ B.value
            rows = self.frames.rows[i].copy()
            rows[0, :n] -= omega
            read = Bounded(rows * self.unit, self.frames.rows_error[i])
            count, clear = count_outside(E.value[None], E.error[None])
            loop = WallLoop(
                E,
                B,
                read.part(slice(None), slice(n)),
                read.part(slice(None), n),
                Bounded.exact(residue * self.unit),
                bool(clear[0] and count[0] == 0),
                bool(clear[0] and count[0] > 0),
            )
            found.append((self.frames.names[i], loop))
        return found


def in_frames(rules: Any, values: dict[str, Any], wall: list[str]) -> InFrames | None:
    """Return a loop of some rules in its frames; None if there is a reason against it."""
    try:
        return fit_frames(rules, values, wall)
    except offered("rules").UnfitWallError:
        return None


def fit_frames(rules: Any, values: dict[str, Any], wall: list[str]) -> InFrames:
    """Return a loop of some rules in its frames. Errors: UnfitWallError, with the reason, if its
    wall is not one scalar of each."""
    asked = offered("rules")
    frames = asked.wall_frames(rules.plan(values, tuple(wall)), wall)
    if not frames.follows.all():
        raise asked.UnfitWallError("one whose results may be lost")
    return InFrames.of(frames)


@dataclass(frozen=True, slots=True, eq=False)
class Along:
    """Walls of a loop along one of their numbers: index 0 is K, with B `fixed`; 1 is B, K fixed."""

    loop: InFrames
    index: int
    fixed: float

    def wall(self, value: float) -> tuple[float, float]:
        """The wall of a value."""
        if self.index == 0:
            return (value, self.fixed)
        return (self.fixed, value)

    def proved(self, low: float, high: float) -> list[Piece]:
        """Pieces that prove an interval, from near its low end on, the highest first; empty if none do.

        Nothing is beyond a motion that goes on in frames of one length, and most proofs end near
        the first of these.
        """
        ceiling, _ = self.motion(low, high)
        if np.isnan(ceiling):
            ceiling = high
        tops = [np.nan]
        for graph in self.loop.graphs:
            tops.append(self._end(graph, low, ceiling, tops[-1]))
        best: list[Piece] = []
        # The largest graph reaches highest; a smaller one is tried above what is proved already.
        for graph, top in zip(reversed(self.loop.graphs), reversed(tops[1:]), strict=True):
            # How far below the end that is found a proof is tried, of that.
            for back in (0.0, 1e-4, 1e-3, 0.01, 0.03, 0.1, 0.3):
                begun = (1 - back) * top
                if not begun > max([low, *(self.value(piece.walls[0]) for piece in best)]):
                    break
                # Of what begins at 0 a thousandth of the end is left out.
                goal = max(low, 1e-3 * begun) if low >= 0 else low
                pieces = self.down(graph, begun, goal, self.loop.serves)
                if pieces:
                    best = pieces
                    break
        return best

    def _end(self, graph: Graph, low: float, ceiling: float, top: float) -> float:
        """The highest value for which forms are found, from `top` on, if that is known; NaN without."""
        above = ceiling
        if self._found_at(graph, ceiling):
            return ceiling
        for halved in range(14 if np.isnan(top) else 0):  # down to where a first form is looked for
            value = low + (ceiling - low) / 2**halved * (0.99 if halved == 0 else 1.0)
            if self._found_at(graph, value):
                top = value
                break
            above = value
        resolved = RESOLVED if graph is self.loop.graphs[-1] else 5 * RESOLVED
        step = 0.02 * abs(top)  # first a little beyond what is found with a smaller graph
        while not np.isnan(top) and above - top > resolved * max(abs(above), abs(top)):
            middle = min(top + step, (top + above) / 2)
            step *= 2
            if self._found_at(graph, middle):
                top = middle
            else:
                above = middle
        return top

    def _found_at(self, graph: Graph, value: float) -> bool:
        return self.loop.found(graph, self.wall(value)) is not None

    def value(self, wall: tuple[float, float]) -> float:
        """The value of a wall."""
        return wall[self.index]

    def down(
        self, graph: Graph, top: float, goal: float, serves: Callable[[Piece], bool]
    ) -> list[Piece]:
        """How far down from `top` walls are proved without a gap, in pieces with forms of their own.
        serves: the check of a piece."""
        pieces: list[Piece] = []
        reached = top
        share = 1.0
        for _ in range(MOST_PIECES):
            if (pieces and reached <= goal) or share < LEAST_SHARE:
                break
            below = max(goal, reached - share * max(abs(reached), goal))
            walls = [self.wall(value) for value in dict.fromkeys((reached, below))]
            piece = self.loop.found(graph, *walls)
            if piece and serves(piece):
                pieces.append(piece)
                reached = below
                share = min(1.0, share * LONGER)
            else:
                share *= SHORTER
        return pieces

    def motion(self, end: float, limit: float) -> tuple[float, str]:
        """The nearest value beyond an end that a motion refutes in frames of one length, and what
        it is; NaN and nothing if none is found."""
        best = np.nan, ""
        for frame, loop in self.loop.constant():
            motion = motion_beyond(WallsAlong(loop, self.index, self.fixed), end, limit)
            if motion and not abs(motion.value - end) >= abs(best[0] - end):
                best = motion.value, _in_words(motion, frame)
        return best


def graphs_of(follows: np.ndarray) -> tuple[Graph, ...]:
    """Return the graphs on which forms are looked for, one after the other."""
    first, *others = (Graph.of(follows, known) for known in range(KNOWN_FRAMES))
    return (first, *(graph for graph in others if len(graph.edges) <= MOST_EDGES))


def _wide(rows: Bounded) -> Bounded:
    """Rows over (eta, u) as rows over (eta, x, v, u)."""
    n = rows.value.shape[-1] - 1
    return rows.each(lambda matrix: np.insert(matrix, [n, n], 0.0, axis=-1))


def _at_wall(rows, K: Fraction, B: Fraction):
    """K times the first row and B times the second one, of balls."""
    multiply = balls.POINT.ring.multiply
    pairs = zip(*rows, strict=True)
    return [balls.add(multiply(balls.ball(K), x), multiply(balls.ball(B), v)) for x, v in pairs]


def along_of(rules: Any, values: dict[str, Any], wall_names: list[str], along: str) -> Along | None:
    """Return the walls of a loop along a number of its wall; None if the proof is not about it."""
    wall = [path_of(name) for name in wall_names]
    loop = in_frames(rules, values, wall)
    if loop is None:
        return None
    index = wall.index(along)
    fixed = float(values[wall[1 - index]]) if len(wall) > 1 else 0.0
    return Along(loop, index, fixed)


def _in_words(motion, frame):
    return str(motion).replace("a wall through", f"a wall, in frames of {frame}, through", 1)


def verdict_in_frames(rules: Any, values: dict[str, Any], wall: list[str]) -> dict[str, str]:
    """What is known of a wall itself in all frames: verdict and counterexample, as
    `verdict.of_wall`."""
    numbers = [float(values[path]) for path in wall]
    K, B = (*numbers, 0.0)[:2]
    loop = in_frames(rules, values, wall)
    if loop is None:
        return {"verdict": "unknown", "counterexample": ""}
    if loop.unstable:
        return {"verdict": "refuted", "counterexample": f"no contact at all: {loop.unstable}"}
    for graph in loop.graphs:
        piece = loop.found(graph, (K, B))
        if piece and loop.serves(piece):
            return {"verdict": "proved", "counterexample": ""}
    asked = offered("rules")
    said, by = asked.decided_over(rules, values, ())
    if said == "refuted":
        return {"verdict": "refuted", "counterexample": f"{LINEAR_WALL}, {', '.join(by)}"}
    for frame, constant in loop.constant():
        motion = motion_at(WallsAlong(constant, 0, B), K)
        if motion:
            text = _in_words(motion, frame)
            return {"verdict": "refuted", "counterexample": text}
    return {"verdict": "unknown", "counterexample": ""}
