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


def facts(spec: Spec, own: Facts, _: object = None) -> dict[str, Any]:
    """measured: of a spec with [measured], how far the design is from the points, see
    `measured.distances`."""
    if not spec.measured:
        return {}
    from wavesweep.identification.measured import distances, read_points

    return {"measured": distances(spec, read_points(spec), own["stable"])}


def lines(spec: Spec, found: Facts) -> Iterator[tuple[float, str]]:
    """Yield how far the design is from the points of [measured]; details are indented."""
    measured = found.get("measured", {})
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


def _limits(found: Facts, stiffness: str, damping: str) -> Iterator[str]:
    start = f"measured limits ({found['file']})"
    if not found["compared"]:
        yield f"{start}: none of {found['count']} compared, since what is stable is not known at their damping"
        return
    worst, compared = found["worst"], found["compared"]
    least = "more than " if worst["beyond"] else ""
    place = f"at B_VE = {worst['B_VE']:g}{damping} ({least}{_short(worst['computed'])} for {_short(worst['K_VE'])}{stiffness})"
    median = f"{found['median_ratio']:.3g} in the median"
    yield f"{start}: computed over measured is {median}, {least}{worst['ratio']:.3g} at worst, {place}"
    most = found["most_promised"]
    if most and not most["beyond"]:
        much = f", by {100 * (most['ratio'] - 1):.3g} % at most"
    else:
        much = ""
    side = (
        f"the model promises more than was measured, the dangerous side, at {found['more']}{much}"
    )
    yield f"  of {compared} limits {side if most else 'the model promises more than was measured at none'}"
    yield f"  {_explained(found, stiffness)}"
    if found["above_hole"]:
        yield f"  {found['above_hole']} of them lie above stiffnesses at which the model is unstable"
    if left := found["count"] - compared:
        yield f"  not compared: {left} of {found['count']}, since what is stable is not known at their damping"


def _explained(found: Facts, stiffness: str) -> str:
    least = "at least " if found["beyond"] else ""
    size = f"{least}{_short(found['rms'])}{stiffness} rms, {100 * found['share']:.3g} % of their median"
    if found["scatter"] is not None:
        size += f"; repeated limits scatter by {_short(found['scatter'])}{stiffness}"
    if found["explained"]:
        return f"the model explains them{' within a tenth' if found['scatter'] is None else ''}: {size}"
    return f"the model does not explain them: {size}"


def _tried(found: Facts, stiffness: str, damping: str) -> Iterator[str]:
    unknown = f", {found['not_known']} not known" if found["not_known"] else ""
    yield (
        f"measured walls ({found['file']}): {found['wrong']} of {found['count']} on the wrong side; unstable though computed "
        f"stable, the dangerous side: {found['promised']}; stable though computed unstable: {found['denied']}{unknown}"
    )
    for point in found["worst"]:
        observed = "stable" if point["stable"] else "unstable"
        ends = f"the model is {'stable at no' if point['stable'] else 'stable at every'} stiffness in the range"
        if point["ratio"] is not None:
            ends = f"the model's nearest end is at {_short(point['computed'])}{stiffness}, {point['ratio']:.3g} times that"
        yield f"  {observed} at B_VE = {point['B_VE']:g}{damping}, K_VE = {_short(point['K_VE'])}{stiffness}: {ends}"


def _response(found: Facts, *_: str) -> Iterator[str]:
    start = f"measured response ({found['file']})"
    if not found["compared"]:
        if found["stable"]:
            why = "no frequency can be compared"
        else:
            why = "not compared, since the model is not stable"
        yield f"{start}: {why}"
        return
    worst, phase = found["worst"], found["worst_phase"]
    median = f"{found['median_ratio']:.3g} in the median"
    place = f"{worst['ratio']:.3g} at worst, at {worst['frequency_hz']:.4g} Hz"
    yield f"{start}: computed over measured admittance is {median}, {place}"
    yield f"  the model is softer at {found['softer']} of {found['compared']} frequencies"
    place = f"{phase['deg']:.3g} at worst, at {phase['frequency_hz']:.4g} Hz"
    yield f"  its phase less the measured one: {found['median_deg']:.3g} deg in the median, {place}"
    if left := found["count"] - found["compared"]:
        yield f"  not compared: {left} of {found['count']}, above half the rate of the ticks or of a coherence below a half"
