"""The lines of `check` on what holds for all of [for_all]."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec


def facts(spec: Spec, *_: object) -> dict[str, Any]:
    """for_all: of a spec with [for_all], whether it is stable for all of it, see `rows.verdict`; at_random: the same of
    frames at random, if it has their shares; every_hand: what hands need then, see `every_hand.damping`.
    """
    if not spec.for_all:
        return {}
    from wavesweep.for_all.every_hand import damping
    from wavesweep.for_all.rows import verdict
    from wavesweep.for_all.varying import Rules

    random = Rules.of(spec).on_average()
    found = {"for_all": verdict(spec)} | ({"at_random": verdict(spec, random)} if random else {})
    return found | {"every_hand": damping(spec)}


def lines(spec: Spec, found: Mapping[str, Any]) -> Iterator[tuple[float, str]]:
    """Yield what is proved."""
    if not found.get("for_all"):
        return
    from wavesweep.for_all.rows import in_words
    from wavesweep.program.analyses.assumptions import losses, of_axes

    apart = spec.for_all.apart(spec.values) if spec.for_all else []
    without = f", without the spec's own {' and '.join(apart)}" if apart else ""
    yield 1, in_words(found["for_all"]) + without
    if found.get("at_random"):
        yield 1, in_words(found["at_random"])
    if found.get("every_hand"):
        yield 1.5, _every_hand(found["every_hand"])
    own = of_axes(spec, spec.for_all.axes if spec.for_all else (), "[for_all]")
    below = [f"for the spec's own {own or 'numbers'}"]
    if lost := "; ".join(losses(spec)):
        below.append(
            f"with every {'message' if spec.drawing else 'result'} in time (for all: {lost})"
        )
    yield 1, f"all below is {', '.join(below)}:"


def _every_hand(found: Mapping[str, Any]) -> str:
    """What every passive hand needs of the device's damping while frames vary."""
    from wavesweep.for_all.rows import CONTRADICTED

    needed, device = found["needed"], found["device"]
    enough = (
        "no damping is proved to suffice"
        if needed is None
        else f"{needed:.4g} N*s/m of damping suffice"
    )
    safe = needed is not None and needed <= device
    refuted = found["refuted"] is not None and found["refuted"] > device
    if found.get("doubt"):
        return f"for every passive hand, whatever the frames do: {CONTRADICTED}"
    verdict = "stable" if safe else f"not stable with {found['by']}" if refuted else "not known"
    return f"for every passive hand, whatever the frames do: {verdict}; {enough}, the device has {device:.4g}"
