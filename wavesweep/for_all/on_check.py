"""The lines of `check` on what holds for all of [for_all]."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec


def facts(spec: Spec, *_: object) -> dict[str, Any]:
    """for_all: of a spec with [for_all], whether it is stable for all of it, see `rows.verdict`;
    at_random: the same of frames at random, if it has their shares; rms: what white noise comes out
    with where anything is at random, see `noise.table`; every_hand: what hands need then, see
    `every_hand.damping`; claims: the same.
    """
    if not spec.for_all:
        return {}
    from wavesweep.for_all import noise
    from wavesweep.for_all.at_cut import refused
    from wavesweep.for_all.every_hand import damping
    from wavesweep.for_all.rows import claim
    from wavesweep.for_all.varying import Rules

    rules = Rules.of(spec)
    if spec.require and not rules.vary and not refused(spec.require, rules, at_random=False):
        rules = replace(rules, require=spec.require)
    stability, verdict = claim(spec, rules)
    claims = [stability]
    answers: dict[str, Any] = {"for_all": verdict}
    if random := rules.on_average():
        stability, verdict = claim(spec, random)
        claims.append(stability)
        answers["at_random"] = verdict
    if rules.at_random or random:
        decays = verdict["verdict"]
        answers["rms"] = noise.table(spec, random or rules) if decays == "proved" else []
        claims += noise.claims(spec, random or rules, decays)
    return answers | {"every_hand": damping(spec), "claims": claims}


def lines(spec: Spec, facts: Mapping[str, Any]) -> Iterator[tuple[float, str]]:
    """Yield what is proved beside the answer to [for_all] itself."""
    if not facts.get("for_all"):
        return
    apart = spec.for_all.apart(spec.values) if spec.for_all else []
    if apart:
        yield 1, f"[for_all] leaves the spec's own {' and '.join(apart)} out"
    for row in facts.get("rms", ()):
        yield 2.5, _noise(spec, row)
    if damping := facts.get("every_hand"):
        refuted = facts.get("for_all", {}).get("verdict") == "refuted"
        if not refuted or damping.get("doubt") == "contradiction":
            yield 1.5, _every_hand(spec, damping)
        elif damping["needed"] is not None:  # nobody at the device is a passive hand as well
            yield 1.5, f"with every passive hand: {_enough(damping)}"


def _noise(spec: Spec, row: Mapping[str, Any]) -> str:
    """What white noise comes out with, at random and with all in time."""
    ports = (*spec.drawing.inputs, *spec.drawing.outputs)
    units = {name: unit and f" {unit}" for name, _, unit in ports}
    unit = units[row["to"]]
    at_random = "not known" if row["rms"] is None else f"{row['rms']:.6g}{unit}"
    in_time = "" if row["in_time"] is None else f", {row['in_time']:.6g}{unit} with all in time"
    said = f"white noise of 1{units[row['from']]} in {row['from']}"
    return f"{said}: rms of {row['to']} {at_random}{in_time}"


def _enough(damping: Mapping[str, Any]) -> str:
    """The damping of the device that is enough, and what it has."""
    from wavesweep.program.number_words import rounded_up

    enough = "no damping is proved to suffice"
    if damping["needed"] is not None:
        enough = f"{rounded_up(damping['needed'], 4)} N*s/m of damping suffice"
    return f"{enough}, the device has {damping['device']:g}"


def _every_hand(spec: Spec, damping: Mapping[str, Any]) -> str:
    """What is known with every passive hand, and what hands need of the device's damping."""
    from wavesweep.for_all.every_hand import EveryHandGuarantee
    from wavesweep.for_all.rows import CONTRADICTED
    from wavesweep.for_all.varying import Rules
    from wavesweep.program.analyses.claim_words import in_words
    from wavesweep.program.analyses.claims import STABLE, Claim, Status

    needed = damping["needed"]
    device = damping["device"]
    status = Status.UNKNOWN
    reason = ""
    if damping.get("doubt"):
        reason = CONTRADICTED
    elif needed is not None and needed <= device:
        status = Status.PROVED
    elif damping["refuted"] is not None and damping["refuted"] > device:
        status = Status.REFUTED
        reason = damping["by"]
    claim = Claim(STABLE, EveryHandGuarantee(Rules.of(spec)).scope(spec), status, reason)
    if damping.get("doubt"):
        return in_words(claim)
    return f"{in_words(claim)}; {_enough(damping)}"
