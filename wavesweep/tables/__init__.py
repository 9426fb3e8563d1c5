"""The tables: one file for each kind, with its columns, computation, summary, verification and figure.

A new kind is a file with a `Kind` in it, and its name in `HOMES`.
"""

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from types import MappingProxyType

from wavesweep.errors import WavesweepError
from wavesweep.tables.kind import Kind

HOMES: Mapping[str, str] = MappingProxyType(
    {
        "compare": "comparison",
        "compare-bode": "comparison",
        "zwidth": "intervals",
        "stability-region": "intervals",
        "zwidth-hands": "intervals",
        "stability-region-hands": "intervals",
        "bode": "responses",
        "bode-ports": "responses",
        "simulate": "simulation",
        "simulate-response": "simulation",
        "passivity": "passivity",
        "passivity-filters": "passivity",
        "passivity-ports": "passivity",
        "passivity-along": "intervals",
        "why": "why",
        "margins": "margins",
        "design": "design",
        "identify": "identify",
        "identify-response": "identify",
    }
)


@cache
def kind_named(name: str) -> Kind:
    """The kind of table of that name. Errors: WavesweepError for an unknown name."""
    if name not in HOMES:
        raise WavesweepError(f"no table is called {name!r}, expected one of {', '.join(HOMES)}")
    kinds: tuple[Kind, ...] = import_module(f"{__name__}.{HOMES[name]}").KINDS
    return next(kind for kind in kinds if kind.name == name)


def kinds() -> dict[str, Kind]:
    """All kinds of tables by their names."""
    return {name: kind_named(name) for name in HOMES}
