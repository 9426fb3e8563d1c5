"""Stability, rendering range and transparency of haptic and other linear loops of several rates.

Importing the package costs nothing; a name is loaded when it is first touched. `__init__.pyi` says
the same names, with those of capabilities, to editors and type checkers.
"""

__version__ = "1.2.0"

_HOMES = {
    **dict.fromkeys(
        ("IllPosedLoopError", "SpecError", "UsageError", "WavesweepError"), "engine.errors"
    ),
    **dict.fromkeys(("Loop", "bode", "compile", "stability_region", "zwidth"), "program.api"),
    **dict.fromkeys(("Spec", "load"), "program.spec"),
    "CheckpointError": "program.store.checkpoint",
}


def __getattr__(name):
    from importlib import import_module

    if name == "results":  # a module with functions for users
        return import_module("wavesweep.results")
    if name in _HOMES:
        return getattr(import_module(f"wavesweep.{_HOMES[name]}"), name)

    from wavesweep.capabilities import library_names, of_library

    if name == "__all__":
        return sorted([*_HOMES, "__version__", "results", *library_names()])
    return of_library(name, _HOMES)


def __dir__():
    return __getattr__("__all__")
