"""What a search for designs asks of [for_all]: whether loops are proved for all of it, and how
they rank before that."""

from collections import defaultdict
from dataclasses import dataclass, replace

from wavesweep.for_all.patterns import seems_refuted, seems_refuted_from
from wavesweep.for_all.rows import (
    ForAllGuarantee,
    cases_of,
    proved_from_zero,
    refuse_unsuitable_ranges,
    verdict,
)
from wavesweep.for_all.varying import Rules
from wavesweep.program.analyses.claims import Claim
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import loops_of


@dataclass(frozen=True, slots=True)
class DesignProof:
    """Proves designs for all numbers of [for_all], and for the values of [design.for_all]."""

    rules: Rules

    @staticmethod
    def of(spec: Spec) -> "DesignProof":
        """The proof of the designs of a spec."""
        rules = Rules.of(spec)
        for_all = rules.for_all.beside(spec.design)
        return DesignProof(replace(rules, for_all=for_all, words=defaultdict(list)))

    @property
    def vary(self) -> bool:
        """Whether frames vary."""
        return self.rules.vary

    def refuse_unsuitable(self, spec: Spec, along: str) -> None:
        """Raise UsageError for numbers that designs cannot be proved for; along: of walls, empty
        without these."""
        refuse_unsuitable_ranges(spec, along)

    def claim(self, spec: Spec) -> Claim:
        """What is proved of designs, and of which loops."""
        return ForAllGuarantee(self.rules).claim(spec)

    def verdict(self, spec: Spec) -> str:
        """Whether the loop of a design is "proved" or "refuted"; otherwise it is not known."""
        return verdict(spec, self.rules)["verdict"]

    def stiffest(self, spec: Spec, path: str, stop: float) -> float:
        """The stiffest wall, at most `stop`, up to which every loop of a design is proved to be
        stable."""
        return proved_from_zero(spec, path, stop, self.rules)


@dataclass(frozen=True, slots=True)
class DesignRanking(DesignProof):
    """Ranks designs whose frames vary by what short patterns of frames refute, at the spec's own
    values of ranges."""

    def verdict(self, spec: Spec) -> str:
        """Whether the loop of a design is "refuted"; otherwise it counts as "proved"."""
        if any(
            seems_refuted(family, 0.0, self._known(family)) for family in self._families(spec, "")
        ):
            return "refuted"
        return "proved"

    def stiffest(self, spec: Spec, path: str, stop: float) -> float:
        """The softest wall, at most `stop`, with which some short pattern of frames is unstable."""
        return min(
            (
                seems_refuted_from(family, stop, self._known(family))
                for family in self._families(spec, path)
            ),
            default=stop,
        )

    def _known(self, family):
        return self.rules.words[family.follows.tobytes()]

    def _families(self, spec, along):
        cases = cases_of(self.rules, along, (0.0, 0.0), loops_of(spec, dict(spec.values), along))
        families = (self.rules.family(case.values, along) for case in cases)
        return [
            family for family in families if family.drift is None
        ]  # one that drifts never decays
