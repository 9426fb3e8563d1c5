"""What a call of the library shows of its work while it is done."""

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Progress = Callable[[int, int, int | None], None]


@contextmanager
def reporting(progress: Progress | bool | None) -> Iterator[Progress | None]:
    """Yield what takes the reports of a run, see `Work`: for True a bar of tqdm or, where it is not
    installed, one of a terminal on stderr."""
    if progress is not True:
        yield progress or None
        return
    try:
        from tqdm.auto import tqdm
    except ImportError:
        import click

        with click.progressbar(length=1, file=sys.stderr, show_pos=True) as terminal_bar:

            def report(done: int, total: int, _: int | None = None) -> None:
                terminal_bar.length = total
                terminal_bar.update(done - terminal_bar.pos)

            yield report
        return
    with tqdm(unit="slice") as bar:
        proof_notes = _ProofNotes(bar)
        logger = logging.getLogger("wavesweep.proof")
        level = logger.level
        logger.addHandler(proof_notes)
        logger.setLevel(logging.INFO)
        try:
            yield _moving(bar)
        finally:
            logger.removeHandler(proof_notes)
            logger.setLevel(level)


class _ProofNotes(logging.Handler):
    """Shows beside a bar how far the slice is proved that is computed now."""

    def __init__(self, bar: Any) -> None:
        super().__init__()
        self._bar = bar

    def emit(self, record: logging.LogRecord) -> None:
        self._bar.set_postfix_str(record.getMessage())


def _moving(bar: Any) -> Progress:
    """What moves a bar of tqdm with each report."""

    def report(done: int, total: int, certified: int | None = None) -> None:
        bar.total = total
        if certified is not None:
            bar.set_postfix_str(f"{certified:,} certified", refresh=False)
        bar.update(done - bar.n)

    return report
