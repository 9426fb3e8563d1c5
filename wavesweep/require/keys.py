"""What [sweep] requires of every mode, in place of stability alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import inf
from typing import TYPE_CHECKING

from wavesweep.core.errors import SpecError
from wavesweep.core.reading.checking import Mistakes, show
from wavesweep.core.reading.keys import REQUIRE_KEYS
from wavesweep.core.reading.reading import Leaf, Place

if TYPE_CHECKING:
    from wavesweep.require.bound import Bound

SETTLED = 0.02  # share of its size to which a mode has decayed when it has settled
TABLE = "sweep.require"
KEYS_BY_NAME = {path.rpartition(".")[2]: key for path, key in REQUIRE_KEYS.items()}


@dataclass(frozen=True, slots=True)
class Require:
    """The bounds on every mode: its eigenvalue of a frame, the time (s) in which it is down to SETTLED, its damping ratio.

    bounded: whether the modes of a loop that conserves have to stay on the unit circle, in place of all of these.
    """

    radius: float | None = None
    settling: float | None = None
    damping_ratio: float | None = None
    bounded: bool = False

    @classmethod
    def of(cls, numbers: Mapping[str, object]) -> Require:
        """The requirement given by name. Errors: SpecError with every mistake."""
        mistakes = Mistakes()
        leaves = {name: Leaf(value, Place()) for name, value in (numbers or {"": {}}).items()}
        require = build_require(leaves, mistakes)
        if mistakes:
            raise SpecError(mistakes)
        return require

    def written(self) -> dict[str, float]:
        """Return the table as a spec could give it."""
        return {name: value for name, value in asdict(self).items() if value}

    @property
    def bound(self) -> Bound:
        """The same for the search: bounds on the eigenvalues of the frames of a drawing."""
        from wavesweep.require.bound import Bound

        return Bound(self.radius or 1.0, self.settling or inf, self.damping_ratio or 0.0, self.bounded)


def build_require(leaves: Mapping[str, Leaf], mistakes: Mistakes) -> Require | None:
    """Return the requirement and add its mistakes; None if nothing is required.

    leaves: by name, "" if it is not a table of keys.
    """
    if (whole := leaves.get("")) is not None:
        found = "an empty table" if whole.value == {} else show(whole.value)
        return mistakes.refuse(whole, TABLE, f"a table with some of {', '.join(KEYS_BY_NAME)}", found, of_key=False)
    numbers = mistakes.read(KEYS_BY_NAME, leaves, TABLE)
    if numbers.get("bounded") and len(numbers) > 1:
        mistakes.refuse(leaves["bounded"], f"{TABLE}.bounded", "true alone", "other requirements as well", of_key=False)
    return Require(**numbers) if any(numbers.values()) else None
