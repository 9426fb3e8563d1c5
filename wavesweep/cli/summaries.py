"""Summaries of tables: numbers for a program, and from these a few lines for the terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.cli.design_summary import design, design_lines
from wavesweep.cli.interval_summary import HandTally, SpecTally, count
from wavesweep.cli.messages import Line, Numbers
from wavesweep.cli.why_summary import why, why_lines
from wavesweep.results.schema import at_port
from wavesweep.stability.certificate import SPARED
from wavesweep.sweep.table import Columns

if TYPE_CHECKING:
    from wavesweep.sweep import Table


def tally_of(table: Table) -> WholeTable | BodeTally | PassivityTally | HandTally | SpecTally:
    """Return the summary of a table: call `add` with each of its blocks, then `numbers` and `lines`."""
    if table.kind in BLOCKWISE:
        return BLOCKWISE[table.kind](table.facts)
    return HandTally(table.axes, table.facts) if table.axes is not None else WholeTable(*SUMMARIES[table.kind])


class WholeTable:
    """The summary of a table whose rows come in one block."""

    def __init__(self, measure: Callable[[Columns, Numbers], Numbers], write: Callable[[Numbers], Iterator[Line]]) -> None:
        self._measure, self._write, self._columns = measure, write, {}

    def add(self, columns: Columns) -> None:
        """Take the only block."""
        self._columns = columns

    def numbers(self, facts: Mapping[str, Any]) -> Numbers:
        """The summary as numbers and words that JSON can hold."""
        return self._measure(self._columns, facts)

    def lines(self, facts: Mapping[str, Any]) -> Iterator[Line]:
        """Yield the lines, each with a flag that is true for a warning."""
        yield from self._write(self.numbers(facts))


class BodeTally:
    """Counts the rows of a table of responses: curves, frequencies, unstable loops, and rows with other doubts."""

    def __init__(self, _: Mapping[str, Any]) -> None:
        self._rows = self._curves = self._diverging = self._undecided = self._doubted = self._gains = 0
        self._frequencies, self._last = np.empty(0), None
        self._unstable: set[str] = set()
        self._doubts: set[str] = set()

    def add(self, columns: Columns) -> None:
        """Count a block of rows; a curve is rows with the same values, one after the other."""
        leading = [columns[name] for name in list(columns)[: list(columns).index("controller")]]
        new = np.zeros(len(columns["controller"]), bool)
        for column in leading:
            new[1:] |= _differ(column[1:], column[:-1])
        first = [column[:1] for column in leading]
        new[:1] = self._last is None or any(_differ(*pair).any() for pair in zip(first, self._last, strict=True))
        self._last = [column[-1:] for column in leading]
        doubted = np.isin(columns["doubt"].astype(str), ["", "unstable"], invert=True)
        self._rows, self._curves = self._rows + new.size, self._curves + int(new.sum())
        unstable = columns["doubt"] == "unstable"
        self._diverging, self._undecided = (
            total + int((new & these).sum())
            for total, these in ((self._diverging, unstable), (self._undecided, ~columns["stable"] & ~unstable))
        )
        bounded = (columns["admittance_error"] <= SPARED) & (columns["impedance_error"] <= SPARED)
        gains = bounded & (columns["doubt"] == "rounding")
        self._doubted, self._gains = self._doubted + int(doubted.sum()), self._gains + int(gains.sum())
        self._frequencies = np.union1d(self._frequencies, columns["frequency_hz"])
        self._unstable.update(columns["spec"][unstable].tolist())
        self._doubts.update(columns["doubt"][doubted].tolist())

    def numbers(self, _: Mapping[str, Any]) -> Numbers:
        """The summary as numbers and words that JSON can hold."""
        return {
            "rows": self._rows,
            "frequencies": self._frequencies.size,
            "curves": self._curves,
            "unstable_curves": self._diverging,
            "unstable_specs": sorted(self._unstable),
            "undecided_curves": self._undecided,
            "doubted_rows": self._doubted,
            "doubted_worst_gains": self._gains,
            "doubts": sorted(self._doubts),
        }

    def lines(self, facts: Mapping[str, Any]) -> Iterator[Line]:
        """Yield the lines, each with a flag that is true for a warning."""
        yield from bode_lines(self.numbers(facts))


def _differ(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Where two columns differ; a missing number equals another."""
    return (one != other) & ((one == one) | (other == other))  # noqa: PLR0124 - a missing number is unequal to itself


def bode_lines(found: Numbers) -> Iterator[Line]:
    """Yield the lines, each with a flag that is true for a warning."""
    each = "different " if found["rows"] != found["curves"] * found["frequencies"] else ""
    frequencies = f"{each}frequencies" if found["frequencies"] != 1 else f"{each}frequency"
    yield f"{count(found['curves'], 'curve')} of {found['frequencies']} {frequencies}", False
    if found["unstable_specs"]:
        share = f"{found['unstable_curves']} of {count(found['curves'], 'loop')}"
        yield f"{share} unstable, without a steady response (of {', '.join(found['unstable_specs'])})", True
    if found["undecided_curves"]:
        yield (
            f"{found['undecided_curves']} of {count(found['curves'], 'loop')} not known to be stable, see the column doubt",
            True,
        )
    if found["doubted_rows"]:
        words = ", ".join(found["doubts"])
        rest = found["doubted_rows"] - found["doubted_worst_gains"]
        if found["doubted_worst_gains"]:
            yield f"{count(found['doubted_worst_gains'], 'row')} without a reliable worst gain, the rest of them reliable", True
        if rest:
            yield f"{count(rest, 'row')} without a reliable value ({words}), see the column doubt", True


class PassivityTally:
    """Counts the passive rows, and keeps the ranges of norm, margin and further damping; facts: those of the run."""

    def __init__(self, facts: Mapping[str, Any]) -> None:
        self._tolerance, self._slices = facts["tolerance"], facts["slices"]
        self._damped = "damping_needed" not in facts["methods"]  # otherwise it is not known
        self._counts: Counter[str] = Counter()
        self._ranges: dict[str, list[float] | None] = dict.fromkeys(("channel_norm", "port_margin", "damping_needed"))

    def add(self, columns: Columns) -> None:
        """Count a block of rows."""
        needed, passive = columns["damping_needed"], columns["channel_passive"]
        flags = {
            "rows": np.ones(needed.size, bool),
            "channel_passive_within_tolerance": (columns["channel_norm"] ** 2 - 1 <= self._tolerance) | passive,
            "channel_passive": passive,
            "port_passive": columns["port_passive"],
            "no_damping_is_enough": np.isnan(needed) & self._damped,
            "margin_unknown": np.isnan(columns["port_margin"]),
            "unstable": ~columns["stable"],
        }
        self._counts.update({name: int(each.sum()) for name, each in flags.items()})
        values = {name: columns[name] for name in self._ranges} | {"damping_needed": needed[needed > 0]}
        for name, column in values.items():
            self._ranges[name] = _range(np.array([*(self._ranges[name] or ()), *(_range(column) or ())]))

    def numbers(self, _: Mapping[str, Any]) -> Numbers:
        """The summary as numbers and words that JSON can hold."""
        order = ("rows", "tolerance", "channel_norm", "channel_passive_within_tolerance", "channel_passive", "port_passive",
                 "port_margin", "margin_unknown", "damping_needed", "no_damping_is_enough", "unstable", "slices")  # fmt: skip
        found = {**self._counts, **self._ranges, "tolerance": self._tolerance, "slices": dict(self._slices)}
        return {name: found[name] for name in order}

    def lines(self, facts: Mapping[str, Any]) -> Iterator[Line]:
        """Yield the lines, each with a flag that is true for a warning."""
        yield from passivity_lines(self.numbers(facts), facts)


def passivity_lines(found: Numbers, facts: Mapping[str, Any]) -> Iterator[Line]:
    """Yield the lines, each with a flag that is true for a warning."""
    rows = count(found["rows"], "row")
    if found["channel_norm"]:
        within = f"{100 * found['tolerance']:g} % of energy in {found['channel_passive_within_tolerance']} of {rows}"
        norm = _span(found["channel_norm"])
        yield f"wave channel: passive to within {within}, strictly in {found['channel_passive']}; norm {norm}", False
    reach = f"; margin {_span(found['port_margin'])} {at_port('m/N', facts)}" if found["port_margin"] else ""
    yield f"hand's port: passive in {found['port_passive']} of {rows}{reach}", False
    if found["margin_unknown"]:
        yield f"margin lost in rounding or overflow, and not known to be passive: {count(found['margin_unknown'], 'row')}", True
    if found["damping_needed"]:
        needed, unit = _span(found["damping_needed"], 3), at_port("N*s/m", facts)
        yield f"further damping of the device that makes it passive: {needed} {unit}", False
    if found["no_damping_is_enough"]:
        yield f"no damping of the device makes it passive in {count(found['no_damping_is_enough'], 'row')}", False
    if found["unstable"]:
        yield f"not stable in the first place, or not known to be: {count(found['unstable'], 'row')}", True
    slices = found["slices"]
    if slices["certified"] < slices["computed"]:
        yield f"{slices['computed'] - slices['certified']} of {slices['computed']} loops not certified", True


def filter_choices(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    """The least sufficient order of LP1 at each cutoff, missing if none is."""
    order = dict(zip(columns["lp1_cutoff_hz"].tolist(), columns["sufficient_order"].tolist(), strict=True))
    return {
        "controller": facts["spec"]["controller"]["kind"],
        "tolerance": facts["tolerance"],
        "highest_order": int(columns["lp1_order"].max()),
        "sufficient_orders": [
            {"cutoff_hz": cutoff, "order": None if np.isnan(each) else int(each)} for cutoff, each in order.items()
        ],
    }


def filter_lines(found: Numbers) -> Iterator[Line]:
    """Yield the lines, each with a flag that is true for a warning."""
    orders = found["sufficient_orders"]
    known = [f"{each['order']} at {each['cutoff_hz']:g} Hz" for each in orders if each["order"] is not None]
    least = f"least order of LP1 with which aliasing adds at most {100 * found['tolerance']:g} % of energy to the waves of pmw"
    yield f"{least}: {', '.join(known) or 'none'}", False
    beyond = [f"{each['cutoff_hz']:g} Hz" for each in orders if each["order"] is None]
    if beyond and known:
        yield f"no order up to {found['highest_order']} is enough at {', '.join(beyond)}", False
    if found["controller"] == "pmw-lm":
        yield "the waves of pmw-lm take its other filters and its local model too, for which these orders are not enough", False
    elif found["controller"] != "pmw":
        yield f"{found['controller']} sends no waves, and needs no LP1", False


def simulation(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    """The run, the linear loop behind it, contact, saturation, timing and energies; None if something does not apply."""
    spec, options = facts["spec"], facts["spec"]["simulate"]
    tick = facts["tick_s"] if "tick_s" in facts else 1 / spec["rates"]["fast_hz"]
    rows = len(columns["tick"])
    motors = np.mean(columns["f_m"] != columns["f_device"]) if "max_force" in options and rows else None
    return {
        "controller": spec["controller"]["kind"] if "controller" in spec else "drawn",
        "input": options["input"],
        "ticks": rows,
        "wanted_ticks": facts["ticks"]["wanted"],
        "seconds": rows * tick,
        "stopped": facts["ticks"]["stopped"],
        "linear_loop": dict(facts["linear_loop"]),
        "contact": _contact(columns["touching"]) if "wall" in options and rows else None,
        "max_force": options.get("max_force"),
        "share_at_max_force": None if motors is None else float(motors),
        "slow_results": facts["slow_results"] if (options.get("late") or options.get("dropped")) and rows else None,
        "energy": _energy(columns) if rows else None,
    }


def _contact(touching: np.ndarray) -> Numbers:
    made = int(np.sum(touching[1:] & ~touching[:-1]) + touching[0])
    return {"times": made, "share": float(touching.mean())}


def _energy(columns: Columns) -> Numbers:
    last = {name: float(columns[f"energy_{name}"][-1]) for name in ("hand", "device", "channel")}
    least = float(columns["energy_channel"].min())
    return {name: None if np.isnan(value) else value for name, value in (last | {"channel_least": least}).items()}


def simulation_lines(found: Numbers) -> Iterator[Line]:
    """Yield the lines, each with a flag that is true for a warning."""
    ticks, wanted = found["ticks"], found["wanted_ticks"]
    much = f"{ticks}" if ticks == wanted else f"{ticks} of {wanted}"
    if not found["linear_loop"]["stable"]:
        yield unstable(found["linear_loop"]), True
    yield (
        f"{found['controller']}, force of the hand {found['input']}: {much} tick{'s' * (wanted != 1)}, {found['seconds']:g} s",
        False,
    )
    if found["stopped"]:
        yield f"stopped after tick {ticks}, {found['seconds']:g} s: {found['stopped']}; the rows end before it", True
    if ticks == 0:
        return
    if found["contact"]:
        made, share = found["contact"]["times"], 100 * found["contact"]["share"]
        yield f"contact made {'once' if made == 1 else f'{made} times'}, felt for {share:.3g} % of the time", False
    if found["share_at_max_force"] is not None:
        share = 100 * found["share_at_max_force"]
        yield f"motors at their limit of {found['max_force']:g} N for {share:.3g} % of the time", False
    if timing := found["slow_results"]:
        yield f"of {timing['results']} slow results {timing['late']} came late and {timing['lost']} were lost", False
    if not found["stopped"]:  # the energies of a run that explodes mean nothing
        yield _energy_line(found["energy"], "force against it" if found["controller"] == "drawn" else "motors"), False


def unstable(linear: Numbers) -> str:
    """The sentence about a linear loop that is not stable."""
    radius = linear["spectral_radius"]
    if radius is None:
        return "the linear loop is not known to be stable (numbers overflow, or rounding hides them)"
    if radius == 1:
        return "the linear loop is not known to be stable (spectral radius 1 per frame, but for rounding)"
    return f"UNSTABLE: the linear loop diverges (spectral radius {radius:.6g} per frame)"


def _energy_line(energy: Numbers, taker: str) -> str:
    line = f"energy: the hand gave {energy['hand']:.4g} J"
    if energy["device"] is None:
        return line
    line += f", the {taker} took {energy['device']:.4g} J"
    if energy["channel"] is None:
        return line
    return f"{line}, the wave channel kept {energy['channel']:.4g} J (at least {energy['channel_least']:.4g} J at any time)"


def simulated_response(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    """Largest relative difference between the simulated response and that of the linear loop, None without one."""
    stable, radius = facts["linear_loop"]["stable"], facts["linear_loop"]["spectral_radius"]
    off = {f"largest_difference_{name}": _off(columns, name) for name in ("admittance", "impedance")}
    known = {"stable": stable, "undecided": not stable and (radius is None or radius == 1)}
    return {"frequencies": len(columns["frequency_hz"]), **known, **(off if stable else dict.fromkeys(off))}


def simulated_response_lines(found: Numbers) -> Iterator[Line]:
    """Yield the lines, each with a flag that is true for a warning."""
    where = f"response at {found['frequencies']} frequenc{'y' if found['frequencies'] == 1 else 'ies'}"
    if found["undecided"]:
        yield f"{where}: the loop is not known to be stable, and may have no steady response to compare it with", True
        return
    if not found["stable"]:
        yield f"{where}: an unstable loop has no steady response to compare it with (doubt: unstable)", True
        return
    off = [found[f"largest_difference_{name}"] for name in ("admittance", "impedance")]
    if None in off:
        yield f"{where}: not known, so there is nothing to compare with the linear loop; is the force zero?", True
        return
    yield (
        f"{where}: differs from the linear loop by at most {off[0]:.2g} (admittance) and {off[1]:.2g} (impedance), relative",
        False,
    )


def _off(columns: Columns, name: str) -> float | None:
    """Largest relative difference, over the frequencies at which both are known; None if there are none."""
    seen, linear = (columns[f"{kind}{name}_re"] + 1j * columns[f"{kind}{name}_im"] for kind in ("", "linear_"))
    off = np.abs(seen - linear) / np.abs(linear)
    return float(np.max(off, where=np.isfinite(off), initial=0.0)) if np.isfinite(off).any() else None


def _range(values: np.ndarray) -> list[float] | None:
    """The least and the largest value; None if none is known."""
    known = values[~np.isnan(values)]
    return [float(known.min()), float(known.max())] if known.size else None


def _span(ends: list[float], digits: int = 7) -> str:
    return " to ".join(dict.fromkeys(f"{end:.{digits}g}" for end in ends))


BLOCKWISE = {"bode": BodeTally, "compare-bode": BodeTally, "passivity": PassivityTally, "compare": SpecTally}


SUMMARIES = {
    "design": (design, design_lines),
    "passivity-filters": (filter_choices, filter_lines),
    "simulate": (simulation, simulation_lines),
    "why": (why, why_lines),
    "simulate-response": (simulated_response, simulated_response_lines),
}
