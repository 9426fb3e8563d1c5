"""Small nets of blocks that several tests share."""

import numpy as np

from support.specs import values_of
from wavesweep.loops.block import Block


def first_order(name, pole, through):
    return Block(name, ("u",), ("y",), ("s",), E=[[pole - 1]], B=[[1.0]], C=[[0.5]], D=[[through]])


def random_net(seed, batch=(), kind=float):
    """Blocks with direct terms that feed each other at random, so that several loops of these are closed, and their sums."""
    random = np.random.default_rng(seed)
    sizes = [(int(n), int(m), int(p)) for n, m, p in random.integers((0, 1, 1), (4, 3, 4), (5, 3))]

    def entries(*shape):
        values = random.normal(size=(*batch, *shape)) + (1j * random.normal(size=(*batch, *shape)) if kind is complex else 0)
        return values * (random.random(shape) < 0.6)

    blocks = [
        Block(
            f"b{i}", tuple(f"u{k}" for k in range(m)), tuple(f"y{k}" for k in range(p)), tuple(f"s{k}" for k in range(n)),
            entries(n, n), entries(n, m), entries(p, n), 0.4 * entries(p, m),
        )
        for i, (n, m, p) in enumerate(sizes)
    ]  # fmt: skip
    sources = [f"b{i}.y{k}" for i, (_, _, p) in enumerate(sizes) for k in range(p)] + ["r", "q"]
    ports = [f"b{i}.u{k}" for i, (_, m, _) in enumerate(sizes) for k in range(m)]

    def gain():
        return random.normal(size=batch) if batch and random.random() < 0.5 else float(random.normal())

    sums = {port: {sources[i]: gain() for i in random.choice(len(sources), 3, replace=False)} for port in ports}
    sums["seen"] = {sources[i]: gain() for i in random.choice(len(sources), 3, replace=False)}
    return blocks, sums, ("r", "q"), ("seen", sources[0])


# Both branches reflect half of the wave, turned round: v_m = -v_m/2 - v_m/2 + ..., which has no solution.
SINGULAR = values_of(
    "pmw-lm", integration="explicit", B_VE=75.0, B_LM=75.0, lp1_order=0, hp_order=0, lp2_order=0,
    **{"local_model.integration": "explicit", "local_model.delay": 0},
)  # fmt: skip
