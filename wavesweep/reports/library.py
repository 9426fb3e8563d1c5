"""The report, as a call."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from wavesweep.core.api import Source, spec_of
from wavesweep.core.atomic_files import write_file
from wavesweep.reports import content


def report(source: Source, path: str | Path | None = None, cut: str = "", for_hands: str | Iterable[str] = ()) -> str:
    """The report of `source` as `wavesweep report` writes it: the text of an HTML file, which is written to `path` too.

    source: a spec, a path, or nested tables. path: of the file; an earlier one is replaced. cut: the signal for the margins,
    "block.port"; by default the one that acts on the plant. for_hands: words for guarantees, as for `zwidth`. What the spec
    does not allow is named in the report. Errors: UsageError for other words, OSError for a file that cannot be written.
    """
    hands = (for_hands,) if isinstance(for_hands, str) else tuple(for_hands)
    text = content.report(spec_of(source), content.Request(cut, hands))
    if path is not None:
        write_file(Path(path), text.encode())
    return text
