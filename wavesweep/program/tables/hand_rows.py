"""The option --for-hands: intervals guaranteed for hands, of kinds that capabilities offer, beside those of the spec's loop."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from wavesweep.capabilities import HANDS, asked, modules
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.haptics.controllers import HAND
from wavesweep.program.analyses.interval_jobs import Guarantee
from wavesweep.program.row_kinds import hands_offered
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import own_loop
from wavesweep.program.sweep.job import Job

if TYPE_CHECKING:
    from wavesweep.haptics.held_loop import HeldLoop


@dataclass(frozen=True, slots=True)
class Hands:
    """Guarantees whose intervals are added to those of the spec's own loop; at most one of each kind."""

    guarantees: tuple[Guarantee, ...]

    @property
    def replaced(self) -> list[str]:
        """The guarantees for which other hands are in the place of the spec's operator."""
        return [guarantee.kind for guarantee in self.guarantees if guarantee.replaces]

    def facts(self) -> dict[str, list[str]]:
        """The guarantees as a fact of a run: words, which `hands_of` reads."""
        return {"for_hands": [guarantee.word for guarantee in self.guarantees]}

    def refuse(self, job: Job) -> None:
        """Raise UsageError if the spec's own job leaves no answer for these hands."""
        swept = [axis.name for axis in (*job.grid.axes, job.asked.axis) if axis.path in HAND]
        if self.replaced and swept:
            raise UsageError(
                f"hand {self.replaced[0]}: every hand is looked at, so {', '.join(swept)} cannot be an axis as well; "
                f"--set sweep.{swept[0]}= leaves it out"
            )
        spec = job.grid.spec
        spec.refuse_require("hands")
        if missing := spec.without_hand() if spec.drawing else None:
            raise SpecError(missing)

    def without_operator(self, spec: Spec) -> Spec | None:
        """The spec for the free device; None if it has no operator anyway."""
        operated = spec.drawing is None and any(spec.values[path] for path in HAND)
        if operated:
            return spec.with_values(dict.fromkeys(HAND, 0.0))
        return None


def guarantees_of(job: Job, hands: Hands | None) -> Iterable[Guarantee]:
    """The guarantees of a run beside the spec's own job: what capabilities make of the hands asked for, and of the spec.

    Errors: UsageError for one that cannot be had.
    """
    guarantees: Iterable[Guarantee] = hands.guarantees if hands else ()
    for module in modules("guarantee"):
        guarantees = module.of_run(job, guarantees)
    return guarantees


def _guarantee_of(kind: str, options: str | None) -> Guarantee | None:
    """The guarantee that a capability offers for a kind of hands, None if there is none. Errors: UsageError of its options."""
    try:
        return next(filter(None, asked("guarantee", "of_word", kind, options)), None)
    except ValueError as error:
        raise UsageError(str(error)) from error


def hands_of(words: str | Iterable[str]) -> Hands | None:
    """Hands from the words of `--for-hands`; None without any.

    words: those of `hands_offered`, some with more behind a colon, such as
    "box:mass=0.1..0.4,damping=2..5". Raises UsageError for another word, one that is there twice,
    or a range that is empty.
    """
    words, guarantees = (words,) if isinstance(words, str) else words, {}
    for word in words if isinstance(words, Iterable) else (words,):
        kind, colon, options = word.partition(":") if isinstance(word, str) else ("", "", "")
        guarantee = _guarantee_of(kind, options if colon else None)
        if guarantee is None and kind in HANDS and kind not in hands_offered():
            raise UsageError(
                f"hands: expected the capability {HANDS[kind]} for {kind}, found that it is not there"
            )
        if guarantee is None:
            raise UsageError(
                f"hands: expected one of {', '.join(hands_offered())}, found {word!r:.60}"
            )
        if kind in guarantees:
            raise UsageError(f"hands: expected {kind} once, found it twice")
        guarantees[kind] = guarantee
    if guarantees:
        return Hands(tuple(sorted(guarantees.values(), key=lambda guarantee: guarantee.order)))
    return None


def device_held(kind: str, job: Job) -> "HeldLoop":
    """The spec's own loop, whose device any hand can hold. Errors: UsageError if its hand does not hold one mass alone."""
    from wavesweep.haptics.held_loop import held_loop

    loop = held_loop(own_loop(job.grid.spec, job.asked.axis.path))
    if loop.device is None:
        raise UsageError(
            f"hand {kind}: expected a hand whose force acts on one block mass or inertia and on nothing else, and whose "
            "displacement is the position of that block, found another one"
        )
    return loop


def refuse_velocity(job: Job) -> None:
    """Raise UsageError if the spec's own loop reads the velocity of the device, or no passive hand can hold it."""
    loop, spec = device_held("passive", job), job.grid.spec
    if loop.reads_velocity:
        raise UsageError(
            'hand passive: expected device.velocity = "difference", found "exact": a point sample of the velocity can be '
            "anything at no cost in energy, so no damping answers for what its feedback does"
            if spec.drawing is None
            else f"hand passive: expected that nothing reads {loop.device}.v, found that something does: a point sample of "
            "the velocity can be anything at no cost in energy; take a block difference of the position"
        )
