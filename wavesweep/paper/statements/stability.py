"""Section 3.1, Figures 4 and 5: the stiffest wall, and what the local model and Kp do to it."""

from __future__ import annotations

from wavesweep.paper.bench import Bench
from wavesweep.paper.measures import show, show_limits
from wavesweep.paper.readings import DELAYS, FIGURE_4, OWN, READINGS, set_to
from wavesweep.paper.statements.introduction import WITH_MODEL
from wavesweep.paper.verdicts import Answer, Finding, Outcome, Statement, over

TOLERANCE = 0.01  # of the 800 N/m, which are read off a figure
LITTLE = 1.1  # "little impact" is taken to mean that the largest and the smallest limit are within 10 %
STIFFNESSES = (0, 500, 1000, 2000, 3000)
GAINS = (0, 10, 20, 40)
WITHOUT_LP2 = "filters.lp2.order=0"


def renders_800(bench: Bench) -> Finding:
    """Upper end of the stable K_VE that begin at 0, B_VE = 1, against 800 N/m, to 1 %: for both specs of Figure 4 and
    for the loop of Figure 6 without its local model."""

    def check(name: str, *reading: str) -> Answer:
        found = bench.stable(name, *reading)
        begins = [high for low, high in found if low == 0]
        spans = " and ".join(f"({show(low, 4)}, {show(high, 4)})" for low, high in found)
        return Answer(bool(begins) and abs(begins[0] - 800) <= TOLERANCE * 800, f"stable K_VE in {spans} N/m")

    one = "sweep.B_VE=[1.0]"
    figures = [Outcome(f"{name}.toml", *check(name, one)) for name in ("fig4", "fig4-b25")]
    others = [
        Outcome(f"b = 25, {r.label.replace(OWN, 'as pmw.toml')}", *check("pmw", *r.overrides))
        for r in READINGS
        if r is not FIGURE_4
    ]
    return Finding((*figures, *others))


def local_stiffness_matters_little(bench: Bench) -> Finding:
    """Stiffest stable wall for K_LM from 0 to 3000 N/m, Kp = 20: whether its extremes are within 10 % of each other."""

    def check(*reading: str) -> Answer:
        return _spread(bench.limits("fig6", f"sweep.K_LM={list(STIFFNESSES)}", *reading), "K_LM")

    return over(check)


def gain_matters_little(bench: Bench) -> Finding:
    """Stiffest stable wall for Kp from 0 to 40, K_LM = 500 N/m: whether its extremes are within 10 % of each other."""

    def check(*reading: str) -> Answer:
        return _spread(bench.limits("fig6", f"sweep.Kp={list(GAINS)}", *reading), "Kp")

    return over(check)


def power_domain_parameters_matter(bench: Bench) -> Finding:
    """Stiffest stable wall of the power-domain local model for K_LM from 0 to 1000 N/m: whether its extremes differ by
    more than 10 %."""

    def check(*reading: str) -> Answer:
        limits = [bench.limit("dc", WITH_MODEL, f"K_LM={K}", *reading) for K in (0, 500, 1000)]
        answer = _spread(limits, "K_LM")
        return Answer(not answer.holds, answer.numbers)

    return over(check, DELAYS)


def bank_improves_stability(bench: Bench) -> Finding:
    """Stiffest stable wall with filter bank, local model and Kp, against that without them (b = 25, K_LM = 500, Kp
    = 20)."""

    def check(*reading: str) -> Answer:
        without, found = (bench.limit(name, *reading) for name in ("pmw", "fig6"))
        return Answer(found > without, f"{show_limits(found)}; without them {show_limits(without)}")

    return over(check, _with_stiffer_models())


def improvement_is_lp2s(bench: Bench) -> Finding:
    """Stiffest stable wall with LP2, without LP2, and without the local model: whether only LP2 makes it an
    improvement."""

    def check(*reading: str) -> Answer:
        loops = [("fig6", *reading), ("fig6", *reading, WITHOUT_LP2), ("pmw", *reading)]
        found, without, plain = (bench.limit(*loop) for loop in loops)
        numbers = f"{show_limits(found)}; without LP2 {show_limits(without)}; without local model {show_limits(plain)}"
        return Answer(found > plain >= without, numbers)

    return over(check, _with_stiffer_models())


def lp2_is_needed(bench: Bench) -> Finding:
    """Stiffest stable wall of Figure 6's loop with LP2 and without: whether LP2 raises it."""

    def check(*reading: str) -> Answer:
        found, without = (bench.limit("fig6", *reading, *more) for more in ((), (WITHOUT_LP2,)))
        return Answer(found > without, f"{show_limits(found)}; without LP2 {show_limits(without)}")

    return over(check)


def _with_stiffer_models():
    """The readings, and explicit ones with local models beyond the paper's 500 N/m."""
    explicit = 'environment.integration="explicit"'
    return (*READINGS, *(set_to(f"explicit, delay 0, K_LM = {K} N/m", explicit, f"K_LM={K}") for K in (1000, 3000)))


def _spread(limits: list[float], along: str) -> Answer:
    low, high = min(limits), max(limits)
    holds = low == high or (low > 0 and high / low <= LITTLE)
    return Answer(holds, f"along {along} {show_limits(limits)}")


STATEMENTS = (
    Statement("3.1, Fig. 4", "Passive multirate wave control renders at most K_VE = 800 N/m at B_VE = 1 N s/m", renders_800),
    Statement(
        "Abstract; 1; 3; 3.1, Fig. 5; 5",
        "The stiffness of the local model has little impact on stability",
        local_stiffness_matters_little,
    ),
    Statement("3; 3.1, Fig. 5", "The gain Kp does not affect stability", gain_matters_little),
    Statement(
        "Abstract; 5",
        "... unlike the parameters of local models developed in the power domain",
        power_domain_parameters_matter,
    ),
    Statement(
        "3.1, Fig. 5",
        "Filter bank, local model and position feedback improve the stability of the system",
        bank_improves_stability,
    ),
    Statement("3.1", "LP2 injects damping that stabilises the loop closed through the local model", lp2_is_needed),
    Statement("3.1", "The improvement is largely brought about by the damping injected through LP2", improvement_is_lp2s),
)
