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
from itertools import combinations, product

from wavesweep.engine.drawing import (
    Drawing,
    DrawnBlock,
    name_of,
    scalars,
    without_rule,
)
from wavesweep.engine.errors import Mistake, SpecError
from wavesweep.engine.switched import Symbol
from wavesweep.for_all.plan import (
    ANY_NUMBER,
    FRAME,
    LATE,
    LOST,
    SHOW,
    THROUGH,
    TICK,
    Plan,
    Schedule,
)
from wavesweep.haptics.controller_page import loop_drawing

# as delays: results are in place when the blocks that show them run, by their phases
IN_PHASE = (None,)
RULED = "whose types have a rule for steps that vary (`wavesweep keys block`)"
RATIO, DELAY = "rates.ratio", "environment.delay"


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
        shortest = min(self.lengths)
        expected = (
            f'delays up to the shortest frame, {shortest} ticks, or "frame", with the next one'
        )
        if not self.delays:
            refuse(DELAY, expected, "none")
        longest = max([0, *(delay for delay in self.delays if delay not in (FRAME, None))])
        if longest > shortest:
            refuse(DELAY, expected, f"{longest}")

    @property
    def results(self) -> list[tuple[int | str | None, int]]:
        """What may come of a result: its delay, and how many are lost in a row with it, if it is
        lost."""
        in_a_row = (0,) if self.lost == ANY_NUMBER else range(1, self.lost + 1)
        on_time = [(delay, 0) for delay in self.delays]
        return on_time + [(LOST, count) for count in in_a_row]


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
        name = name_of(number)
        constants = scalars(values)
        cases = [constants | {name: value} for value in (*numbers, constants.get(name, 0))]
        ticks_of = {}
        for block in drawing.blocks:
            ticks = tuple(_whole_ticks(block, case, name) for case in cases)
            reads_it = block.every.reads(name)
            if set(ticks) != {1} or reads_it:
                ticks_of[block.name] = ticks
        slow = [block for block in drawing.blocks if block.name in ticks_of]
        if len(set(ticks_of.values())) > 1:
            expected = (
                "one `every` of all blocks that do not run in every tick, where frames vary (the faster of them may "
                "run in every tick of a slower rates.tick_hz, and what is faster still may be continuous)"
            )
            runs = ", ".join(f"{block.every.text} of {block.name}" for block in slow)
            refuse(_every(slow[-1]), expected, runs)
        *lengths, nominal = ticks_of[slow[0].name] if slow else (1,)
        distinct = tuple(dict.fromkeys(lengths)) or (nominal,)
        return SlowFrames(tuple(ticks_of), distinct, nominal, name)


def _whole_ticks(block: DrawnBlock, numbers: Mapping[str, float], name: str) -> int:
    """The ticks in which a block runs once, with these numbers; name: of the one that varies, or
    empty."""
    ticks = block.every.finite_value(numbers)
    if ticks is None or ticks < 1 or ticks % 1:
        text_found = "none" if ticks is None else f"{ticks:g}"
        place = f" with {name} = {numbers[name]}" if name else ""
        refuse(_every(block), "a whole number of ticks, 1 or more", f"{text_found}{place}")
    return int(ticks)


def drawing_of_controller(values: Mapping[str, object], gains: Sequence[str]) -> Drawing:
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
    shown = frozenset()
    if frames.delays != IN_PHASE:
        shown = frozenset(name for name in slow.names if name.endswith("_shown"))
    names = [name for name in slow.names if name not in shown]
    at_phases = _at_phases(drawing, values, names, min(frames.lengths))
    if len({*frames.lengths, slow.nominal}) > 1:
        stepping = set(slow.names) - channels
        blocks = [block for block in drawing.blocks if block.name in stepping]
        _refuse_unsteady(drawing, blocks, slow.number, frames.elapsed)
    losses = []
    for count in range(len(channels) + 1):
        for lost in combinations(sorted(channels), count):
            losses.append(frozenset(lost))
    kinds = _kinds_of_ticks(at_phases, losses)
    if frames.delays != IN_PHASE:
        kinds |= {SHOW: shown, LATE: None}
    if 0 in frames.delays:
        kinds[THROUGH] = frozenset(slow.names)
    schedule = Schedule(kinds, slow.nominal, frames.elapsed, shown, at_phases)
    read = drawing.reads.union(drawing.building)
    values_read = {path: value for path, value in values.items() if path in read}
    steps = frames.lengths if frames.elapsed and len(at_phases) > 1 else (None,)
    return Plan(drawing, values_read, schedule, _symbols(frames, steps, losses))


def _at_phases(
    drawing: Drawing, values: Mapping[str, object], names: Sequence[str], shortest: int
) -> dict[int, frozenset[str]]:
    """The blocks of these names that run at each phase, in ticks after the sample, which is at
    phase 0. shortest: the shortest frame (ticks)."""
    constants = scalars(values)
    phases = {}
    for block in drawing.blocks:
        if block.name not in names:
            continue
        phase = int(block.phase.finite_value(constants))
        if phase >= shortest:
            expected = f"phases below the shortest frame, {shortest}"
            refuse(f"block.{block.name}.phase", expected, f"{phase} of {block.name}")
        phases[block.name] = phase
    at_phases = {}
    for phase in sorted({0, *phases.values()}):
        at_phases[phase] = frozenset(name for name in phases if phases[name] == phase)
    return at_phases


def _kinds_of_ticks(
    at_phases: Mapping[int, frozenset[str]], losses: Sequence[frozenset[str]]
) -> dict[object, frozenset[str] | None]:
    """The slow blocks that run in each kind of tick: those of a phase, the same without some of
    the channels, whose messages are lost, and none in any other tick."""
    kinds: dict[object, frozenset[str] | None] = dict(at_phases)
    for phase, blocks in at_phases.items():
        for lost in losses:
            if lost and lost <= blocks:
                kinds[phase, lost] = blocks - lost
    kinds[TICK] = frozenset()
    return kinds


def _symbols(
    frames: FramesInAnyOrder, steps: Sequence[int | None], losses: Sequence[frozenset[str]]
) -> list[Symbol]:
    """The kinds of frames. steps: periods of slow blocks, of the frame before; losses: channels
    whose message of the frame may be lost together."""
    at_once = sorted({delay == 0 for delay, _ in frames.results})
    return [
        Symbol(ticks, *result, step, through, lost)
        for ticks, result, step, through, lost in product(
            frames.lengths, frames.results, steps, at_once, losses
        )
    ]


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
        if not path.endswith(".every") and tree.reads(number):
            refuse(path, f"keys and wires that do not read the frame's length, {number}", tree.text)


def _every(block: DrawnBlock) -> str:
    """The path of the key that says how often a block runs."""
    if block.every.text == RATIO:
        return RATIO
    return f"block.{block.name}.every"


def refuse(path: str, expected: str, found: str) -> None:
    """Raise SpecError about a key whose place is not known here."""
    raise SpecError([Mistake("", path, expected, found)])
