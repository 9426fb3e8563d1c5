"""Values over a band of frequencies, from pieces on which no resonance may hide between the nodes.

A function of the logarithm of the frequency is a polynomial through its values at the nodes of a
piece if its last Legendre coefficients are small. They are small as well if a pole lies next to a
zero, nearer than any node does. But the poles of a response are known: the eigenvalues of the
frame, with images that lie the frame's rate apart. Times `x - p` for each pole p near the piece, a
response has no pole left there. A polynomial through its values is then what it is, and has its
zeros, which the argument principle counts. So a piece is settled only if the ellipse about it has
no zero, and no pole, at which what is wanted is singular. Otherwise it is divided about them, the
finer the nearer.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import legendre

GAUSS_NODES = 24  # Gauss-Legendre nodes of a piece of a band in the logarithm of the frequency
HIGH = 4  # coefficients of a piece that have to be small
# sum of the semi-axes, in half widths, of the ellipse about a piece that has to be clear of them
CLEAR_ELLIPSE = 1.25
ELLIPSE_OF_POLES = 2.5  # the same of that whose poles are divided out
RIM_SAMPLES = 64  # points of the ellipse, between which a value turns by at most
MOST_TURN = np.pi / 2
# in the logarithm of the frequency: how far from real frequencies a zero is taken to be at the
# least
LEAST_DISTANCE = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class BandModes:
    """The modes of loops as complex frequencies (Hz), `(points, modes)`, NaN for none, and the
    rate of their frames (Hz)."""

    frequency: np.ndarray
    rate: np.ndarray

    def some(self, index) -> "BandModes":
        """Those of some points."""
        return BandModes(self.frequency[index], self.rate[index])

    def logarithms(self, top: float) -> np.ndarray:
        """The logarithms of the frequencies and of their images up to a frequency (Hz), on three
        sheets, `(points, any)`."""
        count = int(np.ceil(top / self.rate.min(initial=np.inf))) + 1
        images = self.frequency[:, :, None] + self.rate[:, None, None] * np.arange(
            -count, count + 1
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            sheets = np.log(images)[..., None] + 2j * np.pi * np.array([-1, 0, 1])
        return np.where(np.isfinite(sheets), sheets, np.nan).reshape(len(images), -1)


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """What is wanted at some frequencies, real, `(points, frequencies)`, and whether it is known,
    `(points,)`.

    responses: pairs of a complex function of the frequency at the zeros and poles of which it is singular,
    and of the modes that are the only poles of that.
    """

    wanted: np.ndarray
    sure: np.ndarray
    responses: Sequence[tuple[np.ndarray, BandModes]]


def over_band(
    band: Sequence[float],
    some: np.ndarray,
    sample: Callable[[np.ndarray, np.ndarray], Sampled],
    reduce: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
    filled: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Fill in the values of the points `some` over a band (Hz), and their certificates: found, both
    of all points.

    sample: takes points and frequencies (Hz). reduce: takes the Legendre coefficients of each
    piece, `(points, pieces, GAUSS_NODES)`, and the share of each piece in the band, and gives
    values and whether these are settled.
    """
    ends = np.log(band)
    value, certified = filled

    def look(edges, points):
        pieces = _BandPieces(edges)
        sampled = sample(points, np.exp(pieces.nodes).ravel())
        value[points], settled = reduce(degrees_of(sampled.wanted), np.diff(edges) / np.ptp(ends))
        functions = [_Function(pieces, *response) for response in sampled.responses]
        clear = np.logical_and.reduce([function.clear() for function in functions])
        certified[points] = sampled.sure & settled & clear
        return [
            (points[[row]], row, functions)
            for row in np.flatnonzero(~(settled & clear) & np.isfinite(value[points]))
        ]

    # Pieces of a band, tried in turn before it is divided about zeros and poles.
    for count in (4, 16):
        edges = np.linspace(*ends, count + 1)
        open_ = []
        # Pieces that are looked at together, so that their arrays stay small.
        for batch in np.array_split(some, len(some) * count // 4096 + 1):
            if batch.size:
                open_ += look(edges, batch)
        some = np.array([points[0] for points, *_ in open_], int)
    for _ in range(3):  # rounds of dividing about zeros: the first may see them only roughly
        before = open_
        open_ = []
        for points, row, functions in before:
            singular = [function.singular(row) for function in functions]
            places = np.concatenate(singular)
            if places.size:
                open_ += look(_divided(edges, places), points)
    return value, certified


def _divided(edges, singular):
    """The edges of pieces, with more of them about places in the complex plane, four times finer
    each towards these."""
    away = 2 * np.maximum(np.abs(singular.imag), LEAST_DISTANCE)
    away = away[:, None] * 4.0 ** np.arange(int(np.ceil(np.log2(np.ptp(edges) / away.min()) / 2)))
    cuts = singular.real[:, None] + np.concatenate([-away, away], 1)
    nodes = np.unique(np.concatenate([edges, cuts[(cuts > edges[0]) & (cuts < edges[-1])]]))
    return nodes[np.append(np.diff(nodes) > LEAST_DISTANCE / 4, True)]


class _BandPieces:
    """Pieces of a band in the logarithm of the frequency."""

    def __init__(self, edges) -> None:
        self.middle, self.half = (edges[:-1] + edges[1:]) / 2, np.diff(edges) / 2
        self.nodes = self.middle[:, None] + self.half[:, None] * _nodes()[0]

    @property
    def top(self) -> float:
        """The highest frequency (Hz) of the ellipses whose poles are divided out."""
        return float(
            np.exp((self.middle + self.half * (ELLIPSE_OF_POLES + 1 / ELLIPSE_OF_POLES) / 2).max())
        )


class _Function:
    """A response on pieces, with the poles near these divided out."""

    def __init__(self, pieces, values, modes) -> None:
        self.pieces = pieces
        in_ellipse = (
            modes.logarithms(pieces.top)[:, None, :] - pieces.middle[:, None]
        ) / pieces.half[:, None]
        with np.errstate(invalid="ignore"):
            size = _size(in_ellipse)
            order = np.argsort(size, -1)[
                ..., : int((size < ELLIPSE_OF_POLES).sum(-1).max(initial=0))
            ]
            in_ellipse, size = (
                np.take_along_axis(array, order, -1) for array in (in_ellipse, size)
            )
            self.poles = np.where(size < ELLIPSE_OF_POLES, in_ellipse, np.nan)
            factor = np.where(
                np.isnan(self.poles)[..., None, :],
                1.0,
                _nodes()[0][:, None] - self.poles[..., None, :],
            )
            self.degrees = degrees_of(
                (values.reshape(factor.shape[:-1]) * factor.prod(-1)).reshape(len(values), -1)
            )

    def clear(self):
        """Whether the ellipses have no zero and no pole of each point; False if that
        is not known."""
        rim = self.degrees @ _rim()
        with np.errstate(all="ignore"):
            unseen = (
                np.abs(self.degrees[..., -HIGH:]).max(-1)
                * CLEAR_ELLIPSE**GAUSS_NODES
                / (1 - CLEAR_ELLIPSE / ELLIPSE_OF_POLES)
            )
            turns = np.angle(np.roll(rim, -1, -1) / rim)
            clear = (
                (unseen < np.abs(rim).min(-1) / 2)
                & (np.abs(turns).max(-1) < MOST_TURN)
                & (np.abs(turns.sum(-1)) < np.pi)
            )
            clear &= ~(_size(self.poles) < CLEAR_ELLIPSE).any(-1)
        return clear.all(-1)

    def singular(self, row):
        """The zeros and the poles of a point in the ellipses, in the logarithm of the
        frequency, `(any,)`."""
        singular = []
        pieces = self.pieces.middle, self.pieces.half
        for degrees, poles, middle, half in zip(
            self.degrees[row], self.poles[row], *pieces, strict=True
        ):
            if np.isfinite(degrees).all() and degrees.any():
                roots = np.concatenate([legendre.legroots(degrees), poles])
                # Sum of the semi-axes, in half widths, of the ellipse about those that are divided
                # out.
                singular.append(middle + half * roots[_size(roots) < 1.7])
        return np.concatenate([np.zeros(0, complex), *singular])


def _size(place):
    """The sum of the semi-axes of the ellipse about [-1, 1] that goes through a place."""
    return np.abs(place + np.sqrt(place - 1) * np.sqrt(place + 1))


@cache
def _nodes():
    return legendre.leggauss(GAUSS_NODES)


@cache
def _to_degrees():
    node, weight = _nodes()
    return (
        legendre.legvander(node, GAUSS_NODES - 1) * weight[:, None] * (np.arange(GAUSS_NODES) + 0.5)
    )


@cache
def _rim():
    round_ = CLEAR_ELLIPSE * np.exp(2j * np.pi * np.arange(RIM_SAMPLES) / RIM_SAMPLES)
    return legendre.legvander((round_ + 1 / round_) / 2, GAUSS_NODES - 1).T


def degrees_of(values: np.ndarray) -> np.ndarray:
    """Return the Legendre coefficients of each piece, `(points, pieces, degrees)`, from values at
    its nodes.

    The first is the mean. The highest are small if a function has no features narrower than the
    nodes resolve.
    """
    return values.reshape(len(values), -1, GAUSS_NODES) @ _to_degrees()
