"""A sample of `python -m tests.stress`, of every family: no certified row is wrong, nothing crashes, no warning."""

import pytest

pytest.importorskip("flint", reason="python-flint is the witness")
from stress.command import NAMES, verdicts

MANY = {  # of the slow ones; else 20
    "climbs": 1, "hands": 3, "numbers": 3, "constructed": 6, "long_filters": 6, "windows": 6, "wild": 12,
}  # fmt: skip


@pytest.mark.parametrize("family", NAMES)
def test_certified_rows_are_right(family):
    """Ends to 1e-9 (1e-6 where rounding of the loop alone moves them), counts exactly; and most rows are certified."""
    found = [(seed, v) for seed in range(MANY.get(family, 20)) for v in verdicts(family, seed)]
    assert [(seed, v) for seed, v in found if v.certified and v.kind not in {"right", "loose"}] == []
    assert sum(v.certified for _, v in found) > 0.4 * len(found)
