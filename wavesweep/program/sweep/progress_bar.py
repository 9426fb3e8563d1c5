"""What a call of the library shows of its work while it is done."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from wavesweep.engine.errors import UsageError

Progress = Callable[[int, int, int | None], None]


@contextmanager
def reporting(progress: Progress | bool | None) -> Iterator[Progress | None]:
    """Yield what takes the reports of a run, see `Work`: for True a bar of tqdm. Errors: UsageError without tqdm."""
    if progress is not True:
        yield progress or None
        return
    try:
        from tqdm.auto import tqdm
    except ImportError as error:
        raise UsageError(
            "progress=True: expected tqdm, found that it is not installed (pip install tqdm)"
        ) from error
    with tqdm(unit="slice") as bar:

        def report(done: int, total: int, certified: int | None = None) -> None:
            bar.total = total
            if certified is not None:
                bar.set_postfix_str(f"{certified:,} certified", refresh=False)
            bar.update(done - bar.n)

        yield report
