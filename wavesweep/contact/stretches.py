"""Stretches of a number of the wall that are proved: found by steps, checked by sums of squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wavesweep.contact.motions import motion_beyond
from wavesweep.contact.multipliers import LEAST_SHARE, Multiplier, Sampled
from wavesweep.contact.sums_of_squares import serves
from wavesweep.contact.wall_loop import WallLoop, WallsAlong
from wavesweep.engine.frames import Bounded, balance

TRIED_NEAR_END = 2e-4  # of a linear interval, how near to its ends a proof is tried
RESOLVED = 2e-4  # of the end that is found, how far the next failure is known to be


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Values from low to high that are proved with one multiplier."""

    low: float
    high: float
    multiplier: Multiplier


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """Values that are proved in pieces, each of which begins where the next one ends."""

    pieces: tuple[Piece, ...]

    @property
    def low(self) -> float:
        """Where it begins."""
        return self.pieces[-1].low

    @property
    def high(self) -> float:
        """Where it ends."""
        return self.pieces[0].high


@dataclass(slots=True)
class Line:
    """The search along a number of the wall; its sampled angles become more where a check fails."""

    walls: WallsAlong
    sampled: Sampled

    @staticmethod
    def of(walls: WallsAlong) -> Line:
        """Begin with the usual angles."""
        return Line(walls, Sampled.of(walls.loop, np.zeros(0)))

    def proved(self, low: float, high: float, *, whole: bool = True) -> Piece | None:
        """A piece from low to high that is checked; None if no multiplier is found.

        whole: whether it has to begin at low; otherwise it begins where the best multiplier at high
        ceases to serve.
        """
        start = low
        for _ in range(4):  # sampled again at most, with angles at which the check fails
            ends = self.walls.at(low, high) if whole else self.walls.at(high)
            multiplier, margin = self.sampled.multiplier(ends)
            if not margin > LEAST_SHARE:
                return None
            if not whole:
                reached, _ = self.sampled.reach(multiplier, self.walls)
                start = max(low, reached + TRIED_NEAR_END * (high - reached))
            ends = self.walls.at(start, high)
            missed = self.sampled.missed(multiplier, self.walls.loop, ends)
            if not missed.size:
                proved = serves(self.walls.loop, ends, multiplier)
                return Piece(start, high, multiplier) if proved else None
            angles = np.concatenate([self.sampled.angles, missed])
            self.sampled = Sampled.of(self.walls.loop, angles)
        return None

    def end(self, seed: float, limit: float) -> float:
        """The value nearest to `limit` that a multiplier serves at the sampled angles.

        seed: a value that some multiplier serves. Each step takes the multiplier of a value as far
        as it serves, or else halves the way that is left.
        """
        best = value = seed
        beyond = limit
        for _ in range(12):  # steps towards an end, at most
            multiplier, margin = self.sampled.multiplier(self.walls.at(value))
            if margin > LEAST_SHARE:
                reach = self.sampled.reach(multiplier, self.walls)
                up = limit > seed
                reached = min(reach[up], beyond) if up else max(reach[up], beyond)
                best = max(value, reached) if up else min(value, reached)
            else:
                beyond = value
            if abs(beyond - best) <= RESOLVED * max(abs(best), abs(beyond)):
                break
            value = best + 0.5 * (beyond - best)
        return best

    def _seed(self, low, high):
        """A value between others at which a multiplier is found with some margin; None without."""
        # Shares of a linear interval, where a first value is looked for.
        for share in (0.3, 0.1, 0.01, 0.001, 0.6, 0.9):
            value = low + share * (high - low)
            _, margin = self.sampled.multiplier(self.walls.at(value))
            if margin > LEAST_SHARE:
                return value
        return None

    def stretch(self, low: float, high: float) -> Stretch | None:
        """The stretch that is proved within (low, high); None if none is found.

        low, high: of an interval in which the linear loop is stable. It ends before the first
        motion that goes on, and mostly next to it, so that this is tried first.
        """
        motion = motion_beyond(self.walls, low, high)
        ceiling = motion.value if motion else high
        # Of a stretch, which a check needs before the first motion that goes on.
        below_motion = low + (1 - 2e-3) * (ceiling - low)
        whole = self.proved(low, below_motion if motion else high)
        if whole is not None:
            return Stretch((whole,))
        seed = self._seed(low, ceiling)
        if seed is None:
            return None
        motion = motion_beyond(self.walls, seed, low)
        floor = motion.value + 2e-3 * abs(motion.value) if motion else low
        bottom = self.end(seed, floor)
        top = self.end(seed, ceiling)
        pieces: list[Piece] = []
        # Shares that are given up in turn, for a check of the first piece; after it they mean nothing.
        for back in (0, 1e-3, 3e-3, 0.01, 0.03, *[0.1] * 20):
            at = pieces[-1].low if pieces else top - back * (top - bottom)
            piece = self.proved(bottom, at) or self.proved(bottom, at, whole=False)
            if piece:
                pieces.append(piece)
            ended = piece.low <= bottom if piece else pieces or back == 0.1
            if ended:
                break
        return Stretch(tuple(pieces)) if pieces else None


def pieces_of(
    moved: np.ndarray,
    read: np.ndarray,
    residue: float,
    along: tuple[int, float],
    span: tuple[float, float],
) -> list[Piece]:
    """Return pieces that prove all values from span[0] to span[1], the highest first; an empty list
    if none are found.

    moved `(n, n + 1)`: what states and the wall's force make of states in a frame; read `(2, n + 1)`,
    residue: see `WallLoop`. along: whether 0, K, or 1, B, varies, and the other number.
    """
    n = len(moved)
    E = moved[:, :n] - np.eye(n)
    _, (units,) = balance(E[None])
    E *= units / units[:, None]
    B, rows, direct = moved[:, n] / units, read[:, :n] * units, read[:, n]
    fields = map(Bounded.exact, (E, B, rows, direct, np.array(residue)))
    line = Line.of(WallsAlong(WallLoop(*fields, stable=True, unstable=False), *along))
    low, at = span
    pieces: list[Piece] = []
    while not pieces or at > low:
        piece = line.proved(low, at) or line.proved(low, at, whole=False)
        if piece is None or (pieces and piece.low >= at):
            return []
        pieces.append(piece)
        at = piece.low
    return pieces
