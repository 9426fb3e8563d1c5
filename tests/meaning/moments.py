"""The growth of second moments of what is at random, by a march of these over what the documents say happens how often."""

import numpy as np
from meaning.members import LOST, Frame, Messages, family_of
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs


def growth_at_random(tables: dict, asked) -> float:
    """The spectral radius of the map of second moments over a frame, or over a period of messages."""
    family = family_of(tables, asked)
    if isinstance(family, Messages):
        edges, count = edges_of_messages(family)
        steps = family.period
    else:
        edges, count = edges_of_frames(family, asked)
        steps = 1
    size = family.walk.size

    def moved(packed):
        moments = packed.reshape(count, size, size)
        for step in range(steps):
            after = np.zeros_like(moments)
            for before, to, share, matrix in edges(step):
                after[to] += share * matrix @ moments[before] @ matrix.T
            moments = after
        return moments.ravel()

    whole = count * size * size
    try:
        values = eigs(
            LinearOperator((whole, whole), matvec=moved, dtype=float),
            k=1,
            v0=np.tile(np.eye(size), (count, 1, 1)).ravel(),
        )[0]
        return float(abs(values[0]))
    except ArpackNoConvergence:
        return np.nan


def edges_of_frames(family, asked):
    """Nodes are the last frame: its length, and whether its result comes with the next one."""
    frames = [Frame(ticks, delay) for ticks in family.lengths for delay in family.delays]
    frames += [Frame(ticks, LOST) for ticks in family.lengths]
    lengths = np.array(asked.next or [asked.shares.get("rates.ratio", [1])] * len(family.lengths), float)
    lengths /= lengths.sum(1, keepdims=True)
    results = np.array(asked.shares.get("environment.delay", [1]), float)
    results = np.atleast_2d(results) * np.ones((len(family.lengths), 1))
    results /= results.sum(1, keepdims=True)
    found = []
    for before, one in enumerate(frames):
        row = lengths[family.lengths.index(one.ticks)]
        for to, other in enumerate(frames):
            at = family.lengths.index(other.ticks)
            share = (
                row[at] * asked.loss
                if other.delay is LOST
                else row[at] * (1 - asked.loss) * results[at][family.delays.index(other.delay)]
            )
            if share:
                found.append((before, to, share, family.frame(other, one)))
    return (lambda _: found), len(frames)


def edges_of_messages(family):
    """Nodes are which channels are in a burst; each tick, a run's message is lost by itself or in the burst."""
    own = family.drawing
    names = [link.name for link in family.links]
    chances = []
    for name in names:
        loss, burst = (own.value(name, key, 0.0) for key in ("loss", "burst"))
        chances.append((loss, burst, own.value(name, "burst_end", 1.0), own.value(name, "burst_loss", 1.0)))
    if len(names) != 1:
        raise NotImplementedError("two channels at random")
    ((loss, burst, ends, lost_in_burst),) = chances
    (link,) = family.links
    rows = []
    for tick in range(family.period):
        active = family.active[tick]
        if link.name not in active:
            step = [(node, node, 1.0, family.walk.after((active, (None,)))) for node in (0, 1)]
        else:
            come = family.walk.after((active, ("now",)))
            gone = family.walk.after((active, ("zero" if link.zero else None,)))
            step = []
            for node, moves in ((0, ((0, 1 - burst), (1, burst))), (1, ((0, ends), (1, 1 - ends)))):
                for to, share in moves:
                    chance = lost_in_burst if to else loss
                    step += [(node, to, share * (1 - chance), come), (node, to, share * chance, gone)]
        rows.append(step)
    return rows.__getitem__, 2
