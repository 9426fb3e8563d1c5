"""Passivity at the hand's port of a drawn loop."""

from dataclasses import replace

import numpy as np

from wavesweep.analysis.passivity.hinf import SOFT, Element, angles, peak_by_levels, then, tick
from wavesweep.analysis.passivity.port import FAINT, SLACK, TOLERANCE, PortMargin
from wavesweep.analysis.response.lifted import Lifted
from wavesweep.analysis.response.port import Port, frame_of_port
from wavesweep.analysis.response.steady import respond
from wavesweep.analysis.spectrum import count_outside, is_stable
from wavesweep.errors import UsageError
from wavesweep.lifted.circle import on_circle, solve
from wavesweep.lifted.periodic import GROWING, in_a_row
from wavesweep.lifted.rounding import CANCELLED, balance, hides, measured_frame

SWEEPS = 12  # over the states, for their units
LONGEST = 600  # ticks; the map of a frame is a matrix of that size
MOST_GROWTH = 1e6  # in a frame, beyond which an unstable loop loses more than SLACK
SURE = 1e-9  # relative error of a response, up to which it says that a margin is known


def drawn_port_margin(port: Port) -> PortMargin:
    """Margin of positive realness of the map from the held force to the displacement in the tick; see `port_margin`.

    Errors: UsageError for a frame of more than LONGEST ticks. Accuracy: 1e-10 of the margin and of the mean eigenvalue;
    NaN for a frame that is not known, and for terms that cancel so far that the response there is not known to SURE.
    """
    M = port.kind.size
    if M > LONGEST:
        raise UsageError(f"expected a frame of at most {LONGEST} ticks for passivity, found {M}")
    given, port = port, _without_drift(_in_even_units(port))
    E, toeplitz, O, G = _lifted(port)
    mean = float(np.mean(np.diagonal(toeplitz)))
    n, unknown = E.shape[-1], np.array([np.nan])
    if not np.isfinite(E).all():
        return PortMargin(unknown, unknown, np.array([mean]), *np.zeros((3, 1), bool))
    stable = np.array([bool(is_stable(E))])
    if _without_digits(E, stable[0]):
        return PortMargin(unknown, unknown, np.array([mean]), stable, *np.zeros((2, 1), bool))

    def smallest(_, theta):
        w = on_circle(theta)[:, None, None]
        with np.errstate(all="ignore"):
            H = toeplitz + O @ solve(w * np.eye(n) - E, np.broadcast_to(G + 0j, (theta.size, *G.shape)))
        H = (H + np.swapaxes(H.conj(), -1, -2)) / 2
        good = np.isfinite(H).all((-1, -2))
        found = np.full(theta.size, np.nan)
        found[good] = np.linalg.eigvalsh(H[good])[:, 0]
        return found

    def met(_, level):
        return angles(_level_frame(port, float(level[0])))

    peak = peak_by_levels(
        lambda owner, theta, _: np.nan_to_num(-smallest(owner, theta), nan=-np.inf),
        lambda owner, level: met(owner, -level),
        1,
        lambda _, level: SLACK * (np.abs(level) + mean),
        SOFT,
    )
    # Beside a peak at rest the response is the same but for rounding, and less well known.
    at_rest = np.where(-smallest(0, np.zeros(1)) >= peak.value - SLACK * (np.abs(peak.value) + mean), 0.0, peak.theta)
    peak, period = replace(peak, theta=at_rest), port.period * M
    margin = np.where(np.isfinite(peak.value) & _known(given, peak.theta / period), -peak.value, np.nan)
    margin = np.where(np.abs(margin) <= FAINT * mean, 0.0, margin)  # which is 0 but for rounding
    omega = np.where(np.isnan(margin), np.nan, peak.theta / period)
    negative = margin < -TOLERANCE * mean
    return PortMargin(margin, omega, np.array([mean]), stable, peak.certified, negative)


def _without_digits(E, stable):
    """Whether an eigenvalue lies on the circle but for rounding, a pole of the map, or an unstable loop grows too much."""
    _, clear = count_outside(E[None])
    return bool(not clear[0] or (not stable and np.abs(E).max(initial=0.0) > MOST_GROWTH))


def _known(port, omega):
    """Whether no terms cancel in or between ticks, or the response at these frequencies (rad/s) keeps its digits even so."""
    changes, sizes = ([each[0] for each in parts] for parts in (port.maps, port.sizes))
    _, growth, cancellation = measured_frame(port.kind, changes)
    if not hides(changes, sizes) and growth <= GROWING and cancellation <= CANCELLED:
        return True
    return respond(Lifted.of(port), omega / (2 * np.pi)).admittance_error <= SURE


def _in_even_units(port):
    """Return the port with states in units that give the entries of its ticks similar sizes.

    States of a transfer function are as different as powers of its poles, and eigenvalues of a level's pencil would be off by
    as much.
    """
    n = port.maps[0][0].shape[-1]
    whole = np.zeros((1, n + 1, n + 1))
    for E, B, C, _ in port.maps:
        whole[0, :n, :n] += np.abs(E)
        whole[0, :n, n:] += np.abs(B)
        whole[0, n:, :n] += np.abs(C[:1])
    units = balance(whole, SWEEPS)[1][0]
    u = units[:n] / units[n]
    maps = tuple((E * (u / u[:, None]), B / u[:, None], C * u, D) for E, B, C, D in port.maps)
    return replace(port, maps=maps, sizes=())


def _without_drift(port):
    """Return the port without the shifts of its states that nothing in the loop opposes and no displacement shows.

    Along a shift r no tick changes anything, `E r = 0` and `C r = 0`, so the coordinates across it suffice. Their frame has no
    eigenvalue 1, with which a response towards 0 Hz would be one rounding error over another.
    """
    if not port.laws:
        return port
    rows = np.concatenate([part for E, _, C, _ in port.maps for part in (E, C[:1])])
    across = np.linalg.svd(rows)[2][: -port.laws]
    return replace(port, laws=0, maps=tuple((across @ E @ across.T, across @ B, C @ across.T, D) for E, B, C, D in port.maps))


def _lifted(port):
    """The frame, and the lifted map `T + O (w - E)^-1 G` from its forces to its displacements."""
    M, n = port.kind.size, port.maps[0][0].shape[-1]
    O, T, state, drive = np.zeros((M, n)), np.zeros((M, M)), np.eye(n), np.zeros((n, M))
    for i, kind in enumerate(port.kind.tolist()):
        E, B, C, D = port.maps[kind]
        O[i], T[i] = (C[:1] @ state)[0], (C[:1] @ drive)[0]
        T[i, i] += D[0, 0]
        state, drive = state + E @ state, drive + E @ drive
        drive[:, i] += B[:, 0]
    return frame_of_port(port), T, O, drive


def _level_frame(port, level) -> Element:
    """One frame with the balance `2 f dx - 2 level f^2`; see `hinf`."""
    maps = []
    for E, B, C, D in port.maps:
        A, zero = np.eye(E.shape[-1]) + E, np.zeros_like(E)
        maps.append(tick(*(part[None] for part in (A, B, zero, C[:1].T, 2 * (D[:1] - level)))))
    return in_a_row(port.kind.tolist(), maps, then)
