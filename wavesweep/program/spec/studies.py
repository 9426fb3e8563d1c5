"""What the tables of a spec ask of the loop: the studies, checked in themselves and against the
loop."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from wavesweep.engine.drawing import RATE, Drawing
from wavesweep.engine.errors import SpecError
from wavesweep.engine.keys import Mistakes, Names, Place, leaves_of, nearest, show
from wavesweep.program.reading.axes import Axis, axis_place, build_axis, logarithmic
from wavesweep.program.reading.keys import (
    BAND_EDGES,
    BUILT_IN,
    HARDWARE_KEYS,
    STUDY_KEYS,
    HapticDevice,
)
from wavesweep.program.reading.sorting import Sorted
from wavesweep.program.reading.tables import TableValue, missing, sections, table_at, tables
from wavesweep.program.spec.resolving import LIMITS, Given, exceeds_limit, is_read, quantity_of

K_VE_SPAN = (0.0, 20000.0)  # N/m, where K_VE is wanted and the spec gives it no span
# of its value, up and down: how far a number without a span is searched by `check` and by tables
# along it, and how far the sliders of `explore` go; `options.ABOUT_ITS_VALUE` and docs/check.md have
# it in words
FARTHEST_FACTOR = 10.0
DEFAULT_FREQUENCIES = Axis(
    "frequency_hz", "bode.frequency_hz", logarithmic(0.1, 50.0, 400), 0.1, 50.0, False, "log"
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Studies:
    """What a spec asks for, with its axes in the order of the spec.

    along: name of the axis whose stable intervals are wanted, as written. sweep: the axes of
    [sweep], that one among them. bode: those of [bode] without the frequencies. route: the ends
    `from` and `to` of the responses that [bode] names. asked: the values of tables of capabilities
    by name; None of a table that the spec does not have.
    """

    along: str
    sweep: tuple[Axis, ...]
    bode: tuple[Axis, ...]
    frequencies: Axis
    route: Mapping[str, str] = field(default_factory=dict)
    asked: Mapping[str, TableValue | None] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What a table is built from: its leaves, and the loop, as far as it is known.

    drawing: of a drawn loop, None if it has mistakes. hz: the rate of the tick, None if it is not
    known. values: of a controller's loop, None if they have mistakes. asked: the values of the
    tables before it. sweep: the axes of [sweep].
    """

    belongs: Sorted
    given: Given
    mistakes: Mistakes
    names: Names = BUILT_IN
    drawing: Drawing | None = None
    hz: float | None = None
    values: Mapping[str, float | int | str] | None = None
    asked: dict[str, TableValue | None] = field(default_factory=dict)
    sweep: tuple[Axis, ...] = ()

    @property
    def drawn(self) -> bool:
        """Whether the loop is drawn."""
        return self.names is not BUILT_IN

    def loop(self, varied: Iterable[Axis]) -> Drawing | None:
        """The drawing of the loop, or of its controller with what varies in it; None if it has
        mistakes."""
        if self.drawing or self.values is None:
            return self.drawing
        from wavesweep.haptics.controller_page import loop_drawing

        return loop_drawing(self.values, [axis.path for axis in varied])

    @property
    def rate(self) -> str:
        """The path of the tick's rate."""
        return RATE if self.drawn else "rates.fast_hz"

    @property
    def stepped(self) -> bool:
        """Whether a step of an input is what the user of a drawn loop looks at, as there is no
        hand."""
        return bool(self.drawing and self.drawing.hand is None and self.drawing.inputs)

    def axes(self, section: str) -> list[Axis]:
        """Return the axes of a section, and add their mistakes."""
        named = self.belongs.axes[section].items()
        axes = (
            build_axis(section, name, leaves, self.mistakes, self.names) for name, leaves in named
        )
        return [axis for axis in axes if axis]

    def refuse_repeated(self) -> None:
        """Add the mistakes of numbers that one table, or two, have by two names or keys."""
        first: dict[str, tuple[str, str]] = {}
        for path, section in sections().items():
            table = ".".join(path)
            axes = {} if section.takes else self.belongs.axes.get(table, {})
            for name, leaves in axes.items():
                quantity = quantity_of(getattr(self.names.find(name), "path", name))
                where, name_before = first.setdefault(quantity, (table, name))
                if name_before == name:
                    continue
                expected = "one key for one number in all tables"
                text_found = f"{name_before} of [{where}] beside it"
                if where == table:
                    expected = "each key once"
                    text_found = f"the key of the axis {name_before} again"
                self.mistakes.refuse(axis_place(leaves), f"{table}.{name}", expected, text_found)

    def refuse_other_edges(self, section: str, axes: Iterable[Axis], spared: bool = False) -> None:
        """Add the mistakes of axes of a filter that is given in the other way. spared: whether
        edges of its band are none."""
        for axis in axes:
            table, _, last = axis.path.rpartition(".")
            by_edges = f"{table}.{BAND_EDGES[0]}" in self.given.leaves
            edge = last in BAND_EDGES
            if table.startswith("filters.") and by_edges != edge and not (spared and edge):
                expected = f"an axis that fits {table}, given by {'its band edges' if by_edges else 'order and cutoff_hz'}"
                self.mistakes.refuse(axis.place, f"{section}.{axis.name}", expected, axis.path)

    def refuse_beyond_limits(self, section: str, axes: Iterable[Axis]) -> None:
        """Add the mistakes of axes of a controller's loop that leave the range set by its other
        values.

        Every combination of a section's axes is computed, so a cutoff has to suit the lowest swept
        rate. A delay along with a swept ratio is left to `Spec.with_values`, which sees each
        combination. A cutoff that the controller does not read has no limit.
        """
        if self.values is None:
            return
        swept = {axis.path: axis for axis in axes}
        if "rates.fast_hz" in swept:
            limiting = {**self.values, "rates.fast_hz": swept["rates.fast_hz"].start}
        else:
            limiting = self.values
        for axis in axes:
            if axis.path == "environment.delay" and set(LIMITS[axis.path]) & set(swept):
                continue
            if not is_read(axis.path, self.values):
                continue
            if expected := exceeds_limit(axis.path, axis.stop, limiting):
                self.mistakes.refuse(
                    axis.place, f"{section}.{axis.name}", expected, show(axis.stop)
                )

    def refuse_unknown_ends(self, path: str, names: Iterable[object], ports: str) -> None:
        """Add the mistake of a key that names none of the `inputs` or `outputs` of the loop, if
        what it is is known."""
        for name in names if self.drawing or not self.drawn else ():
            if fault := unknown_end(self.drawing, name, ports):
                self.mistakes.refuse(self.belongs.keys[path], path, *fault, of_key=False)


def hardware_of(
    asked: Mapping[str, TableValue | None], device: HapticDevice | None
) -> dict[str, float | None]:
    """Return the numbers of a device that are not of the loop, by the last names of
    `HARDWARE_KEYS`. asked: as in `Studies`."""
    numbers = {path.rpartition(".")[2]: key.default for path, key in HARDWARE_KEYS.items()}
    numbers |= device.simulation() if device else {}
    for value in asked.values():
        numbers |= value.on(device).hardware if value is not None else {}
    return numbers


def build_studies(request: Request) -> Studies:
    """Return the studies and add their mistakes."""
    mistakes = request.mistakes
    request.refuse_repeated()
    axes = {study: request.axes(study) for study in ("sweep", "bode")}
    for study, swept_axes in axes.items():
        request.refuse_other_edges(study, swept_axes)
    for axis in axes["bode"]:
        if not axis.values:
            mistakes.refuse(
                axis.place, f"bode.{axis.name}", "num with start and stop, or a list", "only a span"
            )
    frequencies = _frequencies(request, axes["bode"])
    bode = tuple(axis for axis in axes["bode"] if axis.path != DEFAULT_FREQUENCIES.path)
    if (
        request.hz and frequencies.place != Place()
    ):  # defaults are not checked, since `bode` may never run
        refuse_beyond_half(frequencies, bode, request.hz, request.rate, mistakes)
    route = _route(request)
    along = _along(request, axes["sweep"])
    request = replace(request, sweep=tuple(axes["sweep"]))
    for study, swept_axes in (("sweep", request.sweep), ("bode", bode)):
        request.refuse_beyond_limits(study, swept_axes)
    for table in tables().values():
        request.asked[table.name] = table.value(request)
    return Studies(
        along=along,
        sweep=request.sweep,
        bode=bode,
        frequencies=frequencies,
        route=route,
        asked=dict.fromkeys(path.rpartition(".")[2] for path in missing()) | request.asked,
    )


def _route(request: Request) -> dict[str, str]:
    """The ends of the responses that [bode] asks for, "from" and "to"; a mistake is added for
    those that the loop has not."""
    keys = request.belongs.keys
    route = {name: keys[f"bode.{name}"].value for name in ("from", "to") if f"bode.{name}" in keys}
    for name, value in route.items():
        request.refuse_unknown_ends(
            f"bode.{name}", [value], "inputs" if name == "from" else "outputs"
        )
    return {name: str(value) for name, value in route.items()}


def _frequencies(request: Request, axes: Iterable[Axis]) -> Axis:
    """The axis of frequencies of [bode], or the default one; axes: of [bode]."""
    frequency_axis = next((axis for axis in axes if axis.path == DEFAULT_FREQUENCIES.path), None)
    if frequency_axis or not (request.stepped and request.hz):
        return frequency_axis or DEFAULT_FREQUENCIES
    # The usual frequencies of responses between inputs and outputs, of the tick's rate.
    start, stop = (share * request.hz for share in (1e-5, 0.49))
    return replace(
        DEFAULT_FREQUENCIES, values=logarithmic(start, stop, 400), start=start, stop=stop
    )


def _along(request: Request, axes: Iterable[Axis]) -> str:
    """The name of the axis whose stable intervals are wanted; axes: of [sweep]."""
    key = STUDY_KEYS["sweep.along"]
    drawing = request.drawing
    mistakes = request.mistakes
    leaf = request.belongs.keys.get(key.path)
    along = mistakes.check(key, leaf) if leaf else None
    if along is None and request.drawn:  # the only span, or the wall's stiffness
        spans = [axis.name for axis in axes if not axis.values]
        if len(spans) == 1:
            return spans[0]
        return (*((drawing and drawing.wall) or ()), "")[0]
    if along and (fault := axis_fault(along, request.names)):
        mistakes.refuse(leaf, key.path, "the name of a numeric key", *fault, of_key=False)
    return key.default if along is None else along


def value_of(path: str, keys: Mapping[str, object]) -> TableValue:
    """Return the value of a table of a capability that no spec has, as its keys give it by name.

    Errors: SpecError with every mistake, UsageError if the capability is not installed.
    """
    table = table_at(path)
    leaves = {".".join(place): leaf for place, leaf in leaves_of({path: dict(keys)}, Place())}
    request = Request(belongs=Sorted(leaves), given=Given({}, Place()), mistakes=Mistakes())
    value = table.value(request)
    if request.mistakes:
        raise SpecError(request.mistakes)
    return value


def unknown_end(drawing: Drawing | None, name: object, ports: str) -> tuple[str, str, str] | None:
    """Return expected and found text and a suggestion if a name is none of the `inputs` or
    `outputs` of a loop, else None."""
    port_names = [port for port, *_ in getattr(drawing, ports, ())]
    if name in port_names:
        return None
    signals = drawing.signals if drawing and ports == "outputs" else ()
    expected = (
        f"an {ports[:-1]} in [ports] of a drawn loop ({', '.join(port_names) or 'it has none'})"
    )
    hint = nearest(name, (*port_names, *signals)) if isinstance(name, str) else ""
    return f"{expected} or a signal BLOCK.PORT" if signals else expected, show(name), hint


def axis_fault(name: str, names: Names) -> tuple[str, str] | None:
    """Return the text for "found" and a suggestion if `name` is not a numeric key, otherwise
    None."""
    key = names.find(name)
    if name in names.following:
        return f"{show(name)}, which follows from other numbers", ""
    if key is None:
        return show(name), nearest(name, names.symbols) or nearest(name, names.numeric)
    if key.numeric:
        return None
    return (f"{show(name)}, which takes no number", "")


def refuse_beyond_half(
    frequency: Axis, axes: Iterable[Axis], design_rate: float, rate: str, mistakes: Mistakes
) -> None:
    """Add the mistake of frequencies of [bode] beyond half the rate, where the response to a held
    force is not defined.

    axes: of the responses, among which the rate may be; design_rate: its value otherwise, in Hz; rate: its
    path.
    """
    least = min((axis.start for axis in axes if axis.path == rate), default=design_rate)
    if frequency.stop > least / 2:
        expected, highest = apart(least / 2, frequency.stop)
        mistakes.refuse(
            frequency.place,
            frequency.path,
            f"numbers <= {expected} (half of {rate})",
            highest,
            of_key=False,
        )


def fitting(frequency: Axis, axes: Iterable[Axis], design_rate: float, rate: str) -> Axis:
    """Return the frequencies of [bode], the default ones lower if half the rate is; axes, own,
    rate: as above."""
    least = min((axis.start for axis in axes if axis.path == rate), default=design_rate)
    if frequency is not DEFAULT_FREQUENCIES or frequency.stop <= least / 2:
        return frequency
    stop = least / 2
    num = len(frequency.values)
    start = stop * frequency.start / frequency.stop
    return replace(frequency, values=logarithmic(start, stop, num), start=start, stop=stop)


def apart(first: float, second: float) -> tuple[str, str]:
    """Return two different numbers with enough digits to differ, at least six."""
    texts = ((f"{first:.{digits}g}", f"{second:.{digits}g}") for digits in range(6, 18))
    return next((pair for pair in texts if pair[0] != pair[1]), (repr(first), repr(second)))
