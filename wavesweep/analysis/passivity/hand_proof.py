"""Walls proved stable with every hand of a box, piece by piece: no matrix of a piece has an eigenvalue outside the circle."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.passivity.enclosure import Enclosure
from wavesweep.analysis.passivity.hand import HandBox
from wavesweep.analysis.passivity.held_frame import WALL, HeldLoop, frame_over, held_loop

ROOM = 1e-9  # of a weighted row: what rounding may add to it
SECTORS = 4  # of the upper half of the plane, one about each of the largest eigenvalues
SWEEPS = 8  # of the power iteration that tells which parameter does most


def excluded(A: Enclosure) -> tuple[np.ndarray, np.ndarray]:
    """Whether every `I + A` is stable, `(pieces,)`, and which parameter adds most to the bound, `(pieces,)`.

    A: real matrices, near to diagonal in some basis that is common to them. For z outside, `z - I - A` is invertible
    where it is diagonally dominant in some weights: `sum_j |A_ij| d_j < |z - 1 - A_ii| d_i`. That is asked of each sector
    `|z| >= 1, a <= arg z <= b` of the upper half plane (the lower one is its image), with the least of the right side
    in it; the weights d are solved for (A. Berman, R. Plemmons, Nonnegative matrices in the mathematical sciences,
    1979: they exist exactly for a nonsingular M-matrix) and then tried.
    """
    centre, slopes, bends, rest = _flattened(A)
    finite = np.logical_and.reduce([np.isfinite(part).all(tuple(range(1, part.ndim))) for part in A.parts])
    moves = np.abs(slopes)
    radius = moves.sum(1) + rest
    d = np.arange(centre.shape[-1])
    own = 1 + centre[:, d, d]
    inside = 1 - _modulus(1 + A.centre[:, d, d], slopes[:, :, d, d], A.curves[:, :, d, d]) - A.rest[:, d, d]
    away = np.maximum(inside[:, None], _distances(own) - radius[:, None, d, d])
    off = np.abs(centre) + radius
    off[:, d, d] = 0
    finite &= np.isfinite(off).all((-1, -2)) & np.isfinite(away).all((-1, -2))
    off, away = np.where(finite[:, None, None], off, 1.0), np.where(finite[:, None, None], away, 0.0)
    clear = _dominant(off, away)
    worst = np.argmin(np.where(clear, 10.0, 0.0) + away.min(-1), axis=-1)
    least = np.take_along_axis(away, worst[:, None, None], 1)[:, 0]
    return finite & clear.all(-1), _costliest(off, least, moves, bends, np.where(finite[:, None, None], A.rest, 0.0))


def _flattened(A):
    """Centre, slopes, what pairs of parameters add at most, and all that no slope says."""
    i, j = np.triu_indices(A.slopes.shape[1])
    centre = A.centre + A.curves[:, i == j].sum(1) / 2  # e^2 is within a half of a half
    bends = np.abs(A.curves) * np.where(i == j, 0.5, 1.0)[:, None, None]
    return centre, A.slopes, bends, A.rest + bends.sum(1)


def _modulus(centre, slopes, curves):
    """At most how large `centre + sum slopes_k e_k + sum curves_ij e_i e_j` is, to second order in the square of it.

    A mode that only turns with the parameters grows by its third order alone.
    """
    i, j = np.triu_indices(slopes.shape[1])
    linear = 2 * (centre[:, None].conj() * slopes).real
    square = 2 * (centre[:, None].conj() * curves).real
    square += np.where(i == j, 1, 2)[:, None] * (slopes[:, i].conj() * slopes[:, j]).real
    own, mixed = square[:, i == j], np.abs(square[:, i != j]).sum(1)
    size = np.abs(linear)  # the most of l e + q e^2: in a corner, unless q < 0 bends it down before
    hump = np.where(size < -2 * own, linear**2 / np.maximum(-4 * own, 1e-300), size + own)
    first, second = np.abs(slopes).sum(1), np.abs(curves).sum(1)
    return np.sqrt(np.maximum(np.abs(centre) ** 2 + hump.sum(1) + mixed + 2 * first * second + second**2, 0))


def _distances(own):
    """From each of `own` to each sector: `(pieces, sectors, n)`; the sectors meet midway between the largest of them."""
    upper = np.where(own.imag >= 0, np.abs(own), -1.0)
    largest = np.argsort(-upper, axis=-1, kind="stable")[:, :SECTORS]
    chosen = np.where(np.take_along_axis(upper, largest, -1) < 0, -1, np.take_along_axis(own, largest, -1))
    angles = np.sort(np.angle(chosen))
    between = (angles[:, 1:] + angles[:, :-1]) / 2
    first = np.concatenate([np.zeros((len(own), 1)), between], -1)[..., None]
    last = np.concatenate([between, np.full((len(own), 1), np.pi)], -1)[..., None]
    z, angle = own[:, None], np.angle(own)[:, None]
    edge = np.minimum(np.abs(z - np.exp(1j * first)), np.abs(z - np.exp(1j * last)))
    return np.where((angle >= first) & (angle <= last) | (np.abs(z) >= 1), 1 - np.abs(z), edge)


def _dominant(off, away):
    """In which sectors weights d > 0 with `off d < away d` were found, `(pieces, sectors)`."""
    positive = (away > ROOM).all(-1)
    diagonal = np.where(positive[..., None], away, 1.0) * (1 - ROOM)
    matrix = diagonal[..., None] * np.eye(off.shape[-1]) - np.where(positive[..., None, None], off[:, None], 0.0)
    d = _solved(matrix)
    return positive & (d > 0).all(-1) & ((off[:, None] @ d[..., None])[..., 0] < diagonal * d).all(-1)


def _solved(matrix):
    """`matrix^-1 1`, or -1 where a matrix is singular."""
    ones = np.ones((*matrix.shape[:-1], 1))
    try:
        return np.linalg.solve(matrix, ones)[..., 0]
    except np.linalg.LinAlgError:
        regular = (np.linalg.slogdet(matrix)[0] != 0)[..., None]
        solved = np.linalg.solve(np.where(regular[..., None], matrix, np.eye(matrix.shape[-1])), ones)[..., 0]
        return np.where(regular, solved, -1.0)


def _costliest(off, away, moves, bends, rest):
    """The parameter that raises the spectral radius of the weighted bound most, to first order.

    Of each bend all those that have a part in it have the whole; of the rest, a part as of the bends.
    """
    i, j = np.triu_indices(moves.shape[1])
    bent = np.stack([bends[:, (i == k) | (j == k)].sum(1) for k in range(moves.shape[1])], axis=1)
    size = 1 / (np.maximum(away, 0) + 1e-3 * off.sum(-1) + 1e-300)
    bound = size[..., None] * (off + (moves + bent).sum(1) * np.eye(off.shape[-1]))
    right, left = np.ones((*bound.shape[:-1], 1)), np.ones((len(bound), 1, bound.shape[-1]))
    for _ in range(SWEEPS):
        right, left = bound @ right, left @ bound
        right, left = right / right.max(-2, keepdims=True), left / left.max(-1, keepdims=True)
    left = left * size[:, None]
    straight, curved = ((left[:, None] @ part @ right[:, None])[..., 0, 0] for part in (moves, bent))
    beyond = (left @ rest @ right)[..., 0] / np.maximum(curved.sum(-1, keepdims=True), 1e-300)
    gain = straight + curved * (1 + beyond)
    return np.argmax(np.where(np.isfinite(gain), gain, -1), axis=-1)


WORK = 400_000  # pieces to look at, times what each costs in a loop of its order: some seconds
CHUNK = 512  # pieces looked at together
UNSTABLE = 1e-9  # beyond 1, of a spectral radius
SOFTEST = 1e-6  # of the stiffest: where no position is fed back, softer springs than that, but none at all, are left out
TOLD = 8  # hands to go on from, of either end of the interval and of all of it


@dataclass(frozen=True, slots=True, eq=False)
class Proof:
    """holds: every hand is proved. unstable, hardest: hands `(n, 3)` (kg, N*s/m, N/m) that are unstable at some wall, and
    those whose neighbourhood was cut finest. work: pieces looked at, times what each costs."""

    holds: bool
    unstable: np.ndarray
    hardest: np.ndarray
    work: int


NOTHING = np.zeros((0, 3))


def prove(values, box: HandBox, walls: tuple[float, float], work: int = WORK) -> Proof:
    """Try to prove it for K_VE in `walls` (N/m); values: flat keys, numbers.

    A piece is proved where no matrix of its enclosure has an eigenvalue on or outside the unit circle (`excluded`); if
    it is not, it is halved across the parameter that does most to its bound, and given up when `work` is spent. A piece
    whose middle is unstable ends the search.
    Accuracy: every hand of the box, but for springs softer than SOFTEST of the stiffest where waves feed no position back
    and the box begins without a spring (they hold the scene ever more loosely; none at all is proved by itself). The
    bound leaves room for rounding.
    """
    proofs = []
    for part in _parts(values, box):
        loop = held_loop(values, part)
        proofs.append(_prove(loop, part, walls, work - sum(proof.work for proof in proofs)))
        if not proofs[-1].holds:
            break
    hands = (np.concatenate([getattr(proof, name) for proof in proofs]) for name in ("unstable", "hardest"))
    return Proof(all(proof.holds for proof in proofs), *hands, sum(proof.work for proof in proofs))


def _parts(values, box):
    """The box, or its hands with a spring and those without where the frame is another."""
    low, high = box.stiffness
    if low > 0 or high == 0:
        return [box]
    if held_loop(values, box).kind == "plain":
        return [box]
    return [HandBox(box.mass, box.damping, (SOFTEST * high, high)), HandBox(box.mass, box.damping, (0.0, 0.0))]


def _prove(loop: HeldLoop, box: HandBox, walls, work) -> Proof:
    ends = [loop.points(np.append(end, wall)) for end, wall in zip((box.low, box.high), walls, strict=True)]
    low, high = np.minimum(*ends)[None], np.maximum(*ends)[None]
    last, done, cost = low, 0, round(loop.order**1.5)
    if not loop.wall_is_regular(walls):
        return Proof(False, NOTHING, NOTHING, 0)
    while len(low) and done + len(low) * cost <= work:
        done += len(low) * cost
        found = [_judged(loop, low[i : i + CHUNK], high[i : i + CHUNK]) for i in range(0, len(low), CHUNK)]
        radius, proved, split = (np.concatenate(parts) for parts in zip(*found, strict=True))
        worst = np.argsort(-radius, kind="stable")
        if radius[worst[0]] > 1 + UNSTABLE:
            worst = worst[:TOLD][radius[worst[:TOLD]] > 1 + UNSTABLE]
            return Proof(False, _hands(loop, box, (low[worst] + high[worst]) / 2), NOTHING, done)
        ends = (low[worst, WALL] == low[:, WALL].min(), high[worst, WALL] == high[:, WALL].max(), slice(None))
        worst = np.concatenate([worst[end][:TOLD] for end in ends])
        last = (low[worst] + high[worst]) / 2
        low, high = _halved(low[~proved], high[~proved], split[~proved])
    return Proof(not len(low), NOTHING, _hands(loop, box, last), done)


def _hands(loop, box, points):
    return np.clip(loop.hands_and_walls(points)[0], box.low, box.high)


def _judged(loop, low, high):
    """Spectral radius in the middle, whether the piece is proved, and the parameter to cut it across."""
    with np.errstate(all="ignore"):  # what overflows is not proved
        frame, modes = frame_over(loop, low, high)
        proved, split = excluded(frame)
        bounded = np.isfinite(frame.rest).all((-1, -2))
        split = np.where(bounded, split, np.argmax(high / low, axis=-1))
    return np.where(np.isfinite(modes).all(-1), np.abs(1 + modes).max(-1), np.inf), proved, split


def _halved(low, high, split):
    """Both halves of every piece, even in the logarithm where it spans more than a factor of four."""
    at = np.arange(len(low))
    a, b = low[at, split], high[at, split]
    wide = np.where(a > 0, np.sqrt(np.maximum(a * b, 0)), b / 16)
    first, second = high.copy(), low.copy()
    first[at, split] = second[at, split] = np.where(b > 4 * np.maximum(a, 0), wide, (a + b) / 2)
    return np.concatenate([low, second]), np.concatenate([first, high])
