"""This tool, as a library and as a command."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import wavesweep
from wavesweep import results
from wavesweep.bench.problems import Problem
from wavesweep.bench.scoring import Answer
from wavesweep.paper.specs import folder
from wavesweep.spec import Spec


def library(spec: Spec) -> Any:
    """Compile and ask for all stable intervals, certificate included: the DataFrame that a user gets."""
    (along,) = (axis for axis in spec.sweep if axis.name == "K_VE")
    axes = {axis.name: axis.values for axis in spec.sweep if axis is not along}
    return wavesweep.compile(spec).stable_intervals("K_VE", (along.start, along.stop), **axes)


def answer_of(table: Mapping[str, Any]) -> Answer:
    """The answer in a table of intervals."""
    interval = np.asarray(table["interval"])
    stable = np.asarray(table["intervals"]) > 0
    column = np.cumsum(interval <= 0) - 1
    return Answer(column[stable], np.asarray(table["low"])[stable], np.asarray(table["high"])[stable])


def command(problem: Problem, columns: int) -> Answer:
    """`wavesweep zwidth` as a process of its own, and its table read back."""
    settings = [word for setting in problem.overrides(columns) for word in ("--set", setting)]
    with tempfile.TemporaryDirectory() as out:
        spec = folder() / f"{problem.spec}.toml"
        run(["-m", "wavesweep", "zwidth", str(spec), "--no-plot", "--quiet", "--out", out, *settings])
        return answer_of(results.read(Path(out) / "zwidth.parquet"))


def run(arguments: Sequence[str]) -> None:
    """Run this Python with these arguments, this package within its reach and its bytecode kept, as installing does."""
    reach = os.pathsep.join([str(Path(wavesweep.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    subprocess.run(  # noqa: S603 - our own command
        [sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL, env=kept | {"PYTHONPATH": reach}
    )
