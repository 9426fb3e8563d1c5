"""The numbers of a spec's own design: stability, the feel at rest, and its slowest and least
damped modes."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from wavesweep.engine.keys import LARGEST
from wavesweep.engine.loop import Loops
from wavesweep.engine.poles import GONE, damping_ratio, lines_in_loops, named_modes, radius_of
from wavesweep.program.analyses.assumptions import FAVOURABLE, MOST_AXES, model_in_words
from wavesweep.program.analyses.claim_words import verdict_lines
from wavesweep.program.analyses.claims import STABLE, Claim, Status, Verdict, own_scope, questions
from wavesweep.program.analyses.feel import felt_at_rest
from wavesweep.program.analyses.free_space import radius_without_wall, without_wall_in_words
from wavesweep.program.analyses.mode_in_the_way import (
    SAME_EIGENVALUE,
    only_oscillates,
    stays_in_words,
    turns_of_modes,
)
from wavesweep.program.analyses.poles import leading
from wavesweep.program.analyses.required_words import where_nothing_decides
from wavesweep.program.analyses.spec_loops import loop_at_hand, refuse_singular
from wavesweep.program.number_words import in_time
from wavesweep.program.spec import Spec
from wavesweep.program.spec.studies import FARTHEST_FACTOR
from wavesweep.program.sweep.grid import own_loop

USUAL = {
    "K_VE": 1000.0,
    "B_VE": 10.0,
    "Kp": 20.0,
    "K_LM": 1000.0,
    "B_LM": 10.0,
}  # followed up to FARTHEST_FACTOR times that, from 0


def searched(spec: Spec, name: str, path: str) -> tuple[float, float]:
    """The range about the value of a number in which its stable intervals are looked for, and
    that of [sweep] with it."""
    value, wall = spec.own(path), spec.wall
    usual = USUAL.get(dict(zip(wall, ("K_VE", "B_VE"), strict=False)).get(path, name), 1.0)
    if path in wall or not (value or spec.drawing):
        start = 0.0
    else:
        start = value / FARTHEST_FACTOR or -FARTHEST_FACTOR * usual
    ends = [start, float(np.clip(FARTHEST_FACTOR * (value or usual), -LARGEST, LARGEST))]
    for axis in spec.sweep:
        if axis.path == path:
            ends += axis.values or (axis.start, axis.stop)
    return min(ends), max(ends)


def is_an_end(value: float, intervals: Sequence[Sequence[float]]) -> bool:
    """Whether a value is an end of one of some intervals, but for rounding."""
    ends = np.ravel(intervals)
    # Relative: ends of intervals are rounded, and a value as near as this may be one.
    return bool(np.isclose(ends, value, rtol=1e-9, atol=0).any())


@np.errstate(all="ignore")  # of numbers that overflow
def own_design(spec: Spec, loop=None) -> dict:
    """The numbers of the spec's own design without those about its changes, as a JSON-able dict; a
    missing number is None.

    stable, radius_without_wall (of a stable loop, see `free_space`), spectral_radius (per frame;
    missing after overflow or if rounding hides it, and then it is not known to be stable),
    only_oscillates (of a radius of 1: whether all modes are pairs on the circle), stays (of a radius of 1: the states of a
    mode that neither grows nor decays nor oscillates, empty if there is none), period_s (of the
    frame), assumes (see `assumptions`); felt: stiffness (N/m) and damping (N*s/m) of the wall as
    the hand feels it towards 0 Hz, whether it is rigid, as an integrator makes it: then neither has
    a limit, and over_band, see `felt_over_band`; slowest: time constant (s), and at the strongest
    line that a spectrum of the states shows of it (see `lines_of`) the damping ratio and the
    frequency (rad/s) of the slowest mode, the second line (Hz) if it has more than a third of the
    energy, and the states that take part most; least_damped: the same of the mode with the lowest
    damping ratio, if it is another one. A drawn loop is felt at the hand's port if it has one.
    loop: the one prepared for responses, if it is known already.
    """
    nominal = own_loop(spec)
    refuse_singular(spec, nominal.drawing)
    drawn = nominal.drawn()
    drift = nominal.drift_of_frames()
    E, hidden = nominal.frames_with_reliability(drift, drawn)
    radius, period = float(radius_of(E, hidden)), float(drawn.period * drawn.ticks)
    numbers = {"stable": radius < 1, "spectral_radius": _number(radius), "period_s": period}
    numbers["assumes"] = model_in_words(spec)
    numbers["radius_without_wall"] = radius_without_wall(spec) if numbers["stable"] else None
    modes = []
    if radius <= 1:
        names, (delta, shares) = named_modes(E, drawn, drift)
        for mode, share in zip(delta, shares, strict=True):
            modes.append((complex(mode), leading(names, share)))
        modes = modes or [(-1 + 0j, [])]  # without a state
    if radius == 1:
        staying = [states for mode, states in modes if abs(mode) <= SAME_EIGENVALUE]
        numbers["stays"] = staying[0] if staying else []
        numbers["only_oscillates"] = only_oscillates(delta)
        modes = []
    if loop is None and not (spec.drawing and spec.drawing.hand is None):
        loop = loop_at_hand(spec)
    named = {"slowest": modes[0] if modes else None, "least_damped": _least_damped(nominal, modes)}
    described = {name: mode and _mode(spec, *mode, period) for name, mode in named.items()}
    return numbers | {"felt": felt_at_rest(spec, loop), **described}


def _least_damped(
    loops: Loops, modes: Sequence[tuple[complex, list[str]]]
) -> tuple[complex, list[str]] | None:
    """The mode with the lowest damping ratio; None if it is the first one, the slowest, or its
    conjugate."""
    if not modes:
        return None
    delta = np.array([mode for mode, _ in modes])
    lasting = np.abs(1 + delta) >= GONE
    ratios = np.ones(delta.size)
    of_lasting = damping_ratio(delta[lasting], turns_of_modes(loops, delta[lasting]))
    ratios[lasting] = np.nan_to_num(of_lasting, nan=1.0)
    damped, slowest = modes[int(np.argmin(ratios))], modes[0][0]
    another = (
        abs(damped[0] - slowest) > SAME_EIGENVALUE
        and abs(damped[0] - slowest.conjugate()) > SAME_EIGENVALUE
    )
    return damped if another else None


def own_claim(spec: Spec, design: Mapping[str, Any]) -> Claim:
    """What is known of the loop with the spec's own numbers; design: see `own_design`, and
    `limits` if there are some."""
    radius = design["spectral_radius"]
    scope = own_scope(spec)
    if design["stable"]:
        within = [limit for limit in design.get("limits", ()) if limit["stable"]]
        certified = any(limit["certified"] for limit in within)
        return Claim(STABLE, scope, Status.CERTIFIED if certified else Status.COMPUTED)
    if radius is None or radius == 1:  # which also stands for one that is below it by rounding
        return Claim(STABLE, scope, Status.UNKNOWN, "numbers overflow, or rounding hides them")
    return Claim(STABLE, scope, Status.REFUTED, "not stable with the spec's own numbers")


def own_lines(
    spec: Spec, design: Mapping[str, Any], verdict: Verdict | None = None
) -> Iterator[str]:
    """Yield the verdict on what the spec asks, if that is more than that its design is stable, and
    whether this is, in a line or two, with what it assumes if that decides what it is: see
    `is_first`.

    design: see `own_design`.
    """
    radius = design["spectral_radius"]
    words = {Status.REFUTED: "UNSTABLE", Status.UNKNOWN: "not known whether it is stable"}
    said = words.get(own_claim(spec, design).status, "stable")
    why = "numbers overflow, or rounding hides them"
    if radius is not None:
        if spec.drawing or spec.values["rates.ratio"] % 1 == 0:
            common = ""
        else:
            common = "common "
        why = f"spectral radius {radius:.6g} per {common}frame of {in_time(design['period_s'])}"
        why += ", but for rounding" if radius == 1 else ""
    subject = f"{spec.name}, {spec.kind}"
    if verdict:
        yield from verdict_lines(verdict, subject)
        subject = f"  {_own_in_words(spec)}"
    yield f"{subject}: {said} ({why})"
    if spec.drawing and design.get("only_oscillates") and (hint := where_nothing_decides()):
        yield f"  {hint}"
    if design.get("stays"):
        yield f"  {stays_in_words(design['stays'])}"
    if design.get("radius_without_wall"):
        yield f"  {without_wall_in_words(design['radius_without_wall'])}"
    if is_first(spec, design):
        yield f"  assumes: {design['assumes']}"


def _own_in_words(spec: Spec) -> str:
    """The spec's own numbers, those by name for which [for_all] has others, and messages in
    time; what below is of them."""
    axes = spec.for_all.axes if spec.for_all else ()
    values = [f"{axis.name} = {spec.values[axis.path]:g}" for axis in axes]
    named = f" ({', '.join(values)})" if 0 < len(values) <= MOST_AXES else ""
    scopes = [question.scope for question in questions(spec)]
    late = any(scope.frames.lost or scope.frames.loss or scope.messages for scope in scopes)
    sent = "message" if spec.drawing else "result"
    in_time = f", every {sent} in time" if late else ""
    return f"own numbers{named}{in_time}, as for the limits and modes below"


def is_first(spec: Spec, design: Mapping[str, Any]) -> bool:
    """Whether what is assumed is said with the verdict: what a drawn loop means, or defaults by
    which alone it is better."""
    return bool(spec.drawing and design["assumes"]) or FAVOURABLE in design["assumes"]


def _mode(spec, mode, states, period):
    """Of a mode: s per factor e, damping ratio, rad/s of its strongest line, Hz of a second one,
    and the states."""
    with np.errstate(divide="ignore", invalid="ignore"):  # a mode of 0 is over after one frame
        s = np.log1p(mode)
        hz, second = lines_in_loops(own_loop(spec), np.array([[s]]))[0].tolist()
        s = complex(s.real / period, 2 * np.pi * hz)
        ratio = -s.real / abs(s)
        numbers = {
            "time_constant_s": -1 / s.real,
            "damping_ratio": ratio,
            "omega": s.imag,
            "second_hz": second,
        }
    return {name: _number(value) for name, value in numbers.items()} | {"states": states}


def _number(value):
    if np.isfinite(value):
        return float(value)
    return None
