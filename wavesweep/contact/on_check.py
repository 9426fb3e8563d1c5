"""The lines of `check` on contact: whether the spec's own wall may be any that pushes, and its saturations any curve."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec

_SAID = {
    "proved": "proved to come to rest",
    "unknown": "not known whether every motion comes to rest",
    "refuted": "not every motion comes to rest: {}",
}
_WALL = "with any wall that pushes and never pulls, up to the spec's own stiffness and damping"
_BLOCK = "with {} at its limits, or any curve of slopes from 0 to 1"


def facts(spec: Spec, *_: object) -> dict[str, Any]:
    """contact: of a spec with [for_all] contact that has a wall, what is known of it, see `verdict.of_wall`; saturations: the
    same of each block of type saturation, by its name.
    """
    if not spec.contact:
        return {}
    from wavesweep.contact.verdict import of_saturation, of_wall, saturations

    found: dict[str, Any] = {"contact": of_wall(spec)} if spec.wall else {}
    blocks = {name: of_saturation(spec, name) for name in saturations(spec.drawing)}
    return found | ({"saturations": blocks} if blocks else {})


def lines(spec: Spec, found: Mapping[str, Any]) -> Iterator[tuple[float, str]]:  # noqa: ARG001
    """Yield what is proved."""
    verdicts = {_WALL: found["contact"]} if found.get("contact") else {}
    verdicts |= {_BLOCK.format(name): each for name, each in found.get("saturations", {}).items()}
    for what, verdict in verdicts.items():
        yield 1, f"{what}: {_SAID[verdict['verdict']].format(verdict['counterexample'])}"


def refuse(spec: Spec) -> None:
    """Raise UsageError if the spec has nothing that the proof could be about."""
    if spec.contact:
        from wavesweep.contact.verdict import refuse as refuse_without

        refuse_without(spec)
