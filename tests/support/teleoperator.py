"""The teleoperator of sweeps/examples/two-channel.toml by hand, with springs, masses and dampers at both ports."""

import numpy as np
from scipy.linalg import expm, inv

T = 1e-3


def arm(m, d):
    """Matrices of an arm's velocity and position over a tick, under a force that is held."""
    whole = expm(T * np.array([[-d / m, 0, 1 / m], [1, 0, 0], [0, 0, 0]]))
    return whole[:2, :2], whole[:2, 2:]


def termination(rng, parts):
    """A random ladder of springs, masses and dampers, discretised by Tustin's rule, which keeps them passive.

    A, B, C and D from the displacement in a tick (m) to the held force (N).
    """

    def part():
        size = 10 ** rng.uniform(0, 3)
        spring = np.eye(1), np.eye(1), np.array([[size**2]]), np.array([[size**2 / 2]])
        mass = -np.eye(1), np.eye(1), np.array([[-4 * size / 100 / T**2]]), np.array([[2 * size / 100 / T**2]])
        damper = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[size / 100 / T]])
        return (spring, mass, damper)[rng.integers(3)]

    def side_by_side(one, other):
        n, m = len(one[0]), len(other[0])
        A = np.block([[one[0], np.zeros((n, m))], [np.zeros((m, n)), other[0]]])
        return A, np.vstack([one[1], other[1]]), np.hstack([one[2], other[2]]), one[3] + other[3]

    def inverse(one):
        A, B, C, D = one
        return A - B @ inv(D) @ C, B @ inv(D), -inv(D) @ C, inv(D)

    whole = part()
    for _ in range(parts):
        in_series = inverse(side_by_side(inverse(whole), inverse(other := part())))
        whole = side_by_side(whole, other) if rng.random() < 0.6 else in_series
    return whole


FREE = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.zeros((1, 1)))


def radius(ends, *, K, B, g, m, d, n, late):
    """The spectral radius of a frame with a termination at each port; each message of the link is `late` periods late."""
    (A, b), q = arm(m, d), late + 1
    sizes = [4, q, q, *(len(end[0]) for end in ends)]
    arms, there, back, hand, contact = np.split(np.eye(sum(sizes)), np.cumsum(sizes)[:-1])
    _, x, w, y = arms
    sent = np.vstack([x, there[:-1]])  # what the link passes on: it sends back the pull of what has come
    answers = np.vstack([K * (sent[-1] - y) - B * w, back[:-1]])
    sampled = np.vstack([arms, sent, answers, hand, contact])
    pull = K * (there[-1] - y) - B * w
    force = np.array([-g * back[-1], pull])
    moved = np.vstack([A @ arms[:2], A @ arms[2:]])
    into = np.block([[b, 0 * b], [0 * b, b]])
    places = [1, 3]
    own = np.vstack([end[2] @ part for end, part in zip(ends, (hand, contact), strict=True)])
    D = np.diag([end[3][0, 0] for end in ends])
    # displacements Y of the state, for the forces of terminations -D Y - own
    Y = np.linalg.solve(np.eye(2) + into[places] @ D, (moved + into @ (force - own))[places] - np.array([x, y]))
    step = np.vstack([moved + into @ (force - own - D @ Y), there, back, *(
        end[0] @ part + end[1] @ row[None] for end, part, row in zip(ends, (hand, contact), Y, strict=True)
    )])  # fmt: skip
    whole = step @ sampled
    for _ in range(n - 1):
        whole = step @ whole
    return np.abs(np.linalg.eigvals(whole)).max()
