"""Names, units and sentences as a paper prints them."""

import re
from collections.abc import Iterable, Mapping
from typing import Any

from wavesweep.program.analyses.claim_words import form_of, scope_in_words
from wavesweep.program.analyses.claims import NOBODY, of_rows
from wavesweep.program.columns import RATIO
from wavesweep.program.reading.keys import readable
from wavesweep.program.results import fields
from wavesweep.program.row_kinds import row_kinds
from wavesweep.program.tables.columns import at_port, unlike_units

LONGEST_LEGEND_NAME = 48  # letters of a spec in a legend
_POWER = r"\^(?:\(([-+./·a-zA-Z0-9]*)\)|(-?\d+))"  # of a unit: ^-1, ^(1/2)
_SYMBOLS = {
    "K_VE": r"$K_\mathrm{VE}$",
    "B_VE": r"$B_\mathrm{VE}$",
    "K_LM": r"$K_\mathrm{LM}$",
    "B_LM": r"$B_\mathrm{LM}$",
    "Kp": r"$K_p$",
    "K_VC": r"$K_\mathrm{VC}$",
    "B_VC": r"$B_\mathrm{VC}$",
    "b": r"$b$",
    "rates.fast_hz": "fast rate",
    "rates.slow_hz": "slow rate",
    "rates.tick_hz": "rate of the ticks",
    "rates.ratio": "ratio of the rates",
    "environment.delay": "delay",
    "device.delay": "delay of the amplifier",
    "device.dead_time": "dead time of the amplifier",
    "local_model.delay": "delay of the local model",
}
# words of summaries, and of captions in their place; a sign and its number stay in one line
_SHORTER = {
    " (as physics does; a program holds its sums)": "",
    ' (step = "elapsed")': "",
    "velocity from differences of position": "velocity by differences",
    " of at most ": " ≤\u00a0",
    " of at least ": " ≥\u00a0",
    ", up and down,": "",
}
for _filter in ("lp1", "hp", "lp2"):
    for _edge in ("cutoff", "passband", "stopband"):
        _SYMBOLS[f"filters.{_filter}.{_edge}_hz"] = f"{_filter.upper()} {_edge}"
    _SYMBOLS[f"filters.{_filter}.order"] = f"{_filter.upper()} order"


def symbol(name: str) -> str:
    """The name of an axis as a paper prints it; a number of a drawn loop as its spec has it, but
    for gains such as Ki."""
    if name in _SYMBOLS:
        return _SYMBOLS[name]
    if re.fullmatch("[A-Z][a-z]", name):
        return f"${name[0]}_{name[1]}$"
    if "." in name:
        return name.replace(".", " ").replace("_", " ")
    return name


def unit(name: str, facts: Mapping[str, Any] | None = None) -> str:
    """The unit of an axis as a paper prints it, empty if it has none; facts: see `label`."""
    units = {field.name: field.unit for field in fields("zwidth", [name], facts=facts)}
    return printed([units[name]])


def label(name: str, facts: Mapping[str, Any] | None = None) -> str:
    """The name of an axis with its unit. facts: of a run, which describe the numbers of a drawn
    loop."""
    return with_unit(symbol(name), printed(unlike_units(facts).get(name, ())) or unit(name, facts))


def valued(name: str, value: float, facts: Mapping[str, Any] | None = None) -> str:
    """The name of an axis with a value and its unit; facts: see `label`."""
    digits, _, power = f"{value:.6g}".partition("e")
    said = f"{digits}·10$^{{{int(power)}}}$" if power else digits
    printed_unit = unit(name, facts)
    if printed_unit == "tick" and value != 1:
        printed_unit = "ticks"
    return f"{symbol(name)} = {said} {printed_unit}".rstrip()


def at_hand(text: str, column: str, unit: str, facts: Mapping[str, Any] | None) -> str:
    """The name of a quantity at the hand with its unit.

    unit: of a hand that slides, which "m" before it makes a thousandth.
    """
    thousandth = "m" if unit in ("mm", "mm/N") else ""
    units = unlike_units(facts).get(column) or [at_port(unit.removeprefix(thousandth), facts)]
    between = "\n" if len(units) > 1 else " "
    return f"{text}{between}({printed(thousandth + each for each in units)})"


def with_unit(text: str, printed_unit: str) -> str:
    """The text with a printed unit behind it, if there is one."""
    if printed_unit:
        return f"{text} ({printed_unit})"
    return text


def printed(units: Iterable[str]) -> str:
    """Units as a paper prints them, those of several specs with "or" between them; nothing for a
    number without a unit."""
    texts = []
    for each in units:
        if each in ("1", RATIO):
            texts.append("")
        else:
            text = as_it_stands(readable(each)).replace("*", "·")
            texts.append(re.sub(_POWER, r"$^{\1\2}$", text))
    if len(texts) == 1:
        return texts[0]
    return " or ".join(text or "no unit" for text in texts)


def as_it_stands(text: str) -> str:
    """A text of a user, such as the name of a spec, without a meaning for the program that sets
    it."""
    return text.replace("$", r"\$")


def shortened(name: str) -> str:
    """The name of a spec as a legend has it, without the middle of a long one."""
    half = LONGEST_LEGEND_NAME // 2
    if len(name) > LONGEST_LEGEND_NAME:
        name = f"{name[:half]}...{name[3 - half :]}"
    return as_it_stands(name)


def assumption(facts: Mapping[str, Any]) -> str:
    """The sentence on wall, delay and velocity that a run is for, and on its loops where they are
    not the spec's own; empty if there is none."""
    said = assumed(facts)
    return " ".join(filter(None, (f"Assumes: {said}." if said else "", claimed(facts))))


def claimed(facts: Mapping[str, Any]) -> str:
    """What the rows of each kind say of which loops, where these are not the spec's own alone and
    the legend does not say it by the name of the kind."""
    claims = facts.get("claims", {})
    sentences = []
    for word in claims:
        claim = of_rows(facts, word)
        spec, _, word_of_rows = word.partition("/") if "specs" in facts else ("", "", word)
        kind = row_kinds().get(word_of_rows)  # none of a wish, whose claim begins with its name
        name = kind.legend if len(claims) > 1 and kind else ""
        said = f"{form_of(claim.what).holds} {scope_in_words(claim.scope)}".rstrip()
        in_legend = name and (claim.scope.hands == NOBODY or said.endswith(name))
        if (scope_in_words(claim.scope) or claim.what.required) and not in_legend:
            sentences.append(": ".join(filter(None, (as_it_stands(spec), name, said))))
    said = "; ".join(sentences)
    if said and "specs" not in facts:  # whose names begin sentences as they are
        said = said[0].upper() + said[1:]
    return _in_caption(f"{said}." if said else "")


def assumed(facts: Mapping[str, Any]) -> str:
    """What a run assumes of wall, delay and velocity, with the names of specs; empty if it
    assumes nothing."""
    return _in_caption(". ".join(str(facts.get("assumes") or "").splitlines()))


def _in_caption(text: str) -> str:
    """A sentence of a summary as a caption has it."""
    for long, short in _SHORTER.items():
        text = text.replace(long, short)
    return as_it_stands(text)
