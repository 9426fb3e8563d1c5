"""The verdict on a spec's own design: its own numbers, and what each capability says of it."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from wavesweep.capabilities import asked
from wavesweep.core.analyses.own_design import is_favourable, own_design
from wavesweep.core.spec import Spec

Facts = Mapping[str, Any]
Ranked = tuple[float, str]


def verdict(spec: Spec) -> dict:
    """The verdict on the spec's own design as a JSON-able dict; a missing number is None.

    The numbers of `own_design`, and those of `further`.
    """
    own = own_design(spec)
    return own | further(spec, own)


@np.errstate(all="ignore")  # of numbers that overflow
def further(spec: Spec, own: dict, report: Callable[[int, int], None] | None = None) -> dict:
    """What capabilities say in addition to the numbers of `own_design`.

    report: is called with the number of ranges that are done, and of all.
    """
    return {name: fact for facts in asked("on_check", "facts", spec, own, report) for name, fact in facts.items()}


def verdict_lines(spec: Spec, found: Facts) -> Iterator[Ranked]:
    """Yield what the verdict says beside `own_lines`, each line with its rank, see `on_check`."""
    for lines in asked("on_check", "lines", spec, found):
        yield from ((rank, f"  {line}") for rank, line in lines)
    if found["assumes"] and not is_favourable(found):
        yield 0 if spec.for_all else 4, f"  assumes: {found['assumes']}"
