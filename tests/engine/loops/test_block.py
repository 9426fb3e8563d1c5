"""Blocks check their shapes once and cannot be changed afterwards."""

import numpy as np
import pytest

from wavesweep.engine._loops.block import Block


def test_a_wrong_shape_names_block_matrix_expected_and_found():
    with pytest.raises(ValueError, match=r"block p: B expected \(\.\.\., 1, 1\), found \(1, 2\)"):
        Block("p", ("u",), ("y",), ("s",), E=[[0.0]], B=[[0.0, 1.0]], C=[[1.0]], D=[[0.0]])


def test_arrays_are_read_only_and_the_callers_own_is_not():
    own = np.zeros((1, 1))
    block = Block("p", ("u",), ("y",), ("s",), E=own, B=own, C=own, D=own)
    with pytest.raises(ValueError, match="read-only"):
        block.E[0, 0] = 1.0
    own[0, 0] = 1.0
