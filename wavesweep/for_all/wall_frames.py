"""Frames of a loop without its wall: what the wall reads once a frame, and what its force moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine.blocks import BESIDE, FACTOR, PRODUCT
from wavesweep.engine.doubles import ENTRY_ROUNDING
from wavesweep.engine.drawing import name_of
from wavesweep.engine.frames import (
    Bounded,
    MarginalModes,
    Ticks,
    both,
    pattern_of,
    products_of_rows,
)
from wavesweep.engine.loop import Loops

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wavesweep.for_all.plan import Plan

READ = (FACTOR, BESIDE)
OTHER_DRIFT = (
    "a loop that drifts without its wall otherwise than by the one position that the wall reads"
)


class UnfitWallError(Exception):
    """A loop whose wall is not one scalar of each frame; its text says what it is."""


@dataclass(frozen=True, slots=True, eq=False)
class WallFrames:
    """Frames of each kind from one sample of the wall to the next, without the wall:

        eta+ = A eta + b u,   p+ = p + l' eta + r u,
        x = p + o' eta + d_x u,   v = c' eta + d_v u.

    x, v: what stiffness and damping of the wall multiply at the sample that ends the frame; u: the
    wall's force from then on. p: what the wall reads of all positions that nothing opposes, as that of
    a device which floats freely; drifts: whether there are such, or else l, r and p are 0. changes `(frames, n + 1, n + 1)`:
    A less the identity and b, with the row (l, r) below; rows `(frames, 2, n + 1)`: (o, d_x) and
    (c, d_v). changes_error, rows_error: bounds on their errors. follows: which frame
    (column) may come after which (row). names: of each, its ticks and, where delays vary, its delay.
    """

    changes: np.ndarray
    rows: np.ndarray
    changes_error: np.ndarray
    rows_error: np.ndarray
    drifts: bool
    follows: np.ndarray
    names: tuple[str, ...]


def wall_frames(plan: Plan, wall: Sequence[str]) -> WallFrames | None:
    """Return the frames of a plan without the numbers of its wall; None if these are not one scalar
    of a frame, or the loop without them drifts otherwise than by a position that the wall reads.

    wall: the paths of stiffness and damping.
    """
    names = [name_of(path) for path in wall]
    signals = READ[: len(names)]
    if not all(plan.drawing.scalar_place(name) for name in names):
        return None
    open_values = {**plan.values, **dict.fromkeys(wall, 0.0)}

    def loops_at(step):
        return Loops(plan.schedule.with_period(plan.drawing, step), open_values)

    def ticks_at(step):
        drawn = plan.schedule.scheduled(loops_at(step).drawn(*names))
        held = drawn.held(signals)
        return Ticks.of(drawn, signals, alone=True, through=PRODUCT, held_ports=held, terms=True)

    twins = map(plan.schedule.scheduled, loops_at(plan.schedule.nominal).twins(*names))
    drift = MarginalModes.of(*twins, signals)
    maps, _, index = plan.different_ticks(ticks_at)
    if drift.varying or maps[0].states != drift.states:
        raise UnfitWallError(OTHER_DRIFT)
    ticks, _ = drift.relative_ticks(Ticks(tuple(maps), np.arange(len(maps))))
    befores, samples, symbols, follows = plan.written(index)
    acts = [bool(tick.inputs) for tick in ticks.maps]
    if not all(acts[sample] for sample in samples):
        raise UnfitWallError("one that does not act in each frame")
    if any(acts[i] for row in befores for i in row):
        raise UnfitWallError("one that acts several times in a frame")
    frames = list(_frames(ticks, befores, samples))
    delays_vary = len({symbol.delay for symbol in symbols}) > 1
    words = []
    for symbol in symbols:
        words.append(f"{symbol.ticks} ticks" + f" and a delay of {symbol.delay}" * delays_vary)
    return _without_drift(frames, drift, follows, tuple(words))


def _frames(ticks: Ticks, befores, samples):
    """Yield of each frame its changes `[A - 1, B]`, `(n, n + 1)`, and the row `[C, D]`, `(1, n + 1)`, that the
    wall reads, from states and the wall's force; then bounds on the errors of both.

    befores: the ticks of each frame before the one in which the force acts, `samples`. Where no tick's
    pattern has an entry of A, it is 0 exactly.
    """
    n = len(ticks.states)
    identity = np.eye(n)
    nothing = np.zeros((1, n, n))
    square = [each.E for each in ticks.maps]
    changes = np.concatenate([square, nothing])
    sizes = np.concatenate([[each.terms[0] for each in ticks.maps], nothing])
    still = (len(ticks.maps),)  # a row in which nothing happens
    rows = [tuple(row) or still for row in befores]
    E, dE = products_of_rows(rows, (changes, ENTRY_ROUNDING * sizes), both)
    for i, (row, sample) in enumerate(zip(rows, samples, strict=True)):
        tick = ticks.maps[sample]
        acts = pattern_of(np.array(row), list(changes))
        first = np.where(acts, E[i], -identity), np.where(acts, dE[i], 0.0)
        whole, whole_error = both(first, (tick.E, ENTRY_ROUNDING * tick.terms[0]))
        acts = pattern_of(np.array([*row, sample]), list(changes))
        whole, whole_error = np.where(acts, whole, -identity), np.where(acts, whole_error, 0.0)
        moved = Bounded.exact(identity) + Bounded(*first)
        read = Bounded(tick.C, ENTRY_ROUNDING * tick.terms[2]) @ moved
        yield (
            np.concatenate([whole, tick.B], axis=1),
            np.concatenate([read.value, tick.D], axis=1),
            np.concatenate([whole_error, ENTRY_ROUNDING * tick.terms[1]], axis=1),
            np.concatenate([read.error, ENTRY_ROUNDING * tick.terms[3]], axis=1),
        )


def _without_drift(frames, drift, follows, names) -> WallFrames:
    """The frames with the drift that the wall reads as their last state, and without states that
    nothing reads. Errors: UnfitWallError of another drift."""
    changes, rows, changes_error, rows_error = map(np.array, zip(*frames, strict=True))
    if rows.shape[1] == 1:  # no damping
        rows = np.concatenate([rows, np.zeros_like(rows)], axis=1)
        rows_error = np.concatenate([rows_error, np.zeros_like(rows_error)], axis=1)
    moving = [lead for lead in drift.leads if rows[:, 0, lead].any()]
    if rows[:, 1, drift.leads].any():
        raise UnfitWallError(OTHER_DRIFT)
    states = list(drift.remaining)
    force = changes.shape[-1] - 1
    while True:
        read = (changes[:, [*states, *moving]] != 0).any(0)
        # The change of a state that each frame sets anew is its own value, which it does not read.
        for index, state in enumerate(states):
            read[index, state] = (changes[:, state, state] != -1).any()
        is_read = read.any(0) | (rows != 0).any((0, 1))
        if is_read[states].all():
            break
        states = [state for state in states if is_read[state]]
    columns = [*states, force]
    # A shift of all that drifts is constant in every signal, so that its share of what the wall reads is
    # one number for all frames, within the bounds of the first of them.
    share = Bounded(rows[:1, :1, moving], rows_error[:1, :1, moving])
    of = Bounded(changes, changes_error)
    read = share @ of.part(*np.ix_(range(len(changes)), moving, columns))
    moved = of.part(*np.ix_(range(len(changes)), states, columns))
    whole = Bounded.joined([moved, read], -2)
    seen = rows[..., columns], rows_error[..., columns]
    return WallFrames(whole.value, seen[0], whole.error, seen[1], bool(moving), follows, names)
