"""The folder of the results: the files of a table, those of earlier runs, and the specs that made them."""

import hashlib
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from shutil import rmtree
from typing import Any

from wavesweep.capabilities import WITH_SPECS
from wavesweep.engine.errors import UsageError
from wavesweep.program.atomic_files import is_folder, read_file
from wavesweep.program.results.package import BEST, packaged_facts
from wavesweep.program.spec import SYMBOLS

FIGURES = (".png", ".svg", ".pdf", ".eps")
PACKAGE = ".datapackage.json"
DESIGNS = r"[^/]+-\d\d\.toml"  # their names
HEADER = "# A design that wavesweep found: "  # which they begin with
LONGEST_NAME = 255  # bytes, of a file or folder on the usual file systems


def names_of(kind: str) -> list[str]:
    """The names of all files that a table may have, its package last."""
    best = [BEST] if kind in WITH_SPECS else []
    return [
        *(f"{kind}{suffix}" for suffix in (".csv", ".parquet", *FIGURES, ".md", ".proof")),
        *best,
        f"{kind}{PACKAGE}",
    ]


def place_of(sources: Iterable[str | Path], directory: str | Path) -> str:
    """Give a digest of the places of spec files as seen from the directory of the results.

    sources: their paths. The digest identifies the files also if their text changes, survives a
    move of the whole project, and shows no path of the machine.
    """
    seen_from = os.path.realpath(directory)
    places = [Path(_relative(os.path.realpath(source), seen_from)).as_posix() for source in sources]
    return hashlib.sha256("\n".join(places).encode("utf-8", "surrogateescape")).hexdigest()


def _relative(file: str, folder: str) -> str:
    try:
        return os.path.relpath(file, folder)
    except ValueError:  # on another drive
        return file


def refuse_other_spec(kind: str, directory: str | Path, sha256: str, place: str = "") -> None:
    """Raise UsageError if the directory holds a table of this kind that another spec made, or an unknown one.

    sha256: the digest of the spec. place: that of its file, see `place_of`; results of the same
    file may be replaced, also if it was edited, and those of an equal spec in any case.
    """
    facts = existing_facts(kind, directory)
    if (
        facts is None
        or facts.get("spec_sha256") == sha256
        or (place and facts.get("spec_place") == place)
    ):
        return
    if facts:
        maker = f"another spec ({_name(facts)}SHA-256 {facts['spec_sha256'][:12]}…)"
    else:
        maker = "an unknown origin"
    raise UsageError(
        f"{Path(directory) / kind}.*: found results of {maker}; give --overwrite to replace them, or another --out"
    )


def _name(facts: Mapping[str, Any]) -> str:
    names = ", ".join(facts.get("specs", ()))
    return f"{names}; " if names else ""


def refuse_other_hands(kind: str, directory: str | Path, words: Sequence[str]) -> None:
    """Raise UsageError if the directory holds a table of this kind for other hands; words: see `Hands.facts`."""
    facts = packaged_facts(Path(directory) / f"{kind}{PACKAGE}")
    if facts and facts.get("for_hands") != words:
        other_hands = f"other hands ({' '.join(map(str, facts.get('for_hands') or ()))})"
        raise UsageError(
            f"{Path(directory) / kind}.*: found results for {other_hands}; give --overwrite to replace them, or another --out"
        )


def existing_facts(kind: str, directory: str | Path) -> dict[str, Any] | None:
    """Give the facts of the table `kind` in a directory: empty if they are unknown, None if there is no such table.

    A run that was killed before it put its package in place has left them in the Parquet file.
    """
    from wavesweep.program.results.table_files import schema_facts

    files = [Path(directory) / name for name in names_of(kind)]
    if not any(os.path.lexists(file) for file in files):
        return None
    # Files without facts of ours belong to somebody as well, and are not replaced.
    return packaged_facts(files[-1]) or schema_facts(Path(directory) / f"{kind}.parquet")


def changes(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Give the differences between the specs of two runs, such as `b 25 -> 40`, in the order of the keys.

    before, now: the facts of both runs.
    """
    old = dict(_numbers(before))
    new = dict(_numbers(now))
    return [
        f"{key} {_shown(old, key)} -> {_shown(new, key)}"
        for key in {**new, **old}
        if old.get(key) != new.get(key)
    ]


def _numbers(facts: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the keys of the specs of a run, the short ones if there are some, and their values."""
    short = {path: symbol for symbol, path in SYMBOLS.items()}
    axis = facts.get("along")
    if isinstance(axis, Mapping):  # of `why`, which an option may name
        yield "along", axis.get("name")
    for name, tables in (facts.get("specs") or {"": facts.get("spec", {})}).items():
        if not isinstance(tables, Mapping):  # a package that somebody has changed
            continue
        for path, value in _flat(tables):
            yield f"{name}: {short.get(path, path)}" if name else short.get(path, path), value


def _flat(tables: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in tables.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", list(value) if isinstance(value, tuple) else value


def _shown(values: Mapping[str, Any], key: str) -> str:
    value = values.get(key, "not given")
    if not isinstance(value, list):
        return _text(value)
    text = f"[{', '.join(map(_text, value))}]"
    if len(text) <= 40:  # characters of a list in a message
        return text
    return f"{len(value)} values"


def _text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.12g}"
    return str(value)


def discard(kind: str, directory: str | Path) -> None:
    """Remove the files of the table `kind` in a directory, if there are any; `refuse_other_spec` has checked their spec."""
    for path in (Path(directory) / name for name in reversed(names_of(kind))):
        if is_folder(path):
            rmtree(path)
        else:
            path.unlink(missing_ok=True)


def remove_unfinished(kind: str, directory: Path) -> None:
    """Remove the folders in which interrupted runs wrote the table, as far as that is possible now."""
    for folder in directory.glob(f".{kind}.new-*"):
        if re.fullmatch("[0-9a-f]{12}", folder.name.rpartition("-")[2]) and is_folder(folder):
            rmtree(folder, ignore_errors=True)


def refuse_folders(kind: str, directory: Path) -> None:
    """Raise UsageError for a folder in the place of a file of the table that holds anything but what this program writes."""
    for place in (directory / name for name in names_of(kind)):
        if place.name == BEST and os.path.lexists(place):
            ours = _holds_only(DESIGNS, place) and all(
                read_file(path).startswith(HEADER.encode()) for path in place.iterdir()
            )
            if not ours:
                raise UsageError(
                    f"{place}: expected designs of this program or none, found others; move it away"
                )
        elif is_folder(place):
            raise UsageError(
                f"{place}: expected a file of results or none, found a folder; move it away"
            )


def _holds_only(pattern: str, folder: Path) -> bool:
    """Whether a path is a folder that holds files of such names and nothing else."""
    return is_folder(folder) and all(
        re.fullmatch(pattern, path.name) and path.is_file() and not path.is_symlink()
        for path in folder.iterdir()
    )


def refuse_unusable(directory: str | Path) -> None:
    """Raise UsageError if `directory`, the folder for the results, is a file, or cannot be made or written to."""
    place = Path(directory).absolute()
    try:
        _refuse_unusable(directory, place)
    except OSError as error:
        raise UsageError(
            f"{directory}: {error.strerror}; name another folder for the results with --out"
        ) from error


def _refuse_unusable(directory: str | Path, place: Path) -> None:
    if long := [segment for segment in place.parts if len(os.fsencode(segment)) > LONGEST_NAME]:
        raise UsageError(
            f"the folder {long[0][:40]}...: expected a name of at most {LONGEST_NAME} bytes; name another with --out"
        )
    while not place.exists() and place != place.parent:
        if place.is_symlink():
            raise UsageError(
                f"{directory}: {place} is a link to nothing; remove it, or name another folder for the results"
            )
        place = place.parent
    if not place.is_dir():
        raise UsageError(f"{directory}: {place} is a file; name another folder for the results")
    if not os.access(place, os.W_OK | os.X_OK):
        raise UsageError(
            f"{directory}: {place} may not be written to; name another folder for the results"
        )
