"""The paper's specs, in a checkout or in an installed package."""

from __future__ import annotations

from pathlib import Path

from wavesweep.errors import UsageError
from wavesweep.spec import Spec, load


def folder() -> Path:
    """Give the folder of the paper's specs: inside an installed package, else the checkout's `sweeps/paper`.

    Errors: UsageError if there is neither.
    """
    here = Path(__file__).resolve().parent
    places = (here / "toml", here.parents[1] / "sweeps" / "paper")
    for place in places:
        if (place / "fig4.toml").is_file():
            return place
    raise UsageError(f"the paper's specs: expected them in {' or '.join(map(str, places))}, found neither")


def load_paper(name: str, overrides: tuple[str, ...] = ()) -> Spec:
    """Load one of the paper's specs by its name, e.g. "fig4"; overrides as for `--set`."""
    return load(folder() / f"{name}.toml", overrides)
