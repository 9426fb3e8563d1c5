"""The slices that a spec asks for, computed in chunks, as tables."""

from wavesweep.sweep.table import Table

__all__ = [
    "Table",
    "compare",
    "filter_choices",
    "hands_of",
    "intervals",
    "passivity",
    "plan",
    "responses",
    "simulate",
    "why",
]

_HOMES = {
    "compare": "wavesweep.sweep.comparison",
    "hands_of": "wavesweep.sweep.hands",
    "intervals": "wavesweep.sweep.interval_table",
    "responses": "wavesweep.sweep.response_table",
    "filter_choices": "wavesweep.sweep.passivity_table",
    "passivity": "wavesweep.sweep.passivity_table",
    "plan": "wavesweep.sweep.planning",
    "simulate": "wavesweep.sweep.simulation_table",
    "why": "wavesweep.sweep.why_table",
}


def __getattr__(name):
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
