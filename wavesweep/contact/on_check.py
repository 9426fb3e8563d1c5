"""The lines of `check` on contact: whether the spec's own wall may be any that pushes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec


def facts(spec: Spec, *_: object) -> dict[str, Any]:
    """contact: of a spec with [for_all] contact, what is known of its own wall, see `verdict`."""
    if not spec.contact:
        return {}
    from wavesweep.contact.verdict import verdict

    return {"contact": verdict(spec)}


def lines(spec: Spec, found: Mapping[str, Any]) -> Iterator[tuple[float, str]]:  # noqa: ARG001
    """Yield what is proved."""
    contact = found.get("contact")
    if not contact:
        return
    said = {
        "proved": "proved to come to rest",
        "unknown": "not known whether every motion comes to rest",
        "refuted": f"not every motion comes to rest: {contact['counterexample']}",
    }
    wall = "with any wall that pushes and never pulls, up to the spec's own stiffness and damping"
    yield 1, f"{wall}: {said[contact['verdict']]}"


def refuse(spec: Spec) -> None:
    """Raise UsageError if the spec has no wall that the proof could be about."""
    if spec.contact:
        from wavesweep.contact.rows import refuse as refuse_wall

        refuse_wall(spec, spec.wall[0] if spec.wall else "")
