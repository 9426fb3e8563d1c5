"""The stiffness that the hand feels of a drawn loop at rest, from a single tick in which every block runs.

If nothing changes, every block holds the outputs that it would have if it ran: a state at rest is the same in all ticks,
whichever blocks run in them. So the schedule does not matter, and no frame is needed. A loop that drifts, or that conserves a
combination of its states, has no unique state at rest; then the result here is not known. `resting_frame` and
`static_port_response` have it.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wavesweep.engine.loops.multirate import MultirateLoop
from wavesweep.engine.loops.ports import Ports
from wavesweep.engine.monodromy.interconnect import all_sums, connect
from wavesweep.engine.monodromy.rounding import ENTRIES, ROUNDING
from wavesweep.engine.response.bounded_sums import ordered_products
from wavesweep.engine.response.linear_systems import solved

SURE = 1e-9  # relative error up to which a stiffness is known; as a share of a rigid wall's, what counts as nothing felt


@dataclass(frozen=True, slots=True, eq=False)
class DcGain:
    """Loops at rest under a unit force of the hand, and a number p of them that is one scalar gain.

    shown: `(loops, 3, 2)`; the rows are position (m), force against the hand (N) and the number's product. The first column is
    for the case that the signal which the number multiplies is 0; the second is the change for a 1 of that signal. error:
    bounds on the errors. free: whether there is such a number. A fourth row is the signal that another number multiplies, whose
    product is added to that of the first one.
    """

    shown: np.ndarray
    error: np.ndarray
    free: bool

    def stiffness(self, at, p, second=0.0) -> np.ndarray:
        """Return the stiffness (N/m) that the hand feels of the loops `at` if the number is p, `(n,)` all.

        second: the number of the fourth row. NaN: not known to SURE. If nothing is swept, one loop represents all.

        The product of the number is p times the signal that it multiplies, and that signal is `F_0/(p - F_1)` (Sherman and
        Morrison 1950); of F the product of the other number is a part.
        """
        at = at if len(self.shown) > 1 else 0 * at
        (still, change), (unsure, of_change) = (
            np.moveaxis(rows.take(at, axis=0), (-1, -2), (0, 1)) for rows in (self.shown, self.error)
        )
        with np.errstate(all="ignore"):
            if self.free:
                if len(still) > 3:
                    still, unsure = _less(still, unsure, second)
                    change, of_change = _less(change, of_change, second)
                left = p - change[2]
                of_left = of_change[2] + ROUNDING * (np.abs(p) + np.abs(change[2]))
                sizes = np.abs(still[:2] * left), np.abs(still[2] * change[:2])
                error = unsure[:2] * np.abs(left) + np.abs(still[:2]) * of_left + ROUNDING * sum(sizes)
                error = error + unsure[2] * np.abs(change[:2]) + np.abs(still[2]) * of_change[:2]
                limits, rigid = still[:2] * left + still[2] * change[:2], np.abs(still[1] / still[0])
            else:
                limits, error, rigid = still[:2], unsure[:2], 0.0
            stiffness, off = limits[1] / limits[0], error / np.abs(limits)
            stiffness = np.where((off[1] >= 1) & (error[1] <= SURE * rigid * np.abs(limits[0])), 0.0, stiffness)
            return np.where((off[0] <= SURE) & ((off[1] <= SURE) | (stiffness == 0)), stiffness, np.nan)


def _less(rows, errors, second):
    """The first three rows with the fourth one times a number taken from the third, and the errors."""
    product = second * rows[3]
    third = rows[2] - product
    error = errors[2] + np.abs(second) * errors[3] + ROUNDING * (np.abs(rows[2]) + np.abs(product))
    return np.stack([*rows[:2], third]), np.stack([*errors[:2], error])


def tick_dcgain(drawn: MultirateLoop, ports: Ports, product: str = "", factor: str = "") -> DcGain:
    """Return the loops at rest.

    product, factor: the number's product is that input of the drawing, and it would multiply the signal `factor`; if they are
    empty, the drawing is the whole loop. Errors: IllPosedLoopError if the loop of direct terms through all blocks is singular.

    With the number's product F, `E X + B F + g = 0` and `C X + D F + d = r` hold at rest; r is the signal that the number
    multiplies.
    """
    signals = (ports.position, *((ports.reaction,) if ports.reaction else ()), *((factor,) if factor else ()))
    drawn = drawn.living(signals)
    blocks = [placed.block for placed in drawn.placed]
    block = connect("rest", blocks, all_sums(blocks, drawn.sums), drawn.inputs, signals, terms=True)
    hand, free = drawn.inputs.index(ports.force), drawn.inputs.index(product) if factor else None
    structure = block.batch, hand, bool(ports.reaction), free
    at_rest = _at_rest(block.E, block.B, block.C, block.D, *structure)
    sizes = _at_rest(*block.terms, *structure)
    with np.errstate(all="ignore"):
        X, dX = solved(at_rest.A, ENTRIES * sizes.A, at_rest.right, ENTRIES * np.abs(sizes.right))
        shown = ordered_products(at_rest.rows, X) + at_rest.direct
        size = ordered_products(sizes.rows, np.abs(X)) + sizes.direct
        error = ordered_products(np.abs(at_rest.rows), dX) + (ENTRIES + X.shape[-2] * ROUNDING) * size
    return DcGain(shown.reshape(-1, 3, 2), error.reshape(-1, 3, 2), bool(factor))


class DcEquations(NamedTuple):
    """The equations at rest, `A X = right`; `rows X + direct` is shown by `DcGain`."""

    A: np.ndarray
    right: np.ndarray
    rows: np.ndarray
    direct: np.ndarray


def _at_rest(E, B, C, D, batch, hand, reacts, free):
    """Return the equations at rest.

    hand, free: inputs that are the hand's force and the number's product, None without a number. reacts: whether the second
    signal is the force against the hand. They may be made of sizes as well; only `right` has the other sign then.
    """
    n, order = E.shape[-1], E.shape[-1] + (free is not None)
    A, right, rows, direct = (np.zeros((*batch, *shape)) for shape in ((order, order), (order, 2), (3, order), (3, 2)))
    A[..., :n, :n], right[..., :n, 0] = E, -B[..., hand]
    for row in range(1 + reacts):
        rows[..., row, :n], direct[..., row, 0] = C[..., row, :], D[..., row, hand]
    if not reacts:
        direct[..., 1, 0] = 1
    if free is not None:
        A[..., :n, n], A[..., n, :n], A[..., n, n] = B[..., free], C[..., -1, :], D[..., -1, free]
        right[..., n, 0], right[..., n, 1] = -D[..., -1, hand], 1
        rows[..., : 1 + reacts, n], rows[..., 2, n] = D[..., :-1, free], 1
    return DcEquations(A, right, rows, direct)
