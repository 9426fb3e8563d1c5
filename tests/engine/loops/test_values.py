"""Values of expressions that have parts in common."""

import numpy as np
import pytest

from wavesweep.engine._drawing.expressions import SharedParts, Tree
from wavesweep.engine._drawing.parsing import parse

CANCELS = "1 - sqrt(1 - a*a)"  # for a = 1e-9 all digits of it are lost in doubles: 5e-19


def test_a_part_in_which_digits_are_lost_is_computed_again_in_every_tree_that_has_it():
    part = parse(CANCELS)
    trees = [factor * part for factor in (2.0, 4.0, 8.0)]
    for values, numbers in ((Tree.value, {"a": 1e-9}), (Tree.values, {"a": np.array([0.6, 1e-9])})):
        shared = SharedParts()
        found = [np.atleast_1d(values(tree, numbers, shared)) for tree in trees]
        for value, factor in zip(found, (2.0, 4.0, 8.0), strict=True):
            assert value[-1] == pytest.approx(factor * 5e-19, rel=1e-15, abs=0)
            assert value[0] == pytest.approx(factor * (0.2 if value.size > 1 else 5e-19), rel=1e-15, abs=0)
