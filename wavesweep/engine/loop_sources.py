"""Closed loops from what describes them: a drawing as nested tables, or matrices and systems of python-control with rates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from wavesweep.engine._drawing.block_classes import expanded
from wavesweep.engine._drawing.drawing_keys import is_name
from wavesweep.engine._drawing.drawing_tables import TABLES, read_drawing
from wavesweep.engine._keys.checking import Mistakes
from wavesweep.engine._keys.key import Place, leaves_of, read_dict, split_names
from wavesweep.engine.closed_loop import ClosedLoop
from wavesweep.engine.errors import SpecError, UsageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Matrix = Sequence[Sequence[float | str]] | NDArray[Any]

# relative difference from a whole number of ticks up to which a sample time is meant to be one
SAME_RATE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class StateSpaceBlock:
    """A linear block: `x' = A x + B u`, `y = C x + D u`, or `x[k+1] = A x[k] + B u[k]` at every so many ticks.

    A `(n, n)`, B `(n, m)`, C `(p, n)`, D `(p, m)`; D may be 0. Entries are numbers, or texts that
    are expressions in the numbers of the loop, such as "-k/m". every: None for a continuous block,
    which is exact between ticks; else it runs at the ticks phase, phase + every, and so on, and its
    outputs hold in between. inputs, outputs: names of its ports. states: names of its states; x0,
    x1, ... if there are none.

    What a continuous block reads is held over each tick, but for the terms of its wire that read
    another continuous block: these act continuously, as a spring between two masses has to.
    `loop.assumptions` names them. A program that computes such a term from samples is drawn as a
    block of its own, `{"type": "hold"}`.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix | Literal[0] = 0
    every: int | None = None
    phase: int = 0
    inputs: tuple[str, ...] = ("u",)
    outputs: tuple[str, ...] = ("y",)
    states: tuple[str, ...] = ()

    def table(self) -> dict[str, Any]:
        """The block in the language of drawings."""
        matrices = {name: _rows(getattr(self, name)) for name in "ABC"}
        direct = {} if isinstance(self.D, int | float) and self.D == 0 else {"D": _rows(self.D)}
        ports = {"inputs": list(self.inputs), "outputs": list(self.outputs)}
        return {"type": "ss", **matrices, **direct, **ports, **_timing(self.every, self.phase)}


def loop_from_drawing(tables: Mapping[str, Any]) -> ClosedLoop:
    """A closed loop from the tables of a drawing.

    Parameters
    ----------
    tables : dict
        `rates`, `numbers`, `block`, `signals`, `wire`, `ports` and `type`, with the keys and
        expressions of a spec: docs/drawn-loops.md describes them, docs/blocks.md lists the blocks.

    Returns
    -------
    ClosedLoop

    Raises
    ------
    SpecError
        With all mistakes at once, `.mistakes` one by one.

    Examples
    --------
    >>> from wavesweep.engine import loop_from_drawing
    >>> loop = loop_from_drawing({
    ...     "rates": {"tick_hz": 1000}, "numbers": {"kp": 100.0},
    ...     "block": {"mass": {"type": "mass", "mass": 0.1, "damping": 1.0}},
    ...     "wire": {"mass.f": "-kp*mass.x"},
    ... })
    >>> loop.stable_intervals("kp", (0, 10_000)).high.round(6)
    array([2003.338893])
    """
    place = Place()
    mistakes = Mistakes()
    leaves = {}
    for path, leaf in leaves_of(read_dict(tables), place):
        if mistakes.is_known(path[0], ("type", *TABLES), leaf, ".".join(path), "an unknown table"):
            leaves[split_names(path, 1) if path[0] == "wire" else path] = leaf
    drawing, values, *_ = read_drawing(expanded(leaves, mistakes), place, mistakes)
    if drawing is None or mistakes:
        raise SpecError(mistakes.in_order())
    return ClosedLoop(drawing, values)


def loop_from_blocks(
    blocks: Mapping[str, object],
    wires: Mapping[str, str],
    *,
    rate_hz: float,
    numbers: Mapping[str, float] | None = None,
    inputs: Iterable[str] = (),
    outputs: Mapping[str, str] | None = None,
) -> ClosedLoop:
    """A closed loop from matrices and rates.

    Parameters
    ----------
    blocks : dict
        By name: a `StateSpaceBlock`; a state-space system or a transfer function of python-control
        or scipy.signal, which is continuous or has a sample time of whole ticks; or the keys of any
        other block as a dict, see docs/blocks.md. Ports and states of systems keep their names; if
        these are none, they are `u` and `y`, or `u0`, ..., `y0`, ..., and `x0`, ...
    wires : dict
        Input `"block.port"` -> expression that is linear in outputs of blocks and in inputs, such
        as `"ref - kp*plant.y"`. A port without a wire is a mistake; "0" leaves it at rest.
    rate_hz : float
        Rate of the common tick (Hz), at which continuous blocks get what other blocks and inputs
        give them; what they give each other acts continuously, see `ClosedLoop.assumptions`.
    numbers : dict, optional
        Numbers that expressions read by name, and that can be varied.
    inputs : iterable of str, optional
        Names of signals from outside, which wires read.
    outputs : dict, optional
        Name -> expression, as for wires.

    Returns
    -------
    ClosedLoop

    Raises
    ------
    UsageError
        For a system that is no block, or with a sample time that is open or not of whole ticks.
    SpecError
        With all other mistakes at once.

    Examples
    --------
    >>> import numpy as np
    >>> from wavesweep.engine import StateSpaceBlock, loop_from_blocks
    >>> plant = StateSpaceBlock(A=[[0, 1], [0, -10]], B=[[0], [10]], C=[[1, 0]])
    >>> control = StateSpaceBlock(A=[[0]], B=[[1]], C=[[0]], D=[[1]], every=4)
    >>> wires = {"plant.u": "kp*control.y", "control.u": "ref - plant.y"}
    >>> blocks, ports = {"plant": plant, "control": control}, {"inputs": ["ref"], "outputs": {"y": "plant.y"}}
    >>> loop = loop_from_blocks(blocks, wires, rate_hz=1000, numbers={"kp": 1.0}, **ports)
    >>> intervals = loop.stable_intervals("kp", (0, 1000))
    >>> intervals.high.round(6), intervals.certified
    (array([503.355615]), array([ True]))
    """
    read = {name: _block(name, block, rate_hz) for name, block in blocks.items()}
    tables = {
        "rates": {"tick_hz": rate_hz},
        "numbers": numbers or {},
        "block": {name: _table(block) for name, block in read.items()},
        "wire": wires,
        "ports": {"inputs": {name: name for name in inputs}, "outputs": outputs or {}},
    }
    state_names: dict[str, str] = {}
    for name, block in read.items():
        if isinstance(block, StateSpaceBlock):
            for index, state in enumerate(block.states):
                state_names[f"{name} x{index}"] = f"{name} {state}"
    return replace(loop_from_drawing(tables), state_names=state_names)


def block_tables(blocks: Mapping[str, object], rate_hz: float) -> dict[str, Mapping[str, Any]]:
    """The blocks of `loop_from_blocks` in the language of drawings; systems have no names of states."""
    return {name: _table(_block(name, block, rate_hz)) for name, block in blocks.items()}


def _table(block: StateSpaceBlock | Mapping[str, Any]) -> Mapping[str, Any]:
    return block.table() if isinstance(block, StateSpaceBlock) else block


def _block(name: str, block: Any, rate_hz: float) -> StateSpaceBlock | Mapping[str, Any]:
    """A block as matrices or in the language of drawings."""
    if isinstance(block, StateSpaceBlock | Mapping):
        return block
    none_is_continuous = type(block).__module__.startswith("scipy.signal")
    if type(block).__name__.startswith("ZerosPolesGain") and none_is_continuous:
        block = block.to_tf()
    is_transfer = hasattr(block, "num") and hasattr(block, "den")
    is_state_space = all(hasattr(block, matrix) for matrix in "ABCD")
    if not hasattr(block, "dt") or not (is_transfer or is_state_space):
        expected = "a StateSpaceBlock, a system of python-control or scipy.signal, or a dict of a block's keys"
        raise UsageError(f"block {name}: expected {expected}, found {type(block).__name__}")
    dt = block.dt
    if dt is None and not none_is_continuous:
        expected = "a system that says its time: dt = 0 for continuous, or its sample time in s"
        raise UsageError(
            f"block {name}: expected {expected}, found dt = None, which leaves it open"
        )
    every = _every(name, dt, rate_hz)
    if is_state_space:
        rows, columns = np.shape(block.D)
        inputs = _ports(getattr(block, "input_labels", None), columns, "u")
        outputs = _ports(getattr(block, "output_labels", None), rows, "y")
        labels = getattr(block, "state_labels", None) or ()
        states = tuple(labels) if all(map(is_name, labels)) else ()
        matrices = block.A, block.B, block.C, block.D
        return StateSpaceBlock(*matrices, every, 0, inputs, outputs, states)
    num = np.squeeze(np.asarray(block.num, float))
    den = np.squeeze(np.asarray(block.den, float))
    if num.ndim > 1 or den.ndim > 1:
        raise UsageError(
            f"block {name}: expected a transfer function with one input and one output; convert it to state space"
        )
    coefficients = {"num": np.atleast_1d(num).tolist(), "den": np.atleast_1d(den).tolist()}
    return {"type": "tf", **coefficients, **_timing(every, 0)}


def _every(name: str, dt: Any, rate_hz: float) -> int | None:
    """The ticks in a sample time (s), 0 or None of a continuous system, which has none."""
    if not dt:
        return None
    ticks: float = dt * rate_hz
    if dt is True or not ticks > 0 or abs(ticks - round(ticks)) > SAME_RATE * ticks:
        expected = f"a sample time of whole ticks of {1 / rate_hz:g} s"
        raise UsageError(
            f"block {name}: expected {expected}, found dt = {dt!r}; give another rate of the tick, or a StateSpaceBlock with `every`"
        )
    return round(ticks)


def _timing(every: int | None, phase: int) -> dict[str, Any]:
    return {} if every is None else {"discrete": True, "every": every, "phase": phase}


def _ports(labels: list[str] | None, size: int, letter: str) -> tuple[str, ...]:
    """The names of the ports of a system: its labels if these are names."""
    if labels and all(map(is_name, labels)):
        return tuple(labels)
    return (letter,) if size == 1 else tuple(f"{letter}{index}" for index in range(size))


def _rows(matrix: Matrix) -> list[Any]:
    """A matrix as a list of rows, entries that are texts included."""
    rows: list[Any] = np.array(matrix, dtype=object).tolist()
    return rows
