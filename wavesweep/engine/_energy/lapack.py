"""LAPACK as scipy brings it, without the rest of scipy.linalg, whose import takes 0.15 s: longer
than most answers that need it."""

import sys
from functools import cache
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from types import ModuleType

MODULE = "scipy.linalg._flapack"


@cache
def lapack() -> ModuleType:
    """The module with the routines of LAPACK.

    It has its own name, so that scipy.linalg takes it if it is imported later. Where scipy keeps it
    elsewhere, all of scipy.linalg is imported.
    """
    if MODULE not in sys.modules:
        import scipy

        spec = PathFinder.find_spec(MODULE, [f"{folder}/linalg" for folder in scipy.__path__])
        if spec is None or spec.loader is None:
            import scipy.linalg.lapack

            return scipy.linalg.lapack
        sys.modules[MODULE] = module_from_spec(spec)
        spec.loader.exec_module(sys.modules[MODULE])
    return sys.modules[MODULE]
