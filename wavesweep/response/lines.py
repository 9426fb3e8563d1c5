"""The frequency of a mode within the frame, of which its eigenvalue tells only an image below half the frame's rate."""

import numpy as np

from wavesweep.response.lifted import Lifted

ALIKE = 1e-3  # distance of an eigenvalue from one that is the same but for rounding
NOTHING = 1e-9  # of the terms of displacements, what is left of them by rounding


def strongest_turns(E, shown, delta) -> int:
    """Return the whole turns k per frame of a mode's strongest line in the position, `angle(1 + delta) + 2 pi k` rad per frame.

    E `(n, n)`: the frame less identity. shown `(ticks, n)`: the displacement in each tick for a state at the frame's start.
    delta: eigenvalue less 1 of the mode. In the frame a mode is `z^(t/T)` times a periodic signal, whose Fourier components
    are its lines (N. M. Wereley, S. R. Hall, Conference on Decision and Control 1990). 0 if nothing of it is seen.
    """
    values, vectors = np.linalg.eig(E)
    at = int(np.argmin(np.abs(values - delta)))
    if abs(values[at] - delta) > ALIKE:  # the mode is a drift, which the frame leaves out
        return 0
    state = vectors[:, at]
    ticks, moved = len(shown), shown @ state
    if np.abs(moved).max() <= NOTHING * (np.abs(shown) @ np.abs(state)).max():  # at rest, as a mode that only drifts
        return 0
    with np.errstate(all="ignore"):
        s = np.log1p(complex(delta)) / ticks
        line = np.fft.fft(moved * np.exp(-s * np.arange(ticks)))
        turns = np.round(np.fft.fftfreq(ticks) * ticks).astype(int)
        size = np.abs(line / np.expm1(s + 2j * np.pi * turns / ticks))
    size = np.where(np.isfinite(size), size, 0.0)
    return int(turns[np.argmax(size)]) if size.max() > 0 else 0


def shown_in_ticks(loop: Lifted) -> tuple[np.ndarray, np.ndarray]:
    """Return the frame less identity of a single loop, and the displacement in each of its ticks for a state at its start."""
    E, shown = loop.frame.E[0], loop.frame.seen[0][..., 0, :, :]
    return E.reshape(E.shape[-2:]), shown.reshape(shown.shape[-2:])
