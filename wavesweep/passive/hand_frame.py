"""The frame of a loop with a hand at its device, enclosed over a box of hands and of values of a number."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.loops.from_drawing import FACTOR, PRODUCT, assembled, scalar_place
from wavesweep.monodromy.drift import TickDrift
from wavesweep.monodromy.periodic import frame_of, in_a_row, ticks_of
from wavesweep.monodromy.rounding import balance
from wavesweep.passive.enclosure import Enclosure, inverted, over_box, solved_left, stacked, widened
from wavesweep.passive.hand import HandBox, with_hands
from wavesweep.passive.held_loop import HAND, HeldLoop, device_keys
from wavesweep.spec.drawing import name_of

TERMS = 12  # of the device's series, whose n-th is at most about 0.6^n/n!
REACH = 0.25  # of a tick, up to which the series is taken; the rest by doubling
SKEW = 1e7  # condition of eigenvectors beyond which those of a matrix nearby are taken
BLUR = 1e-4  # of it, how near
FAR = 0.05  # between eigenvalues that count as separate
SINGULAR = 1e12
CONSERVED = 1e-9  # of its terms, up to which a change of a combination of states is rounding
ROUNDING = 1e-14  # of the terms of a product in another basis
NEARBY = np.array([1.0, 1.25])  # times a number, others for which a drift has to hold
MASS, DAMPING, STIFFNESS, NUMBER = range(4)


@dataclass(frozen=True, slots=True, eq=False)
class HandLoop:
    """A loop in parts, so that the device's rows of its ticks, which depend on the hand, can be replaced by an enclosure.

    loop: a single one, with some hand. path: of the number. own: mass (kg), damping (N*s/m) and stiffness (N/m) of the device.
    period: of the tick, s. kind: of each tick. ticks: for each kind E `(n, n)` less identity and the row `(1, n)` of the force
    on the device, both without the number, and what t adds to them; nothing where the number is not read. direct: how what the
    number multiplies depends on its product. device: its states as {"v": row, "x": row}. turn: to the
    states of the ticks, see `_from_position`. index: of the states that remain.
    rows: `(k, n)`, that count these from those that drift. folded: if a shift of the states depends on the numbers, row and
    column without which the frame is regular. read: the states that are read then, among the others. doublings: of the
    device's series, enough for every hand of the box.
    """

    loop: HeldLoop
    path: str
    own: tuple[float, float, float]
    period: float
    kind: np.ndarray
    ticks: tuple
    direct: float
    device: dict[str, int]
    turn: np.ndarray
    index: list[int]
    rows: np.ndarray
    folded: tuple[int, int] | None
    read: list[int]
    doublings: int

    def points(self, points) -> np.ndarray:
        """Hands (kg, N*s/m, N/m) and values p of the number, `(..., 4)`, in terms that the frame is as linear in as can be.

        1/m, d and k of device and hand together, and `t = p/(1 - p D)`, D the direct term; each grows with its own number.
        """
        mass, damping, stiffness, p = np.moveaxis(points, -1, 0)
        m, d, k = self.own
        return np.stack([1 / (mass + m), damping + d, stiffness + k, p / (1 - p * self.direct)], -1)

    def hands_and_numbers(self, points) -> tuple[np.ndarray, np.ndarray]:
        """Hands `(..., 3)` and values of the number at these points."""
        inverse, damping, stiffness, t = np.moveaxis(points, -1, 0)
        m, d, k = self.own
        return np.maximum(np.stack([1 / inverse - m, damping - d, stiffness - k], -1), 0), t / (1 + t * self.direct)

    @property
    def order(self) -> int:
        """Of the loop."""
        return len(self.index)

    @property
    def regular(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the frame without those of `folded`."""
        every = np.arange(len(self.index))
        return tuple(np.delete(every, at) for at in self.folded)

    def is_regular(self, values) -> bool:
        """Whether `t` grows with the number all over `values`."""
        return all(1 - p * self.direct > 0 for p in values)

    def frames(self, hands, p) -> np.ndarray:
        """Frames less identity with these hands and values of the number, in the coordinates that are kept."""
        some = with_hands(self.loop, hands).changed({self.path: p})
        with np.errstate(all="ignore"):
            E = self.rows @ frame_of(ticks_of(some.drawn(), alone=True))[..., self.index]
            if self.folded is None:
                return E
            rest, columns = self.regular
            law = -E[..., [self.folded[0]], :][..., columns] @ inverted(E[..., rest[:, None], columns])
            E = E[..., rest[:, None], rest] - E[..., rest, :][..., [self.folded[0]]] @ law
        return E[..., self.read, :][..., self.read]


def hand_loop(loop: HeldLoop, path: str, box: HandBox) -> HandLoop | None:
    """Take a single loop apart; springs in all of the hands or in none. None if the number is not one scalar gain of its ticks.

    None as well if several combinations of its states drift together with its numbers.
    """
    number, middle = name_of(path), box.points(np.full(3, 0.5))
    loop = loop.with_hand()
    if not scalar_place(loop.drawing, number):
        return None
    loop = loop.changed(dict(zip(HAND, middle.tolist(), strict=True)) | {path: loop.values[path] or 1.0})
    whole, cut_open = loop.drawn(), assembled(loop.drawing, loop.values, number)
    ticks = ticks_of(cut_open, (f"{loop.device}.f", FACTOR), held=whole.held())
    column, parts, direct = cut_open.inputs.index(PRODUCT), [], set()
    for each in ticks.maps:
        E, B, C, D = (np.asarray(getattr(each, part)) for part in "EBCD")
        into, read = B[:, column : column + 1], C[1:2]
        reads = np.any(into) or D[0, column] != 0
        direct |= {float(D[1, column])} if reads else set()
        parts.append((E, C[:1], into @ read, D[0, column] * read) if reads else (E, C[:1]))
    x = ticks.states.index(f"{loop.device}.x")
    turn = _from_position(ticks.maps, x)
    parts = [tuple(part @ turn for part in each) for each in parts]
    drift = loop.drift(varied={each: loop.values[each] * NEARBY for each in (*HAND, path)})
    if len(direct) != 1 or len(drift.folded) > 1:
        return None
    index, rows = _counted(drift)
    device = {"v": ticks.states.index(f"{loop.device}.v"), "x": x}
    found = HandLoop(
        loop, path, device_keys(loop), float(whole.period), ticks.kind, tuple(parts), direct.pop(), device, turn, index, rows,
        None, [], 0,
    )  # fmt: skip
    found = _living(replace(found, doublings=_doublings(found, box)), middle)
    if not drift.folded:
        return found
    folding = _folding(found, drift, middle)
    return folding and replace(found, **folding)


def _from_position(maps, x):
    """A change of coordinates that is its own inverse: positions of the tick before become changes since then, which are small.

    So the velocity that follows from their difference keeps what an enclosure knows of it.
    """
    unit, turn = np.eye(len(maps[0].states)), np.eye(len(maps[0].states))
    for state in range(len(unit)):
        if state != x and all(np.array_equal(each.E[..., state, :], unit[x] - unit[state]) for each in maps):
            turn[state] = unit[x] - unit[state]
    return turn


def _living(found: HandLoop, middle) -> HandLoop:
    """The loop without the states that the first tick overwrites unread: eigenvalues 0 of the frame."""
    E = found.frames(middle[None], np.array([found.loop.values[found.path]]))[0]
    kept = np.flatnonzero(np.any(E + np.eye(len(E)) != 0, axis=0))
    return replace(found, index=[found.index[state] for state in kept], rows=found.rows[kept])


def _counted(drift: TickDrift):
    """The states that are kept, and their rows, those that a lead moves being counted from it."""
    gone = {lead for lead, _ in drift.moved} | (set() if drift.folded else set(drift.unread))
    rows = np.eye(len(drift.states))
    for lead, others in drift.moved:
        for state, factor in others:
            rows[state, lead] -= factor
    index = [state for state in range(len(drift.states)) if state not in gone]
    return index, rows[index]


def _folding(found: HandLoop, drift, middle) -> dict | None:
    """Row and column without which the frame is regular, and the states that remain, of a drift that depends on the numbers.

    None if the combination of states that a frame conserves is another one without the number.
    """
    E = found.frames(np.tile(middle, (2, 1)), np.array([0.0, found.loop.values[found.path]]))
    even, units = (part[0] for part in balance(E[:1]))
    law, _, shift = np.linalg.svd(even)
    conserved = law[:, -1] / units
    if np.any(np.abs(conserved @ E[1]) > CONSERVED * (np.abs(conserved) @ np.abs(E[1]))):
        return None
    row, column = int(np.argmax(np.abs(law[:, -1]))), int(np.argmax(np.abs(shift[-1])))
    rest = np.delete(found.index, row)
    return {"folded": (row, column), "read": [i for i, state in enumerate(rest) if state not in drift.unread]}


def frame_over(loop: HandLoop, low, high) -> tuple[Enclosure, np.ndarray]:
    """Frame-to-frame matrix, less identity, drift aside, over boxes `(n, 4)` of points as `HandLoop.points` has them.

    Returned in coordinates of its own, near to diagonal in the middle of each box; and its eigenvalues there.
    """
    A = loop.frames(*loop.hands_and_numbers((low + high) / 2))
    finite = np.isfinite(A).all((-1, -2), keepdims=True)
    A = np.where(finite, A, 0.0)
    V, back = basis(A)
    found = _in_basis(loop, low, high, V, back)
    # the frame in the middle of the piece, computed directly and in parts, may differ by rounding only
    rounding = 2 * np.abs(back @ A @ V - found.centre) + ROUNDING * (np.abs(back) @ np.abs(A) @ np.abs(V))
    rest = np.where(finite, found.rest + rounding, np.inf)
    return Enclosure(found.centre, found.slopes, found.curves, rest), np.linalg.eigvals(A)


def _in_basis(loop, low, high, V, back) -> Enclosure:
    """The frame less identity, without its drift, in another basis; see `HandLoop.frames`."""
    *hand, t = over_box(low, high)
    few = over_box(low[:, :NUMBER], high[:, :NUMBER])
    frame = _frame(loop, hand, few, t)
    pick, rows = loop.turn[:, loop.index], loop.rows @ loop.turn
    if loop.folded is None:
        return (back @ rows) @ (frame @ (pick @ V)) - back @ V
    E, still = (rows @ (each @ pick) - np.eye(len(loop.index)) for each in (frame, _frame(loop, few, few, None)))
    (row, _), (rest, columns) = loop.folded, loop.regular
    centre = still.centre[..., rest[:, None], columns]
    U, inverse = basis(np.where(np.isfinite(centre), centre, 0.0))
    kept = np.eye(len(rest))[loop.read]
    law = solved_left(inverse @ (still.part(rest, columns) @ U), still.part([row], columns) @ U) @ (inverse @ kept.T @ V)
    whole, across = (back @ kept) @ (E.part(rest, rest) @ (kept.T @ V)), (back @ kept) @ E.part(rest, [row])
    return whole + across @ widened(law, NUMBER + 1)


def basis(A):
    """Eigenvectors and their inverse, of a matrix nearby if they are too skew; a proof may use any basis."""
    n = A.shape[-1]
    V = np.linalg.eig(A)[1].astype(complex)
    back = inverted(V)
    worst = ~(_skew(V, back) < SKEW)
    if worst.any():
        noise = np.sin(1.0 + np.arange(n * n).reshape(n, n) ** 2 % 97)  # fixed, without any structure that A may have
        size = np.sqrt(np.abs(A).max(-1, keepdims=True) * np.abs(A).max(-2, keepdims=True))
        V[worst] = np.linalg.eig(A[worst] + (BLUR * size * noise)[worst])[1]
        for _ in range(2):
            V[worst] = _parted(A[worst], V[worst])
        back = inverted(V)
        lost = ~(_skew(V, back) < SINGULAR)
        V[lost] = back[lost] = np.eye(n)
    return V, back


def _parted(A, V):
    """V with modes that are far apart decoupled to first order, so that only those of a cluster stay blurred."""
    turned = inverted(V) @ A @ V
    own = np.diagonal(turned, axis1=-2, axis2=-1)
    gap = own[..., None, :] - own[..., None]
    step = turned / np.where(np.abs(gap) > FAR, gap, np.inf)
    return V + V @ np.where(np.abs(step) < 1, step, 0)


def _skew(V, back):
    """Condition number, infinite without an inverse."""
    return np.abs(V).sum(-2).max(-1) * np.abs(back).sum(-2).max(-1)


def _frame(loop, hand, few, t) -> Enclosure:
    """A frame of ticks; those that do not read the number have one parameter less. few: the hand's; t: None for none of it."""
    ticks = [_tick(loop, parts[: None if t else 2], *(hand if t and len(parts) > 2 else few), t) for parts in loop.ticks]
    return in_a_row(loop.kind.tolist(), ticks, _joined)


def _joined(first, second):
    count = max(each.slopes.shape[-3] for each in (first, second))
    return widened(second, count) @ widened(first, count)


def _tick(loop, parts, inverse, damping, stiffness, t):
    """The device's rows are written with the force that is left for its mass, `F = f - d v - k x`:
    `dv = s F/m - k/m g v`, `dx = s v + g (f - k x)/m`.
    """
    s, g = impulse_and_step(damping * inverse, stiffness * inverse, loop.period, loop.doublings)
    fixed, force, *more = parts
    unit = np.eye(len(fixed))
    if more:
        fixed, force = t * more[0] + fixed, t * more[1] + force
    v, x = (unit[loop.device[name] : loop.device[name] + 1] for name in "vx")
    pushed = force - stiffness * x
    dx = s * v + g * (inverse * pushed)
    moves = {loop.device["v"]: s * (inverse * (pushed - damping * v)) - (stiffness * inverse * g) * v, loop.device["x"]: dx}
    moves |= {i: dx - unit[i : i + 1] for i in np.flatnonzero(np.diagonal(loop.turn) < 0).tolist()}
    every = np.arange(len(unit))
    rows = [moves[i] if i in moves else fixed.part([i], every) if more else fixed[i : i + 1] for i in every]
    return stacked([[row] for row in rows]) + unit


def _doublings(loop, box):
    """How often the series has to be doubled for the fastest hand of the box."""
    m, d, k = (own + end for own, end in zip(loop.own, (box.low[MASS], box.high[DAMPING], box.high[STIFFNESS]), strict=True))
    reach = max(d / m * loop.period, 2 * np.sqrt(k / m) * loop.period)
    return max(0, int(np.ceil(np.log2(max(reach, 1e-9) / (2 * REACH)))))


def impulse_and_step(damping, stiffness, period, doublings):
    """As `wavesweep.loops.device.impulse_and_step`, enclosed."""
    tau = period * 0.5**doublings
    d, k = damping * tau, stiffness * tau**2
    slope, curve = 1.0, -d
    s, g, factorial = 1.0 + curve * 0.5, 0.5 + curve * (1 / 6), 2.0
    for order in range(3, TERMS):
        slope, curve = curve, -(d * curve) - k * slope
        factorial *= order
        s, g = s + curve * (1 / factorial), g + curve * (1 / (factorial * (order + 1)))
    s, g = s * tau, g * tau**2
    for _ in range(doublings):
        s, g = s * (2.0 - damping * s - 2.0 * (stiffness * g)), g * (2.0 - stiffness * g) + s * s
    return s, g
