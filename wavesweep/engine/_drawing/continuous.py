"""Which terms of a wire act continuously: those by which plants act on each other."""

from collections.abc import Iterable, Iterator, Mapping

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._drawing.expressions import (
    Fault,
    Terms,
    Tree,
)

Wires = tuple[tuple[str, Terms], ...]


def _multiplied_out(terms: Terms) -> list[tuple[str, Tree]]:
    """Return terms with a summand of their gain each."""
    return [(signal, factor) for signal, gain in terms for factor in _summands(gain, products=True)]


def parted(
    tree: Tree, signals: set[str], plant: str, plants: Mapping[str, str]
) -> tuple[Terms, Terms]:
    """Return the terms of the wire of a plant that are held over a tick, and those that act
    continuously.

    plant: name of the plant. plants: name and type of each one.

    A wire is a sum. A summand that reads another plant acts continuously, as a spring `ks*(link.x -
    motor.x)` does, and so does the other half of one that is multiplied out, `ks*link.x - (ks +
    kp)*motor.x`, or stands in brackets, `g*(ks*(link.x - motor.x) - kp*motor.x)`. What else reads
    the plant alone is what a controller computes from samples, `-kp*motor.x`. Signals of other
    blocks and the hand's force are held. Errors: Fault as for `linear`, and if terms in both
    positions, or both velocities, are left that form no spring or damper.
    """
    wire = tree.linear(signals)
    held_terms: list[tuple[str, Tree]] = []
    continuous: list[tuple[str, Tree]] = []
    halves: list[tuple[str, Tree]] = []  # read another plant
    alone: list[tuple[str, Tree]] = []  # read the plant itself
    for summand in _summands(tree):
        blocks = {name.rpartition(".")[0] for name in summand.names if name in signals}
        far_plants = plants.keys() & blocks - {plant}
        terms = _multiplied_out(summand.linear(signals))
        if far_plants and plant in blocks:
            far = [term for term in terms if term[0].rpartition(".")[0] in far_plants]
            near = [term for term in terms if term[0].rpartition(".")[0] == plant]
            pairs = _opposite_pairs(near, far)
            ends = {signal.rpartition(".")[2] for signal, _ in far}
            if any(signal.rpartition(".")[2] in ends for signal, _ in near):
                continuous += terms  # whose ends do not fit, as behind a gear: it is one term
            else:
                continuous += pairs
                halves += far
                alone += near
                held_terms += [term for term in terms if term not in (*pairs, *near, *far)]
        elif far_plants:
            halves += terms
        elif blocks == {plant}:
            alone += terms
        else:
            held_terms += terms
    if not (continuous or halves):
        return wire, ()
    continuous += _opposite_pairs(alone, halves)
    springs = _springs(tree, plant, plants, alone, halves)
    continuous += springs
    alone = [term for term in alone if term not in springs]
    sampled = [term for term in (*continuous, *halves) if term[0].rpartition(".")[0] not in plants]
    return _added([*held_terms, *alone, *sampled]), _added(
        term for term in (*continuous, *halves) if term not in sampled
    )


def _opposite_pairs(
    near: list[tuple[str, Tree]], far: list[tuple[str, Tree]]
) -> list[tuple[str, Tree]]:
    """Take pairs out of both lists, and return them: a term of the wire that reads this plant (near),
    and one that reads another plant (far), with the opposite gain."""
    pairs = []
    for far_term in list(far):
        port = far_term[0].rpartition(".")[2]
        opposites = [term for term in near if _opposite(far_term[1], term[1])]
        near_term = min(opposites, key=lambda term: not term[0].endswith(f".{port}"), default=None)
        if near_term:
            near.remove(near_term)
            far.remove(far_term)
            pairs += [far_term, near_term]
    return pairs


def _springs(
    tree: Tree,
    plant: str,
    plants: Mapping[str, str],
    alone: list[tuple[str, Tree]],
    halves: list[tuple[str, Tree]],
) -> list[tuple[str, Tree]]:
    """Return the terms in a plant alone that are the near ends of springs and dampers, whose far
    ends are halves.

    Errors: Fault if the gains of both ends do not add up to 0.
    """
    springs = []
    for port in (f".{port}" for port in ("x", "v") if TYPES[plants[plant]].body):
        of_bodies = {f"{name}{port}" for name, kind in plants.items() if TYPES[kind].body}
        near_ends, far_ends = (
            [term for term in terms if term[0] in of_bodies] for terms in (alone, halves)
        )
        if near_ends and far_ends and not _balance([*near_ends, *far_ends]):
            signal, gain = near_ends[0]
            far, _ = far_ends[0]
            raise Fault(
                min(place for name, place in tree.places_of_names() if name == signal),
                f"a number times ({far} - {signal}), as of a spring or a damper, or a block hold for what a program computes",
                f"{gain.text} times {signal}, which may be either",
            )
        springs += near_ends if far_ends else []
    return springs


def _blocks_read(wires: Wires, couplings: Wires, seen: Terms) -> set[str]:
    """Return the blocks that the hand's port reads, by itself or through other blocks."""
    read = {port.rpartition(".")[0] for port, _ in wires}
    before = None
    while read != before:
        before = read
        read = {signal.rpartition(".")[0] for signal, _ in seen}
        for port, terms in (*wires, *couplings):
            if (block := port.rpartition(".")[0]) in before:
                read |= {signal.rpartition(".")[0] for signal, _ in terms} - {block}
    return read


def watching_held(wires: Wires, couplings: Wires, seen: Terms) -> tuple[Wires, Wires]:
    """Return wires and couplings in which terms that act on a plant that nothing reads are wires:
    nothing shows how they act.

    A block that nothing reads itself does not count as a reader. What such a plant does to itself
    stays a coupling. seen: signals at the hand's port.
    """
    read = _blocks_read(wires, couplings, seen)
    held_terms = {}
    continuous = []
    for port, terms in couplings:
        block = port.rpartition(".")[0]
        inside = tuple(
            term for term in terms if block in read or term[0].rpartition(".")[0] == block
        )
        held_terms[port] = [term for term in terms if term not in inside]
        continuous += [(port, inside)] if inside else []
    return tuple(
        (port, _added([*terms, *held_terms.get(port, ())])) for port, terms in wires
    ), tuple(continuous)


def _summands(tree: Tree, products: bool = False) -> Iterator[Tree]:
    """Yield the trees that a tree is the sum of; products: multiplied out."""
    operation = tree.operation
    if operation in ("+", "-", "negative"):
        *first, last = tree.operands
        for operand in first:
            yield from _summands(operand, products)
        for summand in _summands(last, products):
            yield summand if operation == "+" else Tree("negative", (summand,), tree.offset)
    elif products and operation in ("*", "/"):
        left_operand, right_operand = tree.operands
        seconds = list(_summands(right_operand, products)) if operation == "*" else [right_operand]
        for factor in _summands(left_operand, products):
            for second in seconds:
                yield Tree(operation, (factor, second), tree.offset)
    else:
        yield tree


def _opposite(first: Tree, second: Tree) -> bool:
    """Whether two gains differ in their signs alone."""
    return (-first).text == second.text or first.text == (-second).text


def _balance(terms: Iterable[tuple[str, Tree]]) -> bool:
    """Whether gains are plain numbers that add up to 0: the force does not change if all moves
    together."""
    gains = [gain for _, gain in terms]
    if any(gain.names for gain in gains):
        return False
    values = [gain.evaluate({}) for gain in gains]
    # Relative, of gains that add up to 0.
    return bool(abs(sum(values)) <= 1e-12 * sum(map(abs, values)))


def _added(terms: Iterable[tuple[str, Tree]]) -> Terms:
    gains_of: dict[str, list[Tree]] = {}
    for signal, gain in terms:
        gains_of.setdefault(signal, []).append(gain)
    sums = {}
    for signal, (first, *further) in gains_of.items():
        sums[signal] = first
        for gain in further:
            sums[signal] = Tree("+", (sums[signal], gain), gain.offset)
    return tuple(sums.items())
