"""A delay of one tick of the rate at which the block runs."""

import numpy as np

from wavesweep.diagram.block import Block


def unit_delay(name: str) -> Block:
    """`y[k] = u[k-1]`."""
    one = np.ones((1, 1))
    return Block(name, ("u",), ("y",), ("u_before",), E=-one, B=one, C=one, D=0 * one)
