"""Switched systems: matrices in any order that a graph allows, and norms in which all shrink."""

from typing import TYPE_CHECKING

from wavesweep.engine import on_demand

if TYPE_CHECKING:
    from wavesweep.engine._switched.any_order import (
        Decision,
        Verdict,
        bracket,
        decide,
    )
    from wavesweep.engine._switched.average import ALWAYS, OnAverage
    from wavesweep.engine._switched.boxes import cover, cover_constant
    from wavesweep.engine._switched.brackets import Bracket, LeftOpen, Refuted, driven, nearest_of
    from wavesweep.engine._switched.climb import (
        Growth,
        corners_of,
        on_edges_of,
    )
    from wavesweep.engine._switched.dissipation import automaton, least_damping
    from wavesweep.engine._switched.folded import counted_from_rest, lasting, shift_of
    from wavesweep.engine._switched.frames_over import (
        TOTAL_DEGREE,
        FramesOver,
        TickPlace,
        constant_frames,
        inside_of,
    )
    from wavesweep.engine._switched.graph import Family, Graph
    from wavesweep.engine._switched.inertia import inertia_of_cells
    from wavesweep.engine._switched.left_open import INWARD, left_open
    from wavesweep.engine._switched.loop_frames import LoopFrames, Symbol, WrittenFrames, alive
    from wavesweep.engine._switched.mean_square import (
        Chances,
        brackets_on_average,
        decays,
        grows_everywhere,
        parts_that_decay,
    )
    from wavesweep.engine._switched.norm_check import (
        Norms,
        shrink_along,
    )
    from wavesweep.engine._switched.norms import (
        Centre,
        acting,
        packed,
        recentred,
        units_of_places,
    )
    from wavesweep.engine._switched.pattern_slopes import largest_modes, slopes_of
    from wavesweep.engine._switched.patterns import (
        Word,
        growing_of,
        is_refuted,
        joined,
        product_of,
        short_words,
        shortest_through,
    )
    from wavesweep.engine._switched.ranking import least_refuted, seems_refuted
    from wavesweep.engine._switched.ring_search import RingSearch, opened, units_of_ring
    from wavesweep.engine._switched.semidefinite import Inequality, minimised, symmetric_basis
    from wavesweep.engine._switched.stretches import covered
    from wavesweep.engine._switched.worst import (
        FROM_ZERO,
        OPERATIONS_OF_PROOFS,
        SOON,
        LoopsOver,
        bracket_over,
        decide_over,
    )
else:
    __getattr__ = on_demand(
        {
            "_switched.any_order": (
                "Decision",
                "Verdict",
                "bracket",
                "decide",
            ),
            "_switched.average": (
                "ALWAYS",
                "OnAverage",
            ),
            "_switched.boxes": (
                "cover",
                "cover_constant",
            ),
            "_switched.brackets": (
                "Bracket",
                "LeftOpen",
                "Refuted",
                "driven",
                "nearest_of",
            ),
            "_switched.climb": (
                "Growth",
                "corners_of",
                "on_edges_of",
            ),
            "_switched.dissipation": (
                "automaton",
                "least_damping",
            ),
            "_switched.folded": (
                "counted_from_rest",
                "lasting",
                "shift_of",
            ),
            "_switched.frames_over": (
                "FramesOver",
                "TOTAL_DEGREE",
                "TickPlace",
                "constant_frames",
                "inside_of",
            ),
            "_switched.graph": (
                "Family",
                "Graph",
            ),
            "_switched.inertia": ("inertia_of_cells",),
            "_switched.left_open": (
                "INWARD",
                "left_open",
            ),
            "_switched.loop_frames": (
                "LoopFrames",
                "Symbol",
                "WrittenFrames",
                "alive",
            ),
            "_switched.mean_square": (
                "Chances",
                "brackets_on_average",
                "decays",
                "grows_everywhere",
                "parts_that_decay",
            ),
            "_switched.norm_check": (
                "Norms",
                "shrink_along",
            ),
            "_switched.norms": (
                "Centre",
                "acting",
                "packed",
                "recentred",
                "units_of_places",
            ),
            "_switched.pattern_slopes": (
                "largest_modes",
                "slopes_of",
            ),
            "_switched.patterns": (
                "Word",
                "growing_of",
                "is_refuted",
                "joined",
                "product_of",
                "short_words",
                "shortest_through",
            ),
            "_switched.ranking": ("least_refuted", "seems_refuted"),
            "_switched.ring_search": (
                "RingSearch",
                "opened",
                "units_of_ring",
            ),
            "_switched.semidefinite": (
                "Inequality",
                "minimised",
                "symmetric_basis",
            ),
            "_switched.stretches": ("covered",),
            "_switched.worst": (
                "FROM_ZERO",
                "LoopsOver",
                "OPERATIONS_OF_PROOFS",
                "SOON",
                "bracket_over",
                "decide_over",
            ),
        }
    )
