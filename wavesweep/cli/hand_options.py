"""The options that say whose hand holds the device, for the commands that find stable intervals."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from wavesweep.sweep.guarantees import Holders

_RANGE = re.compile(r"\s*(mass|damping|stiffness)\s*=\s*([^.\s]\S*?)\s*\.\.\s*(\S+)\s*")

_OPTIONS = (
    click.option(
        "--hand",
        type=click.Choice(["free", "passive", "box"]),
        default="free",
        show_default=True,
        help=(
            "Whose hand holds the device. passive: add what is guaranteed for every passive hand, of any mass and "
            "stiffness, also one that moves within a tick; the damping of the device has to pay for it, and waves without "
            "Kp never get there. box: add what is stable for every hand of a box; settled says 1 where that is proved, but "
            "for a thousandth of the interval at its ends, 0 where it is only searched. "
            "What is not certified has certified 0."
        ),
    ),
    click.option(
        "--hand-box",
        "hand_box",
        metavar="RANGES",
        help=(
            "With --hand box, e.g. mass=0.1..0.4,damping=2..5 (kg, N*s/m; stiffness in N/m). What is not named: "
            "mass 0.005..0.6, damping 2..10, stiffness 100..1000, from a fingertip to an arm."
        ),
    ),
    click.option(
        "--passive",
        is_flag=True,
        help="Add where the hand's port is passive for forces held over a tick. Takes tenths of a second per slice.",
    ),
)


def hands(body: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options; its body receives them together as `holders`, None where the free device is all."""

    @wraps(body)
    def gathered(hand: str, hand_box: str | None, passive: bool, **given: Any) -> None:
        body(holders=_holders(hand, hand_box, passive), **given)

    for option in reversed(_OPTIONS):
        gathered = option(gathered)
    return gathered


def _holders(hand: str, hand_box: str | None, passive: bool) -> Holders | None:
    if hand_box is not None and hand != "box":
        raise click.UsageError(f"--hand-box needs --hand box, found --hand {hand}")
    ranges = _ranges(hand_box) if hand_box is not None else {}
    if hand == "free" and not passive:
        return None
    from wavesweep.sweep import holders_of

    return holders_of(hand, ranges, passive)


def _ranges(text: str) -> dict[str, tuple[float, float]]:
    """Read `mass=0.1..0.5,damping=1..2`; a part that is not named keeps its default."""
    found: dict[str, tuple[float, float]] = {}
    for part in text.split(","):
        matched = _RANGE.fullmatch(part)
        try:
            name, low, high = matched.groups() if matched else ("", "", "")
            found[name] = (float(low), float(high))
        except ValueError:
            raise click.BadParameter(
                f"expected ranges such as mass=0.1..0.5 (mass, damping, stiffness), found {part.strip()!r}",
                param_hint="--hand-box",
            ) from None
    return found
