"""Section 3.1, Figures 4 and 5: the stiffest wall, and the effects of local model and Kp on it."""

from __future__ import annotations

from collections.abc import Sequence

from reproduce.felt_responses import show, show_limits
from reproduce.paper_loops import PaperLoops
from reproduce.readings import (
    CHOICES,
    IMPEDANCES_OF_FIGURE_4,
    PMW_LM,
    SLOW,
    STIFFER_MODELS,
    readings,
    under,
)
from reproduce.statements.introduction import WITH_MODEL
from reproduce.verdicts import Answer, Finding, Statement, over

TOLERANCE = 0.01  # of the 800 N/m, which are read off a figure
LITTLE = 1.1  # "little impact" is taken to mean that the largest and the smallest limit are within 10 %
STIFFNESSES = [{"K_LM": K} for K in (0, 500, 1000, 2000, 3000)]
GAINS = [{"Kp": Kp} for Kp in (0, 10, 20, 40)]
WITHOUT_LP2 = {"filters.lp2.order": 0}
ALL_OF_PMW = readings((*under("device.", "environment.", "filters.lp1."), *IMPEDANCES_OF_FIGURE_4), 6)
WITH_STIFFER_MODELS = readings((*CHOICES, *STIFFER_MODELS))
DAMPINGS = [{"B_VE": B} for B in (1, 5, 10, 15)]


def renders_800(paper: PaperLoops) -> Finding:
    """Upper end of the stable K_VE that begin at 0, B_VE = 1, against 800 N/m, to 1 %, under all combinations of the
    choices for PMW and of b, which the paper does not give for Figure 4; fig4.toml and fig4-b25.toml are among them."""

    def check(found: list) -> Answer:
        (spans,) = found
        begins = [high for low, high in spans if low == 0]
        named = " and ".join(f"({show(low, 4)}, {show(high, 4)})" for low, high in spans)
        return Answer(bool(begins) and _is_800(begins[0]), f"stable K_VE in {named} N/m")

    return over(ALL_OF_PMW, check, paper.stable_families("pmw", ALL_OF_PMW, [{}]))


def fills_figure_4(paper: PaperLoops) -> Finding:
    """Stiffest stable walls at B_VE = 1, 5, 10, 15 N s/m under the same combinations: whether the first is within 1 % of
    800 N/m, and the largest within the axis and beyond its half."""
    found = paper.limit_families("pmw", ALL_OF_PMW, DAMPINGS)
    shown = [limits for limits in found if _is_800(limits[0])]
    ends = f"the {len(shown)} with 800 N/m end at {show(sorted(limits[-1] for limits in shown), 4)} N/m for B_VE = 15"

    def check(limits: list[float]) -> Answer:
        return Answer(_is_800(limits[0]) and 1000 < max(limits) <= 2000, f"{show_limits(limits)}; {ends}")

    return over(ALL_OF_PMW, check, found)


def fills_figure_5(paper: PaperLoops) -> Finding:
    """Stiffest stable walls for five K_LM from 0 to 3000 N/m and four Kp from 0 to 40: whether the largest is within an axis
    to 3000 N/m and beyond its half. A region without limit has no boundary to draw. The numbers say under how many of
    these readings K_LM, or Kp, matters little as well."""
    found = [paper.limit_families("fig6", PMW_LM, each) for each in (STIFFNESSES, GAINS)]
    largest = [max(*stiffnesses, *gains) for stiffnesses, gains in zip(*found, strict=True)]
    little = [
        sum(_spread(limits, "").holds for limits, top in zip(family, largest, strict=True) if _fills(top)) for family in found
    ]
    words = [show_limits(top) for top in largest]
    words[0] += f"; of those that end within it K_LM matters little under {little[0]}, Kp under {little[1]}"
    return over(PMW_LM, lambda top, said: Answer(_fills(top), said), largest, words)


def _fills(largest: float) -> bool:
    return 1500 < largest <= 3000


def local_stiffness_matters_little(paper: PaperLoops) -> Finding:
    """Stiffest stable wall for K_LM = 0, 500, 1000, 2000 and 3000 N/m, Kp = 20: whether its extremes are within 10 % of each
    other. Between these values it may be lower."""
    return over(PMW_LM, lambda found: _spread(found, "K_LM"), paper.limit_families("fig6", PMW_LM, STIFFNESSES))


def gain_matters_little(paper: PaperLoops) -> Finding:
    """Stiffest stable wall for Kp = 0, 10, 20 and 40, K_LM = 500 N/m: whether its extremes are within 10 % of each other."""
    return over(PMW_LM, lambda found: _spread(found, "Kp"), paper.limit_families("fig6", PMW_LM, GAINS))


def power_domain_parameters_matter(paper: PaperLoops) -> Finding:
    """Stiffest stable wall of the power-domain local model for K_LM from 0 to 1000 N/m: whether its extremes differ by
    more than 10 %."""

    def check(limits: list[float]) -> Answer:
        answer = _spread(limits, "K_LM")
        return Answer(not answer.holds, answer.numbers)

    return over(SLOW, check, paper.limit_families("dc", SLOW, [{**WITH_MODEL, "K_LM": K} for K in (0, 500, 1000)]))


def bank_improves_stability(paper: PaperLoops) -> Finding:
    """Stiffest stable wall with filter bank, local model and Kp, against that without them (b = 25, Kp = 20; K_LM =
    500, and up to 3000 N/m as in Figure 5)."""

    def check(found: float, without: float) -> Answer:
        return Answer(found > without, f"{show_limits(found)}; without them {show_limits(without)}")

    tried = WITH_STIFFER_MODELS
    return over(tried, check, paper.limits("fig6", tried), paper.limits("pmw", tried))


def improvement_is_lp2s(paper: PaperLoops) -> Finding:
    """Stiffest stable wall with LP2, without LP2, and without the local model: whether only LP2 makes it an
    improvement. Readings as before."""

    def check(found: float, without: float, plain: float) -> Answer:
        numbers = f"{show_limits(found)}; without LP2 {show_limits(without)}; without local model {show_limits(plain)}"
        return Answer(found > plain >= without, numbers)

    tried = WITH_STIFFER_MODELS
    limits = (paper.limits("fig6", tried), paper.limits("fig6", tried, WITHOUT_LP2), paper.limits("pmw", tried))
    return over(tried, check, *limits)


def lp2_is_needed(paper: PaperLoops) -> Finding:
    """Stiffest stable wall of Figure 6's loop with LP2 and without: whether LP2 raises it."""

    def check(found: float, without: float) -> Answer:
        return Answer(found > without, f"{show_limits(found)}; without LP2 {show_limits(without)}")

    return over(PMW_LM, check, paper.limits("fig6", PMW_LM), paper.limits("fig6", PMW_LM, WITHOUT_LP2))


def _is_800(limit: float) -> bool:
    return abs(limit - 800) <= TOLERANCE * 800


def _spread(limits: Sequence[float], along: str) -> Answer:
    low, high = min(limits), max(limits)
    holds = low == high or (low > 0 and high / low <= LITTLE)
    return Answer(holds, f"along {along} {show_limits(limits)}")


STATEMENTS = (
    Statement(
        "3.1, Fig. 4",
        "“the haptic device can stably render a maximum environment stiffness KVE = 800 N/m for an environment damping BVE = 1 "
        "Ns/m”",
        renders_800,
    ),
    Statement(
        "Fig. 4, labels",
        "The axes of Figure 4 go to K_VE = 2000 N/m and B_VE = 15 N s/m, and a boundary through those 800 N/m fits them",
        fills_figure_4,
    ),
    Statement(
        "Abstract; 1; 3; 3.1, Fig. 5; 5",
        "“the parameters of the local model have little impact on the stability of the haptic system” (K_LM)",
        local_stiffness_matters_little,
    ),
    Statement(
        "3; 3.1, Fig. 5",
        "“the gain of the term added to the returning wave Kp do not affect the stability of the haptic system”",
        gain_matters_little,
    ),
    Statement(
        "Fig. 5, labels", "An axis of Figure 5 goes to 3000: if it is K_VE's, the stable region ends within it", fills_figure_5
    ),
    Statement(
        "Abstract; 5",
        "“unlike the parameters of local models developed in the power domain”",
        power_domain_parameters_matter,
    ),
    Statement(
        "3.1, Fig. 5",
        "“passive multi rate wave control with filter bank, local model and position feedback improves the stability of the "
        "system, too”",
        bank_improves_stability,
    ),
    Statement(
        "3.1",
        "“the damping injected through the low-pass filter LP2. This filter has been introduced to reduce the wave reflections "
        "caused by the feedback loop closed through the local model of interaction.” (so that it is stable)",
        lp2_is_needed,
    ),
    Statement(
        "3.1",
        "“The improvement is largely brought about by the damping injected through the low-pass filter LP2.”",
        improvement_is_lp2s,
    ),
)
