"""What [sweep] requires of every mode, in place of stability alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass

from wavesweep.errors import Mistake, SpecError
from wavesweep.spec.checking import show
from wavesweep.spec.keys import REQUIRE_KEYS
from wavesweep.spec.reading import Leaf, Place
from wavesweep.spec.resolving import check_each

SETTLED = 0.02  # of its size, what is left of a mode after the time that it settles in
TABLE = "sweep.require"
BOUNDED = "of a loop that conserves energy, [sweep] require = { bounded = true } finds where nothing grows"
KNOWN = ", ".join(path.rpartition(".")[2] for path in REQUIRE_KEYS)


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
        found, mistakes = build_require(
            {name: Leaf(value, Place()) for name, value in numbers.items()} or {"": Leaf({}, Place())}
        )
        if mistakes:
            raise SpecError(mistakes)
        return found

    def written(self) -> dict[str, float]:
        """Return the table as a spec could give it."""
        return {name: value for name, value in asdict(self).items() if value}


def build_require(leaves: Mapping[str, Leaf]) -> tuple[Require | None, list[Mistake]]:
    """Return the requirement and its mistakes; leaves: by name, "" if it is no table of keys; none: nothing is required."""
    mistakes = list(_unknown(leaves))
    found, wrong = check_each(REQUIRE_KEYS, {f"{TABLE}.{name}": leaf for name, leaf in leaves.items() if _is_known(name)})
    numbers = {path.rpartition(".")[2]: value for path, value in found.items()}
    if numbers.get("bounded") and len(numbers) > 1:
        wrong.append(leaves["bounded"].mistake(f"{TABLE}.bounded", "true alone", "others beside it"))
    return Require(**numbers) if any(numbers.values()) else None, mistakes + wrong


def _is_known(name):
    return f"{TABLE}.{name}" in REQUIRE_KEYS


def _unknown(leaves) -> Iterator[Mistake]:
    for name, leaf in leaves.items():
        if not name:
            found = "an empty table" if leaf.value == {} else show(leaf.value)
            yield leaf.mistake(TABLE, f"a table with some of {KNOWN}", found)
        elif not _is_known(name):
            yield leaf.mistake(f"{TABLE}.{name}", f"one of {KNOWN}", "an unknown key", of_key=True)


def words_of(written: Mapping[str, float]) -> str:
    """What is required, in words; written: see `Require.written`."""
    parts = []
    if "radius" in written:
        parts.append(f"within {written['radius']:g} per frame")
    if "settling" in written:
        parts.append(f"down to {100 * SETTLED:g} % in {written['settling']:g} s")
    if "damping_ratio" in written:
        parts.append(f"of a damping ratio of at least {written['damping_ratio']:g}")
    if "bounded" in written:
        parts.append("on the unit circle")
    return f"every mode {' and '.join(parts)}"
