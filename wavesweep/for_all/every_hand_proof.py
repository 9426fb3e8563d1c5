"""The damping with which a loop is stable with every passive hand, whatever its frames do, proved
in ball arithmetic.

The hand is continuous and may push within a tick. While the device moves by u in a tick of length
T, its damper takes at least `d u^2/T`, and the force against it, which is held, takes `f u` (see
`passive.over_ranges.reaction_maps`). So what matters is the switched system from displacements to
forces, with the position x of the device prescribed. At rest all its states are multiples of x.
Counted from there they follow `s+ = A s + B u`, and the force is `f = k x + C s + D u`. With the
stored energy `k x^2/2 + s' P_i s` at node i of an automaton of ticks, no hand takes out more than
was stored if

    F = [P_i 0; 0 d/T] + [0 C'/2; C/2 D - k/2] - [A B]' P_j [A B]

is positive definite for every kind of tick from node i to j: x cancels, but for `k u^2/2`. The
nodes are what may still happen, such as the ticks since the last sample and whether its result is
in place. `for_all.dissipation` finds P and the least d in doubles; here F is computed in balls, and
eliminated. With less than what a kind of frame needs that is repeated for ever (`damping_peak`), a
hand takes out energy: this refutes.
"""

from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np
from flint import arb, arb_mat, ctx

from wavesweep.capabilities import offered
from wavesweep.engine.drawing import Drawing, DrawnBlock
from wavesweep.engine.errors import UsageError
from wavesweep.engine.expressions import ONE, Tree
from wavesweep.engine.loop import Loops
from wavesweep.engine.norms import TickMaps, closure, damping_peak
from wavesweep.engine.poles import is_stable
from wavesweep.engine.switched import (
    Graph,
    Norms,
    Symbol,
    alive,
    automaton,
    least_damping,
    shortest_through,
)
from wavesweep.for_all.plan import Plan
from wavesweep.haptics.held_loop import device_of

PROOF_BITS = 192  # of the balls in which the proof is checked
MOST_UNKNOWNS = 1500  # unknown numbers of the stored energies, which take some seconds
X, PUSH, FORCE = 0, 1, 2  # states of a loop with a ruler
LEAST = 0.01  # N*s/m
ROOM_OF_DAMPING = 1e-12  # of the damping, for the rounding of a product


@dataclass(frozen=True, slots=True)
class Needed:
    """Damping of device and hand together, N*s/m.

    proved: suffices for every passive hand and every order of frames; infinite if none is proved.
    refuted: with less, a passive hand that moves at `omega` (rad/s) takes out energy for ever while
    the pattern `word` is repeated; -infinite without one.
    """

    proved: float
    refuted: float = -np.inf
    word: tuple[int, ...] = ()
    omega: float = np.nan


@dataclass(frozen=True, slots=True, eq=False)
class Unmet:
    """The frames of states that the hand does not meet, less identity, as a `Family` of no
    number; dE: bounds on the errors."""

    E: np.ndarray
    dE: np.ndarray
    follows: np.ndarray

    @staticmethod
    def of(frames: list[arb_mat], states: np.ndarray, follows: np.ndarray) -> "Unmet | None":
        """Return those of the states that are not over after some frames; None without any."""
        remaining = alive(
            np.logical_or.reduce([_pattern(frame) for frame in frames]), states
        ).tolist()
        if not remaining:
            return None
        matrices = [
            [frame[i, j] - int(i == j) for i in remaining for j in remaining] for frame in frames
        ]
        E = np.array([[float(entry.mid()) for entry in matrix] for matrix in matrices])
        dE = np.array([[_rounded_off(entry) for entry in matrix] for matrix in matrices])
        shape = len(frames), len(remaining), len(remaining)
        return Unmet(E.reshape(shape), np.nextafter(dE, np.inf).reshape(shape), follows)

    def at(self, x: float) -> np.ndarray:  # noqa: ARG002
        """See `Family`."""
        return np.eye(self.E.shape[-1]) + self.E

    def enclosed(self, x: float) -> tuple[np.ndarray, np.ndarray]:  # noqa: ARG002
        """See `Family`."""
        return self.E, self.dE

    def hull(self, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:  # noqa: ARG002
        """See `Family`."""
        return self.E[None], self.dE[None]


def _rounded_off(entry: arb) -> float:
    """The size of what a ball has beyond the double in its middle."""
    return float((entry - arb(float(entry.mid()))).abs_upper())


@dataclass(frozen=True, slots=True, eq=False)
class EveryHand:
    """A loop whose frames vary, as the hand sees it.

    kinds: of each kind of tick `[A B]` and `[C D - k/2]` as matrices of balls. stiffness: k, N/m;
    with the device's own it has to be 0 or more. unmet: the states that the hand does not meet and
    that last from frame to frame, which have to decay as well; None without. graph: the automaton,
    whose symbols are kinds. period: of a tick, s. words: the kinds of ticks of each symbol;
    symbols, follows: see `LoopFrames`.
    """

    kinds: tuple[tuple[arb_mat, arb_mat], ...]
    stiffness: arb
    unmet: "Unmet | None"
    graph: Graph
    period: float
    words: tuple[tuple[int, ...], ...]
    symbols: tuple[Symbol, ...]
    follows: np.ndarray

    @staticmethod
    def of(plan: Plan) -> "EveryHand | None":
        """Return the loop of a plan; None if it does not settle to a force with a stiffness.

        Nothing may read the velocity of the mass that the hand holds. Errors: UsageError if it is
        too large.
        """
        with ctx.workprec(PROOF_BITS):
            places, maps = _ticks(plan)
            rows, samples, symbols, follows = plan.written(places)
            joined: dict[tuple[int, ...], int] = {}
            words = tuple(
                _timed([*row, sample], maps, joined)
                for row, sample in zip(rows, samples, strict=True)
            )
            ticks = [reduce(_after, (maps[place] for place in moments)) for moments in joined]
            from_rest = _from_rest(ticks)
            if from_rest is None:
                return None
            kinds, stiffness, unmet_states = from_rest
            graph = automaton(words, follows)
            frames = [reduce(_after, (ticks[kind] for kind in word)) for word in words]
            unmet = Unmet.of(frames, unmet_states, follows)
        n = kinds[0][0].nrows()
        if (unknowns := graph.nodes * n * (n + 1) // 2) > MOST_UNKNOWNS:
            raise UsageError(
                f"hand passive while frames vary: expected at most {MOST_UNKNOWNS} unknown numbers of stored energies, found {unknowns}; "
                "choose shorter frames, or fewer delays of results"
            )
        period = 1 / float(Loops(plan.drawing, plan.values).rate)
        return EveryHand(kinds, stiffness, unmet, graph, period, words, symbols, follows)

    def pulls(self, stiffness: float) -> bool:
        """Whether the loop and a spring of the device (N/m) push it away from where it is, all
        in all."""
        with ctx.workprec(PROOF_BITS):
            return bool(self.stiffness + arb(stiffness - ROOM_OF_DAMPING * abs(stiffness)) < 0)

    def needed(self) -> Needed:
        """Return the damping that is needed. Accuracy: 1e-7, unless rounding ends the search for
        energies earlier."""
        n = self.kinds[0][0].nrows()
        M, rows = (np.array([_doubles(kind[place]) for kind in self.kinds]) for place in (0, 1))
        S = np.zeros((len(M), n + 1, n + 1))
        S[:, n, :] += rows[:, 0] / 2
        S[:, :, n] += rows[:, 0] / 2
        edges = self.graph.symbol
        proved = np.inf if n else float(ROOM_OF_DAMPING - S.min() * self.period)
        follows = self.graph.target[:, None] == self.graph.source
        for centre, damping in least_damping(M[edges], S[edges], follows) if n else ():
            if centre.norms.graph.is_complete(follows) and self._dissipates(centre.norms, damping):
                proved = float(damping * self.period * (1 + ROOM_OF_DAMPING * np.sign(damping)))
                break
        return Needed(proved, *self._refuted(M, rows, proved))

    def _refuted(self, M, rows, proved):
        """The most damping that a pattern needs which is repeated for ever, that pattern, and the
        frequency.

        Patterns that need most are made longer until one needs about what is proved. The first ones
        have as many losses in a row as there may be.
        """
        n = M.shape[1]
        maps = [
            (A[:, :n] - np.eye(n), A[:, n:], row[:, :n], row[:, n:])
            for A, row in zip(M, rows, strict=True)
        ]
        shortest = [self._needed_by(word, maps) for word in shortest_through(self.follows)]
        best = max(shortest, key=lambda need: need[0])
        beam = [()]
        for _ in range(3):  # frames of a pattern
            longer = [(*first, last) for first in beam for last in range(len(self.words))]
            longer = [word for word in longer if self.follows[word[:-1], word[1:]].all()]
            needs = sorted(
                (self._needed_by(word, maps) for word in longer), key=lambda need: -need[0]
            )
            best = max(best, needs[0], key=lambda need: need[0])
            # No longer patterns are looked at if proof and pattern are this near.
            if best[0] >= proved - 1e-4 * (LEAST + abs(proved)) or not np.isfinite(proved):
                break
            # 96 patterns of two and of three frames are looked at.
            beam = [word for _, word, _ in needs[: max(1, 96 // len(self.words))]]
        return best

    def _needed_by(self, word, maps):
        """The damping that a repeated pattern needs, -infinite if it is not known, the pattern,
        and the frequency."""
        ticks = TickMaps.of(maps, np.concatenate([self.words[symbol] for symbol in word]), ())
        lifted = ticks.lifted()
        if not self.follows[word[-1], word[0]] or (lifted.E.size and not is_stable(lifted.E)[0]):
            return -np.inf, word, np.nan
        peak = damping_peak(ticks, lifted, np.array([self.period]), np.zeros(1))
        value = float(peak.value[0]) if peak.certified[0] else -np.inf
        return value, word, float(peak.theta[0] / (self.period * ticks.kind.size))

    def _dissipates(self, norms: Norms, damping: float) -> bool:
        """Whether F is positive definite on every edge, and each P as well: elimination meets
        positive pivots alone."""
        with ctx.workprec(PROOF_BITS):
            stored = [arb_mat(P.tolist()) for P in norms.P]
            definite = all(map(_definite, (P.tolist() for P in stored)))
            for source, edge, target in zip(
                norms.graph.source, norms.graph.symbol, norms.graph.target, strict=True
            ):
                M, row = self.kinds[self.graph.symbol[edge]]
                F = (M.transpose() * stored[target] * M * -1).tolist()
                n = len(F) - 1
                for i in range(n):
                    F[i] = [F[i][j] + stored[source][i, j] for j in range(n)] + [
                        F[i][n] + row[0, i] / 2
                    ]
                    F[n][i] = F[i][n]
                F[n][n] += row[0, n] + arb(damping)
                definite = definite and _definite(F)
            return definite


def _definite(rows) -> bool:
    """Whether a symmetric matrix of balls is positive definite, as rows, which are eliminated."""
    for i in range(len(rows)):
        if not rows[i][i] > 0:
            return False
        for j in range(i + 1, len(rows)):
            share = rows[j][i] / rows[i][i]
            rows[j] = [a - share * b for a, b in zip(rows[j], rows[i], strict=True)]
    return True


def _doubles(matrix):
    return np.array([[float(entry.mid()) for entry in row] for row in matrix.tolist()]).reshape(
        matrix.nrows(), matrix.ncols()
    )


def with_ruler(drawing: Drawing) -> Drawing:
    """Return the loop whose device is a ruler: it moves by a constant displacement in each tick,
    and another block takes the force that pushes it, without the hand's. Their states are the
    first three: X, PUSH, FORCE."""
    device = device_of(drawing)
    zero = Tree.number(0.0)
    pushes = f"{device}!push"
    takes = f"{device}!force"
    explicit = (("method", "explicit"),)
    ruler = [DrawnBlock(name, "integrator", explicit, ONE, zero) for name in (device, pushes)]
    ruler.append(DrawnBlock(takes, "delay", (("steps", ONE),), ONE, zero))
    wires = []
    for port, terms in drawing.wires:
        terms_of_port = tuple(
            (f"{device}.y" if signal == f"{device}.x" else signal, gain)
            for signal, gain in terms
            if signal != drawing.hand[0]
        )
        wires.append((f"{takes}.u" if port == f"{device}.f" else port, terms_of_port))
    wires.append((f"{device}.u", ((f"{pushes}.y", drawing.tick_hz),)))
    other_blocks = [block for block in drawing.blocks if block.name != device]
    return replace(
        drawing,
        blocks=(*ruler, *other_blocks),
        wires=tuple(wires),
        hand=None,
        inputs=(),
        outputs=(),
        named=(),
    )


def _ticks(plan: Plan) -> tuple[dict[tuple[Any, int], int], list[arb_mat]]:
    """The different maps of ticks of a loop with a ruler, and (kind of tick, period of the slow
    blocks) -> place of its map among them."""
    balls = offered("ticks")
    if balls is None:
        raise UsageError(
            "hand passive while frames vary: expected the capability prove, found that it is not there"
        )
    at_steps = [with_ruler(plan.schedule.with_period(plan.drawing, step)) for step in plan.steps]
    loops = [balls.BallLoop(drawing, plan.values, "") for drawing in at_steps]
    # An output is held at some periods only if its block runs in every tick at others: held in all,
    # so that all maps have the same states.
    held_outputs = sorted({output for loop in loops for output in loop.held})
    places = {}
    maps = []
    place_of_map = {}
    for step, loop in zip(plan.steps, loops, strict=True):
        running = plan.schedule.running([block.name for block in loop.blocks])
        loop.kinds = tuple(tuple(np.flatnonzero(tick).tolist()) for tick in running)
        loop.held = held_outputs
        tick_maps = loop.tick_maps(arb(0))
        for kind, running_blocks in zip(plan.schedule.kinds, loop.kinds, strict=True):
            matrix = tick_maps[running_blocks][0]
            digits = tuple(
                (entry.mid().man_exp(), entry.rad().man_exp()) for entry in matrix.entries()
            )
            if digits not in place_of_map:
                place_of_map[digits] = len(maps)
                maps.append(matrix)
            places[kind, step] = place_of_map[digits]
    return places, maps


def _timed(row, maps, joined):
    """The kinds of a row of ticks, in which moments without time are joined with the tick behind
    them."""
    word = []
    before = ()
    for kind in row:
        before = (*before, kind)
        if not maps[kind][X, PUSH].is_zero():
            word.append(joined.setdefault(before, len(joined)))
            before = ()
    return tuple(word)


def _after(first, second):
    return second * first


def _pattern(matrix):
    return np.array([[not entry.is_zero() for entry in row] for row in matrix.tolist()])


def _from_rest(
    ticks: list[arb_mat],
) -> tuple[tuple[tuple[arb_mat, arb_mat], ...], arb, np.ndarray] | None:
    """`[A B]` and `[C D - k/2]` of each kind of tick, of the states that matter for the force,
    counted from their rest; the stiffness k; and which of the states are none of these.

    With the place x and the displacement u, `x+ = x + u`, a tick moves the states s that the force
    reads by `s+ = F s + g x + b u`, and the force is `f = -c s - e x - h u`. They rest at R x if
    `R = F R + g`, which has to hold in all ticks. So, with s counted from there,

        A = F,   B = b - R,   C = -c,   D = -h,   k = -(e + c R).

    None if nothing rests alike in all of them.
    """
    present = np.array([_pattern(tick) for tick in ticks]).any(0)
    read_by_force = np.flatnonzero(closure([present], present[FORCE])).tolist()
    states = [state for state in read_by_force if state > FORCE]
    frame = reduce(_after, ticks)
    identity = arb_mat(len(states), len(states), [int(i == j) for i in states for j in states])
    try:
        R = (identity - _part(frame, states, states)).solve(_part(frame, states, [X]))
    except ZeroDivisionError:
        return None
    systems = []
    stiffness = None
    for tick in ticks:
        moves = tick[X, PUSH]  # the displacement of a push of 1
        F = _part(tick, states, states)
        g = _part(tick, states, [X])
        b = _part(tick, states, [PUSH]) * (1 / moves)
        c = _part(tick, [FORCE], states)
        k = -(_part(tick, [FORCE], [X]) + c * R)[0, 0]
        if stiffness is None:
            stiffness = k
        residual = g + (F - identity) * R
        rests = all(entry.contains(0) for entry in residual.entries())
        if not rests or not k.overlaps(stiffness):
            return None
        systems.append((F, b - R, -c, -tick[FORCE, PUSH] / moves - k / 2))

    moved = []  # places among the states that a push moves
    if states:
        A_present = np.array([_pattern(A) for A, _, _, _ in systems]).any(0)
        B_present = np.array([_pattern(B) for _, B, _, _ in systems]).any(0)[:, 0]
        moved = np.flatnonzero(closure([A_present.T], B_present)).tolist()
    kinds = []
    for A, B, C, last in systems:
        AB = []
        for i in moved:
            AB.extend([*(A[i, j] for j in moved), B[i, 0]])
        CD = [*(C[0, j] for j in moved), last]
        kinds.append((arb_mat(len(moved), len(moved) + 1, AB), arb_mat([CD])))
    met = {X, PUSH, FORCE, *(states[place] for place in moved)}
    unmet = [state for state in range(ticks[0].nrows()) if state not in met]
    return tuple(kinds), stiffness, np.array(unmet, int)


def _part(matrix: arb_mat, rows: list[int], columns: list[int]) -> arb_mat:
    entries = [matrix[i, j] for i in rows for j in columns]
    return arb_mat(len(rows), len(columns), entries)
