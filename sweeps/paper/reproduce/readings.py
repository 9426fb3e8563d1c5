"""Readings: ways to fill the gaps of the paper; each statement is tried under all of them that its loops read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations

OWN = "the spec's own values"  # those of fig6.toml: what is inferred there is marked


@dataclass(frozen=True)
class Choice:
    """One key of a spec with another value than in the specs, and its name in texts."""

    path: str
    value: float | int | str
    words: str


@dataclass(frozen=True)
class Reading:
    """One way to fill the gaps of the paper: the choices that differ from the spec's own values."""

    choices: tuple[Choice, ...] = ()

    @property
    def label(self) -> str:
        """Its name."""
        return " + ".join(choice.words for choice in self.choices) or OWN

    @property
    def changes(self) -> Mapping[str, float | int | str]:
        """Give path -> value of its changes."""
        return {choice.path: choice.value for choice in self.choices}

    @property
    def overrides(self) -> tuple[str, ...]:
        """Give the same as for `--set`."""
        return tuple(f'{c.path}="{c.value}"' if isinstance(c.value, str) else f"{c.path}={c.value}" for c in self.choices)

    @property
    def size(self) -> int:
        """Number of choices that it changes."""
        return len(self.choices)

    def contains(self, other: Reading) -> bool:
        """Whether it makes all choices of the other one and at least one more."""
        return self.size > other.size and set(other.choices) <= set(self.choices)


def _numbers(path: str, words: str, *values: float) -> tuple[Choice, ...]:
    return tuple(Choice(path, value, words.format(value)) for value in values)


CHOICES = (
    Choice("environment.integration", "explicit", "explicit wall"),
    Choice("environment.integration", "trapezoidal", "trapezoidal wall"),
    *_numbers("environment.delay", "wall's delay {}", 1, 20),
    Choice("device.velocity", "difference", "difference velocity"),
    *_numbers("filters.lp1.order", "LP1 of order {}", 2, 4),
    # 8.57 Hz is that of fig4-b25.toml: with an explicit wall it gives Figure 4's 800 N/m at the b of the other figures.
    *_numbers("filters.lp1.cutoff_hz", "LP1 at {:g} Hz", 5.0, 8.57, 20.0),
    *_numbers("filters.hp.order", "HP of order {}", 2, 4),
    *_numbers("filters.hp.cutoff_hz", "HP at {:g} Hz", 5.0, 20.0, 40.0),
    *_numbers("filters.lp2.order", "LP2 of order {}", 1, 4),
    *_numbers("filters.lp2.cutoff_hz", "LP2 at {:g} Hz", 10.0, 40.0, 80.0, 160.0),
    Choice("local_model.integration", "explicit", "explicit local model"),
    Choice("local_model.integration", "trapezoidal", "trapezoidal local model"),
    Choice("local_model.delay", 0, "local model without delay"),
)
"""Values around the specs' own for the gaps of the paper, whose Table 1 is lost."""

NO_HOLD = Choice("rates.ratio", 1, "wall at the fast rate (no hold)")
IMPEDANCES_OF_FIGURE_4 = _numbers("controller.b", "b = {:g}", 10.0, 40.0)  # the paper gives b for Figures 5 to 8 only
STIFFER_MODELS = _numbers("local_model.K_LM", "K_LM = {:g} N/m", 1000.0, 3000.0)  # Figure 5 goes to 3000
# A low-pass "with cutoff frequency less than half the update frequency", which is 25 Hz.
ANTI_ALIASING = (
    *_numbers("filters.lp1.order", "LP1 of order {}", 2, 4, 8, 12),
    *_numbers("filters.lp1.cutoff_hz", "LP1 at {:g} Hz", 1.0, 5.0, 20.0, 24.0),
)


def under(*beginnings: str) -> tuple[Choice, ...]:
    """Give the choices whose paths begin so."""
    return tuple(choice for choice in CHOICES if choice.path.startswith(beginnings))


def readings(choices: Iterable[Choice], most: int = 2) -> tuple[Reading, ...]:
    """Give the spec's own values and all changes of up to `most` choices, those of few first."""
    choices = tuple(choices)
    sets = (each for size in range(most + 1) for each in combinations(choices, size))
    return tuple(Reading(each) for each in sets if len({choice.path for choice in each}) == len(each))


DIRECT = readings(under("device."))
SLOW = readings(under("device.", "environment.delay"))
# Of virtual coupling [3] the paper gives no number.
COUPLINGS = (
    *_numbers("controller.K_VC", "coupling of {:g} N/m", 300.0, 3000.0),
    *_numbers("controller.B_VC", "coupling of {:g} N*s/m", 2.0, 20.0),
)
COUPLED = readings((*under("device.", "environment."), *COUPLINGS))
PMW = readings(under("device.", "environment.", "filters.lp1."))
PMW_LM = readings(CHOICES)
FILTERS = readings(under("filters."))
