"""Stability, rendering range and transparency of multirate wave-variable haptic loops.

Importing the package costs nothing; a name is loaded when it is first touched.
"""

__version__ = "0.1.0"

_HOMES = {
    "load": "wavesweep.spec",
    "Spec": "wavesweep.spec",
    **dict.fromkeys(
        (
            *("compile", "Loop", "zwidth", "stability_region", "bode", "design", "passivity", "filter_choices", "simulate"),
            *("verdict", "why", "identify"),
        ),
        "wavesweep.api",
    ),
    **dict.fromkeys(("WavesweepError", "UsageError", "SpecError", "IllPosedLoopError", "CheckpointError"), "wavesweep.errors"),
}
_STAGES = ("results",)  # modules with functions for users
__all__ = ["__version__", *_HOMES, *_STAGES]  # noqa: PLE0604 - the names are strings


def __getattr__(name):
    from importlib import import_module

    if name in _STAGES:
        return import_module(f"{__name__}.{name}")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__():
    return sorted({*globals(), *__all__})
