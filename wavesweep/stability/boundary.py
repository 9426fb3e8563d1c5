"""The stability boundary as a curve on the unit circle: point by point, polished to rounding, with its rounding errors.

The wall's characteristic equation is `one = K_VE x + B_VE v` at each point: `1 = K_VE G_x + B_VE G_v`, multiplied by w if the
loop integrates.
"""

from dataclasses import dataclass

import numpy as np

from wavesweep.monodromy.circle import inverse, on_circle, refined
from wavesweep.monodromy.cut import ADVANCE, OFFSET, Cut, V

K_VE, B_VE = "K_VE", "B_VE"
ROUNDS = 12  # Newton from a seed of 8 digits needs 2; from the fallback's arcs a few more
LAST_STEP = 1e-9  # of the distance to the nearer end of the circle, a step after which an angle is exact: errors are its square
NEAREST_END = 1e-3  # of that distance, what a step leaves of it at least
NEAR = 1e-8  # of a state, by which it may change from where an inverse was taken for one refinement to make up for it


@dataclass(frozen=True, slots=True)
class Terms:
    """The terms of `one = K_VE*x + B_VE*v` at points of the circle, scaled alike; each an array over the points."""

    one: np.ndarray
    x: np.ndarray
    v: np.ndarray

    def along(self, name: str):
        """Return (term of the parameter that is solved for, term of the one that is fixed)."""
        return (self.x, self.v) if name == K_VE else (self.v, self.x)


def terms_of(cut: Cut, w, G, one=1.0) -> Terms:
    """Return the terms from the rows V, ADVANCE, OFFSET of G at `w = z - 1`; arrays of sizes give the sizes of terms.

    one: a factor that the rows of G have as well.
    """
    if not cut.integrates:
        return Terms(one + 0 * G[..., V], G[..., OFFSET], G[..., V])
    return Terms(w * one + 0 * G[..., V], G[..., ADVANCE] + w * G[..., OFFSET], w * G[..., V])


def _slopes_of(cut, w, G, dG) -> Terms:
    """Return the derivatives of the terms by w."""
    if not cut.integrates:
        return Terms(0.0, dG[..., OFFSET], dG[..., V])
    return Terms(1.0, dG[..., ADVANCE] + w * dG[..., OFFSET] + G[..., OFFSET], w * dG[..., V] + G[..., V])


def terms(cut: Cut, w) -> Terms:
    """Return the terms of the characteristic equation at `w = z - 1`; cut: one loop per point (leading axes as `w`).

    Accuracy: a refined solve in delta form, so relative to the distance of the nearest pole, even if many poles crowd at z = 1.
    """
    return terms_and_inverse(cut, w)[0]


def terms_and_inverse(cut: Cut, w) -> tuple[Terms, np.ndarray]:
    """Return the terms of the characteristic equation (see `terms`), and the inverse of `w I - E` for `end_errors`."""
    w = np.asarray(w)
    _, back, state = _states(cut, w)
    return terms_of(cut, w, read(cut.C, state) + cut.D[..., 0]), back


def _states(cut, w, back=None):
    """Return `w I - E`, its inverse, and the states for a unit force.

    back: the inverse at a point so near that one refinement corrects for the distance; it is returned in place of the inverse.
    """
    A = _shifted(cut, w)
    back = inverse(A) if back is None else back
    return A, back, refined(A, back, cut.B + 0 * A[..., :1])


def _shifted(cut, w):
    """Return `w I - E`."""
    w, n = np.asarray(w), cut.E.shape[-1]
    A = np.empty((*np.broadcast_shapes(w.shape, cut.E.shape[:-2]), n, n), np.result_type(w, cut.E))
    np.negative(cut.E, out=A)
    A.reshape(*A.shape[:-2], n * n)[..., :: n + 1] += w[..., None]
    return A


def read(C, state):
    """Return `C state`, `(..., 3)`, added up state by state.

    BLAS, and numpy's own sums, round differently in a batch of another size, and a sweep's bytes must not depend on its chunks.
    """
    total = C[..., :, 0] * state[..., 0, :]
    for k in range(1, C.shape[-1]):
        total = total + C[..., :, k] * state[..., k, :]
    return total


def residual(t: Terms, K, B, least=0.0):
    """Return the relative residual of the characteristic equation: 0 exact, 1 meaningless; least: size of a further term."""
    parts = np.abs(t.one) + np.abs(K * t.x) + np.abs(B * t.v) + least
    return np.abs(t.one - K * t.x - B * t.v) / parts


@np.errstate(divide="ignore", invalid="ignore", over="ignore")
def polish(cut: Cut, along: str, fixed, theta, scale):
    """Solve `Im K(theta) = 0`, `K = (one - fixed*other)/solved`, by Newton's method from the seeds theta.

    cut: one loop per seed. fixed: the other wall parameter, per seed. scale: the largest value of interest; if K is beyond it,
    Newton's method is applied to 1/K, since a crossing at a very large K lies next to a pole of K. Returns (theta, value,
    converged, inverse): the angle (rad per frame), the wall parameter there, whether Newton's last step is at rounding, and the
    inverse of `w I - E` there or next to it, `(seeds, n, n)`.
    Accuracy: value good to about 1e-13 relative, less if the curve crosses the real axis at a grazing angle.
    """
    theta, value, inverses = theta.astype(float), np.full(theta.shape, np.nan), None
    (done, far_off), active = np.zeros((2, *theta.shape), bool), np.arange(theta.size)
    for _ in range(ROUNDS):
        if not active.size and inverses is not None:
            break
        some = cut if active.size == theta.size else cut.at(active)
        now, slope, back, speed = _value_and_slope(some, along, fixed[active], theta[active])
        far = np.abs(now) > scale
        now, slope = np.where(far, 1 / now, now), np.where(far, -slope / now**2, slope)
        step = -now.imag / slope.imag
        step = np.where(np.isfinite(step), step, 0.0)
        size = np.abs(step)
        small = size <= LAST_STEP * np.minimum(theta[active], np.pi - theta[active])
        least, most = NEAREST_END * theta[active], np.pi - NEAREST_END * (np.pi - theta[active])
        theta[active] = np.clip(theta[active] + step, least, most)
        estimate = now.real + step * slope.real  # its error is the square of the step
        value[active] = np.where(far, 1 / estimate, estimate)
        done[active] = small & (slope.imag != 0)
        if inverses is None:
            inverses = back
        else:
            inverses[active] = back
        far_off[active] = size * speed > NEAR
        active = active[~small]
    moved = np.flatnonzero(far_off)
    if moved.size:  # by more than what one refinement makes up for
        inverses[moved] = inverse(_shifted(cut.at(moved), on_circle(theta[moved])))
    return theta, value, done, inverses


def _value_and_slope(cut, along, fixed, theta):
    """Return K(theta) and dK/dtheta, complex; the inverse there; and the relative change of the states per angle."""
    w = on_circle(theta)
    _, back, state = _states(cut, w)
    turn = back @ state
    G, dG = read(cut.C, state) + cut.D[..., 0], -read(cut.C, turn)
    speed = np.fmax.reduce((np.abs(turn) / np.abs(state))[..., 0], axis=-1, initial=0)
    return *_solved(terms_of(cut, w, G), _slopes_of(cut, w, G, dG), along, fixed, w), back, speed


def _solved(t, slopes, along, fixed, w):
    """Return the wall parameter that solves the equation, and its derivative by theta, complex."""
    (solved, other), (d_solved, d_other) = t.along(along), slopes.along(along)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = (t.one - fixed * other) / solved
        return value, (slopes.one - fixed * d_other - value * d_solved) / solved * (1j * (1 + w))


def end_errors(cut: Cut, along: str, fixed, value, w, on_axis, back=None, least: float = 0.0):
    """Return the residuals of the characteristic equation at crossings, and two effects of rounding.

    The residual is relative to the equation's terms and to that of the value `least`, since an end next to zero, as a mode
    without damping has one, has few digits of itself. The second number bounds the change of the wall parameter by the errors
    of the loop's entries. The third is the residual that a rounding of every entry leaves.

    cut: one loop per crossing. value: the wall parameter. w: `exp(j theta) - 1` there. on_axis: whether the crossing is held at
    z = 1 or -1. back: inverses of `w I - E` there or next to it. To first order an entry's change reaches `G` as `C R dE R B`,
    R the resolvent, and `K = (one - fixed*other)/solved` with it; if K grazes the real axis, the angle changes by
    `Im dK/Im K'`, which moves K by `Re K'` times as much.
    """
    G, rounding, error, dG = _with_errors(cut, w, back)
    t, slopes = terms_of(cut, w, G), _slopes_of(cut, w, G, dG)
    (solved, other), *errors = (each.along(along) for each in (t, *(terms_of(cut, np.abs(w), e) for e in (error, rounding))))
    with np.errstate(all="ignore"):
        exact, turned = _solved(t, slopes, along, fixed, w)
        left, usual = (np.abs(fixed) * of_other + np.abs(exact) * of_solved for of_solved, of_other in errors)
        grazing = np.where(on_axis, 1.0, np.abs(turned) / np.abs(turned.imag))
        more = least * np.abs(solved)
        size = np.abs(t.one) + np.abs(fixed * other) + np.abs(exact * solved) + more
        size = np.where(size > 0, size, 1)  # at K_VE = 0 the equation is 0 = 0 by structure
        moved = left / np.abs(solved) * grazing
        return residual(t, *((value, fixed) if along == K_VE else (fixed, value)), more), moved, usual / size


def _with_errors(cut, w, back):
    """Return rows V, ADVANCE, OFFSET of G at w, their errors, and their derivative by w.

    The first errors are those of a rounding of every entry and of the solve itself, the second ones those of the bounds on the
    errors of the entries, and of the solve.
    """
    A, back, state = _states(cut, w, back)
    left = cut.C @ back
    change = (cut.C - left @ A) @ back
    # Next to a pole of the loop itself, as a mode without damping is one, the change would be rounding of another scale.
    left = left + np.where(np.abs(change).max(-1, keepdims=True) < np.abs(left).max(-1, keepdims=True), change, 0.0)
    size = np.abs(state)
    reach, missed = np.abs(left), np.abs(left) @ np.abs(cut.B - A @ state)
    far = reach @ (np.abs(cut.E) @ size + np.abs(cut.B)) + np.abs(cut.C) @ size + np.abs(cut.D)
    rounding = np.finfo(float).eps * far + missed
    error = rounding + reach @ (cut.dE @ size + cut.dB) + cut.dC @ size + cut.dD
    return (cut.C @ state + cut.D)[..., 0], rounding[..., 0], error[..., 0], -(left @ state)[..., 0]
