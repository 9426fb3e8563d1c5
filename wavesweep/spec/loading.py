"""Loading: from a path or nested tables, and overrides, to a `Spec`."""

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from itertools import islice

from wavesweep.errors import Mistake, SpecError, UsageError
from wavesweep.spec.axes import Axis
from wavesweep.spec.checking import Rejected, check, show
from wavesweep.spec.classes import expanded, numbers_of_blocks
from wavesweep.spec.drawing import MARKS, RATE, is_derived, names_of, path_of
from wavesweep.spec.drawing_tables import as_meant, read_drawing
from wavesweep.spec.keys import KEYS, SYMBOLS
from wavesweep.spec.reading import Leaf, Place, file_stem, read_dict, read_file, read_override
from wavesweep.spec.resolving import Given, resolve
from wavesweep.spec.sorting import Path, leaves_of, normal_path, sort_leaves
from wavesweep.spec.spec import K_VE_SPAN, Spec
from wavesweep.spec.studies import (
    DEFAULT_FREQUENCIES,
    Studies,
    beyond_half,
    beyond_limits,
    build_studies,
    unknown_ends,
    unmeasurable,
    usual_frequencies,
)

MOST_KEYS = 1000  # that a spec gives; each one that is wrong takes a millisecond
_TWINS = {("rates", "ratio"): ("rates", "slow_hz"), ("rates", "slow_hz"): ("rates", "ratio")}


def load(source: str | os.PathLike | Mapping, overrides: Iterable[str] = ()) -> Spec:
    """Return the spec of a TOML file, or of the same nested tables as a dict.

    source: a path or the tables. overrides: texts `key=value` as for `--set`, e.g. `controller.b=40`, `b=40`,
    `sweep.B_VE.num=20`. They replace values of the source before anything is checked; `rates.ratio` and `rates.slow_hz`
    displace each other.

    Errors: UsageError if a file cannot be read, and SpecError with all mistakes of source and overrides at once.
    """
    if isinstance(source, Mapping):
        try:
            name, path, tables, place = "spec", None, read_dict(source), Place()
        except RecursionError:
            raise UsageError("a spec: expected nested tables, found one that contains itself") from None
    else:
        try:
            path = os.fsdecode(os.fspath(source))
        except TypeError:
            raise UsageError(f"a spec: expected a path, or nested tables as a dict, found {source!r:.60}") from None
        tables, place = read_file(path)
        name = file_stem(path)
    leaves, mistakes = _collect(tables, place, overrides)
    return _build(name, path, leaves, place, mistakes)


def naming(spec: Spec, names: Iterable[object]) -> Spec:
    """Return the spec in which these keys of blocks (`block.m.mass`) are numbers too, as those are that [sweep] names.

    Other names, and keys that are not written as a number, are left to who looks for them.
    """
    of_blocks = (name for name in names if isinstance(name, str) and name.startswith("block.") and not spec.names.find(name))
    return _naming(spec, tuple(of_blocks)) if spec.drawing else spec


@lru_cache(maxsize=64)
def _naming(spec, names):
    tables = spec.tables()
    written = {f"block.{block}.{key}": value for block, keys in tables["block"].items() for key, value in keys.items()}
    new = {name: [written[name]] for name in names if isinstance(written.get(name), (int, float))}
    if not new:
        return spec
    try:
        named = load(tables | {"sweep": tables.get("sweep", {}) | new})
    except SpecError:  # a key that has a number and takes none that varies
        return spec
    return replace(named, name=spec.name, source=spec.source)


def _collect(tables: dict, place: Place, overrides: Iterable[str]) -> tuple[dict[Path, Leaf], list[Mistake]]:
    leaves: dict[Path, Leaf] = {}
    mistakes: list[Mistake] = []
    given = list(islice(leaves_of(tables, place), MOST_KEYS + 1))
    if len(given) > MOST_KEYS:
        return leaves, [given[-1][1].mistake("", f"at most {MOST_KEYS} keys", "more", of_key=True)]
    for path, leaf in given:
        if path in leaves:  # an axis written both as "device.mass" and as device.mass
            mistakes.append(leaf.mistake(".".join(path), "each key once", "the same key again", of_key=True))
        leaves[path] = leaf
    symbols = {name: path_of(name) for path in leaves if (name := path[1:] and path[1]) and path[0] == "numbers"}
    symbols |= numbers_of_blocks(leaves)
    for typed in overrides:
        try:
            path, value, where = read_override(typed, symbols if any(path[0] in MARKS for path in leaves) else SYMBOLS)
        except SpecError as error:
            mistakes += error.mistakes
        else:
            if (*path, "value") in leaves:  # a number that has a unit keeps it
                path = (*path, "value")
            path, known = normal_path(path), len(leaves)
            leaves = _override(leaves, path, {} if value == "" else dict(leaves_of(_nested(path, value), where)))
            if value == "" and len(leaves) == known:
                mistakes.append(
                    Mistake(where.location(), ".".join(path), "a value, or a key of the spec to leave out", "neither")
                )
    return leaves, mistakes


def _nested(path: Path, value: object) -> dict:
    for name in reversed(path):
        value = {name: value}
    return value


def _override(leaves: dict[Path, Leaf], replaced: Path, new: dict[Path, Leaf]) -> dict[Path, Leaf]:
    """Replace everything at, above or below one path by `new`, in the same position, so that the order of axes is kept."""
    result: dict[Path, Leaf] = {}
    for path, leaf in leaves.items():
        if _overlap(path, replaced):
            result.update(new)
        elif _TWINS.get(replaced) != path:
            result[path] = leaf
    return {**result, **new}


def _overlap(one: Path, other: Path) -> bool:
    length = min(len(one), len(other))
    return one[:length] == other[:length]


def _build(name: str, path: str | None, leaves: dict[Path, Leaf], place: Place, mistakes: list[Mistake]) -> Spec:
    tables = {each[0] for each in leaves}
    if tables & {*MARKS} or ("controller" not in tables and tuple(RATE.split(".")) in leaves):
        return _drawn(name, path, leaves, place, mistakes)
    belongs = sort_leaves(leaves)
    given = Given(belongs.loop, place)
    values, wrong = resolve(given)
    studies, wrong_studies = build_studies(belongs, given)
    mistakes = [*mistakes, *belongs.mistakes.values(), *wrong, *wrong_studies, *unknown_ends(belongs, None)]
    if not wrong:
        followers = _followers(studies, values)
        axes = (*studies.axes, ("design.for_all", followers))
        mistakes += [m for study, some in axes for m in beyond_limits(study, some, values)]
        mistakes += _out_of_range(followers)
    if not any(mistake.key.startswith("rates.") for mistake in wrong):
        mistakes += _beyond_rate(studies, values["rates.fast_hz"], "rates.fast_hz")
    if mistakes:
        raise SpecError(_in_order(mistakes))
    return Spec(name, path, values, studies, given)


def _followers(studies: Studies, values: Mapping) -> tuple[Axis, ...]:
    """Return the ranges of the numbers that ratios of [design.for_all] set."""
    if studies.design is None:
        return ()
    axis = next((axis for axis in studies.sweep if axis.path == "environment.K_VE"), None)
    return tuple(studies.design.followers(values, axis.stop if axis else K_VE_SPAN[1]))


def _out_of_range(axes: Iterable[Axis]) -> Iterator[Mistake]:
    for axis in axes:
        for end in (axis.start, axis.stop):
            try:
                check(KEYS[axis.path], float(end))
            except Rejected as error:
                leaf = Leaf(None, axis.place)
                yield leaf.mistake(f"design.for_all.{axis.name}", error.expected, f"{show(end)} of {axis.path}", of_key=True)
                break


def _drawn(name: str, path: str | None, leaves: dict[Path, Leaf], place: Place, mistakes: list[Mistake]) -> Spec:
    """Return the spec of a drawn loop; its axes are checked as far as its numbers are known."""
    leaves, unknown = as_meant(leaves)
    leaves, of_classes = expanded(leaves)
    drawing, values, of_loop, wrong = read_drawing(leaves, place)
    following = frozenset(path[1] for path, leaf in leaves.items() if path[0] == "numbers" and is_derived(path, leaf))
    names = replace(drawing.names if drawing else names_of(leaves), following=following)
    belongs = sort_leaves(leaves, names)
    given = Given(of_loop, place)
    stepped = drawing is not None and drawing.hand is None and drawing.inputs
    studies, wrong_studies = build_studies(belongs, given, names, "step" if stepped else "sine")
    mistakes = [*mistakes, *unknown, *of_classes, *wrong, *belongs.mistakes.values(), *wrong_studies]
    hz = drawing.rate(values) if drawing else values.get(RATE)
    mistakes += _beyond_rate(studies, hz, RATE) if hz else []
    if drawing:
        mistakes += [m for study, axes in studies.axes for m in drawing.vanishing(study, axes, values)]
        mistakes += studies.design.unsuited(drawing) if studies.design else []
        mistakes += [*unknown_ends(belongs, drawing), *unmeasurable(belongs, drawing)]
    if mistakes:
        raise SpecError(_in_order(mistakes))
    if stepped:
        studies = usual_frequencies(studies, hz)
    return Spec(name, path, values, _with_along(studies, belongs.along, drawing.wall), given, drawing=drawing)


def _beyond_rate(studies: Studies, hz: float, rate: str) -> Iterator[Mistake]:
    """Yield the mistakes of frequencies and times that do not fit the fast rate, `hz`; rate: its path.

    The defaults of a command that may never run are no mistakes.
    """
    if studies.frequencies is not DEFAULT_FREQUENCIES:
        yield from beyond_half(studies.frequencies, studies.bode, hz, rate)
    if studies.experiment.given:
        yield from studies.experiment.beyond_limits(hz, rate)
    if studies.design:
        yield from studies.design.beyond_half(hz, rate)


def _with_along(studies: Studies, given: Leaf | None, wall: tuple[str, ...] | None) -> Studies:
    """The studies with an axis of the intervals if the spec does not name one: its only span, or the wall's stiffness."""
    if given is not None:
        return studies
    spans = [axis.name for axis in studies.sweep if not axis.values]
    return replace(studies, along=spans[0] if len(spans) == 1 else wall[0] if wall else "")


def _in_order(mistakes: list[Mistake]) -> list[Mistake]:
    """Sort by line and column; mistakes without a place keep their order, at the end.

    A key that is missing in a table that is no table itself is no further mistake.
    """
    none = tuple(mistake.key for mistake in mistakes if mistake.expected == "a table")
    below = tuple(f"{key}." for key in none)
    own = [each for each in mistakes if each.expected == "a table" or not (each.key in none or each.key.startswith(below))]

    def position(mistake: Mistake) -> tuple[int, ...]:
        numbers = mistake.location.rsplit(":", 2)[1:]
        return tuple(map(int, numbers)) if len(numbers) == 2 and all(map(str.isdecimal, numbers)) else (10**9,)

    return sorted(dict.fromkeys(own), key=position)
