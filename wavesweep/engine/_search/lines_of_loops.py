"""The lines of a mode within the frame: which of all frequencies of an eigenvalue a spectrum of the
states of loops shows.

An eigenvalue z of the frame gives the frequency of its mode up to whole turns per frame. In a frame
of M ticks the mode is `z^(i/M)` times a periodic signal, whose Fourier components are its lines (N.
M. Wereley, S. R. Hall, Conference on Decision and Control 1990).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wavesweep.engine._drawing.drawing import Drawing
from wavesweep.engine._loops.from_drawing import PRODUCT
from wavesweep.engine._monodromy.bounded import sum_rounding
from wavesweep.engine._monodromy.cut import LinearFractional
from wavesweep.engine._monodromy.drift import MarginalModes
from wavesweep.engine._monodromy.hessenberg import even_units, in_units, polynomials, reduced
from wavesweep.engine._monodromy.periodic import Ticks, frame_of
from wavesweep.engine._monodromy.product import blocks_of, product_with_errors
from wavesweep.engine._monodromy.rounding import balance
from wavesweep.engine._monodromy.unit_circle import inverse, solve
from wavesweep.engine._search.open_loops import Opened, OpenLoops
from wavesweep.engine._search.question import RequiredRegion
from wavesweep.engine._stability.boundary import times
from wavesweep.engine._stability.spectrum import eigenvalues
from wavesweep.engine.doubles import ENTRY_ROUNDING, FEW_ROUNDINGS, LEAST_NORMAL
from wavesweep.engine.loop import Loops

STATES_AT_ONCE = 2**18  # numbers of states that are followed at once
NO_PARTICIPATION = 1e-9  # of the largest participation in a mode, up to which a state takes no part
# of the energy of a mode, by which a line has to be behind the strongest one of one loop to be told
# from it
TIE = 0.2
SHARE_ROUNDING = 1e-9  # of the energy of a state, what its computation may be off by
AROUND_DISC = 4  # points of a circle about a disc
SECOND = 1 / 3  # of the energy of a mode, beyond which a second line is told
# rad: so near to 0 or pi the two lines of an eigenvalue and its conjugate are one
REAL_ANGLE = 1e-6


def lines_in_loops(loops: Loops, s: np.ndarray) -> np.ndarray:
    """`lines_of` a mode of each loop of a batch, that whose eigenvalue is nearest to one of
    exp(s), `(loops, choices)`."""
    (lines,) = lines_of_each(loops, [s])
    return lines


def _with_leads(
    E: np.ndarray, delta: np.ndarray, vector: np.ndarray, inner: np.ndarray, leads: Sequence[int]
) -> np.ndarray:
    """Return eigenvectors of frames E `(loops, n, n)` with eigenvalues delta, `(loops, n, 1)`, given what
    they are in the inner states; of a lead that drifts `x = (E x)/delta`, 0 if delta is."""
    state = np.zeros((*E.shape[:-1], 1), complex)
    state[:, inner, 0] = vector
    for lead in leads:
        moved = (E[:, lead] * state[..., 0]).sum(-1)
        state[:, lead, 0] = np.where(delta == 0, 0.0, moved / delta)
    return state


def lines_of_each(
    loops: Loops, modes: Sequence[np.ndarray], *, ranges: bool = False
) -> Iterator[np.ndarray]:
    """Yield `lines_in_loops` of several modes, each given by its s, from frames that are computed
    once.

    ranges: whether `range_of_lines` is wanted in place of `lines_of`.
    """
    told = range_of_lines if ranges else lines_of
    drawn = loops.drawn()
    drift = loops.drift()
    size = len(modes[0]) if modes else 0
    period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), (size,))
    if drawn.ticks == 1:
        yield from (told(np.ones((size, 1, 1)), s[:, 0], period) for s in modes)
        return
    with drawn.naming_blocks(), np.errstate(all="ignore"):
        ticks, _ = drift.relative_ticks(Ticks.of(drawn, alone=True, terms=True))
        n = len(ticks.states)
        leads = drift.leads
        inner = np.delete(np.arange(n), [*leads, *drift.unobserved])
        if not inner.size:  # nothing lasts from frame to frame
            yield from (told(np.ones((size, 1, 1)), s[:, 0], period) for s in modes)
            return
        E = np.broadcast_to(frame_of(ticks), (size, n, n))
        balanced, units = balance(
            np.where(np.isfinite(E).all((-1, -2))[:, None, None], E, 0.0)[:, inner[:, None], inner]
        )
        values, _ = eigenvalues(balanced)
        changes = [(np.eye(n) + tick.E, None) for tick in ticks.maps]
        for s in modes:
            nearest = np.argmin(np.abs(values[..., None] - np.expm1(s)[:, None]).min(-1), -1)
            delta = values[np.arange(size), nearest]
            left, right = (vectors.reshape(units.shape) for vectors in vectors_of(balanced, delta))
            participation = np.zeros((size, n))
            participation[:, inner] = np.abs(left * right)
            state = _with_leads(E, delta, right * units, inner, leads)
            taking = participation > NO_PARTICIPATION * participation.max(-1, keepdims=True)
            rows, shown = _shown_by(loops.drawing, ticks.states, drift, taking)
            moved = np.concatenate([*_in_ticks(ticks.kind.tolist(), changes, state, rows)], axis=-1)
            moved[~shown] = 0.0
            yield told(moved, np.log1p(delta).real + 1j * s[:, 0].imag, period)


def lines_in_discs(
    drawing: Drawing,
    drift: MarginalModes,
    ticks: Ticks,
    points: int,
    delta: np.ndarray,
    radius: np.ndarray,
    margin: float,
) -> np.ndarray:
    """What modes turn in a frame (rad): by the strongest line in the middle of a panel of a number,
    and by the lowest and the highest one that is it anywhere on the panel, `(n, r, 3)`.

    ticks: of `(n, points)` loops, those in the middle, and on the upper half of a circle of twice
    the size about the panel, if there are more. margin: on the largest value at such points, for
    those between. delta, radius: eigenvalues less 1 in the middle, and of discs about them, `(n,
    r)`.

    With left and right vectors as border, `B = [E - w, b; c, 0]` has an inverse also where two
    eigenvalues meet, and `B [x; 0] = [0; 1]`, `[y 0] B = [0 1]` for the vectors of every eigenvalue
    w in the disc, of every frame E of the panel. Where B has an inverse in the whole disc of twice
    the size, for all of the larger circle, x and y are analytic there, and so is what a mode shows
    of a state in the ticks of a frame, `z^(-i/M)` times it. So they differ on the panel by at most
    half of the largest difference on both circles (Schwarz's lemma); less, where the eigenvalue is
    in a part of its disc. The share of a line in the energy of a state differs by no more than
    that, as a part of the length of what is shown, since it is a projection of its direction.
    """
    frames = _FramesOnPanels.of(drift, ticks, len(delta), points)
    around = np.exp(2j * np.pi * np.arange(AROUND_DISC if points > 1 else 0) / AROUND_DISC)
    away = 2 * radius[..., None] * np.append(0.0, around)
    right, off, takes, differs, in_disc = _vectors_in_discs(frames, delta, away, margin)
    least = np.maximum(takes - differs, 0.0)
    upper = takes + differs
    bounded = np.isfinite(upper).all(1)
    taking = frames.taking_part(least, upper)
    rows, (sure, possible) = _shown_by(drawing, ticks.states, drift, taking)
    unclear = (sure & ~possible).any(-1, keepdims=True)  # whether a plant takes part
    possible = np.where(unclear, possible | taking[1], possible)
    sure = sure & ~unclear
    some = possible.any((0, 1))

    z = 1 + delta
    s = np.log(z)[..., None] + np.log1p(away / z[..., None])
    shown, differ = _shown_on_panels(
        frames, rows[some], frames.of_all_states(right, off), s, in_disc, margin
    )
    off_by = differ / np.linalg.norm(shown, axis=-1)
    off_by = np.where(off_by < 1, off_by, 1.0)
    off_by = np.where(bounded[..., None], off_by, np.inf)
    moved = -np.log1p(-np.abs(radius / z))
    share = _share_in_each(shown, np.zeros(delta.shape))
    s_middle = np.log1p(delta)
    bounds_of_turns = _turns_of(
        share, off_by, sure[..., some], possible[..., some], s_middle, moved
    )
    if points == 1:
        return bounds_of_turns

    # A pair that meets on the negative real axis may have any vectors of a plane there.
    theta = s_middle.imag
    meeting = (np.abs(theta) >= np.pi - moved - REAL_ANGLE) & (
        bounds_of_turns[..., 1] < bounds_of_turns[..., 2]
    )
    everything = np.ones((1, 1, len(ticks.states)), bool)
    rows, (shows,) = _shown_by(drawing, ticks.states, drift, everything)
    pairs, turns = _turns_of_meeting(
        frames, np.argwhere(meeting), rows[shows[0]], delta, away, s, margin
    )
    bounds_of_turns[*pairs.T] = turns
    return bounds_of_turns


class _FramesOnPanels(NamedTuple):
    """Frames of n panels of a number, in the middle of each and at points around it.

    kinds: of the ticks. maps: per kind the matrices, `(n, points, size, size)`; sizes: those of
    their terms in the middle. kept: states that others read, in which frames are without a drift.
    E, dE: frames of these less identity, in units of the states, `(n, points, k, k)`, and bounds on
    the errors in the middle. units: `(n, k)`. connected: which states act on which, `(k, k)`.
    """

    kinds: list[int]
    maps: list[np.ndarray]
    sizes: list[np.ndarray]
    kept: np.ndarray
    E: np.ndarray
    dE: np.ndarray
    units: np.ndarray
    connected: np.ndarray

    @classmethod
    def of(cls, drift: MarginalModes, ticks: Ticks, n: int, points: int) -> _FramesOnPanels:
        """ticks: of `(n, points)` loops, see `lines_in_discs`."""
        relative, _ = drift.relative_ticks(ticks)
        size = len(ticks.states)
        changes = [tick.E for tick in relative.maps]
        terms = [tick.terms[0] for tick in relative.maps]
        E, dE = product_with_errors(relative.kind, changes, terms, per_loop=True)
        E = _with_lower_half(E, n, points)
        dE = np.abs(_with_lower_half(dE, n, points)[:, 0])
        observed = np.delete(np.arange(size), drift.unobserved)
        inner = observed[:, None], observed
        connected = ((E != 0).any((0, 1)) | (dE != 0).any(0))[inner]
        units = balance(np.nan_to_num(E[:, 0].real)[:, *inner])[1]
        in_units = units[:, None, :] / units[:, :, None]
        maps = []
        sizes = []
        for change, size_of_terms in zip(changes, terms, strict=True):
            maps.append(_with_lower_half(np.eye(size) + change, n, points))
            sizes_of_all = np.broadcast_to(np.eye(size) + size_of_terms, (n * points, size, size))
            sizes.append(sizes_of_all[::points])
        return cls(
            relative.kind.tolist(),
            maps,
            sizes,
            observed,
            E[:, :, *inner] * in_units[:, None],
            dE[:, *inner] * in_units,
            units,
            connected,
        )

    def of_panels(self, panels: np.ndarray, points: int) -> _FramesOnPanels:
        """The frames of some panels, at the first points of each."""
        return self._replace(
            maps=[matrices[panels, :points] for matrices in self.maps],
            sizes=[matrices[panels] for matrices in self.sizes],
            E=self.E[panels, :points],
            dE=self.dE[panels],
            units=self.units[panels],
        )

    def taking_part(self, least: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """Which of all states take part in modes for sure, and which may, `(2, n, modes, size)`.

        least, upper: how much they do, `(n, k, modes)`. States of other diagonal blocks take no
        part: one of the two vectors is 0 there, if none is somewhere in its own block.
        """
        label = np.zeros(self.kept.size, int)
        for index, block in enumerate(blocks_of(self.connected)):
            label[block] = index
        other_blocks = label[:, None] != label[least.argmax(1)][:, None]
        upper = np.where(other_blocks & (least.max(1) > 0)[:, None], 0.0, upper)
        least = np.where(other_blocks, 0.0, least)
        n, _, modes = least.shape
        taking = np.zeros((2, n, modes, self.maps[0].shape[-1]), bool)
        sure = least > NO_PARTICIPATION * upper.max(1, keepdims=True)
        possible = upper > NO_PARTICIPATION * least.max(1, keepdims=True)
        taking[0][..., self.kept] = sure.mT
        taking[1][..., self.kept] = possible.mT
        return taking

    def of_all_states(self, vectors: np.ndarray, off: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Vectors of the states that are kept, `(n, points, k, circle, modes)`, and what rounding
        moves of them, `(n, k, modes)`, as those of all states in their own units."""
        size = self.maps[0].shape[-1]
        state = np.zeros((*vectors.shape[:2], size, *vectors.shape[3:]), complex)
        state[:, :, self.kept] = vectors * self.units[:, None, :, None, None]
        missed = np.zeros((len(off), size, off.shape[-1]))
        missed[:, self.kept] = off * self.units[..., None]
        return state, missed


def _turns_of_meeting(
    frames: _FramesOnPanels,
    pairs: np.ndarray,
    rows: np.ndarray,
    delta: np.ndarray,
    away: np.ndarray,
    s: np.ndarray,
    margin: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Of modes that meet their conjugates, panel and mode of those that are told, `(m, 2)`, and what
    they turn, `(m, 3)`, see `_turns_of_pair`.

    pairs: panels and modes. rows: what is shown of the states. The rest is as in `lines_in_discs`.
    """
    theta = np.log1p(delta).imag
    turns = np.empty((0, 3))
    for whole in (False, True):  # most are not told in the middle already
        points = frames.E.shape[1] if whole else 1
        circle = away.shape[-1] if whole else 1
        at_once = max(1, STATES_AT_ONCE // (2 * points * circle * frames.maps[0].shape[-1]))
        told: list[np.ndarray] = []
        for first in range(0, len(pairs), at_once):
            panel, mode = pairs[first : first + at_once].T
            part = frames.of_panels(panel, points)
            disc = delta[panel, mode], away[panel, mode, :circle], margin
            vectors = part.of_all_states(*_plane_in_disc(part.E, part.dE, *disc))
            s_of_both = np.repeat(s[panel, mode, None, :circle], 2, axis=1)
            columns, differ = _shown_on_panels(
                part, rows, vectors, s_of_both, np.ones((panel.size, 2)), margin
            )
            told += map(_turns_of_pair, columns, differ, theta[panel, mode])
        turns = np.array(told).reshape(-1, 3)
        resolved = ~np.isnan(turns).any(-1)
        pairs = pairs[resolved]
        turns = turns[resolved]
    return pairs, turns


def _with_lower_half(matrices: np.ndarray, n: int, points: int) -> np.ndarray:
    """Matrices of n panels: in the middle, on the upper half of a circle about it, and on the
    lower one."""
    order = matrices.shape[-1]
    matrices = np.broadcast_to(matrices, (n * points, order, order))
    matrices = matrices.reshape(n, points, order, order)
    return np.concatenate([matrices, matrices[:, 1:].conj()], axis=1)


def _least_ahead(ahead: np.ndarray, sure: np.ndarray, optional: np.ndarray) -> np.ndarray:
    """Return the least by which the best line may be ahead of each, `(n, modes, lines)`, of how far it is
    in each state, `(n, modes, states, lines)`: with those that surely count, and any of the optional
    ones; where none surely counts, with one of these."""
    least = np.where(optional, np.minimum(ahead, 0.0), 0.0).sum(2)
    least += np.where(sure, ahead, 0.0).sum(2)
    least_of_one = np.where(optional, ahead, np.inf).min(2, initial=np.inf)
    least_of_one = np.where(least_of_one < np.inf, least_of_one, -np.inf)
    return np.where(sure.any(2), least, least_of_one)


def _turns_of(
    share: np.ndarray,
    off_by: np.ndarray,
    sure: np.ndarray,
    possible: np.ndarray,
    s: np.ndarray,
    moved: np.ndarray,
) -> np.ndarray:
    """What modes turn by their strongest line, and by the lowest and the highest one that may be
    it, `(n, modes, 3)`.

    share: in the energy of each state, `(n, modes, states, lines)`. off_by: how far it may be off.
    sure, possible: which states count, and which may count. moved: how far log z may be off. Where
    z may be real, the lines of an eigenvalue and its conjugate may be one.
    """
    theta = s.imag[..., None]
    reach = moved[..., None] + REAL_ANGLE
    turns, conjugate_turns = _turns_and_conjugate(s, share.shape[-1])
    some = np.any(sure, -1)[..., None]
    counting = np.where(some, sure, possible)[..., None]
    optional = (possible & ~sure)[..., None]
    pairs = (
        (True, np.broadcast_to(np.arange(turns.size), conjugate_turns.shape)),
        (np.abs(theta) <= reach, np.broadcast_to(-turns % turns.size, conjugate_turns.shape)),
        (np.abs(theta) >= np.pi - reach, (-turns - np.where(theta < 0, -1, 1)) % turns.size),
    )
    near = False
    for may_be, conjugate in pairs:
        together = _with_conjugate(share, conjugate[..., None, :])
        best = np.argmax((counting * together).sum(2), -1)[..., None, None]
        ahead = np.take_along_axis(together, best, -1) - together - 2 * off_by[..., None]
        least = _least_ahead(ahead, sure[..., None], optional)
        near = near | may_be & ~(least > SHARE_ROUNDING * share.shape[2])
    strongest = _with_conjugate((counting * share).sum(2), conjugate_turns)
    w = np.abs(theta + 2 * np.pi * turns)
    first = np.take_along_axis(w, np.argmax(strongest, -1)[..., None], -1)
    lowest = np.minimum(first, np.where(near, w, np.inf).min(-1, keepdims=True))
    highest = np.maximum(first, np.where(near, w, 0.0).max(-1, keepdims=True))
    return np.concatenate([first, lowest, highest], -1)


def _turns_of_pair(columns: np.ndarray, differ: np.ndarray, theta: float) -> np.ndarray:
    """What a mode turns by its strongest line, by the lowest and by the highest one that may be it,
    if its vector is any one of a plane; NaN if that does not tell which.

    columns: what two vectors of the plane show in each tick, `(2, states, ticks)`, and how far
    these may be off, as lengths, `(2, states)`. A line and its conjugate have the energy `u' K u` of
    a vector u of the plane, of `u' H u` in all. One of them is the strongest line for every u if,
    for each state, `K/2 - K_j` is positive definite for all other lines j, beside H.
    """
    ticks = columns.shape[-1]
    lines = np.fft.fft(columns).transpose(1, 2, 0) / np.sqrt(ticks)
    K = lines.conj()[..., :, None] * lines[..., None, :]
    H = K.sum(1)
    least = np.linalg.eigvalsh(H)[:, 0]
    if not (np.isfinite(H).all() and (least > SHARE_ROUNDING * np.abs(H).max()).all()):
        return np.full(3, np.nan)
    off_by = np.sqrt((differ**2).sum(0) / least)
    W = np.linalg.inv(np.linalg.cholesky(H))[:, None]
    K = W @ K @ W.conj().mT
    turns = np.round(np.fft.fftfreq(ticks) * ticks).astype(int)
    conjugate = (-turns - (1 if theta > 0 else -1)) % ticks
    energy = np.trace(K, axis1=-2, axis2=-1).real.sum(0)
    best = int(np.argmax(energy + energy[conjugate]))
    of_mode = [best] if conjugate[best] == best else [best, int(conjugate[best])]
    competing = np.delete(np.arange(ticks), of_mode)
    ahead = K[:, of_mode].sum(1, keepdims=True) / 2 - K[:, competing]
    ahead = np.linalg.eigvalsh((ahead + ahead.conj().mT) / 2)[..., 0] - 2 * off_by[:, None]
    if not (ahead > SHARE_ROUNDING).all():
        return np.full(3, np.nan)
    w = np.abs(theta + 2 * np.pi * turns[of_mode])
    return np.array([w[0], w.min(), w.max()])


class _Bordered(NamedTuple):
    """Matrices `B = [E - w, b; c, 0]` of panels, `(n, points, circle, size, size)`: their
    approximate inverses, that in the middle, and by how much rounding and the panel with its disc
    move the entries of it, `(n, size, size)`."""

    inverses: np.ndarray
    middle: np.ndarray
    rounding: np.ndarray
    change: np.ndarray

    @classmethod
    def of(
        cls,
        E: np.ndarray,
        dE: np.ndarray,
        w: np.ndarray,
        away: np.ndarray,
        margin: float,
        beside: np.ndarray,
        below: np.ndarray,
    ) -> _Bordered:
        """E, dE, w, away: see `_vectors_in_disc`. beside, below: b and c, `(n, k, size - k)` and `(n,
        size - k, k)`."""
        n, points, k, _ = E.shape
        size = k + beside.shape[-1]
        B = np.zeros((n, points, away.shape[-1], size, size), complex)
        B[..., :k, :k] = E[:, :, None]
        B[..., :k, :k] -= (w[:, None] + away)[:, None, :, None, None] * np.eye(k)
        B[..., :k, k:] = beside[:, None, None]
        B[..., k:, :k] = below[:, None, None]
        middle = B[:, 0, 0]
        rounding = sum_rounding(size + 1, of_complex=True) * np.abs(middle)
        rounding[:, :k, :k] += dE
        change = np.array(rounding)
        change[:, :k, :k] += margin * np.abs(E - E[:, :1]).max(1)
        change[:, :k, :k] += np.abs(away).max(-1)[:, None, None] * np.eye(k)
        return cls(inverse(B), middle, rounding, change)

    def columns_off(self, first: int) -> list[np.ndarray]:
        """How far the columns of the inverse in the middle are off, from the first one on, each `(n,
        size)`; NaN where an inverse is not proved for the whole panel and disc."""
        C = self.inverses[:, 0, 0]
        missing = np.abs(np.eye(C.shape[-1]) - C @ self.middle) + np.abs(C) @ self.change
        columns = range(first, C.shape[-1])
        residuals = [
            _residual(self.middle, C[:, :, column], column, self.rounding) for column in columns
        ]
        return [_enclosed(missing, np.abs(C) @ residual) for residual in residuals]

    def last_row_off(self) -> np.ndarray:
        """The same of the last row."""
        C = self.inverses[:, 0, 0]
        missing = np.abs(np.eye(C.shape[-1]) - self.middle @ C) + self.change @ np.abs(C)
        residual = _residual(self.middle.mT, C[:, -1], -1, self.rounding.mT)
        return _enclosed(missing.mT, np.abs(C).mT @ residual)


def _plane_in_disc(
    E: np.ndarray, dE: np.ndarray, w: np.ndarray, away: np.ndarray, margin: float
) -> tuple[np.ndarray, np.ndarray]:
    """Two vectors of which every eigenvector of a panel is a sum, `(n, points, k, circle, 2)`, and by
    how much rounding moves them in the middle, `(n, k, 2)`, NaN where there are none.

    With two left and two right singular vectors of the least values as border, `B = [E - w, b; c,
    0]` has an inverse also where two eigenvalues meet that have two vectors. An eigenvector x for w
    is `X c x` with `B [X; G] = [0; I]`. The rest is as in `lines_in_discs`. E, dE, w, away: see
    `_vectors_in_disc`.
    """
    k = E.shape[-1]
    # Modes meet their conjugates at a real w. Any border with which B has an inverse will do.
    middle = np.where(np.isfinite(E[:, 0]), E[:, 0], 0.0).real - w.real[:, None, None] * np.eye(k)
    left, _, right = np.linalg.svd(middle)
    bordered = _Bordered.of(E, dE, w, away, margin, left[..., -2:], right[:, -2:])
    off = np.stack(bordered.columns_off(k), -1)
    return bordered.inverses[..., :k, k:].swapaxes(2, 3), off[:, :k]


def _vectors_in_discs(
    frames: _FramesOnPanels, delta: np.ndarray, away: np.ndarray, margin: float
) -> list[np.ndarray]:
    """What `_vectors_in_disc` gives of each mode, on a last axis."""
    of_modes = []
    for mode in range(delta.shape[1]):
        disc = delta[:, mode], away[:, mode], margin
        of_modes.append(_vectors_in_disc(frames.E, frames.dE, *disc))
    return [np.stack(by_mode, -1) for by_mode in zip(*of_modes, strict=True)]


def _vectors_in_disc(
    E: np.ndarray, dE: np.ndarray, w: np.ndarray, away: np.ndarray, margin: float
) -> tuple[np.ndarray, ...]:
    """Of modes on panels, `(n, ...)`: right eigenvectors next to w + away for each frame less
    identity, `(n, points, k, circle)`, of product 1 with that of w in the middle; by how much
    rounding moves that one, `(n, k)`; how much states take part in the middle, and how much that
    differs on the panel, NaN if it is not known; and in which part of its disc the eigenvalue is.

    E, dE: in the middle and around it, `(n, points, k, k)`, and bounds on the errors in the middle.
    See `lines_in_discs`.
    """
    n, _, k, _ = E.shape
    left, right = (vectors.reshape(n, k) for vectors in vectors_of(E[:, 0], w))
    left = left / np.linalg.norm(left, axis=-1, keepdims=True)
    right = right / np.linalg.norm(right, axis=-1, keepdims=True)
    border = left.conj()[:, :, None], right.conj()[:, None]
    bordered = _Bordered.of(E, dE, w, away, margin, *border)
    C = bordered.inverses
    x = C[..., :k, k].swapaxes(-1, -2)
    y = C[..., k, :k].swapaxes(-1, -2)
    (off_x,) = bordered.columns_off(k)
    off_y = bordered.last_row_off()
    product = x * y
    takes = np.abs(product[:, 0, :, 0])

    # The eigenvalue is where `g(w) = 0` in `B [x; g] = [0; 1]`, and g' is the product of both
    # vectors.
    slope = product.sum(2)
    steady = np.abs(slope[:, 0, 0]) - margin / 2 * np.abs(slope - slope[:, :1, :1]).max((1, 2))
    left_over = margin * np.abs(C[:, :, 0, k, k]).max(1) + off_x[:, k]
    in_disc = 2 * left_over / (steady * np.abs(away).max(-1))
    in_disc = np.where((steady > 0) & (in_disc < 1), in_disc, 1.0)
    differs = np.abs(product[..., 0] - product[:, :1, :, 0]).max(1)
    differs += in_disc[:, None] * np.abs(product - product[..., :1]).max((1, 3))
    differs = margin / 2 * differs
    of_x = off_x[:, :k] * (np.abs(y[:, 0, :, 0]) + off_y[:, :k])
    of_y = off_y[:, :k] * np.abs(x[:, 0, :, 0])
    return x, off_x[:, :k], takes, differs + of_x + of_y, in_disc


def _residual(B: np.ndarray, x: np.ndarray, row: int, rounding: np.ndarray) -> np.ndarray:
    """What is left of `B x = e`, e the unit vector of a row, at most."""
    right_side = np.eye(B.shape[-1])[row]
    residual = np.abs(right_side - (B @ x[..., None])[..., 0])
    return (residual + (rounding @ np.abs(x)[..., None])[..., 0])[..., None]


def _enclosed(M: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """v with `residual + M v < v`, `(n, k)`; NaN where there is none.

    So a matrix with an approximate inverse C has one, if M bounds 1 less their product, and v how
    far a solution with C times what is left is off (S. M. Rump, Verification methods, Acta Numerica
    19, 2010).
    """
    residual = residual * (1 + SHARE_ROUNDING) + LEAST_NORMAL
    v = solve(np.eye(M.shape[-1]) - np.nan_to_num(M), np.nan_to_num(residual))
    v = v * (1 + SHARE_ROUNDING)
    proved = (v > 0) & (residual + M @ v < v)
    return np.where(proved.all(1, keepdims=True), v, np.nan)[..., 0]


def _shown_on_panels(
    frames: _FramesOnPanels,
    rows: np.ndarray,
    vectors: tuple[np.ndarray, np.ndarray],
    s: np.ndarray,
    in_disc: np.ndarray,
    margin: float,
) -> tuple[np.ndarray, np.ndarray]:
    """What states show in each tick in the middle of panels, `(n, modes, states, ticks)`, without
    the growth of the mode, and how far that may be off on the panels, as lengths of vectors over
    the ticks, `(n, modes, states)`.

    vectors: at the begin of the frame, `(n, points, size, circle, modes)`, and what rounding moves
    there, `(n, size, modes)`. s: logarithms of the eigenvalues, `(n, modes, circle)`; in_disc: in
    which part of its disc each is, `(n, modes)`.
    """
    state, missed = vectors
    n, points, size, circle, modes = state.shape
    decay = np.exp(-s.swapaxes(1, 2) / len(frames.kinds))[:, None, None]
    weight = np.ones_like(decay)
    state = state.reshape(n, points, size, circle * modes)
    since = np.broadcast_to(np.eye(size), (n, size, size))  # the product of the ticks
    rounded = np.zeros((n, size, modes))
    shown = []
    of_panel = np.zeros((n, points, len(rows), modes))
    of_disc = np.zeros((n, points, len(rows), circle, modes))
    off = np.zeros((n, len(rows), modes))
    for kind in frames.kinds:
        in_middle_of_tick = frames.maps[kind][:, 0]
        seen = (rows @ state).reshape(n, points, len(rows), circle, modes) * weight
        in_middle = seen[:, 0, :, 0]
        shown.append(in_middle)
        of_panel += np.abs(seen[:, :, :, 0] - in_middle[:, None]) ** 2
        of_disc += np.abs(seen - seen[:, :, :, :1]) ** 2
        at_once = np.abs(rows @ since) @ missed + np.abs(rows) @ rounded
        off += (at_once * np.abs(weight[:, 0, :, 0])) ** 2
        here = np.abs(state[:, 0].reshape(n, size, circle, modes)[:, :, 0])
        rounded = np.abs(in_middle_of_tick) @ rounded
        rounded += (ENTRY_ROUNDING + sum_rounding(size, of_complex=True)) * (
            frames.sizes[kind] @ here
        )
        since = in_middle_of_tick @ since
        state = frames.maps[kind] @ state
        weight = weight * decay
    differ = np.sqrt(of_panel.max(1)) + in_disc[:, None] * np.sqrt(of_disc.max((1, 3)))
    differ = margin / 2 * differ + np.sqrt(off)
    return np.stack(shown, -1).swapaxes(1, 2), differ.swapaxes(1, 2)


def _shown_by(
    drawing: Drawing, states: tuple[str, ...], drift: MarginalModes, taking: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rows C with which a spectrum shows the states x of a frame, and which of them it shows of
    modes.

    Ticks move states that are relative to the leads of a drift: `x_i = xi_i + f_i xi_l` of the lead
    l that moves state i by a factor f_i (see `MarginalModes`). So `x = C xi`, `(n, n)`, has a one on
    its diagonal, and f_i in the column of the lead.

    A spectrum shows the states of plants, also a position of theirs that nothing else reads; what
    programs remember is held over ticks, and shown only without a plant. taking: the states xi that
    take part in each mode, a mask `(..., n)`, as the second result is. A lead takes part if a state
    of its own block does.
    """
    rows = np.eye(len(states))
    blocks = np.array([name.rpartition(".")[0] for name in states])
    taking = taking.copy()
    for lead, followers in drift.constant:
        for follower, factor in followers:
            rows[follower, lead] = factor
        of_block = blocks == blocks[lead]
        taking[..., lead] = (taking & of_block).any(-1)

    members = [plant.start(block.name) for plant in drawing.plants for block in plant.members]
    alone = [f"{block.name}." for block in drawing.alone if block.plant]
    starts = (*members, *alone)
    of_plants = taking & [name.startswith(starts) for name in states]
    has_plant = of_plants.any(-1, keepdims=True)
    return rows, np.where(has_plant, of_plants, taking)


def _in_ticks(
    kinds: list[int],
    changes: Sequence[tuple[np.ndarray, np.ndarray | None]],
    state: np.ndarray,
    rows: np.ndarray,
) -> Iterator[np.ndarray]:
    """Yield `rows` times the states, complex `(..., n, columns)`, in each tick of a frame.

    kinds: of each tick. changes: per kind, the matrix, and what is added to each column, or None.
    """
    column = rows.argmax(-1)
    picked = (
        rows == np.eye(rows.shape[-1])[column]
    ).all()  # which takes a tenth of a product's time
    for kind in kinds:
        yield state[..., column, :] if picked else times(rows, state)
        matrix, added = changes[kind]
        state = times(matrix, state)
        if added is not None:
            state += added


def strongest_in_cut(
    drawing: Drawing,
    opened: Opened,
    place: np.ndarray,
    omega: np.ndarray,
    bound: RequiredRegion | None,
) -> np.ndarray:
    """The strongest line (Hz) of the modes of frequency omega, `(n,)`, of the slices at `place` of
    loops cut at a number.

    bound: see `Question`.
    """
    loops = opened.loops
    label = opened.loop_of[place]
    hz = np.abs(omega) / (2 * np.pi)
    if loops.frame.ticks.kind.size == 1:
        return hz
    cut = loops.batch(int(opened.loop_of.max()) + 1)
    n = len(loops.frame.ticks.states)
    period = np.broadcast_to(np.asarray(cut.period), cut.batch)[label]
    s = (np.log(bound.radius_of(period)) if bound else 0.0) + 1j * omega * period
    modes = ModesOfCut.of(drawing, loops, cut)
    order = np.argsort(label, kind="stable")
    # there nothing moves but the integrator
    order = order[s[order] != 0] if cut.integrates else order
    few = max(1, STATES_AT_ONCE // (n * np.bincount(label[order]).max(initial=1)))
    with np.errstate(all="ignore"):
        rest = order[~(_share_of_first(modes, label, order, s, few) > 1 / 2)]
        for batch in (rest[begin : begin + few] for begin in range(0, rest.size, few)):
            moved = np.concatenate(
                [*modes.in_ticks(label[batch], np.expm1(s[batch, None]))], axis=-1
            )
            hz[batch] = lines_of(moved, s[batch], period[batch])[:, 0]
    return hz


def _share_of_first(
    modes: ModesOfCut, label: np.ndarray, order: np.ndarray, s: np.ndarray, few: int
) -> np.ndarray:
    """The share of the first line in what is shown of each mode, in this order, which is that of
    their loops `label`; s: of all modes. `few` loops are computed at a time.

    The modes of a loop stand in a row of a rectangle, whose rest is filled up with its first one.
    """
    first, begins, counts = np.unique(label[order], return_index=True, return_counts=True)
    row = np.repeat(np.arange(first.size), counts)
    column = np.arange(order.size) - np.repeat(begins, counts)
    index = np.repeat(order[begins][:, None], counts.max(initial=1), axis=1)
    index[row, column] = order
    share = np.empty(index.shape)
    for batch in (slice(begin, begin + few) for begin in range(0, first.size, few)):
        shown = modes.in_ticks(first[batch], np.expm1(s[index[batch]]))
        share[batch] = share_of_first(shown, modes.loops.frame.ticks.kind.size, s[index[batch]])
    return share[row, column]


@dataclass(frozen=True, slots=True, eq=False)
class ModesOfCut:
    """Modes of loops that are cut at a number: what a product of 1 moves, `(z - A)^-1 B`, whatever
    the number.

    rows: what a spectrum shows, over the states. inner: where the states of the cut are among them.
    force: the input that the product is.
    """

    loops: OpenLoops
    cut: LinearFractional
    rows: np.ndarray
    inner: np.ndarray
    force: int

    @staticmethod
    def of(drawing: Drawing, loops: OpenLoops, cut: LinearFractional) -> ModesOfCut:
        """The modes of a batch of loops."""
        states = loops.frame.ticks.states
        inner = np.array([states.index(name) for name in cut.states])
        all_states = np.arange(len(states))
        rows, shown = cut.remembered(
            "shown", lambda: _shown_by(drawing, states, loops.drift, np.isin(all_states, inner))
        )
        return ModesOfCut(loops, cut, rows[shown], inner, loops.drawn.inputs.index(PRODUCT))

    def in_ticks(self, index: np.ndarray, w: np.ndarray) -> Iterable[np.ndarray]:
        """What is shown in each tick, of the loops `index`, `(k,)`, and their modes of
        eigenvalue 1 + w, `(k, columns)`."""
        cut = self.cut
        frame = self.loops.frame
        ticks = self.loops.frame.ticks
        kinds = ticks.kind.tolist()
        n = len(ticks.states)
        single = (
            cut.batch[0] == index.size == 1
            and len(kinds) * len(self.rows) * max(n, w.shape[-1]) <= STATES_AT_ONCE
        )
        pole, mode = polynomials(
            cut.remembered("form", lambda: self._form(index)) if single else self._form(index), w
        )
        state = np.zeros((index.size, n, w.shape[-1]), complex)
        state[:, self.inner] = mode / pole[:, None]
        for lead in self.loops.drift.leads:
            moved = (_of_loops(frame.E, index)[..., lead, :, None] * state).sum(-2) + _of_loops(
                frame.B, index
            )[..., lead, :1]
            state[:, lead] = np.where(w == 0, 0.0, moved / w)
        if single:
            all_ticks = cut.remembered("ticks", self._in_one_product)
            moved = times(
                all_ticks.reshape(-1, n + 1), np.append(state[0], np.ones((1, w.shape[-1])), axis=0)
            )
            return moved.reshape(len(kinds), 1, len(self.rows), -1)
        changes = []
        for tick in ticks.maps:
            force = (
                _of_loops(tick.B, index)[..., self.force, None]
                if np.any(tick.B[..., self.force])
                else None
            )
            changes.append((np.eye(n) + _of_loops(tick.E, index), force))
        return _in_ticks(kinds, changes, state, self.rows)

    def _form(self, index: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        E = self.cut.E[index]
        B = self.cut.B[index]
        return reduced(
            in_units(even_units(E), E, B, np.broadcast_to(np.eye(self.inner.size), E.shape))
        )

    def _in_one_product(self) -> np.ndarray:
        """What is shown in all ticks, as rows over the states and the product of a single loop,
        `(ticks, rows, n + 1)`."""
        ticks = self.loops.frame.ticks
        rows = self.rows
        n = len(ticks.states)
        matrices = np.tile(np.eye(n + 1), (len(ticks.maps), 1, 1))
        for matrix, tick in zip(matrices, ticks.maps, strict=True):
            matrix[:n] += np.append(
                tick.E.reshape(n, n), tick.B[..., self.force].reshape(n, 1), axis=-1
            )
        changes = [(matrix, None) for matrix in matrices]
        return np.stack(
            [
                *_in_ticks(
                    ticks.kind.tolist(),
                    changes,
                    np.eye(n + 1),
                    np.append(rows, 0 * rows[:, :1], axis=-1),
                )
            ]
        )


def _of_loops(arrays: np.ndarray, index: np.ndarray) -> np.ndarray:
    """The arrays of some loops of a batch; one array is that of all loops."""
    return arrays[index] if arrays.ndim > 2 and len(arrays) > 1 else arrays


def vectors_of(E: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the left and the right eigenvector next to w of each matrix, `(..., 1, n)` and `(...,
    n, 1)`, of product 1.

    They follow from this eigenvalue alone: the states of a delay make others that have too few
    vectors.
    """
    # Not quite at w: at an eigenvalue there is no inverse, and next to two of them the inverse is
    # not known.
    # A part of its size, and roundings of the entries.
    step = 1e-10 * np.abs(w) + FEW_ROUNDINGS * np.abs(E).max((-1, -2))
    back = np.full(E.shape, np.nan + 0j)
    for farther in (1.0, 1e2, 1e4):  # times that, tried in turn
        rest = np.flatnonzero(~np.isfinite(back).all((-1, -2)))
        if rest.size:
            back[rest] = inverse(
                E[rest] - (w + farther * step)[rest, None, None] * np.eye(E.shape[-1])
            )
    start = np.cos(np.arange(1, E.shape[-1] + 1))
    right = back @ start[:, None]
    left = start @ back
    right, left = (
        v / np.abs(v).max((-1, -2) if v.ndim > 2 else -1, keepdims=True) for v in (right, left)
    )
    right = back @ right
    left = left[:, None] @ back
    right, left = (v / np.abs(v).max((-1, -2), keepdims=True) for v in (right, left))
    return left / (left @ right), right


def lines_of(moved: np.ndarray, s: np.ndarray, period: np.ndarray) -> np.ndarray:
    """Return the strongest line of modes (Hz), and the second one or NaN, `(..., 2)`, from states
    in each tick.

    moved: `(..., states, ticks)`. s: logarithm of the eigenvalue, and period of the frame (s),
    `(...)`. The share of a line is its mean share in the energy of each state, whatever their units
    are. If all of them rest, the line is that of s itself.
    """
    share, turns, conjugate = _shares_of_lines(moved, s)
    index = np.arange(turns.size)
    first = np.argmax(share, -1)[..., None]
    rest = np.where(
        (index == first) | (index == np.take_along_axis(conjugate, first, -1)), 0.0, share
    )
    both = np.concatenate([first, np.argmax(rest, -1)[..., None]], -1)
    hz = np.abs(s.imag[..., None] / (2 * np.pi) + turns[both]) / np.asarray(period)[..., None]
    hz[..., 1] = np.where(rest.max(-1) > SECOND, hz[..., 1], np.nan)
    return hz


def range_of_lines(moved: np.ndarray, s: np.ndarray, period: np.ndarray) -> np.ndarray:
    """Return the strongest line of modes (Hz), and the lowest and the highest one that may be it,
    `(..., 3)`; see `lines_of`.

    A line may be the strongest if its share is within TIE of the largest one: so far apart that
    neither rounding nor values next to these move the others past it. Any may be of a mode whose
    states are not known.
    """
    share, turns, _ = _shares_of_lines(moved, s)
    hz = np.abs(s.imag[..., None] / (2 * np.pi) + turns) / np.asarray(period)[..., None]
    unknown = ~np.isfinite(moved).all((-1, -2))[..., None]
    strongest = np.argmax(share, -1)[..., None]
    largest = np.take_along_axis(share, strongest, -1)
    tied = (share >= largest - TIE) & (share > 0) | unknown
    strongest_hz = np.take_along_axis(hz, strongest, -1)
    lowest = np.minimum(strongest_hz, np.where(tied, hz, np.inf).min(-1, keepdims=True))
    highest = np.maximum(strongest_hz, np.where(tied, hz, 0.0).max(-1, keepdims=True))
    return np.concatenate([strongest_hz, lowest, highest], -1)


def _shares_of_lines(moved: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The share of each line in modes, its turns per frame, and which line is that of the
    conjugate; see `lines_of`."""
    turns, conjugate = _turns_and_conjugate(s, moved.shape[-1])
    with np.errstate(all="ignore"):
        share = _share_in_each(moved, s).sum(-2)
        share = np.nan_to_num(share / share.sum(-1, keepdims=True))
    return _with_conjugate(share, conjugate), turns, conjugate


def _share_in_each(moved: np.ndarray, s: np.ndarray) -> np.ndarray:
    """The share of each line in the energy of each state, `(..., states, ticks)`; 0 of states that
    rest."""
    ticks = moved.shape[-1]
    with np.errstate(all="ignore"):
        still = moved * np.exp(-s[..., None] * np.arange(ticks) / ticks)[..., None, :]
        energy = np.abs(np.fft.fft(still)) ** 2
        return np.nan_to_num(energy / energy.sum(-1, keepdims=True))


def _turns_and_conjugate(s: np.ndarray, ticks: int) -> tuple[np.ndarray, np.ndarray]:
    """The turns per frame of each line, and which line is that of the conjugate: another one if
    the eigenvalue is real."""
    theta = s.imag[..., None]
    index = np.arange(ticks)
    turns = np.round(np.fft.fftfreq(ticks) * ticks).astype(int)
    half = np.where(np.abs(theta) >= np.pi - REAL_ANGLE, np.sign(theta), 0).astype(int)
    is_real = (np.abs(theta) <= REAL_ANGLE) | (half != 0)
    return turns, np.where(is_real, (-turns - half) % ticks, index)


def _with_conjugate(share: np.ndarray, conjugate: np.ndarray) -> np.ndarray:
    """The share of each line and that of its conjugate, if it is another one."""
    of_conjugate = np.take_along_axis(share, conjugate, -1)
    return share + np.where(conjugate == np.arange(share.shape[-1]), 0.0, of_conjugate)


def share_of_first(observed: Iterable[np.ndarray], ticks: int, s: np.ndarray) -> np.ndarray:
    """Return the share of the line of s itself, as `lines_of` has it, `(..., columns)`;
    observed: the states, tick by tick, `(..., states, columns)`, or an array of all of them."""
    near = 0.0
    total = 0.0
    turn = np.ones_like(s)[..., None, :]
    step = np.exp(-s / ticks)[..., None, :]
    if isinstance(observed, np.ndarray):
        moved = observed * np.multiply.accumulate(np.stack([turn, *[step] * (ticks - 1)]))
        near = moved.sum(0)
        total = (moved.real**2 + moved.imag**2).sum(0)
    else:
        for states in observed:
            moved = states * turn
            near = near + moved
            total = total + (moved.real**2 + moved.imag**2)
            turn = turn * step
    is_half = np.abs(s.imag) >= np.pi - REAL_ANGLE
    with np.errstate(invalid="ignore"):  # of states that stand still, or of none that move
        share = (near.real**2 + near.imag**2) / (ticks * total)
        moves = ~np.isnan(share)
        mean = np.where(moves, share, 0.0).sum(-2) / moves.sum(-2)
    return mean * np.where(is_half, 2, 1)
