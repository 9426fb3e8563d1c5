"""Roots of many functions at once inside brackets."""

import numpy as np

STEPS = 80  # bisection alone needs 52; interpolation usually ends after 8


def bracketed_roots(value, low, high):
    """Chandrupatla's method (Adv. Eng. Software 28, 1997) on every bracket; functions of any size, given by logarithms.

    value(at, x): sign and log of the size of the functions `at` (indices) at x. Returns the roots, to rounding, and whether
    the signs at the bracket's ends differed.
    """
    everything = np.arange(low.size)
    if not everything.size:
        return low.copy(), np.zeros(0, bool)
    a, b = high.astype(float), low.astype(float)
    (sign_a, log_a), (sign_b, log_b) = value(everything, a), value(everything, b)
    valid = sign_a * sign_b <= 0
    scale = np.maximum(log_a, log_b)
    fa, fb = sign_a * np.exp(log_a - scale), sign_b * np.exp(log_b - scale)
    t, open_ = np.full(a.size, 0.5), valid.copy()
    for _ in range(STEPS):
        at = np.flatnonzero(open_)
        if not at.size:
            break
        x = a[at] + t[at] * (b[at] - a[at])
        sign, log = value(at, x)
        with np.errstate(over="ignore"):
            fx = sign * np.exp(log - scale[at])
        same = np.sign(fx) == np.sign(fa[at])
        c, fc = np.where(same, a[at], b[at]), np.where(same, fa[at], fb[at])
        b[at], fb[at] = np.where(same, b[at], a[at]), np.where(same, fb[at], fa[at])
        a[at], fa[at] = x, fx
        t[at] = _next(a[at], fa[at], b[at], fb[at], c, fc)
        width, rounding = np.abs(b[at] - a[at]), np.spacing(np.maximum(np.abs(a[at]), np.abs(b[at])))
        t[at] = np.clip(t[at], rounding / np.maximum(width, rounding), 1 - rounding / np.maximum(width, rounding))
        open_[at] = (fx != 0) & (width > 2 * rounding)
    return np.where(np.abs(fa) <= np.abs(fb), a, b), valid


def _next(a, fa, b, fb, c, fc):
    """Inverse quadratic interpolation where it may be trusted, bisection elsewhere, as a share of the bracket."""
    with np.errstate(all="ignore"):
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        trusted = (phi**2 < xi) & ((1 - phi) ** 2 < 1 - xi)
        share = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
    return np.where(trusted & np.isfinite(share), share, 0.5)
