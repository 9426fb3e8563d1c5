"""From a loop whose frames vary to a family of matrices, one for each kind of frame.

A frame of M ticks begins when the slow environment takes its sample, and ends when it takes the
next one. Here, however, it goes from the tick after a sample to the next sample, inclusive.
Everything in it then depends on its own length and not on that of the frame before, because the
environment's step is the time since its last sample, or a fixed one. So any frame may follow any
other, and there are as many matrices as lengths. (Products of frames in a row merely begin at
another tick.)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from wavesweep.engine.drawing import (
    Drawing,
    DrawnBlock,
    finite_value,
    name_of,
    scalars,
    without_rule,
)
from wavesweep.engine.errors import Mistake, SpecError
from wavesweep.engine.expressions import names_in, text_of
from wavesweep.for_all.loop_frames import Symbol
from wavesweep.for_all.plan import Plan, Schedule
from wavesweep.haptics.controller_page import loop_drawing

FRAME = "frame"  # as a delay: the result is in place with the next sample, whenever that is
LOST = "lost"  # as a delay: the result never arrives, and the last one is held
ANY_NUMBER = -1  # of results in a row that are lost
# as delays: results are in place when the blocks that show them run, by their phases
IN_PHASE = (None,)
RULED = "whose types have a rule for steps that vary (`wavesweep keys block`)"
RATIO, DELAY = "rates.ratio", "environment.delay"
# Kinds of ticks beside those of the phases, of which 0 is the sample: one whose result is in place
# at once; one in which a result comes into place; an ordinary one; and the moment before the next
# sample in which a result comes into place.
THROUGH, SHOW, TICK, LATE = "through", "show", "tick", "late"


@dataclass(frozen=True, slots=True)
class FramesInAnyOrder:
    """What may happen in a frame.

    lengths: in fast ticks. delays: of the result, in ticks after its sample, up to the frame's
    length, or FRAME; each may occur in any frame; IN_PHASE of a drawn loop. lost: how many results
    in a row may be lost, or ANY_NUMBER. elapsed: whether the step of slow blocks is the time since
    they last ran; otherwise it is the nominal one.
    """

    lengths: tuple[int, ...]
    delays: tuple[int | str | None, ...] = (1,)
    lost: int = 0
    elapsed: bool = True

    def __post_init__(self):
        """Check lengths and delays. Errors: SpecError."""
        if not self.lengths or min(self.lengths) < 1:
            refuse(RATIO, "frames of 1 tick or more", f"{self.lengths}")
        longest = max((delay for delay in self.delays if delay not in (FRAME, None)), default=0)
        if not self.delays or longest > min(self.lengths):
            expected = f'delays up to the shortest frame, {min(self.lengths)} ticks, or "frame", with the next one'
            refuse(DELAY, expected, f"{longest}" if self.delays else "none")


@dataclass(frozen=True, slots=True)
class SlowFrames:
    """The blocks that run once in a frame, the lengths of frames and the nominal one (ticks),
    and the number behind them."""

    names: tuple[str, ...]
    lengths: tuple[int, ...]
    nominal: int
    number: str = ""

    @staticmethod
    def of(
        drawing: Drawing,
        values: Mapping[str, object],
        number: str = "",
        numbers: Sequence[int] = (),
    ) -> "SlowFrames":
        """Return those of a loop in which a number has some values in turn, and `every` of blocks
        depends on it in any way.

        number: its path; its value among `values` gives the nominal length, which is the only one
        without a number. Errors: SpecError for lengths that are not whole, and for blocks of
        different lengths.
        """
        name, known, found = name_of(number), scalars(values), {}
        tried = [*numbers, known.get(name, 0)]
        for block in drawing.blocks:
            ticks = _whole_ticks(block, [known | {name: value} for value in tried], name)
            if {*ticks} != {1} or any(each == name for each, _ in names_in(block.every)):
                found[block.name] = block, tuple(map(int, ticks))
        if len({ticks for _, ticks in found.values()}) > 1:
            runs = ", ".join(
                f"{text_of(block.every)} of {block.name}" for block, _ in found.values()
            )
            last, _ = [*found.values()][-1]
            refuse(
                _every(last),
                "one `every` of all blocks that do not run in every tick, whatever varies",
                runs,
            )
        ticks = next((ticks for _, ticks in found.values()), (1,))
        return SlowFrames(tuple(found), tuple(dict.fromkeys(ticks[:-1] or ticks)), ticks[-1], name)


def _whole_ticks(block, numbers, name):
    """The ticks in which a block runs once, with each of some numbers in turn; name: of the one
    that differs, or empty."""
    ticks = [finite_value(block.every, values) for values in numbers]
    for values, value in zip(numbers, ticks, strict=True):
        if value is None or value < 1 or value % 1:
            at = f" with {name} = {values[name]}" if name else ""
            refuse(
                _every(block),
                "a whole number of ticks, 1 or more",
                f"{'none' if value is None else f'{value:g}'}{at}",
            )
    return ticks


def drawing_of_controller(values: Mapping[str, object], gains: Sequence[str] = ()) -> Drawing:
    """Return the loop of a built-in controller, in which results have a separate hold whatever its
    ratio and its delay are.

    gains: numbers that count as other than 0. Errors: SpecError for one whose filters depend on the
    ratio.
    """
    drawing = loop_drawing({**values, RATIO: 20, DELAY: 1}, gains)
    if any(block.type == "mean" for block in drawing.blocks):
        expected = "a controller whose filters do not depend on the ratio, where frames, delays or results vary"
        refuse(
            "controller.kind",
            expected,
            f"{values['controller.kind']}, whose mean is as long as a frame",
        )
    return drawing


def plan_of(
    drawing: Drawing,
    values: Mapping[str, object],
    frames: FramesInAnyOrder,
    slow: SlowFrames,
    channels: frozenset[str] = frozenset(),
) -> Plan:
    """Return what the frames of a loop consist of: the one way from any loop to its frames.

    values: numbers by their keys, of which those that the drawing reads count. frames: with delays
    of results, these are what the blocks of the page of a controller show that have names with
    `_shown`. slow: has the nominal length. channels: slow blocks whose messages may be lost: they
    do not run then, and show the last one. Errors: SpecError for blocks that cannot have such
    frames.
    """
    blocks, known = [block for block in drawing.blocks if block.name in slow.names], scalars(values)
    shown = frozenset(
        name for name in slow.names if frames.delays != IN_PHASE and name.endswith("_shown")
    )
    phases = {
        block.name: int(finite_value(block.phase, known))
        for block in blocks
        if block.name not in shown
    }
    for name, phase in phases.items():
        if phase >= min(frames.lengths):
            refuse(
                f"block.{name}.phase",
                f"phases below the shortest frame, {min(frames.lengths)}",
                f"{phase} of {name}",
            )
    if len({*frames.lengths, slow.nominal}) > 1:
        _refuse_unsteady(
            drawing,
            [each for each in blocks if each.name not in channels],
            slow.number,
            frames.elapsed,
        )
    kinds = {
        phase: frozenset(name for name in phases if phases[name] == phase)
        for phase in sorted({0, *phases.values()})
    }
    steps = frames.lengths if frames.elapsed and len(kinds) > 1 else (None,)
    in_a_row = (0,) if frames.lost == ANY_NUMBER else range(1, frames.lost + 1)
    results = [(delay, 0) for delay in frames.delays] + [(LOST, count) for count in in_a_row]
    through = sorted({delay == 0 for delay, _ in results})
    some = [
        frozenset(each)
        for count in range(len(channels) + 1)
        for each in combinations(sorted(channels), count)
    ]
    kinds |= {
        (phase, gone): kinds[phase] - gone
        for phase in [*kinds]
        for gone in some
        if gone & kinds[phase] == gone != set()
    }
    symbols = [
        Symbol(ticks, *result, step, each, gone)
        for ticks in frames.lengths
        for result in results
        for step in steps
        for each in through
        for gone in some
    ]

    def kind(phase, symbol):
        gone = symbol.gone & kinds[phase]
        return (phase, gone) if gone else phase

    def sample(symbol):
        return THROUGH if symbol.through else kind(0, symbol)

    def rest(symbol):
        row = [kind(phase, symbol) if phase in kinds else TICK for phase in range(1, symbol.ticks)]
        if symbol.delay in (symbol.ticks, FRAME):
            return [*row, LATE]
        if symbol.delay not in (None, 0, LOST):
            row[symbol.delay - 1] = SHOW
        return row

    kinds_of_ticks = {**kinds, TICK: frozenset()}
    if frames.delays != IN_PHASE:
        kinds_of_ticks |= {SHOW: shown, LATE: None} | (
            {THROUGH: frozenset(slow.names)} if 0 in frames.delays else {}
        )
    held = {
        path: value
        for path, value in values.items()
        if path in drawing.reads or path in drawing.building
    }
    return Plan(
        drawing,
        held,
        Schedule(kinds_of_ticks, slow.nominal, frames.elapsed, shown),
        symbols,
        rest,
        sample,
    )


def _refuse_unsteady(
    drawing: Drawing, slow: Sequence[DrawnBlock], number: str, elapsed: bool
) -> None:
    """Raise SpecError if slow blocks have a type without a rule for steps that vary, or a key or
    wire reads what varies.

    Keys and wires that read the period (`dt`) would keep the nominal one.
    """
    if elapsed and (wrong := without_rule(slow)):
        refuse(f"block.{wrong[0].partition(' ')[0]}.type", f"slow blocks {RULED}", ", ".join(wrong))
    for path, tree in drawing.trees():
        if not path.endswith(".every") and any(name == number for name, _ in names_in(tree)):
            refuse(
                path, f"keys and wires that do not read the frame's length, {number}", text_of(tree)
            )


def _every(block: DrawnBlock) -> str:
    """The path of the key that says how often a block runs."""
    return RATIO if text_of(block.every) == RATIO else f"block.{block.name}.every"


def refuse(path: str, expected: str, found: str) -> None:
    """Raise SpecError about a key whose place is not known here."""
    raise SpecError([Mistake("", path, expected, found)])
