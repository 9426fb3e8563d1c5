"""The report, as a call."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from wavesweep.program.api import Source, spec_of
from wavesweep.program.atomic_files import write_file
from wavesweep.reports import content


def report(
    source: Source,
    path: str | Path | None = None,
    cut: str = "",
    for_hands: str | Iterable[str] = (),
) -> str:
    """The report of a spec, as `wavesweep report` writes it.

    Parameters
    ----------
    source : Spec, str, Path or dict
        A spec, its path, or its nested tables. What the spec does not allow is named in the report.
    path : str or Path, optional
        The file to write it to as well; an earlier one is replaced.
    cut : str, optional
        The signal for the margins, "block.port"; by default the cut of the spec's
        `require.margins`, or of a wish, else of several channels, else the one that acts on the plant.
    for_hands : str or iterable of str, optional
        Words for guarantees, as for `zwidth`.

    Returns
    -------
    str
        The text of an HTML file.

    Raises
    ------
    UsageError
        For other words.
    OSError
        For a file that cannot be written.
    """
    hands = (for_hands,) if isinstance(for_hands, str) else tuple(for_hands)
    text = content.report(spec_of(source), content.ReportRequest(cut, hands))
    if path is not None:
        write_file(Path(path), text.encode())
    return text
