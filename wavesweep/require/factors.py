"""Where a loop stays stable along a number while its signal at a cut is multiplied by any factor of
a range: gains from 1/g to g, or phases exp(j phi) of up to p either way.

The signal is y in the ticks in which it is made, and with the factor f the input u = (f - 1) y is
added to it. With E, G, O, T of a frame of the loop with the factor 1, z is an eigenvalue of the
loop with the factor f (1 + e) where

    K - (z - 1) L + e N,   K = [E G; (f-1) O  (f-1) T - 1],   L = [1 0; 0 0],   N = f [0 0; O T]

is singular. In eigenvectors of the middle of a panel of the number, and of a piece of the range, it
is diagonal, `d_i - (z - 1)`, or 1 for the inputs. If the diagonal dominates all that is left for no
z of the unit circle, no number of the panel and no factor of the piece has an eigenvalue on it, and
all have as many outside as the middle. So a panel is shown if pieces cover the range and have none
outside, and it is lost if a piece, or a single factor, has one in all of it.

e is real for gains, and next to the imaginary line for phases. So an eigenvalue moves along a line,
`d_i + e N_ii`, whose distance from the circle is exact: where the last factor becomes stable inside
the range, eigenvalues move along the circle, and pieces may be as wide as the root of what is left.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wavesweep.engine.blocks import OUTPUT
from wavesweep.engine.drawing import BLOCK
from wavesweep.engine.errors import UsageError
from wavesweep.engine.expressions import ONE
from wavesweep.engine.frames import balance, inverse, solve, sum_rounding
from wavesweep.engine.intervals import SHARE_OF_SPAN, Intervals
from wavesweep.require.at_cut import INPUT, PATH, refuse_cut, runs_at_cut
from wavesweep.require.between import Between, by_panel, needed, of_panels, typical_between
from wavesweep.require.by_forms import ByForms
from wavesweep.require.disc_panels import (
    BAD,
    GOOD,
    LOST,
    OPEN,
    SAFE,
    Accuracy,
    Domain,
    along_panels,
)
from wavesweep.require.discs import eigenvectors
from wavesweep.require.gain_bound import FACTOR_GAIN, FactorBound
from wavesweep.require.gain_intervals import attached, begun_at_low_end
from wavesweep.require.maps import at_runs
from wavesweep.require.pencil import dominated

if TYPE_CHECKING:
    from wavesweep.engine.loop import Loops

RETURNED = "what comes back to the cut"
# of an end, and of a NEAR_ZERO-th of the span: from there on rounding hides which factor is the last
END_EXACTNESS = 1e-7
# up to which eigenvalues are taken together, as are those of 16 ticks of a dead time
SMALL_EIGENVALUES = 0.5
MOST_RUNS = 128  # of the signal in a frame, whose inputs stand beside the states
# of a slice, some 10 s: a piece of N rows takes PIECE_WORK + N^3, by measured times
MOST_WORK = 200e6
PIECE_WORK = 1000
PIECE = np.dtype([("panel", int), ("place", float), ("half", float)])  # of a range, on a panel
LOOKED_AT = 33  # factors at which the largest eigenvalue is looked for, next to an end


def _opened(loops: Loops, cut: str) -> Loops:
    """The loops with a gain at the cut, an input that is added to what it reads, and what comes back as
    an output."""
    drawing = loops.drawing
    wires = dict(drawing.wires)
    wires[f"{BLOCK}.u"] = (*wires[f"{BLOCK}.u"], (INPUT, ONE))
    drawing = replace(
        drawing,
        wires=tuple(wires.items()),
        inputs=(*drawing.inputs, (INPUT, INPUT, "")),
        outputs=(*drawing.outputs, (RETURNED, ((cut, ONE),), "")),
    )
    return loops._replace(drawing=drawing)


def _range_of(wanted: FactorBound) -> Range:
    """The factors that have to be borne: logarithms of gains, or angles (rad)."""
    if wanted.margin == FACTOR_GAIN:
        end = float(np.log(wanted.size))
        return Range(-end, end, turning=False)
    return Range(0.0, float(np.radians(wanted.size)), turning=True)


def along_factors(
    loops: Loops, along: str, domain: Domain, wanted: FactorBound, stable: Intervals
) -> Intervals:
    """All intervals of a number in which loops are stable with all factors, within those in which
    they may be stable with the factor 1.

    The omegas of ends are those of the eigenvalue that leaves with
    the last factor, with a minus: no mode of the loop itself is on the circle there. Accuracy: ends
    to END_EXACTNESS; what is not shown with MOST_WORK is in doubt. Errors: UsageError for a signal
    at which loops cannot be cut, that moves without end, or that is made more than MOST_RUNS times
    in a frame.
    """
    refuse_cut(loops.drawing, wanted.cut)
    forms = ByForms(loops, along, wanted.cut, wanted.margin, wanted.size, domain.span)
    loops = loops.with_gain_at(wanted.cut)
    runs = runs_at_cut(loops)
    if runs.size > MOST_RUNS:
        raise UsageError(
            f"{PATH}.{wanted.margin}: expected Ms in its place, since {wanted.cut!r} is made "
            f"{runs.size} times in a frame, and factors are proved of at most {MOST_RUNS}"
        )
    loops = _opened(loops, wanted.cut)
    route = INPUT, OUTPUT + RETURNED
    span = domain.span
    size = domain.period.size
    drift, port, _, _ = typical_between(loops, along, span, size, route, "margins")
    factors = _range_of(wanted)
    columns = np.arange(size)
    about = loops, along, route, 1.0, drift, needed(port.maps), runs, columns, stable
    judge = Factors(*about, factors, span, np.zeros(size), forms)
    begun = np.maximum(begun_at_low_end(judge, span), END_EXACTNESS)
    # Ends are exact to 16 of the narrowest panels.
    ends = Accuracy(END_EXACTNESS, 16.0, END_EXACTNESS, begun, slow=True)
    intervals = along_panels([judge], np.ones(size, bool), domain, ends)
    intervals = replace(intervals, low_omega=-intervals.low_omega, high_omega=-intervals.high_omega)
    return attached(intervals, stable, SHARE_OF_SPAN * domain.width, END_EXACTNESS)


@dataclass(frozen=True, slots=True)
class Range:
    """Factors exp(place) from low to high, or exp(j place) if they are turning; phases below 0 are
    the conjugates of these."""

    low: float
    high: float
    turning: bool

    def first(self) -> np.ndarray:
        """The whole range as a piece, and its ends."""
        middle = (self.low + self.high) / 2
        pieces = [(0, middle, self.high - middle), (0, self.high, 0.0)]
        if not self.turning:
            pieces.append((0, self.low, 0.0))
        return np.array(pieces, PIECE)

    def about(
        self, place: np.ndarray, half: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The factor f about which factors f (1 + e) of pieces are, and e = t u + r with t of size
        1: the largest real u and the largest r.

        With v from -h to h, exp(v) is cosh(h) (1 + u), |u| <= tanh(h), and exp(j v) is 1 + j sin(v)
        - (1 - cos(v)).
        """
        if self.turning:
            return np.exp(1j * place), np.sin(half), 2 * np.sin(half / 2) ** 2
        return np.exp(place) * np.cosh(half), np.tanh(half), np.zeros_like(half)


@dataclass(frozen=True, slots=True, eq=False)
class Factors(Between):
    """A judge of panels of the number, see `along_panels`; level: not asked for.

    read: ticks in which the signal is made. work: spent on each column, see MOST_WORK. kept: the
    pieces that stay open on panels, by the column and an end: the others are shown on all parts of
    these.
    """

    factors: Range
    span: tuple[float, float]
    work: np.ndarray
    forms: ByForms
    kept_pieces: dict[tuple[int, str, float], np.ndarray] = field(default_factory=dict)
    smooth: ClassVar[bool] = True

    @property
    def order(self) -> int:
        """Of the pencil."""
        return self.kept.size + self.read.size

    def struggles(self, tried: np.ndarray) -> np.ndarray:
        return (tried > 0) & (self.work > MOST_WORK / 4)

    def over_frame(self, port: Any, size: int) -> tuple[Any, Any, Any, Any]:
        """The maps of frames, of the ticks in which the signal is made."""
        return at_runs(port, self.kept, (size,), self.read)

    def labelled(
        self, column: np.ndarray, low: np.ndarray, high: np.ndarray, bounds: list[np.ndarray]
    ) -> np.ndarray:
        label = np.full(column.size, OPEN)
        spent = self.work[column] > MOST_WORK
        label[spent] = LOST
        panels_left = np.flatnonzero(~spent)
        if not panels_left.size:
            return label
        port, shape, bounded = self._about(
            column[panels_left], low[panels_left], high[panels_left], bounds
        )
        maps = by_panel(self.over_frame(port, bounded.size * shape[1]), shape)
        for matrix, error in maps:
            bounded &= np.isfinite(matrix).all((1, 2, 3)) & np.isfinite(error).all((1, 2, 3))
        maps = of_panels(maps, bounded)
        panels_left = panels_left[bounded]
        pieces_left = self._left(column[panels_left], low[panels_left], high[panels_left])
        lost = np.zeros(panels_left.size, bool)
        # A middle that is on the circle stays so: next to an end that one factor inside the range
        # sets, pieces are as wide as the root of a panel. Where all factors do, that is no help.
        halvings = np.log2((self.span[1] - self.span[0]) / (high[panels_left] - low[panels_left]))
        every_other = np.round(halvings) % 2 == 0
        open_pieces = [pieces_left[:0]]
        while pieces_left.size:
            panel = pieces_left["panel"]
            spent = self.work[column[panels_left]] > MOST_WORK
            open_pieces.append(pieces_left[spent[panel]])
            pieces_left = pieces_left[~spent[panel]]
            fine, fine_middle, outside = self._shown(pieces_left, maps)
            np.add.at(
                self.work, column[panels_left][pieces_left["panel"]], PIECE_WORK + self.order**3
            )
            lost[pieces_left["panel"][(fine | fine_middle) & outside]] = True
            going_on = ~fine & ~lost[pieces_left["panel"]]
            halved = going_on & fine_middle & (pieces_left["half"] > 0)
            stuck = going_on & ~halved
            # Pieces of a panel with a middle next to the circle, up to which they are halved.
            few = np.bincount(pieces_left["panel"][stuck], minlength=panels_left.size) <= 16
            finer = stuck & (pieces_left["half"] > 0) & (few & every_other)[pieces_left["panel"]]
            open_pieces.append(pieces_left[stuck & ~finer])
            open_pieces.append(_halves(pieces_left[finer]))
            pieces_left = _halves(pieces_left[halved])
        still_open = np.concatenate(open_pieces)
        label[panels_left[np.setdiff1d(np.arange(panels_left.size), still_open["panel"])]] = GOOD
        label[panels_left[lost]] = BAD
        for index in np.unique(still_open["panel"]).tolist():
            pieces = still_open[still_open["panel"] == index]
            place = panels_left[index]
            self.kept_pieces[int(column[place]), "from", low[place]] = pieces
            self.kept_pieces[int(column[place]), "to", high[place]] = pieces
        return label

    def worst_at(self, column: int, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The largest eigenvalue with any of the factors, less 1, and by how much it is outside."""
        maps = self.maps(np.full(p.size, column), p)
        E, G, O, T = (matrix for matrix, _ in maps)
        delta = []
        for loop in range(p.size):
            of_loop = E[loop].real, G[loop].real, O[loop].real, T[loop].real
            places = np.linspace(self.factors.low, self.factors.high, LOOKED_AT)
            for _ in range(4):  # zooms between the neighbours of the largest
                f, _, _ = self.factors.about(places, np.zeros(places.size))
                of_factors = np.linalg.eigvals(_with_factor(*of_loop, f)[0])
                sizes = np.abs(1 + of_factors).max(-1)
                largest = int(sizes.argmax())
                around = places[max(largest - 1, 0)], places[min(largest + 1, places.size - 1)]
                eigenvalues = of_factors[largest]
                places = np.unique(np.append(np.linspace(*around, LOOKED_AT), places[largest]))
            delta.append(eigenvalues[np.abs(1 + eigenvalues).argmax()])
        delta = np.array(delta)
        return delta, np.abs(1 + delta) - 1

    def _left(self, column: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """The pieces that are to be shown on panels: those that stay open on twice as wide ones,
        or the first."""
        pieces = [np.zeros(0, PIECE)]
        for index, column_number in enumerate(column.tolist()):
            wider = self.kept_pieces.get((column_number, "from", low[index]))
            if wider is None:
                wider = self.kept_pieces.get(
                    (column_number, "to", high[index]), self.factors.first()
                )
            of_panel = wider.copy()
            of_panel["panel"] = index
            pieces.append(of_panel)
        return np.concatenate(pieces)

    def _shown(
        self, pieces: np.ndarray, maps: list[Any]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of pieces on their panels: whether no factor has an eigenvalue on the circle, whether
        that in the middle has none, and whether that has one outside."""
        points = 2 * maps[0].value.shape[1]
        # Entries of the pencils of some pieces.
        at_once = max(1, 1_000_000 // (points * self.order**2))
        shown = [(np.zeros(0, bool),) * 3]
        for first in range(0, pieces.size, at_once):
            some = pieces[first : first + at_once]
            f, u, r = self.factors.about(some["place"], some["half"])
            turn = 1j if self.factors.turning else 1.0
            shown.append(clear(of_panels(maps, some["panel"]), f, turn, u, r))
        return tuple(np.concatenate(parts) for parts in zip(*shown, strict=True))


def clear(
    maps: list[Any], f: np.ndarray, turn: complex, u: np.ndarray, r: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Whether no eigenvalue is on the unit circle, for all numbers of discs and all factors of
    pieces; the same for the factors f in their middles; and whether these have one outside.

    maps: E, G, O, T in the middles of discs and on the upper halves of circles of twice the size,
    `(pieces, points, ...)`, with bounds on their errors. f, turn, u, r: see `Range.about`.
    """
    E, G, O, T = (matrix for matrix, _ in maps)
    dE, dG, dO, dT = (error[:, 0] for _, error in maps)
    n = E.shape[-1]
    m = T.shape[-1]
    N = n + m
    states = np.arange(N) < n
    rounding = sum_rounding(2 * N, of_complex=True)  # of products of three
    with np.errstate(all="ignore"):
        # In the middle: the eigenvalues and vectors of the states, and what inputs they have.
        middle = E[:, 0].real, G[:, 0].real, O[:, 0].real, T[:, 0].real
        S, to_inputs = _with_factor(*middle, f)
        fine = np.isfinite(S).all((-1, -2))
        S, units = balance(np.where(fine[:, None, None], S, 0.0), thorough=True)
        d, V = eigenvectors(S, SMALL_EIGENVALUES)
        V = units[:, :, None] * V
        f = f[:, None, None]
        K = _pencil(*middle, f)
        alone = np.broadcast_to(np.eye(N, m, -n), (len(V), N, m))  # inputs
        V = np.concatenate([np.concatenate([V, to_inputs @ V], -2), alone], -1)
        W = inverse(np.concatenate([V[:, :, :n] * states[:, None], K[:, :, n:]], -1))
        W_size = np.abs(W)
        V_size = np.abs(V)

        # What is left of K and L, in the middle and on the discs.
        diagonal = np.concatenate([d, np.ones((len(d), m))], -1)
        L = np.diag(states.astype(float))
        dK = _pencil_sizes(dE, dG, dO, dT, np.abs(f - 1)) + rounding * np.abs(K)
        F = np.abs(W @ K @ V - diagonal[:, None, :] * np.eye(N)) + W_size @ dK @ V_size
        loss = np.abs(W @ (L @ V) - L) + rounding * (W_size @ (L @ V_size))
        moved = []
        for rims in ((E, G, O, T), (E.conj(), G.conj(), O.conj(), T.conj())):
            changes = [
                rim[:, 1:] - centre[:, None] for rim, centre in zip(rims, middle, strict=True)
            ]
            moved.append(_between(W, changes, V, f))
        of_number = np.maximum(*(np.abs(K_moved).max(1) for K_moved, _ in moved))
        F = F + SAFE / 2 * of_number + 2 * loss  # |z - 1| <= 2 on the circle

        # What factors change, of which states move along lines.
        to_u = W[:, :, n:] * f
        read = np.concatenate([middle[2] + 0j, middle[3] + 0j], -1) @ V
        of_factor = to_u @ read
        size = np.abs(to_u) @ (rounding * np.abs(read) + np.concatenate([dO, dT], -1) @ V_size)
        size = size + SAFE / 2 * np.maximum(*(np.abs(N_moved).max(1) for _, N_moved in moved))
        lines = np.diagonal(of_factor, axis1=-2, axis2=-1) * states
        beside = np.abs(of_factor - lines[:, None, :] * np.eye(N))
        beside = (beside + size) * np.hypot(u, r)[:, None, None]
        beside = beside + np.abs(lines * r[:, None])[:, None, :] * np.eye(N)

        room = _room(d, turn * lines[:, :n], u[:, None])
        at_middle = _room(d, 0 * d, u[:, None])
        shown = dominated(F + beside, np.concatenate([room, np.ones((len(d), m))], -1))
        of_middle = dominated(F, np.concatenate([at_middle, np.ones((len(d), m))], -1))
    outside = (2 * d.real + np.abs(d) ** 2 > 0).any(-1)
    return fine & shown, fine & of_middle, outside


def _with_factor(
    E: np.ndarray, G: np.ndarray, O: np.ndarray, T: np.ndarray, f: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """E of loops with factors f, and the map from their states to the inputs."""
    change = (f - 1)[:, None, None]
    to_inputs = solve(np.eye(T.shape[-1]) - change * T, change * O)
    return E + G @ to_inputs, to_inputs


def _pencil(
    E: np.ndarray, G: np.ndarray, O: np.ndarray, T: np.ndarray, f: np.ndarray
) -> np.ndarray:
    """K of the module's text."""
    of_states = np.concatenate([E + 0 * f, G + 0 * f], -1)
    of_inputs = np.concatenate([(f - 1) * O, (f - 1) * T - np.eye(T.shape[-1])], -1)
    return np.concatenate([of_states, of_inputs], -2)


def _pencil_sizes(
    dE: np.ndarray, dG: np.ndarray, dO: np.ndarray, dT: np.ndarray, change: np.ndarray
) -> np.ndarray:
    """Bounds on the errors of K by those of its parts."""
    of_states = np.concatenate([dE, dG], -1)
    of_inputs = change * np.concatenate([dO, dT], -1)
    return np.concatenate([of_states, of_inputs], -2)


def _between(
    W: np.ndarray, changes: list[np.ndarray], V: np.ndarray, f: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`W K V` and `W N V` of changes of E, G, O, T at points, `(n, points, ...)`."""
    dE, dG, dO, dT = changes
    n = dE.shape[-1]
    V = V[:, None]
    of_states = W[:, None, :, :n] @ (np.concatenate([dE, dG], -1) @ V)
    of_inputs = W[:, None, :, n:] @ (np.concatenate([dO, dT], -1) @ V)
    f = f[:, None]
    return of_states + (f - 1) * of_inputs, f * of_inputs


def _room(d: np.ndarray, slope: np.ndarray, u: np.ndarray) -> np.ndarray:
    """The least distance of `1 + d + slope t` from the circle, of all real t from -u to u.

    The square of the size less 1 is a parabola in t, least at its vertex and largest at an end.
    """
    flat = 2 * d.real + np.abs(d) ** 2
    rise = 2 * ((1 + d.conj()) * slope).real
    bend = np.abs(slope) ** 2
    largest = flat + np.abs(rise) * u + bend * u**2
    vertex = np.clip(np.where(bend > 0, -rise / (2 * bend), 0.0), -u, u)
    least = flat + rise * vertex + bend * vertex**2
    square = np.where(largest < 0, largest, np.maximum(least, 0.0))
    return np.abs(square) / (1 + np.sqrt(np.maximum(1 + square, 0.0)))


def _halves(pieces: np.ndarray) -> np.ndarray:
    """Both halves of each piece."""
    below = pieces.copy()
    above = pieces.copy()
    for halves, side in ((below, -1), (above, 1)):
        halves["half"] /= 2
        halves["place"] += side * halves["half"]
    return np.concatenate([below, above])
