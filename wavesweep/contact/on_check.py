"""What `check` finds of contact: whether the spec's own wall may be any that pushes, and its
saturations any curve."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from wavesweep.program.analyses.claims import (
    AT_REST,
    PUSHES,
    Claim,
    Scope,
    Status,
    curve_of,
    own_scope,
)
from wavesweep.program.tables.refuters import in_a_sentence

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec


def facts(spec: Spec, *_: object) -> dict[str, Any]:
    """contact: of a spec with [for_all] contact that has a wall, what is known of it, see
    `verdict.of_wall`; saturations: the same of each block of type saturation, by its name; claims:
    the same, of a wall for all frames and
    values of [for_all], of blocks for the spec's own.
    """
    if not spec.contact:
        return {}
    from wavesweep.contact.rows import rules_of, scope_of
    from wavesweep.contact.verdict import of_saturation, of_wall, saturations

    found: dict[str, Any] = {}
    claims = []
    own = own_scope(spec)
    if spec.wall:
        rules = rules_of(spec)
        found["contact"] = of_wall(spec, rules)
        scope = replace(scope_of(spec, rules), walls=PUSHES)
        claims.append(_claim(scope, found["contact"]))
    blocks = {name: of_saturation(spec, name) for name in saturations(spec.drawing)}
    if blocks:
        found["saturations"] = blocks
        claims += [_claim(replace(own, walls=curve_of(name)), blocks[name]) for name in blocks]
    return found | {"claims": claims}


def _claim(scope: Scope, verdict: Mapping[str, str]) -> Claim:
    status = Status[verdict["verdict"].upper()]
    reason = in_a_sentence(verdict["counterexample"])
    return Claim(AT_REST, scope, status, reason)


def refuse(spec: Spec) -> None:
    """Raise UsageError if the spec has nothing that the proof could be about."""
    if spec.contact:
        from wavesweep.contact.verdict import refuse as refuse_without

        refuse_without(spec)
