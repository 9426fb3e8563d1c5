"""Margins of a loop broken at a signal that is made once or several times in a frame: those of the
lifted loop.

With the signal multiplied by the same number k in all of its m samples of a frame, the frame's
eigenvalues z solve `det(1 - k H(z)) = 0`, H being the m x m transfer function from the samples back
to themselves without the number: -H is the return ratio of the lifted signal. A real k gives gain
margins, `k = exp(j phi)` the phase margin, `k = (1 + d)/(1 - d)` with
|d| < a/2 the disk margin a. With `S = 1/(1 - H)` the last one is `det(1 - 2 d (S - 1/2)) = 0`, so that 1/a is the largest
spectral radius of `S - 1/2` on the unit circle: the structured singular value of a repeated complex
scalar (A. Packard, J. Doyle, Automatica 29, 1993). For one sample in a frame it is the peak of
`|S - 1/2|`, and the phase margin follows from all crossings of |L| = 1.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wavesweep.engine.doubles import EPS, NEXT_TO_ZERO
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.frames import (
    Frames,
    LinearFractional,
    MarginalModes,
    OpenTicks,
    on_circle,
    solve,
)
from wavesweep.engine.intervals import ParametricFrames, stable_along_any
from wavesweep.engine.loop import Loops
from wavesweep.engine.norms import (
    NORM_TOLERANCE,
    SOFT,
    START,
    LiftedMap,
    TickMaps,
    connected,
    squared_norm,
    with_middles,
)
from wavesweep.engine.poles import count_outside
from wavesweep.margins.loop_margins import (
    BESIDE_ZERO,
    LARGEST_GAIN_FACTOR,
    Margin,
    disk_margins,
    limited_or_not,
    margin_within,
    peak_margin,
    stable_around_1,
)

GAINS = frozenset(("gain_up", "gain_down", "gain"))
TURNS = frozenset(("phase", "delay_frames"))
MARGINS = TURNS | {"gain_up", "gain_down", "disk", "sensitivity", "complementary"}
END_ERROR = 2e-9  # relative error of an end of `stable_along_any`
DISK_GAP = 1e-8  # relative, between a disk that is proved and one that is met at some frequency
# samples of a frame at all angles at which the spectral radius is looked at before its peaks are
# refined
GRID = 10_000
NO_DRIFT_SEEN = 1e-8  # of the sizes of its terms, below which what is seen of a drift is rounding
TOUCHES = 1e-7  # a peak or dip of the gain within this distance of 1 may touch it
# distance of the direct term's size from 1 beyond which the pencil of the gain 1 is regular
DIRECT = 1e-6
MODE_MET = 1e-6  # of a mode, from the place on the circle where it should be
# shares of a curve of factors, which a search looks at; the nearer the closer to the factor 1
SEEN_AT = np.linspace(0.0, 1.0, 33) ** 2
SEEN_TO = 1e-7
# the factors at which such curves end, powers of which they are
SEEN = {"gain": (LARGEST_GAIN_FACTOR, 1 / LARGEST_GAIN_FACTOR), "phase": (-1 + 0j,)}


@dataclass(frozen=True, eq=False)
class LiftedLoop:
    """A single loop without a number that multiplies all samples of a signal in a frame.

    loop: with the number, a gain at the signal. ticks: those of the loop without it. drift: of the
    loop with it. period: of the frame, s. places: when the signal is made, as shares of a frame. cut: of a signal
    that is made once, the loop cut at the number, with bounds on errors of its entries.
    """

    loop: Loops
    ticks: OpenTicks
    drift: MarginalModes
    period: float
    places: np.ndarray
    cut: LinearFractional | None = None

    @cached_property
    def returned(self) -> LiftedMap:
        """H, from the samples of a frame back to themselves."""
        maps = TickMaps.of(self._maps, self.ticks.ticks.kind, ())
        return maps.lifted(measured=False)

    @property
    def _maps(self):
        """E, B, C and D of each kind of tick."""
        return [(tick.E, tick.B, tick.C, tick.D) for tick in self.ticks.ticks.maps]

    @cached_property
    def _returned_matrices(self):
        """E less identity, G, O and T of `H = T + O (z - 1 - E)^-1 G`.

        A drift v, by constant factors or of a state that nothing reads, has E v = 0 and O v = 0.
        `E - v e'`, e the unit vector of its lead and v_lead = 1, moves its eigenvalue of the frame
        from 1 to 0 and changes no other one, nor H, of which its pole would leave nothing but rounding
        next to z = 1.
        """
        H = self.returned
        E = H.E[0].copy()
        identity = np.eye(len(E))
        for lead in self.drift.unobserved:
            E[:, lead] -= identity[lead]
        for lead, trailing in self.drift.constant:
            E[:, lead] -= identity[lead]
            for state, factor in trailing:
                E[state, lead] -= factor
        return E, H.G[0], H.O[0], H.T[0]

    @property
    def times(self) -> int:
        """How often the signal is made in a frame."""
        return self.returned.T.shape[-1]

    @property
    def returns(self) -> bool:
        """Whether the signal comes back to itself."""
        return bool(connected(self._maps).any() or self.returned.T.any())

    def response(self, theta) -> np.ndarray:
        """Return the eigenvalues of L = -H at the angles theta (rad per frame), `(..., samples)`;
        of one sample L, `(...)`.

        They are 1/s - 1 for the eigenvalues s of S: next to a large eigenvalue of H, as integrators
        give it at low frequencies, rounding would leave nothing of the small ones.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            returns = 1 / np.linalg.eigvals(self._sensitivity_at(theta)) - 1
        if self.times > 1:
            return returns
        return returns[..., 0]

    def at_line(self, theta) -> np.ndarray:
        """Return what comes back of a sine at the signal, of its own frequency, with its sign
        changed: L of the signal's rate.

        theta: rad per frame, up to pi times the samples. A sine also comes back with its images.
        With samples at equal steps these are off the diagonal of the harmonic transfer matrix,
        which has the eigenvalues of L (N. Wereley, thesis, MIT 1991); without anything slower than
        the signal there are none, and L is that of a loop of one rate.
        """
        E, G, O, T = self._returned_matrices
        angles = np.asarray(theta, float)[..., None, None]
        sine = np.exp(1j * angles * self.places[:, None])
        A = on_circle(angles) * np.eye(len(E)) - E
        comes_back = O @ solve(A, G @ sine) + T @ sine
        return -(sine.conj() * comes_back).mean((-2, -1))

    def _sensitivity_at(self, theta):
        E, B, C, D = (array[0] for array in self.sensitivity.maps[0])
        A = on_circle(np.asarray(theta, float))[..., None, None] * np.eye(len(E)) - E
        return D + C @ solve(A, B + 0j)

    @cached_property
    def sensitivity(self) -> TickMaps:
        """The map `S = 1/(1 - H)`, in states of even units.

        The eigenvalue 1 of a drift v with the left vector w, `w v = 1`, is moved to 0, by `E - v
        w`, if S does not have it: `C v w B` is 0. Otherwise S has no bound at 0 rad/s.
        """
        E, G, O, T = self._returned_matrices
        feedback = np.linalg.inv(np.eye(len(T)) - T)
        E = E + G @ feedback @ O
        B = G @ feedback
        C = feedback @ O
        in_even_units = TickMaps.of([(E, B, C, feedback)], np.zeros(1, int), ()).in_even_units()
        (matrices,) = in_even_units.maps
        count = len(self.drift.varying)
        if count:
            E, B, C, _ = (matrix[0] for matrix in matrices)
            U, _, V = np.linalg.svd(E)
            v = V[-count:].T
            w = U[:, -count:].T
            v = v @ np.linalg.inv(w @ v)
            seen = np.abs(C @ v @ w @ B)
            sizes = np.abs(C) @ np.abs(v) @ np.abs(w) @ np.abs(B)
            if (seen <= NO_DRIFT_SEEN * sizes).all():
                matrices = ((E - v @ w)[None], *matrices[1:])
        return TickMaps((matrices,), np.zeros(1, int))

    def slope_and_error(self, theta: float) -> tuple[complex, float]:
        """Return the derivative of L by the angle, and a bound on the error of L itself: of the
        frame's entries, and of rounding; of a signal that is made once."""
        E, B, C, _ = self.cut.with_integrator()
        dE, dB, dC, _ = self.cut.errors_with_integrator()
        w = complex(on_circle(theta))
        identity = np.eye(len(E))
        A = w * identity - E
        state = solve(A, B + 0j)
        read = solve(A.T, C.T + 0j).T
        rounding = len(E) * EPS
        rounded = rounding * (abs(w) * identity + np.abs(E))
        error = np.abs(read) @ ((dE + rounded) @ np.abs(state) + dB) + dC @ np.abs(state)
        error = error + rounding * (np.abs(C) @ np.abs(state) + np.abs(self.returned.T[0]))
        slope = complex((read @ state)[0, 0]) * 1j * (1 + w)
        return slope, float((error + self.cut.dD[-1:])[0, 0])

    def unit_gains(self) -> tuple[np.ndarray, bool, float]:
        """Return all angles in (0, pi) at which |L| crosses 1, whether it is known that there are
        no others, and up to which angle rounding hides one beside 0.

        |L| = 1 exactly where the real part of S is 1/2. The pencil of that level has all the angles as eigenvalues; between
        these and their middles the size of L shows where it crosses, and halving finds the root to
        rounding.
        """

        def size(theta):
            return np.nan_to_num(
                np.log(np.abs(self.at_line(theta))), nan=np.inf, posinf=1e3, neginf=-1e3
            )

        with np.errstate(all="ignore"):
            met = self.sensitivity.pencil(np.zeros(1, int), np.array([0.5])).angles()
            points = np.unique(np.concatenate([with_middles(met)[0], SOFT, START]))
            points = points[np.isfinite(points)]
            sizes = size(points)
            above = sizes > 0
            change = np.flatnonzero(above[:-1] != above[1:])
            low = points[change]
            high = points[change + 1]
            while (high - low > NEXT_TO_ZERO + 4 * EPS * high).any():
                unit_angles = (low + high) / 2
                is_below_root = (size(unit_angles) > 0) == above[change]
                low = np.where(is_below_root, unit_angles, low)
                high = np.where(is_below_root, high, unit_angles)
            unit_angles = (low + high) / 2
        touches = np.abs(sizes) <= TOUCHES
        if unit_angles.size:
            # At the ends a rotation by 180 degrees is meant, which no other one exceeds.
            touches &= (points > 0) & (points < np.pi)
        near = np.flatnonzero(touches)
        is_beside = np.zeros(near.size, bool)
        for root in unit_angles:
            slope, _ = self.slope_and_error(root)
            slope_of_size = abs((slope * self.at_line(root).conj()).real)
            is_beside |= (
                slope_of_size * np.abs(points[near] - root) <= 2 * np.abs(sizes[near]) + 1e-12
            )
        at_rest, hidden = self._largest_at_rest(points[near], sizes[near])
        regular = abs(abs(self.returned.T[0, 0, 0]) - 1) > DIRECT
        return unit_angles, bool((is_beside | at_rest).all()) and regular, hidden

    def _largest_at_rest(self, points, sizes) -> tuple[np.ndarray, float]:
        """Return at which of some angles log |L| is that of a largest L(0) = 1, `-c theta^2/2`, and
        the angle up to which the error of L may hide a crossing of 1 next to it.

        There L is near to 1, and a rotation by almost 180 degrees is meant.
        """
        nowhere = np.zeros(points.size, bool)
        is_at_rest = points.size and points[0] == 0 < points[-1] and sizes[-1] < 0
        if not is_at_rest or not self.at_line(0.0).real > 0:
            return nowhere, 0.0
        c = -2 * sizes[-1] / points[-1] ** 2
        parabola = c / 2 * points**2
        at_rest = np.abs(sizes + parabola) <= parabola / 2 + 1e-12
        _, error = self.slope_and_error(BESIDE_ZERO)
        return at_rest, float(np.sqrt(2 * error / c))

    def radius(self, theta) -> np.ndarray:
        """Return the spectral radius of `S - 1/2` at the angles theta.

        Next to a drift that moves the signal rounding of S hides its small eigenvalues: 0 if no
        mode of the frame is there with the factor that the largest one gives.
        """
        theta = np.asarray(theta, float)
        peaks = np.linalg.eigvals(self._sensitivity_at(theta)) - 0.5
        size = np.abs(peaks).max(-1)
        if not self.drift.varying:
            return size
        farthest = np.abs(peaks).argmax(-1)[..., None]
        largest = np.take_along_axis(peaks, farthest, -1)[..., 0].ravel()
        with np.errstate(all="ignore"):
            factor = (2 * largest + 1) / (2 * largest - 1)
            modes = np.linalg.eigvals(np.nan_to_num(self.frames(factor).E))
        distance = np.abs(modes - on_circle(theta).reshape(-1, 1)).min(-1)
        met = distance.reshape(theta.shape) <= MODE_MET
        return np.where(met, size, 0.0)

    def frames(self, k, at=0) -> Frames:
        """Return the frames of the loops `at` of a batch with the number k, `(n,)`, real or
        complex."""
        E, pivot, condition = self.ticks.frames(np.broadcast_to(at, k.shape), k)
        pivot = np.broadcast_to(pivot, k.shape)
        condition = np.broadcast_to(condition, k.shape)
        return Frames(self.drift.removed_from(E), pivot[:, None], condition)

    def growth(self, k, at=0) -> np.ndarray:
        """By how much the spectral radius of these frames is beyond 1."""
        with np.errstate(all="ignore"):
            E = self.frames(k, at).E
        E = np.where(np.isfinite(E).all((-2, -1), keepdims=True), E, LARGEST_GAIN_FACTOR)
        return np.abs(1 + np.linalg.eigvals(E)).max(-1) - 1

    def errors(self, k) -> tuple[np.ndarray, np.ndarray]:
        """Return the same frames, and bounds on the errors of their entries."""
        return self.drift.frames_with_errors(
            self.ticks.closed(np.zeros(k.size, int), k, terms=True)
        )

    def along_turn(self, factor):
        """Return the stable intervals along an angle from 0 to pi; factor: k, and its analytic
        continuation, for an angle.

        The real matrix [[Re, -Im], [Im, Re]] of a complex frame has its eigenvalues and their
        conjugates, which are those at the opposite angle.
        """

        def frames(_, p):
            p = p.ravel()
            up = self.frames(factor(p) + 0j)
            down = self.frames(factor(-p) + 0j)
            E = _real_form(up.E, down.E)
            pivots = up.pivots * down.pivots
            if not np.iscomplexobj(p):
                E = E.real
                pivots = pivots.real
            return Frames(E, pivots, up.condition + down.condition)

        def errors(_, p):
            p = p.ravel()
            up, error_of_up = self.errors(factor(p) + 0j)
            down, error_of_down = self.errors(factor(-p) + 0j)
            error = np.maximum(error_of_up.real, error_of_down.real)
            return _real_form(up, down).real, np.tile(error, (2, 2))

        return stable_along_any(
            ParametricFrames(frames, np.array([self.period]), errors=errors), (0.0, np.pi)
        )


def _real_form(up, down):
    """[[Re, -Im], [Im, Re]] of matrices with the conjugates `down`."""
    real = (up + down) / 2
    imaginary = (up - down) / 2j
    return np.block([[real, -imaginary], [imaginary, real]])


def margins_of(loop: LiftedLoop, wanted: Collection[str] = MARGINS) -> tuple[list[Margin], int]:
    """Return the margins of a broken loop, empty if it is not stable, and why its stability is in
    doubt, a code.

    wanted: names of those that are asked for, the others are not worked out. gain: the less of gain_up
    and 1 / gain_down, in place of both. gain_up, gain_down:
    factors of the signal, of all its samples in a frame, at the ends of the stable interval around
    1; LARGEST_GAIN_FACTOR and 0 if they are beyond LARGEST_GAIN_FACTOR and 1/LARGEST_GAIN_FACTOR.
    phase (degrees): up to which every rotation of the signal leaves the loop
    stable. delay_frames: a delay of fewer whole frames leaves it stable; only of a signal that is
    made once, as a delay of samples is no factor of a frame. disk: the largest a for which every
    factor (1 + a d/2)/(1 - a d/2), |d| < 1, does, so those from 1/disk_gain to disk_gain, and
    rotations up to disk_phase. sensitivity, complementary: the largest singular values of S and of
    S - 1, which are |1/(1 + L)| and |L/(1 + L)| of one sample.

    Accuracy: see `Margin.bound`; gains and the phase of several samples END_ERROR, as ends of
    certified intervals along k; peaks by level sets (see `hinf_norm`). A disk of several samples
    that is smaller by DISK_GAP is proved: along its rim the frame is stable, and so it is within,
    since the spectral radius of a frame that is analytic in k has no peak there. Source: P. Seiler,
    A. Packard, P. Gahinet, IEEE Control Systems Magazine 40 (2020), with a disk of no skew.
    """
    margins, doubt = [], int(Doubt.NONE)
    if GAINS.intersection(wanted):
        margins, doubt = _gains(loop, nearer="gain" in wanted)
    if not margins:
        outside, clear = count_outside(*loop.errors(np.ones(1)))
        doubt = doubt or int(Doubt.NONE if clear[0] else Doubt.ROUNDING)
        if outside[0] or GAINS.intersection(wanted):
            return [], doubt
    if TURNS.intersection(wanted):
        turns = list(_at_unit_gain(loop)) if loop.cut else []
        if not turns or turns[0].doubt:
            turns[:1] = [_phase(loop)]
        margins += turns
    return [*margins, *_peaks(loop, wanted)], doubt


def seen_margins(loops: LiftedLoop, size: int, name: str) -> np.ndarray:
    """Return the margins "gain" or "phase" (degrees) of a batch of so many loops as a search ranks
    them, NaN of one that is not stable, with nothing proved: they are where the spectral radius is
    first seen to reach 1.

    Accuracy: SEEN_TO of half a turn, or of the logarithm of LARGEST_GAIN_FACTOR, unless a loop is
    unstable between two of SEEN_AT and at neither.
    """
    from scipy.optimize.elementwise import find_root

    number = np.arange(size)
    stable = loops.growth(np.ones(size), number) < 0
    least = np.where(stable, 1.0, np.nan)
    for limit in SEEN[name]:
        factors = np.tile(limit**SEEN_AT, size)
        beyond = loops.growth(factors, np.repeat(number, SEEN_AT.size)) >= 0
        first = beyond.reshape(size, -1).argmax(-1)
        met = np.flatnonzero(stable & (first > 0))
        between = SEEN_AT[first[met] - 1], SEEN_AT[first[met]]
        crossing = find_root(
            lambda share, at, limit=limit: loops.growth(limit**share, at.astype(int)),
            between,
            args=(met,),
            tolerances={"xatol": SEEN_TO, "xrtol": 0.0},
        )
        least[met] = np.minimum(least[met], crossing.x)
    return 180 * least if name == "phase" else LARGEST_GAIN_FACTOR**least


def _gains(loop, *, nearer) -> tuple[list[Margin], int]:
    """Both margins of gain, none of a loop that is not stable, and the doubt about them. nearer: the
    less of them alone."""
    around_1, doubt = stable_around_1(loop.loop, 0.0 if loop.cut else None, nearer=nearer)
    if doubt and loop.cut:
        around_1, doubt = stable_around_1(loop.loop, nearer=nearer)
    margins: list[Margin] = []
    if around_1 is None:
        return margins, doubt
    rate = 2 * np.pi / loop.period
    ends = [("gain_up", "high"), ("gain_down", "low")]
    if nearer:
        ends = [("gain", "low" if around_1["low"] * around_1["high"] > 1 else "high")]
    for name, end in ends:
        omega = float(around_1[f"{end}_omega"])
        # A part of the loop that runs by itself sees it in a shorter frame of its own.
        omega = float(abs(omega - rate * np.round(omega / rate)))
        factor = float(around_1[end])
        if name == "gain":
            factor = max(factor, 1 / factor)
        margins.append(limited_or_not(name, factor, omega, END_ERROR, doubt))
    return margins, doubt


def _at_unit_gain(loop) -> Iterator[Margin]:
    """The margins of phase and delay of a signal that is made once, from all crossings of the gain
    1."""
    theta, certain, hidden = loop.unit_gains()
    doubt = Doubt.NONE if certain else Doubt.CROWDED
    slow = abs(complex(loop.at_line(np.pi))) < 1 - TOUCHES  # otherwise see Doubt.FAST
    if not theta.size:
        if hidden:
            # Up to the angle `hidden` L is about 1, turned by at most `turned`: to reach -1 takes
            # 180 degrees less that, or a delay of about pi/hidden frames or more.
            turned = abs(loop.slope_and_error(BESIDE_ZERO)[0]) * hidden
            yield margin_within("phase", 180.0, 0.0, turned / np.pi, doubt)
            doubt = doubt if hidden * LARGEST_GAIN_FACTOR <= np.pi else Doubt.ROUNDING
        else:
            yield Margin.unlimited("phase", 180.0, doubt)  # which no rotation exceeds
        doubt = doubt if slow else Doubt.FAST
        yield Margin.unlimited("delay_frames", LARGEST_GAIN_FACTOR, doubt)
        return
    response = loop.at_line(theta)
    lag = np.angle(-response)
    limits = (("phase", np.abs(lag), np.pi / 180), ("delay_frames", lag % (2 * np.pi), theta))
    for name, turns, unit in limits[: 1 + slow]:
        values = turns / unit
        worst = int(np.argmin(values))
        L = response[worst]
        slope, error = loop.slope_and_error(float(theta[worst]))
        error += abs(abs(L) - 1)
        # as the angle moves with the size of L
        with np.errstate(all="ignore"):
            error *= 1 + abs(slope * L) / abs((slope * L.conj()).real)
        omega = float(theta[worst]) / loop.period
        yield margin_within(name, float(values[worst]), omega, error / turns[worst], doubt)
    if not slow:
        yield Margin.unlimited("delay_frames", LARGEST_GAIN_FACTOR, Doubt.FAST)


def _phase(loop):
    intervals = loop.along_turn(lambda angle: np.exp(1j * angle))
    doubt = int(intervals.doubt[0])
    decided = intervals.take(intervals.index >= 0)  # not the places where nothing is known
    if not decided.low.size or decided.low[0] != 0 or np.isnan(decided.high_omega[0]):
        return Margin.unlimited("phase", 180.0, doubt)
    high = float(decided.high[0])
    bound = END_ERROR * (1 + 1e-3 / high)
    return Margin("phase", float(np.degrees(high)), float(decided.high_omega[0]), bound, doubt)


def _peaks(loop, wanted) -> Iterator[Margin]:
    E, B, C, D = loop.sensitivity.maps[0]
    for name, less in (("disk", 0.5), ("sensitivity", 0.0), ("complementary", 1.0)):
        if name not in wanted:
            continue
        if name == "disk" and not loop.cut:
            disk, theta, doubt = _disk(loop)
            yield from disk_margins(disk, theta / loop.period, DISK_GAP, doubt)
            continue
        matrices = (E, B, C, D - less * np.eye(loop.times))
        peak = squared_norm(TickMaps((matrices,), np.zeros(1, int)))
        theta = float(peak.theta[0])
        bound = NORM_TOLERANCE
        if loop.cut:
            angle = max(theta, BESIDE_ZERO)  # an integrator has no response at 0
            size = float(np.sqrt(peak.value[0]))
            S = 1 / (1 + complex(loop.at_line(angle)))
            _, error = loop.slope_and_error(angle)
            bound += (abs(S) ** 2 * error + abs(abs(S - less) - size)) / size
        if name == "disk":
            disk = 1 / np.sqrt(peak.value[0])
            doubt = Doubt.NONE if peak.certified[0] else Doubt.SEARCH
            yield from disk_margins(float(disk), theta / loop.period, bound, doubt)
        else:
            yield peak_margin(name, peak, loop.period, bound)


def _climbed(loop, points: np.ndarray, size: np.ndarray, highest: int) -> tuple[float, float]:
    """The largest radius about one of some angles (rad per frame), and its angle; size: the radii there."""
    best = 0.0
    angle = 0.0
    while True:
        if size[highest] > best:
            best = float(size[highest])
            angle = float(points[highest])
        below = points[max(highest - 1, 0)]
        above = points[min(highest + 1, points.size - 1)]
        # How far a peak may be from the angle that is found.
        if above - below < 1e-12:
            return best, angle
        points = np.linspace(below, above, 9)  # angles in each step of a refinement
        size = np.nan_to_num(loop.radius(points))
        highest = int(size.argmax())


def _disk(loop):
    """The disk margin, its angle (rad per frame), and the doubt."""
    few = max(100, GRID // loop.times)
    E, *_ = loop.sensitivity.maps[0]
    poles = np.abs(np.angle(1 + np.linalg.eigvals(E[0])))
    everywhere = [np.geomspace(1e-6, 1.0, few), np.linspace(0, np.pi, few)]
    points = np.concatenate([START, SOFT, *everywhere, poles])
    points = np.unique(np.clip(points[np.isfinite(points)], BESIDE_ZERO, np.pi))
    direct = np.diagonal(loop.returned.T[0])
    best = 0.0
    at = 0.0
    for _ in range(4):  # each proof that fails shows the angle of a larger peak
        size = np.nan_to_num(loop.radius(points))
        for top in np.argsort(size)[-3:]:
            peak, angle = _climbed(loop, points, size, top)
            if peak > best:
                best = peak
                at = angle
        disk = min(1 / best, 2.0)
        reach = disk / 2 * (1 - DISK_GAP)
        intervals = loop.along_turn(
            lambda angle, reach=reach: 2 / (1 - reach * np.exp(1j * angle)) - 1
        )
        doubt = int(intervals.doubt[0])
        if not doubt and (np.abs(1 - direct) <= reach * np.abs(1 + direct)).any():
            doubt = Doubt.SEARCH
        if doubt or (intervals.low[0] == 0 and intervals.high[0] == np.pi):
            return disk, at, doubt
        angles = np.concatenate([intervals.low_omega, intervals.high_omega]) * loop.period
        points = np.unique(np.concatenate([points, angles[np.isfinite(angles)]]))
    return disk, at, Doubt.SEARCH
