"""Results of the paper's loops for the statements, computed in batches, each only once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np

import wavesweep
from reproduce.felt_responses import CONTROLLERS, FeltResponse, estimated, respond_to
from reproduce.readings import Reading
from reproduce.specs import load_paper
from wavesweep import Spec
from wavesweep.engine._monodromy.cut import FIRST
from wavesweep.engine._stability.stable import stable_intervals
from wavesweep.haptics.controller_page import keys_of_page, loop_drawing, wall_cut
from wavesweep.passive.channel import ChannelNorm, channel_norm
from wavesweep.program.spec import find_key
from wavesweep.program.spec.studies import K_VE_SPAN

Change = Mapping[str, float | int | str]
Spans = list[tuple[float, float]]
BASE = (Reading(),)


class PaperLoops:
    """Results of the paper's specs under many readings at once, with a memory of those computed before.

    A reading changes keys that the loop of a spec reads; `change` (symbols or paths -> values) goes before it.
    """

    def __init__(self) -> None:
        self._specs: dict[str, Spec] = {}
        self._known: dict[tuple, dict] = {}
        self._read: dict[tuple, tuple] = {}
        self._experiments: dict[str, Mapping[str, np.ndarray]] = {}
        self.uncertified = 0  # stable intervals that were asked for and are not proved

    def response(self, name: str, reading: Reading = BASE[0], change: Change | None = None) -> FeltResponse:
        """Give the response of a spec at its own frequencies."""
        return self.responses(name, [reading], change)[0]

    def responses(self, name: str, readings: Sequence[Reading], change: Change | None = None) -> list[FeltResponse]:
        """Give the same for each reading."""
        return [one for (one,) in self.families(name, readings, [change or {}])]

    def families(
        self, name: str, readings: Sequence[Reading], changes: Sequence[Change], frequency_hz: tuple[float, ...] = ()
    ) -> list[list[FeltResponse]]:
        """Give for each reading the responses with each change, at the spec's frequencies unless others are given."""
        frequency = np.asarray(frequency_hz or self._own(name).frequency_hz)
        key = ("response", name, frequency_hz)
        return self._ask(
            key, name, readings, changes, lambda values, size: respond_to(loop_drawing(values), values, size, frequency)
        )

    def limits(self, name: str, readings: Sequence[Reading], change: Change | None = None) -> list[float]:
        """Give the upper end of the stable K_VE that begin at 0, for each reading.

        inf if the searched range ends it, 0 if no stable interval begins there.
        """
        return [one for (one,) in self.limit_families(name, readings, [change or {}])]

    def limit_families(self, name: str, readings: Sequence[Reading], changes: Sequence[Change]) -> list[list[float]]:
        """Give the same for each reading with each change."""
        found = self.stable_families(name, readings, changes)
        return [[next((high for low, high in spans if low == 0), 0.0) for spans in family] for family in found]

    def stable_families(self, name: str, readings: Sequence[Reading], changes: Sequence[Change]) -> list[list[Spans]]:
        """Give all stable intervals of K_VE for each reading with each change; inf if the searched range ends one."""
        return self._ask(("stable", name), name, readings, changes, self._stable_walls)

    def stable_along(self, name: str, *overrides: str) -> Spans:
        """Give the stable intervals of a spec along its own axis; overrides as for `--set`."""
        table = wavesweep.stability_region(load_paper(name, overrides))
        self.uncertified += int((~table.certified).sum())
        there = table[table.intervals > 0]
        ends = there.high.where(there.high_omega.notna(), np.inf)
        return list(zip(there.low.tolist(), ends.tolist(), strict=True))

    def channels(self, name: str, readings: Sequence[Reading], change: Change | None = None) -> list[ChannelNorm]:
        """Give the norms of a spec's wave channel for each reading."""
        found = self._ask(("channel", name), name, readings, [change or {}], _channels)
        return [one for (one,) in found]

    def values(self, name: str, readings: Sequence[Reading]) -> list[dict]:
        """Give the values of a spec under each reading, as flat keys."""
        return [{**self._own(name).values, **reading.changes} for reading in readings]

    def experiment(self, name: str) -> Mapping[str, np.ndarray]:
        """Give the response that Figure 7's experiment shows of "PMW+LM", "PMW" or "DC"; see `estimated`."""
        if name not in self._experiments:
            self._experiments[name] = estimated(load_paper("fig7", CONTROLLERS[name]))
        return self._experiments[name]

    def _own(self, name: str) -> Spec:
        if name not in self._specs:
            self._specs[name] = load_paper(name)
        return self._specs[name]

    def _ask(self, key: tuple, name: str, readings: Sequence[Reading], changes, solve: Callable) -> list[list]:
        """Answer from known results, after all missing ones have been computed in batches.

        solve(values, size): the answers to `size` loops whose values are numbers or arrays over them.
        """
        known = self._known.setdefault(key, {})
        wanted = [[self._asked(name, reading, change) for change in changes] for reading in readings]
        missing = list(dict.fromkeys(each for family in wanted for each in family if each not in known))
        base = self._own(name).values
        for members, values in _batches([{**base, **dict(each)} for each in missing]):
            for member, answer in zip(members, solve(values, len(members)), strict=True):
                known[missing[member]] = answer
        return [[known[each] for each in family] for family in wanted]

    def _asked(self, name: str, reading: Reading, change: Change) -> tuple:
        """The differences from the spec: of the reading, only keys that the loop reads; the change goes before it."""
        base = self._own(name).values
        key = (name, *change.items())
        if key not in self._read:
            typed = {(path := find_key(each).path): type(base[path])(value) for each, value in change.items()}
            self._read[key] = typed, keys_of_page({**base, **typed})
        typed, read = self._read[key]
        changed = {path: value for path, value in reading.changes.items() if path in read}
        return tuple(sorted((path, value) for path, value in {**changed, **typed}.items() if base[path] != value))

    def _stable_walls(self, values: Mapping, size: int) -> Iterator[Spans]:
        cut = wall_cut(values).as_batch(size)
        damping = np.broadcast_to(np.asarray(values["environment.B_VE"], float), (size,))
        found = stable_intervals(cut, FIRST, K_VE_SPAN, damping[:, None])
        self.uncertified += int(np.count_nonzero(~found.certified))
        ends = np.where(np.isnan(found.high_omega), np.inf, found.high)
        for column in range(size):
            rows = (found.column == column) & (found.count > 0)
            yield list(zip(found.low[rows].tolist(), ends[rows].tolist(), strict=True))


def _channels(values: Mapping, size: int) -> Iterator[ChannelNorm]:
    norm = channel_norm(loop_drawing(values), values)
    parts = {name: np.broadcast_to(getattr(norm, name), (size,)) for name in norm.__dataclass_fields__}
    return (ChannelNorm(**{name: part[loop] for name, part in parts.items()}) for loop in range(size))


def _batches(loops: Sequence[Mapping]) -> Iterator[tuple[list[int], dict]]:
    """Yield (members, values): loops that share one drawing, with an array for each number that differs."""
    groups: dict[tuple, list[int]] = {}
    for number, values in enumerate(loops):
        groups.setdefault(_structure(values), []).append(number)
    for members in groups.values():
        first = loops[members[0]]
        columns = {path: [loops[member][path] for member in members] for path in first}
        yield (
            members,
            {
                path: np.array(column) if any(value != column[0] for value in column) else column[0]
                for path, column in columns.items()
            },
        )


def _structure(values: Mapping) -> tuple:
    """Values that loops of one drawing share: all that are no floats, and which of the numbers that decide it are zero."""
    fixed: Iterable = ((path, value) for path, value in values.items() if not isinstance(value, float))
    return (*fixed, *(value == 0 for _, value in sorted(values.items()) if isinstance(value, float)))
