"""A delay of one tick of the rate at which the block runs."""

import numpy as np

from wavesweep.diagram.block import Block


def unit_delay(name: str, is_position: bool = False) -> Block:
    """`y[k] = u[k-1]`; is_position: what it holds is a position (see Block)."""
    one = np.ones((1, 1))
    return Block(
        name, ("u",), ("y",), ("u_before",), E=-one, B=one, C=one, D=0 * one,
        positions=frozenset({"u_before"} if is_position else ()),
    )
