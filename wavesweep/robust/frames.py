"""The frames of a loop whose slow environment takes another number of ticks each time.

A frame of M ticks begins when the slow environment takes its sample, and ends when it takes the next one. Here it goes from the
tick after a sample to the next sample: all that happens in it then depends on its own length alone, and not on that of the
frame before, since the environment's step is the time since its last sample, or a fixed one. So any frame may come after any
other one, and there are as many matrices as lengths. (Products of frames in a row only begin at another tick.)
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from wavesweep.errors import UsageError
from wavesweep.loops.controllers import loop_drawing
from wavesweep.loops.from_drawing import FACTOR, PRODUCT, assembled, scalar_place, twins
from wavesweep.loops.multirate import MultirateLoop
from wavesweep.monodromy.drift import counted_ticks, drift_of_drawn
from wavesweep.monodromy.open_ticks import OpenTicks
from wavesweep.monodromy.periodic import Ticks, ticks_of
from wavesweep.monodromy.product import ENTRIES, pattern_of, product_with_errors
from wavesweep.monodromy.rounding import both
from wavesweep.robust.enclosure import Enclosure
from wavesweep.spec.block_types import without_rule
from wavesweep.spec.drawing import Drawing, DrawnBlock, name_of, path_of
from wavesweep.spec.expressions import evaluate, names_in, text_of

FRAME = "frame"  # a delay: the result is in place with the next sample, whenever that is
LOST = "lost"  # the same: the result never comes, and the last one is held
RATIO = "rates.ratio"
SOLVABLE = 1e-6  # of its terms, the least size of what closes a number's loop in a tick
ANY = np.array([0.5, 2.0])  # a number that varies
SOME = 0.7  # one at which no entry of a frame vanishes by chance
MIDDLE = 64 * ENTRIES  # of a matrix, what the rounding of a number does to it
SAMPLE, THROUGH, SHOW, TICK, LATE = "sample", "through", "show", "tick", "late"


@dataclass(frozen=True, slots=True)
class Frames:
    """What may happen in a frame.

    lengths: fast ticks. delays: of the result, in ticks from its sample, up to the frame's length, or FRAME; each may come in
    any frame. lost: how many results in a row may fail to come. elapsed: whether the slow environment's period is the time
    since its last sample; if not, it is the nominal one.
    """

    lengths: tuple[int, ...]
    delays: tuple[int | str, ...] = (1,)
    lost: int = 0
    elapsed: bool = True

    def __post_init__(self):
        """Refuse what is no frame. Errors: UsageError."""
        if not self.lengths or min(self.lengths) < 1:
            raise UsageError(f"frames: expected lengths of 1 tick or more, found {self.lengths}")
        longest = max((delay for delay in self.delays if delay != FRAME), default=0)
        if not self.delays or longest > min(self.lengths):
            raise UsageError(f"frames: expected delays up to the shortest frame, {min(self.lengths)} ticks, found {longest}")


@dataclass(frozen=True, slots=True)
class Symbol:
    """A frame: its ticks, the delay of the result (ticks, FRAME or LOST, None in a drawn loop), and of results that are lost
    the number in a row.

    step: the period of slow blocks that run later than the sample, which is the length of the frame before; None if nothing
    depends on it. through: whether the next result is in place at once, with the sample at which this frame ends.
    """

    ticks: int
    delay: int | str | None = None
    lost: int = 0
    step: int | None = None
    through: bool = False


def frames_of_controller(values: Mapping[str, object], frames: Frames, number: str = "environment.K_VE") -> "LoopFrames":
    """Return the frames of a spec's controller, whose slow environment varies, as a family along one of its keys, if any.

    values: flat keys with numbers; `environment.delay` is replaced by `frames.delays`, and `rates.ratio` is the nominal length
    of a frame. number: a key that one wire or gain reads, such as a wall's; empty for the loop at its own values alone.
    Errors: UsageError for a controller without a slow environment, or a number that the loop reads in several places.
    """
    ratio = values[RATIO]
    if int(ratio) != ratio:
        raise UsageError(f"{RATIO}: expected a whole number of ticks in a frame, found {ratio}")
    drawing = loop_drawing(
        {**values, RATIO: 20, "environment.delay": 1}, (number,)
    )  # a delay that gives results a hold of their own
    slow = [block.name for block in drawing.blocks if evaluate(block.every, {RATIO: 20}) != 1]
    if not slow:
        raise UsageError(f"controller.kind: expected a slow environment, found {values['controller.kind']}, which has none")
    _refuse_unlike(drawing, [block for block in drawing.blocks if block.name in slow], frames.elapsed)
    shown = frozenset(name for name in slow if name.endswith("_shown"))
    kinds = {SAMPLE: frozenset(slow) - shown, SHOW: shown, TICK: frozenset(), LATE: None}
    if 0 in frames.delays:
        kinds[THROUGH] = frozenset(slow)
    results = [(delay, 0) for delay in frames.delays] + [(LOST, i + 1) for i in range(frames.lost)]
    through = sorted({delay == 0 for delay in frames.delays})
    symbols = [Symbol(ticks, *result, through=each) for ticks in frames.lengths for result in results for each in through]

    def rest(symbol):
        row = [TICK] * (symbol.ticks - 1)
        if symbol.delay in (symbol.ticks, FRAME):
            return [*row, LATE]
        if symbol.delay not in (0, LOST):
            row[symbol.delay - 1] = SHOW
        return row

    held = {path: values[path] for path in values.keys() & drawing.reads} | {RATIO: int(ratio)}
    return _family(drawing, held, frames, number, kinds, shown, symbols, rest, int(ratio))


def frames_of_drawing(
    drawing: Drawing, values: Mapping[str, object], lengths: tuple[int, ...], number: str, *, elapsed: bool = True
) -> "LoopFrames":
    """Return the frames of a drawn loop, of which all blocks that do not run in every tick follow the frame's length.

    These run with the same `every`, its nominal length, each at its own phase of the frame, which has to be shorter than the
    shortest frame. elapsed: whether their periods are the times since their last runs; if not, they are the nominal ones.
    number: a key that one wire or gain reads; empty for the loop at its own values alone.
    Errors: UsageError.
    """
    known = {name_of(path): value for path, value in values.items()}
    runs = {block.name: [int(evaluate(tree, known)) for tree in (block.every, block.phase)] for block in drawing.blocks}
    slow = {name: phase for name, (every, phase) in runs.items() if every != 1}
    late = [f"{phase} of {name}" for name, phase in slow.items() if phase >= min(lengths)]
    if late:
        raise UsageError(
            f"[for_all] varying: expected phases below the shortest frame, {min(lengths)}, found {', '.join(late)}"
        )
    _refuse_unlike(drawing, [block for block in drawing.blocks if block.name in slow], elapsed)
    kinds = {phase: frozenset(name for name in slow if slow[name] == phase) for phase in sorted({*slow.values(), 0})}
    later = len(kinds) > 1
    steps = lengths if elapsed and later else (None,)
    symbols = [Symbol(ticks, None, step=step) for ticks in lengths for step in steps]

    def rest(symbol):
        return [phase if phase in kinds else TICK for phase in range(1, symbol.ticks)]

    nominal = max(runs[name][0] for name in slow)
    return _family(
        drawing, values, Frames(lengths, (0,), elapsed=elapsed), number, kinds | {TICK: frozenset()}, (), symbols, rest, nominal
    )


def _refuse_unlike(drawing: Drawing, slow: list[DrawnBlock], elapsed: bool) -> None:
    """Raise UsageError for slow blocks that do not follow one number, or whose type has no rule for steps that vary.

    A key or a wire that reads the period (`dt`) would keep the nominal one.
    """
    names = {name for block in slow for name, _ in names_in(block.every)}
    readers = sorted({path for path, tree in drawing.trees() if not path.endswith(".every") and _reads(tree, names)})
    for wrong, expected in (
        (not slow and ["none"], "blocks whose `every` is the number that varies"),
        (
            len({block.every[:2] for block in slow}) > 1 and [f"{text_of(block.every)} of {block.name}" for block in slow],
            "the number that varies as `every` of all blocks that do not run in every tick",
        ),
        (elapsed and without_rule(slow), "slow blocks whose types have a rule for steps that vary (`wavesweep keys block`)"),
        (readers, "keys and wires that do not read the frame's length"),
    ):
        if wrong:
            raise UsageError(f"[for_all] varying: expected {expected}, found {', '.join(wrong)}")


def _reads(tree, names) -> bool:
    """Whether a tree reads one of some names."""
    return any(name in names for name, _ in names_in(tree))


def _family(drawing, values, frames, number, kinds, shown, symbols, rest, nominal):
    """The family of frames.

    kinds: of ticks, the slow blocks that run in each, None for a moment at which only the blocks `shown` run. rest: gives the
    kinds of a symbol's ticks after its sample.
    """
    if number and not scalar_place(drawing, name_of(number)):
        raise UsageError(
            f"intervals along {number}: while frames vary ([for_all]), expected a number that one wire or gain reads linearly, "
            "found another; look along another one, or leave `varying` out"
        )
    slow, varied = set().union(*(each or () for each in kinds.values())), {path_of(name_of(number)): ANY} if number else {}
    steps = sorted({*frames.lengths}) if frames.elapsed else [nominal]
    order = list(kinds)
    maps, index = [], {}
    for step in steps:
        at_step = _with_period(drawing, slow, step, frames.elapsed)
        whole = _scheduled(assembled(at_step, values | varied), kinds, shown, slow)
        if number:
            cut_open = assembled(at_step, values | dict.fromkeys(varied, 0.0), name_of(number))
            ticks = OpenTicks.of(_scheduled(cut_open, kinds, shown, slow), whole, PRODUCT, FACTOR).ticks
        else:
            ticks = ticks_of(whole, alone=True, terms=True)
        for position, kind in enumerate(order):
            own = ticks.maps[ticks.kind[position]]
            alike = next((i for i in range(len(maps)) if _alike(maps[i], own)), len(maps))
            if alike == len(maps):
                maps.append(own)
            index[kind, step] = alike
    both_loops = twins(_with_period(drawing, slow, nominal, frames.elapsed), values | varied)
    drift = drift_of_drawn(*(_scheduled(loop, kinds, shown, slow) for loop in both_loops))
    if drift.folded:
        raise UsageError(
            f"intervals along {number}: while frames vary ([for_all]), expected no drift, or the same at all its values, found "
            f"{', '.join(drift.states[at] for at in drift.folded)}; feed the position back, as waves do with Kp > 0"
        )
    ticks, _ = counted_ticks(Ticks(tuple(maps), np.arange(len(maps))), drift)
    if all(index[kind, step] == index[kind, steps[0]] for kind in order[1:] for step in steps):
        symbols = list(dict.fromkeys(replace(symbol, step=None) for symbol in symbols))
    rows = [[index[kind, symbol.step or steps[0]] for kind in rest(symbol)] for symbol in symbols]
    first = order[0]
    samples = [index[THROUGH if symbol.through else first, symbol.ticks if frames.elapsed else nominal] for symbol in symbols]
    follows = np.array([[_may_follow(before, after) for after in symbols] for before in symbols])
    return LoopFrames.of(ticks, drift.kept, rows, samples, tuple(symbols), follows)


def _may_follow(before, after):
    # A result that is in place at once is so at the end of the frame before.
    at_once = after.delay == 0
    in_a_row = after.lost == 0 or after.lost == before.lost + 1
    return in_a_row and before.through == at_once and after.step in (None, before.ticks)


def _with_period(drawing, slow, step, elapsed):
    """The drawing with another period of its slow blocks, in ticks; their phases are set in `_scheduled`."""
    every, phase = ("number", float(step), 0), ("number", 0.0, 0)
    blocks = (replace(each, every=every, phase=phase, phases=()) if each.name in slow else each for each in drawing.blocks)
    blocks = (each.stepwise(drawing.tick_hz) if elapsed and each.name in slow else each for each in blocks)
    return replace(drawing, blocks=tuple(blocks))


def _scheduled(loop: MultirateLoop, kinds, shown, slow) -> MultirateLoop:
    """The loop with a frame of one tick of each kind: connecting it gives the map of each."""
    placed = []
    for each in loop.placed:
        name = each.block.name
        runs = [
            (name in shown if blocks is None else name in blocks) if name in slow else blocks is not None
            for blocks in kinds.values()
        ]
        placed.append(replace(each, every=len(kinds), phase=tuple(np.flatnonzero(runs).tolist())))
    return replace(loop, placed=tuple(placed))


def _alike(one, other):
    return one.inputs == other.inputs and all(np.array_equal(getattr(one, part), getattr(other, part)) for part in "EBCD")


@dataclass(frozen=True, slots=True, eq=False)
class LoopFrames:
    """The frames of a loop as a family along a number (see `family.Family`).

    ticks: of every kind, open at the number, in states that are counted from others. rows: kinds of each symbol's ticks after
    its sample; samples: the kind of the sample that ends it. patterns: entries of each symbol that may be other than zero.
    kept: states that remain: without drift, and without those that every frame forgets or sets to zero. symbols: what each
    matrix is.
    """

    ticks: Ticks
    rows: tuple[tuple[int, ...], ...]
    samples: tuple[int, ...]
    patterns: tuple[np.ndarray, ...]
    kept: np.ndarray
    symbols: tuple[Symbol, ...]
    follows: np.ndarray
    fixed: "_Fixed | None"

    @staticmethod
    def of(ticks, kept, rows, samples, symbols, follows) -> "LoopFrames":
        """Return the frames of ticks; kept: the states without drift."""
        changes = [each.E for each in _closed(ticks, SOME).maps]
        patterns = [pattern_of(np.array([*row, sample]), changes) for row, sample in zip(rows, samples, strict=True)]
        kept = np.array(kept)
        acts = np.logical_or.reduce(patterns)
        while True:
            inside = acts[np.ix_(kept, kept)]
            live = inside.any(0) & inside.any(1)
            if live.all():
                break
            kept = kept[live]
        rows, samples = tuple(map(tuple, rows)), tuple(samples)
        fixed = None
        if not any(ticks.maps[kind].inputs for row in rows for kind in row):
            fixed = _Fixed.of(ticks, rows, samples, kept)
        return LoopFrames(ticks, rows, samples, tuple(patterns), kept, symbols, follows, fixed)

    def at(self, x: float) -> np.ndarray:
        """See `Family`."""
        if self.fixed is not None:
            return self.fixed.at(x)
        maps = []
        for each in self.ticks.maps:
            E = each.E + (x / (1 - x * each.D[0, 0])) * (each.B @ each.C) if each.inputs else each.E
            maps.append(np.eye(len(E)) + E)
        whole = [_joined(self._ticks(i), maps, lambda first, later: later @ first) for i in range(len(self.rows))]
        return np.array([each[np.ix_(self.kept, self.kept)] for each in whole])

    def enclosed(self, x: float) -> tuple[np.ndarray, np.ndarray]:
        """See `Family`. Accuracy: to first order in a rounding."""
        maps = _closed(self.ticks, x).maps
        changes, errors = [each.E for each in maps], [ENTRIES * each.terms[0] for each in maps]
        E = np.empty((len(self.rows), self.kept.size, self.kept.size))
        dE = np.empty_like(E)
        for i, (row, sample) in enumerate(zip(self.rows, self.samples, strict=True)):
            first = self.fixed.rest[i] if self.fixed is not None else _in_a_row(row, changes, errors)
            whole, error = both(first, (changes[sample], errors[sample]))
            whole = np.where(self.patterns[i], whole, -np.eye(len(whole)))
            error = np.where(self.patterns[i], error, 0.0)
            E[i], dE[i] = (part[np.ix_(self.kept, self.kept)] for part in (whole, error))
        return E, dE

    def _ticks(self, symbol):
        """The kinds of a frame's ticks, the sample at its end included, with the length of each run of the same."""
        return [(kind, len(list(run))) for kind, run in groupby([*self.rows[symbol], self.samples[symbol]])]

    def hull(self, low: float, high: float) -> tuple[np.ndarray, np.ndarray] | None:
        """See `Family`.

        If the number acts only at the sample, a frame is `A + f(x) b c'` with `f(x) = x/(1 - d x)`, which is monotone between
        its poles: all are on the segment between those at both ends. Otherwise ticks are enclosed by Taylor models of second
        order (see `Enclosure`), a frame being `C + s L + s^2 Q` within R for s from -1 to 1. The parabola through its values
        at -1, 0 and 1 is within 2.25 R of it, and in the hull of its three control points, as a Bezier curve is.
        """
        direct = np.array([each.D[0, 0] for each in self.ticks.maps if each.inputs])
        through = np.array([low, high])[:, None] * direct
        closing = 1 - through
        if not ((np.abs(closing) > SOLVABLE * (1 + np.abs(through))).all() and (closing[0] * closing[1] > 0).all()):
            return None
        if self.fixed is not None or low == high:
            return tuple(map(np.stack, zip(*(self.enclosed(x) for x in dict.fromkeys((low, high))), strict=True)))
        middle, half = (low + high) / 2, (high - low) / 2
        (A, dA), (C, dC), (B, dB) = (self.enclosed(x) for x in (low, middle, high))
        maps = [_enclosure(each, middle, half) for each in self.ticks.maps]
        rest = [_joined(self._ticks(i), maps, _then).rest[np.ix_(self.kept, self.kept)] for i in range(len(self.rows))]
        more = 2.3 * np.array(rest)
        control, of_control = 2 * C - (A + B) / 2, 2 * dC + (dA + dB) / 2 + MIDDLE * (np.abs(A) + np.abs(B) + np.abs(C))
        return np.stack([A, control, B]), np.stack([dA + more, of_control + more, dB + more])


@dataclass(frozen=True, slots=True, eq=False)
class _Fixed:
    """Frames in which the number acts only at the sample: `A + f(x) b c'`, and the ticks before it with their errors."""

    A: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    rest: tuple

    @staticmethod
    def of(ticks, rows, samples, kept):
        changes, errors = [each.E for each in ticks.maps], [ENTRIES * each.terms[0] for each in ticks.maps]
        known = {row: _in_a_row(row, changes, errors) for row in set(rows)}
        rest, parts = tuple(known[row] for row in rows), []
        n = len(ticks.states)
        for (E, _), sample in zip(rest, samples, strict=True):
            own = ticks.maps[sample]
            before = np.eye(n) + E
            b, c, d = own.B, own.C @ before, own.D
            if not own.inputs:
                b, c, d = np.zeros((n, 1)), np.zeros((1, n)), np.zeros((1, 1))
            A = (np.eye(n) + own.E) @ before
            parts.append((A[np.ix_(kept, kept)], b[kept], c[:, kept], d[0, 0]))
        return _Fixed(*(np.array(part) for part in zip(*parts, strict=True)), rest)

    def at(self, x):
        return self.A + (x / (1 - x * self.d))[:, None, None] * (self.b @ self.c)


def _closed(ticks, x):
    """The ticks at a value of the number."""
    if x == 0:
        return ticks
    return OpenTicks(ticks, None).closed(np.zeros((), int), np.asarray(float(x)), terms=True)


def _in_a_row(row, changes, errors):
    """The ticks of a row, less identity, with bounds on the errors of the entries."""
    n = changes[0].shape[-1]
    if not row:
        return np.zeros((n, n)), np.zeros((n, n))
    return product_with_errors(np.array(row), changes, [each / ENTRIES for each in errors], each=True)


def _enclosure(tick, middle, half):
    """The change of a tick for all values of the number from `middle - half` to `middle + half`."""
    nothing = np.zeros_like(tick.E)
    if not tick.inputs:
        return Enclosure(tick.E, nothing, nothing, nothing)
    d = tick.D[0, 0]
    through = tick.B @ tick.C
    # f(p) = p/(1 - d p): its n-th derivative is n! d^(n-1)/(1 - d p)^(n+1).
    closing = 1 - d * middle
    least = abs(closing) - abs(d) * half
    parts = middle / closing, half / closing**2, d * half**2 / closing**3
    rest = d**2 * half**3 / least**4
    centre, slope, curve = (part * through for part in parts)
    return Enclosure(tick.E + centre, slope, curve, rest * np.abs(through))


def _then(first, later):
    return first + later + later @ first


def _joined(runs, maps, joined):
    """The maps of runs of ticks, `(kind, ticks)`, one after the other; the powers of a run by squaring."""
    whole = None
    for kind, ticks in runs:
        power, left = maps[kind], ticks
        while left:
            if left % 2:
                whole = power if whole is None else joined(whole, power)
            left //= 2
            power = joined(power, power) if left else power
    return whole
