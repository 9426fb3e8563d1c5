"""Worst-case gain of a drawn loop: the largest singular value of the map from the hand's forces of a frame to its positions."""

import numpy as np

from wavesweep.analysis.response.circle import Circle
from wavesweep.analysis.response.delayed import solved_frame
from wavesweep.analysis.response.dominant import Dominant, Lifted
from wavesweep.analysis.response.drawn import LOST, static_port_response
from wavesweep.analysis.response.port import Port
from wavesweep.analysis.response.steady import GOOD
from wavesweep.lifted.rounding import ROUNDING, frame_errors

MOST_TICKS = 500  # of a frame; the map's memory grows with their square
BLOCK = 2_000_000  # entries of one batch of matrices


def worst_gain_of_port(port: Port, frequency_hz) -> tuple[np.ndarray, np.ndarray]:
    """Return the worst-case gain (m/N) of a port and a bound on its relative error, `(points,)` each; see `worst_gain`.

    A frame that begins at another tick gives a map with the same singular values: the difference of the two is added to the
    bound. Both are NaN if the gain is not known, and for frames of more than MOST_TICKS.
    """
    frequency = np.atleast_1d(np.asarray(frequency_hz, float))
    ticks = port.kind.size
    if ticks > MOST_TICKS:
        return np.full(frequency.size, np.nan), np.full(frequency.size, np.nan)
    points = Circle(frequency, port.rate, ticks)
    with np.errstate(all="ignore"):
        (gain, error), (other, _) = (_gain(lifted_map(each), points) for each in (port, port.turned(max(1, ticks // 2))))
        unbounded = (points.frame == 0) & (port.position is None)
        relative = np.where(unbounded, 0.0, (error + np.abs(gain - other)) / gain)
        if ticks == 1 and not frequency.all():  # the gain is that of the position, which an integrator may hold at rest
            rigid = (frequency == 0) & (static_port_response(port)[0] == 0)
            gain, relative = (np.where(rigid, 0.0, part) for part in (gain, relative))
    unknown = ~(relative < LOST)
    return np.where(unknown | unbounded, np.nan, gain), np.where(unknown, np.nan, relative)


def lifted_map(port: Port) -> Lifted:
    """Return the map from the forces of a frame to the positions at the beginning of its ticks.

    A position that drifts is no state of the port; it is one more state here, the sum of the displacements.
    """
    n, ticks, rough = port.maps[0][0].shape[-1], port.kind.size, port.rough
    state, size = np.zeros((2, n, n + ticks))
    state[:, :n], size[:, :n] = np.eye(n), np.eye(n)
    rows, sizes = np.zeros((2, ticks, n + ticks))
    seen = []  # of each tick: what rounding of it adds to the state after it and to the position read before it, over `rough`
    for tick, kind in enumerate(port.kind.tolist()):
        (E, B, C, D), (of_E, of_B, of_C, of_D) = port.maps[kind], port.sizes[kind]
        reads, of_reads = (C[:1], of_C[:1]) if port.position is None else (port.position, np.abs(port.position))
        rows[tick], sizes[tick] = (reads @ state)[0], (of_reads @ size)[0]
        if port.position is None:
            rows[tick, n + tick], sizes[tick, n + tick] = D[0, 0], of_D[0, 0]
        entries, known = np.maximum(np.abs(np.eye(n) + E), of_E), np.abs(state)
        seen.append((E, reads, entries @ known, (of_reads @ known)[0]))
        state, size = state + E @ state, entries @ size
        state[:, n + tick], size[:, n + tick], seen[-1][2][:, n + tick] = B[:, 0], of_B[:, 0], of_B[:, 0]
        if port.position is None:
            seen[-1][3][n + tick] = of_D[0, 0]
    sizes, size = _less(seen, sizes, size)
    changes, of_terms = ([each[0] for each in parts] for parts in (port.maps, port.sizes))
    frame, dE = frame_errors(port.kind, changes, of_terms)
    if port.position is None:
        summed, of_sum = (np.cumsum(part, axis=0) for part in (rows, sizes))
        rows, sizes = (np.concatenate([np.zeros((1, n + ticks)), part[:-1]]) for part in (summed, of_sum))
        frame, dE, own = np.pad(frame, (0, 1)), np.pad(dE, (0, 1)), (summed[-1], of_sum[-1])
        frame[n, :n], dE[n, :n] = own[0][:n], rough * own[1][:n]
        state, size = np.vstack([state, own[0]]), np.vstack([size, own[1]])
    O, T = rows[:, :n], rows[:, n:]
    dO = rough * sizes[:, :n]
    if port.position is None:
        O, dO = np.hstack([O, np.ones((ticks, 1))]), np.pad(dO, ((0, 0), (0, 1)))
    return Lifted((frame, dE), (O, dO), (state[:, n:], rough * size[:, n:]), (T, rough * sizes[:, n:]))


def _less(seen, sizes, size):
    """Return sizes of the errors of the rows and of the last state, over `Port.rough`, that are no larger than those given.

    Those given are products of the sizes of all ticks, which grow where velocities are differences of positions, although the
    products themselves do not. What rounding of a tick adds to the state is taken through the ticks after it, and added up:
    the state is the sum of these, and no higher order is left out but that of the products, which are rounded in their turn.
    """
    ticks, n = len(seen), len(size)
    later, total = np.concatenate([np.zeros((ticks, n)), np.eye(n)]), np.zeros((ticks + n, size.shape[1]))
    for tick in reversed(range(ticks)):
        E, reads, of_state, of_row = seen[tick]
        total += np.abs(later) @ of_state
        total[tick] += of_row
        later += later @ E
        later[tick] = reads[0]
    found = 2 * total  # since the products that carry it are rounded themselves
    return np.minimum(found[:ticks], sizes), np.minimum(found[ticks:], size)


def _gain(lifted, points):
    """Return the largest singular value and a bound on its error, `(points,)` each.

    It is computed through modes, and from the whole matrix if these do not prove it.
    """
    if not all(np.isfinite(part).all() for pair in (lifted.E, lifted.O, lifted.G) for part in pair):
        size = np.size(points.frame)
        return np.full(size, np.nan), np.full(size, np.inf)
    gain, error = Dominant(lifted).gain(points)
    doubtful = np.flatnonzero(~(error <= GOOD * gain))
    ticks, n = lifted.O[0].shape
    for at in np.array_split(doubtful, -(-doubtful.size * ticks * max(ticks, n) // BLOCK)) if doubtful.size else ():
        gain[at], error[at] = _dense(lifted, points.frame[at][:, None, None])
    return gain, error


def _dense(lifted, w):
    """`_gain` by LAPACK, from equations that are solved at every point."""
    (E, dE), (O, dO), (G, dG), (T, dT) = lifted.E, lifted.O, lifted.G, lifted.T
    X, dX = solved_frame(E, dE, w, G, dG)
    whole, size = O @ X + T, np.abs(O) @ np.abs(X) + np.abs(T)
    off = np.abs(O) @ dX + dO @ np.abs(X) + dT + ROUNDING * size
    error = np.sqrt((off**2).sum((-1, -2)))
    finite = np.isfinite(whole).all((-1, -2)) & np.isfinite(error)
    value = np.linalg.svd(np.where(finite[:, None, None], whole, 0.0), compute_uv=False)[:, 0]
    return np.where(finite, value, np.nan), np.where(finite, error + len(T) * ROUNDING * value, np.inf)
