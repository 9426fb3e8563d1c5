"""The loop of the model in ball arithmetic (python-flint): every number with a proved bound on its error.

From the interpreter of the documents, which shares no code with the package. What it gives is the characteristic polynomial
`d - K_VE N_x - B_VE N_v` of a frame, which is linear in the wall.
"""

from dataclasses import dataclass
from itertools import groupby

from flint import acb, acb_mat, arb, arb_mat, fmpq

from support.specs import nested
from wavesweep.checker.reader.controllers import Controller


@dataclass(frozen=True)
class Frame:
    """The loop cut at the wall: `s+ = A s + B F`, and rows over (s, F) of what the wall reads."""

    A: arb_mat
    B: arb_mat
    x: arb_mat
    v: arb_mat
    size: int

    def trace(self, K, B):
        """(numerator, denominator) of the sum of the closed loop's eigenvalues."""
        through, total = arb(1), arb(0)
        for gain, row in ((arb(K), self.x), (arb(B), self.v)):
            through -= gain * row[0, self.size]
            total += gain * (_columns(row, 0, self.size) * self.B)[0, 0]
        return self.A.trace() * through + total, through

    def polynomials(self):
        """(d, N_x, N_v), in z."""
        d, rows = self.A.charpoly(), (self.x, self.v)
        return d, *((self.A - self.B * _columns(row, 0, self.size)).charpoly() - d + d * row[0, self.size] for row in rows)


class Arithmetic:
    """That of the interpreter, in balls; times are fractions, and all keys the doubles that they are."""

    pi = property(lambda _: arb.pi())

    def number(self, value):
        return arb(str(value)) if isinstance(value, str) else arb(value)

    def whole(self, value):
        return round(float(value))

    def exact(self, value):
        return fmpq(*float(value).as_integer_ratio())

    time = least = exact

    def ends(self, value):
        return float(value), float(value)

    def __getattr__(self, name):
        return lambda value: getattr(value, name)()


class Page(Controller):
    """A controller whose wall is an input of its own."""

    def __init__(self, values):
        alone = {"controller.kind": "dc-slow", "rates.ratio": 1, "environment.delay": 0}  # which is what `dc` is
        super().__init__(nested(values | (alone if values["controller.kind"] == "dc" else {})), Arithmetic())
        self.read = ()  # x_tilde and x_dot

    def slow(self, equations, writes, event, x, v, wave):
        super().slow(equations, writes, event, x, v, wave)
        direct = self.kind in {"dc", "dc-slow", "dc-lm"}
        spring = "@slow place" if self.integration == "explicit" else "slow place"
        self.read = (x, v) if direct else (spring, "slow speed")
        equations["slow F"] = {"!wall": 1}

    def fast_pmw_mean(self, equations, writes):
        """Its mean as a sum that begins anew with each frame."""
        self.waves(equations, {"held w": 1})
        equations["u_s"] = {"sum": fmpq(1, round(self.ratio))}
        equations["sum"] = {"@sum": 1, "u_m": 1}
        writes["@sum"] = {"sum": 1}

    def tick(self, come, event, lost=False):
        instant = super().tick(come, event, lost)
        if event is not None and "@sum" in instant.writes:
            instant.writes["@sum"] = {}
        return instant


SEEN = {"x": "x", "v": "v", "v_hat": "v_hat", "f_m": "f_m now", "u_m": "u_m", "v_m": "v_m", "u_h": "u_l", "v_l": "v_l"}
SEEN_BY_THE_WALL = {"u_s": "u_s", "v_s": "slow wave", "x_s": "slow place", "x_dot_s": "slow speed"}


@dataclass(frozen=True)
class Tick:
    """One tick over (states, wall's force, hand's force): the next states, and rows of signals."""

    step: arb_mat
    x: arb_mat
    f_m: arb_mat
    x_tilde: arb_mat
    x_dot: arb_mat
    seen: dict[str, arb_mat]

    @property
    def size(self):
        """Number of states."""
        return self.step.nrows()


def clock(values):
    """(ratio, delay, T) of the loop as it runs."""
    alone = values["controller.kind"] == "dc"
    ratio, delay = (1, 0) if alone else (values["rates.ratio"], values["environment.delay"])
    return ratio, delay, 1 / arb(values["rates.fast_hz"])


def ticks_of(values) -> list[tuple[Tick, int]]:
    """The ticks of a frame in order, each with how often it comes in a row; the first one comes once."""
    page = Page(values)
    schedule = page.schedule()
    kinds = [kind for _, kind in schedule.times if kind != "motor"]
    rows = {kind: _rows(page, values, schedule.kinds[kind]) for kind in set(kinds)}
    states = _remembered([*rows.values()])
    ticks = {kind: _tick(*each, states) for kind, each in rows.items()}
    return [(ticks[kinds[0]], 1)] + [(ticks[kind], len([*some])) for kind, some in groupby(kinds[1:])]


def _rows(page, values, instant):
    """(memory afterwards, signals) of a tick, each a row over memory and inputs."""
    known = _solved(instant.equations)
    after = {name: _put(terms, known) for name, terms in instant.writes.items()}
    place = {name: _put({f"@{name}": 1}, known) for name in "xv"}
    parts, last = [(page.T, after["@f"])], after.get(f"@m{page.late_ticks}")
    if page.late_rest:
        parts = [(page.late_rest, after["@f"]), (page.T - page.late_rest, last)]
        after["@f"] = last
    for part, force in parts:
        rows = dict(zip("xv", device(values, arb(part)), strict=True))
        push = _sum((1, after["@hand"]), (-1, force))
        place = {name: _sum((of_x, place["x"]), (of_v, place["v"]), (of_f, push)) for name, (of_x, of_v, of_f) in rows.items()}
    after |= {f"@{name}": row for name, row in place.items()}
    del after["@hand"]
    slow = "slow F" in known
    names = SEEN | {"F_s": "slow F"} | (SEEN_BY_THE_WALL if slow and page.kind.startswith("pmw") else {})
    seen = {name: known[own] for name, own in names.items() if own in known}
    if page.kind == "pmw-lm":
        seen["v_2"] = _put({"@v_2" if page.local_delay else "lp2 out": 1}, known)
    return after, seen, [_put({name: 1}, known) if slow else {} for name in page.read]


def _sum(*terms):
    """The sum of (factor, row)."""
    total = {}
    for factor, row in terms:
        for name, coefficient in row.items():
            total[name] = total.get(name, arb(0)) + factor * coefficient
    return {name: coefficient for name, coefficient in total.items() if not (coefficient == 0 and coefficient.is_exact())}


def _put(terms, known):
    """A form of an instant in its memory and its inputs alone."""
    return _sum(*((factor, known.get(name, {name: arb(1)})) for name, factor in terms.items()))


def _solved(equations):
    """Its variables in memory and inputs; where some read one another, one of them is guessed and then found."""
    known, left, guesses = {}, dict(equations), {}
    while left:
        ready = [name for name, terms in left.items() if not any(terms[other] and other in left for other in terms)]
        if not ready:
            name = next(iter(left))
            guesses[name], known[name] = left.pop(name), {f"?{name}": arb(1)}
        known |= {name: _put(left.pop(name), known) for name in ready}
    for name, terms in guesses.items():
        row = _put(terms, known)
        found = _sum((1 / (1 - row.pop(f"?{name}", arb(0))), row))
        known = {each: _put(row, {f"?{name}": found}) for each, row in known.items()}
    return known


def _remembered(rows):
    """The memory that a signal depends on sooner or later, in order."""
    found = {name for _, seen, read in rows for row in (*seen.values(), *read) for name in row if name[0] == "@"}
    size = 0
    while len(found) > size:
        size = len(found)
        found |= {name for after, *_ in rows for own in found & after.keys() for name in after[own] if name[0] == "@"}
    return sorted(found)


def _tick(after, seen, read, states) -> Tick:
    columns = [*states, "!wall", "!hand"]
    rows = {name: arb_mat([[row.get(column, arb(0)) for column in columns]]) for name, row in seen.items()}
    x_tilde, x_dot = (arb_mat([[row.get(column, arb(0)) for column in columns]]) for row in read)
    step = [[after.get(name, {name: arb(1)}).get(column, arb(0)) for column in columns] for name in states]
    return Tick(arb_mat(step), rows["x"], rows["f_m"], x_tilde, x_dot, rows)


def frame(values) -> Frame:
    """Multiply the ticks of a frame; its precision is `flint.ctx.prec` bits."""
    (first, _), *others = ticks_of(values)
    n, whole = first.size, first.step
    for tick, times in others:
        whole = _columns(tick.step, 0, n) ** times * whole
    read = (_columns(row, 0, n + 1) for row in (first.x_tilde, first.x_dot))
    return Frame(_columns(whole, 0, n), _columns(whole, n, n + 1), *read, n)


def _columns(matrix, start, stop):
    return arb_mat([row[start:stop] for row in matrix.tolist()])


def device(values, T):
    """Rows of `(x, v)+` over `(x, v, f)`, in closed form: exponentials of large matrices have no useful bound."""
    m, d, k = (
        arb(values[f"device.{a}"]) + arb(values[f"operator.{a}"]) if a != "stiffness" else arb(values["operator.stiffness"])
        for a in ("mass", "damping", "stiffness")
    )
    if k == 0 and d == 0:
        return (1, T, T * T / (2 * m)), (0, 1, T / m)
    if k == 0:
        gone = -(-d * T / m).expm1()
        return (1, gone * m / d, (T - gone * m / d) / d), (0, 1 - gone, gone / d)
    sigma = d / (2 * m)
    square = sigma * sigma - k / m
    if square < 0:
        root = (-square).sqrt()
        shrink = (-sigma * T).exp()
        c, h = shrink * (root * T).cos(), shrink * (root * T).sin() / root
    else:
        root = square.sqrt()
        slow, quick = ((root - sigma) * T).exp(), (-(root + sigma) * T).exp()
        c, h = (slow + quick) / 2, (slow - quick) / (2 * root)
    rest = c + sigma * h
    return (rest, h, (1 - rest) / k), (-k / m * h, c - sigma * h, h / m)


def response(values, frequency_hz):
    """(admittance, impedance) at the hand's own frequency, as balls: the steady state under `exp(j w k T)`, its component.

    frequency_hz: an arb; the loop has no pole there.
    """
    (ratio, _, T), ticks = clock(values), ticks_of(values)
    first = ticks[0][0]
    n = first.size
    wall = first.x_tilde * arb(values["environment.K_VE"]) + first.x_dot * arb(values["environment.B_VE"])
    wall = _columns(wall, 0, n) * (1 / (1 - wall[0, n]))
    turn = acb(0, 2 * arb.pi() * frequency_hz * T).exp()
    parts = [(_ready(t, wall if i == 0 else None), times) for i, (t, times) in enumerate(ticks)]
    A = acb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])
    for (step, *_), times in parts:
        A = step**times * A
    driven, *_ = _march(parts, acb_mat(n, 1, [0] * n), turn)
    unit = acb_mat(n, n, [turn**ratio if i == j else 0 for i in range(n) for j in range(n)])
    _, x, f_m = _march(parts, (unit - A).solve(driven), turn)
    return x / ratio, f_m / x


def _ready(t, wall):
    """(states to states, hand to states, x row, f_m row) with the wall's force put in."""
    n = t.size
    states, hand = _columns(t.step, 0, n), _columns(t.step, n + 1, n + 2)
    f_m = _columns(t.f_m, 0, n)
    if wall is not None:
        states, f_m = states + _columns(t.step, n, n + 1) * wall, f_m + wall * t.f_m[0, n]
    return acb_mat(states), acb_mat(hand), acb_mat(_columns(t.x, 0, n)), acb_mat(f_m)


def _march(parts, state, turn):
    """The state after a frame, and the sums of x and f_m times turn^-i."""
    x = f_m = acb(0)
    force = acb(1)
    for (step, hand, x_row, f_row), times in parts:
        for _ in range(times):
            x, f_m = x + (x_row * state)[0, 0] / force, f_m + (f_row * state)[0, 0] / force
            state, force = step * state + hand * force, force * turn
    return state, x, f_m


def lifted(values, frequency_hz):
    """The map from the frame's hand forces to its positions under `exp(j w j T_s)`, an acb_mat, M by M also for `dc`.

    Raises ValueError where the bits do not give every entry to 18 digits of the largest.
    """
    (ratio, _, T), ticks = clock(values), ticks_of(values)
    M = values["rates.ratio"]
    first = ticks[0][0]
    n = first.size
    wall = first.x_tilde * arb(values["environment.K_VE"]) + first.x_dot * arb(values["environment.B_VE"])
    wall = _columns(wall, 0, n) * (1 / (1 - wall[0, n]))
    parts = [(_ready(t, None if i else wall), times) for i, (t, times) in enumerate(ticks)]
    ticks = [part for part, times in parts for _ in range(times)] * (1 if ratio == M else M)
    state = acb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])
    forces, rows, direct = [], [], []
    for step, hand, x_row, _ in ticks:
        rows.append(x_row * state)
        direct.append([(x_row * force)[0, 0] for force in forces])
        state, forces = step * state, [step * force for force in forces] + [hand]
    turn = acb(0, 2 * arb.pi() * frequency_hz * T * M).exp()
    unit = acb_mat(n, n, [turn if i == j else 0 for i in range(n) for j in range(n)])
    reply = (unit - state).solve(acb_mat([[force[k, 0] for force in forces] for k in range(n)]))
    found = [
        [e + (direct[i][j] if j < i else 0) for j, e in enumerate((row * reply).tolist()[0])] for i, row in enumerate(rows)
    ]
    largest = max(e.abs_upper() for row in found for e in row)
    if not all(e.is_finite() and e.real.rad() + e.imag.rad() < 1e-18 * largest for row in found for e in row):
        raise ValueError("not enough bits")
    return acb_mat(found)


def displacements(values, theta):
    """The map from the frame's hand forces to the displacements in its ticks at theta (rad per frame), M by M, complex."""
    M = values["rates.ratio"]
    positions = lifted(values, theta / (2 * arb.pi() * M) * arb(values["rates.fast_hz"])).tolist()
    turn = acb(0, theta).exp()
    after = [*positions[1:], [turn * entry for entry in positions[0]]]
    return [[complex(b - a) for a, b in zip(*rows, strict=True)] for rows in zip(positions, after, strict=True)]
