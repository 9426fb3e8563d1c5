"""Which slices, in which order, as which table."""

from wavesweep.sweep.run import Table

__all__ = ["Table", "filter_choices", "held_intervals", "holders_of", "intervals", "passivity", "plan", "responses", "simulate"]

_HOMES = {
    "held_intervals": "wavesweep.sweep.held_table",
    "holders_of": "wavesweep.sweep.held_table",
    "intervals": "wavesweep.sweep.interval_table",
    "responses": "wavesweep.sweep.response_table",
    "filter_choices": "wavesweep.sweep.passivity_table",
    "passivity": "wavesweep.sweep.passivity_table",
    "plan": "wavesweep.sweep.planning",
    "simulate": "wavesweep.sweep.simulation_table",
}


def __getattr__(name):
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
