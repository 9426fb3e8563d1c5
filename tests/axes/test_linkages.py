"""The mass and the damping of linkages at their hands, against kinematics by angles and sums over points of the links."""

from itertools import product

import numpy as np
import pytest

from wavesweep.engine._drawing.mass_matrix import at_axes
from wavesweep.engine._loops.values import keys_with, numbers_of
from wavesweep.engine.keys import Leaf, Place
from wavesweep.program.spec import load
from wavesweep.program.spec.shipped_classes import with_classes

STEP = 1e-5  # m, of central differences of second order: a relative error of about 1e-7
GAUSS = np.polynomial.legendre.leggauss(2)  # exact for the squares of velocities along a rod


def at_hand(kind, axes, numbers):
    """Mass, damping and stiffness of a linkage at its hand."""
    spec = load(
        {
            "rates": {"tick_hz": 1000},
            "block": {"device": {"type": kind, **numbers}},
            "wire": {f"device.f{axis}": f"hand_{axis}" for axis in axes},
            "ports": {"inputs": {f"push_{axis}": f"hand_{axis}" for axis in axes}},
        }
    )
    known = numbers_of(spec.values)
    (block,) = spec.drawing.blocks
    keys = keys_with(block, lambda tree: tree.values(known))
    return [np.array(at_axes(keys, name), float) for name in ("mass", "damping", "stiffness")]


def planar_arm(hand, motor, side, n):
    """Angles of an arm, and points of its links with their masses; side: of the elbow."""
    d = hand - motor
    r = np.hypot(*d)
    fold = np.arccos((n["l1"] ** 2 + r**2 - n["l2"] ** 2) / (2 * n["l1"] * r))
    first = np.arctan2(d[1], d[0]) + side * fold
    elbow = motor + n["l1"] * np.array([np.cos(first), np.sin(first)])
    second = np.arctan2(*(hand - elbow)[::-1])
    points = []
    for start, angle, m, length in ((motor, first, n["m1"], n["l1"]), (elbow, second, n["m2"], n["l2"])):
        points += [
            (share * m / 2, start + (1 + at) / 2 * length * np.array([np.cos(angle), np.sin(angle)]))
            for at, share in zip(*GAUSS, strict=True)
        ]
    return (first, second), points


def spatial_arm(hand, direction, n):
    """The same of an arm of a delta: the angle of its motor, and points of the arm and of its rods."""
    u = np.array([np.cos(direction), np.sin(direction), 0.0])
    joint, motor, up = hand + n["platform"] * u, n["base"] * u, np.array([0.0, 0.0, 1.0])
    d = joint - motor
    X, Z, Y = d @ u, d @ up, d @ np.cross(up, u)
    r = np.hypot(X, Z)
    angle = np.arctan2(Z, X) - np.arccos((n["l1"] ** 2 + r**2 + Y**2 - n["l2"] ** 2) / (2 * n["l1"] * r))
    knee = motor + n["l1"] * (np.cos(angle) * u + np.sin(angle) * up)
    points = []
    for m, start, end in ((n["m1"], motor, knee), (n["m2"], knee, joint)):
        points += [(share * m / 2, start + (1 + at) / 2 * (end - start)) for at, share in zip(*GAUSS, strict=True)]
    return (angle,), points


def five_bar(hand, n):
    right, left = (planar_arm(hand, np.array([side * n["base"] / 2, 0.0]), -side, n) for side in (1, -1))
    inertias, dampings = (n["motor_inertia"], 0.0) * 2, (n["damping"], 0.0) * 2
    return right[0] + left[0], right[1] + left[1], inertias, dampings


def pantograph(hand, n):
    angles, points = planar_arm(hand, np.zeros(2), -1, n)
    return angles, points, (n["motor1"], n["motor2"]), (n["damping1"], n["damping2"])


def delta(hand, n):
    arms = [spatial_arm(hand, direction, n) for direction in 2 * np.pi / 3 * np.arange(3)]
    angles, points = (sum((arm[i] for arm in arms), type(arms[0][i])()) for i in (0, 1))
    return angles, points, (n["motor_inertia"],) * 3, (n["damping"],) * 3


LINKAGES = {"five-bar": (five_bar, "xy"), "pantograph": (pantograph, "xy"), "delta": (delta, "xyz")}


def drawn(kind, seed):
    """Numbers of a linkage, its pose within reach."""
    rng = np.random.default_rng(seed)
    n = {name: float(rng.uniform(0.01, 0.1)) for name in ("m1", "m2", "handle")}
    n |= {"l1": rng.uniform(0.06, 0.12), "l2": rng.uniform(0.12, 0.15), "x": rng.uniform(-0.03, 0.03)}
    more = {
        "five-bar": {"y": (0.09, 0.15), "base": (0.0, 0.08), "motor_inertia": (0, 1e-4), "damping": (0, 1e-3)},
        "pantograph": {"y": (0.09, 0.15), **{f"{a}{i}": (0, 1e-4) for a, i in product(("motor", "damping"), "12")}},
        "delta": {
            "y": (-0.03, 0.03),
            "z": (0.1, 0.13),
            "base": (0.04, 0.06),
            "platform": (0.02, 0.03),
            "motor_inertia": (0, 1e-4),
            "damping": (0, 1e-3),
        },
    }[kind]
    hand = {f"hand_{what}_{axis}": (0, 1) for what, axis in product(("mass", "damping", "stiffness"), LINKAGES[kind][1])}
    return {name: float(value) for name, value in n.items()} | {
        name: float(rng.uniform(*ends)) for name, ends in (more | hand).items()
    }


@pytest.mark.sample(3)
@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("kind", LINKAGES)
def test_the_matrices_at_the_hand_are_those_of_its_links(kind, seed):
    linkage, axes = LINKAGES[kind]
    n = drawn(kind, seed)
    M, D, K = at_hand(kind, axes, n)
    hand = np.array([n[axis] for axis in axes])
    turned, moved = [], []
    for step in STEP * np.eye(len(axes)):
        ahead, behind = linkage(hand + step, n), linkage(hand - step, n)
        turned.append((np.array(ahead[0]) - behind[0]) / (2 * STEP))
        moved.append([(a[1] - b[1]) / (2 * STEP) for a, b in zip(ahead[1], behind[1], strict=True)])
    turned, moved = np.array(turned), np.array(moved)  # (axes, angles), (axes, points, axes of the world)
    _, points, inertias, dampings = linkage(hand, n)
    masses = np.array([m for m, _ in points])
    own = {what: np.diag([n[f"hand_{what}_{axis}"] for axis in axes]) for what in ("mass", "damping", "stiffness")}
    expected = np.einsum("p,ipk,jpk->ij", masses, moved, moved) + turned @ np.diag(inertias) @ turned.T
    expected += n["handle"] * np.eye(len(axes)) + own["mass"]
    assert np.allclose(M, expected, rtol=1e-5, atol=1e-7 * np.abs(expected).max())
    expected = turned @ np.diag(dampings) @ turned.T + own["damping"]
    assert np.allclose(D, expected, rtol=1e-5, atol=1e-7 * np.abs(expected).max())
    assert np.array_equal(K, own["stiffness"])


def test_classes_are_added_in_the_order_in_which_blocks_name_them():
    names = ["wall-3d", "delta", "wall", "pantograph", "five-bar"]
    leaves = {("block", f"b{i}", "type"): Leaf(name, Place()) for i, name in enumerate(names)}
    added = [path[1] for path in with_classes(leaves) if path[0] == "type"]
    assert list(dict.fromkeys(added)) == names
