"""Gains and energies of lifted loops: peaks over all frequencies, by levels that no frequency meets."""

from typing import TYPE_CHECKING

from wavesweep.engine import on_demand

if TYPE_CHECKING:
    from wavesweep.engine._energy.hinf import (
        NEAR_CIRCLE,
        NORM_TOLERANCE,
        SOFT,
        START,
        Element,
        Peak,
        hinf_norm,
        with_middles,
    )
    from wavesweep.engine._energy.lifted_map import (
        LiftedMap,
        TickMaps,
        closure,
        connected,
        damping_peak,
        read,
    )
    from wavesweep.engine._energy.norms import squared_norm
else:
    __getattr__ = on_demand(
        {
            "_energy.hinf": (
                "Element",
                "NEAR_CIRCLE",
                "NORM_TOLERANCE",
                "Peak",
                "SOFT",
                "START",
                "hinf_norm",
                "with_middles",
            ),
            "_energy.lifted_map": (
                "LiftedMap",
                "TickMaps",
                "closure",
                "damping_peak",
                "connected",
                "read",
            ),
            "_energy.norms": ("squared_norm",),
        }
    )
