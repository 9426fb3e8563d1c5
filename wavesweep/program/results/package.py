"""The Frictionless data package beside a table: its columns, the hashes of its files, and the facts of the run."""

import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

from wavesweep.capabilities import WITH_SPECS
from wavesweep.program.atomic_files import open_file, write_file
from wavesweep.program.tables.fields import Field, FieldKind

_DIALECT = {
    "delimiter": ",",
    "lineTerminator": "\n",
    "quoteChar": '"',
    "doubleQuote": True,
    "header": True,
}
_MEDIA = {
    "png": "image/png",
    "svg": "image/svg+xml",
    "pdf": "application/pdf",
    "eps": "application/postscript",
}
OF_RUN = ("timings", "warnings", "date", "command")  # facts that do not concern the rows
OWN_FACTS = (*OF_RUN, "spec_place")  # facts that differ between runs that give the same rows
BEST = "best"  # the folder of specs beside a table that has them
LARGEST_PACKAGE = 1 << 24  # bytes of a package
_OF_COLUMN = ("name", "type", "unit", "description")


def package_text(
    kind: str,
    fields: tuple[Field, ...],
    facts: Mapping[str, Any],
    stem: Path,
    figures: Sequence[Path],
) -> str:
    """The package as JSON text, for the files as they are on disk; `facts` includes the timings.

    stem: the CSV and the Parquet file, or the folder of Parquet files, without their suffixes.
    """
    schema = {"fields": [*map(_described, fields)], "missingValues": [""]}
    package = {
        "profile": "data-package",
        "name": kind,
        "title": _title(kind, facts),
        "resources": [
            *_tables(kind, stem, schema),
            *(
                _spec(kind, spec)
                for spec in sorted((stem.parent / BEST).glob("*.toml"))
                if kind in WITH_SPECS
            ),
            *(figure_resource(kind, facts, figure) for figure in figures),
            *(_proof(kind, proof) for proof in [stem.with_suffix(".proof")] if proof.exists()),
        ],
        "wavesweep": facts,
    }
    return _as_text(package)


def _described(field: Field) -> dict[str, Any]:
    """A column, as the schema of a table has it."""
    column: dict[str, Any] = {
        "name": field.name,
        "type": field.kind,
        "unit": field.unit,
        "description": field.description,
    }
    if field.kind == "boolean":
        column |= {"trueValues": ["1"], "falseValues": ["0"]}
    return column


def _tables(kind: str, stem: Path, schema: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The entries of the CSV and the Parquet file."""
    # No "tabular-data-resource": frictionless would then look for the bytes of a text stream and
    # find none.
    parquet = {
        "profile": "data-resource",
        "type": "file",
        "format": "parquet",
        "mediatype": "application/vnd.apache.parquet",
    }
    single = stem.with_suffix(".parquet")
    csv = {
        "profile": "tabular-data-resource",
        "format": "csv",
        "mediatype": "text/csv",
        "encoding": "utf-8",
    }
    return [
        {
            "name": f"{kind}-csv",
            **csv,
            "dialect": _DIALECT,
            **file_facts(stem.with_suffix(".csv")),
            "schema": schema,
        },
        {"name": f"{kind}-parquet", **parquet, **file_facts(single), "schema": schema},
    ]


def _spec(kind: str, spec: Path) -> dict[str, Any]:
    """The entry of a spec in the folder BEST."""
    return {
        "name": f"{kind}-{spec.stem}".lower(),
        "profile": "data-resource",
        "type": "file",
        "format": "toml",
        "mediatype": "application/toml",
        **file_facts(spec),
        "path": f"{BEST}/{spec.name}",
    }


def _proof(kind: str, proof: Path) -> dict[str, Any]:
    """The entry of a proof file."""
    return {
        "name": f"{kind}-proof",
        "profile": "data-resource",
        "type": "file",
        "format": "proof",
        "mediatype": "application/gzip",
        **file_facts(proof),
    }


def loaded(package: Path) -> dict[str, Any]:
    """Give the content of a data package. Raises OSError, also for a pipe or a device.

    Raises ValueError if the file is too large, no JSON, or has a list of files that this program
    does not write.
    """
    with open_file(package) as file:
        text = file.read(LARGEST_PACKAGE + 1)
    if len(text) > LARGEST_PACKAGE:
        raise ValueError(f"expected at most {LARGEST_PACKAGE} bytes, found more")
    content: dict[str, Any] = parsed(text)
    _check_resources(content.get("resources") if isinstance(content, dict) else None)
    return content


def parsed(text: bytes) -> Any:
    """The value of a JSON text. Raises ValueError, also for NaN and infinities, which JSON does not have, and for depth."""
    try:
        return json.loads(text, parse_constant=_finite, parse_float=_finite)
    except RecursionError:
        raise ValueError("expected fewer values within each other") from None


def _finite(word: str) -> float:
    value = float(word)
    if not math.isfinite(value):
        raise ValueError(f"expected a number, found {word[:40]}")
    return value


def _check_resources(resources: Any) -> None:
    """Raise ValueError if this is no list of files with path, size and hash, and columns with names and types."""
    if not isinstance(resources, list) or not resources:
        raise ValueError("expected a list of files, found none")
    for entry in resources:
        if not _has_texts(entry, ("name", "path", "hash")):
            raise ValueError("expected name, path and hash of each file, found others")
        if not entry["path"].isprintable() or not isinstance(entry.get("bytes"), int):
            raise ValueError("expected a printable path and bytes of each file, found others")
    schema = resources[0].get("schema")
    columns = schema.get("fields") if isinstance(schema, dict) else None
    if not (columns and isinstance(columns, list)):
        raise ValueError("expected the columns of the table, found none")
    for entry in columns:
        if not _has_texts(entry, _OF_COLUMN):
            raise ValueError(f"expected {', '.join(_OF_COLUMN)} of each column, found others")
        if entry["type"] not in get_args(FieldKind):
            raise ValueError(f"expected {' or '.join(get_args(FieldKind))} as type of each column")


def _has_texts(entry: Any, names: Iterable[str]) -> bool:
    """Whether a value is a table with texts of these names."""
    if not isinstance(entry, dict):
        return False
    return all(isinstance(entry.get(name), str) for name in names)


def packaged_files(package: Path) -> list[str]:
    """Give the paths of the files in a package, none if it is not readable."""
    try:
        return [entry["path"] for entry in loaded(package)["resources"]]
    except (OSError, ValueError):
        return []


def figure_resource(kind: str, facts: Mapping[str, Any], figure: Path) -> dict[str, Any]:
    """The entry of a figure among the resources of a package."""
    form = figure.suffix[1:]
    return {
        "name": f"{kind}-{form}",
        "profile": "data-resource",
        "type": "file",
        "title": f"Figure: {_title(kind, facts)}",
        "description": f"drawn by wavesweep {facts.get('tool_version', '')}".rstrip(),
        "format": form,
        "mediatype": _MEDIA[form],
        **file_facts(figure),
    }


def _title(kind: str, facts: Mapping[str, Any]) -> str:
    if "spec_name" in facts:
        return f"{kind} of {facts['spec_name']}"
    return kind


def packaged_facts(package: Path) -> dict[str, Any]:
    """Give the facts of the run in a package, empty if it is no readable package of this program."""
    try:
        facts = loaded(package).get("wavesweep")
    except (OSError, ValueError):
        return {}
    if not isinstance(facts, dict) or not isinstance(facts.get("spec_sha256"), str):
        return {}
    return facts if facts["spec_sha256"] else {}


def packaged_fault(csv: Path, package: Path) -> str:
    """Give the reason why a CSV is not the table that the package beside it describes, empty if it is."""
    if not packaged_facts(package):
        if package.is_file():
            state = "a damaged one; use the Parquet file, or compute the table again"
        else:
            state = "none"
        return f"expected the data package of wavesweep, {package.name}, beside the table, found {state}"
    described = loaded(package)["resources"][0]
    facts = file_facts(csv)
    if facts["hash"] == described["hash"]:
        return ""
    expected = f"expected the {described['bytes']} bytes that {package.name} describes"
    state = f"found {facts['bytes']} other ones: the file is torn or was changed"
    return f"{expected}, {state}; use the Parquet file, or compute the table again"


def same_but_for_the_run(one: Path, other: Path) -> bool:
    """Whether two packages are equal but for facts of the run that made them; false if one cannot be read."""
    try:
        packages = [loaded(package_file) for package_file in (one, other)]
        for content in packages:
            content.pop("hash", None)
            content["wavesweep"] = {
                name: fact for name, fact in content["wavesweep"].items() if name not in OF_RUN
            }
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False
    return packages[0] == packages[1] and not other.is_symlink()


def add_figures(package: Path, kind: str, figures: Sequence[Path]) -> None:
    """Enter figures in an existing data package, in place of older ones of the same format; another file is left as it is.

    package: its path. kind: of the table. figures: paths of the files, beside the package. The
    caller is `at_work` there.
    """
    if not packaged_facts(package):
        return
    package_content = loaded(package)
    new = [figure_resource(kind, package_content["wavesweep"], figure) for figure in figures]
    names = {resource["name"] for resource in new}
    package_content["resources"] = [
        resource for resource in package_content["resources"] if resource["name"] not in names
    ] + new
    write_file(package, _as_text(package_content).encode())


def _as_text(package: Mapping[str, Any]) -> str:
    """The text of a package, with a hash of what is in it."""
    content = {name: value for name, value in package.items() if name != "hash"}
    digest = hashlib.sha256(json.dumps(content, indent=2, allow_nan=False).encode()).hexdigest()
    return json.dumps(content | {"hash": f"sha256:{digest}"}, indent=2, allow_nan=False) + "\n"


def package_differences(
    package: Path, kind: str, fields: tuple[Field, ...], facts: Mapping[str, Any]
) -> Iterator[str]:
    """Yield where a package differs from the one that this program writes for the files beside it.

    fields, facts: those in the Parquet file; what such a file does not have is held against the
    hash in the package. Sizes and hashes of files are not compared. Raises OSError, ValueError,
    KeyError or TypeError if something cannot be read.
    """
    content, stem = loaded(package), package.with_name(kind)
    own_facts = {
        name: content["wavesweep"][name] for name in OWN_FACTS if name in content["wavesweep"]
    }
    possible = [stem.with_suffix(f".{form}") for form in _MEDIA]
    figures = []
    for resource in content["resources"]:
        figure = package.parent / resource["path"]
        if resource.get("format") in _MEDIA and figure in possible:
            figures.append(figure)
    text = package_text(kind, fields, {**facts, **own_facts}, stem, figures)
    expected = json.loads(text)
    for resource, entry in zip(expected["resources"], content["resources"], strict=False):
        resource |= {name: entry[name] for name in ("bytes", "hash") if name in entry}
    expected.pop("hash")
    entries = {name: value for name, value in content.items() if name != "hash"}
    places = list(_differences(entries, expected, ""))
    yield from places[:5]
    if not places and package.read_text(encoding="utf-8") not in (
        _as_text(content),
        json.dumps(entries, indent=2) + "\n",
    ):
        yield "its text does not have the hash that it gives"


def _differences(value: Any, expected: Any, place: str) -> Iterator[str]:
    """Yield each place of a JSON value that is not as expected, and how."""
    if isinstance(value, Mapping) and isinstance(expected, Mapping):
        for name in {**expected, **value}:
            inner_place = f"{place}.{name}" if place else name
            if name not in value or name not in expected:
                yield f"{inner_place} is {'missing' if name in expected else 'in it, and expected by nothing'}"
            else:
                yield from _differences(value[name], expected[name], inner_place)
    elif isinstance(value, list) and isinstance(expected, list) and len(value) == len(expected):
        for number, (item, wanted) in enumerate(zip(value, expected, strict=True)):
            yield from _differences(item, wanted, f"{place}[{number}]")
    elif type(value) is not type(expected) or value != expected:
        yield f"{place} is {json.dumps(value)[:60]}, not {json.dumps(expected)[:60]}"


def packaged_kinds(csv: Path) -> dict[str, FieldKind]:
    """Give the kind of each column of a CSV from the package beside it; empty without one of this program."""
    package = csv.with_suffix(".datapackage.json")
    if not packaged_facts(package):
        return {}
    return {field.name: field.kind for field in packaged_fields(package)}


def packaged_fields(package: Path) -> tuple[Field, ...]:
    """Give the columns of a table as its package describes them. Raises OSError, or ValueError for a damaged package."""
    columns = loaded(package)["resources"][0]["schema"]["fields"]
    return tuple(
        Field(column["name"], column["type"], column["unit"], column["description"])
        for column in columns
    )


def file_facts(path: Path) -> dict[str, Any]:
    """Give the name of a file, its size in bytes and its SHA-256."""
    digest = hashlib.sha256()
    with open_file(path) as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return {"path": path.name, "bytes": path.stat().st_size, "hash": f"sha256:{digest.hexdigest()}"}
