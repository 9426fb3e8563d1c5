"""Blocks check their shapes once and cannot be changed afterwards."""

import numpy as np
import pytest

from wavesweep.engine._loops.block import Block, matrix


def test_a_wrong_shape_names_block_matrix_expected_and_found():
    with pytest.raises(ValueError, match=r"block p: B expected \(\.\.\., 1, 1\), found \(1, 2\)"):
        Block("p", ("u",), ("y",), ("s",), E=[[0.0]], B=[[0.0, 1.0]], C=[[1.0]], D=[[0.0]])


def test_labels_are_one_per_state():
    part = np.zeros((1, 1))
    with pytest.raises(ValueError, match="block p: labels expected 1, one per state, found 2"):
        Block("p", ("u",), ("y",), ("s",), E=part, B=part, C=part, D=part, labels=("a", "b"))


def test_arrays_are_read_only_and_the_callers_own_is_not():
    own = np.zeros((1, 1))
    block = Block("p", ("u",), ("y",), ("s",), E=own, B=own, C=own, D=own)
    with pytest.raises(ValueError, match="read-only"):
        block.E[0, 0] = 1.0
    own[0, 0] = 1.0


def test_batches_of_the_four_arrays_broadcast():
    block = Block("p", ("u",), ("y",), ("s",), E=np.zeros((3, 1, 1)), B=np.zeros((2, 1, 1, 1)), C=[[0.0]], D=[[0.0]])
    assert block.batch == (2, 3)


def test_matrices_are_stacked_from_numbers_and_arrays():
    found = matrix([[1, np.array([2.0, 3.0])], [0, 4]])
    assert np.array_equal(found, [[[1, 2], [0, 4]], [[1, 3], [0, 4]]])
