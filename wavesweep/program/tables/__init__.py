"""The tables: one file for each kind, with its columns, computation, summary, verification and figure.

Those of the core stand here, those of a capability in its `table.py`.
"""

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from types import MappingProxyType

from wavesweep.capabilities import CAPABILITIES
from wavesweep.engine.errors import WavesweepError
from wavesweep.program.tables.kind import Kind

_OF_INTERVALS = ("zwidth", "stability-region", "zwidth-hands", "stability-region-hands")
HOMES: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(_OF_INTERVALS, f"{__name__}.interval_table"),
        "zwidth-specs": f"{__name__}.specs",
        **dict.fromkeys(("bode", "bode-ports"), f"{__name__}.response_table"),
        **{
            kind: capability.name_of("table")
            for capability in CAPABILITIES
            for kind in capability.kinds
        },
    }
)


@cache
def kind_named(name: str) -> Kind:
    """The kind of table of that name. Errors: WavesweepError for an unknown name."""
    if name not in HOMES:
        raise WavesweepError(f"no table is called {name!r}, expected one of {', '.join(HOMES)}")
    kinds: tuple[Kind, ...] = import_module(HOMES[name]).KINDS
    return next(kind for kind in kinds if kind.name == name)


def kinds() -> dict[str, Kind]:
    """All kinds of tables by their names."""
    return {name: kind_named(name) for name in HOMES}
