"""The four matrices of a linear map with states, which loops, frames and channels share."""

from typing import NamedTuple

import numpy as np


class StateSpace(NamedTuple):
    """`x[k+1] - x[k] = E x[k] + B u[k]`, `y[k] = C x[k] + D u[k]`, `(..., n, n)`, `(..., n, m)`,
    `(..., p, n)`, `(..., p, m)`; or bounds on the errors of their entries, or the sizes of the
    terms of these. Where numbers may be of every kind, lists of rows."""

    E: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
