"""Whose intervals are asked for, and as which questions: settled before anything is computed."""

from dataclasses import dataclass, replace

from wavesweep.analysis.passivity import HOLDING_A_DEVICE
from wavesweep.diagram import WALL
from wavesweep.errors import UsageError
from wavesweep.spec import Spec
from wavesweep.sweep.guarantees import Guarantee, Holders
from wavesweep.sweep.question import Question, ask, cut_otherwise

FEW = 4  # columns of a chunk: they take from tenths of a second to some seconds each
OPERATOR = ("operator.mass", "operator.damping", "operator.stiffness")


@dataclass(frozen=True, slots=True)
class Stage:
    """One kind of rows: the name in the column `hand`, and the question that they answer."""

    hand: str
    asked: Question


def holders_of(hand: str, box: dict[str, tuple[float, float]] | None, port: bool) -> Holders:
    """Who is asked for; box: the ranges that are not those of the literature. Raises UsageError for an empty range."""
    if hand != "box":
        return Holders(hand, None, port)
    try:
        return Holders(hand, replace(HOLDING_A_DEVICE, **(box or {})), port)
    except ValueError as error:
        raise UsageError(str(error)) from error


def stages_of(spec: Spec, holders: Holders, along: str | None) -> list[Stage]:
    """Settle every question before anything is computed. Raises UsageError where one cannot be answered."""
    own = ask(spec, along)
    _refuse(spec, own, holders)
    operated = any(spec.values[path] for path in OPERATOR)
    stages = [Stage("operator" if operated else "free", own)]
    if operated and holders.hand != "free":
        stages.insert(0, Stage("free", ask(spec.with_values(dict.fromkeys(OPERATOR, 0.0)), along)))
    stages += [Stage(hand, _guaranteed(own, guarantee)) for hand, guarantee in holders.guarantees().items()]
    return stages


def _guaranteed(own: Question, guarantee: Guarantee) -> Question:
    walls = own.grid.walls
    few = cut_otherwise(own, deep=max(1, FEW // walls), wide=min(FEW, walls))
    return replace(few, guarantee=guarantee, cut=None)


def _refuse(spec, own, holders):
    swept = [axis.name for axis in (*own.grid.axes, own.axis) if axis.path in OPERATOR]
    if holders.hand != "free" and swept:
        raise UsageError(f"hand {holders.hand}: every hand is looked at, so {', '.join(swept)} cannot be an axis as well")
    if holders.hand == "box" and own.axis.path != WALL[0]:
        raise UsageError(f"hand box: expected intervals along K_VE, found {own.axis.name}; the other hands go along any axis")
    if holders.hand == "passive" and spec.values["device.velocity"] != "difference":
        raise UsageError(
            'hand passive: expected device.velocity = "difference", found "exact": a point sample of the velocity can be '
            "anything at no cost in energy, so no damping answers for what its feedback does"
        )
