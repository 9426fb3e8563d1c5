"""A design study: the table `design`, whose columns are those that its spec varies and wishes."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from wavesweep.designs.columns import DESIGN
from wavesweep.designs.wish_keys import WISHES, Wish, word_of
from wavesweep.program.columns import Columns
from wavesweep.program.number_words import rounded_down, rounded_up
from wavesweep.program.spec import Spec
from wavesweep.program.tables.columns import fields
from wavesweep.program.tables.fields import Field
from wavesweep.program.tables.kind import Line, Numbers, count, plain, whole_kind

THIN = 0.01  # of a bound or a range, within which a design is near it, or near an end


def fields_of_design(spec: Spec, columns: Columns) -> tuple[Field, ...]:
    """The columns of a study: numbers that are varied, wishes, and certificates."""
    design_fields: list[Field] = []
    if spec.design:
        names = [axis.name for axis in spec.design.vary]
        by_name = {
            field.name: field for field in fields("zwidth", names, facts={"spec": spec.tables()})
        }
        design_fields += [by_name[name] for name in names]
        units = wish_units(spec)
        for wish in spec.design.wishes:
            at_worst = f"{wish.kind.description}, at its worst"
            design_fields.append(Field(wish.name, "number", units[wish.name], at_worst))
            design_fields.append(
                Field(f"{wish.name}_scenario", "string", "", f"what sets the worst {wish.name}")
            )
    design_fields += DESIGN
    return tuple(field for field in design_fields if field.name in columns)


def wish_units(spec: Spec) -> dict[str, str]:
    """Return the unit of each wish: z_width has that of the wall's own number, others those at
    the hand."""
    if not spec.design:
        return {}
    units = dict.fromkeys(("z_width", "felt"), spec.at_port("N/m"))
    units["port"] = spec.at_port("m/N")
    if spec.wall:
        units["z_width"] = spec.names.keys[spec.wall[0]].unit or units["z_width"]
    named = {axis.name: spec.names.keys[axis.path].unit for axis in spec.design.vary}
    units_of = {}
    for wish in spec.design.wishes:
        unit_of_wish = named.get(wish.options.get("number"), wish.kind.unit)
        units_of[wish.name] = units.get(wish.word, unit_of_wish)
    return units_of


def _numbers(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    """The best of each wish, the spec's own design, and what was searched."""
    wishes = [wish_of(name, facts) for name in facts["spec"]["design"]["wish"]]
    vary = facts["spec"]["design"]["vary"]
    values, varied_of = _best(columns, wishes, vary)
    near = {}  # to its bound
    free = []
    for wish in wishes:
        if wish.bound is None:
            free.append(wish.name)
        else:
            margins = wish.margin(columns[wish.name])
            near[wish.name] = int((np.abs(margins) < THIN).sum())
    runners_up = []
    for runner_up in facts.get("runners_up", ()):
        runners_up.append({**runner_up, "margins": margins_of(runner_up["wishes"], facts)})
    return {
        "designs": len(columns["certified"]),
        "certified": int(columns["certified"].sum()),
        "bounds_hold_between": int(columns["holds"].sum()),
        "searched": facts["slices"]["computed"],
        "scenarios": facts["scenarios"],
        **{name: facts[name] for name in ("proved", "ranked") if name in facts},
        "best": values,
        "numbers": varied_of,
        "own": dict(facts["own"]),
        "own_unstable": bool(facts.get("own_unstable")),
        "units": dict(facts["units"]),
        "files": list(facts.get("best", ())),
        "walls_to": facts["stop"],
        "at_end": list(facts.get("at_end", ())),
        "wall": facts["spec"].get("ports", {}).get("wall", {}).get("stiffness", "K_VE"),
        "ends": {name: _ends(numbers, vary) for name, numbers in varied_of.items()},
        "margins": {name: margins_of(value, facts) for name, value in values.items()},
        "near": near,
        "free": free,
        "runners_up": runners_up,
    }


def _best(
    columns: Columns, wishes: Sequence[Wish], varied: Iterable[str]
) -> tuple[dict[str, dict], dict[str, dict]]:
    """For each wish the values of all wishes, and the varied numbers, of the design that is the
    best in it."""
    values = {}
    numbers = {}
    for best_in in wishes:
        column = columns[best_in.name]
        size = column if best_in.kind.more else -column
        row = int(np.argmax(np.where(np.isnan(size), -np.inf, size)))
        values[best_in.name] = {wish.name: plain(columns[wish.name][row]) for wish in wishes}
        numbers[best_in.name] = {axis: columns[axis][row].item() for axis in varied}
    return values, numbers


def _ends(numbers: Mapping[str, float], vary: Mapping[str, Any]) -> list[str]:
    """The numbers of a design that lie near an end of their ranges."""

    near = []
    for name, axis in vary.items():
        if not isinstance(axis, Mapping):
            continue
        places = np.array([axis["start"], numbers[name], axis["stop"]], float)
        if axis.get("scale") == "log":
            places = np.log(places)
        low, value, high = places.tolist()
        if min(value - low, high - value) <= THIN * (high - low):
            near.append(name)
    return near


def wish_of(name: str, facts: Mapping[str, Any]) -> Wish:
    """Return a wish of a study with its bound."""
    bound = facts["spec"]["design"]["wish"][name].get(WISHES[word_of(name)].bound)
    return Wish(name, bound, {})


def margins_of(values: Mapping[str, float | None], facts: Mapping[str, Any]) -> dict[str, float]:
    """Return the margins of a design's wishes to their bounds, as shares of these; values: of
    the wishes."""
    margins = {}
    for name, value in values.items():
        wish = wish_of(name, facts)
        if wish.bound is not None and value is not None:
            margins[name] = float(wish.margin(value))
    return margins


def _lines(facts: Numbers) -> Iterator[Line]:
    """Yield a line for the front, one for each design that is the best in a wish, and one for
    the spec's own design."""
    searched = count(facts["searched"], "design")
    combinations = count(facts["scenarios"], "combination")
    evaluated = f"{searched} evaluated, each at its worst over {combinations}"
    tried = f"{searched} tried"
    if "proved" in facts:
        over = " and some short patterns of frames" if facts.get("ranked") else ""
        evaluated += f"{over}; {facts['proved']} of them were then tried for all of [for_all]"
        tried = f"these {facts['proved']}"
    yield evaluated, False
    if facts["designs"] > 1:
        yield f"{count(facts['designs'], 'design')} on the front", False
    for names in _alike(facts["numbers"]):
        name = names[0]
        best = "best" if facts["designs"] == 1 else f"best {' and '.join(names)}"
        described = _design(facts["best"][name], facts["numbers"][name], facts["units"])
        yield f"{best} of {tried}: {described}", False
        ends = facts["ends"][name]
        if ends:
            where = "near an end of the range in [design.vary]"
            hint = "a longer one may have better designs"
            yield f"  {_several(ends, 'lie')} {where}; {hint}", False
    yield from _bound_lines(facts)
    for runner_up in facts["runners_up"]:
        described = _design(runner_up["wishes"], runner_up["numbers"], facts["units"])
        if runner_up["margins"]:
            described += f"; margins: {_shares(runner_up['margins'])}"
        yield f"next best: {described}", False
    if facts["designs"] == 1 and not facts["runners_up"]:
        yield "next best: none was found whose numbers differ by a tenth of their ranges", False
    nominal = _wishes(facts["own"], facts["units"])
    if facts["own_unstable"] and not any(value is not None for value in facts["own"].values()):
        nominal = "unstable"
    elif facts["own_unstable"]:  # wishes may be about other walls than its own
        nominal += "; unstable with its own numbers"
    yield f"the spec's own design: {nominal}", False
    yield from _notes(facts)


def _notes(facts: Numbers) -> Iterator[Line]:
    """Yield where walls end with their range, the files, and what is proved, not certified or
    does not hold."""
    if facts["at_end"]:
        where = f"where the range of {facts['wall']} ends, at {facts['walls_to']:g}"
        yield (
            f"{_several(facts['at_end'], 'end')} {where}; a longer one in [sweep] may show more",
            False,
        )
    files = facts["files"]
    if files:
        number = f"{len(files)} of them " if 1 < len(files) < facts["designs"] else ""
        named = files[0] if len(files) == 1 else f"{files[0]} ... {files[-1]}"
        yield f"{number}as specs: {named}", False
    if facts["certified"] < facts["designs"]:
        yield (
            f"{facts['designs'] - facts['certified']} of {count(facts['designs'], 'row')} not certified",
            True,
        )
    if facts["bounds_hold_between"] < facts["designs"]:
        missed = facts["designs"] - facts["bounds_hold_between"]
        yield (
            f"{count(missed, 'design')} with a bound that is missed between the ends of the ranges (column holds)",
            True,
        )


def _several(names: Sequence[str], verb: str) -> str:
    """Names and what they do: "b lies", "b and K_LM lie"."""
    return f"{' and '.join(names)} {verb}{'s' if len(names) == 1 else ''}"


def _alike(numbers: Mapping[str, Any]) -> list[list[str]]:
    """The wishes, those of the same design together."""
    groups: list[list[str]] = []
    for name in numbers:
        for group in groups:
            if numbers[group[0]] == numbers[name]:
                group.append(name)
                break
        else:
            groups.append([name])
    return groups


def _bound_lines(facts: Numbers) -> Iterator[Line]:
    """Yield how near designs are to their bounds, and which wish decides."""
    if facts["designs"] > 1:
        for name, number in facts["near"].items():
            if number:
                yield (
                    f"{name} is within {100 * THIN:g} % of its bound in {number} of {facts['designs']} designs",
                    False,
                )
    elif facts["designs"] == 1 and facts["best"]:
        margins = next(iter(facts["margins"].values()))
        if facts["free"]:
            decides = _several(facts["free"], "decide")
            tight = [name for name, share in margins.items() if share < THIN]
            if tight:
                decides += f", held back by the bound of {' and '.join(tight)}"
        else:
            least = min(margins.values(), default=0.0)
            tight = [name for name, share in margins.items() if share < least + THIN]
            decides = f"{_several(tight, 'decide')}: no design found has a larger smallest margin"
        yield (
            (f"margins to the bounds: {_shares(margins)}; {decides}" if margins else decides),
            False,
        )


def _shares(margins: Mapping[str, float]) -> str:
    per_cent = {name: float(rounded_down(100 * share, 3)) for name, share in margins.items()}
    return ", ".join(f"{name} {share:g} %" for name, share in per_cent.items())


def _design(
    wishes: Mapping[str, float | None], numbers: Mapping[str, Any], units: Mapping[str, str]
) -> str:
    said = ", ".join(f"{axis} = {value:.5g}" for axis, value in numbers.items())
    return f"{_wishes(wishes, units)}, with {said}"


def wish_in_words(name: str, value: float, unit: str, digits: int = 5) -> str:
    """The value of a wish, rounded to the side that is worse."""
    worse = rounded_down if WISHES[word_of(name)].more else rounded_up
    return f"{worse(value, digits)} {unit}".removesuffix(" 1").rstrip()


def _wishes(values: Mapping[str, float | None], units: Mapping[str, str]) -> str:
    said = []
    for name, value in values.items():
        if value is None:
            said.append(f"{name} unstable, or not known")
        else:
            said.append(f"{name} {wish_in_words(name, value, units[name])}")
    return ", ".join(said)


KINDS = (whole_kind("design", _numbers, _lines, "wavesweep.designs.figure.design"),)
