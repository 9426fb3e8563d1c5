"""The paper's specs, which lie beside this program."""

from __future__ import annotations

from pathlib import Path

import wavesweep

FOLDER = Path(__file__).parents[1]


def load_paper(name: str, overrides: tuple[str, ...] = ()) -> wavesweep.Spec:
    """Load one of the paper's specs by its name, e.g. "fig4"; overrides as for `--set`."""
    return wavesweep.load(FOLDER / f"{name}.toml", overrides)
