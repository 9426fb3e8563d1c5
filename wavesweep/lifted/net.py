"""Blocks of a structure and the gains between them, entry by entry, as terms of a tape."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from wavesweep.lifted.sparse import Row, add_to, between, product, rows_of, sizes_of, summed
from wavesweep.lifted.tape import ONE, READ


@dataclass(frozen=True, slots=True)
class Net:
    """Blocks and the gains between them, entry by entry.

    E: function of a state and a column that returns the entry, None outside of the blocks. B: of each state; C, D: of each
    block output; a row maps states (C) or ports (B, D) to the entries that are not zero.
    ports: a name per block input. into, out: of each port, and of each output signal of the net, the gains of block outputs and
    of external inputs. shown: the port that an output signal of the net is, if it is one. states, inputs: number of states and
    of external inputs.
    """

    E: object
    B: list[Row]
    C: list[Row]
    D: list[Row]
    ports: list[str]
    into: list[tuple[Row, Row]]
    out: list[tuple[Row, Row]]
    shown: list[int | None]
    states: int
    inputs: int

    @staticmethod
    def of(structure, tape) -> tuple["Net", object, list[int]]:
        """Return the net of a structure, a function that returns it with the size of every number, and the gains that it uses.

        The sizes of blocks are those of their terms, if these are known; without `terms` only those between ports are right.
        """
        patterns, given, parts = iter(structure.patterns), iter(tape.start), {part: [] for part in "BCD"}
        places = []  # of each block: its first state, port and output
        state = port = output = 0
        for _, inputs, outputs, states, _ in structure.blocks:
            places.append((state, port, output))
            for part, shape, column in (
                ("B", (states, len(inputs)), port),
                ("C", (len(outputs), states), state),
                ("D", (len(outputs), len(inputs)), port),
            ):
                parts[part] += rows_of(patterns, shape, column, given)
            state, port, output = state + states, port + len(inputs), output + len(outputs)
        known_sizes = []
        for (state, port, output), (_, inputs, outputs, states, known) in zip(places, structure.blocks, strict=True):
            own = ("B", (states, len(inputs)), state, port), ("C", (len(outputs), states), output, state)
            own = (*own, ("D", (len(outputs), len(inputs)), output, port))
            for part, shape, row, column in (own if structure.terms else own[2:]) if known else ():
                known_sizes.append((part, row, rows_of(patterns, shape, column, given)))
        gains = [1.0 if each == ONE else next(given) for each in patterns]
        tracer = _Tracer(structure, gains)
        ports = [f"{name}.{port}" for name, inputs, *_ in structure.blocks for port in inputs]
        into, out = ([tracer.gains(signal) for signal in signals] for signals in (ports, structure.outputs))
        shown = [ports.index(signal) if signal in ports else None for signal in structure.outputs]
        counts = [states for *_, states, _ in structure.blocks]
        facts = {"ports": ports, "shown": shown, "states": sum(counts), "inputs": len(structure.inputs)}
        net = Net(partial(_entry, tape, counts, 0), **parts, into=into, out=out, **facts)
        return net, partial(net.sized, partial(_entry, tape, counts, len(counts)), known_sizes), tracer.used

    def sized(self, E, known) -> "Net":
        """Return the net with every number replaced by its size; known: sizes of terms, by part and first row."""
        sizes = {part: list(map(sizes_of, getattr(self, part))) for part in "BCD"}
        for part, row, rows in known:
            sizes[part][row : row + len(rows)] = rows
        into, out = ([tuple(map(sizes_of, pair)) for pair in pairs] for pairs in (self.into, self.out))
        return replace(self, E=E, **sizes, into=into, out=out)

    def order(self) -> tuple[list[int], list[int]]:
        """Return the ports that something reads, in an order of evaluation, and those of them that are torn.

        Each port comes after those that its direct terms need, except for the torn ones.
        """
        read = {port for row in (*self.B, *self.D) for port in row} | {port for port in self.shown if port is not None}
        needs = [list(dict.fromkeys(port for output in outputs for port in self.D[output])) for outputs, _ in self.into]
        order, torn, begun, ended = [], [], set(), set()
        for first in sorted(read):
            path = [] if first in begun else [(first, iter(needs[first]))]
            begun.add(first)
            while path:
                port, rest = path[-1]
                for other in rest:
                    if other not in begun:
                        begun.add(other)
                        path.append((other, iter(needs[other])))
                        break
                    if other not in ended and other not in torn:
                        torn.append(other)
                else:
                    path.pop()
                    ended.add(port)
                    order.append(port)
        return order, torn

    def followed(self, order, torn, states=True) -> list[Row]:
        """Return every port of `order` as a sum over columns; a torn port is given as the sum that it has to be equal to.

        states: whether to add up states.
        """
        first = self.states + self.inputs
        unknown = {port: {first + at: 1.0} for at, port in enumerate(torn)}
        rows, known = [{} for _ in self.into], {}
        for port in order:
            outputs, outside = self.into[port]
            row = {self.states + column: gain for column, gain in outside.items()}
            for output, gain in outputs.items():
                if output not in known:
                    known[output] = dict(self.C[output]) if states else {}
                    for other, through in self.D[output].items():
                        add_to(known[output], unknown.get(other, rows[other]), through)
                add_to(row, known[output], gain)
            rows[port] = row
        return rows

    def reached(self, rows, torn):
        """Return which torn ports each of them depends on, directly or through others, `(torn, torn)`."""
        first, found = self.states + self.inputs, np.eye(len(torn), dtype=bool)
        for at, port in enumerate(torn):
            found[at, [column - first for column in rows[port] if column >= first]] = True
        for _ in torn:
            found = (found.astype(int) @ found) > 0
        return found

    def solved(self, rows, torn, inverse) -> list[Row]:
        """Return the torn ports as sums over states and inputs; inverse: of their return difference.

        One step of refinement leaves them as uncertain as rounding of the loop's equations makes them, entry by entry, although
        the terms of a product with the inverse may cancel (R. D. Skeel, Math. Comp. 35, 1980). One port needs none.
        """
        found = product(inverse, self.unsolved(rows, torn, [{} for _ in torn]))
        again = product(inverse, self.unsolved(rows, torn, found)) if len(torn) > 1 else []
        for row, change in zip(found, again, strict=False):
            add_to(row, change, 1.0)
        return found

    def unsolved(self, rows, torn, known, sign=-1.0) -> list[Row]:
        """Return residuals of the torn ports' equations, or sizes of their terms if sign is 1; known: values of the ports."""
        first, found = self.states + self.inputs, []
        for port, own in zip(torn, known, strict=True):
            found.append({column: value for column, value in rows[port].items() if column < first})
            add_to(found[-1], own, sign)
            for at, factor in between(rows[port], first).items():
                add_to(found[-1], known[at], factor)
        return found

    def untorn(self, rows, torn, solved) -> list[Row]:
        """Return every port as a sum over states and inputs alone; solved: the torn ports."""
        first, found = self.states + self.inputs, []
        for port, row in enumerate(rows):
            if port in torn:
                found.append(solved[torn.index(port)])
                continue
            found.append({column: value for column, value in row.items() if column < first})
            for at, factor in between(row, first).items():
                add_to(found[-1], solved[at], factor)
        return found

    def assembled(self, rows) -> tuple[list[Row], ...]:
        """Return the rows of E, B, C and D of the whole net from its ports, E without the entries to which no port adds."""
        n, found = self.states, []
        for state, ports in enumerate(self.B):
            found.append(summed({}, ports, rows, n, partial(self.E, state)))
        for (outputs, outside), port in zip(self.out, self.shown, strict=True):
            base, ports = {n + column: gain for column, gain in outside.items()}, {}
            for output, gain in outputs.items():
                add_to(base, self.C[output], gain)
                add_to(ports, self.D[output], gain)
            if port is not None:  # what is known of a port is better than its sum, whose terms may cancel
                base, ports = {}, {port: 1.0}
            found.append(summed(base, ports, rows, n))
        E, C = ([between(row, 0, n) for row in some] for some in (found[:n], found[n:]))
        B, D = ([between(row, n) for row in some] for some in (found[:n], found[n:]))
        return E, B, C, D

    def numbers(self):
        """Yield all rows."""
        yield from (*self.B, *self.C, *self.D)
        yield from (row for pairs in (self.into, self.out) for pair in pairs for row in pair)

    def on(self, tape, moved) -> "Net":
        """Return the net with its rows on another tape; moved: see `moved`."""
        parts = {part: list(map(moved, getattr(self, part))) for part in "BCD"}
        into, out = ([tuple(map(moved, pair)) for pair in pairs] for pairs in (self.into, self.out))
        return replace(self, E=partial(self.E.func, tape, *self.E.args[1:]), **parts, into=into, out=out)


def _entry(tape, counts, first, row, column):
    """Return the entry of E, None outside of the blocks; counts: states of each block; first: number of its first matrix."""
    start = 0
    for block, count in enumerate(counts):
        if start <= row < start + count:
            inside = start <= column < start + count
            return tape.do(READ, first + block, (row - start, column - start)) if inside else None
        start += count
    raise IndexError(f"row: expected one of {start}, found {row}")


class _Tracer:
    """Follows a signal back through the junctions to block outputs and external inputs; used: gains on the way, by number."""

    def __init__(self, structure, gains):
        outputs = [f"{name}.{port}" for name, _, outputs, *_ in structure.blocks for port in outputs]
        self.sums, numbered = {}, enumerate(gains)
        for signal, sources in structure.sums:
            self.sums[signal] = {source: next(numbered) for source in sources}
        self.outputs = {signal: i for i, signal in enumerate(outputs)}
        self.inputs = {signal: i for i, signal in enumerate(structure.inputs)}
        self.known, self.used = {}, []

    def gains(self, signal) -> tuple[Row, Row]:
        """Return the gains of block outputs, and those of external inputs."""
        traced = self.trace(signal)
        return tuple(
            {at[source]: gain for source, gain in traced.items() if source in at} for at in (self.outputs, self.inputs)
        )

    def trace(self, signal) -> dict:
        """Return the sources of a signal and their gains."""
        if signal in self.inputs or signal in self.outputs:
            return {signal: 1.0}
        if signal not in self.known:
            if signal not in self.sums:
                raise ValueError(f"nothing makes the signal {signal!r}")
            total = {}
            for source, (number, gain) in self.sums[signal].items():
                self.used.append(number)
                add_to(total, self.trace(source), gain)
            self.known[signal] = total
        return self.known[signal]


def moved(terms, row) -> Row:
    """Return a row with the terms of another tape."""
    return {column: each if isinstance(each, float) else terms[each.at] for column, each in row.items()}
