"""Figures of tables; nothing is computed here. Each kind of table has a function of (columns, facts, path).

A function is imported at its first use, so a run without a figure imports none.
"""

from importlib import import_module
from types import MappingProxyType

_HOMES = MappingProxyType(
    {
        "Picture": "intervals", "bode": "responses", "compare": "comparison", "compare_bode": "comparison",
        "passivity": "margins", "passivity_filters": "margins", "simulate": "simulation",
        "simulate_response": "responses", "zwidth": "intervals",
    }
)  # fmt: skip


def __getattr__(name):
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
