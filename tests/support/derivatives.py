"""Derivatives of ends of intervals by central differences of the loop in 50 digits, and the ends themselves."""

from support.exact import frame, mp, number, response

STEP = mp.mpf(10) ** -13  # relative; central differences in 50 digits keep 24 of them
SMALL = mp.mpf(10) ** -20
FREQUENCY = mp.mpf(10) ** -9  # Hz, where the impedance is that at rest to 1e-18
PATHS = {"K_VE": "environment.K_VE", "B_VE": "environment.B_VE", "b": "controller.b", "Kp": "controller.Kp"}
PATHS |= {"K_LM": "local_model.K_LM", "B_LM": "local_model.B_LM"}


def end_near(values, along, p, omega):
    """The value of the number at the path `along` near p with an eigenvalue of this frequency (rad/s) on the unit circle."""
    theta = number(omega) * values["rates.ratio"] / number(values["rates.fast_hz"])
    real = theta == 0 or abs(theta - mp.pi) < 1e-9
    if along == PATHS["K_VE"]:  # the wall is what remains of the equation, and the loop is lifted once
        whole = frame(values)

        def wall(theta):
            return whole.value_at(theta, "K_VE", values["environment.B_VE"])

        return wall(mp.pi if real else newton(lambda theta: [wall(theta).imag], [theta])[0]).real

    def miss(p, theta):
        changed = values | {along: p}
        found = frame(changed).value_at(theta, "K_VE", changed["environment.B_VE"])
        return found - changed["environment.K_VE"]

    if real:
        angle = mp.pi if theta else mp.mpf(0)
        return newton(lambda p: [miss(p, angle).real], [number(p)])[0]

    def both(p, theta):
        found = miss(p, theta)
        return [found.real, found.imag]

    return newton(both, [number(p), theta])[0]


def newton(function, point):
    """A root near a point: each step, with slopes from differences of 1e-20, adds twenty digits."""
    for _ in range(8):
        here = function(*point)
        slopes = mp.matrix(len(point), len(point))
        for j, x in enumerate(point):
            step = x * SMALL
            there = function(*point[:j], x + step, *point[j + 1 :])
            for i in range(len(point)):
                slopes[i, j] = (there[i] - here[i]) / step
        move = mp.lu_solve(slopes, mp.matrix(here))
        point = [x - dx for x, dx in zip(point, move, strict=True)]
        if max(abs(dx / x) for x, dx in zip(point, move, strict=True)) < mp.mpf(10) ** -40:
            return point
    raise AssertionError("Newton's method did not settle")


def elasticity(values, along, p, omega, path):
    """d ln end/d ln number by central differences. values: flat keys; along, path: paths of the axis and of the number."""
    fast = path == "rates.fast_hz"
    ends = []
    for sign in (1, -1):
        factor = 1 + sign * STEP
        start = end_near(values, along, p, omega) if not ends else ends[0]
        changed = values | {path: number(values[path]) * factor}
        ends.append(end_near(changed, along, start, omega * (factor if fast else 1)))
    return (mp.log(ends[0]) - mp.log(ends[1])) / (2 * STEP)


def felt_elasticity(values, along, p, path, of_end):
    """d ln felt/d ln number of the stiffness felt at the end p; of_end: d ln end/d ln number."""

    def felt(change):
        changed = values | {path: number(values[path]) * (1 + change)}
        changed[along] = number(p) * (1 + of_end * change)
        return response(changed, FREQUENCY)[1].real

    return (mp.log(felt(STEP)) - mp.log(felt(-STEP))) / (2 * STEP)
