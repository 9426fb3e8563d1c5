"""Stability, rendering range and transparency of multirate wave-variable haptic loops.

Importing the package costs nothing; a name is loaded when it is first touched.
"""

TYPE_CHECKING = False  # type checkers take it for that of typing, whose import is not needed

__version__ = "0.1.0"
__all__ = [
    "CheckpointError",
    "IllPosedLoopError",
    "Loop",
    "Spec",
    "SpecError",
    "UsageError",
    "WavesweepError",
    "__version__",
    "bode",
    "compile",
    "design",
    "filter_choices",
    "identify",
    "load",
    "passivity",
    "report",
    "results",
    "simulate",
    "stability_region",
    "verdict",
    "why",
    "zwidth",
]

if TYPE_CHECKING:  # what an editor and a type checker read; at run time `__getattr__` loads the same names
    from wavesweep.core import results
    from wavesweep.core.api import (
        Loop,
        bode,
        compile,  # noqa: A004 - the name that the interface gives it
        design,
        filter_choices,
        identify,
        passivity,
        report,
        simulate,
        stability_region,
        verdict,
        why,
        zwidth,
    )
    from wavesweep.core.errors import CheckpointError, IllPosedLoopError, SpecError, UsageError, WavesweepError
    from wavesweep.core.spec import Spec, load
else:

    def __getattr__(name):
        from importlib import import_module

        if name == "results":  # a module with functions for users
            return import_module("wavesweep.core.results")
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        homes = (
            ("wavesweep.core.errors",)
            if name.endswith("Error")
            else ("wavesweep.core.spec",)
            if name in ("load", "Spec")
            else ()
        )
        return getattr(import_module(*homes or ("wavesweep.core.api",)), name)


def __dir__():
    return sorted(__all__)
