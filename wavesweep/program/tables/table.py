"""The table that a sweep returns: its columns, at once or block by block, and the facts of the run."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from wavesweep.program.columns import Columns, joined
from wavesweep.program.platform_compat import versions
from wavesweep.program.tables import HOMES, kind_named

if TYPE_CHECKING:
    from wavesweep.program.analyses.claims import Claim
    from wavesweep.program.spec import Spec
    from wavesweep.program.tables.fields import Field


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """A table that need not fit into memory, with all that its files need.

    kind: the table's name, and that of its files. blocks: gives the columns (name -> array, in the
    table's order) in blocks of consecutive rows, as often as it is called. facts: JSON-able, see
    `results`. axes: name -> values of each leading column of a table of intervals. fields: the
    columns' fields, if they are not those of its kind. figure: writes the figure to a path, in the
    format of its suffix. text: the table as Markdown. extra_files: writes further files, which
    appear together with the table, into a folder. forget: removes the checkpoint that the rows are
    read from, once they are safe elsewhere. rows: how many there are, 0 if it is not known.
    """

    kind: str
    blocks: Callable[[], Iterable[Columns]]
    facts: Mapping[str, Any]
    axes: Mapping[str, tuple[float, ...]] | None = None
    fields: tuple[Field, ...] | None = None
    figure: Callable[[Path], None] | None = None
    text: str | None = None
    extra_files: Callable[[Path], None] | None = None
    forget: Callable[[], None] = lambda: None
    rows: int = 0

    def __post_init__(self) -> None:
        if self.kind in HOMES and (kind := kind_named(self.kind)).vouched:
            blocks = self.blocks
            object.__setattr__(self, "blocks", lambda: map(kind.lawful, blocks()))

    @classmethod
    def of(cls, kind: str, columns: Columns, facts: Mapping[str, Any], **more: Any) -> Table:
        """A table of rows that are known already."""
        return cls(kind, lambda: (columns,), facts, **more)

    @property
    def columns(self) -> Columns:
        """The whole table."""
        return joined(self.blocks())

    def watched(self, *watchers: Callable[[Columns], None]) -> Table:
        """The same table; as its blocks are read, each is shown to the watchers as well."""

        def blocks() -> Iterator[Columns]:
            for block in self.blocks():
                for watch in watchers:
                    watch(block)
                yield block

        return replace(self, blocks=blocks)


def facts_of(
    specs: Spec | Sequence[Spec],
    methods: Mapping[str, str],
    slices: Mapping[str, int],
    timings: Mapping[str, float],
    notices: Iterable[str] = (),
    swept: Collection[str] = (),
    *,
    claims: Mapping[str, Claim] = MappingProxyType({}),
) -> dict[str, Any]:
    """The facts of a run: versions, the resolved specs and their digest, assumptions, methods, counts, timings in s.

    specs: a spec or several; `spec` in the facts is the first of them. swept: paths of the axes of
    the table. claims: what rows say of which loops, by word, or by the names of several specs.
    """
    from wavesweep.program.analyses.assumptions import solved_within_ticks
    from wavesweep.program.analyses.claim_words import fact_of

    specs = specs if isinstance(specs, (list, tuple)) else (specs,)
    several = len(specs) > 1
    facts = {
        "schema_version": 1,
        **versions(),
        "spec_name": "+".join(spec.name for spec in specs),
        "spec": specs[0].tables(),
        "spec_sha256": digest_of(specs),
    }
    if several:
        facts["specs"] = {spec.name: spec.tables() for spec in specs}
    facts["assumes"] = _assumed(specs, swept, claims)
    facts["claims"] = {word: fact_of(claim.over(specs, swept)) for word, claim in claims.items()}
    facts["methods"] = dict(methods)
    facts["slices"] = dict(slices)
    facts["notices"] = list(notices)
    for spec in specs:
        for cycle in solved_within_ticks(spec, swept):
            facts["notices"].append(f"{spec.name}: {cycle}" if several else cycle)
    facts["timings"] = {name: round(seconds, 6) for name, seconds in timings.items()}
    return facts


def _assumed(specs: Sequence[Spec], swept: Collection[str], claims: Mapping[str, Claim]) -> str:
    """What is assumed of the walls of the specs; by their names if it is not the same of all."""
    from wavesweep.program.analyses.assumptions import model_in_words

    several = len(specs) > 1
    models = []
    for spec in specs:
        of_spec = [
            claims[word] for word in claims if not several or word.split("/")[0] == spec.name
        ]
        told = {path for claim in of_spec for path in claim.scope.paths()}
        axes = {axis.path for axis in (*spec.sweep, *spec.bode)}
        models.append(model_in_words(spec, axes & {*swept} if several else swept, told))
    if len(set(models)) == 1:
        return models[0]
    named = zip(specs, models, strict=True)
    return "\n".join(f"{spec.name}: {model}" for spec, model in named if model)


def with_unlike_units(
    facts: dict[str, Any], units: Mapping[str, Iterable[tuple[str, str]]]
) -> dict[str, Any]:
    """The facts of a table of several specs, with a notice for columns that do not have the same unit in all of them.

    units: (spec, unit) pairs of each column. The fact `unlike_units` has the specs of each unit of
    such a column.
    """
    unlike: dict[str, dict[str, list[str]]] = {}
    columns: dict[str, list[str]] = {}
    for name, pairs in units.items():
        by_unit: dict[str, list[str]] = {}
        for spec, unit in pairs:
            by_unit.setdefault(unit, []).append(spec)
        if len(by_unit) > 1:
            unlike[name] = by_unit
            units_of_specs = [
                f"{unit or 'no unit'} in {' and '.join(specs)}" for unit, specs in by_unit.items()
            ]
            columns.setdefault(", ".join(units_of_specs), []).append(name)
    if not unlike:
        return facts
    notices = list(facts["notices"])
    for said, names in columns.items():
        notices.append(f"{', '.join(names)}: {said}; each row has the unit of its spec")
    return facts | {"notices": notices, "unlike_units": unlike}


def spans_held(spec: Spec, along: str = "") -> Iterator[str]:
    """Yield notices of the axes of [sweep] that have only a span, but for the path `along`."""
    for axis in spec.sweep:
        if not axis.values and axis.path != along:
            yield f"{axis.name} is not swept, because it has a range and no values: {held(spec, axis.path)}"


def held(spec: Spec, path: str) -> str:
    """Words for an axis that is not swept."""
    value = spec.own(path)
    if value is None:
        return "held as the spec has it"
    return f"held at the spec's {value:g}"


def digest_of(specs: Sequence[Spec]) -> str:
    """The SHA-256 of a spec, or of the digests of several."""
    if len(specs) == 1:
        return specs[0].sha256
    return sha256("".join(spec.sha256 for spec in specs).encode()).hexdigest()
