"""`wavesweep inspect`: what a table has."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.program.cli.entry import verbosity
from wavesweep.program.cli.options import PATH

FACTS = ("spec_name", "spec_sha256", "tool_version", "numpy_version", "assumes")


@click.command("inspect")
@click.argument("table", type=PATH)
def inspect(table: str) -> None:
    """Show what a table has: columns with units, rows, facts of the run, and how many rows are in doubt.

    TABLE is a Parquet file of another command, a CSV with its data package beside it, a folder of
    results, or the name of a spec, whose results are in results/NAME.

    \b
    Examples:
      wavesweep inspect results/fig4/zwidth.parquet
      wavesweep inspect fig4
    """
    from wavesweep.program.cli.messages import printable, show_json

    facts = {str(path): _facts_of(path) for path in _tables(table)}
    if verbosity().as_json:
        show_json({"command": "inspect", "tables": facts})
        return
    lines: list[str] = []
    for path, facts_of_table in facts.items():
        lines += _lines(path, facts_of_table)
    click.echo(printable("\n".join(lines)))


def _tables(name: str) -> list[Path]:
    """The tables of a path or of the name of a spec. Errors: UsageError without a table."""
    path = Path(name)
    if path.suffix in (".csv", ".parquet"):
        return [path]
    folder = path if path.is_dir() else Path("results", name)
    packages = sorted(folder.glob("*.datapackage.json"))
    if not packages:
        raise UsageError(
            f"{name}: expected a table, a folder of results, or a spec's name in results/, found none"
        )
    return [package.with_suffix("").with_suffix(".parquet") for package in packages]


def _facts_of(path: Path) -> Mapping[str, Any]:
    """A table as numbers and words that JSON can hold."""
    from wavesweep.program.results import NOT_OURS, read_table

    kind, columns, facts = read_table(path)
    try:
        return _described(path, kind, columns, facts)
    except NOT_OURS as error:  # a whole table may have facts and columns that no run writes
        said = f"{type(error).__name__}: {error}"
        raise UsageError(
            f"{path}: expected columns and facts that a run writes, found others ({said})"
        ) from error


def _described(
    path: Path, kind: str, columns: Mapping[str, np.ndarray], facts: Mapping[str, Any]
) -> Mapping[str, Any]:
    """`_facts_of` of a table that has been read."""
    from wavesweep.program.results import described_fields, fields_of
    from wavesweep.program.tables import kind_named, kinds
    from wavesweep.program.tables.kind import counted_doubts

    own_kind = kind in kinds() and bool(kind_named(kind).fields)
    # The columns of a design study follow from its spec, and those of a missing command are not
    # known here.
    fields = fields_of(kind, columns, facts) if own_kind else described_fields(path)
    described = []
    for field in fields:
        said = {
            "name": field.name,
            "unit": field.unit,
            "kind": field.kind,
            "description": field.description,
        }
        described.append(said | _extent(columns[field.name]))
    table: dict[str, Any] = {"kind": kind, "rows": len(next(iter(columns.values())))}
    if "doubt" in columns:
        table["doubts"] = counted_doubts(columns["doubt"])
    table["facts"] = {name: facts[name] for name in FACTS if isinstance(facts.get(name), str)}
    table["columns"] = described
    return table


def _extent(values: np.ndarray) -> dict[str, Any]:
    """How many values are missing, and the least and the largest of the others; how many texts differ, and are true."""
    if values.dtype == object:
        words = values.tolist()
        return {"different": len(set(words)), "missing": words.count("")}
    if values.dtype == np.bool_:
        return {"true": int(values.sum())}
    finite = values[~np.isnan(values)] if values.dtype == np.float64 else values
    extent = {"missing": len(values) - len(finite)}
    if len(finite):
        extent["least"] = finite.min().item()
        extent["largest"] = finite.max().item()
    return extent


def _lines(path: str, table: Mapping[str, Any]) -> Iterator[str]:
    first = f"{path}: {table['kind']}, {table['rows']} rows"
    if "doubts" in table:
        doubts = ", ".join(f"{word} {number}" for word, number in table["doubts"].items())
        first += f"; in doubt: {doubts}" if doubts else "; no row in doubt"
    yield first
    for name, value in table["facts"].items():
        yield f"  {name}: {value}"
    cells = [("column", "unit", "values", "meaning")]
    for column in table["columns"]:
        unit = "" if column["unit"] == "1" else column["unit"]
        cells.append((column["name"], unit, _values(column), column["description"]))
    names, units, values, _ = zip(*cells, strict=True)
    wide_name = max(map(len, names))
    wide_unit = max(map(len, units))
    wide_values = max(map(len, values))
    for name, unit, extent, meaning in cells:
        yield f"  {name:{wide_name}}  {unit:{wide_unit}}  {extent:{wide_values}}  {meaning}"


def _values(column: Mapping[str, Any]) -> str:
    if "true" in column:
        return f"{column['true']} true"
    parts = []
    if "different" in column:
        different = column["different"] - bool(column["missing"])  # texts that are not empty
        if different:
            parts.append(f"{different} different")
    elif "least" in column:
        ends = (f"{column[end]:.6g}" for end in ("least", "largest"))
        parts.append(" to ".join(dict.fromkeys(ends)))
    if column["missing"]:
        parts.append(f"{column['missing']} missing")
    return ", ".join(parts)
