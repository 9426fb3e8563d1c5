"""How far a spec's own design is from what was measured, for `check`: facts and lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec

    Facts = Mapping[str, Any]


def refuse(spec: Spec) -> None:
    """Raise UsageError for a file of [measured] that cannot be used."""
    if spec.measured:
        from wavesweep.identification.measured import read_points

        read_points(spec)


def facts(spec: Spec, design: Facts, _: object = None) -> dict[str, Any]:
    """measured: of a spec with [measured], how far the design is from the points, see
    `measured.distances`."""
    if not spec.measured:
        return {}
    from wavesweep.identification.measured import distances, read_points

    return {"measured": distances(spec, read_points(spec), design["stable"])}


def lines(spec: Spec, facts_of_check: Facts) -> Iterator[tuple[float, str]]:
    """Yield how far the design is from the points of [measured]; details are indented."""
    measured = facts_of_check.get("measured", {})
    stiffness, damping = (f" {unit}" if unit else "" for unit in _units(spec))
    for name, lines_of in (("limits", _limits), ("tried", _tried), ("response", _response)):
        if name in measured:
            for line in lines_of(measured[name], stiffness, damping):
                yield 6 if line.startswith(" ") else 1, line


def _short(value: float) -> str:
    if abs(value) >= 1000:
        return f"{value:.0f}"
    return f"{value:.3g}"


def _units(spec):
    return [spec.names.keys[path].unit for path in spec.wall] or ["", ""]


def _limits(compared_limits: Facts, stiffness: str, damping: str) -> Iterator[str]:
    start = f"measured limits ({compared_limits['file']})"
    if not compared_limits["compared"]:
        yield f"{start}: none of {compared_limits['count']} compared, since what is stable is not known at their damping"
        return
    worst, compared = compared_limits["worst"], compared_limits["compared"]
    least = "more than " if worst["beyond"] else ""
    place = f"at B_VE = {worst['B_VE']:g}{damping} ({least}{_short(worst['computed'])} for {_short(worst['K_VE'])}{stiffness})"
    median = f"{compared_limits['median_ratio']:.3g} in the median"
    yield f"{start}: computed over measured is {median}, {least}{worst['ratio']:.3g} at worst, {place}"
    worst_promise = compared_limits["most_promised"]
    if worst_promise and not worst_promise["beyond"]:
        much = f", by {100 * (worst_promise['ratio'] - 1):.3g} % at most"
    else:
        much = ""
    side = f"the model promises more than was measured, the dangerous side, at {compared_limits['more']}{much}"
    yield f"  of {compared} limits {side if worst_promise else 'the model promises more than was measured at none'}"
    yield f"  {_explained(compared_limits, stiffness)}"
    if compared_limits["above_hole"]:
        yield f"  {compared_limits['above_hole']} of them lie above stiffnesses at which the model is unstable"
    if remaining := compared_limits["count"] - compared:
        yield f"  not compared: {remaining} of {compared_limits['count']}, since what is stable is not known at their damping"


def _explained(compared_limits: Facts, stiffness: str) -> str:
    least = "at least " if compared_limits["beyond"] else ""
    size = f"{least}{_short(compared_limits['rms'])}{stiffness} rms, {100 * compared_limits['share']:.3g} % of their median"
    if compared_limits["scatter"] is not None:
        size += f"; repeated limits scatter by {_short(compared_limits['scatter'])}{stiffness}"
    if compared_limits["explained"]:
        return f"the model explains them{' within a tenth' if compared_limits['scatter'] is None else ''}: {size}"
    return f"the model does not explain them: {size}"


def _tried(walls: Facts, stiffness: str, damping: str) -> Iterator[str]:
    unknown = f", {walls['not_known']} not known" if walls["not_known"] else ""
    yield (
        f"measured walls ({walls['file']}): {walls['wrong']} of {walls['count']} on the wrong side; unstable though computed "
        f"stable, the dangerous side: {walls['promised']}; stable though computed unstable: {walls['denied']}{unknown}"
    )
    for point in walls["worst"]:
        observed = "stable" if point["stable"] else "unstable"
        ends = f"the model is {'stable at no' if point['stable'] else 'stable at every'} stiffness in the range"
        if point["ratio"] is not None:
            ends = f"the model's nearest end is at {_short(point['computed'])}{stiffness}, {point['ratio']:.3g} times that"
        yield f"  {observed} at B_VE = {point['B_VE']:g}{damping}, K_VE = {_short(point['K_VE'])}{stiffness}: {ends}"


def _response(compared_points: Facts, *_: str) -> Iterator[str]:
    start = f"measured response ({compared_points['file']})"
    if not compared_points["compared"]:
        if compared_points["stable"]:
            why = "no frequency can be compared"
        else:
            why = "not compared, since the model is not stable"
        yield f"{start}: {why}"
        return
    worst, phase = compared_points["worst"], compared_points["worst_phase"]
    median = f"{compared_points['median_ratio']:.3g} in the median"
    place = f"{worst['ratio']:.3g} at worst, at {worst['frequency_hz']:.4g} Hz"
    yield f"{start}: computed over measured admittance is {median}, {place}"
    yield f"  the model is softer at {compared_points['softer']} of {compared_points['compared']} frequencies"
    place = f"{phase['deg']:.3g} at worst, at {phase['frequency_hz']:.4g} Hz"
    yield f"  its phase less the measured one: {compared_points['median_deg']:.3g} deg in the median, {place}"
    if remaining := compared_points["count"] - compared_points["compared"]:
        yield f"  not compared: {remaining} of {compared_points['count']}, above half the rate of the ticks or of a coherence below a half"
