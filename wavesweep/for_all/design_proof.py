"""What a search for designs asks of [for_all]: whether loops are proved for all of it."""

from dataclasses import dataclass, replace

from wavesweep.core.spec import Spec
from wavesweep.for_all.rows import proved_from_zero, refuse_unsuitable_ranges, verdict
from wavesweep.for_all.varying import Rules


@dataclass(frozen=True, slots=True)
class DesignProof:
    """Proves designs for all numbers of [for_all], and for the values of [design.for_all]."""

    rules: Rules

    @staticmethod
    def of(spec: Spec) -> "DesignProof":
        """The proof of the designs of a spec."""
        rules = Rules.of(spec)
        return DesignProof(replace(rules, for_all=rules.for_all.beside(spec.design)))

    @property
    def vary(self) -> bool:
        """Whether frames vary."""
        return self.rules.vary

    def refuse_unsuitable(self, spec: Spec, along: str) -> None:
        """Raise UsageError for numbers that designs cannot be proved for; along: of walls, empty without these."""
        refuse_unsuitable_ranges(spec, along)

    def verdict(self, spec: Spec) -> str:
        """Whether the loop of a design is "proved" or "refuted"; otherwise it is not known."""
        return verdict(spec, self.rules)["verdict"]

    def stiffest(self, spec: Spec, path: str, stop: float) -> float:
        """The stiffest wall, at most `stop`, up to which every loop of a design is proved to be stable."""
        return proved_from_zero(spec, path, stop, self.rules)
