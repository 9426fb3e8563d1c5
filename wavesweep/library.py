"""The commands as calls: a spec with its own sweep in, DataFrames out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavesweep.spec import Spec, load

if TYPE_CHECKING:
    from pandas import DataFrame

Source = Spec | str | Path | Mapping[str, Any]


class Shared(dict):
    """A dict for the `.attrs` of a DataFrame, which pandas copies at every access to a column: its copies are itself."""

    def __deepcopy__(self, memo: Any) -> Shared:
        return self

    def __reduce__(self) -> tuple[type[dict], tuple[dict[str, Any]]]:
        return dict, (dict(self),)  # who reads a pickled DataFrame needs no part of this package


def frame(
    kind: str,
    columns: Mapping[str, Any],
    facts: Mapping[str, Any] | None = None,
    units: Mapping[str, str] | None = None,
) -> DataFrame:
    """Columns of a table of that kind as a DataFrame; `.attrs` has the `units` of the columns, and `facts` if there are any.

    units: if they are known; otherwise they follow from the kind and the facts.
    """
    import pandas

    table = pandas.DataFrame(dict(columns))
    if units is None:
        from wavesweep.results import fields_of

        units = {field.name: field.unit for field in fields_of(kind, columns, facts)}
    table.attrs["units"] = Shared(units)
    if facts is not None:
        table.attrs["facts"] = Shared(facts)
    return table


def zwidth(
    source: Source,
    along: str | None = "K_VE",
    for_hands: str | Iterable[str] = (),
    **work: Any,
) -> DataFrame:
    """Stable intervals over the spec's own [sweep], as `wavesweep zwidth` computes them.

    source: a spec, a path, or nested tables. along: the axis of the intervals; None for the spec's own. for_hands: a word
    or several, whose intervals are added: "passive", "box", "box:mass=0.1..0.4,damping=2..5", "port", see `wavesweep zwidth
    --help`. work: jobs, backend, scheduler, progress, checkpoint and
    force, see `wavesweep.sweep.intervals`. Errors: UsageError, SpecError, WavesweepError.
    """
    from wavesweep import sweep

    return _framed(sweep.intervals(_spec(source), along, sweep.hands_of(for_hands), **work))


def stability_region(source: Source, along: str | None = None, **options: Any) -> DataFrame:
    """The same along the spec's own axis, as `wavesweep stability-region` computes them.

    source: a spec, a path, or nested tables. along: another axis than the spec's own. options: as for `zwidth`.
    """
    return zwidth(source, along, **options)


def bode(*sources: Source, **work: Any) -> DataFrame:
    """Admittance (m/N), impedance (N/m) and worst-case gain over the [bode] axes, as `wavesweep bode` computes them.

    sources: specs, paths, or nested tables; of several that are called alike, the second and further ones have a number in the
    column `spec`. work: as for `zwidth`.
    """
    from wavesweep import sweep

    return _framed(sweep.responses(_numbered([_spec(source) for source in sources]), **work))


def _numbered(specs: list[Spec]) -> list[Spec]:
    """The specs under different names, which label their rows."""
    names: list[str] = []
    for spec in specs:
        tries = (f"{spec.name} {number}" if number > 1 else spec.name for number in count(1))
        names.append(next(name for name in tries if name not in names))
    return [replace(spec, name=name) for spec, name in zip(specs, names, strict=True)]


def design(source: Source, **work: Any) -> DataFrame:
    """Designs that meet the wishes of the spec's [design], the best first, as `wavesweep design` has them.

    source, work: as for `zwidth`. Errors: UsageError, SpecError; WavesweepError if no design meets all bounds.
    """
    from wavesweep.search.study import design as search

    table = search(_spec(source).as_designed(), **work)
    found = frame_of_fields(table)
    found.attrs["facts"] = Shared(table.facts)
    return found


def passivity(source: Source, tolerance: float = 1e-3, **work: Any) -> DataFrame:
    """Wave channel and hand's port over the spec's [sweep], as `wavesweep passivity` has them.

    source: a spec, a path, or nested tables. tolerance: J per J sent that aliasing may add. work: as for `zwidth`.
    """
    from wavesweep import sweep

    return _framed(sweep.passivity(_spec(source), tolerance, **work))


def filter_choices(source: Source, tolerance: float = 1e-3) -> DataFrame:
    """Norm of the wave channel for orders 1 to 8 of LP1, as `passivity --filters` has it.

    source: a spec, a path, or nested tables. tolerance: as for `passivity`.
    """
    from wavesweep import sweep

    return _framed(sweep.filter_choices(_spec(source), tolerance))


def simulate(source: Source) -> list[DataFrame]:
    """The run that the [simulate] of `source` describes and, for settled sines, its response; see `wavesweep simulate`."""
    from wavesweep import sweep

    return [_framed(table) for table in sweep.simulate(_spec(source).as_simulated())]


def verdict(source: Source) -> dict[str, Any]:
    """The verdict of `wavesweep check` on the own design of `source`, as a dict; see `wavesweep.sweep.verdict`."""
    from wavesweep.sweep.verdict import verdict as found

    return found(_spec(source))


def why(source: Source, along: str | None = None) -> DataFrame:
    """Elasticities and slopes of each limit of the own design of `source`, as `wavesweep why` computes them.

    source: a spec, a path, or nested tables. along: the axis of the intervals, the spec's own by default.
    """
    from wavesweep import sweep

    return _framed(sweep.why(_spec(source), along))


def _spec(source):
    return source if isinstance(source, Spec) else load(source)


def frame_of_fields(table: Any) -> DataFrame:
    """A table that names its fields itself as a DataFrame, with `units` in `.attrs`."""
    import pandas

    found = pandas.DataFrame(dict(table.columns))
    found.attrs["units"] = Shared((field.name, field.unit) for field in table.fields)
    return found


def _framed(table):
    return frame(table.kind, table.columns, table.facts)
