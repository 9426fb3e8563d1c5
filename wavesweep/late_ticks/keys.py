"""The key `tick` of [for_all]: the times that a fast tick may take, another one each time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from wavesweep.engine.keys import Key
from wavesweep.program.number_words import span_in_words
from wavesweep.program.reading.tables import SpecTable, TableValue

if TYPE_CHECKING:
    from collections.abc import Iterator

    from wavesweep.program.spec.studies import Request

PATH = "for_all.tick"
REQUIRE = "sweep.require"
LONGEST_TICK = 1e4  # of the spec's own ticks
NOMINAL = "nominal"
KEYS = Key.by_path(
    [
        Key.positive(
            f"{PATH}.late",
            None,
            "s",
            "by how much a fast tick may be late: each takes its own time to that much more, another time in each tick, in any "
            "order; what is held is held as long, and the program counts with the nominal tick",
        ),
        Key.positive(f"{PATH}.start", None, "s", "the shortest time of a fast tick"),
        Key.positive(f"{PATH}.stop", None, "s", "the longest time of a fast tick"),
        Key.word(
            f"{PATH}.steps",
            NOMINAL,
            "what the program divides by: filters, differences and integrators are those of the nominal tick",
            {
                NOMINAL: "of the nominal tick",
                "measured": "of the time since its last tick; not proved",
            },
        ),
    ]
)
EITHER = "either late, or start and stop"
SAME_TICK = 1e-9  # relative: a spec's own tick is within an interval that ends there


@dataclass(frozen=True, slots=True)
class LateTick(TableValue):
    """The times of a fast tick: from the spec's own one to `late` (s) more, or from start to
    stop (s)."""

    late: float | None = None
    start: float | None = None
    stop: float | None = None
    otherwise: ClassVar = "ticks that are all on time"

    def interval(self, hz: float) -> tuple[float, float]:
        """Return the shortest and the longest time of a tick (s); hz: the rate of the spec's own
        ticks."""
        if self.late is not None:
            return 1 / hz, 1 / hz + self.late
        return float(self.start or 0.0), float(self.stop or 0.0)

    def in_words(self, hz: float) -> str:
        """Return which ticks these are."""
        low, high = self.interval(hz)
        return f"ticks of {span_in_words(1e3 * low, 1e3 * high)} ms in any order"

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        if self.late is not None:
            return {"late": self.late}
        return {"start": self.start, "stop": self.stop}


def build(request: Request) -> LateTick | None:
    """Return the times and add their mistakes, and those of what cannot be proved beside them;
    None if there are none."""
    leaves, mistakes = request.belongs.below(PATH), request.mistakes
    numbers = TABLE.read(leaves, mistakes)
    if not leaves or len(numbers) < len(leaves):
        return None
    place = next(iter(leaves.values()))
    if numbers.pop("steps", NOMINAL) != NOMINAL:
        expected = '"nominal": a program that divides by the measured time is not proved'
        return mistakes.refuse(leaves["steps"], f"{PATH}.steps", expected, "measured", of_key=False)
    if numbers.keys() not in ({"late"}, {"start", "stop"}):
        return mistakes.refuse(place, PATH, EITHER, ", ".join(numbers), of_key=False)
    late_tick = LateTick(**numbers)
    if request.hz:
        own_tick = 1 / request.hz
        low, high = late_tick.interval(request.hz)
        if (
            not low <= own_tick * (1 + SAME_TICK)
            or not own_tick <= high * (1 + SAME_TICK)
            or not low < high
        ):
            expected = f"times from start up to stop, with the spec's own tick of {own_tick:g} s among them"
            mistakes.refuse(place, PATH, expected, f"{low:g} to {high:g} s", of_key=False)
        elif high > LONGEST_TICK * own_tick:
            expected = (
                f"at most {LONGEST_TICK * own_tick:g} s, {LONGEST_TICK:g} of the spec's own ticks"
            )
            mistakes.refuse(place, PATH, expected, f"{high:g} s", of_key=False)
    for expected, problem in _beside(request):
        mistakes.refuse(place, PATH, expected, problem, of_key=False)
    return late_tick


def _beside(request: Request) -> Iterator[tuple[str, str]]:
    """Yield what is expected beside late ticks and what is found, for all that is not proved
    beside them."""
    for_all = request.asked.get("for_all")
    if for_all and (for_all.axes or for_all.lost or for_all.loss):
        names = [axis.name for axis in for_all.axes]
        names += ["lost"] if for_all.lost else []
        names += ["loss"] if for_all.loss else []
        yield "tick alone in [for_all]", ", ".join(names)
    if request.asked.get("contact"):
        yield "tick alone in [for_all]", "contact"
    if request.belongs.below(REQUIRE):
        yield "stability alone beside tick", "[sweep] require"
    drawing = request.drawing
    if drawing and drawing.channels:
        yield "a loop without channels", ", ".join(channel.name for channel in drawing.channels)
    if drawing and drawing.dead_times:
        names = ", ".join(drawing.dead_times)
        yield "delays in whole ticks", f"a delay in seconds, {names}"
    values = request.values or {}
    if values.get("device.dead_time"):
        yield "an amplifier that is late by whole ticks (device.delay)", "device.dead_time"
    if isinstance(values.get("rates.ratio"), float):
        yield "a whole number of ticks in a frame", f"{values['rates.ratio']:.6g}"


TABLE = SpecTable(path=PATH, build=build, keys=KEYS, always=True)
