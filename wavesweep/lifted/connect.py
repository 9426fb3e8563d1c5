"""Connection of blocks of one rate through their summing junctions, with every algebraic loop closed exactly."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from wavesweep.diagram.block import Block, numbers
from wavesweep.errors import IllPosedLoopError
from wavesweep.lifted.sparse import Diagonal, Row, add_to, between, plain_or_array, product, rows_of, sizes_of, stacked, summed

WORST_CONDITION = 1e12  # beyond it a closed loop keeps fewer than 4 digits, which is no answer

REFINED = 2  # steps of refinement of an inverse


def connect(name: str, blocks, sums, inputs, outputs, terms: bool = False) -> Block:
    """Close every junction among `blocks` and return one block from the signals `inputs` to the signals `outputs`.

    name: of the block. blocks: `Block`s of one rate. sums: signal -> {source signal: gain}. inputs: external signals. outputs:
    any signals. terms: whether the block has the sizes of the terms of its entries' sums (see `Block`).
    Errors: IllPosedLoopError if the algebraic loop through the direct terms is singular to working precision.

    The ports are visited in the order in which their direct terms need each other. If this comes to a port again, the port is
    torn: it is unknown until all others are sums of states, inputs and torn ports, and then found from as many equations as
    ports are torn (G. Kron, Diakoptics, 1963).
    """
    net = _Net.of(blocks, sums, inputs, outputs)
    order, torn = net.order()
    rows, sized = net.followed(order, torn), net.sized(blocks, terms) if torn or terms else None
    inverse, condition, pivot = np.zeros((0, 0)), 1.0, 1.0
    if torn:
        sizes = sized.loop(sized.followed(order, torn, states=False), torn)
        closed = [port for port, row in zip(net.ports, rows, strict=True) if max(row, default=0) >= len(net.E) + net.inputs]
        inverse, condition, pivot = _loop_inverse(net.loop(rows, torn), sizes, net.reached(rows, torn), name, closed)
        with np.errstate(over="ignore", invalid="ignore"):
            known = net.solved(rows, torn, inverse)
        rows = net.untorn(rows, torn, known)
    for block in blocks:
        condition, pivot = condition * block.condition, pivot * block.pivot
    states = tuple(f"{block.name}.{state}" for block in blocks for state in block.states)
    with np.errstate(over="ignore", invalid="ignore"):  # a frame that overflows is for the caller to see
        parts = net.assembled(rows)
        if terms:
            rows = sized.followed(order, torn)
            uncertain = product(np.abs(inverse), sized.unsolved(rows, torn, list(map(sizes_of, known)), 1.0)) if torn else []
            terms = sized.assembled(sized.untorn(rows, torn, uncertain))
    facts = {"condition": condition, "pivot": pivot, "terms": terms or None}
    return Block(name, tuple(inputs), tuple(outputs), states, *parts, **facts)


@dataclass(frozen=True, slots=True)
class _Net:
    """Blocks and the gains between them, entry by entry.

    E: between states. B: of each state; C, D: of each block output; a row maps states (C) or ports (B, D) to the entries that
    are not zero.
    ports: a name per block input. into, out: of each port, and of each output signal of the net, the gains of block outputs and
    of external inputs. shown: the port that an output signal of the net is, if it is one. inputs: number of external inputs.
    batch: shape. kind: type of the numbers.
    """

    E: Diagonal
    B: list[Row]
    C: list[Row]
    D: list[Row]
    ports: list[str]
    into: list[tuple[Row, Row]]
    out: list[tuple[Row, Row]]
    shown: list[int | None]
    inputs: int
    batch: tuple[int, ...]
    kind: np.dtype

    @staticmethod
    def of(blocks, sums, inputs, outputs) -> "_Net":
        """Return the net of these blocks; see `connect`."""
        tracer = _Tracer(blocks, sums, inputs)
        ports = [f"{block.name}.{port}" for block in blocks for port in block.inputs]
        into, out = ([tracer.gains(signal) for signal in signals] for signals in (ports, outputs))
        arrays = [getattr(block, part) for block in blocks for part in "EBCD"]
        batch = np.broadcast_shapes(*{array.shape[:-2] for array in arrays}, *{gain.shape for gain in tracer.used})
        parts = {"E": Diagonal(block.E for block in blocks)} | {part: [] for part in "BCD"}
        states = first_port = 0
        for block in blocks:
            for part, column in (("B", first_port), ("C", states), ("D", first_port)):
                parts[part] += rows_of(getattr(block, part), column)
            states, first_port = states + len(block.states), first_port + len(block.inputs)
        kind = np.result_type(float, *{array.dtype for array in (*arrays, *tracer.used)})
        shown = [ports.index(signal) if signal in ports else None for signal in outputs]
        return _Net(**parts, ports=ports, into=into, out=out, shown=shown, inputs=len(inputs), batch=batch, kind=kind)

    def sized(self, blocks, states: bool) -> "_Net":
        """Return the net with every number replaced by its size, those of blocks by the sizes of their terms if it has them.

        states: whether to include the entries of states; those from port to port are always there.
        """
        parts = {part: list(map(sizes_of, getattr(self, part))) for part in ("BCD" if states else "D")}
        if states:
            parts["E"] = Diagonal(block.terms[0] if block.terms else np.abs(block.E) for block in blocks)
        n = m = p = 0
        for block in blocks:
            if block.terms:
                places = ("B", n, m), ("C", p, n), ("D", p, m)
                for (part, row, column), size in zip(places, block.terms[1:], strict=True):
                    if part in parts:
                        parts[part][row : row + size.shape[-2]] = rows_of(size, column)
            n, m, p = n + len(block.states), m + len(block.inputs), p + len(block.outputs)
        into, out = ([tuple(map(sizes_of, pair)) for pair in pairs] for pairs in (self.into, self.out))
        return replace(self, **parts, into=into, out=out, kind=np.dtype(float))

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
        first = len(self.E) + self.inputs
        unknown = {port: {first + at: 1.0} for at, port in enumerate(torn)}
        rows, known = [{} for _ in self.into], {}
        for port in order:
            outputs, outside = self.into[port]
            row = {len(self.E) + column: gain for column, gain in outside.items()}
            for output, gain in outputs.items():
                if output not in known:
                    known[output] = dict(self.C[output]) if states else {}
                    for other, through in self.D[output].items():
                        add_to(known[output], unknown.get(other, rows[other]), through)
                add_to(row, known[output], gain)
            rows[port] = row
        return rows

    def loop(self, rows, torn):
        """Return the part of the torn ports that comes from torn ports, `(..., torn, torn)`."""
        first = len(self.E) + self.inputs
        return stacked([between(rows[port], first) for port in torn], len(torn), self.batch, self.kind)

    def reached(self, rows, torn):
        """Return which torn ports each of them depends on, directly or through others, `(torn, torn)`."""
        first, found = len(self.E) + self.inputs, np.eye(len(torn), dtype=bool)
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
        first, found = len(self.E) + self.inputs, []
        for port, own in zip(torn, known, strict=True):
            found.append({column: value for column, value in rows[port].items() if column < first})
            add_to(found[-1], own, sign)
            for at, factor in between(rows[port], first).items():
                add_to(found[-1], known[at], factor)
        return found

    def untorn(self, rows, torn, solved) -> list[Row]:
        """Return every port as a sum over states and inputs alone; solved: the torn ports."""
        first, found = len(self.E) + self.inputs, []
        for port, row in enumerate(rows):
            if port in torn:
                found.append(solved[torn.index(port)])
                continue
            found.append({column: value for column, value in row.items() if column < first})
            for at, factor in between(row, first).items():
                add_to(found[-1], solved[at], factor)
        return found

    def assembled(self, rows) -> tuple[np.ndarray, ...]:
        """Return E, B, C and D of the whole net from its ports."""
        n, found = len(self.E), []
        for state, ports in enumerate(self.B):
            found.append(summed({}, ports, rows, n, partial(self.E.entry, state)))
        for (outputs, outside), port in zip(self.out, self.shown, strict=True):
            base, ports = {n + column: gain for column, gain in outside.items()}, {}
            for output, gain in outputs.items():
                add_to(base, self.C[output], gain)
                add_to(ports, self.D[output], gain)
            if port is not None:  # what is known of a port is better than its sum, whose terms may cancel
                base, ports = {}, {port: 1.0}
            found.append(summed(base, ports, rows, n))
        whole = []
        for some, base in ((found[:n], self.E), (found[n:], None)):
            for first, width, own in ((0, n, base), (n, self.inputs, None)):
                rows = [between(row, first, first + width) for row in some]
                whole.append(stacked(rows, width, self.batch, self.kind, own))
        return tuple(whole)


class _Tracer:
    """Follows a signal back through the junctions to block outputs and external inputs."""

    def __init__(self, blocks, sums, inputs):
        outputs = [f"{block.name}.{port}" for block in blocks for port in block.outputs]
        self.sums = sums
        self.outputs = {signal: i for i, signal in enumerate(outputs)}
        self.inputs = {signal: i for i, signal in enumerate(inputs)}
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
            for source, gain in self.sums[signal].items():
                if not isinstance(gain, int | float):
                    self.used.append(numbers(gain))
                add_to(total, self.trace(source), plain_or_array(gain))
            self.known[signal] = total
        return self.known[signal]


def _loop_inverse(loop, sizes, reached, name, ports):
    """Return the inverse of the return difference of torn ports, its condition number and its determinant.

    sizes: of the terms that the loop's entries are sums of. reached: entries of the inverse that are not zero by structure.
    Errors: IllPosedLoopError if the condition number shows that the loop is ill-posed.
    """
    one = np.eye(loop.shape[-1])
    loop = one - loop
    overflown = ~np.isfinite(loop).all((-1, -2))  # a frame that overflows is for the caller to see
    with np.errstate(all="ignore"):
        inverse, pivot = (1 / loop, loop[..., 0, 0]) if loop.shape[-1] == 1 else _inverse(loop, overflown, reached)
    condition = _condition(inverse, one + sizes)
    if not np.all((condition < WORST_CONDITION) | overflown):
        raise IllPosedLoopError(
            f"the algebraic loop of the {name} side through {', '.join(ports)} is ill-posed: condition number "
            f"{float(np.max(condition)):.1e}, expected below {WORST_CONDITION:.0e}; give the loop a delay "
            "(environment.delay or local_model.delay) or change the gain that closes it"
        )
    return inverse, condition, pivot


def _inverse(loop, overflown, reached):
    """Return the inverse and the determinant of a return difference; see `_loop_inverse`."""
    try:
        inverse = np.linalg.inv(np.where(overflown[..., None, None], np.nan, loop))
    except np.linalg.LinAlgError:
        inverse = np.full_like(loop, np.inf)
    for _ in range(REFINED):  # entries that are small beside the largest have lost their digits
        inverse = inverse + inverse @ (np.eye(loop.shape[-1]) - loop @ inverse)
    inverse[..., ~reached] = 0.0
    return inverse, np.linalg.det(loop)


def _condition(inverse, sizes):
    """Return the condition number for the best choice of units, the spectral radius of |L^-1| |L| (Bauer 1963).

    With it, a wave impedance of 1e-9, which makes entries of very different sizes, is no ill-posed loop. The number is
    overestimated by a small factor, since it is found from the norm of a power.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        power = np.abs(inverse) @ sizes
        for _ in range(3 if power.shape[-1] > 1 else 0):
            power = power @ power
        condition = power.sum(-1).max(-1, initial=0) ** (0.125 if power.shape[-1] > 1 else 1.0)
    return np.where(np.isnan(condition), np.inf, condition)
