"""A loop cut at one or two numbers of a wire that are scalar gains of its frame: the linear
fractional transformation (LFT) that the numbers close, as a wall's stiffness and damping do."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine._loops.block import frozen
from wavesweep.engine._monodromy.bounded import Bounded
from wavesweep.engine._state_space import StateSpace

FIRST, SECOND = "first", "second"  # the two numbers; of a wall, stiffness and damping
VELOCITY, ADVANCE, OFFSET = 0, 1, 2  # rows of C and D
MATRICES = ("E", "B", "C", "D")
ERRORS = ("dE", "dB", "dC", "dD")


class SignalRows(NamedTuple):
    """E and B, and the rows of the two signals without their direct terms: x of the first
    number, v of the second."""

    E: np.ndarray
    B: np.ndarray
    x: np.ndarray
    v: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class LinearFractional:
    """Everything but the numbers, once a frame, in delta form (`w = z - 1`).

    E `(..., n, n)`, B `(..., n, 1)`, C `(..., 3, n)`, D `(..., 3, 1)`; the rows of C and D are
    VELOCITY: the signal that the second number multiplies, G_v; ADVANCE and OFFSET: the one that
    the first number multiplies is G_x = ADVANCE/w + OFFSET. dE, dB, dC, dD: bounds on the errors of
    their entries. integrates: whether there is an ADVANCE. It is the exact eigenvalue 1 of the cut
    loop, as of the position of the whole scene if no spring holds the hand. It is kept out of E, so
    it is never rounded. period: of the frame, s (a number or an array over the batch). states:
    their names. poles_at_one: how many eigenvalues of E are exactly 0 by its pattern, as that of a
    mass that nothing brakes. uncontrolled: the diagonal blocks of the monodromy matrix less
    identity that the numbers do not act on, in the block-triangular form of its pattern. late:
    frames by which what the numbers make reaches the loop later, as a factor `z^-late` of both
    signals; these frames are no states of E.
    """

    E: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    dE: np.ndarray
    dB: np.ndarray
    dC: np.ndarray
    dD: np.ndarray
    integrates: bool
    period: np.ndarray
    states: tuple[str, ...]
    poles_at_one: int = 0
    uncontrolled: tuple[np.ndarray, ...] = ()
    late: int = 0
    memo: dict[object, Any] = field(
        default_factory=dict, init=False, repr=False
    )  # what belongs to these loops alone, see `remembered`

    def __post_init__(self) -> None:
        for name in (*MATRICES, *ERRORS, "period"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def order(self) -> int:
        """Number of states of the loop with the numbers in place."""
        return self.E.shape[-1] + self.integrates + self.late

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the leading axes."""

        def together() -> tuple[int, ...]:
            shapes = [getattr(self, name).shape[:-2] for name in MATRICES]
            return np.broadcast_shapes(*shapes, np.shape(self.period))

        return self.remembered("batch", together)

    def remembered(self, name: object, make: Callable[[], Any]) -> Any:
        """What `make` gives at the first call with this name: of a compiled loop it is asked for
        in every call."""
        if name not in self.memo:
            self.memo[name] = make()
        return self.memo[name]

    def at(self, index: Any) -> "LinearFractional":
        """Return the loops `index` (anything that indexes the leading axes) of the batch."""
        batch = self.batch
        indices = isinstance(index, np.ndarray) and index.dtype.kind == "i"

        def pick(array: np.ndarray, tail: int) -> np.ndarray:
            array = np.asarray(array)
            full = batch + array.shape[array.ndim - tail :]
            if array.shape != full:
                return np.broadcast_to(array, full)[index]
            if indices and array.flags.c_contiguous:
                return array.take(index, axis=0)  # in a seventh of the time of brackets
            return array[index]

        parts: dict[str, Any] = {
            name: pick(getattr(self, name), 2) for name in (*MATRICES, *ERRORS)
        }
        parts["uncontrolled"] = tuple(pick(block, 2) for block in self.uncontrolled)
        return replace(self, **parts, period=pick(self.period, 0))

    def as_batch(self, size: int) -> "LinearFractional":
        """The cut as a batch of `size` loops, all its parts over all of them; a single loop is
        repeated."""
        if self.batch:
            return self.at(slice(None))
        single = self.at(np.newaxis)
        return single if size == 1 else single.at(np.zeros(size, int))

    def open_in(self, open_number: str, fixed: np.ndarray) -> StateSpace:
        """Return the loop with one number closed and the other open, from the open number's product
        u to its factor y.

        With the rows c of the closed number k and o of the open one:

            E + B g c,   B/(1 - k D_c),   C = o + D_o g c,   D = D_o/(1 - k D_c),   g = k/(1 - k D_c).

        open_number: the open number, FIRST or SECOND; fixed: value of the other one, an array that
        broadcasts with the batch.
        """
        E, B, x, v = self.with_integrator()
        D_x = self.D[..., OFFSET, 0]
        D_v = self.D[..., VELOCITY, 0]
        if open_number == SECOND:
            closed = x
            D_closed = D_x
            opened = v
            D_opened = D_v
        else:
            closed = v
            D_closed = D_v
            opened = x
            D_opened = D_x
        return_difference = (1 - fixed * D_closed)[..., None, None]
        gain = fixed[..., None, None] / return_difference
        D_opened = D_opened[..., None, None]
        return StateSpace(
            E=E + B * gain * closed,
            B=B / return_difference,
            C=opened + D_opened * gain * closed,
            D=D_opened / return_difference,
        )

    def open_late(self, open_number: str) -> StateSpace:
        """Return the loop with both numbers open, and not late, to the signal of the one that is
        looked for, and then that of the other one."""
        E, B, x, v = self.with_integrator()
        D_x = self.D[..., OFFSET : OFFSET + 1, :]
        D_v = self.D[..., VELOCITY : VELOCITY + 1, :]
        rows = [x, v] if open_number == FIRST else [v, x]
        direct = [D_x, D_v] if open_number == FIRST else [D_v, D_x]
        C = np.concatenate(np.broadcast_arrays(*rows), axis=-2)
        D = np.concatenate(np.broadcast_arrays(*direct), axis=-2)
        return StateSpace(E, B, C, D)

    def with_integrator(self) -> SignalRows:
        """Return the loop with the integrator s as the last state, which sums up the row ADVANCE. E,
        B and the rows x and v of the two signals are

            [E    0]      [B  ]
            [C_a  0],     [D_a],     [C_o  1],     [C_v  0]

        with the rows a, o and v of C and D: ADVANCE, OFFSET and VELOCITY.
        """
        x = self.C[..., OFFSET : OFFSET + 1, :]
        v = self.C[..., VELOCITY : VELOCITY + 1, :]
        if not self.integrates:
            return SignalRows(self.E, self.B, x, v)
        advance = self.C[..., ADVANCE : ADVANCE + 1, :]
        advance_direct = self.D[..., ADVANCE : ADVANCE + 1, :]
        ones = np.ones((*self.batch, 1, 1))
        zero = 0 * ones  # added to a row, it gives one to each loop of the batch
        E = np.concatenate([self.E, advance], axis=-2)
        E = np.concatenate([E, np.zeros((*E.shape[:-1], 1))], axis=-1)
        B = np.concatenate([self.B, advance_direct], axis=-2)
        x = np.concatenate([x + zero, ones], axis=-1)
        v = np.concatenate([v + zero, zero], axis=-1)
        return SignalRows(E, B, x, v)

    def of_errors(self) -> "LinearFractional":
        """Return the cut with bounds on the errors of the entries in place of the entries."""
        return replace(self, E=self.dE, B=self.dB, C=self.dC, D=self.dD)

    def errors_with_integrator(self) -> SignalRows:
        """Return bounds on the errors of the entries of `with_integrator`."""
        errors = self.of_errors().with_integrator()
        if not self.integrates:
            return errors
        exact = 0 * errors.x[..., -1:]  # the integrator is in the signal by exactly 1
        return errors._replace(x=np.concatenate([errors.x[..., :-1], exact], axis=-1))

    def closed(self, K: np.ndarray | float, F: np.ndarray | float) -> np.ndarray:
        """Return the monodromy matrix less identity of the loop with the numbers in place, `(...,
        order, order)`.

        K, F: values of the first and the second number, which broadcast with the batch. If K = 0,
        nothing reads the integrator; its eigenvalue 1 is a drift and is replaced by 0 (a delta of
        -1).
        """
        with np.errstate(
            over="ignore", invalid="ignore", divide="ignore"
        ):  # a frame that overflows is for the caller to see
            K = np.asarray(K)[..., None, None]
            F = np.asarray(F)[..., None, None]
            E, B, x, v = self.with_integrator()
            of_x = self.D[..., OFFSET : OFFSET + 1, :]
            of_v = self.D[..., VELOCITY : VELOCITY + 1, :]
            read = K * x + F * v
            through = K * of_x + F * of_v
            if self.late:
                A = self._late(E, B, read, through, 1.0)
            else:
                A = E + B * (read / (1 - through))
            if self.integrates:
                integrator = E.shape[-1] - 1
                A[..., integrator, integrator] = np.where(
                    K[..., 0, 0] == 0, -1.0, A[..., integrator, integrator]
                )
        return A

    def errors_of_closed(self, K: np.ndarray | float, F: np.ndarray | float) -> np.ndarray:
        """Return bounds on the errors of the entries of `closed`, `(..., order, order)`."""
        with np.errstate(all="ignore"):
            K = np.asarray(K, float)[..., None, None]
            F = np.asarray(F, float)[..., None, None]
            parts = zip(self.with_integrator(), self.errors_with_integrator(), strict=True)
            E, B, x, v = (Bounded(*np.broadcast_arrays(*pair)) for pair in parts)
            D = Bounded(self.D, self.dD)
            of_x = D.part(..., slice(OFFSET, OFFSET + 1), slice(None))
            of_v = D.part(..., slice(VELOCITY, VELOCITY + 1), slice(None))
            read = x * K + v * F
            through = of_x * K + of_v * F
            if self.late:
                return self._late(E.error, B.error, read.error, through.error, 0.0)
            return (E + B * read.over(Bounded.exact(1.0) - through)).error

    def _late(
        self,
        E: np.ndarray,
        B: np.ndarray,
        read: np.ndarray,
        through: np.ndarray,
        passed_on: float,
    ) -> np.ndarray:
        """The loop with `late` states behind it, through which the product of the numbers goes: the
        sum of the states, by `read`, and of what the last of these is, by `through`.

        passed_on: 1, or 0 for bounds on errors in place of the entries.
        """
        n = E.shape[-1]
        parts = (E, B, read, through)
        batch = np.broadcast_shapes(*(part.shape[:-2] for part in parts))
        A = np.zeros((*batch, n + self.late, n + self.late), np.result_type(*parts))
        A[..., n:, n:] = passed_on * (np.eye(self.late, k=-1) - np.eye(self.late))
        A[..., :n, :n] = E
        A[..., :n, -1:] = B
        A[..., n : n + 1, :n] = read
        A[..., n : n + 1, -1:] += through
        return A


@dataclass(frozen=True, slots=True, eq=False)
class CutColumns:
    """Columns of cut loops: one of the two numbers is looked for, the other one is fixed.

    cut: the loops. owner: the loop of each column, `(columns,)`. along: the number that is looked
    for, FIRST or SECOND. fixed: the other one, `(columns,)`.
    """

    cut: LinearFractional
    owner: np.ndarray
    along: str
    fixed: np.ndarray

    @property
    def size(self) -> int:
        """The number of columns."""
        return self.fixed.size

    def some(self, rows: np.ndarray | slice) -> "CutColumns":
        """Return some of the columns, of the same loops."""
        return CutColumns(self.cut, self.owner[rows], self.along, self.fixed[rows])

    def apart(self, rows: np.ndarray | slice) -> "CutColumns":
        """Return some of the columns, each with a loop of its own."""
        loops = self.loops(rows)
        fixed = self.fixed[rows]
        return CutColumns(loops, np.arange(fixed.size), self.along, fixed)

    def loops(self, column: np.ndarray | slice | int) -> LinearFractional:
        """Return the loops of these columns, one for each."""
        return self.cut.at(self.owner[column])

    def numbers(self, column: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return both numbers, the first one first, if the one that is looked for has a value in
        each of these columns."""
        fixed = self.fixed[column]
        return (value, fixed) if self.along == FIRST else (fixed, value)
