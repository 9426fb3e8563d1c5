"""The state of a marched loop as a row of real numbers, and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from wavesweep.analysis.march.linear import Loop, State, at_rest


def random_state(loop: Loop, seed: int) -> State:
    """Give a state with every number drawn from the standard normal distribution, the same for the same seed."""
    rest = at_rest(loop)
    return with_numbers(rest, np.random.default_rng(seed).standard_normal(len(numbers_of(rest))))


def numbers_of(state: State) -> np.ndarray:
    """Give the state's real numbers in a row; whole numbers are ticks and no part of the motion."""
    found: list[float] = []

    def visit(part: Any) -> None:
        if isinstance(part, tuple):
            for inner in part:
                visit(inner)
        elif isinstance(part, complex):
            found.extend((part.real, part.imag))
        elif not isinstance(part, int):
            found.append(part)

    visit(state)
    return np.array(found)


def with_numbers(state: State, numbers: np.ndarray) -> State:
    """Give the state with other numbers in the same places."""
    left = iter(numbers.tolist())

    def fill(part: Any) -> Any:
        if isinstance(part, tuple):
            inner = [fill(one) for one in part]
            return type(part)(*inner) if hasattr(part, "_fields") else tuple(inner)
        if isinstance(part, complex):
            return complex(next(left), next(left))
        return part if isinstance(part, int) else next(left)

    return fill(state)
