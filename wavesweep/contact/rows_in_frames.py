"""Walls that push and never pull while frames vary: the numbers of a wall for which every motion is
proved to come to rest, whatever frames come."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.contact.coming_rests import edges_of
from wavesweep.contact.motions import motion_at, motion_beyond
from wavesweep.contact.stored_check import Conditions, Stored, falls
from wavesweep.contact.stored_search import find_stored
from wavesweep.contact.stretches import RESOLVED
from wavesweep.contact.wall_loop import WallLoop, WallsAlong
from wavesweep.engine.drawing import path_of
from wavesweep.engine.frames import Bounded
from wavesweep.engine.poles import count_outside

# Shares of a wall that a proof goes down in a piece: the first and largest one, and the least that is
# tried.
MOST_SHARE, LEAST_SHARE = 0.9, 0.001
LONGER, SHORTER = 1.5, 0.4  # times the share after a piece that is proved, or is not
MOST_PIECES = 60  # that are tried in a proof


@dataclass(frozen=True, slots=True, eq=False)
class InFrames:
    """A loop without its wall in all frames that may come; without conditions, one that is
    unstable.

    frames: see `WallFrames`, in units in which states, forces and rests are about 1; unit: of the
    wall's position in these. finer: the same with more conditions, for what is not proved otherwise.
    """

    frames: Any
    conditions: Conditions | None
    unit: float
    finer: tuple[InFrames, ...] = ()

    @staticmethod
    def of(frames: Any) -> InFrames | None:
        """Return the loop; None if it is not known that it comes to rest, and farther from the wall
        with each push of that."""
        frames, unit = _in_units(frames)
        alone = InFrames(frames, None, unit)
        loops = []
        # Frames that a node knows: proofs begin with the first, and go on with those after it.
        for ahead in range(3):
            edges = edges_of(frames, ahead, 2)
            if edges is None:
                return alone if alone.unstable else None
            conditions = Conditions.on_edges(frames, edges)
            if loops and conditions.R.value.size > 150:  # conditions of a proof
                break
            if conditions.are_met_by_rests:
                loops.append(InFrames(frames, conditions, unit))
            if conditions.exact:
                break
        if not loops:
            return alone if alone.unstable else None
        return replace(loops[0], finer=tuple(loops[1:]))

    def wall(self, K: float, B: float) -> tuple[float, float]:
        """A wall as the conditions have it."""
        return K * self.unit, B * self.unit

    def found(self, *walls: tuple[float, float]) -> list[Stored]:
        """Forms that are proved for a wall (K, B), or for two and all walls between them, one for each of
        these; nothing if none are found."""
        if self.conditions.drifts and not walls[-1][0] > 0:
            return []
        in_units = [self.wall(*wall) for wall in walls]
        stored = find_stored(self.conditions, in_units)
        if stored and falls(self.conditions, list(zip(stored, in_units, strict=True))):
            return stored
        return []

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
    wall is not one scalar of each, or its force is not known to move the rest away from it."""
    asked = offered("rules")
    found = InFrames.of(asked.wall_frames(rules.plan(values, tuple(wall)), wall))
    if found is None:
        reason = (
            "a loop of which it is not known that each force of the wall moves its rest away from it, "
            "as where results are lost"
        )
        raise asked.UnfitWallError(reason)
    return found


def _in_units(frames):
    """The frames in units, powers of two, in which all that a force of 1 moves is about 1."""
    n = frames.changes.shape[-1] - 1
    A = np.eye(n) + frames.changes[:, :n, :n]
    b = frames.changes[:, :n, n]
    gramian = np.zeros((n, n))
    with np.errstate(all="ignore"):
        for _ in range(200):  # frames of whose sum units follow
            gramian = (A @ gramian @ A.mT + b[:, :, None] * b[:, None]).mean(0)
    size = np.sqrt(np.diagonal(gramian))
    known = np.isfinite(size) & (size > 0)
    units = np.exp2(np.round(np.log2(np.where(known, size, 1.0))))
    unit = 1.0
    if frames.drifts:
        with np.errstate(all="ignore"):
            omega = np.linalg.pinv(np.eye(n) - A.mean(0).T) @ frames.changes[:, n, :n].mean(0)
        moved = float(np.abs(frames.changes[:, n, n] + b @ omega).mean())
    else:
        moved = float(np.abs(frames.rows[:, 0] * np.append(units, 1.0)).max())
    if moved > 0:
        unit = 2.0 ** round(np.log2(moved))
    column = np.append(units, 1.0)
    row = np.append(1 / units, 1 / unit)
    scaled = replace(
        frames,
        changes=frames.changes * row[:, None] * column,
        changes_error=frames.changes_error * row[:, None] * column,
        rows=frames.rows * column / unit,
        rows_error=frames.rows_error * column / unit,
    )
    return scaled, unit


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

    def proved(self, low: float, high: float) -> tuple[float, float] | None:
        """What is proved in an interval, from near its low end on; None if nothing is.

        Nothing is beyond a motion that goes on in frames of one length, and most proofs end near
        the first of these.
        """
        proved = self.proved_alone(low, high)
        for loop in self.loop.finer:
            finer = replace(self, loop=loop)
            if not proved:
                proved = finer.proved_alone(low, high)
                continue
            begin, end = proved
            goal = _goal(low, end)
            begin = finer.down(begin, goal)
            if end < high:
                beyond = finer.proved_alone(end, high)
                if beyond and beyond[0] == end:
                    end = beyond[1]
            proved = begin, end
        return proved

    def proved_alone(self, low: float, high: float) -> tuple[float, float] | None:
        """The same with the conditions of this loop alone."""
        ceiling, _ = self.motion(low, high)
        if np.isnan(ceiling):
            reached = self.down(high, low)
            if reached < high:
                return reached, high
            ceiling = high
        above = ceiling
        # How far before a first motion that goes on a proof is tried, of the way to it.
        top = ceiling - 0.01 * (ceiling - low)
        found = self.proved_at(top)
        for halved in range(1, 14):  # halvings of the range, down to where a first proof is tried
            if found:
                break
            above = top
            top = low + (ceiling - low) / 2**halved
            found = self.proved_at(top)
        else:
            return None
        while above - top > RESOLVED * max(abs(above), abs(top)):
            middle = (top + above) / 2
            if self.proved_at(middle):
                top = middle
            else:
                above = middle
        return self._longest(top, low)

    def _longest(self, top: float, low: float) -> tuple[float, float]:
        """The longest interval that is proved down from `top` or from a little below it: a wall that
        is only just proved may be so with no other."""
        best = self.down(top, low), top
        # How far below a wall a proof is begun once more, of the wall.
        for back in (0.01, 0.03, 0.1, 0.3):
            if best[0] < (1 - back) * best[1]:
                break
            begun = (1 - back) * top
            best = max(best, (self.down(begun, low), begun), key=lambda ends: ends[1] - ends[0])
        return best

    def proved_at(self, value: float) -> bool:
        """Whether a value is proved."""
        return bool(self.loop.found(self.wall(value)))

    def down(self, top: float, low: float) -> float:
        """How far down from `top` walls are proved without a gap, in pieces with forms of their
        own."""
        goal = _goal(low, top)
        reached = top
        share = MOST_SHARE
        for _ in range(MOST_PIECES):
            if reached <= goal or share < LEAST_SHARE:
                break
            below = max(goal, reached - share * max(abs(reached), goal))
            if self.loop.found(self.wall(reached), self.wall(below)):
                reached = below
                share = min(MOST_SHARE, share * LONGER)
            else:
                share *= SHORTER
        return reached

    def motion(self, end: float, limit: float) -> tuple[float, str]:
        """The nearest value beyond an end that a motion refutes in frames of one length, and what
        it is; NaN and nothing if none is found."""
        best = np.nan, ""
        for frame, loop in self.loop.constant():
            motion = motion_beyond(WallsAlong(loop, self.index, self.fixed), end, limit)
            if motion and not abs(motion.value - end) >= abs(best[0] - end):
                best = motion.value, _in_words(motion, frame)
        return best


def _goal(low, top):
    """How far down a proof from `top` goes: of what begins at 0, to a thousandth of that."""
    return max(low, 1e-3 * top) if low >= 0 else low


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
    for each in (loop, *loop.finer):
        if each.found((K, B)):
            return {"verdict": "proved", "counterexample": ""}
    asked = offered("rules")
    said, by = asked.decided_over(rules, values, ())
    if said == "refuted":
        return {"verdict": "refuted", "counterexample": f"the linear wall, {', '.join(by)}"}
    for frame, constant in loop.constant():
        motion = motion_at(WallsAlong(constant, 0, B), K)
        if motion:
            text = _in_words(motion, frame)
            return {"verdict": "refuted", "counterexample": text}
    return {"verdict": "unknown", "counterexample": ""}
