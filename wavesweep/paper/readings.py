"""The ways to read what the paper leaves open: each statement is tried under all of them."""

from __future__ import annotations

from dataclasses import dataclass

from wavesweep.spec import KEYS

OWN = "the spec's own values"  # among them an implicit wall without delay


@dataclass(frozen=True)
class Reading:
    """One way to fill what the paper leaves open: a name, and the overrides (as for `--set`) of a spec that make it."""

    label: str
    overrides: tuple[str, ...]


def set_to(label: str, *overrides: str) -> Reading:
    """Give a reading of that name."""
    return Reading(label, overrides)


def _walls() -> list[Reading]:
    """Each integration of the wall with no delay, a tick's and a frame's; implicit without delay is the specs' own."""
    choices = [(word, delay) for word in KEYS["environment.integration"].choices for delay in (0, 1, 20)]
    return [
        set_to(f"{word}, delay {delay}", f'environment.integration="{word}"', f"environment.delay={delay}")
        for word, delay in choices
        if (word, delay) != ("implicit", 0)
    ]


SPEC = set_to(OWN)
DELAYS = tuple(set_to(f"delay {delay}", f"environment.delay={delay}") for delay in (0, 1, 20))
VELOCITIES = (SPEC, set_to("difference velocity", 'device.velocity="difference"'))
LP1_ORDERS = tuple(set_to(f"LP1 of order {order}", f"filters.lp1.order={order}") for order in (2, 4, 8, 12))
# The choices of fig4-b25.toml: with them Figure 4's 800 N/m come out at the b of the other figures.
FIGURE_4 = set_to(
    "choices of fig4-b25",
    'environment.integration="explicit"',
    "environment.delay=0",
    "filters.lp1.cutoff_hz=8.57",
)
READINGS = (SPEC, *_walls(), VELOCITIES[1], *LP1_ORDERS[:2], FIGURE_4)


def summary(labels) -> str:
    """Name readings in few words: an integration stands once where all of its delays are there."""
    left, said = list(labels), []
    for word in KEYS["environment.integration"].choices:
        family = [OWN if (word, delay) == ("implicit", 0) else f"{word}, delay {delay}" for delay in (0, 1, 20)]
        if word != "implicit" and all(label in left for label in family):
            left = [label for label in left if label not in family]
            said.append(f"{word} wall")
    return "; ".join([*said, *left])
