"""Loading: from a path or nested tables, and overrides, to a `Spec`."""

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from itertools import islice

from wavesweep.errors import Mistake, SpecError, UsageError
from wavesweep.spec.checking import Mistakes, Rejected, check, show
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
    mistakes = Mistakes()
    leaves = _collect(tables, place, overrides, mistakes)
    return _build(name, path, leaves, place, mistakes)


def naming(spec: Spec, names: Iterable[object], signal: str | None = None) -> Spec:
    """Return the spec in which these keys of blocks (`block.m.mass`) are numbers too, as those are that [sweep] names.

    signal: of a drawn loop, which is an output too, as the one is that [bode] names. Other names, and keys that are not written
    as a number, are left to the caller.
    """
    if spec.drawing is None:
        return spec
    of_blocks = (name for name in names if isinstance(name, str) and name.startswith("block.") and not spec.names.find(name))
    return _naming(spec, tuple(of_blocks), signal if signal in spec.drawing.signals else None)


@lru_cache(maxsize=64)
def _naming(spec, names, signal):
    if not names and signal is None:
        return spec
    tables = spec.tables()
    written = {f"block.{block}.{key}": value for block, keys in tables["block"].items() for key, value in keys.items()}
    new = {name: [written[name]] for name in names if isinstance(written.get(name), (int, float))}
    tables |= {"sweep": tables["sweep"] | new, "bode": tables["bode"] | ({} if signal is None else {"to": signal})}
    try:
        return replace(load(tables), name=spec.name, source=spec.source)
    except SpecError:  # a key that has a number and takes none that varies
        return spec


def _collect(tables: dict, place: Place, overrides: Iterable[str], mistakes: Mistakes) -> dict[Path, Leaf]:
    """Return the leaves of a source by path, with those of the overrides in their places."""
    leaves: dict[Path, Leaf] = {}
    given = list(islice(leaves_of(tables, place), MOST_KEYS + 1))
    if len(given) > MOST_KEYS:
        mistakes.refuse(given[-1][1], "", f"at most {MOST_KEYS} keys", "more")
        return leaves
    for path, leaf in given:
        if path in leaves:  # an axis written both as "device.mass" and as device.mass
            mistakes.refuse(leaf, ".".join(path), "each key once", "the same key again")
        leaves[path] = leaf
    symbols = {name: path_of(name) for path in leaves if (name := path[1:] and path[1]) and path[0] == "numbers"}
    symbols |= numbers_of_blocks(leaves)
    for typed in overrides:
        try:
            path, value, where = read_override(typed, symbols if any(path[0] in MARKS for path in leaves) else SYMBOLS)
        except SpecError as error:
            mistakes += error.mistakes
        else:
            # A number that has a unit keeps it.
            path, known = normal_path((*path, "value") if (*path, "value") in leaves else path), len(leaves)
            leaves = _override(leaves, path, value, where)
            if value == "" and len(leaves) == known:
                mistakes.refuse(where, ".".join(path), "a value, or a key of the spec to leave out", "neither")
    return leaves


def _override(leaves: dict[Path, Leaf], replaced: Path, value: object, where: Place) -> dict[Path, Leaf]:
    """Replace everything at, above or below one path, in the same position, so that the order of axes is kept."""
    for name in reversed(replaced):
        value = {name: value} if value != "" else value  # an empty text leaves the key out
    new = dict(leaves_of(value, where)) if value != "" else {}
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


def _build(name: str, path: str | None, leaves: dict[Path, Leaf], place: Place, mistakes: Mistakes) -> Spec:
    tables = {each[0] for each in leaves}
    if tables & {*MARKS} or ("controller" not in tables and tuple(RATE.split(".")) in leaves):
        return _drawn(name, path, leaves, place, mistakes)
    belongs = sort_leaves(leaves, mistakes)
    given = Given({key: leaf for key, leaf in belongs.keys.items() if key in KEYS}, place)
    values, wrong = resolve(given)
    mistakes += wrong
    studies = build_studies(belongs, given, mistakes)
    mistakes += unknown_ends(belongs, None)
    if not wrong:
        wall = next((axis.stop for axis in studies.sweep if axis.path == "environment.K_VE"), K_VE_SPAN[1])
        followers = tuple(studies.design.followers(values, wall)) if studies.design else ()  # set by ratios of [design.for_all]
        for study, axes in (*studies.axes, ("design.for_all", followers)):
            mistakes += beyond_limits(study, axes, values)
        for axis in followers:
            for end in (axis.start, axis.stop):
                try:
                    check(KEYS[axis.path], float(end))
                except Rejected as error:
                    found = f"{show(end)} of {axis.path}"
                    mistakes.refuse(axis.place, f"design.for_all.{axis.name}", error.expected, found)
                    break
    if not any(mistake.key.startswith("rates.") for mistake in wrong):
        mistakes += _beyond_rate(studies, values["rates.fast_hz"], "rates.fast_hz")
    if mistakes:
        raise SpecError(_in_order(mistakes))
    return Spec(name, path, values, studies, given)


def _drawn(name: str, path: str | None, leaves: dict[Path, Leaf], place: Place, mistakes: Mistakes) -> Spec:
    """Return the spec of a drawn loop; its axes are checked as far as its numbers are known."""
    leaves = expanded(as_meant(leaves, mistakes), mistakes)
    drawing, values, of_loop = read_drawing(leaves, place, mistakes)
    following = frozenset(path[1] for path, leaf in leaves.items() if is_derived(path, leaf))
    names = replace(drawing.names if drawing else names_of(leaves), following=following)
    belongs = sort_leaves(leaves, mistakes, names)
    given = Given(of_loop, place)
    stepped = drawing is not None and drawing.hand is None and drawing.inputs
    studies = build_studies(belongs, given, mistakes, names, "step" if stepped else "sine")
    hz = drawing.rate(values) if drawing else values.get(RATE)
    mistakes += _beyond_rate(studies, hz, RATE) if hz else []
    if drawing:
        for study, axes in studies.axes:
            mistakes += drawing.vanishing(study, axes, values)
        if studies.design:
            studies.design.refuse_unsuited(drawing, mistakes)
        mistakes += [*unknown_ends(belongs, drawing), *unmeasurable(belongs, drawing)]
    if mistakes:
        raise SpecError(_in_order(mistakes))
    if stepped:
        studies = usual_frequencies(studies, hz)
    if "sweep.along" not in belongs.keys:  # intervals are along the only span, or the wall's stiffness
        spans = [axis.name for axis in studies.sweep if not axis.values]
        along = spans[0] if len(spans) == 1 else (*(drawing.wall or ()), "")[0]
        studies = replace(studies, along=along)
    return Spec(name, path, values, studies, given, drawing=drawing)


def _beyond_rate(studies: Studies, hz: float, rate: str) -> Iterator[Mistake]:
    """Yield the mistakes of frequencies and times that do not fit the fast rate, `hz`; rate: its path.

    Defaults are not checked, since the command that reads them may never run.
    """
    if studies.frequencies is not DEFAULT_FREQUENCIES:
        yield from beyond_half(studies.frequencies, studies.bode, hz, rate)
    if studies.experiment.given:
        yield from studies.experiment.beyond_limits(hz, rate)
    if studies.design:
        yield from studies.design.beyond_half(hz, rate)


def _in_order(mistakes: list[Mistake]) -> list[Mistake]:
    """Sort by line and column; mistakes without a place keep their order, at the end.

    A key below a value that should be a table is not said to be missing as well.
    """
    none = tuple(mistake.key for mistake in mistakes if mistake.expected == "a table")
    below = tuple(f"{key}." for key in none)
    own = [each for each in mistakes if each.expected == "a table" or not (each.key in none or each.key.startswith(below))]

    def position(mistake: Mistake) -> tuple[int, ...]:
        numbers = mistake.location.rsplit(":", 2)[1:]
        return tuple(map(int, numbers)) if len(numbers) == 2 and all(map(str.isdecimal, numbers)) else (10**9,)

    return sorted(dict.fromkeys(own), key=position)
