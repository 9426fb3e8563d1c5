"""The plain march: every tick of both loops in turn, without the effects of hardware that a simulation may add.

The control laws are those of `support.controllers`. Around them this is the shortest program that runs them, from any state,
and the state of a loop as a row of real numbers, and back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from support.controllers import Loop, compile_loop


class State(NamedTuple):
    """The whole loop just before a tick: its number, position and velocity (m, m/s), position a tick ago, control."""

    tick: int
    x: float
    v: float
    x_before: float
    control: Any


@dataclass(frozen=True)
class March:
    """What was seen, in SI units: an entry per tick, or per slow event for the fields of the slow loop.

    The waves and the avatar are None without waves, `F_s` is one per tick for `dc`, and `u_h`, `v_l`, `v_2` are None
    without a local model behind waves. `x` and `v` are those at the start of a tick; `state` is what follows the last.
    """

    x: np.ndarray
    v: np.ndarray
    v_hat: np.ndarray
    f_m: np.ndarray
    u_m: np.ndarray | None
    v_m: np.ndarray | None
    u_s: np.ndarray | None
    v_s: np.ndarray | None
    x_s: np.ndarray | None
    x_dot_s: np.ndarray | None
    F_s: np.ndarray | None
    u_h: np.ndarray | None
    v_l: np.ndarray | None
    v_2: np.ndarray | None
    state: State


def at_rest(loop: Loop, x: float = 0.0) -> State:
    """Give the loop at rest with the hand at ``x`` metres; the avatar, and all that remembers, is at zero."""
    return State(0, x, 0.0, x, loop.memory)


def tick(loop: Loop, state: State, f_h: float):
    """March one tick under the hand force ``f_h`` (N): the state after it, the measured velocity, the signals."""
    k, x, v, x_before, control = state
    v_hat = v if loop.velocity == "exact" else (x - x_before) / loop.T
    control, seen = loop.tick(control, k, x, v_hat)
    a, b, c, d, e, g = loop.plant
    f = f_h - seen.f_m
    return State(k + 1, x + (a * x + b * v + c * f), v + (d * x + e * v + g * f), x, control), v_hat, seen


def march(values: Mapping, force, ticks: int | None = None, state: State | None = None) -> March:
    """Run the loop tick by tick under a force of the hand: the model's equations in their order, nothing else.

    Parameters: `values` the flat values of a spec; `force` the hand's force (N) per tick, shape ``(n,)``, or one number
    for every tick, with `ticks` then saying how many; `ticks` alone cuts a longer record short; `state` where to start
    (at rest if not given; a `March.state` goes on where that march stopped).

    Errors: `ValueError` when there are fewer forces than ticks; `IllPosedLoopError` when a loop without delay has no
    solution.

    Accuracy: rounding, about 1e-15 of the largest signal per tick; nothing is linearised, cut off or iterated.
    """
    force = np.asarray(force, dtype=float)
    if force.ndim == 0:
        force = np.full(1 if ticks is None else ticks, float(force))
    ticks = len(force) if ticks is None else ticks
    if len(force) < ticks:
        raise ValueError(f"expected at least {ticks} forces, one per tick, but found {len(force)}")
    loop = compile_loop(values)
    state = at_rest(loop) if state is None else state
    rows = []
    for f_h in force[:ticks].tolist():
        x, v = state.x, state.v
        state, v_hat, seen = tick(loop, state, f_h)
        rows.append((x, v, v_hat, seen))
    return _march(rows, state)


def _march(rows: list, state: State) -> March:
    """The rows of a march as columns."""
    seen = [row[3] for row in rows]

    def column(name, of=seen):
        return _column([getattr(signals, name, None) for signals in of])

    avatars = [signals.slow for signals in seen if getattr(signals, "slow", None)]
    moving = {"v_s": "v", "x_s": "x", "x_dot_s": "x_dot"}
    slow = {name: column(field, avatars) for name, field in moving.items()}
    slow["F_s"] = column("F", avatars) if avatars else column("F_s")
    fast = {name: column(name) for name in ("f_m", "u_m", "v_m", "u_s", "u_h", "v_l", "v_2")}
    x, v, v_hat = (_column([row[place] for row in rows]) for place in range(3))
    return March(x=x, v=v, v_hat=v_hat, state=state, **fast, **slow)


def _column(numbers: list) -> np.ndarray | None:
    """The numbers that are there, read-only; None where there are none."""
    present = np.array([number for number in numbers if number is not None])
    present.flags.writeable = False
    return present if len(present) else None


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
