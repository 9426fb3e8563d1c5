"""What [simulate] asks for: the force of the hand, and what a real rig adds to the linear model."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from wavesweep.errors import Mistake
from wavesweep.spec.axes import Axis, axis_place, build_axis
from wavesweep.spec.checking import Rejected, check, show
from wavesweep.spec.devices import DEVICES
from wavesweep.spec.keys import SIMULATE_KEYS
from wavesweep.spec.places import Leaf, Place
from wavesweep.spec.sorting import FREQUENCIES, Sorted
from wavesweep.spec.spacing import linear

MOST_TICKS = 1_000_000  # about 1 GB of rows while the loop is marched
SECONDS = 10.0  # of an input that has no length of its own


def _default(values: tuple[float, ...], scale: str | None = None) -> Axis:
    return Axis("frequency_hz", FREQUENCIES, values, values[0], values[-1], False, scale)


# The steps pass by 25 and 50 Hz, where with the default rates a sine is its own image.
DEFAULT_FREQUENCIES = {
    "sine": _default((5.0,)),
    "stepped-sine": _default(linear(0.5, 49.5, 50), "linear"),
    "chirp": _default((0.1, 50.0)),
}


@dataclass(frozen=True, slots=True)
class Experiment:
    """The keys of [simulate] by their last name, resolved, None where one is absent; and where they were given.

    `frequency_hz` is a tuple: one for a sine, all of a stepped sine, both ends of a chirp.
    """

    values: dict[str, float | int | str | tuple | None]
    frequencies: Axis | None
    given: Mapping[str, Leaf] = field(repr=False)

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        present = {name: value for name, value in self.values.items() if value is not None}
        frequencies = {"frequency_hz": self.frequencies.written()} if self.frequencies else {}
        return present | frequencies

    def beyond_limits(self, fast_hz: float) -> Iterator[Mistake]:
        """Yield the mistakes that only the fast rate (Hz) makes."""
        half, most = fast_hz / 2, MOST_TICKS / fast_hz
        if self.frequencies and self.values["frequency_hz"] and not self.frequencies.stop < half:
            expected, found = f"numbers < {half!r} (half of rates.fast_hz)", show(self.frequencies.stop)
            yield self._leaf("frequency_hz").mistake(FREQUENCIES, expected, found)
        seconds = self._seconds()
        if seconds > most:
            name = "frequency_hz" if self.values["duration_s"] is None else "duration_s"
            expected = f"at most {most:g} s ({MOST_TICKS} ticks at rates.fast_hz)"
            yield self._leaf(name).mistake(f"simulate.{name}", expected, f"{seconds:g} s")

    def _leaf(self, name: str) -> Leaf:
        """Return what was given for a key, or where its table stands."""
        table = next((leaf.place.parent() for leaf in self.given.values()), Place())
        return self.given.get(f"simulate.{name}") or Leaf(None, table)

    def _seconds(self) -> float:
        values = self.values
        if values["duration_s"] is not None or values["input"] != "stepped-sine":
            return values["duration_s"] or 0.0
        return sum(step_seconds(f, values["settle_s"], values["periods"]) for f in values["frequency_hz"])


def step_seconds(frequency_hz: float, settle_s: float, periods: int) -> float:
    """Return how long a step of the stepped sine takes: it settles, then lasts whole periods and at least a second."""
    return settle_s + max(periods, math.ceil(frequency_hz)) / frequency_hz


def build_experiment(leaves: Sorted) -> tuple[Experiment, list[Mistake]]:
    """Return the experiment and its mistakes; what the fast rate limits is left to `beyond_limits`."""
    checked, mistakes = _check_each(leaves.simulate)
    device = DEVICES[checked["preset"]].beyond_the_model() if "preset" in checked else {}
    defaults = {path.split(".")[1]: key.default for path, key in SIMULATE_KEYS.items()}
    values = defaults | device | checked
    axis, wrong = _frequencies(leaves.frequencies)
    settled = not wrong and ("input" in checked or "simulate.input" not in leaves.simulate)
    if settled:
        axis = axis or DEFAULT_FREQUENCIES.get(values["input"])
        values["frequency_hz"], wrong = _fit(values["input"], axis, leaves.frequencies)
    if values["duration_s"] is None and values["input"] not in ("stepped-sine", "record"):
        values["duration_s"] = SECONDS
    if values["input"] == "record" and values["record"] is None:
        leaf = leaves.simulate["simulate.input"]
        mistakes.append(leaf.mistake("simulate.record", "the name of a CSV file for this input", "nothing"))
    given = dict(leaves.simulate)
    if leaves.frequencies:
        given[FREQUENCIES] = Leaf(None, axis_place(leaves.frequencies))
    return Experiment(values, axis, given), mistakes + wrong


def _check_each(given: Mapping[str, Leaf]) -> tuple[dict, list[Mistake]]:
    checked, mistakes = {}, []
    for path, leaf in given.items():
        try:
            checked[path.split(".")[1]] = check(SIMULATE_KEYS[path], leaf.value)
        except Rejected as error:
            mistakes.append(leaf.mistake(path, error.expected, error.found, error.suggestion))
    return checked, mistakes


def _frequencies(parts: dict[str, Leaf]) -> tuple[Axis | None, list[Mistake]]:
    if not parts:
        return None, []
    alone = parts.get("")
    if alone and isinstance(alone.value, (int, float)):
        parts = {"": Leaf([alone.value], alone.place)}
    return build_axis("simulate", "frequency_hz", parts)


def _fit(kind: str, axis: Axis | None, parts: dict[str, Leaf]) -> tuple[tuple[float, ...], list[Mistake]]:
    """Return the frequencies that this input reads; the mistake where they are too many or only a span."""
    if kind == "chirp":
        return (axis.start, axis.stop), []
    if kind == "sine" and len(axis.values) != 1:
        found = f"{len(axis.values)} frequencies" if axis.values else "a span"
        expected = 'one frequency for a sine (several are for input = "stepped-sine")'
    elif kind == "stepped-sine" and not axis.values:
        expected, found = "num beside start and stop, or a list", "only a span"
    else:
        return (axis.values if kind in DEFAULT_FREQUENCIES else ()), []
    return (), [Leaf(None, axis_place(parts)).mistake(FREQUENCIES, expected, found, of_key=True)]
