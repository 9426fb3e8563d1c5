"""Functions that numba compiles at their first call, and the folder that keeps their code."""

import os
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from shutil import rmtree

from numba import config, njit


def _place(package: Path = Path(__file__).parents[2]) -> Path | None:
    """Return a folder for compiled code that belongs to exactly these sources of the package; None if there is no place.

    The folder depends on all sources, since numba checks only the file of a function, and not those that it calls or takes
    constants from. It is beside the sources or, if that place is not writable, in the user's cache. Beside the sources, folders
    that belong to earlier sources are removed.
    """
    here, digest = Path(__file__).parent, sha256()
    for source in sorted(package.rglob("*.py")):
        digest.update(source.read_bytes())
    own = here / "__pycache__"
    if config.CACHE_DIR:
        root = Path(config.CACHE_DIR)
    elif os.access(own if own.exists() else here, os.W_OK):
        root = own
    else:
        try:
            root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "wavesweep"
        except RuntimeError:  # a user without a home
            return None
    place = root / f"wavesweep-{digest.hexdigest()[:16]}"
    for earlier in root.glob("wavesweep-*") if root == own and not place.exists() else ():
        rmtree(earlier, ignore_errors=True)
    return place


PLACE = _place()


def compiled(function):
    """Return the function compiled at its first call, and kept on disk if there is a place and room."""
    options = {"error_model": "numpy", "nogil": True}
    if PLACE is None:
        return njit(**options)(function)
    before, config.CACHE_DIR = config.CACHE_DIR, str(PLACE)
    try:
        found = njit(cache=True, **options)(function)
    except RuntimeError:
        return njit(**options)(function)
    finally:
        config.CACHE_DIR = before
    cache = found._cache  # noqa: SLF001 - numba has no other way to say that a full disk is no reason to stop
    save = cache.save_overload

    def saved(*overload):
        with suppress(OSError):
            save(*overload)

    cache.save_overload = saved
    return found
