"""From a loop whose frames vary to a family of matrices, one for each kind of frame.

A frame of M ticks begins when the slow environment takes its sample, and ends when it takes the next one. Here, however, it
goes from the tick after a sample to the next sample, inclusive. Everything in it then depends on its own length and not on that
of the frame before, because the environment's step is the time since its last sample, or a fixed one. So any frame may follow
any other, and there are as many matrices as lengths. (Products of frames in a row merely begin at another tick.)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from wavesweep.core.drawing.block_types import without_rule
from wavesweep.core.drawing.drawing import Drawing, name_of
from wavesweep.core.drawing.drawn_block import DrawnBlock
from wavesweep.core.drawing.expressions import evaluate, names_in, text_of
from wavesweep.core.errors import UsageError
from wavesweep.core.loops.controllers import loop_drawing
from wavesweep.for_all.loop_frames import LoopFrames, Symbol
from wavesweep.for_all.plan import Plan, Schedule

FRAME = "frame"  # as a delay: the result is in place with the next sample, whenever that is
LOST = "lost"  # as a delay: the result never arrives, and the last one is held
RATIO = "rates.ratio"
# Kinds of ticks: the sample; one whose result is in place at once; one in which a result comes into place; an ordinary one; and
# the moment before the next sample in which a result comes into place.
SAMPLE, THROUGH, SHOW, TICK, LATE = "sample", "through", "show", "tick", "late"


@dataclass(frozen=True, slots=True)
class Frames:
    """What may happen in a frame.

    lengths: in fast ticks. delays: of the result, in ticks after its sample, up to the frame's length, or FRAME; each may occur
    in any frame. lost: how many results in a row may be lost. elapsed: whether the slow environment's step is the time since
    its last sample; otherwise it is the nominal one.
    """

    lengths: tuple[int, ...]
    delays: tuple[int | str, ...] = (1,)
    lost: int = 0
    elapsed: bool = True

    def __post_init__(self):
        """Check lengths and delays. Errors: UsageError."""
        if not self.lengths or min(self.lengths) < 1:
            raise UsageError(f"frames: expected lengths of 1 tick or more, found {self.lengths}")
        longest = max((delay for delay in self.delays if delay != FRAME), default=0)
        if not self.delays or longest > min(self.lengths):
            raise UsageError(f"frames: expected delays up to the shortest frame, {min(self.lengths)} ticks, found {longest}")


def frames_of_controller(values: Mapping[str, object], frames: Frames, number: str = "environment.K_VE") -> LoopFrames:
    """Return the frames of a built-in controller as a family along one of its keys.

    values: numbers by their keys; `frames.delays` replaces `environment.delay`, and `rates.ratio` is the nominal length of a
    frame. number: a key that one wire or gain reads, such as a wall's; empty for the loop at these values alone.
    Errors: UsageError for a controller without a slow environment, or a number that the loop reads in several places.
    """
    return plan_of_controller(values, frames, (number,)).along(number)


def plan_of_controller(values: Mapping[str, object], frames: Frames, gains: Sequence[str] = ()) -> Plan:
    """Return what the frames of a built-in controller consist of; gains: numbers that count as other than 0.

    values, frames, errors: as for `frames_of_controller`.
    """
    ratio = values[RATIO]
    if int(ratio) != ratio:
        raise UsageError(f"{RATIO}: expected a whole number of ticks in a frame, found {ratio}")
    # With a delay of 1 results have a separate hold.
    drawing = loop_drawing({**values, RATIO: 20, "environment.delay": 1}, gains)
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
    schedule = Schedule(kinds, int(ratio), frames.elapsed, shown)
    return Plan(drawing, held, schedule, symbols, rest, THROUGH)


def frames_of_drawing(
    drawing: Drawing, values: Mapping[str, object], lengths: tuple[int, ...], number: str, *, elapsed: bool = True
) -> LoopFrames:
    """Return the frames of a drawn loop in which all blocks that do not run in every tick run once per frame.

    These blocks have the same `every`, the nominal length, and each has a phase, below the shortest frame. elapsed: whether
    their periods are the times since their last runs; otherwise they are the nominal ones. number: a key that one wire or gain
    reads; empty for the loop at these values alone. Errors: UsageError.
    """
    return plan_of_drawing(drawing, values, lengths, elapsed).along(number)


def plan_of_drawing(drawing: Drawing, values: Mapping[str, object], lengths: tuple[int, ...], elapsed: bool) -> Plan:
    """Return what the frames of a drawn loop consist of; see `frames_of_drawing`."""
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

    schedule = Schedule(kinds | {TICK: frozenset()}, max(runs[name][0] for name in slow), elapsed)
    return Plan(drawing, values, schedule, symbols, rest)


def _refuse_unlike(drawing: Drawing, slow: list[DrawnBlock], elapsed: bool) -> None:
    """Raise UsageError if slow blocks do not follow one number, or have a type without a rule for steps that vary.

    Keys and wires that read the period (`dt`) would keep the nominal one.
    """
    names = {name for block in slow for name, _ in names_in(block.every)}
    readers = sorted(
        {path for path, tree in drawing.trees() if not path.endswith(".every") and names & {name for name, _ in names_in(tree)}}
    )
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
