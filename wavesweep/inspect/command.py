"""`wavesweep inspect`: what a table has."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.program.cli.entry import verbosity
from wavesweep.program.cli.options import PATH
from wavesweep.program.tables.number_words import span_in_words

FACTS = ("spec_name", "spec_sha256", "tool_version", "numpy_version", "assumes")


@click.command("inspect")
@click.argument("table", type=PATH)
def inspect(table: str) -> None:
    """Show what a table has: columns with units, rows, facts of the run, and how many rows are in doubt.

    TABLE is a Parquet file of another command, a CSV with its data package beside it, a folder of results, or the name of a
    spec, whose results are in results/NAME.

    \b
    Examples:
      wavesweep inspect results/fig4/zwidth.parquet
      wavesweep inspect fig4
    """
    from wavesweep.program.cli.messages import printable, show_json

    facts = {str(path): _facts_of(path) for path in _tables(table)}
    if verbosity().as_json:
        show_json({"command": "inspect", "tables": facts})
    else:
        click.echo(
            printable("\n".join(line for path, facts_of_table in facts.items() for line in _lines(path, facts_of_table)))
        )


def _tables(name: str) -> list[Path]:
    """The tables of a path or of the name of a spec. Errors: UsageError without a table."""
    path = Path(name)
    if path.suffix in (".csv", ".parquet"):
        return [path]
    folder = path if path.is_dir() else Path("results", name)
    packages = sorted(folder.glob("*.datapackage.json"))
    if not packages:
        raise UsageError(f"{name}: expected a table, a folder of results, or a spec's name in results/, found none")
    return [package.with_suffix("").with_suffix(".parquet") for package in packages]


def _facts_of(path: Path) -> Mapping[str, Any]:
    """A table as numbers and words that JSON can hold."""
    from wavesweep.program.results import fields_of, read_table
    from wavesweep.program.tables.kind import counted_doubts

    kind, columns, facts = read_table(path)
    fields = fields_of(kind, columns, facts)
    doubts = {"doubts": counted_doubts(columns["doubt"])} if "doubt" in columns else {}
    return {
        "kind": kind,
        "rows": len(next(iter(columns.values()))),
        **doubts,
        "facts": {name: facts[name] for name in FACTS if isinstance(facts.get(name), str)},
        "columns": [
            {name: getattr(field, name) for name in ("name", "unit", "kind", "description")} | _extent(columns[field.name])
            for field in fields
        ],
    }


def _extent(values: np.ndarray) -> dict[str, Any]:
    """How many values are missing, and the least and the largest of the others; how many texts differ, and are true."""
    if values.dtype == object:
        words = values.tolist()
        return {"different": len(set(words)), "missing": words.count("")}
    if values.dtype == np.bool_:
        return {"true": int(values.sum())}
    finite = values[~np.isnan(values)] if values.dtype == np.float64 else values
    ends = {"least": finite.min().item(), "largest": finite.max().item()} if len(finite) else {}
    return {"missing": len(values) - len(finite), **ends}


def _lines(path: str, table: Mapping[str, Any]) -> Iterator[str]:
    doubts = ", ".join(f"{word} {number}" for word, number in table.get("doubts", {}).items())
    certified = f"; in doubt: {doubts}" if doubts else "; no row in doubt" if "doubts" in table else ""
    yield f"{path}: {table['kind']}, {table['rows']} rows{certified}"
    yield from (f"  {name}: {value}" for name, value in table["facts"].items())
    cells = [("column", "unit", "values", "meaning")]
    for column in table["columns"]:
        unit = "" if column["unit"] == "1" else column["unit"]
        cells.append((column["name"], unit, _values(column), column["description"]))
    widths = [max(len(row[column]) for row in cells) for column in range(3)]
    yield from ("  " + "  ".join(f"{cell:{width}}" for cell, width in zip(row, (*widths, 0), strict=True)) for row in cells)


def _values(column: Mapping[str, Any]) -> str:
    if "true" in column:
        return f"{column['true']} true"
    missing = f"{column['missing']} missing" if column["missing"] else ""
    if "different" in column:
        different = column["different"] - bool(missing)
        return ", ".join(filter(None, [f"{different} different" if different else "", missing]))
    ends = span_in_words(column["least"], column["largest"]) if "least" in column else ""
    return ", ".join(filter(None, [ends, missing]))
