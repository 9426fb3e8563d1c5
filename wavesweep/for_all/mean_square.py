"""Markov chains of loops whose messages are lost at random, or whose frames are at random.

Of frames, the nodes are the length of the last one, where anything depends on it. Of messages, they
are the moments at which channels send, together with whether each channel is in a burst of losses
(E. N. Gilbert, Capacity of a burst-noise channel, Bell Syst. Tech. J. 39, 1960; E. O. Elliott, the
same, 42, 1963). Edges carry a matrix and its probability. `engine.switched` says whether the mean
square of all states decays.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from wavesweep.engine.drawing import Drawing, name_of, scalars
from wavesweep.engine.errors import UsageError
from wavesweep.engine.switched import Chances, Graph, LoopFrames, Symbol
from wavesweep.for_all.channel_families import LOST, channels_of, frames_with_messages
from wavesweep.for_all.plan import LOST as LOST_RESULT

MOST_MOMENTS = 800  # second moments, whose operator is formed
# keys of a channel, as `Losses` has them
PROBABILITIES = ("loss", "burst_loss", "burst", "burst_end")


@dataclass(frozen=True, slots=True)
class Losses:
    """The probabilities of a channel: that a message is lost, outside and in a burst, and that
    bursts begin and end."""

    outside: float
    inside: float
    begins: float
    ends: float

    def written(self) -> dict[str, float]:
        """The probabilities by the keys of a channel."""
        return {
            "loss": self.outside,
            "burst": self.begins,
            "burst_end": self.ends,
            "burst_loss": self.inside,
        }

    def factors(self, before: int, after: int, late: int | None) -> tuple[float, float]:
        """The probability that the burst goes on like this, and then that of what happens to the
        message."""
        changes = self.ends if before else self.begins
        lost = self.inside if after else self.outside
        of_burst = changes if before != after else 1 - changes
        of_message = lost if late is LOST else 1 - lost
        return of_burst, of_message


def losses_at_random(drawing: Drawing, values: Mapping[str, object]) -> dict[str, Losses]:
    """Return the probabilities of each channel of a drawn loop with these numbers.

    Errors: UsageError for channels whose messages are late or lost in any pattern.
    """
    _refuse_patterns(drawing, values)
    return _losses(_probabilities(drawing), scalars(values))


def _probabilities(drawing):
    """The expressions of the probabilities of each channel."""
    return {
        block.name: [dict(block.keys)[key] for key in PROBABILITIES] for block in drawing.channels
    }


def _losses(trees, numbers) -> dict[str, Losses]:
    """How each channel loses messages, by the expressions of its probabilities."""
    return {
        channel: Losses(*(float(tree.values(numbers)) for tree in channel_trees))
        for channel, channel_trees in trees.items()
    }


def _refuse_patterns(drawing, values):
    if patterned := [
        channel.name for channel in channels_of(drawing, values) if channel.late or channel.lost > 0
    ]:
        raise UsageError(
            f"messages lost at random: expected late = 0 and lost = 0 of other channels, found {', '.join(patterned)} with more"
        )


def chances(drawing: Drawing, values: Mapping[str, object], number: str = "") -> Chances:
    """Return the chain of a drawn loop whose messages are lost at random.

    values: flat numbers. number: that one wire or gain reads, or probabilities are linear in; empty
    for none. Errors: UsageError for another number, a loop with too many states or moments, or
    other channels whose messages are late or lost in any pattern.
    """
    _refuse_patterns(drawing, values)
    name = name_of(number) if number else ""
    numbers = scalars(values)
    trees = _probabilities(drawing)
    reads = [
        tree for channel_trees in trees.values() for tree in channel_trees if name in tree.names
    ]
    paths = [path for path, tree in drawing.trees() if name in tree.names]
    if reads and (len(paths) > len(reads) or any(tree.degree(name) > 1 for tree in reads)):
        raise UsageError(
            f"intervals along {number}: expected a number that probabilities of channels alone read, linearly, found another"
        )
    family = frames_with_messages(drawing, values, "" if reads else number)
    graph, factors = _chain(
        family, *(_losses(trees, numbers | ({name: x} if reads else {})) for x in (0.0, 1.0))
    )
    _refuse_large(
        family,
        graph,
        "messages lost at random",
        "choose longer ticks, or rates with a larger common divisor",
    )
    return Chances(family, graph, factors, not reads)


def frames_at_random(
    family: LoopFrames,
    shares: Sequence[Sequence[float]],
    results: Sequence[Sequence[float]],
    number: str,
    lost: Mapping[str, Losses],
) -> Chances:
    """Return the chain of a loop whose frames have lengths, and results, at random.

    family: along a number, or at its own values without one. shares, results, lost: see `chain_of`.
    Errors: UsageError for other lengths, or a loop with too many moments.
    """
    graph, weights = chain_of(shares, results, family.symbols, lost)
    _refuse_large(
        family,
        graph,
        "frames at random",
        "take fewer lengths, fewer channels with bursts, or shares in place of next",
    )
    return Chances(family, graph, np.tile(weights[:, None, None], 2), bool(number))


def chain_of(
    shares: Sequence[Sequence[float]],
    results: Sequence[Sequence[float]],
    symbols: Sequence[Symbol],
    lost: Mapping[str, Losses],
) -> tuple[Graph, np.ndarray]:
    """Return the chain of frames, and the probability of each of its edges.

    shares: probabilities of the lengths in the order of the symbols, a row if frames are
    independent, or a row for each length, of those of the next frame. results: those of their
    delays, and then that a result is lost, a row, or one for each length. lost: those of the
    messages of channels. Errors: UsageError for other lengths.

    A node is the length of the last frame, where anything depends on it, whether the next result is
    in place at once, which the matrix of the last frame has to know, and which channels are in a
    burst of losses.
    """
    frames = _FramesAtRandom.of(shares, results, symbols)
    probabilities = frames.probabilities()
    nodes = {node: number for number, node in enumerate(probabilities)}
    bursts = list(product(*(range(1 + (losses.begins > 0)) for losses in lost.values())))
    edges = []
    for node, kind in product(nodes, range(len(symbols))):
        before, at_once = node
        symbol = symbols[kind]
        then = (frames.length_of[kind] if frames.recalls else 0, symbol.through)
        if then not in nodes or not frames.fits(before, kind, at_once):
            continue
        weight = frames.weight(before, kind) * probabilities[then] / probabilities[node]
        for (i, burst), (j, next_burst) in product(enumerate(bursts), repeat=2):
            chance = weight * _chance_of_messages(lost, burst, next_burst, symbol.gone)
            if chance:
                source = nodes[node] * len(bursts) + i
                target = nodes[then] * len(bursts) + j
                edges.append((source, kind, target, chance))
    source, kind, target, weights = (np.array(column) for column in zip(*edges, strict=True))
    return Graph(source, kind, target), weights


@dataclass(frozen=True, slots=True)
class _FramesAtRandom:
    """The kinds of frames with their probabilities.

    shares: see `chain_of`. symbols: the kinds; length_of: the place of each one's length among the
    lengths; result: the probability of its result. recalls: whether anything depends on the length
    of the frame before.
    """

    shares: Sequence[Sequence[float]]
    symbols: Sequence[Symbol]
    lengths: list[int]
    length_of: list[int]
    result: list[float]
    recalls: bool

    @staticmethod
    def of(
        shares: Sequence[Sequence[float]],
        results: Sequence[Sequence[float]],
        symbols: Sequence[Symbol],
    ) -> "_FramesAtRandom":
        """The kinds with these probabilities, as `chain_of` has them. Errors: UsageError."""
        lengths = list(dict.fromkeys(symbol.ticks for symbol in symbols))
        if len(lengths) != len(shares[0]):
            raise UsageError(
                f"frames at random: expected {len(shares[0])} different lengths, found {len(lengths)}"
            )
        in_time = (symbol.delay for symbol in symbols if symbol.delay != LOST_RESULT)
        delays = [*dict.fromkeys(in_time), LOST_RESULT]
        length_of = [lengths.index(symbol.ticks) for symbol in symbols]
        result = []
        for symbol, length in zip(symbols, length_of, strict=True):
            of_length = results[length if len(results) > 1 else 0]  # or the same for all lengths
            result.append(of_length[delays.index(symbol.delay)])
        recalls = len(shares) > 1 or any(symbol.step is not None for symbol in symbols)
        return _FramesAtRandom(shares, symbols, lengths, length_of, result, recalls)

    def weight(self, before: int, kind: int) -> float:
        """The probability of a kind after a frame of a length."""
        shares = self.shares[before] if len(self.shares) > 1 else self.shares[0]
        return shares[self.length_of[kind]] * self.result[kind]

    def fits(self, before: int, kind: int, at_once: bool) -> bool:
        """Whether a kind may follow a frame of a length, whose result is in place at once or not."""
        symbol = self.symbols[kind]
        if (symbol.delay == 0) != at_once:
            return False
        return not self.recalls or symbol.step in (None, self.lengths[before])

    def probabilities(self) -> dict[tuple[int, bool], float]:
        """The probability of each node, (length before, at once), that may occur."""
        lengths = range(len(self.lengths) if self.recalls else 1)
        probabilities = {}
        for before, at_once in product(lengths, (False, True)):
            probability = self.probability(before, at_once)
            if probability > 0:
                probabilities[before, at_once] = probability
        return probabilities

    def probability(self, before: int, at_once: bool) -> float:
        """The probability that the next result is in place at once, or is not.

        Kinds that differ only in what comes after them, or in the messages that are lost in them,
        are one here.
        """
        kinds = [kind for kind in range(len(self.symbols)) if self.fits(before, kind, at_once)]
        if not kinds:
            return 0.0
        through = self.symbols[kinds[0]].through
        total = 0.0
        for kind in kinds:
            if self.symbols[kind].through == through and not self.symbols[kind].gone:
                total += self.weight(before, kind)
        return total


def _chance_of_messages(
    lost: Mapping[str, Losses], burst: Sequence[int], then: Sequence[int], gone: Collection[str]
) -> float:
    """The probability that exactly the messages of some channels are lost, and that each channel
    goes from being in a burst of losses or not to what it is then."""
    factors = []
    for (name, losses), before, after in zip(lost.items(), burst, then, strict=True):
        factors += losses.factors(before, after, LOST if name in gone else 0)
    return np.prod(factors)


def _refuse_large(family, graph, path, hint):
    if graph.nodes * (family.kept.size * (family.kept.size + 1) // 2) > MOST_MOMENTS:
        size = f"{family.kept.size} states at {graph.nodes} moments"
        raise UsageError(
            f"{path}: expected at most {MOST_MOMENTS} second moments, found {size}; {hint}"
        )


def _chain(family, first, second):
    """The graph of the chain, and the factors of each edge's probability with the losses at both
    ends of the number."""
    channels = list(first)
    nodes = {}
    edges = []
    factors = []
    open_ = []

    def node(moment, bursts):
        if (moment, bursts) not in nodes:
            nodes[moment, bursts] = len(nodes)
            open_.append((moment, bursts))
        return nodes[moment, bursts]

    node(0, (0,) * len(channels))
    while open_:
        moment, bursts = open_.pop()
        for symbol, sent in enumerate(family.symbols):
            if sent.moment != moment:
                continue
            late = dict(sent.late)
            after = int(np.flatnonzero(family.follows[symbol])[0])
            choices = []
            for name, burst in zip(channels, bursts, strict=True):
                begins = first[name].begins > 0 or second[name].begins > 0
                choices.append(range(1 + begins) if name in late else (burst,))
            for then in product(*choices):
                changes = list(zip(channels, bursts, then, strict=True))
                both = np.array([_factors(losses, changes, late) for losses in (first, second)]).T
                if not (both == 0).all(-1).any():
                    edges.append(
                        (node(moment, bursts), symbol, node(family.symbols[after].moment, then))
                    )
                    factors.append(both)
    source, symbol, target = (np.array(column) for column in zip(*edges, strict=True))
    return Graph(source, symbol, target), np.array(factors)


def _factors(losses, changes, late):
    """The factors of the probability that the bursts of the channels change in this way."""
    factors = []
    for name, *change in changes:
        factors += losses[name].factors(*change, late[name]) if name in late else (1.0, 1.0)
    return factors
