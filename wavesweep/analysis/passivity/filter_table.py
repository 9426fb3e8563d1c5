"""The filter choices of the paper in numbers: how far each is from a passive channel, and which order is enough."""

import numpy as np

from wavesweep.analysis.passivity.channel import channel_norm

ORDERS = tuple(range(1, 9))
CUTOFFS_HZ = (2.0, 5.0, 8.57, 10.0, 15.0, 20.0, 25.0)


def filter_table(values, orders=ORDERS, cutoffs_hz=CUTOFFS_HZ) -> dict[str, np.ndarray]:
    """Columns over every order and cutoff (Hz) of LP1, orders slowest.

    `lp1_order`, `lp1_cutoff_hz`; `channel_norm` of `pmw` and its `channel_omega` (rad/s); `excess`, norm less 1: how
    far from passive; `energy_gain`, norm^2 - 1: the energy (J per J sent) that aliasing can add to a wave, at most;
    `bank_norm`: that of the way out of `pmw-lm`, `u_m -> (u_s, u_h)`, with a high-pass of the same order and cutoff,
    which is power-complementary; `certified`. The way back of `pmw-lm` has the norm sqrt(2) for every LP2 that passes
    constants, because `v_m = v_1 + v_2` adds two waves, so it is not a column.
    values: flat keys; rates are taken from it, and all but the filters is ignored.
    """
    cutoffs = np.asarray(cutoffs_hz, float)
    parts = [_of_order(dict(values), order, cutoffs) for order in orders]
    table = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return table | {"excess": table["channel_norm"] - 1, "energy_gain": table["channel_norm"] ** 2 - 1}


def _of_order(values, order, cutoffs):
    filters = {f"filters.{name}.order": order for name in ("lp1", "hp")}
    filters |= {f"filters.{name}.cutoff_hz": cutoffs for name in ("lp1", "hp")}
    alone, bank = (channel_norm(values | filters | {"controller.kind": kind}) for kind in ("pmw", "pmw-lm"))
    return {
        "lp1_order": np.full(cutoffs.size, order), "lp1_cutoff_hz": cutoffs, "channel_norm": alone.norm,
        "channel_omega": alone.omega, "bank_norm": bank.outward, "certified": alone.certified & bank.certified,
    }


def sufficient_order(table, energy_gain: float = 1e-3) -> dict[float, int | None]:
    """Least order per cutoff (Hz) whose aliasing adds at most `energy_gain` (J per J); None where no order does.

    No finite order at a cutoff below half the slow rate makes it zero: the stop band is not empty of any Butterworth.
    """
    found = {}
    for cutoff in np.unique(table["lp1_cutoff_hz"]):
        enough = (table["lp1_cutoff_hz"] == cutoff) & (table["energy_gain"] <= energy_gain)
        found[float(cutoff)] = int(table["lp1_order"][enough].min()) if enough.any() else None
    return found
