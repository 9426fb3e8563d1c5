"""Margins of a loop broken at a signal that is made several times in a frame: those of the lifted loop.

With the signal multiplied by the same number k in all of its m samples of a frame, the frame's eigenvalues z solve
`det(1 - k H(z)) = 0`, H being the m x m transfer function from the samples back to themselves without the number: -H is the
return ratio of the lifted signal. A real k gives gain margins, `k = exp(j phi)` the phase margin, `k = (1 + d)/(1 - d)` with
|d| < a/2 the disk margin a. With `S = 1/(1 - H)` the last one is `det(1 - 2 d (S - 1/2)) = 0`, so that 1/a is the largest
spectral radius of `S - 1/2` on the unit circle: the structured singular value of a repeated complex scalar (A. Packard,
J. Doyle, Automatica 29, 1993). For one sample in a frame all this is what `loop_margins` computes of a scalar.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wavesweep.engine.energy.hinf import SOFT, START
from wavesweep.engine.energy.lifted_map import LiftedMap, TickMaps, reached, read
from wavesweep.engine.energy.norms import TOLERANCE, squared_norm
from wavesweep.engine.monodromy.drift import MarginalModes
from wavesweep.engine.monodromy.open_ticks import OpenTicks
from wavesweep.engine.monodromy.unit_circle import on_circle, solve
from wavesweep.engine.stability.along_any import stable_along_any
from wavesweep.engine.stability.certificate import FAST, NONE, SEARCH
from wavesweep.engine.stability.sampled_frames import Frames
from wavesweep.margins.loop_margins import (
    BESIDE,
    SPANS,
    BrokenLoop,
    Margin,
    disk_margins,
    limited_or_not,
    peak_margin,
    scalar_margins,
)

EXACT = 2e-9  # relative error of an end of `stable_along_any`
GAP = 1e-8  # relative, between a disk that is proved and one that is met at some frequency
GRID = 10_000  # samples of a frame at all angles at which the spectral radius is looked at before its peaks are refined
STILL = 1e-8  # of the sizes of its terms, below which what is seen of a drift is rounding
MET = 1e-6  # of a mode, from the place on the circle where it should be
ROUNDS = 4  # of the search for a disk: each proof that fails shows the angle of a larger peak


@dataclass(frozen=True, eq=False)
class LiftedLoop:
    """A single loop without a number that multiplies all samples of a signal in a frame.

    ticks: those of the loop without the number. drift: of the loop with it. period: of the frame, s. places: when the signal is
    made, as shares of a frame.
    """

    ticks: OpenTicks
    drift: MarginalModes
    period: float
    places: np.ndarray

    @cached_property
    def returned(self) -> LiftedMap:
        """H, from the samples of a frame back to themselves."""
        maps = self.ticks.ticks.maps
        return TickMaps.of(
            [(tick_map.E, tick_map.B, tick_map.C, tick_map.D) for tick_map in maps], self.ticks.ticks.kind, ()
        ).lifted(measured=False)

    @property
    def times(self) -> int:
        """How often the signal is made in a frame."""
        return self.returned.T.shape[-1]

    @property
    def returns(self) -> bool:
        """Whether the signal comes back to itself."""
        maps = [(tick_map.E, tick_map.B, tick_map.C, tick_map.D) for tick_map in self.ticks.ticks.maps]
        return bool((read(maps) & reached(maps)).any() or self.returned.T.any())

    def response(self, theta) -> np.ndarray:
        """Return the eigenvalues of L = -H at the angles theta (rad per frame), `(..., samples)`; of one sample L, `(...)`.

        They are 1/s - 1 for the eigenvalues s of S: next to a large eigenvalue of H, as integrators give it at low frequencies,
        rounding would leave nothing of the small ones.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            returns = 1 / np.linalg.eigvals(self._sensitivity_at(theta)) - 1
        return returns if self.times > 1 else returns[..., 0]

    def at_line(self, theta) -> np.ndarray:
        """Return what comes back of a sine at the signal, of its own frequency, with its sign changed: L of the signal's rate.

        theta: rad per frame, up to pi times the samples. A sine also comes back with its images. With samples at equal steps
        these are off the diagonal of the harmonic transfer matrix, which has the eigenvalues of L (N. Wereley, thesis, MIT
        1991); without anything slower than the signal there are none, and L is that of a loop of one rate.
        """
        E, T, O, G = (array[0] for array in (self.returned.E, self.returned.T, self.returned.O, self.returned.G))
        angles = np.asarray(theta, float)[..., None, None]
        sine = np.exp(1j * angles * self.places[:, None])
        A = on_circle(angles) * np.eye(len(E)) - E
        return -(sine.conj() * (O @ solve(A, G @ sine) + T @ sine)).mean((-2, -1))

    def _sensitivity_at(self, theta):
        E, B, C, D = (array[0] for array in self.sensitivity.maps[0])
        A = on_circle(np.asarray(theta, float))[..., None, None] * np.eye(len(E)) - E
        return D + C @ solve(A, B + 0 * A[..., :1])

    @cached_property
    def sensitivity(self) -> TickMaps:
        """The map `S = 1/(1 - H)`, in states of even units.

        The eigenvalue 1 of a drift v with the left vector w, `w v = 1`, is moved to 0, by `E - v w`, if S does not have it:
        `C v w B` is 0. Otherwise S has no bound at 0 rad/s. A drift by constant factors has `C v = 0`, and any w will do.
        """
        E, T, O, G = (array[0] for array in (self.returned.E, self.returned.T, self.returned.O, self.returned.G))
        left = np.linalg.inv(np.eye(len(T)) - T)
        E, B, C = E + G @ left @ O, G @ left, left @ O
        for lead, trailing in [*self.drift.constant, *((state, ()) for state in self.drift.unobserved)]:
            E[:, lead] -= np.eye(len(E))[lead]
            for state, factor in trailing:
                E[state, lead] -= factor
        matrices = TickMaps.of([(E, B, C, left)], np.zeros(1, int), ()).in_even_units().maps[0]
        if count := len(self.drift.varying):
            E, B, C, _ = (matrix[0] for matrix in matrices)
            U, _, V = np.linalg.svd(E)
            v, w = V[-count:].T, U[:, -count:].T
            v = v @ np.linalg.inv(w @ v)
            if (np.abs(C @ v @ w @ B) <= STILL * (np.abs(C) @ np.abs(v) @ np.abs(w) @ np.abs(B))).all():
                matrices = ((E - v @ w)[None], *matrices[1:])
        return TickMaps((matrices,), np.zeros(1, int))

    def radius(self, theta) -> np.ndarray:
        """Return the spectral radius of `S - 1/2` at the angles theta.

        Next to a drift that moves the signal rounding of S hides its small eigenvalues: 0 if no mode of the frame is there with
        the factor that the largest one gives.
        """
        theta = np.asarray(theta, float)
        peaks = np.linalg.eigvals(self._sensitivity_at(theta)) - 0.5
        size = np.abs(peaks).max(-1)
        if self.drift.varying:
            largest = np.take_along_axis(peaks, np.abs(peaks).argmax(-1)[..., None], -1)[..., 0].ravel()
            with np.errstate(all="ignore"):
                modes = np.linalg.eigvals(np.nan_to_num(self.frames((2 * largest + 1) / (2 * largest - 1)).E))
            size = np.where(np.abs(modes - on_circle(theta).reshape(-1, 1)).min(-1).reshape(theta.shape) <= MET, size, 0.0)
        return size

    def frames(self, k) -> Frames:
        """Return the frames of the loop with the number k, `(n,)`, real or complex."""
        E, pivot, condition = self.ticks.frames(np.zeros(k.size, int), k)
        pivot, condition = (np.broadcast_to(array, k.shape) for array in (pivot, condition))
        return Frames(self.drift.removed_from(E), pivot[:, None], condition)

    def errors(self, k) -> tuple[np.ndarray, np.ndarray]:
        """Return the same frames, and bounds on the errors of their entries."""
        return self.drift.frames_with_errors(self.ticks.closed(np.zeros(k.size, int), k, terms=True))

    def along_gain(self, span):
        """Return the stable intervals along real k."""
        return stable_along_any(
            lambda _, p: self.frames(p.ravel()), span, 1, np.array([self.period]), errors=lambda _, p: self.errors(p.ravel())
        )

    def along_turn(self, factor):
        """Return the stable intervals along an angle from 0 to pi; factor: k, and its analytic continuation, for an angle.

        The real matrix [[Re, -Im], [Im, Re]] of a complex frame has its eigenvalues and their conjugates, which are those at
        the opposite angle.
        """

        def frames(_, p):
            p = p.ravel()
            up, down = (self.frames(factor(parameter) + 0j) for parameter in (p, -p))
            E, pivots = _real_form(up.E, down.E), up.pivots * down.pivots
            E, pivots = (E, pivots) if np.iscomplexobj(p) else (E.real, pivots.real)
            return Frames(E, pivots, up.condition + down.condition)

        def errors(_, p):
            p = p.ravel()
            (up, of_up), (down, of_down) = (self.errors(factor(parameter) + 0j) for parameter in (p, -p))
            error = np.maximum(of_up.real, of_down.real)
            return _real_form(up, down).real, np.concatenate([np.concatenate([error] * 2, -1)] * 2, -2)

        return stable_along_any(frames, (0.0, np.pi), 1, np.array([self.period]), errors=errors)


def _real_form(up, down):
    """[[Re, -Im], [Im, Re]] of matrices with the conjugates `down`."""
    real, imaginary = (up + down) / 2, (up - down) / 2j
    return np.concatenate([np.concatenate(row, -1) for row in ((real, -imaginary), (imaginary, real))], -2)


def margins_of(loop: BrokenLoop | LiftedLoop) -> tuple[list[Margin], int]:
    """Return the margins of a broken loop, empty if it is not stable, and why its stability is in doubt, a code."""
    if isinstance(loop, LiftedLoop):
        return lifted_margins(loop)
    margins, doubt = scalar_margins(loop)
    if not (doubt or any(margin.doubt not in (NONE, FAST) for margin in margins)):
        return margins, doubt
    lifted_ones, of_others = lifted_margins(loop.lifted)
    certain = {margin.name: margin for margin in lifted_ones if not margin.doubt}
    return ([certain.get(margin.name, margin) if margin.doubt else margin for margin in margins] or lifted_ones), of_others


def lifted_margins(loop: LiftedLoop) -> tuple[list[Margin], int]:
    """Return the margins of a lifted loop, empty if it is not stable, and why its stability is in doubt, a code.

    As `margins_of`, with the same factor on all samples of a frame; sensitivity and complementary are the largest singular
    values of S and of S - 1. There is no delay margin: a delay of samples is no factor of a frame.
    Accuracy: gains and phase EXACT, as ends of certified intervals along k; a disk that is smaller by GAP is proved: along its
    rim the frame is stable, and so it is within, since the spectral radius of a frame that is analytic in k has no peak there.
    """
    for most in SPANS:
        intervals = loop.along_gain((1 / most, most))
        own_interval = intervals.take((intervals.index >= 0) & (intervals.low < 1) & (intervals.high > 1))
        if not own_interval.low.size or (own_interval.high[0] < most and own_interval.low[0] > 1 / most):
            break
    doubt = int(intervals.doubt[0])
    if not own_interval.low.size:
        return [], doubt
    gains = [
        limited_or_not(name, float(value[0]), float(omega[0]), EXACT, doubt)
        for name, value, omega in (
            ("gain_up", own_interval.high, own_interval.high_omega),
            ("gain_down", own_interval.low, own_interval.low_omega),
        )
    ]
    return [*gains, _phase(loop), *_peaks(loop)], doubt


def _phase(loop):
    intervals = loop.along_turn(lambda angle: np.exp(1j * angle))
    doubt, known_intervals = (
        int(intervals.doubt[0]),
        intervals.take(intervals.index >= 0),
    )  # not the places where nothing is known
    if not known_intervals.low.size or known_intervals.low[0] != 0 or np.isnan(known_intervals.high_omega[0]):
        return Margin.unlimited("phase", 180.0, doubt)
    high = float(known_intervals.high[0])
    return Margin("phase", float(np.degrees(high)), float(known_intervals.high_omega[0]), EXACT * (1 + 1e-3 / high), doubt)


def _peaks(loop) -> Iterator[Margin]:
    disk, theta, doubt = _disk(loop)
    yield from disk_margins(disk, theta / loop.period, GAP, doubt)
    E, B, C, D = loop.sensitivity.maps[0]
    for name, less in (("sensitivity", 0.0), ("complementary", 1.0)):
        peak = squared_norm(TickMaps(((E, B, C, D - less * np.eye(loop.times)),), np.zeros(1, int)))
        yield peak_margin(name, peak, loop.period, TOLERANCE)


def _disk(loop):
    """The disk margin, its angle (rad per frame), and the doubt."""
    from scipy.optimize import minimize_scalar

    few = max(100, GRID // loop.times)
    poles = np.angle(1 + np.linalg.eigvals(loop.sensitivity.maps[0][0][0]))
    points = np.concatenate([START, SOFT, np.geomspace(1e-6, 1.0, few), np.linspace(0, np.pi, few), np.abs(poles)])
    points = np.unique(np.clip(points[np.isfinite(points)], BESIDE, np.pi))
    best, at = 0.0, 0.0
    for _ in range(ROUNDS):
        size = np.nan_to_num(loop.radius(points))
        for top in np.argsort(size)[-3:]:
            ends = points[max(top - 1, 0)], points[min(top + 1, points.size - 1)]
            near = minimize_scalar(lambda t: -float(loop.radius(t)), bounds=ends, method="bounded", options={"xatol": 1e-12})
            for value, place in ((-near.fun, near.x), (size[top], points[top])):
                best, at = (float(value), float(place)) if value > best else (best, at)
        disk = min(1 / best, 2.0)
        reach = disk / 2 * (1 - GAP)
        intervals = loop.along_turn(
            lambda angle, reach=reach: (1 + reach * np.exp(1j * angle)) / (1 - reach * np.exp(1j * angle))
        )
        direct = np.diagonal(loop.returned.T[0])
        doubt = int(intervals.doubt[0]) or (SEARCH if (np.abs(1 - direct) <= reach * np.abs(1 + direct)).any() else NONE)
        if doubt or (intervals.low[0] == 0 and intervals.high[0] == np.pi):
            return disk, at, doubt
        angles = np.concatenate([intervals.low_omega, intervals.high_omega]) * loop.period
        points = np.unique(np.concatenate([points, angles[np.isfinite(angles)]]))
    return disk, at, SEARCH
