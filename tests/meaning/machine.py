"""A loop of the reader's instants, marched over its period in double precision."""

from fractions import Fraction

import numpy as np
from scipy.linalg import expm

from wavesweep.checker.reader.loops import Instant, Schedule

REST = 1e-7  # turns in a period for what is at rest: what cancels leaves nine digits


class NoSolution(Exception):
    """The equations of an instant have no solution, or not one alone."""


class Machine:
    """A schedule as matrices over all memory."""

    def __init__(self, schedule: Schedule):
        self.schedule = schedule
        self.memory = _memory_of(schedule)
        self.inputs = _names("!", schedule)
        self.solved = {kind: self._solve(instant) for kind, instant in schedule.kinds.items()}
        moved = self._solve(schedule.motion)[0]
        still = [place for name, place in self.memory.items() if name not in schedule.motion.writes]
        moved[still] = 0.0
        self.generator = moved
        self.flows: dict[Fraction, np.ndarray] = {}
        self.periods: dict[tuple[str, ...], tuple] = {}

    def _solve(self, instant):
        """(M, N, Y, Z, variables): memory M m + N w after it, variables Y m + Z w."""
        variables = {name: place for place, name in enumerate(instant.equations)}
        left = np.eye(len(variables))
        Y = np.zeros((len(variables), len(self.memory)))
        Z = np.zeros((len(variables), len(self.inputs)))
        for name, terms in instant.equations.items():
            for other, coefficient in terms.items():
                if other in variables:
                    left[variables[name], variables[other]] -= float(coefficient)
                elif other in self.memory:
                    Y[variables[name], self.memory[other]] += float(coefficient)
                else:
                    Z[variables[name], self.inputs[other]] += float(coefficient)
        if variables:
            if np.linalg.cond(left) > 1e13:
                raise NoSolution(", ".join(variables))
            both = np.linalg.solve(left, np.hstack([Y, Z]))
            Y = both[:, : len(self.memory)]
            Z = both[:, len(self.memory) :]
        M = np.eye(len(self.memory))
        N = np.zeros((len(self.memory), len(self.inputs)))
        for name, terms in instant.writes.items():
            row = np.zeros(len(self.memory))
            driven = np.zeros(len(self.inputs))
            for other, coefficient in terms.items():
                if other in variables:
                    row += float(coefficient) * Y[variables[other]]
                    driven += float(coefficient) * Z[variables[other]]
                elif other in self.memory:
                    row[self.memory[other]] += float(coefficient)
                else:
                    driven[self.inputs[other]] += float(coefficient)
            M[self.memory[name]] = row
            N[self.memory[name]] = driven
        return M, N, Y, Z, variables

    def _flow(self, duration: Fraction):
        if duration not in self.flows:
            self.flows[duration] = expm(self.generator * float(duration))
        return self.flows[duration]

    def steps(self):
        """(kind, number of the tick or None, flow to the next instant) of one period, in order."""
        times = self.schedule.times
        for place, (time, kind) in enumerate(times):
            last = place + 1 == len(times)
            until = self.schedule.period if last else times[place + 1][0]
            yield kind, self.schedule.ticks.get(place), self._flow(until - time) if until > time else None

    def monodromy(self) -> np.ndarray:
        """Memory after a period, for each unit memory before it."""
        columns = np.eye(len(self.memory))
        for kind, _, flow in self.steps():
            columns = self.solved[kind][0] @ columns
            if flow is not None:
                columns = flow @ columns
        return columns

    def run(self, driven: np.ndarray, which: str, names) -> dict[str, np.ndarray]:
        """The named signals in each tick, from rest, if the input `which` is `driven` in them."""
        memory = np.zeros(len(self.memory))
        outside = np.zeros(len(self.inputs))
        rows = {name: np.full(len(driven), np.nan) for name in names}
        tick = -1
        while True:
            for kind, number, flow in self.steps():
                M, N, Y, Z, variables = self.solved[kind]
                if number is not None:
                    tick += 1
                    if tick == len(driven):
                        return rows
                    outside[self.inputs["!" + which]] = driven[tick]
                    for name in names:
                        place = variables[self.schedule.shown[name]]
                        rows[name][tick] = Y[place] @ memory + Z[place] @ outside
                memory = M @ memory + N @ outside
                if flow is not None:
                    memory = flow @ memory

    def response(self, hertz: float, which: str, names) -> dict[str, complex]:
        """The component of each signal at the frequency of a sine of the input, held over ticks.

        At 0 Hz it is the limit: the real part at two low frequencies, less what grows with their square.
        """
        period = float(self.schedule.period)
        if hertz:
            return self._component(hertz * period, which, names)
        low = self._component(REST, which, names)
        double = self._component(2 * REST, which, names)
        return {name: (4 * low[name].real - double[name].real) / 3 + 1j * low[name].imag for name in names}

    def _component(self, turns: float, which, names):
        """With the memory z, the input turn^k in tick k and n ticks in a period, turn^n z = A z + b."""
        count = len(self.schedule.ticks)
        pushes = np.exp(2j * np.pi * turns * np.arange(count) / count)
        A, B, rows, driven = self.lifted(which, names)
        memory = np.linalg.solve(np.exp(2j * np.pi * turns) * np.eye(len(A)) - A, B @ pushes)
        shown = (rows @ memory + driven @ pushes).reshape(count, len(names)) / pushes[:, None]
        return dict(zip(names, shown.mean(axis=0), strict=True))

    def lifted(self, which: str, names) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """A, B, C, D of a period: memory after it, and the named signals of its ticks in turn, of memory before it and inputs.

        The input `which` has a column for each tick, over which it is held.
        """
        called = (which, *names)
        if called in self.periods:
            return self.periods[called]
        size = len(self.memory)
        columns = np.eye(size, size + len(self.schedule.ticks))
        rows = []
        at = self.inputs["!" + which]
        column = size
        for kind, number, flow in self.steps():
            M, N, Y, Z, variables = self.solved[kind]
            if number is not None:
                column = size + number
                for name in names:
                    place = variables[self.schedule.shown[name]]
                    row = Y[place] @ columns
                    row[column] += Z[place, at]
                    rows.append(row)
            columns = M @ columns
            columns[:, column] += N[:, at]
            if flow is not None:
                columns = flow @ columns
        seen = np.array(rows)
        self.periods[called] = columns[:, :size], columns[:, size:], seen[:, :size], seen[:, size:]
        return self.periods[called]


def radius(monodromy: np.ndarray, drift: int) -> float:
    """The largest modulus of the eigenvalues but the `drift` ones next to 1."""
    values = np.linalg.eigvals(monodromy)
    order = np.argsort(abs(values - 1))
    return float(abs(values[order[drift:]]).max(initial=0.0))


def at_one(monodromy: np.ndarray) -> int:
    """How many eigenvalues are exactly 1, as far as rounding tells.

    Rounding moves several that belong together apart by its root, but not their mean.
    """
    distances = np.linalg.eigvals(monodromy) - 1
    near = sorted(distances[abs(distances) < 1e-8], key=abs)
    while near and abs(np.mean(near)) > 1e-11:
        near.pop()
    return len(near)


def _names(mark: str, schedule: Schedule) -> dict[str, int]:
    found: dict[str, int] = {}
    for instant in _instants(schedule):
        for terms in (*instant.equations.values(), *instant.writes.values()):
            for name in terms:
                if name.startswith(mark):
                    found.setdefault(name, len(found))
    return found


def _instants(schedule: Schedule) -> list[Instant]:
    return [*schedule.kinds.values(), schedule.motion]


def _memory_of(schedule: Schedule) -> dict[str, int]:
    found = _names("@", schedule)
    for instant in _instants(schedule):
        for name in instant.writes:
            found.setdefault(name, len(found))
    return found
