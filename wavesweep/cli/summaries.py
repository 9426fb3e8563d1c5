"""Summaries of tables in a few lines for the terminal, counted while the rows are written."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.analysis.doubt import DOUBTS, INCOMPLETE

if TYPE_CHECKING:
    from wavesweep.sweep import Table

Line = tuple[str, bool]  # a message, and whether it is a warning
Columns = Mapping[str, np.ndarray]
WORDS = {
    "free": "free device",
    "operator": "with the spec's operator",
    "passive": "stable with every passive hand",
    "box": "stable with every hand of the box",
    "port": "hand's port passive, forces held over a tick",
}


def tally_of(table: Table) -> WholeTable | HandTally:
    """Return the summary of a table: call `add` with each of its blocks, then `lines`."""
    return HandTally() if table.axes is not None else WholeTable(SUMMARIES[table.kind])


class WholeTable:
    """The summary of a table whose rows come in one block."""

    def __init__(self, summary: Callable[[Columns, Mapping[str, Any]], Iterator[Line]]) -> None:
        self._summary, self._columns = summary, {}

    def add(self, columns: Columns) -> None:
        """Take the only block."""
        self._columns = columns

    def lines(self, facts: Mapping[str, Any]) -> Iterator[Line]:
        """Yield the notices of the run and the summary."""
        yield from _notices(facts)
        yield from self._summary(self._columns, facts)


class IntervalTally:
    """Counts the rows of a table of intervals for one loop."""

    def __init__(self) -> None:
        self._rows = self._intervals = self._split = 0
        self._doubts: Counter[str] = Counter()
        self._along = "?"
        self._largest: dict[str, Any] = {}

    def add(self, columns: Columns) -> None:
        """Count a block of rows."""
        if not len(columns["along"]):
            return
        stable = columns["intervals"] > 0
        self._along = str(columns["along"][0])
        self._rows += len(stable)
        self._intervals += int(stable.sum())
        # Every slice has exactly one row numbered 0.
        self._split += int(((columns["intervals"] > 1) & (columns["interval"] == 0)).sum())
        self._doubts.update(columns["doubt"][~columns["certified"]].tolist())
        if stable.any():
            row = int(np.nanargmax(columns["high"]))
            if not self._largest or columns["high"][row] > self._largest["high"]:
                self._largest = {name: column[row] for name, column in columns.items()}

    def lines(self, facts: Mapping[str, Any]) -> Iterator[Line]:
        """Yield the lines, each with a flag that is true for a warning."""
        slices = facts["slices"]
        skipped = f" ({slices['skipped']} skipped)" if slices["skipped"] else ""
        holes = f", {_count(self._split, 'slice')} with a hole" if self._split else ""
        found = _count(self._intervals, "stable interval")
        yield f"{_count(slices['computed'], 'slice')}{skipped}: {found}{holes}", False
        yield self.largest(), False
        yield self.certified(), bool(self._doubts)
        for word in DOUBTS:
            if self._doubts[word]:
                yield f"  {word}: {DOUBTS[word]}", True

    @property
    def row(self) -> Mapping[str, Any]:
        """The row of the largest stable value; empty where none is stable."""
        return self._largest

    def certified(self) -> str:
        """Text: how many rows are certified, and why others are not."""
        # Rows and not slices: an uncertified row names the interval that a user should not rely on.
        every = _count(self._rows, "row")
        reasons = ", ".join(f"{word} {self._doubts[word]}" for word in DOUBTS if self._doubts[word])
        return f"{self._doubts.total()} of {every} not certified ({reasons})" if self._doubts else f"all {every} certified"

    def largest(self) -> str:
        """Text: the largest stable value and its place."""
        incomplete = any(self._doubts[word] for word in INCOMPLETE)
        if not self._largest:
            known = f"no stable {self._along} found, but part of the swept range could not be decided"
            return known if incomplete else f"no stable {self._along} anywhere in the swept range"
        row = self._largest
        axes = list(row)[: list(row).index("along")]
        place = ", ".join(f"{axis} = {row[axis]:g}" for axis in axes)
        ended = ""
        if np.isnan(row["high_omega"]):
            ended = ", beyond which stability is not known" if row["doubt"] in INCOMPLETE else ", where the swept range ends"
        return f"largest stable {self._along}: {row['high']:.6g}{f' at {place}' if place else ''}{ended}"


class HandTally:
    """Counts the rows of a table of intervals, separately for each hand if it has several."""

    def __init__(self) -> None:
        self._plain = IntervalTally()
        self._tallies: dict[str, IntervalTally] = {}
        self._unsettled = 0

    def add(self, columns: Columns) -> None:
        """Count a block of rows, all of one hand."""
        if "hand" not in columns:
            self._plain.add(columns)
            return
        if not len(columns["hand"]):
            return
        rows = {name: column for name, column in columns.items() if name != "hand"}
        self._tallies.setdefault(str(columns["hand"][0]), IntervalTally()).add(rows)
        if "settled" in columns and columns["hand"][0] == "box":
            self._unsettled += int((~columns["settled"]).sum())

    def lines(self, facts: Mapping[str, Any]) -> Iterator[Line]:
        """Yield the lines, each with a flag that is true for a warning."""
        yield from _notices(facts)
        if not self._tallies:
            yield from self._plain.lines(facts)
        for hand, tally in self._tallies.items():
            yield f"{WORDS[hand]} ({hand}): {tally.largest()}{_ended_by(tally.row)}; {tally.certified()}", False
        if self._unsettled:
            rows = _count(self._unsettled, "row")
            yield f"{rows} of the box not proved (settled 0): a hand that the search missed may be unstable", True


def _ended_by(row: Mapping[str, Any]) -> str:
    """Text: the hand that ends the interval, if one is known."""
    hand = [row.get(f"high_hand_{part}", np.nan) for part in ("mass", "damping", "stiffness")]
    return "" if np.isnan(hand[0]) else ", ended by a hand of {:.4g} kg, {:.4g} N*s/m, {:.4g} N/m".format(*hand)


def bode(columns: Columns, _: Mapping[str, Any]) -> Iterator[Line]:
    """Yield the lines, each with a flag that is true for a warning."""
    frequencies = len(np.unique(columns["frequency_hz"]))
    curves = len(columns["frequency_hz"]) // max(frequencies, 1)
    yield f"{_count(curves, 'curve')} of {frequencies} frequencies", False
    unstable = ~columns["stable"]
    if unstable.any():
        names = ", ".join(sorted(set(columns["spec"][unstable].tolist())))
        yield f"some loops are unstable and have no steady response: curves of {names}", True
    doubted = np.isin(columns["doubt"], ["", "unstable"], invert=True)
    if doubted.any():
        words = ", ".join(sorted(set(columns["doubt"][doubted].tolist())))
        yield f"{_count(int(doubted.sum()), 'row')} without a reliable value ({words}), see the column doubt", True


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def passivity(columns: Columns, facts: Mapping[str, Any]) -> Iterator[Line]:
    """Yield the lines, each with a flag that is true for a warning."""
    rows = len(columns["channel_norm"])
    norms = columns["channel_norm"][~np.isnan(columns["channel_norm"])]
    if norms.size:
        strictly, gain = int(columns["channel_passive"].sum()), facts["tolerance"]
        within = int(((columns["channel_norm"] ** 2 - 1 <= gain) | columns["channel_passive"]).sum())
        verdict = f"passive to within {100 * gain:g} % of energy in {within} of {_count(rows, 'row')}, strictly in {strictly}"
        yield f"wave channel: {verdict}; norm {_range(norms)}", False
    margins = columns["port_margin"][~np.isnan(columns["port_margin"])]
    reach = f"; margin {_range(margins)} m/N" if margins.size else ""
    yield f"hand's port: passive in {int(columns['port_passive'].sum())} of {_count(rows, 'row')}{reach}", False
    needed = columns["damping_needed"][columns["damping_needed"] > 0]
    never = int(np.isnan(columns["damping_needed"]).sum())
    if needed.size:
        yield f"further damping of the device that makes it passive: {_range(needed, 3)} N*s/m", False
    if never:
        yield f"no damping of the device makes it passive in {_count(never, 'row')}", False
    unstable = int((~columns["stable"]).sum())
    if unstable:
        yield f"not stable in the first place: {_count(unstable, 'row')}", True
    slices = facts["slices"]
    if slices["certified"] < slices["computed"]:
        yield f"{slices['computed'] - slices['certified']} of {slices['computed']} loops not certified", True


def filter_choices(columns: Columns, facts: Mapping[str, Any]) -> Iterator[Line]:
    """Yield the least order at each cutoff with which aliasing adds at most the tolerated share of energy."""
    order = dict(zip(columns["lp1_cutoff_hz"].tolist(), columns["sufficient_order"].tolist(), strict=True))
    known = [f"{each:g} at {cutoff:g} Hz" for cutoff, each in order.items() if not np.isnan(each)]
    least = f"least order of LP1 with which aliasing adds at most {100 * facts['tolerance']:g} % of energy"
    yield f"{least}: {', '.join(known) or 'none'}", False
    beyond = [f"{cutoff:g} Hz" for cutoff, each in order.items() if np.isnan(each)]
    if beyond and known:
        yield f"no order up to {columns['lp1_order'].max()} is enough at {', '.join(beyond)}", False


def _range(values: np.ndarray, digits: int = 7) -> str:
    low, high = values.min(), values.max()
    return f"{low:.{digits}g}" if low == high else f"{low:.{digits}g} to {high:.{digits}g}"


def simulation(columns: Columns, facts: Mapping[str, Any]) -> Iterator[Line]:
    """Yield the lines, each with a flag that is true for a warning."""
    wanted, rows = facts["ticks"]["wanted"], len(columns["tick"])
    rates, options = facts["spec"]["rates"], facts["spec"]["simulate"]
    kind, tick = facts["spec"]["controller"]["kind"], 1 / rates["fast_hz"]
    much = f"{rows}" if rows == wanted else f"{rows} of {wanted}"
    yield f"{kind}, force of the hand {options['input']}: {much} ticks, {rows * tick:g} s", False
    if rows < wanted:
        yield f"the loop diverges: numbers overflow in tick {rows}, {rows * tick:g} s; the rows end before it", True
    if rows == 0:
        return
    if "wall" in options:
        yield _contact(columns["touching"]), False
    if "max_force" in options:
        cut_off = np.mean(columns["f_m"] != columns["f_device"])
        yield f"motors at their limit of {options['max_force']:g} N for {100 * cut_off:.3g} % of the time", False
    if options["late"] or options["dropped"]:
        results = columns["late"][columns["phase"] == 0]
        late, lost = int((results > 0).sum()), int((results < 0).sum())
        yield f"of {len(results)} slow results {late} came late and {lost} were lost", False
    yield _energy(columns), False


def _contact(touching: np.ndarray) -> str:
    made = int(np.sum(touching[1:] & ~touching[:-1]) + touching[0])
    times = "once" if made == 1 else f"{made} times"
    return f"contact made {times}, felt for {100 * touching.mean():.3g} % of the time"


def _energy(columns: Columns) -> str:
    hand, device, channel = (columns[f"energy_{name}"] for name in ("hand", "device", "channel"))
    line = f"energy: the hand gave {hand[-1]:.4g} J, the motors took {device[-1]:.4g} J"
    if np.isnan(channel[-1]):
        return line
    return f"{line}, the wave channel kept {channel[-1]:.4g} J (at least {channel.min():.4g} J at any time)"


def simulated_response(columns: Columns, _: Mapping[str, Any]) -> Iterator[Line]:
    """Yield the largest difference between the simulated response and that of the linear loop."""
    count = len(columns["frequency_hz"])
    off = [_off(columns, name) for name in ("admittance", "impedance")]
    where = f"response at {count} frequenc{'y' if count == 1 else 'ies'}"
    yield (
        f"{where}: differs from the linear loop by at most {off[0]:.2g} (admittance) and {off[1]:.2g} (impedance), relative",
        False,
    )


def _off(columns: Columns, name: str) -> float:
    """Largest relative difference, over the frequencies at which both are known."""
    seen, linear = (columns[f"{kind}{name}_re"] + 1j * columns[f"{kind}{name}_im"] for kind in ("", "linear_"))
    off = np.abs(seen - linear) / np.abs(linear)
    return float(np.max(off, initial=0.0, where=np.isfinite(off)))


def _notices(facts: Mapping[str, Any]) -> Iterator[Line]:
    yield from ((str(notice), False) for notice in facts.get("notices", ()))


SUMMARIES = {
    "bode": bode,
    "passivity": passivity,
    "passivity-filters": filter_choices,
    "simulate": simulation,
    "simulate-response": simulated_response,
}
