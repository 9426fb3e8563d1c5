"""The lines of a mode within the frame: which of all frequencies of an eigenvalue a spectrum of the states shows.

An eigenvalue z of the frame gives the frequency of its mode up to whole turns per frame. In a frame of M ticks the mode is
`z^(i/M)` times a periodic signal, whose Fourier components are its lines (N. M. Wereley, S. R. Hall, Conference on Decision
and Control 1990).
"""

import numpy as np

SECOND = 1 / 3  # of the energy of a mode, beyond which a second line is told
REAL = 1e-6  # rad: so near to 0 or pi the two lines of an eigenvalue and its conjugate are one


def lines_of(moved, s, period) -> np.ndarray:
    """Return the strongest line of modes (Hz), and the second one or NaN, `(..., 2)`, from states in each tick.

    moved: `(..., states, ticks)`. s: logarithm of the eigenvalue, and period of the frame (s), `(...)`. The share of a line is
    its mean share in the energy of each state, whatever their units are. If all of them rest, the line is that of s itself.
    """
    ticks, theta = moved.shape[-1], s.imag[..., None]
    turns, index = np.round(np.fft.fftfreq(ticks) * ticks).astype(int), np.arange(ticks)
    with np.errstate(all="ignore"):
        energy = np.abs(np.fft.fft(moved * np.exp(-s[..., None] * index / ticks)[..., None, :])) ** 2
        share = np.nan_to_num(energy / energy.sum(-1, keepdims=True)).sum(-2)
        share = np.nan_to_num(share / share.sum(-1, keepdims=True))
    half = np.where(np.abs(theta) >= np.pi - REAL, np.sign(theta), 0).astype(int)
    conjugate = np.where((np.abs(theta) <= REAL) | (half != 0), (-turns - half) % ticks, index)
    share = share + np.where(conjugate == index, 0.0, np.take_along_axis(share, conjugate, -1))
    first = np.argmax(share, -1)[..., None]
    rest = np.where((index == first) | (index == np.take_along_axis(conjugate, first, -1)), 0.0, share)
    both = np.concatenate([first, np.argmax(rest, -1)[..., None]], -1)
    hz = np.abs(theta / (2 * np.pi) + turns[both]) / np.asarray(period)[..., None]
    hz[..., 1] = np.where(rest.max(-1) > SECOND, hz[..., 1], np.nan)
    return hz


def share_of_first(observed, ticks, s) -> np.ndarray:
    """Return the share of the line of s itself, as `lines_of` has it, `(..., columns)`; observed: the states, tick by tick,
    `(..., states, columns)`, or an array of all of them."""
    near, total, turn, step = 0.0, 0.0, np.ones_like(s)[..., None, :], np.exp(-s / ticks)[..., None, :]
    if isinstance(observed, np.ndarray):
        moved = observed * np.multiply.accumulate(np.stack([turn, *[step] * (ticks - 1)]))
        near, total = moved.sum(0), (moved.real**2 + moved.imag**2).sum(0)
    else:
        for states in observed:
            moved = states * turn
            near, total, turn = near + moved, total + (moved.real**2 + moved.imag**2), turn * step
    share = (near.real**2 + near.imag**2) / (ticks * total)
    return np.nanmean(share, axis=-2) * np.where(np.abs(s.imag) >= np.pi - REAL, 2, 1)
