"""Devices of several axes in their pose: what the motions of motors and links for a motion of the hand store and take.

Of each, (axes, mass, damping, stiffness) at the hand: matrices of M a + D v + K x = f. Angles stand as their cosine and sine,
which are roots of lengths.
"""

from fractions import Fraction

from .loops import diagonal, dot, identity, outer, plus, times, transposed

DEFAULTS = {
    "five-bar": {
        "x": "0", "y": "0.15", "base": "0.06", "l1": "0.1", "l2": "0.13", "motor_inertia": "2e-5", "m1": "0.05", "m2": "0.04",
        "handle": "0.03", "damping": "5e-4",
    },
    "pantograph": {
        "x": "0.05", "y": "0.17", "l1": "0.12", "l2": "0.14", "motor1": "4e-5", "motor2": "4e-5", "m1": "0.06", "m2": "0.05",
        "handle": "0.03", "damping1": "5e-4", "damping2": "5e-4",
    },
    "delta": {
        "x": "0", "y": "0", "z": "0.13", "base": "0.05", "platform": "0.025", "l1": "0.07", "l2": "0.14",
        "motor_inertia": "2e-5", "m1": "0.03", "m2": "0.02", "handle": "0.06", "damping": "3e-4",
    },
}  # fmt: skip
AXES = {"five-bar": "xy", "pantograph": "xy", "delta": "xyz"}


def parts_of(kind: str, value, arithmetic) -> tuple:
    """value: a key's number, of the key and its default."""
    of = {key: value(key, Fraction(default)) for key, default in DEFAULTS[kind].items()}
    axes = list(AXES[kind])
    mass, damping, stiffness = (
        diagonal([value(f"hand_{key}_{axis}", 0) for axis in axes])
        for key in ("mass", "damping", "stiffness")
    )
    mass = plus(mass, times(of["handle"], identity(len(axes))))
    moving = {"five-bar": _five_bar, "pantograph": _pantograph, "delta": _delta}[kind]
    for stored, taken in moving(of, value, arithmetic):
        mass = plus(mass, stored)
        damping = plus(damping, taken)
    return axes, mass, damping, stiffness


def _inner(of, value, motor: str):
    """The inertia of a motor with its inner link."""
    mass, centre, inertia = _link("1", of, value)
    return of[motor] + inertia + mass * centre * centre


def _link(which: str, of, value):
    """(mass, place of its centre, inertia about that) of a link."""
    length = of[f"l{which}"]
    mass = of[f"m{which}"]
    return mass, value(f"c{which}", length / 2), value(f"I{which}", mass * length * length / 12)


def _five_bar(of, value, arithmetic):
    """Motors are at (+-base/2, 0), elbows outwards."""
    mass2, centre2, inertia2 = _link("2", of, value)
    for side in (-1, 1):
        reach = [of["x"] - side * of["base"] / 2, of["y"]]
        motor, link, middle = _two_links(reach, -side, of["l1"], of["l2"], centre2, arithmetic)
        inner = _inner(of, value, "motor_inertia")
        stored = plus(times(inner, outer(motor, motor)), times(inertia2, outer(link, link)))
        yield plus(stored, times(mass2, _square(middle))), times(of["damping"], outer(motor, motor))


def _pantograph(of, value, arithmetic):
    """Both motors at (0, 0): the first turns the inner link, the second the outer one, whose angle is its own."""
    mass2, centre2, inertia2 = _link("2", of, value)
    first, second, middle = _two_links(
        [of["x"], of["y"]], -1, of["l1"], of["l2"], centre2, arithmetic
    )
    inner = _inner(of, value, "motor1")
    yield times(inner, outer(first, first)), times(of["damping1"], outer(first, first))
    yield times(mass2, _square(middle)), times(of["damping2"], outer(second, second))
    yield times(of["motor2"] + inertia2, outer(second, second)), times(0, outer(second, second))


def _delta(of, value, arithmetic):
    """Motors at `base` from the centre, 120 degrees apart, whose arms swing in planes through the axis z, elbows outwards.

    The rods are thin and alike all along: of ends with velocities a and b they have the energy m (aa + ab + bb)/6.
    """
    l1 = of["l1"]
    half_root = arithmetic.sqrt(arithmetic.number(3)) / 2
    for away in ([1, 0, 0], [Fraction(-1, 2), half_root, 0], [Fraction(-1, 2), -half_root, 0]):
        joint = [of["x"], of["y"], of["z"]]  # from the motor
        for axis in range(3):
            joint[axis] = joint[axis] + (of["platform"] - of["base"]) * away[axis]
        ahead = dot(joint, away)
        z = of["z"]
        # |joint - l1 (away cos q + up sin q)| = l2, or ahead cos q + z sin q = half
        half = (dot(joint, joint) + l1 * l1 - of["l2"] * of["l2"]) / (2 * l1)
        far = ahead * ahead + z * z
        rest = arithmetic.sqrt(far - half * half)
        cosine = (half * ahead + rest * z) / far
        sine = (half * z - rest * ahead) / far
        arm = [l1 * cosine * away[0], l1 * cosine * away[1], l1 * sine]
        rod = [joint[axis] - arm[axis] for axis in range(3)]
        of_q = [-l1 * sine * away[0], -l1 * sine * away[1], l1 * cosine]
        turned = dot(rod, of_q)
        # q' for a motion of the hand: a rod keeps its length
        motor = [entry / turned for entry in rod]
        elbow = outer(of_q, motor)
        rods = plus(_square(elbow), times(Fraction(1, 2), plus(transposed(elbow), elbow)))
        stored = times(of["m2"] / 3, plus(rods, identity(3)))
        inner = _inner(of, value, "motor_inertia")
        yield (
            plus(stored, times(inner, outer(motor, motor))),
            times(of["damping"], outer(motor, motor)),
        )


def _two_links(reach, side, l1, l2, c2, arithmetic):
    """For a motion of the hand at `reach`: the turns of both links, and the motion of a point at c2 of the outer one.

    The hand is at the elbow plus the outer link, so its velocity is that of both links:
    l1 q' (-sin q, cos q) + l2 a' (-sin a, cos a). The elbow lies to the left of the way to the hand if `side` is 1.
    """
    x, y = reach
    far = x * x + y * y
    radial = (l1 * l1 + far - l2 * l2) / (2 * far)
    aside = side * arithmetic.sqrt(l1 * l1 / far - radial * radial)
    elbow = [radial * x - aside * y, radial * y + aside * x]
    of_q = [-elbow[1], elbow[0]]  # motion of the elbow for q' = 1
    of_a = [-(y - elbow[1]), x - elbow[0]]  # of the hand for a' = 1
    size = of_q[0] * of_a[1] - of_q[1] * of_a[0]
    inner_turn = [of_a[1] / size, -of_a[0] / size]
    outer_turn = [-of_q[1] / size, of_q[0] / size]
    middle = plus(outer(of_q, inner_turn), times(c2 / l2, outer(of_a, outer_turn)))
    return inner_turn, outer_turn, middle


def _square(matrix):
    columns = transposed(matrix)
    return [[dot(column, second) for second in columns] for column in columns]
