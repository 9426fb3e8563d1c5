"""Bundled examples: in a checkout beside the package, in a wheel inside it."""

from pathlib import Path

from wavesweep.engine.errors import UsageError


def bundled(folder: str) -> Path:
    """Give a folder of the checkout, e.g. "sweeps/examples". Errors: UsageError if it does not
    exist."""
    package = Path(__file__).resolve().parents[1]
    places = [root / folder for root in (package / "_bundled", package.parent)]
    for place in places:
        if place.is_dir():
            return place
    raise UsageError(
        f"{folder}: expected it in {' or '.join(map(str, places))}, found neither; a checkout of wavesweep has it"
    )
