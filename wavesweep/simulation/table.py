"""A simulation: every tick, and the response that it shows beside that of the linear loop;
`simulate`, `simulate-response`."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from math import log
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine.response import BAND
from wavesweep.program.columns import Columns, run_column
from wavesweep.program.number_words import in_digits
from wavesweep.program.reading.keys import DEVICES
from wavesweep.program.reading.reading import read_bytes
from wavesweep.program.tables.kind import (
    Line,
    Numbers,
    Recompute,
    counted_doubts,
    in_doubt,
    plain,
    whole_kind,
)
from wavesweep.program.tables.table import Table, facts_of
from wavesweep.simulation.columns import TICKS
from wavesweep.simulation.keys import RANDOM, entry_of, first_tick

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec

FREQUENCIES_SHOWN = 5  # frequencies that a notice names
SETTLED_SINE = 0.01  # share of the slowest mode that may be left where a sine is measured
METHODS = {
    "simulate": "blocks run tick by tick from rest, plants exact under inputs held over a tick"
}
RESPONSE_METHODS = {
    "admittance": "least squares over the settled stretch: a sine and a constant per phase of the frame; mean over the phases",
    "linear_admittance": "resolvent of the frame, component at the force's own frequency",
}


def simulate(
    spec: Spec,
    log: str | None = None,
    columns_of_log: Mapping[str, str] = MappingProxyType({}),
    scales: Mapping[str, float] = MappingProxyType({}),
) -> list[Table]:
    """The time series of the simulated spec and, for settled sines, the response estimated from
    it.

    log: a file whose inputs are simulated, and whose outputs stand beside; columns_of_log, scales:
    see `read_run`.
    """
    from wavesweep.simulation.experiment import (
        linear_loop,
        seen_response,
        settled_values,
        simulation_of,
    )
    from wavesweep.simulation.from_spec import hand_force
    from wavesweep.simulation.record import recorded

    started = time.perf_counter()
    if log is not None:
        return [_beside_log(spec, log, columns_of_log, scales)]
    hand = hand_force(spec)
    simulation = simulation_of(spec, hand.force)
    columns = recorded(simulation)
    simulated_at, linear = time.perf_counter(), linear_loop(spec)
    seconds = {"march_s": simulated_at - started}
    facts = _facts(spec, METHODS, seconds, [*_unmeasured(spec, hand.tones), *_notices(spec)]) | {
        "linear_loop": linear
    }
    rows = len(columns["tick"])
    facts |= _facts_of_run(spec, simulation, columns, len(hand.force))
    at_random = spec.drawing is not None and spec.drawing.at_random
    alike = not (
        spec.simulate["frames"] or spec.simulate["messages"] or at_random
    )  # as those of the linear loop
    ends = settled_values(spec, linear) if spec.simulate["input"] == "step" else {}
    facts["settles_at"] = ends if alike else _reached(ends, columns)
    tables = [Table.of("simulate", columns, facts)]
    # whether the input enters where the hand does
    if tones := [
        tone
        for tone in hand.tones
        if tone.last <= rows
        and alike
        and (spec.drawing is None or entry_of(spec) == (spec.drawing.hand or ("",))[0])
    ]:
        response = seen_response(spec, simulation, tones)
        timings = {"estimate_s": time.perf_counter() - simulated_at}
        notices = [*_unlike_the_linear(spec, linear, tones, simulation.frame)]
        facts = _facts(spec, RESPONSE_METHODS, timings, notices) | {"linear_loop": linear}
        tables.append(Table.of("simulate-response", response, facts))
    return tables


def _facts_of_run(spec, simulation, columns: Columns, wanted: int) -> dict[str, Any]:
    """The facts of a run of so many ticks."""
    from wavesweep.simulation.march import FARTHEST_POSITION, STRONGEST

    rows = len(columns["tick"])
    stopped = simulation.stopped or ("numbers overflow" if rows < wanted else "")
    late = simulation.late
    facts: dict[str, Any] = {
        "ticks": {"wanted": wanted, "simulated": rows, "stopped": stopped},
        "slow_results": {
            "results": len(late),
            "late": int((late > 0).sum()),
            "lost": int((late < 0).sum()),
        },
        "limits": {"position_m": FARTHEST_POSITION, "force_N": STRONGEST},
    }
    if spec.drawing:  # whose rate may be an expression
        facts["tick_s"] = 1 / spec.tick_hz
    if simulation.ages:
        facts["channels"] = [*simulation.ages]
    if spec.simulate.frames_file or spec.simulate["frames"] == RANDOM:
        # how many of the frames begun have each length, ticks
        begun = int(columns["frame"].max(initial=-1)) + 1
        lengths = np.diff([*simulation.starts, simulation.frame])[
            np.arange(begun) % len(simulation.starts)
        ]
        values, counts = np.unique(lengths, return_counts=True)
        facts["frames"] = dict(zip(map(str, values.tolist()), counts.tolist(), strict=True))
    return facts


def _beside_log(
    spec: Spec, log: str, columns_of_log: Mapping[str, str], scales: Mapping[str, float]
) -> Table:
    """The time series under the inputs of a log, with what it has measured beside."""
    from wavesweep.simulation.experiment import linear_loop, simulation_of
    from wavesweep.simulation.measured_run import beside, notices_of, read_run
    from wavesweep.simulation.record import recorded

    started = time.perf_counter()
    run = read_run(log, columns_of_log, scales, spec)
    simulation = simulation_of(spec, None, run.inputs)
    columns = recorded(simulation)
    measured, apart = beside(columns, run)
    first = len(TICKS) + len(simulation.shown) + len(simulation.ages)
    names = [*columns]
    columns = {
        **{name: columns[name] for name in names[:first]},
        **measured,
        **{name: columns[name] for name in names[first:]},
    }
    notices = [*notices_of(run, columns), *_notices(spec)]
    seconds = {"march_s": time.perf_counter() - started}
    facts = _facts(spec, METHODS, seconds, notices) | {"linear_loop": linear_loop(spec)}
    facts |= _facts_of_run(spec, simulation, columns, len(run.fresh))
    facts["log"] = {
        "file": Path(log).name,
        "sha256": run.sha256,
        "columns": {**run.columns},
        "units": {name: unit for name, unit in run.units.items() if f"log_{name}" in columns},
        "apart": apart,
    }
    return Table.of("simulate", columns, facts)


def _reached(ends: Mapping[str, float], columns: Columns) -> dict[str, float]:
    """The ends to which a run comes: what is at rest in the linear loop is so whatever messages
    do."""
    reached = {}
    for name, end in ends.items():
        column = columns[run_column("outputs", name)]
        last = column[-1] if len(column) else np.nan
        if abs(last - end) <= BAND * abs(end):
            reached[name] = end
    return reached


def _unmeasured(spec, tones):
    """Yield a notice about the sines without a settled section in the record."""
    if spec.simulate["input"] in ("sine", "stepped-sine"):
        unmeasured = [f"{hz:g}" for hz in spec.simulate["frequency_hz"][len(tones) :]]
        if unmeasured:
            named = ", ".join(
                unmeasured
                if len(unmeasured) <= FREQUENCIES_SHOWN
                else [unmeasured[0], "...", unmeasured[-1]]
            )
            longer = "a longer simulate.duration_s measures them"
            yield f"not measured at {named} Hz: the input ends before they have settled; {longer}"


def _unlike_the_linear(spec, linear, tones, frame):
    """Yield notices about tones that are their own image, and of a slow mode that is there when
    they are measured.

    frame: its ticks.
    """
    from wavesweep.simulation.record import own_image

    tick = 1 / spec.tick_hz
    images = [
        f"{tone.frequency_hz:g}"
        for tone in tones
        if own_image(2 * np.pi * tone.frequency_hz * tick * frame)
    ]
    if images and frame > 1:
        image = "a sine is its own image: the response seen depends on its phase"
        yield f"at {', '.join(images)} Hz, a multiple of half the frame's rate, {image}"
    radius, settle = linear["spectral_radius"], spec.simulate["settle_s"]
    share = radius ** (settle * spec.tick_hz / frame) if linear["stable"] else 0.0
    if share > SETTLED_SINE:
        constant = -frame / spec.tick_hz / log(radius)
        enough = log(SETTLED_SINE / 10) / log(radius) * frame / spec.tick_hz
        yield (
            f"the slowest mode, which falls to 1/e in {constant:.3g} s, still has {in_digits(100 * share, 2)} % of its "
            f"beginning after simulate.settle_s = {settle:g} s, and is part of the "
            f"response seen; {enough:.3g} s leave {10 * SETTLED_SINE:g} % of it"
        )


def _facts(
    spec: Spec, methods: Mapping[str, str], timings: Mapping[str, float], notices: list[str]
) -> dict[str, Any]:
    """The facts of a run; with the digest of the file of frames, as that of the spec has only its name."""
    from wavesweep.simulation.from_spec import beside, claim_of

    counts = {"computed": 1, "skipped": 0, "certified": 0}
    facts = facts_of(spec, methods, counts, timings, notices, claims={"spec": claim_of(spec)})
    if spec.simulate.frames_file:
        # The same limit in bytes as of the run's reading: what a shell passes is not read again.
        data = read_bytes(beside(spec, spec.simulate.frames_file), 1_000_000_000)
        facts["frames_sha256"] = hashlib.sha256(data).hexdigest()
    return facts


def _notices(spec: Spec) -> Iterator[str]:
    """Yield notices about values that a user may not expect."""
    from wavesweep.program.analyses.assumptions import over_preset

    options = spec.simulate
    unread = spec.simulate.unread()
    if unread:
        keys = ", ".join(f"simulate.{name}" for name in unread)
        yield f"{keys}: not read, as simulate.input is {options['input']!r}".replace("'", '"')
    yield from options.between_ticks(spec.tick_hz)
    if options.frames_file:
        from wavesweep.simulation.from_spec import measured_frames

        unfit = measured_frames(spec).unfit
        if unfit.any():
            yield (
                f"simulate.frames: {unfit.sum()} of {unfit.size} frames last no whole ticks; each is one of its neighbours, and "
                "their sum is right"
            )
    if options["frames"]:
        yield "simulate.frames: what is said of the linear loop is about frames of one length; no response is compared with it"
    if spec.preset:
        beyond = []
        for name, value in DEVICES[spec.preset].simulation().items():
            if value and options[name] == value:
                beyond.append(f"{name} = {value:g}")
        if beyond:
            yield f"the preset {spec.preset} adds to the linear loop: {', '.join(beyond)}"
        options_given = {f"simulate.{name}": value for name, value in options.values.items()}
        yield from over_preset(spec, options_given)
    if options["resolution"] and spec.values.get("device.velocity") == "exact":
        yield 'device.velocity = "exact" does not see the encoder; "difference" takes its velocity from it'


def _run_numbers(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    """The run, the linear loop behind it, contact, saturation, timing and energies; None if
    something does not apply."""
    numbers = _numbers_at_first(len(columns["tick"]), facts)
    if not numbers["ticks"]:
        return numbers
    options = facts["spec"]["simulate"]
    if "wall" in options:
        numbers["contact"] = _contact(columns) | {"pulls": options.get("pulls", True)}
    if options.get("friction"):
        numbers["rest_s"] = _rest(columns)
    if "max_force" in options:
        numbers["share_at_max_force"] = float(np.mean(columns["f_m"] != columns["f_device"]))
    frames = facts.get("frames")
    at_random = options.get("frames") == RANDOM
    if frames:
        seed = options["seed"] if at_random else None
        numbers["frames"] = {"frames": sum(frames.values()), "lengths": frames, "seed": seed}
    lost = at_random and facts["slow_results"]["lost"]
    if options.get("late") or options.get("dropped") or lost:
        numbers["slow_results"] = facts["slow_results"]
    if "energy_hand" in columns:
        numbers["energy"] = _energy(columns)
    for name, final in facts.get("settles_at", {}).items():
        numbers["outputs"][name] = _after_step(columns, name, final, options["at_s"])
    return numbers


def _numbers_at_first(rows: int, facts: Mapping[str, Any]) -> Numbers:
    """The numbers of a run that need none of its rows."""
    spec = facts["spec"]
    options = spec["simulate"]
    tick = facts["tick_s"] if "tick_s" in facts else 1 / spec["rates"]["fast_hz"]
    ports = spec.get("ports", {})
    entry = ""
    if "hand" not in ports:
        entry = next(iter(ports.get("inputs") or ()), "")
    return {
        "controller": spec["controller"]["kind"] if "controller" in spec else "drawn",
        "input": "log" if "log" in facts else options["input"],
        "from": facts["log"]["file"] if "log" in facts else options.get("from") or entry,
        "ticks": rows,
        "wanted_ticks": facts["ticks"]["wanted"],
        "seconds": rows * tick,
        "stopped": facts["ticks"]["stopped"],
        "linear_loop": dict(facts["linear_loop"]),
        "contact": None,
        "rest_s": None,
        "max_force": options.get("max_force"),
        "share_at_max_force": None,
        "frames": None,
        "slow_results": None,
        "energy": None,
        "outputs": {},
        "log": facts.get("log", {}).get("apart"),
    }


def _contact(columns: Columns) -> dict[str, float]:
    """How often contact is made, and the share of the time in which it is felt."""
    touching = columns.get("touching", np.zeros(1, bool))
    made = int(np.sum(touching[1:] & ~touching[:-1]) + touching[:1].sum())
    return {"times": made, "share": float(touching.mean())}


def _after_step(columns: Columns, name: str, final: float, start: float) -> dict[str, float | None]:
    """What an output that settles at `final` does after a step asked for at `start` (s): its peak,
    and when it has settled, after the tick at which the step sets in."""
    values = columns[run_column("outputs", name)]
    time_s = columns["time_s"]
    after = np.round(time_s - time_s[set_in(columns, start)], 12)
    peak = int(np.argmax(np.abs(values)))
    outside = np.flatnonzero(np.abs(values - final) > BAND * abs(final))
    settled = int(outside[-1]) + 1 if outside.size else 0
    return {
        "settles_at": final,
        "ends_at": float(values[-1]),
        "peak": float(values[peak]),
        "peak_s": float(after[peak]),
        "settled_s": float(after[settled]) if final and settled < len(after) else None,
    }


def set_in(columns: Columns, at_s: float) -> int:
    """The row of the tick at which a step or a pulse sets in."""
    time_s = columns["time_s"]
    if len(time_s) < 2:
        return 0
    return min(first_tick(at_s, 1 / float(time_s[1] - time_s[0])), len(time_s) - 1)


def _rest(columns: Columns) -> float | None:
    """The time (s) from which on friction holds the device to the end, for more than a frame;
    None if it does not."""
    moved = np.flatnonzero(np.diff(columns["x"]))
    first = int(moved[-1]) + 1 if moved.size else 0
    if columns["frame"][-1] - columns["frame"][first] <= 1:
        return None
    return float(columns["time_s"][first])


def _energy(columns: Columns) -> Numbers:
    last = {
        name: columns.get(f"energy_{name}", np.full(1, np.nan))[-1]
        for name in ("hand", "device", "channel")
    }
    least = {"channel_least": np.min(columns.get("energy_channel", np.nan))}
    return {name: plain(value) for name, value in (last | least).items()}


def _run_lines(facts: Numbers) -> Iterator[Line]:
    ticks, wanted = facts["ticks"], facts["wanted_ticks"]
    much = f"{ticks}" if ticks == wanted else f"{ticks} of {wanted}"
    if not facts["linear_loop"]["stable"]:
        yield unstable(facts["linear_loop"]), True
    entry = f"{facts['from']}:" if facts["from"] else "force of the hand"
    yield (
        f"{facts['controller']}, {entry} {facts['input']}: {much} tick{'s' * (wanted != 1)}, {facts['seconds']:g} s",
        False,
    )
    if facts["stopped"]:
        yield (
            f"stopped after tick {ticks}, {facts['seconds']:g} s: {facts['stopped']}; the rows end before it",
            True,
        )
    if ticks == 0:
        return
    if facts["contact"]:
        made, share = facts["contact"]["times"], 100 * facts["contact"]["share"]
        wall = "" if facts["contact"]["pulls"] else ", of a wall that only pushes"
        times = "once" if made == 1 else f"{made} times"
        yield f"contact made {times}{wall}, felt for {share:.3g} % of the time", False
    yield from _result_lines(facts)


def _result_lines(facts: Numbers) -> Iterator[Line]:
    """Yield rest, saturation, frames, late results, outputs and energies."""
    if facts["rest_s"] is not None and not facts["stopped"]:
        yield f"came to rest at {facts['rest_s']:.4g} s, and friction holds it to the end", False
    if facts["share_at_max_force"] is not None:
        share = 100 * facts["share_at_max_force"]
        yield (
            f"motors at their limit of {facts['max_force']:g} N for {share:.3g} % of the time",
            False,
        )
    if facts["frames"]:
        yield _frames_line(**facts["frames"]), False
    if timing := facts["slow_results"]:
        yield (
            f"of {timing['results']} slow results {timing['late']} came late and {timing['lost']} were lost",
            False,
        )
    for name, off in (facts["log"] or {}).items():
        differ = f"simulated and measured differ by {off['rms']:.4g} in the root mean square"
        longest = f"by {off['largest']:.4g} at most, at {off['largest_s']:.4g} s"
        yield f"{name}: {differ}, of {off['measured_rms']:.4g} in the log, {longest}", False
    for name, output in facts["outputs"].items() if not facts["stopped"] else ():
        yield _output_line(name, output), False
    if facts["energy"] and not facts["stopped"]:  # the energies of a run that explodes mean nothing
        yield (
            _energy_line(
                facts["energy"], "force against it" if facts["controller"] == "drawn" else "motors"
            ),
            False,
        )


def _frames_line(frames: int, lengths: Mapping[str, int], seed: int | None) -> str:
    """How many frames of which lengths a run had, that were drawn or read from a file."""
    most_frequent = sorted(sorted(lengths, key=lengths.__getitem__)[-FREQUENCIES_SHOWN:], key=int)
    shares = ", ".join(
        f"{ticks} ticks {100 * lengths[ticks] / frames:.3g} %" for ticks in most_frequent
    )
    if len(lengths) > len(most_frequent):
        rest = f", {len(lengths) - len(most_frequent)} other lengths"
    else:
        rest = ""
    return f"{frames} frames {'as they were measured' if seed is None else f'at random (seed {seed})'}: {shares}{rest}"


def _output_line(name: str, output: Numbers) -> str:
    """How an output answers a step: where it settles, or, if it does not in the run, where it is
    at the end."""
    final = output["settles_at"]
    largest = abs(output["peak"])
    settled = output["settled_s"] is not None
    if not final:
        settled = abs(output["ends_at"]) <= BAND * largest
    if settled:
        line = f"{name} settles at {final:.6g}"
    else:
        line = f"{name} is {output['ends_at']:.6g} at the end, where the linear loop settles at {final:.6g}"
    if largest > (1 + BAND / 10) * abs(final):
        line += f", peak {output['peak']:.6g} reached {output['peak_s']:.4g} s after the step"
    if output["settled_s"] is None:
        return line
    after = "it" if " the step" in line else "the step"
    return f"{line}, within {100 * BAND:g} % from {output['settled_s']:.4g} s after {after} on"


def unstable(linear: Numbers) -> str:
    """The sentence about a linear loop that is not stable."""
    radius = linear["spectral_radius"]
    if radius is None:
        return (
            "the linear loop is not known to be stable (numbers overflow, or rounding hides them)"
        )
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


def _response_numbers(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    """Largest relative difference between the simulated response and that of the linear loop,
    None without one."""
    stable, radius = facts["linear_loop"]["stable"], facts["linear_loop"]["spectral_radius"]
    off = {
        f"largest_difference_{name}": _off(columns, name) for name in ("admittance", "impedance")
    }
    verdict = {"stable": stable, "undecided": not stable and (radius is None or radius == 1)}
    doubts = counted_doubts(columns["doubt"][columns["doubt"] != "unstable"])
    return {
        "frequencies": len(columns["frequency_hz"]),
        "doubts": doubts,
        **verdict,
        **(off if stable else dict.fromkeys(off)),
    }


def _response_lines(facts: Numbers) -> Iterator[Line]:
    where = (
        f"response at {facts['frequencies']} frequenc{'y' if facts['frequencies'] == 1 else 'ies'}"
    )
    yield from in_doubt(facts["doubts"], facts["frequencies"], "without a reliable value")
    if facts["undecided"]:
        yield (
            f"{where}: the loop is not known to be stable, and may have no steady response to compare it with",
            True,
        )
        return
    if not facts["stable"]:
        yield (
            f"{where}: an unstable loop has no steady response to compare it with (doubt: unstable)",
            True,
        )
        return
    off = [facts[f"largest_difference_{name}"] for name in ("admittance", "impedance")]
    if None in off:
        yield (
            f"{where}: not known, so there is nothing to compare with the linear loop; is the force zero?",
            True,
        )
        return
    yield (
        f"{where}: differs from the linear loop by at most {off[0]:.2g} (admittance) and {off[1]:.2g} (impedance), relative",
        False,
    )


def _off(columns: Columns, name: str) -> float | None:
    """Largest relative difference over the frequencies at which both are known; None without
    such a frequency."""
    response, linear = (
        columns[f"{kind}{name}_re"] + 1j * columns[f"{kind}{name}_im"] for kind in ("", "linear_")
    )
    off = np.abs(response - linear) / np.abs(linear)
    if np.isfinite(off).any():
        return float(np.max(off, where=np.isfinite(off), initial=0.0))
    return None


def _again(number: int, facts: Mapping[str, Any], name: Callable[[], str]) -> Recompute | None:
    from wavesweep.program.spec import load

    if "frames_sha256" in facts or "log" in facts:
        return None  # the package does not have the path of the file
    spec = replace(load(facts["spec"]).asking("simulate"), name=name())
    return Recompute(spec.sha256, simulate(spec)[number].blocks)


KINDS = (
    whole_kind(
        "simulate",
        _run_numbers,
        _run_lines,
        "wavesweep.simulation.figure.simulate",
        again=partial(_again, 0),
        before=len(TICKS),
    ),
    whole_kind(
        "simulate-response",
        _response_numbers,
        _response_lines,
        "wavesweep.simulation.figure.simulate_response",
        again=partial(_again, 1),
    ),
)
