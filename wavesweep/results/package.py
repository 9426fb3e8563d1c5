"""The Frictionless data package beside a table: its columns, the hashes of its files, and the facts of the run."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wavesweep.results.schema import Field, FieldKind

_DIALECT = {"delimiter": ",", "lineTerminator": "\n", "quoteChar": '"', "doubleQuote": True, "header": True}
_HASH_BLOCK = 1 << 20


def package_text(kind: str, fields: tuple[Field, ...], facts: Mapping[str, Any], csv: Path, parquet: Path) -> str:
    """The package as JSON text, for the two files as they are on disk; `facts` includes the timings."""
    schema = {"fields": [_field(field) for field in fields], "missingValues": ["NaN"]}
    package = {
        "profile": "data-package",
        "name": kind,
        "resources": [
            {
                "name": f"{kind}-csv",
                "profile": "tabular-data-resource",
                "format": "csv",
                "mediatype": "text/csv",
                "encoding": "utf-8",
                "dialect": _DIALECT,
                **_file(csv),
                "schema": schema,
            },
            {
                "name": f"{kind}-parquet",
                "profile": "data-resource",
                # Taken for a table, frictionless looks for the bytes of a text stream and finds none.
                "type": "file",
                "format": "parquet",
                "mediatype": "application/vnd.apache.parquet",
                **_file(parquet),
                "schema": schema,
            },
        ],
        "wavesweep": facts,
    }
    return json.dumps(package, indent=2, allow_nan=False) + "\n"


def packaged_facts(package: Path) -> dict[str, Any]:
    """Give the facts of the run in a package, empty if it is no readable package of this program."""
    try:
        facts = json.loads(package.read_text(encoding="utf-8"))["wavesweep"]
        return dict(facts) if facts["spec_sha256"] else {}
    except (FileNotFoundError, ValueError, KeyError, TypeError):
        return {}


def packaged_kinds(csv: Path) -> dict[str, FieldKind]:
    """Give the kind of each column of a CSV from the package beside it; empty without one of this program."""
    package = csv.with_suffix(".datapackage.json")
    if not packaged_facts(package):
        return {}
    schema = json.loads(package.read_text(encoding="utf-8"))["resources"][0]["schema"]
    return {field["name"]: field["type"] for field in schema["fields"]}


def _field(field: Field) -> dict[str, Any]:
    spelling = {"trueValues": ["1"], "falseValues": ["0"]} if field.kind == "boolean" else {}
    return {"name": field.name, "type": field.kind, "unit": field.unit, "description": field.description, **spelling}


def _file(path: Path) -> dict[str, Any]:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_HASH_BLOCK):
            digest.update(block)
    return {"path": path.name, "bytes": path.stat().st_size, "hash": f"sha256:{digest.hexdigest()}"}
