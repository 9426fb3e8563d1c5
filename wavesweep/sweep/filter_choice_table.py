"""The paper's filter choices at the rates of a spec, as a table."""

import time

import numpy as np

from wavesweep.analysis.passivity import filter_table, sufficient_order
from wavesweep.analysis.passivity.channel import CUTOFFS_HZ
from wavesweep.errors import UsageError
from wavesweep.spec import Spec
from wavesweep.sweep.run import Table, facts_of

ENOUGH = 1e-3  # J per J sent that aliasing may add
METHODS = {
    "channel": "H-infinity norm by levels, for LP1 of order 1 to 8; the spec's rates and nothing else of it",
    "sufficient_order": f"least order at this cutoff whose energy_gain is at most {ENOUGH:g}",
}


def filter_choices(spec: Spec) -> Table:
    """How far from passive the channel is for every order and cutoff of LP1 that the paper could mean."""
    started = time.perf_counter()
    cutoffs = [cutoff for cutoff in CUTOFFS_HZ if cutoff < spec.values["rates.fast_hz"] / 2]
    if not cutoffs:
        raise UsageError(f"filter choices: expected a fast rate above {2 * min(CUTOFFS_HZ):g} Hz for the cutoffs to fit")
    columns = filter_table(spec.values, cutoffs_hz=cutoffs)
    enough = sufficient_order(columns, ENOUGH)
    orders = [enough[cutoff] for cutoff in columns["lp1_cutoff_hz"].tolist()]
    columns = columns | {"sufficient_order": np.array([np.nan if order is None else order for order in orders])}
    rows = columns["certified"].size
    counts = {"computed": rows, "skipped": 0, "certified": int(columns["certified"].sum())}
    facts = facts_of(spec, METHODS, counts, {"compute_s": time.perf_counter() - started})
    return Table.of("passivity-filters", columns, facts)
