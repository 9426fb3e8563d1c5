"""A table becomes a figure; nothing is computed here. Each kind of figure is `draw(columns, facts, path)`.

A drawing is loaded when it is first asked for: a run without a figure pays for none. Those whose name is that of their
module (`passivity`, `filter_choices`) are imported from there.
"""

from importlib import import_module
from types import MappingProxyType

_HOMES = MappingProxyType(
    {
        "Picture": "picture", "bode": "responses", "simulate": "simulation",
        "simulate_response": "simulated_response", "zwidth": "intervals",
    }
)  # fmt: skip


def __getattr__(name):
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
