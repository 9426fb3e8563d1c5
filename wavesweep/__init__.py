"""Stability, rendering range and transparency of multirate wave-variable haptic loops.

Importing the package costs nothing; a name is loaded when it is first touched.
"""

__version__ = "0.1.0"
__all__ = ["__version__", "compile", "load"]

_HOMES = {"load": "wavesweep.spec", "compile": "wavesweep.loop"}


def __getattr__(name):
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)


def __dir__():
    return sorted({*globals(), *__all__})
