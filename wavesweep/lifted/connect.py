"""Connection of blocks of one rate through their summing junctions, with every algebraic loop closed exactly."""

from dataclasses import dataclass, replace
from math import prod

import numpy as np

from wavesweep.diagram.block import Block, numbers
from wavesweep.errors import IllPosedLoopError

WORST_CONDITION = 1e12  # beyond it a closed loop keeps fewer than 4 digits, which is no answer

REFINED = 2  # steps of refinement of an inverse
ROUNDING = 8 * np.finfo(float).eps  # of the terms of a sum, what is left of it when it should be zero

Row = dict[int, object]
"""A signal as a sum over columns: states, then inputs from outside, then torn ports; column -> number or array over the batch.

Loops are sparse, and an entry that does not vary over a batch is a plain number here: dense products of small matrices cost
ten times as much. Each sum is added up in an order that the structure alone decides, so a loop does not depend on its batch.
"""


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
    rows, sized = net.followed(order, torn), net.sized(blocks) if torn or terms else None
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
            uncertain = _products(np.abs(inverse), sized.unsolved(rows, torn, list(map(_sizes, known)), 1.0)) if torn else []
            terms = sized.assembled(sized.untorn(rows, torn, uncertain))
    facts = {"condition": condition, "pivot": pivot, "terms": terms or None}
    return Block(name, tuple(inputs), tuple(outputs), states, *parts, **facts)


@dataclass(frozen=True, slots=True)
class _Net:
    """Blocks and the gains between them, entry by entry.

    E, B: of each state; C, D: of each block output; a row maps states (E, C) or ports (B, D) to the entries that are not zero.
    ports: a name per block input. into, out: of each port, and of each output signal of the net, the gains of block outputs and
    of external inputs. shown: the port that an output signal of the net is, if it is one. inputs: number of external inputs.
    batch: shape. kind: type of the numbers.
    """

    E: list[Row]
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
        parts = {part: [] for part in "EBCD"}
        states = first_port = 0
        for block in blocks:
            for part, column in (("E", states), ("B", first_port), ("C", states), ("D", first_port)):
                parts[part] += _entries(getattr(block, part), column)
            states, first_port = states + len(block.states), first_port + len(block.inputs)
        kind = np.result_type(float, *{array.dtype for array in (*arrays, *tracer.used)})
        shown = [ports.index(signal) if signal in ports else None for signal in outputs]
        return _Net(**parts, ports=ports, into=into, out=out, shown=shown, inputs=len(inputs), batch=batch, kind=kind)

    def sized(self, blocks) -> "_Net":
        """Return the net with every number replaced by its size, those of blocks by the sizes of their terms if it has them."""
        parts = {part: [_sizes(row) for row in getattr(self, part)] for part in "EBCD"}
        n = m = p = 0
        for block in blocks:
            if block.terms:
                places = ("E", n, n), ("B", n, m), ("C", p, n), ("D", p, m)
                for (part, row, column), size in zip(places, block.terms, strict=True):
                    parts[part][row : row + size.shape[-2]] = _entries(size, column)
            n, m, p = n + len(block.states), m + len(block.inputs), p + len(block.outputs)
        into, out = ([tuple(map(_sizes, pair)) for pair in pairs] for pairs in (self.into, self.out))
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
                        _add(known[output], unknown.get(other, rows[other]), through)
                _add(row, known[output], gain)
            rows[port] = row
        return rows

    def loop(self, rows, torn):
        """Return the part of the torn ports that comes from torn ports, `(..., torn, torn)`."""
        first = len(self.E) + self.inputs
        return _stacked([_part(rows[port], first) for port in torn], len(torn), self.batch, self.kind)

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
        found = _products(inverse, self.unsolved(rows, torn, [{} for _ in torn]))
        again = _products(inverse, self.unsolved(rows, torn, found)) if len(torn) > 1 else []
        for row, change in zip(found, again, strict=False):
            _add(row, change, 1.0)
        return found

    def unsolved(self, rows, torn, known, sign=-1.0) -> list[Row]:
        """Return residuals of the torn ports' equations, or sizes of their terms if sign is 1; known: values of the ports."""
        first, found = len(self.E) + self.inputs, []
        for port, own in zip(torn, known, strict=True):
            found.append({column: value for column, value in rows[port].items() if column < first})
            _add(found[-1], own, sign)
            for at, factor in _part(rows[port], first).items():
                _add(found[-1], known[at], factor)
        return found

    def untorn(self, rows, torn, solved) -> list[Row]:
        """Return every port as a sum over states and inputs alone; solved: the torn ports."""
        first, found = len(self.E) + self.inputs, []
        for port, row in enumerate(rows):
            if port in torn:
                found.append(solved[torn.index(port)])
                continue
            found.append({column: value for column, value in row.items() if column < first})
            for at, factor in _part(row, first).items():
                _add(found[-1], solved[at], factor)
        return found

    def assembled(self, rows) -> tuple[np.ndarray, ...]:
        """Return E, B, C and D of the whole net from its ports."""
        n, found = len(self.E), []
        for base, ports in zip(self.E, self.B, strict=True):
            found.append(_summed(dict(base), ports, rows, n))
        for (outputs, outside), port in zip(self.out, self.shown, strict=True):
            base, ports = {n + column: gain for column, gain in outside.items()}, {}
            for output, gain in outputs.items():
                _add(base, self.C[output], gain)
                _add(ports, self.D[output], gain)
            if port is not None:  # what is known of a port is better than its sum, whose terms may cancel
                base, ports = {}, {port: 1.0}
            found.append(_summed(base, ports, rows, n))
        whole = []
        for some in (found[:n], found[n:]):
            for first, width in ((0, n), (n, self.inputs)):
                rows = [_part(row, first, first + width) for row in some]
                whole.append(_stacked(rows, width, self.batch, self.kind))
        return tuple(whole)


def _entries(matrix, first) -> list[Row]:
    """Return the entries of each row that are not zero in the whole batch, by their columns, the first of which is `first`."""
    if matrix.ndim == 2 and matrix.dtype.kind != "c":
        return [{first + at: each for at, each in enumerate(row) if each} for row in matrix.tolist()]
    (*batch, height, width), found = matrix.shape, [{} for _ in range(matrix.shape[-2])]
    flat = matrix.reshape(prod(batch), height * width)
    filled = np.flatnonzero((flat != 0).any(0))
    if not filled.size:
        return found
    some = np.ascontiguousarray(flat[:, filled].T)
    one = some[:, 0]
    plain = (some == one[:, None]).all(1) & (one.imag == 0)  # see `_number`
    for at, place in enumerate(filled.tolist()):
        found[place // width][first + place % width] = one[at].real.item() if plain[at] else some[at].reshape(batch)
    return found


def _number(each):
    """Return a plain number if `each` is the same real number in the whole batch, and an array otherwise.

    Complex numbers stay in arrays, since Python multiplies them differently.
    """
    if isinstance(each, int | float):
        return float(each)
    each = numbers(each)
    flat = each.ravel()
    if not flat.size or flat[0] != flat[-1] or flat[0].imag != 0 or not (flat == flat[0]).all():
        return each
    return flat[0].real.item()


def _add(row, other, factor):
    """Add `factor` times the other row to the row."""
    plain = isinstance(factor, float) and factor == 1.0
    for column, value in other.items():
        term = value if plain else factor * value
        row[column] = row[column] + term if column in row else term


def _products(matrix, rows) -> list[Row]:
    """Return a matrix times rows."""
    found = []
    for line in _entries(matrix, 0):
        found.append({})
        for at, factor in line.items():
            _add(found[-1], rows[at], factor)
    return found


def _sizes(row) -> Row:
    return {column: abs(value) for column, value in row.items()}


def _part(row, first, end=np.inf) -> Row:
    """Return the columns from `first` on up to `end`, counted from `first`."""
    return {column - first: value for column, value in row.items() if first <= column < end}


def _stacked(rows, width, batch, kind):
    """Return rows as an array `(..., len(rows), width)`.

    If the batch has several axes, each axis along which nothing varies has length 1.
    """
    if len(batch) > 1:
        batch = np.broadcast_shapes((1,) * len(batch), *{np.shape(value) for row in rows for value in row.values()})
    out = np.zeros((*batch, len(rows), width), kind)
    for at, row in enumerate(rows):
        for column, value in row.items():
            out[..., at, column] = value
    return out


def _summed(row, ports, rows, states) -> Row:
    """Return the row plus the sum of these ports; an entry of an input is 0 if it is only rounding of its terms.

    With no filter and no delay in the line the wall's force reaches the avatar twice, by +1/b and -1/b. What rounding leaves of
    that is eps/b, which is large if b is small.
    """
    sizes = {}  # of the terms, where there are several
    for port, factor in ports.items():
        for column, value in rows[port].items():
            term = factor * value
            if column in row and column >= states:
                sizes[column] = (sizes[column] if column in sizes else abs(row[column])) + abs(term)
            row[column] = row[column] + term if column in row else term
    for column, size in sizes.items():
        total = row[column]
        if isinstance(size, float):
            row[column] = 0.0 if abs(total) <= ROUNDING * size < np.inf else total
        else:
            with np.errstate(invalid="ignore"):
                row[column] = np.where((np.abs(total) <= ROUNDING * size) & np.isfinite(size), 0.0, total)
    return row


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
                _add(total, self.trace(source), _number(gain))
            self.known[signal] = total
        return self.known[signal]


def _loop_inverse(loop, sizes, reached, name, ports):
    """Return the inverse of the return difference of torn ports, its condition number and its determinant.

    sizes: of the terms that the loop's entries are sums of. reached: entries of the inverse that are not zero by structure.
    Errors: IllPosedLoopError if the condition number shows that the loop is ill-posed.
    """
    loop = np.eye(loop.shape[-1]) - loop
    overflown = ~np.isfinite(loop).all((-1, -2))  # a frame that overflows is for the caller to see
    try:
        inverse = np.linalg.inv(np.where(overflown[..., None, None], np.nan, loop))
    except np.linalg.LinAlgError:
        inverse = np.full_like(loop, np.inf)
    with np.errstate(all="ignore"):
        for _ in range(REFINED):  # entries that are small beside the largest have lost their digits
            inverse = inverse + inverse @ (np.eye(loop.shape[-1]) - loop @ inverse)
        inverse[..., ~reached], pivot = 0.0, np.linalg.det(loop)
    condition = _condition(inverse, np.eye(loop.shape[-1]) + sizes)
    if not np.all((condition < WORST_CONDITION) | overflown):
        raise IllPosedLoopError(
            f"the algebraic loop of the {name} side through {', '.join(ports)} is ill-posed: condition number "
            f"{float(np.max(condition)):.1e}, expected below {WORST_CONDITION:.0e}; give the loop a delay "
            "(environment.delay or local_model.delay) or change the gain that closes it"
        )
    return inverse, condition, pivot


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
