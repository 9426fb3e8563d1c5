"""A folder of results held against its data packages, with its proof files, and a sample of its rows computed again."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.capabilities import WITH_SPECS, offered
from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.program.columns import Columns
from wavesweep.program.platform_compat import versions
from wavesweep.program.results.folder import PACKAGE
from wavesweep.program.results.package import (
    BEST,
    file_facts,
    loaded,
    package_differences,
    packaged_facts,
)
from wavesweep.program.results.table_files import (
    GROUP_ROWS,
    csv_blocks,
    read_rows,
    rows_in,
    schema_facts,
    schema_fields,
)
from wavesweep.program.tables import HOMES, kind_named
from wavesweep.program.tables.kind import Recompute

# relative difference that counts as none if versions, or what is computed together, differ
SAME_NUMBER = 1e-9
# of packages and schemas that were changed
FAULTS = (WavesweepError, LookupError, TypeError, ValueError, AttributeError)
NOISE = ("residual",)  # rounding errors, which agree to the bit or not at all


@dataclass(frozen=True)
class Verification:
    """The result for a folder: sentences about the checks that were made, and about each difference that was found."""

    checked: tuple[str, ...]
    differences: tuple[str, ...]


def verify(
    directory: str | Path,
    rows: int = 20,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Verification:
    """Compare each table in a folder with its data package, have its proof file checked, and compute rows again.

    Parameters
    ----------
    directory : str or Path
        Folder of results.
    rows : int, default 20
        Of a table of intervals, so many combinations are drawn at random; the smaller tables of
        responses, passivity and simulation are computed again as a whole.
    seed : int, default 0
        Of the draw.
    progress : callable, optional
        Is called with the number of combinations of a table that are done, and of all that are
        computed again.

    Returns
    -------
    Verification
        Sentences: `checked` of the checks that were made, `differences` of what was found.

    Raises
    ------
    UsageError
        If the folder has no data package of this program.

    Notes
    -----
    Rows are compared to the bit or, if another version of this program or of numpy made them, to
    1e-9, relative.
    """
    packages = sorted(Path(directory).glob(f"*{PACKAGE}"))
    if not packages:
        raise UsageError(f"{directory}: expected results with their data package, found none")
    stems = {package.name.removesuffix(PACKAGE) for package in packages}
    tables = [*Path(directory).glob("*.csv"), *Path(directory).glob("*.parquet")]
    alone = [path for path in sorted(tables) if path.stem not in stems and path.stem in HOMES]
    checked: list[str] = []
    differences = [f"{path}: its data package is missing" for path in alone]
    for package in packages:
        for text, different in _of_package(package, rows, seed, progress or (lambda *_: None)):
            (differences if different else checked).append(text)
    return Verification(tuple(checked), tuple(differences))


def _of_package(
    package: Path, rows: int, seed: int, progress: Callable[[int, int], None]
) -> Iterator[tuple[str, bool]]:
    """Yield (sentence, whether it is about a difference) for one table."""
    cannot_be_read = f"{package}: cannot be read as a data package of this program"
    try:
        loaded(package)
    except (ValueError, OSError) as error:
        yield f"{cannot_be_read}: {error}", True
        return
    facts = packaged_facts(package)
    if not facts:
        yield f"{cannot_be_read}: no facts of a run", True
        return
    damaged = list(_files(package)) or list(_described(package))
    parquet = package.with_name(package.name.replace(PACKAGE, ".parquet"))
    damaged += _between(parquet.with_suffix(".csv"), parquet)
    yield from ((text, True) for text in damaged)
    if not damaged:
        yield f"{package}: the files have the bytes and hashes of the package", False
    if proof := facts.get("proof"):
        columns = {} if damaged else read_rows(parquet, 0, rows_in(parquet))
        yield from offered("of_table").checked(package.with_name(proof), facts, columns)
    try:
        again = _again(package, facts)
    except FAULTS as error:
        yield f"{package}: the spec in it makes no run: {error}", True
        return
    except OSError as error:  # of the table, which has the names of the specs
        yield f"{package}: its rows cannot be computed again: {error}", True
        return
    if again is None:
        yield f"{package}: its rows cannot be computed again from a spec", False
        return
    digest = facts["spec_sha256"]
    if again.sha256 != digest:
        ours = f"{again.sha256[:12]}…"
        yield f"{package}: the digest of the spec in it is {ours}, not {str(digest)[:12]}…", True
    yield from _rows(package, facts, again, rows, seed, progress)


def _files(package: Path) -> Iterator[str]:
    """Yield the differences of the files from their entries in the package."""
    entries = loaded(package)["resources"]
    expected_files = {entry["path"]: (entry["bytes"], entry["hash"]) for entry in entries}
    if len(expected_files) < len(entries):
        yield f"{package}: {len(entries) - len(expected_files)} of its files are listed again"
    stem = package.name.removesuffix(PACKAGE)
    for name in sorted({f"{stem}.csv", f"{stem}.parquet"} - set(expected_files)):
        yield f"{package}: {name} is not in its list of files"
    for name, (size, digest) in expected_files.items():
        relative = name.removeprefix(f"{BEST}/" if stem in WITH_SPECS else "")
        if relative != Path(relative).name:
            yield f"{package}: {name} in its list of files is in another folder"
            continue
        path = package.parent / name
        try:
            facts = file_facts(path)
        except OSError as error:
            yield f"{path}: {error.strerror}"
            continue
        if (facts["bytes"], facts["hash"]) != (size, digest):
            bytes_, hash_ = facts["bytes"], facts["hash"]
            yield f"{path}: {bytes_} bytes with {hash_[:19]}…, but {size} bytes with {digest[:19]}… in the package"


def _described(package: Path) -> Iterator[str]:
    """Yield what the package says otherwise than the Parquet file, or than this program says of such a table."""
    kind = package.name.removesuffix(PACKAGE)
    parquet = package.with_name(f"{kind}.parquet")
    try:
        for text in package_differences(
            package, kind, schema_fields(parquet), schema_facts(parquet)
        ):
            yield f"{package}: {text}"
    except (*FAULTS, OSError) as error:
        yield f"{package}: cannot be held against its Parquet file: {error}"


def _between(csv: Path, parquet: Path) -> Iterator[str]:
    """Yield the first difference of the two tables, whatever their package says of them."""
    try:
        difference = _compared(parquet, csv_blocks(csv), exact=True)
    except (*FAULTS, OSError) as error:
        yield f"{csv.with_suffix('')}.*: a table cannot be read: {error}"
        return
    if difference:
        yield f"{parquet} and {csv.name}: {difference}"


def _again(package: Path, facts: Mapping[str, Any]) -> Recompute | None:
    """The way to compute the rows of this table again; None for a table that does not come from one spec."""
    kind = package.name.removesuffix(PACKAGE)
    if kind in HOMES:
        return kind_named(kind).again(facts, partial(_stem, package))
    return None


def _stem(package: Path) -> str:
    """The name of the spec file, which is in the rows but not in the spec. Raises OSError if these cannot be read."""
    try:
        column = read_rows(package.with_name(package.name.replace(PACKAGE, ".parquet")), 0, 1).get(
            "spec", ["spec"]
        )
    except WavesweepError as error:
        raise OSError(str(error)) from error
    return str(column[0]) if len(column) else "spec"


def _counted(items: Sequence[int], progress: Callable[[int, int], None]) -> Iterator[int]:
    """The items, and a report before each."""
    for done, item in enumerate(items):
        progress(done, len(items))
        yield item


def _rows(
    package: Path,
    facts: Mapping[str, Any],
    again: Recompute,
    rows: int,
    seed: int,
    progress: Callable[[int, int], None],
) -> Iterator[tuple[str, bool]]:
    """Yield the sentences about the rows that are computed again."""
    parquet = package.with_name(package.name.replace(PACKAGE, ".parquet"))
    exact = versions().items() <= facts.items()
    if exact:
        how = "to the bit"
    else:
        how = f"to {SAME_NUMBER:g}, since another version of this program or of numpy made them"
    if exact and again.of_combinations is not None:
        exact = False
        how = f"to {SAME_NUMBER:g}, since what is computed together decides the last digits"
    try:
        # Before a foreign package has millions of them computed.
        count = rows_in(parquet)
        if again.rows not in (0, count):
            difference = f"{count} rows and not {again.rows}"
        elif again.of_combinations is None:
            difference = _compared(parquet, again.all_blocks(), exact)
            extent = "all rows"
        else:
            difference = _sampled(
                parquet, again.of_combinations, again.combinations, rows, seed, exact, progress
            )
            extent = f"{min(rows, again.combinations)} of {again.combinations} combinations (seed {seed})"
    except (WavesweepError, ValueError, OSError) as error:
        yield f"{parquet}: its rows cannot be held against new ones: {error}", True
        return
    if difference:
        yield f"{parquet}: computed again, {difference}", True
    else:
        yield f"{parquet}: {extent} computed again, equal {how}", False


def _compared(parquet: Path, blocks: Iterable[Columns], exact: bool) -> str:
    """The first difference of a whole table from new rows in blocks."""
    first = 0
    for block in blocks:
        end = first + len(next(iter(block.values())))
        if difference := first_difference(read_rows(parquet, first, end), block, exact, first):
            return difference
        first = end
    rows = rows_in(parquet)
    if rows != first:
        return f"{rows} rows and not {first}"
    return ""


def _sampled(
    parquet: Path,
    computed: Callable[[Iterable[int]], Iterator[Columns]],
    combinations: int,
    sample: int,
    seed: int,
    exact: bool,
    progress: Callable[[int, int], None],
) -> str:
    """The first difference in a sample of the combinations, in words; empty if there is none.

    computed: new rows of the combinations with given numbers, one after another. combinations,
    sample: how many there are, and are compared.
    """
    rows, starts = rows_in(parquet), _starts(parquet)
    if starts is None:
        return "no column interval"
    if len(starts) != combinations:
        return f"{len(starts)} combinations and not {combinations}"
    picked = np.sort(
        np.random.default_rng(seed).choice(len(starts), min(sample, len(starts)), replace=False)
    )
    ends = np.append(starts[1:], rows)
    for number, new in zip(picked, computed(_counted(picked.tolist(), progress)), strict=True):
        first, wanted = int(starts[number]), len(new["interval"])
        if ends[number] - first != wanted:
            return f"row {first + 1}: {ends[number] - first} intervals and not {wanted}"
        if difference := first_difference(
            read_rows(parquet, first, first + wanted), new, exact, first
        ):
            return difference
    return ""


def _starts(parquet: Path) -> np.ndarray | None:
    """The first row of every combination, in which the column `interval` is 0; None if there is no such column."""
    starts = []
    for first in range(0, rows_in(parquet), GROUP_ROWS):
        numbers = read_rows(parquet, first, first + GROUP_ROWS, ["interval"]).get("interval")
        if numbers is None:
            return None
        starts.append(first + np.flatnonzero(numbers == 0))
    return np.concatenate(starts)


def first_difference(columns: Columns, expected: Columns, exact: bool, first_row: int) -> str:
    """The first difference of two tables as a text, empty for equal tables.

    columns, expected: columns. exact: to the bit; otherwise numbers may differ by SAME_NUMBER,
    relative. first_row: number of the rows before these.
    """
    if sorted(columns) != sorted(expected):
        return f"columns {', '.join(columns)} and not {', '.join(expected)}"
    for name, column in columns.items():
        wanted = np.asarray(expected[name])
        if len(column) != len(wanted):
            return f"{len(column)} rows and not {len(wanted)}"
        different = np.flatnonzero(~_equal(np.asarray(column), wanted, exact))
        if different.size and (exact or name not in NOISE):
            row = int(different[0])
            return (
                f"row {first_row + row + 1}, column {name}: {column[row]!s} and not {wanted[row]!s}"
            )
    return ""


def _equal(found: np.ndarray, expected: np.ndarray, exact: bool) -> np.ndarray:
    if found.dtype.kind != "f" or expected.dtype.kind != "f":
        return np.asarray(found == expected)
    if exact:
        same = found.view(np.int64) == expected.astype(float).view(np.int64)
    else:
        size = np.maximum(np.abs(found), np.abs(expected))
        same = np.abs(found - expected) <= SAME_NUMBER * size
    return np.asarray(same | (np.isnan(found) & np.isnan(expected)))
