"""Substitution among the blocks of a structure, worked out once: the sums and products that close its junctions, in order."""

from functools import lru_cache
from math import inf
from operator import add, mul, sub

import numpy as np

ROUNDING = 8 * np.finfo(float).eps  # of the terms of a sum, what is left of it when it should be zero
NOTHING, ONE, ANY = range(3)  # patterns of an entry: 0 in the whole batch, 1 in the whole batch, or any number


def _size(number, _):
    return abs(number)


def _clean(total, size):
    """Return a sum, or 0 if it is only rounding of its terms; size: the sum of their sizes."""
    if isinstance(size, float):
        return 0.0 if abs(total) <= ROUNDING * size < inf else total
    rounding = abs(total) <= ROUNDING * size
    return np.where(rounding & np.isfinite(size), 0.0, total) if rounding.any() else total


class Plan:
    """How the blocks of a structure are connected, by steps on a list of numbers.

    blocks: name, inputs, outputs, number of states, and whether the sizes of its terms are known, of each. sums: signals, each
    with its sources. inputs, outputs, terms: see `connect`. patterns: of the entries of each block's B, C and D, by rows, and
    of the sizes of these if they are known; then of the gains. Errors: ValueError if nothing makes a signal.

    A signal is a row, a sum over others: column -> number, without zeros. Columns are states (block, count), ports (block,
    port), and names of outputs and external inputs. A number is a place in the list, which begins with the numbers of the
    patterns and 1. Results of steps follow, then the inverse of the return difference of torn ports, counted from the end.

    places: length of the list without this inverse. stages: steps before and after it, as (operation, places of its arguments,
    place of its result). loop: the part of torn ports that comes from torn ports, and its sizes. parts: E without the blocks'
    own, B, C, D, and their sizes if terms are wanted. A matrix is a list of (entry, counted by rows; place). used: signals with
    gains that matter. reached: `(torn, torn)`, which torn ports each depends on. closed: names of the ports on the loop.
    """

    def __init__(self, blocks, sums, inputs, outputs, terms, patterns):
        self._one, self._steps, self._known, given = len(patterns), [], {}, enumerate(patterns)
        states, ports, net, sized = [], {}, {}, {}
        for name, into, out, count, known in blocks:
            own, read = [(name, state) for state in range(count)], {f"{name}.{port}": (name, port) for port in into}
            for table in (net, sized)[: 1 + known]:
                table.update([(state, self._row(read.values(), given)) for state in own])
                made = [(f"{name}.{each}", self._row(own, given)) for each in out]
                table.update([(signal, row | self._row(read.values(), given)) for signal, row in made])
            states, ports = states + own, ports | read
        sized = {column: self._sizes(row) for column, row in net.items() if column not in sized} | sized
        gains = {signal: self._row(sources, given) for signal, sources in sums}
        ends = {signal: {signal: self._one} for signal in (*inputs, *net)}
        traced = dict(ends)
        for signal in (*ports, *outputs):
            self._trace(signal, gains, traced)
        self.used = gains.keys() & traced.keys() - ends.keys()

        def opened(net, traced):
            shown = [{ports[each]: self._one} if each in ports else self._total(traced[each], net) for each in outputs]
            rows = {port: self._total(traced[signal], net) for signal, port in ports.items()}
            return rows, [net[state] for state in states] + shown  # a port is better than its sum, whose terms may cancel

        rows, made = opened(net, traced)
        of_rows, of_made = opened(sized, {signal: self._sizes(row) for signal, row in traced.items()})
        read, followed, torn = {column for row in (*net.values(), *made) for column in row}, {}, {}
        for port in sorted(rows, key=lambda port: port not in read):  # those that only sizes read come last
            if port not in followed:
                self._follow(port, rows, of_rows, followed, torn)
        rows, of_rows = ({port: pair[at] for port, pair in followed.items()} for at in (0, 1))
        known = {port: row for port, row in of_rows.items() if port not in torn}
        of_rows = {port: self._total(row, known) for port, row in of_rows.items()}  # sizes of zeros may come in any order
        self.closed = [name for name, port in ports.items() if port in read and rows[port].keys() & torn]
        self.loop = [_matrix([some[port] for port in torn], torn) for some in (rows, of_rows) if torn]
        count, border = len(torn), self._one + len(self._steps)
        direct = np.array([p == q or q in rows[p] for p in torn for q in torn], float).reshape(count, count)
        self.reached = np.linalg.matrix_power(direct, count) > 0
        inverse = {
            p: {q: (i - count) * count + k for k, q in enumerate(torn) if self.reached[i, k]} for i, p in enumerate(torn)
        }
        solved = {port: {} for port in torn}
        for _ in range(min(count, 2)):  # refined, several are as uncertain as rounding of their equations (R. D. Skeel, 1980)
            left = {port: self._total(rows[port], solved) for port in torn}
            left = {p: left[p] | {k: self._number(sub, left[p][k], known) for k, known in solved[p].items()} for p in torn}
            solved = {port: self._total(inverse[port], left, own=solved[port]) for port in torn}
        self.parts = self._assembled(made, rows, solved, states, inputs, cleaned=inputs)
        if terms:
            sizes = {port: self._sizes(row) for port, row in solved.items()}
            sizes = {port: self._total(of_rows[port], sizes, own=sizes[port]) for port in torn}
            sizes = {port: self._total(self._sizes(inverse[port]), sizes) for port in torn}
            self.parts += self._assembled(of_made, of_rows, sizes, states, inputs)
        self._place(border if torn else inf)

    def _row(self, columns, given):
        return {at: self._one if each == ONE else number for at, (number, each) in zip(columns, given, strict=False) if each}

    def _trace(self, signal, gains, traced):
        """Return a signal as a row over outputs of blocks and external inputs. traced: signals of which it is known."""
        if signal not in traced:
            if signal not in gains:
                raise ValueError(f"nothing makes the signal {signal!r}")
            traced[signal] = self._total(gains[signal], {each: self._trace(each, gains, traced) for each in gains[signal]})
        return traced[signal]

    def _follow(self, port, rows, of_rows, followed, torn):
        """Replace ports but torn ones in both rows of a port. followed: both rows of ports that are done, None until then."""
        followed[port], needs = None, [each for each in rows[port] if each in rows]
        for each in needs:
            if each not in followed:
                self._follow(each, rows, of_rows, followed, torn)
            elif not followed[each]:
                torn[each] = None
        tables = ({each: pair[at] for each, pair in followed.items() if pair and each not in torn} for at in (0, 1))
        followed[port] = tuple([self._total(some[port], table) for some, table in zip((rows, of_rows), tables, strict=True)])

    def _assembled(self, made, rows, solved, states, inputs, cleaned=()):
        """Return E, B, C and D of the whole. made: rows of states' changes and of outputs. rows, solved: of (torn) ports."""
        rows = {port: solved[port] if port in solved else self._total(row, solved) for port, row in rows.items()}
        made = [self._total(row, rows, cleaned) for row in made]
        return [_matrix(some, each) for some in (made[: len(states)], made[len(states) :]) for each in (states, inputs)]

    def _number(self, *step):
        """Return the number that a step makes. No step is made twice."""
        if step not in self._known:
            self._steps.append(step)
            self._known[step] = self._one + len(self._steps)
        return self._known[step]

    def _sizes(self, row):
        return {at: number if number == self._one else self._number(_size, number, number) for at, number in row.items()}

    def _total(self, row, rows, cleaned=(), own=()):
        """Return the row `own` plus the row with signals replaced by their rows. cleaned: columns of which an entry is 0 if it
        is only rounding of its terms. (The wall's force may reach the avatar twice, by +1/b and -1/b, which leaves eps/b.)
        """
        found, sizes, one = dict(own), {}, self._one
        for at, factor in row.items():
            for column, number in rows[at].items() if at in rows else ((at, one),):
                term = factor if number == one else number if factor == one else self._number(mul, factor, number)
                if column in found and column in cleaned:
                    size = sizes[column] if column in sizes else self._number(_size, found[column], found[column])
                    sizes[column] = self._number(add, size, self._number(_size, term, term))
                found[column] = self._number(add, found[column], term) if column in found else term
        return found | {column: self._number(_clean, found[column], size) for column, size in sizes.items()}

    def _place(self, border):
        """Leave out steps that nothing needs, and use places again. border: the last number before the inverse is known."""
        matrices, steps, place, free = [*self.loop, *self.parts], list(enumerate(self._steps, self._one + 1)), {}, []
        self.places, self.stages = self._one + 1, [[], []]
        last = {number: inf for matrix in matrices for _, number in matrix}
        for number, (_, one, other) in reversed(steps):
            if number in last:
                last.setdefault(one, number)
                last.setdefault(other, number)
        for number, (operation, one, other) in steps:
            if number in last:
                first, second = place.get(one, one), place.get(other, other)
                if last[one] == number:
                    free.append(first)
                if other != one and last[other] == number:
                    free.append(second)
                if free:
                    place[number] = at = free.pop()
                else:
                    place[number] = at = self.places
                    self.places += 1
                self.stages[number > border].append((operation, first, second, at))
        for matrix in matrices:
            matrix[:] = [(entry, place.get(number, number)) for entry, number in matrix]
        self._steps = self._known = None


def _matrix(rows, columns):
    at = {column: k for k, column in enumerate(columns)}
    return [(k * len(at) + at[column], row[column]) for k, row in enumerate(rows) for column in row if column in at]


plan_of = lru_cache(maxsize=256)(Plan)  # the same for all loops that have the structure
