"""Whole processes: a command against the imports that it cannot do without."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from functools import partial

from wavesweep.bench.ours import run
from wavesweep.bench.table import Row
from wavesweep.bench.timing import Patience, interleaved
from wavesweep.paper.specs import folder

_IMPORTS = "import numpy, click, pyarrow.parquet"
_FIGURE = f"{_IMPORTS}; from matplotlib.backends.backend_agg import FigureCanvasAgg; from matplotlib.figure import Figure"
ROUNDS = Patience(6.0, 5, 15)


def rows(patience: Patience, *, quick: bool) -> Iterator[Row]:
    """Measure; quick: the help alone."""
    rounds = patience if quick else ROUNDS
    with tempfile.TemporaryDirectory() as out:
        zwidth = ["-m", "wavesweep", "zwidth", str(folder() / "fig4.toml"), "--quiet", "--force", "--out", out]
        for name, arguments, yardstick in (
            ("wavesweep --help", ["-m", "wavesweep", "--help"], "import click"),
            ("wavesweep zwidth fig4.toml --no-plot", [*zwidth, "--no-plot"], _IMPORTS),
            ("wavesweep zwidth fig4.toml", zwidth, _FIGURE),
        )[: 1 if quick else None]:
            pair = interleaved(partial(run, arguments), partial(run, ["-c", yardstick]), rounds)
            yield {
                "part": "start", "problem": "whole process", "method": name, "seconds": pair.first,
                "ratio": pair.ratio, "yardstick": yardstick, "pairs": pair.pairs,
            }  # fmt: skip
