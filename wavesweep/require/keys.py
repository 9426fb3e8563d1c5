"""What [sweep] requires of every mode, in place of stability alone."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import inf
from typing import TYPE_CHECKING, Any

from wavesweep.core.errors import UsageError
from wavesweep.core.reading.checking import show
from wavesweep.core.reading.keys import Key, by_path, number, positive
from wavesweep.core.reading.tables import Asked, Table

if TYPE_CHECKING:
    from wavesweep.core.spec.schema import Shapes
    from wavesweep.core.spec.studies import Request
    from wavesweep.require.bound import Bound

SETTLED = 0.02  # share of its size to which a mode has decayed when it has settled
PATH = "sweep.require"
KEYS = by_path(
    [
        number(
            "sweep.require.radius",
            None,
            "1",
            "find the intervals in which no eigenvalue of a frame is larger than this, in place of the stable ones",
            low=1e-6,
            high=0.999999,
        ),
        positive(
            "sweep.require.settling",
            None,
            "s",
            "find the intervals in which every mode falls to 2 % of its size in this time, which is 3.912 time constants",
            high=1e6,
        ),
        number(
            "sweep.require.damping_ratio",
            None,
            "1",
            "find the intervals in which every mode has this damping ratio or more, by the principal logarithm of its "
            "eigenvalue",
            low=0.001,
            high=0.999,
        ),
        Key(
            "sweep.require.bounded",
            "boolean",
            None,
            "",
            "for a loop that conserves energy: find the intervals in which no mode grows; all are on the unit circle, "
            "no two equal",
        ),
    ]
)
KEYS_BY_NAME = {path.rpartition(".")[2]: key for path, key in KEYS.items()}


@dataclass(frozen=True, slots=True)
class Require(Asked):
    """The bounds on every mode: its eigenvalue of a frame, the time (s) in which it is down to SETTLED, its damping ratio.

    bounded: whether the modes of a loop that conserves have to stay on the unit circle, in place of all of these.
    """

    radius: float | None = None
    settling: float | None = None
    damping_ratio: float | None = None
    bounded: bool = False

    def written(self) -> dict[str, float]:
        """Return the table as a spec could give it."""
        return {name: value for name, value in asdict(self).items() if value}

    def refuse_stability_alone(self, name: str, what: str) -> None:
        """Raise UsageError, since more is required; see `Asked`."""
        expected = f"no [sweep] require with {what}, which is about stability alone"
        raise UsageError(
            f"{name}: expected {expected} (--set sweep.require= leaves it out; columns low_hz and high_hz of "
            "stability-region name the mode at each end), found one"
        )

    @property
    def bound(self) -> Bound:
        """The same for the search: bounds on the eigenvalues of the frames of a drawing."""
        from wavesweep.require.bound import Bound

        return Bound(self.radius or 1.0, self.settling or inf, self.damping_ratio or 0.0, self.bounded)


def build(request: Request) -> Require | None:
    """Return the requirement and add its mistakes; None if nothing is required."""
    leaves, mistakes = request.belongs.below(PATH), request.mistakes
    if (table := leaves.get("")) is not None:
        found = "an empty table" if table.value == {} else show(table.value)
        return mistakes.refuse(table, PATH, f"a table with some of {', '.join(KEYS_BY_NAME)}", found, of_key=False)
    numbers = mistakes.read(KEYS_BY_NAME, leaves, PATH)
    if numbers.get("bounded") and len(numbers) > 1:
        mistakes.refuse(leaves["bounded"], f"{PATH}.bounded", "true alone", "other requirements as well", of_key=False)
    return Require(**numbers) if any(numbers.values()) else None


def schema(shapes: Shapes) -> dict[str, Any]:
    """Return the JSON Schema of the table."""
    return shapes.table({name: shapes.value(key) for name, key in KEYS_BY_NAME.items()})


TABLE = Table(path=PATH, build=build, keys=KEYS, always=True, schema=schema)
