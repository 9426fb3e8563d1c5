"""What a search for designs asks of [for_all]: whether loops are proved for all of it, and how
they rank before that."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.drawing import name_of
from wavesweep.engine.rows import distinct
from wavesweep.engine.switched import least_refuted, seems_refuted
from wavesweep.for_all.rows import (
    ForAllGuarantee,
    cases_of,
    proved_from_zero,
    refuse_unsuitable_ranges,
    share_from_zero,
    verdict,
)
from wavesweep.for_all.varying import Rules
from wavesweep.program.analyses.claims import Claim
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import is_plain, loops_of


@dataclass(frozen=True, slots=True)
class DesignProof:
    """Proves designs for all numbers of [for_all]."""

    rules: Rules

    @staticmethod
    def of(spec: Spec) -> "DesignProof":
        """The proof of the designs of a spec."""
        return DesignProof(replace(Rules.of(spec), words=defaultdict(list)))

    @property
    def vary(self) -> bool:
        """Whether frames vary."""
        return self.rules.vary

    @property
    def from_share(self) -> float:
        """From which share of the stiffest wall on walls are proved."""
        return share_from_zero(self.rules)

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

    def stiffest(
        self,
        specs: Sequence[Spec],
        path: str,
        stop: float,
        limits: np.ndarray,
        designs: np.ndarray | None = None,
    ) -> np.ndarray:
        """The stiffest wall of each, at most `stop`, up to which every loop is proved to be stable.

        path: of its stiffness. limits, designs: see `DesignRanking`.
        """
        del limits, designs
        proved = []
        for number, spec in enumerate(specs, 1):
            rules = replace(self.rules, said=f"design {number} of {len(specs)}: ")
            proved.append(proved_from_zero(spec, path, stop, rules))
        return np.array(proved)


@dataclass(frozen=True, slots=True)
class DesignRanking(DesignProof):
    """Ranks designs whose frames vary by what short patterns of frames refute, at the spec's own
    values of ranges."""

    def verdict(self, spec: Spec) -> str:
        """Whether the loop of a design is "refuted"; otherwise it counts as "proved"."""
        for families in self._families([spec], ""):
            for family in families:
                if seems_refuted(family, 0.0, self.rules.words[family.follows.tobytes()]):
                    return "refuted"
        return "proved"

    def stiffest(
        self,
        specs: Sequence[Spec],
        path: str,
        stop: float,
        limits: np.ndarray,
        designs: np.ndarray | None = None,
    ) -> np.ndarray:
        """The softest wall of each with which some short pattern of frames is unstable, or else its
        limit.

        path: of the stiffness; stop: its end, which is not asked here. limits: of each the stiffest wall that is stable at constant frames.
        designs: of which design each is, if the best one alone matters; those of others are then
        bounds from above.
        """
        del stop
        families = self._families(specs, path)
        return least_refuted(families, limits, designs, self.rules.words)

    def _families(self, specs, along):
        """The frames of each, for every combination of the numbers that have values; none of what
        drifts, which never decays."""
        first = specs[0]
        timing = loops_of(first, first.values, along).drawing.timing
        columns = {}
        for path, value in first.values.items():
            if any(spec.values[path] != value for spec in specs):
                columns[path] = np.array([spec.values[path] for spec in specs])
        alone = {path for path in columns if name_of(path) in timing or not is_plain(first, path)}
        labels = [column if path in alone else column == 0 for path, column in columns.items()]
        families = [[] for _ in specs]
        for members in distinct(labels, len(specs)):
            spec = specs[members[0]]
            several = {path: columns[path][members] for path in columns.keys() - alone}
            loops = loops_of(spec, dict(spec.values), along)
            for case in cases_of(self.rules, along, (0.0, 0.0), loops):
                of_members = self.rules.families(case.values, along, several, members.size)
                for member, family in zip(members, of_members, strict=True):
                    if family.drift is None:
                        families[member].append(family)
        return families
