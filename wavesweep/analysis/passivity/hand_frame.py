"""The frame of a loop with a hand at its device, enclosed over a box of hands and walls."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.passivity.enclosure import Enclosure, inverted, over_box, solved_left, stacked, with_another
from wavesweep.analysis.passivity.hand import HandBox, cut_with_hands, with_hands
from wavesweep.diagram import draw
from wavesweep.diagram.block import Block
from wavesweep.diagram.drift import drift_of
from wavesweep.lifted.at_wall import conserves, cut_at_wall
from wavesweep.lifted.connect import connect
from wavesweep.lifted.cut import close
from wavesweep.lifted.lift import fast_side, latches, lift_held, slow_sums

TERMS = 12  # of the device's series, whose n-th is at most about 0.6^n/n!
REACH = 0.25  # of a tick, up to which the series is taken; the rest by doubling
SKEW = 1e7  # condition of eigenvectors beyond which those of a matrix nearby are taken
BLUR = 1e-4  # of it, how near
FAR = 0.05  # between eigenvalues that count as separate
SINGULAR = 1e12
ROUNDING = 1e-14  # of the terms of a product in another basis
MASS, DAMPING, STIFFNESS, WALL = range(4)


@dataclass(frozen=True, slots=True, eq=False)
class HandLoop:
    """A loop in parts, so that the device's rows of the tick, which depend on the hand, can be replaced by an enclosure.

    own: mass (kg) and damping (N*s/m) of the device. tick: the fast side with some hand; device: its states there, as
    {"v": row}. force: `(1, n + m)`, on the device, from the n states of the tick and the m held inputs. slow: the slow
    side with a frame of zeros, from the wall's force; feeds: the inputs of that frame, from its states and from the
    wall's force. kept: the states that the loop has, the lead of its drift among them.
    shift: drift of the states beside it. kind: "integrates" and "conserved" as in
    `Cut`, or "plain". doublings: of the device's series, enough for every hand of the box.
    """

    values: dict
    own: tuple[float, float]
    period: float
    ratio: int
    delay: int
    tick: Block
    device: dict[str, int]
    force: np.ndarray
    slow: Block
    feeds: tuple[np.ndarray, np.ndarray]
    kept: list[int]
    lead: int | None
    shift: np.ndarray
    kind: str
    doublings: int

    def points(self, points) -> np.ndarray:
        """Hands (kg, N*s/m, N/m) and K_VE, `(..., 4)`, in terms that the frame is as linear in as can be.

        1/m and d of device and hand together, k, and `t = K/(a - K D_x)` of `_closed`; each grows with its own number.
        """
        mass, damping, stiffness, K = np.moveaxis(points, -1, 0)
        a, D = self._wall
        return np.stack([1 / (mass + self.own[0]), damping + self.own[1], stiffness, K / (a - K * D)], -1)

    def hands_and_walls(self, points) -> tuple[np.ndarray, np.ndarray]:
        """Hands `(..., 3)` and K_VE at these points."""
        inverse, damping, stiffness, t = np.moveaxis(points, -1, 0)
        a, D = self._wall
        hands = np.stack([1 / inverse - self.own[0], damping - self.own[1], stiffness], -1)
        return np.maximum(hands, 0), a * t / (1 + t * D)

    @property
    def order(self) -> int:
        """Of the loop with the wall in place."""
        return len(self.kept)

    def wall_is_regular(self, walls) -> bool:
        """Whether `t` grows with K all over `walls`."""
        a, D = self._wall
        return bool(a > 0 and all(a - K * D > 0 for K in walls))

    @property
    def _wall(self):
        return 1 - float(self.values["environment.B_VE"]) * self.slow.D[1, 0], self.slow.D[0, 0]


def hand_loop(values, box: HandBox) -> HandLoop:
    """Take the loop apart, by a hand of the box; springs in all of its hands or in none."""
    diagram = draw(with_hands(values, box.points(np.full((1, 3), 0.5))))
    cut = cut_at_wall(diagram)
    sampled = tuple(dict.fromkeys(diagram.samples.values()))
    tick = fast_side(diagram, sampled)
    pushed = connect("fast", diagram.fast, diagram.sums, (diagram.hand.force, *diagram.holds), (diagram.hand.push,))
    at = [pushed.states.index(name) for name in tick.states]
    frame = lift_held(tick, diagram.ratio, diagram.delay, tuple(diagram.holds), sampled)
    still = Block(
        "frame", frame.inputs, frame.outputs, frame.states, np.zeros_like(frame.E), np.zeros_like(frame.B), frame.C, frame.D
    )
    ports = tuple(f"frame.{name}" for name in frame.inputs)
    blocks, reads = (still, *diagram.slow, *latches(diagram)), (*diagram.wall, *ports)
    slow = connect("slow", blocks, slow_sums(diagram), (diagram.wall_force,), reads)
    drift, own = drift_of(diagram), f"{diagram.hand.device}."
    known = (*cut.states, drift.lead)
    kept = [i for i, name in enumerate(slow.states) if name in known]
    period = float(np.reshape(diagram.period, -1)[0])
    return HandLoop(
        dict(values), (float(values["device.mass"]), float(values["device.damping"])), period, diagram.ratio, diagram.delay,
        _one(tick), {name.removeprefix(own): i for i, name in enumerate(tick.states) if name.startswith(own)},
        np.concatenate([_at(pushed.C)[:, at], _at(pushed.D)[:, 1:]], -1), _one(slow), (_at(slow.C)[2:], _at(slow.D)[2:]),
        kept, slow.states.index(drift.lead) if drift.shift else None,
        np.array([drift.shift.get(name, 0.0) for name in slow.states]) / (drift.shift[drift.lead] if drift.shift else 1.0),
        "integrates" if cut.integrates else "conserved" if conserves(diagram, cut) else "plain",
        _doublings(values, box, period),
    )  # fmt: skip


def _at(array):
    return array.reshape(-1, *array.shape[-2:])[0]


def _one(block):
    """The block of the only element of the batch."""
    parts = (_at(getattr(block, name)) for name in "EBCD")
    return Block(block.name, block.inputs, block.outputs, block.states, *parts)


def frame_over(loop: HandLoop, low, high) -> tuple[Enclosure, np.ndarray]:
    """Frame-to-frame matrix, less identity, drift aside, over boxes `(n, 4)` of points as `HandLoop.points` has them.

    Returned in coordinates of its own, near to diagonal in the middle of each box; and its eigenvalues there.
    """
    middle = (low + high) / 2
    hands, K_VE = loop.hands_and_walls(middle)
    cut = cut_with_hands(loop.values, hands)
    A = close(cut, K_VE, loop.values["environment.B_VE"])
    finite = np.isfinite(A).all((-1, -2), keepdims=True)
    A = np.where(finite, A, 0.0)
    frame = _frame(loop, _tick(loop, *over_box(low[:, :WALL], high[:, :WALL])))
    V, back = basis(A)
    t, half = (part[:, WALL, None, None] / 2 for part in (low + high, high - low))
    found = with_another(*_closed(loop, frame, V, back, cut), t, half)
    # the frame in the middle of the piece, computed directly and in parts, may differ by rounding only
    rounding = 2 * np.abs(back @ A @ V - found.centre) + ROUNDING * (np.abs(back) @ np.abs(A) @ np.abs(V))
    rest = np.where(finite, found.rest + rounding, np.inf)
    return Enclosure(found.centre, found.slopes, found.curves, rest), np.linalg.eigvals(A)


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


def _tick(loop, inverse, damping, stiffness):
    """The tick, the held inputs being states that stay: `I + [[E, B], [0, 0]]`.

    The device's rows are written with the force that is left for its mass, `F = f - d v - k x`:
    `dv = s F/m - k/m g v`, `dx = s v + g (f - k x)/m`.
    """
    s, g = impulse_and_step(damping * inverse, stiffness * inverse, loop.period, loop.doublings)
    fixed = np.concatenate([loop.tick.E, loop.tick.B[:, 1:]], -1)
    unit = np.eye(fixed.shape[-1])
    row = {name: unit[i : i + 1] for name, i in loop.device.items()}
    v, x = row["v"], row.get("x", 0 * unit[:1])
    pushed = loop.force - stiffness * x
    dx = s * v + g * (inverse * pushed)
    moves = {"v": s * (inverse * (pushed - damping * v)) - (stiffness * inverse * g) * v, "x": dx}
    if "w" in row:
        moves["w"] = dx * (1 / loop.period) - row["w"]
    by_row = {i: moves[name] for name, i in loop.device.items()}
    held = np.zeros((len(unit) - len(fixed), len(unit)))
    return stacked([*([by_row.get(i, fixed[i : i + 1])] for i in range(len(fixed))), [held]]) + unit


def _doublings(values, box, period):
    """How often the series has to be doubled for the fastest hand of the box."""
    mass, damping = values["device.mass"] + box.low[MASS], values["device.damping"] + box.high[DAMPING]
    reach = max(damping / mass * period, 2 * np.sqrt(box.high[STIFFNESS] / mass) * period)
    return max(0, int(np.ceil(np.log2(max(reach, 1e-9) / (2 * REACH)))))


def impulse_and_step(damping, stiffness, period, doublings):
    """As `wavesweep.diagram.device.impulse_and_step`, enclosed."""
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


def _frame(loop, tick):
    """A frame of ticks: the states after it, from those before and from the held inputs, old and new ones."""
    n = len(loop.tick.states)
    rows, states = np.arange(n), np.arange(n)
    if loop.delay in (0, loop.ratio):
        return _power(tick, loop.ratio).part(rows, np.arange(tick.centre.shape[-1]))
    late, early = _power(tick, loop.ratio - loop.delay), _power(tick, loop.delay)
    held = np.arange(n, tick.centre.shape[-1])
    both = late.part(rows, states) @ early.part(rows, np.arange(tick.centre.shape[-1]))
    return stacked([[both, late.part(rows, held)]])


def _power(A, ticks):
    """`A^ticks`, by squaring."""
    power = None
    for bit in f"{ticks:b}":
        if power is not None:
            power = power @ power
        if bit == "1":
            power = A if power is None else A @ power
    return power


def _closed(loop, frame, V, back, cut):
    """With slow blocks and wall, as `cut_at_wall` and `close` have it: X, Y of `V^-1 A V = X + t Y`.

    `t = K/(a - K D_x)`, a = 1 - B D_v; the wall's force, `(K x + B v)/(a - K D_x)`, is `v B/a + t (x + v B D_x/a)`.
    """
    side, x, v, D = _side(loop, frame)
    B_VE = float(loop.values["environment.B_VE"])
    v = v * B_VE / (1 - B_VE * D[1, 0])
    x = x + v * D[0, 0]
    kept = loop.kept
    if loop.kind == "plain":
        return side.closed(kept, kept, back, V, v[:, kept] @ V), side.pushed_by(kept, back, x[:, kept] @ V)
    others = [i for i in kept if i != loop.lead]
    x, v = x[:, others], v[:, others]
    if loop.kind == "integrates":
        last, rows = np.eye(len(others) + 1)[-1:], [*others, loop.lead]
        x, v = (np.pad(row, ((0, 0), (0, 1))) for row in (x, v))
        return side.closed(rows, [*others, None], back, V, v @ V), side.pushed_by(rows, back, (x + last) @ V)
    U, inverse = basis(np.where(np.isfinite(cut.E).all((-1, -2), keepdims=True), cut.E, 0.0))
    E = side.closed(others, others, inverse, U, None)
    advance = side.closed([loop.lead], others, np.eye(1), U, None)
    moved = solved_left(E, advance) @ (inverse @ V)
    return side.closed(others, others, back, V, v @ V), side.pushed_by(others, back, moved + x @ V)


def _side(loop, frame):
    """The slow side and its rows that the wall reads; states that drift are relative to the lead of the drift."""
    states, n, lead = len(loop.slow.states), len(loop.tick.states), loop.lead
    moved, C = np.eye(states), loop.slow.C[:2].copy()
    if lead is not None:
        moved[:, lead] -= loop.shift * (np.arange(states) != lead)
        C[0, lead], C[1, lead] = C[0] @ loop.shift, 0
    X, W = loop.feeds
    still = moved @ (loop.slow.E - np.eye(states, n) @ np.eye(n, states))
    columns, pushed = np.concatenate([np.eye(n, states), X]), np.concatenate([np.zeros((n, 1)), W])
    return Side(still, moved @ loop.slow.B, moved[:, :n], frame, columns, pushed), C[:1], C[1:], loop.slow.D[:2]


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """The slow side: `[E B] = [E0 B0] + rows frame [columns, pushed]`."""

    E0: np.ndarray
    B0: np.ndarray
    rows: np.ndarray
    frame: Enclosure
    columns: np.ndarray
    pushed: np.ndarray

    def closed(self, rows, columns, left, V, q) -> Enclosure:
        """`left (E V + B q)` of these rows and columns (None: a column of zeros), q a row or nothing."""
        pick = np.zeros((len(self.E0), len(columns)))
        for at, column in enumerate(columns):
            if column is not None:
                pick[column, at] = 1
        right, still = self.columns @ pick @ V, left @ (self.E0[rows] @ pick @ V)
        if q is not None:
            right, still = right + self.pushed @ q, still + left @ (self.B0[rows] @ q)
        return (left @ self.rows[rows]) @ (self.frame @ right) + still

    def pushed_by(self, rows, left, q) -> Enclosure:
        """`left B q` of these rows."""
        return (left @ self.rows[rows]) @ (self.frame @ (self.pushed @ q)) + left @ self.B0[rows] @ q
