"""The wishes of a spec, held against what its own numbers reach."""

from collections.abc import Sequence

import numpy as np

from wavesweep.designs.study import claims_of, job_of, own_records
from wavesweep.designs.table import wish_in_words, wish_units
from wavesweep.program.analyses.claims import Claim
from wavesweep.program.spec import Spec


def wished(spec: Spec) -> tuple[list[Sequence[str]], list[Claim]]:
    """Each wish, what is asked, what is reached at its worst over all that a design has to hold for, and whether it is met; and
    how these are known.

    Errors: UsageError or SpecError where no design could be searched for.
    """
    job = job_of(spec)
    (record,) = own_records(spec, job)
    units = wish_units(spec)
    rows = []
    for wish in spec.design.wishes:
        value = record[wish.name]
        reached = "not known"
        if not np.isnan(value):
            reached = wish_in_words(wish.name, value, units[wish.name])
        bound_text = "as good as possible"
        met = ""
        if wish.bound is not None:
            bound = f"{wish.bound:g} {units[wish.name]}".removesuffix(" 1")
            bound_text = f"{wish.kind.bound.replace('_', ' ')} {bound}"
            met = "not known"
            if record[f"{wish.name}_certified"] and not np.isnan(value):
                met = "met" if wish.margin(value) >= 0 else "missed"
        cut = wish.options.get("cut")
        title = f"{wish.kind.title} at {cut}" if cut else wish.kind.title
        rows.append((title, bound_text, reached, met))
    return rows, [*claims_of(job).values()]
