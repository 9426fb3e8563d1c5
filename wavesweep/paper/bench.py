"""The paper's loops as the statements ask for them, each computed once however often it is asked for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wavesweep.analysis.passivity import ChannelNorm, channel_norm
from wavesweep.paper.experiment import CONTROLLERS, estimated
from wavesweep.paper.response import Response, respond
from wavesweep.paper.specs import load_paper
from wavesweep.sweep import intervals


class Bench:
    """Answers about the paper's specs, with overrides as for `--set`; it remembers them, and does nothing else."""

    def __init__(self) -> None:
        self._responses: dict[tuple[str, tuple[str, ...]], Response] = {}
        self._experiments: dict[str, Mapping[str, np.ndarray]] = {}

    def response(self, name: str, *overrides: str) -> Response:
        """Give the response of a spec at its own frequencies."""
        asked = (name, overrides)
        if asked not in self._responses:
            self._responses[asked] = respond(load_paper(name, overrides))
        return self._responses[asked]

    def stable(self, name: str, *overrides: str) -> list[tuple[float, float]]:
        """Give the stable intervals of a spec along its own axis, whose other axes have been given one value each.

        Intervals end at inf where the swept range ends them.
        """
        columns = intervals(load_paper(name, overrides)).columns
        ends = np.where(np.isnan(columns["high_omega"]), np.inf, columns["high"])
        there = columns["intervals"] > 0
        return list(zip(columns["low"][there].tolist(), ends[there].tolist(), strict=True))

    def limits(self, name: str, *overrides: str) -> list[float]:
        """Give the upper end of the stable interval that begins at 0, for each combination of a spec's axes.

        inf where the swept range ends it, 0 where no stable interval begins there.
        """
        columns = intervals(load_paper(name, overrides)).columns
        first = columns["interval"] == 0
        begins = (columns["intervals"] > 0) & (columns["low"] == 0)
        ends = np.where(np.isnan(columns["high_omega"]), np.inf, columns["high"])
        return np.where(begins, ends, 0.0)[first].tolist()

    def limit(self, name: str, *overrides: str) -> float:
        """Give the same for a spec with a single combination, or for its first one."""
        return self.limits(name, *overrides)[0]

    def channel(self, name: str, *overrides: str) -> ChannelNorm:
        """Give the norm of a spec's wave channel."""
        return channel_norm(load_paper(name, overrides).values)

    def experiment(self, name: str) -> Mapping[str, np.ndarray]:
        """Give the response that Figure 7's experiment shows of "PMW+LM", "PMW" or "DC"; see `estimated`."""
        if name not in self._experiments:
            self._experiments[name] = estimated(load_paper("fig7", CONTROLLERS[name]))
        return self._experiments[name]
