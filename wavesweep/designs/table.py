"""A design study: the table `design`, whose columns are those that its spec varies and wishes."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from wavesweep.designs.columns import DESIGN
from wavesweep.designs.wish_keys import WISHES, Wish
from wavesweep.program.columns import Columns
from wavesweep.program.spec import Spec
from wavesweep.program.tables.columns import fields
from wavesweep.program.tables.fields import Field
from wavesweep.program.tables.kind import Line, Numbers, count, plain, whole_kind

THIN = 0.01  # of a bound or a range, within which a design is near it, or near an end
BOX, SETTLED = "z_width_box", "box_settled"


def fields_of_design(spec: Spec, columns: Columns) -> tuple[Field, ...]:
    """The columns of a study: numbers that are varied, wishes, and certificates."""
    varied, wishes = (spec.design.vary, spec.design.wishes) if spec.design else ((), ())
    axes = {field.name: field for field in fields("zwidth", [axis.name for axis in varied], facts={"spec": spec.tables()})}
    axis_fields, units = [axes[axis.name] for axis in varied], wish_units(spec)
    for wish in wishes:
        axis_fields.append(Field(wish.name, "number", units[wish.name], f"{wish.kind.description}, at its worst"))
        axis_fields.append(Field(f"{wish.name}_scenario", "string", "", f"what sets the worst {wish.name}"))
    return tuple(field for field in (*axis_fields, *DESIGN) if field.name in columns)


def wish_units(spec: Spec) -> dict[str, str]:
    """Return the unit of each wish: those of a drawn loop are those of its wall's numbers and of its port."""
    units = dict.fromkeys(("z_width", "felt", "free_motion"), spec.units_felt[0]) | {"port": spec.at_port("m/N")}
    return {wish.name: units.get(wish.name, wish.kind.unit) for wish in (spec.design.wishes if spec.design else ())}


def _numbers(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    """The best of each wish, the spec's own design, and what was searched."""
    wishes, varied = facts["spec"]["design"]["wish"], facts["spec"]["design"]["vary"]
    values, varied_of = _best(columns, wishes, varied)
    bounded = [wish for name in wishes if (wish := wish_of(name, facts)).bound is not None]
    tally = {
        "designs": len(columns["certified"]),
        "certified": int(columns["certified"].sum()),
        "bounds_hold_between": int(columns["holds"].sum()),
        "searched": facts["slices"]["computed"],
        "scenarios": facts["scenarios"],
        **{name: facts[name] for name in ("proved", "ranked") if name in facts},
        "best": values,
        "numbers": varied_of,
        "own": dict(facts["own"]),
        "units": dict(facts["units"]),
        "files": list(facts.get("best", ())),
        "walls_to": facts["stop"],
        "at_end": list(facts.get("at_end", ())),
        "wall": facts["spec"].get("ports", {}).get("wall", {}).get("stiffness", "K_VE"),
        "ends": {name: _ends(numbers, facts["spec"]["design"]["vary"]) for name, numbers in varied_of.items()},
        "margins": {name: margins_of(value, facts) for name, value in values.items()},
        "near": {wish.name: int((np.abs(wish.margin(columns[wish.name])) < THIN).sum()) for wish in bounded},
        "free": [name for name in wishes if name not in {wish.name for wish in bounded}],
        "runners_up": [
            runner_up | {"margins": margins_of(runner_up["wishes"], facts)} for runner_up in facts.get("runners_up", ())
        ],
    }
    if BOX in columns:  # how many designs keep all their walls with every hand of a box, how many of these are proved
        wall, finite = columns["z_width"], columns[BOX] >= columns["z_width"]
        share = np.divide(columns[BOX], wall, out=np.ones(len(wall)), where=wall > 0)
        proved = int((finite & columns[SETTLED]).sum())
        tally["box"] = {"kept": int(finite.sum()), "settled": proved, "least": float(share.min())}
    return tally


def _best(columns: Columns, wishes: Iterable[str], varied: Iterable[str]) -> tuple[dict[str, dict], dict[str, dict]]:
    """For each wish the values of all wishes, and the varied numbers, of the design that is the best in it."""
    values, numbers = {}, {}
    for name in wishes:
        size = columns[name] if WISHES[name].more else -columns[name]
        row = int(np.argmax(np.where(np.isnan(size), -np.inf, size)))
        values[name] = {wish: plain(columns[wish][row]) for wish in wishes}
        numbers[name] = {axis: columns[axis][row].item() for axis in varied}
    return values, numbers


def _ends(numbers: Mapping[str, float], vary: Mapping[str, Any]) -> list[str]:
    """The numbers of a design that lie near an end of their ranges."""

    def place(value: float, scale: str) -> float:
        return float(np.log(value)) if scale == "log" else value

    near = []
    for name, axis in vary.items():
        if isinstance(axis, Mapping):
            low, value, high = (place(number, axis.get("scale", "")) for number in (axis["start"], numbers[name], axis["stop"]))
            near += [name] * (min(value - low, high - value) <= THIN * (high - low))
    return near


def wish_of(name: str, facts: Mapping[str, Any]) -> Wish:
    """Return a wish of a study with its bound."""
    return Wish(name, facts["spec"]["design"]["wish"][name].get(WISHES[name].bound), {})


def margins_of(values: Mapping[str, float | None], facts: Mapping[str, Any]) -> dict[str, float]:
    """Return the margins of a design's wishes to their bounds, as shares of these; values: of the wishes."""
    bounded = (wish for name in values if (wish := wish_of(name, facts)).bound is not None)
    return {wish.name: float(wish.margin(values[wish.name])) for wish in bounded if values[wish.name] is not None}


def _lines(found: Numbers) -> Iterator[Line]:
    """Yield a line for the front, one for each design that is the best in a wish, and one for the spec's own design."""
    over, tried = count(found["scenarios"], "combination"), count(found["searched"], "design")
    by = "by what short patterns of frames refute" if found.get("ranked") else "without [for_all]"
    ranked = f", {by}; {found['proved']} of them then for all of [for_all]" if "proved" in found else ""
    yield f"{tried} evaluated, each at its worst over {over}{ranked}", False
    tried = f"these {found['proved']}" if ranked else f"{tried} tried"
    if found["designs"] > 1:
        yield f"{count(found['designs'], 'design')} on the front", False
    for names in _alike(found["numbers"]):
        first = "best" if found["designs"] == 1 else f"best {' and '.join(names)}"
        yield f"{first} of {tried}: {_design(found['best'][names[0]], found['numbers'][names[0]], found['units'])}", False
        if ends := found["ends"][names[0]]:
            where, advice = "near an end of the range in [design.vary]", "a longer one may have better designs"
            yield f"  {' and '.join(ends)} lie{'s' * (len(ends) == 1)} {where}; {advice}", False
    yield from _bound_lines(found)
    for runner_up in found["runners_up"]:
        margins = f"; margins: {_shares(runner_up['margins'])}" if runner_up["margins"] else ""
        yield f"next best: {_design(runner_up['wishes'], runner_up['numbers'], found['units'])}{margins}", False
    if found["designs"] == 1 and not found["runners_up"]:
        yield "next best: none was found whose numbers differ by a tenth of their ranges", False
    yield f"the spec's own design: {_wishes(found['own'], found['units'])}", False
    yield from _notes(found)


def _notes(found: Numbers) -> Iterator[Line]:
    """Yield where walls end with their range, the files, and what is proved, not certified or does not hold."""
    if found["at_end"]:
        names, wall = " and ".join(found["at_end"]), found["wall"]
        where = f"where the range of {wall} ends, at {found['walls_to']:g}"
        yield f"{names} end{'s' * (len(found['at_end']) == 1)} {where}; a longer one in [sweep] may show more", False
    if found["files"]:
        number = f"{len(found['files'])} of them " if 1 < len(found["files"]) < found["designs"] else ""
        named = " ... ".join(dict.fromkeys([found["files"][0], found["files"][-1]]))
        yield f"{number}as specs: {named}", False
    if "box" in found:
        boxed, of = found["box"], count(found["designs"], "design")
        worst = f"; the worst keeps {100 * boxed['least']:.3g} %" if boxed["kept"] < found["designs"] else ""
        yield f"every hand of the box: {boxed['kept']} of {of} keep all walls, {boxed['settled']} of them proved{worst}", False
    if found["certified"] < found["designs"]:
        yield f"{found['designs'] - found['certified']} of {count(found['designs'], 'row')} not certified", True
    if found["bounds_hold_between"] < found["designs"]:
        missed = found["designs"] - found["bounds_hold_between"]
        yield f"{count(missed, 'design')} with a bound that does not hold between the ends of the ranges (column holds)", True


def _alike(numbers: Mapping[str, Any]) -> list[list[str]]:
    """The wishes, those of the same design together."""
    groups: list[list[str]] = []
    for name in numbers:
        same = next((names for names in groups if numbers[names[0]] == numbers[name]), None)
        groups.append([name]) if same is None else same.append(name)
    return groups


def _bound_lines(found: Numbers) -> Iterator[Line]:
    """Yield how near designs are to their bounds, and which wish decides."""
    if found["designs"] == 1 and found["best"]:
        margins = next(iter(found["margins"].values()))
        least = min(margins.values(), default=0.0)
        tight = [name for name, share in margins.items() if share < (THIN if found["free"] else least + THIN)]
        if not found["free"]:
            decides = f"{' and '.join(tight)} decide{'s' * (len(tight) == 1)}: no design found has a larger smallest margin"
        else:
            decides = f"{' and '.join(found['free'])} decide{'s' * (len(found['free']) == 1)}"
            decides += f", held back by the bound of {' and '.join(tight)}" if tight else ""
        yield (f"margins to the bounds: {_shares(margins)}; {decides}" if margins else decides), False
    for name, number in found["near"].items() if found["designs"] > 1 else ():
        if number:
            yield f"{name} is within {100 * THIN:g} % of its bound in {number} of {found['designs']} designs", False


def _shares(margins: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {100 * share:.3g} %" for name, share in margins.items())


def _design(wishes: Mapping[str, float | None], numbers: Mapping[str, Any], units: Mapping[str, str]) -> str:
    return f"{_wishes(wishes, units)}, with {', '.join(f'{axis} = {value:.5g}' for axis, value in numbers.items())}"


def _wishes(values: Mapping[str, float | None], units: Mapping[str, str]) -> str:
    said = {name: "unstable, or not known" if value is None else f"{value:.5g} {units[name]}" for name, value in values.items()}
    return ", ".join(f"{name} {text.removesuffix(' 1')}" for name, text in said.items())


KINDS = (whole_kind("design", _numbers, _lines, "wavesweep.designs.figure.design"),)
