"""What plain `zwidth`, `passivity` and `design` say of a device at a wall, held against closed forms and an own lifting.

A device of mass m and damping d (with the operator's) moves exactly under a force that is held. Its wall takes a sample of
position and velocity once in a frame of n ticks, and holds `F = K x + B v` for that long. So a frame is a matrix of two states,
`A^n - G_n (K, B)`, whose determinant D and trace S are affine in K: it is stable where `abs(D) < 1` and `abs(S) < 1 + D`.
"""

# ruff: noqa: ARG001 (a function has the numbers of its line, also those that it does not need)
import json
import re
from dataclasses import dataclass, field
from itertools import product
from math import floor, inf, log, log10
from pathlib import Path

import numpy as np
import pandas
from scipy.linalg import expm
from scipy.optimize import minimize_scalar
from words.explanations import hold_columns
from words.law import QUIET, said_by, unfolded
from words.sentences import PROVED, N, Run, are_ends, hold, hold_in_common, hold_share, is_cell, near, of_members, shape

from wavesweep.program.spec.writing import as_toml

T = 0.001  # s
STOP = 20000.0  # N/m
DIGITS = 1e-9  # relative: by which an end that is certified may lie beyond the closed form
FIFTH_DIGIT = 5e-5  # relative: half of it at most
AT_B = rf"(?: at B_VE = {N} N\*s/m(?: \(the edge of that axis\))?(?:, and in {N} other rows?)?)?"
ASKS = ("nothing", "frames", "masses", "design", "port")


@dataclass
class Device:
    """A random spec, what it asks, and the lengths of frames and the masses that it is about."""

    seed: int
    asks: str
    tables: dict
    lengths: list = field(default_factory=list)
    masses: list = field(default_factory=list)

    @property
    def dampings(self):
        """The swept values of B_VE."""
        return self.tables["sweep"]["B_VE"]

    def matrices(self, n, mass=None, damping=None):
        """A and G of a frame of n ticks."""
        device = self.tables["device"]
        operator = self.tables.get("operator", {})
        heavy = (mass or device["mass"]) + operator.get("mass", 0.0)
        damped = (damping or device["damping"]) + operator.get("damping", 0.0)
        flow = np.zeros((3, 3))
        flow[0, 1] = 1.0
        flow[1] = -operator.get("stiffness", 0.0) / heavy, -damped / heavy, 1 / heavy
        moved = expm(flow * n * T)
        return moved[:2, :2], moved[:2, 2:]

    def frame(self, n, K, B, mass=None, damping=None):
        A, G = self.matrices(n, mass, damping)
        return A - G @ [[K, B]]

    def walls(self, n, B, mass=None, damping=None, size=1.0):
        """The interval of K with eigenvalues below a size; low above high of none."""
        ends = [self.frame(n, K, B, mass, damping) / size for K in (0.0, 1.0)]
        D, more_D = np.linalg.det(ends[0]), np.linalg.det(ends[1]) - np.linalg.det(ends[0])
        S, more_S = np.trace(ends[0]), np.trace(ends[1]) - np.trace(ends[0])
        low, high = -inf, inf
        # Each has to be above 0, as constant + slope K.
        for constant, slope in ((1 - D, -more_D), (1 + D - S, more_D - more_S), (1 + D + S, more_D + more_S)):
            if slope > 0:
                low = max(low, -constant / slope)
            elif slope < 0:
                high = min(high, -constant / slope)
        return low, high

    def inside(self, B, word, size=1.0):
        """The interval of K in the swept range in which all members are stable."""
        own = word != "for_all"
        lengths = [self.own_length] if own else self.lengths
        masses = [None] if own else self.masses
        pairs = [self.walls(n, B, mass, size=size) for n, mass in product(lengths, masses)]
        start = self.tables["sweep"]["K_VE"]["start"]
        return max(start, *(low for low, _ in pairs)), min(STOP, *(high for _, high in pairs))

    @property
    def members(self):
        """Those of which heads tell: lengths of frames, and the lightest and the heaviest mass."""
        return {"n": self.lengths, "mass": [self.masses[0], self.masses[-1]]}

    @property
    def proved(self):
        """The intervals of each slice in which all members are stable."""
        return [[self.inside(B, "for_all")] for B in self.dampings]

    @property
    def own_length(self):
        """Ticks of the spec's own frame."""
        return self.tables["rates"].get("ratio", 1) if self.tables["controller"]["kind"] == "dc-slow" else 1


def drawn(seed):
    """A random device."""
    rng = np.random.default_rng(seed)
    asks = ASKS[seed % len(ASKS)]
    slow = asks == "frames" or rng.random() < (0.8 if asks == "port" else 0.4)
    lengths = sorted(rng.choice([1, 2, 3, 4], size=2, replace=False).tolist())
    device = {"mass": float(np.round(rng.uniform(0.05, 0.3), 3)), "damping": float(np.round(rng.uniform(0.3, 3.0), 3))}
    B = float(np.round(rng.uniform(0.05, 0.4) * device["damping"], 4))
    start = float(rng.choice([0.0, 1.0]))
    tables = {
        "rates": {"fast_hz": 1 / T} | ({"ratio": lengths[0]} if slow else {}),
        "device": {**device, "velocity": "exact"},
        "controller": {"kind": "dc-slow" if slow else "dc"},
        "environment": {"K_VE": float(np.round(10 ** rng.uniform(1, 4), 2)), "B_VE": B},
        "sweep": {"B_VE": [0.0, B], "K_VE": {"start": start, "stop": STOP}},
    }
    if asks in ("nothing", "masses") and rng.random() < 0.5:
        tables["operator"] = {"mass": 0.1, "damping": 0.5, "stiffness": 20.0}
    case = Device(seed, asks, tables)
    case.lengths, case.masses = [case.own_length], [device["mass"]]
    if asks == "port":
        share = rng.uniform(0.2, 1.1)  # of the stiffest wall
        tables["environment"]["K_VE"] = float(np.round(share * case.walls(case.own_length, 0.0)[1], 2))
    if asks == "frames":
        tables["for_all"] = {"rates.ratio": {"values": lengths, "varying": True}}
        case.lengths = lengths
    if asks == "masses":
        low, high = device["mass"] * 0.7, device["mass"] * 1.4
        tables["for_all"] = {"device.mass": {"start": low, "stop": high}}
        case.masses = np.linspace(low, high, 41).tolist()
    if asks == "design":
        masses = [device["mass"] * share for share in (0.7, 1.0, 1.4)]
        tables["for_all"] = {"device.mass": masses}
        tables["design"] = {
            "seed": int(seed),
            "population": 8,
            "generations": 1,
            "vary": {"device.damping": {"start": 0.3, "stop": 3.0}},
            "wish": {"z_width": {"B_VE": [0.0, B]}},
        }
        if rng.random() < 0.5:
            tables["design"]["wish"]["time_constant"] = {"at_most": 2.0, "walls": [50.0, 100.0]}
        case.masses = np.linspace(masses[0], masses[-1], 129).tolist()
    return case


def hold_device(seed):
    """Hold all that is said of a random device; in a folder of its own."""
    case = drawn(seed)
    Path("mine.toml").write_text(as_toml(case.tables), encoding="utf-8")
    run = Run(case, "zwidth")
    if case.asks == "port":
        run.command = "passivity"
        lines, table, _ = answered(run, "passivity", "passivity")
        hold_ports(case, table)
    elif case.asks == "design":
        run.command = "design"
        lines, table, _ = answered(run, "design", "design")
        hold_designs(case, table)
    else:
        lines, table, claims = answered(run, "zwidth", "zwidth")
        hold_walls(case, table, claims)
    for line in unfolded(lines, "    "):
        if found := re.match(r".*? \((\w+)\):$", line):
            run.word = found[1]
            assert line.startswith(run.claims[run.word]["said"]), line
        if re.search(r"\d", line):
            hold(run, line)
    hold_columns(table)


def answered(run, command, name):
    """The lines of a command, its table, and what it claims."""
    code, _, lines = said_by(command, "mine.toml", *QUIET)
    assert code == 0, (run.case.seed, lines)
    table = pandas.read_csv(f"t/{name}.csv")
    run.facts = json.loads(Path(f"t/{name}.datapackage.json").read_text(encoding="utf-8"))["wavesweep"]
    run.rows = table.to_dict("records")
    run.claims = run.facts["claims"]
    return lines, table, run.claims


# zwidth


def hold_walls(case, table, claims):
    """Each row lies in the closed form, reaches its ends if it is certified, and what is refuted is unstable."""
    for row in table.to_dict("records"):
        word = row.get("guarantee", "spec")
        assert word in claims, row
        low, high = case.inside(row["B_VE"], word)
        if not row["intervals"]:
            assert not row["certified"] or low >= high or high <= 1.01 * max(low, 1.0), (case.seed, row, low, high)
            continue
        assert low * (1 - DIGITS) <= row["low"], (case.seed, row, low)
        assert row["high"] <= high * (1 + DIGITS), (case.seed, row, high)
        if word == "spec" and row["certified"]:
            assert near(row["high"], high, 1e-7), (case.seed, row, high)
        if word == "for_all":
            hold_members(case, row)
    if "for_all" in claims:
        scope = claims["for_all"]["scope"]
        if case.asks == "frames":
            assert {*case.lengths} == {*scope["frames"]["lengths"]}
            assert scope["frames"]["order"] == "any"
        else:
            (number,) = scope["numbers"]
            assert (number["low"], number["high"]) == (case.masses[0], case.masses[-1])


def hold_members(case, row):
    """No short word of frames grows within a row, and a row that counts as settled is refuted next to its end."""
    for K in (row["low"] * (1 + DIGITS), row["high"] * (1 - DIGITS)):
        frames = [
            case.frame(n, K, row["B_VE"], mass) for n, mass in product(case.lengths, case.masses[:: len(case.masses) - 1 or 1])
        ]
        if case.asks == "frames":
            words = [np.linalg.multi_dot([*word, np.eye(2)]) for size in (1, 2, 3, 4) for word in product(frames, repeat=size)]
        else:
            words = frames
        assert all(np.abs(np.linalg.eigvals(word)).max() < 1 for word in words), (case.seed, row, K)
    if not pandas.isna(row["fails_from"]):
        assert row["fails_from"] > row["high"], row
        assert refuted(case, row["counterexample"], row["fails_from"], row["B_VE"]), row
    if row["settled"] and row["high"] < STOP:
        assert row["fails_from"] <= row["high"] * 1.0101, row


def refuted(case, text, K, B):
    """Whether the frames or the mass that a text names grow."""
    text = re.sub(r".*from \S+: ", "", text)
    if " in all)" in text:  # the table has the whole of it
        named = {int(each) for each in re.findall(r"\d+(?!\d*\))", re.sub(r" x \d+", "", text.partition(", ...")[0]))}
        return named <= {*case.lengths}
    mass = re.search(rf"mass = {N}", text)
    assert not mass or case.masses[0] * (1 - 1e-5) <= float(mass[1]) <= case.masses[-1] * (1 + 1e-5), text
    lengths = [case.own_length]
    if "frames" in text:
        repeated = re.sub(r"\b(\d+) x (\d+)", lambda found: ", ".join([found[1]] * int(found[2])), text.partition("frames ")[2])
        repeated = re.sub(r"\(([^()]*)\) x (\d+)", lambda found: ", ".join([found[1]] * int(found[2])), repeated)
        lengths = [int(each) for each in re.findall(r"\d+", repeated)]
        assert {*lengths} <= {*case.lengths}, text
    product_of_all = np.eye(2)
    for n in lengths:
        product_of_all = case.frame(n, K, B, mass and float(mass[1])) @ product_of_all
    return np.abs(np.linalg.eigvals(product_of_all)).max() >= 1 - 1e-9


def greatest_wall(run, B=None):
    return max(run.case.inside(each, run.word)[1] for each in ([B] if B is not None else run.case.dampings))


@shape(rf"{N} slices?: {N} stable intervals?", "zwidth")
def counted(run, slices, count):
    case = run.case
    found = [case.inside(B, "spec") for B in case.dampings]
    return slices == len(case.dampings) and count == sum(low < high for low, high in found)


@shape(rf"\s*B_VE = {N} N\*s/m: K_VE {N} to {N} N/m", "zwidth")
def of_slice(run, B, low, high):
    return swept(run, B) and are_ends(low, high, [run.case.inside(B, "spec")])


@shape(r"(stable (?:with|for) .*) \((?:spec|for_all)\):", "zwidth")
def whose(run, said):
    return of_members(run, said)


def swept(run, B):
    """Whether a damping that is named is one of the swept ones."""
    return B is None or any(near(B, each) for each in run.case.dampings)


@shape(
    rf"\s*largest (stable|proved) K_VE: (?:just below )?{N} N/m(?: \((?:stable|proved) from {N} on\))?{AT_B}"
    r"(?:, where the swept range ends)?(?:, refuted at (\S+) by (.*))?",
    "zwidth",
)
def largest_wall(run, how, high, low, B, others, fails, by):
    assert (how == "proved") == (run.word == "for_all")
    truth = greatest_wall(run, B)
    assert swept(run, B), B
    assert is_cell(run, high, "high"), high
    assert high <= truth * (1 + DIGITS), (high, truth)
    assert high >= greatest_wall(run) * (0.98 if how == "proved" else 1 - 2e-5), (high, truth)
    if fails is not None:
        assert float(fails) >= high
        assert is_cell(run, float(fails), "fails_from"), fails
        tried = run.case.dampings if B is None else [B]
        return any(refuted(run.case, by, float(fails), each) for each in tried)
    return low is None or low >= run.case.inside(B or 0.0, run.word)[0]


@shape(r"\s*(no )?(stable|proved) K_VE for all of them:? ?(.*)", "zwidth")
def walls_in_common(run, none, how, said):
    rows = [each for each in run.rows if each.get("guarantee", "spec") == run.word]
    return (none is not None) == (not hold_in_common(rows, "B_VE", said))


@shape(rf"\s*(stable|proved) for every K_VE from {N} up to {N} N/m{AT_B}", "zwidth")
def every_wall(run, how, low, high, B, others):
    return swept(run, B) and is_cell(run, high, "high") and near(low, run.case.inside(B or 0.0, run.word)[0])


@shape(
    rf"\s*stiffest wall as the hand feels it at rest: {N} N/m with K_VE = {N} N/m(?: \(stable from {N} on\))?{AT_B}", "zwidth"
)
def felt_wall(run, felt, K, low, B, others):
    return swept(run, B) and near(felt, K, 2e-6) and is_cell(run, K, "high") and greatest_wall(run, B) * (1 + DIGITS) >= K


@shape(rf"\s*(?:all {N} rows|the only row is|the only row) certified", "zwidth")
def certified_walls(run, count):
    rows = [each for each in run.rows if each.get("guarantee", "spec") == run.word]
    return all(each["certified"] for each in rows) and count in (None, len(rows))


@shape(rf"\s*frames of (.*) ticks? decides?: without those of (.*) no end moves by more than {N} %", "zwidth")
def deciding(run, some, others, share):
    case = run.case
    kept, without = ({int(each) for each in re.findall(r"\d+", str(of).removesuffix(".0"))} for of in (some, others))
    assert sorted((*kept, *without)) == case.lengths, (kept, without)
    hold_share(run, share)
    for B in case.dampings:
        part = Device(case.seed, case.asks, case.tables, sorted(kept), case.masses).inside(B, "for_all")[1]
        whole = case.inside(B, "for_all")[1]
        # Of the words of one frame; longer ones decide where these do not.
        assert abs(part - whole) <= share / 100 * max(part, whole) * (1 + 1e-9) + 1e-9, (part, whole)
    return True


# passivity: a force that is held over a tick, and how far the device moves in it.


def least_real(case, K, B, damping=None):
    """The least eigenvalue of the Hermitian part of the response of a frame, seen on a grid and about its least value.

    In each tick of a frame a force acts on the device, and the answer is how far it moves in that tick.
    """
    n = case.own_length
    A, G = case.matrices(1, damping=damping)
    state = np.eye(2, 2 + n)  # by x and v where the frame begins, and the forces in its ticks
    force = np.array([K, B]) @ state
    moves = []
    for tick in range(n):
        pushed = -force.copy()
        pushed[2 + tick] += 1
        after = A @ state + G * pushed
        moves.append(after[0] - state[0])
        state = after
    moves = np.array(moves)

    def least(angles):
        z = np.exp(1j * np.atleast_1d(angles))[:, None, None]
        inner = np.linalg.solve(z * np.eye(2) - state[:, :2], np.broadcast_to(state[:, 2:], (len(z), 2, n)))
        found = moves[:, :2] @ inner + moves[:, 2:]
        return np.linalg.eigvalsh((found + found.conj().swapaxes(-1, -2)) / 2)[:, 0]

    angles = np.concatenate([np.geomspace(1e-6, 0.05, 400), np.linspace(0.05, np.pi, 2000)])
    seen = least(angles)
    place = int(seen.argmin())
    about = angles[max(place - 1, 0)], angles[min(place + 1, len(angles) - 1)]
    found = minimize_scalar(lambda angle: least(angle)[0], bounds=about, method="bounded", options={"xatol": 1e-9})
    return min(float(seen.min()), float(found.fun))


def hold_ports(case, table):
    K = case.tables["environment"]["K_VE"]
    for row in table.to_dict("records"):
        B = row["B_VE"]
        low, high = case.walls(case.own_length, B)
        assert bool(row["stable"]) == (low < K < high), row
        seen = least_real(case, K, B)
        if row["port_passive"]:
            assert row["stable"], row
            assert seen >= -1e-15, (case.seed, row, seen)
        if row["stable"]:
            assert row["port_margin"] <= seen + 1e-15, (case.seed, row, seen)
        needed = row["damping_needed"]
        own = case.tables["device"]["damping"]
        if needed > 0:
            scale = abs(seen)
            assert least_real(case, K, B, own + needed) >= -1e-6 * scale, (case.seed, row)
            assert least_real(case, K, B, own + 0.99 * needed) < 0, (case.seed, row)
        elif needed == 0:
            assert row["port_passive"], row


@shape(rf"hand's port, its force held over a tick: passive in {N} of {N} rows?(?:; margin {N}(?: to {N})? m/N)?", "passivity")
def passive_rows(run, some, count, least, most):
    """No margin is printed above the least that is seen."""
    case = run.case
    K = case.tables["environment"]["K_VE"]
    stable = [row["B_VE"] for row in run.rows if row["stable"]]
    seen = [least_real(case, K, B) for B in stable]
    assert count == len(case.dampings)
    assert some == sum(row["port_passive"] for row in run.rows)
    assert some <= sum(each >= -1e-15 for each in seen)
    margins = [row["port_margin"] for row in run.rows]
    assert least is None or near(least, min(margins)), (least, margins)
    assert most is None or near(most, max(margins)), (most, margins)
    if least is not None and seen:
        assert least <= min(seen) + 1e-15, (least, seen)
        assert (least if most is None else most) <= max(seen) + 1e-15, (most, seen)
    return True


@shape(rf"further damping of the device that makes it passive: {N}(?: to {N})? N\*s/m", "passivity")
def more_damping(run, least, most):
    """With as much as is printed the port is passive."""
    case = run.case
    K = case.tables["environment"]["K_VE"]
    own = case.tables["device"]["damping"]
    enough = least if most is None else most
    needed = [row["damping_needed"] for row in run.rows if row["damping_needed"] > 0]
    assert 0 <= enough - max(needed) <= 10.0 ** (floor(log10(max(needed))) - 2), (enough, needed)
    assert most is None or near(least, min(needed), 1e-2), (least, needed)
    return all(least_real(case, K, B, own + enough) >= -1e-15 for B in case.dampings)


@shape(rf"not stable in the first place, or not known to be: {N} rows?", "passivity")
def unstable_ports(run, count):
    return count == sum(not row["stable"] for row in run.rows)


@shape(rf"no damping of the device makes it passive in {N} rows?", "passivity")
def never_passive(run, count):
    return count == sum(pandas.isna(row["damping_needed"]) for row in run.rows)


@shape(rf"{N} of {N} loops? not certified", "passivity")
def ports_in_doubt(run, some, count):
    return 0 < some <= count


@shape(r"dc(?:-slow)? has no wave channel: the column channel_norm is empty, and channel_passive is 1", "passivity")
def no_channel(run):
    return all(pandas.isna(row["channel_norm"]) and row["channel_passive"] for row in run.rows)


@shape(rf"assumes: [^\d]*(?:; optimistic default of environment\.delay: engines usually have {N})?")
def usual_delay(run, ticks):
    return ticks is None or ticks == run.case.own_length


@shape(rf"K_VE is not swept, because it has a range and no values: held at the spec's {N}")
def held_wall(run, value):
    return value == run.case.tables["environment"]["K_VE"]


# design


def hold_designs(case, table):
    for row in table.to_dict("records"):
        damping = row["device.damping"]
        assert 0.3 <= damping <= 3.0
        assert row["z_width"] <= stiffest(case, damping) * (1 + DIGITS), row
        if "time_constant" in row:
            assert row["time_constant"] >= slowest(case, damping) * (1 - 1e-6), row
            assert row["time_constant"] <= 2.0 * (1 + 1e-9)


def stiffest(case, damping, masses=()):
    """The stiffest wall up to which all are stable, for all masses and both dampings of the wall."""
    pairs = [case.walls(case.own_length, B, mass, damping) for B in case.dampings for mass in masses or case.masses]
    return min(STOP, *(high for _, high in pairs))


def slowest(case, damping, masses=()):
    """The longest time constant of a mode, over masses and walls."""
    B = case.tables["environment"]["B_VE"]
    times = []
    for mass, K in product(masses or case.masses, (50.0, 100.0)):
        size = np.abs(np.linalg.eigvals(case.frame(case.own_length, K, B, mass, damping))).max()
        times.append(-case.own_length * T / log(size) if size < 1 else inf)
    return max(times)


@shape(
    rf"{N} designs evaluated, each at its worst over {N} combinations; {N} of them were then tried for all of \[for_all\]",
    "design",
)
def looked_at(run, designs, combinations, tried):
    assert tried == run.facts["proved"]
    return designs == run.facts["slices"]["computed"] and combinations == len(listed_masses(run))


def listed_masses(run):
    return run.case.tables["for_all"]["device.mass"]


@shape(r"walls are proved from 0.2 % of z_width on", "design")
def from_near_zero(run):
    return True


@shape(rf"(?:z_width|loops): proved stable for device\.mass of {N}, {N}, {N} \(each for ever\)", "design")
def proved_for(run, *masses):
    return all(near(one, other, 1e-5) for one, other in zip(masses, listed_masses(run), strict=True))


@shape(rf"each design was tried with {N} combinations of the numbers of \[for_all\], those of the front with {N}", "design")
def tried_with(run, few, many):
    return few == 3 and many == len(run.case.masses)


@shape(
    rf"time_constant: time constant of the slowest mode for device\.mass of {N} values from {N} to {N} "
    r"\(each for ever\), not certified \(double precision\)",
    "design",
)
def of_masses(run, count, low, high):
    masses = run.case.masses
    assert run.claims["z_width"]["status"] == "proved", run.claims
    assert run.claims["time_constant"]["status"] == "computed", run.claims
    return count == len(masses) and near(low, masses[0], 1e-5) and near(high, masses[-1], 1e-5)


WISHED = rf"z_width {N} N/m(?:, time_constant {N} s)?"


@shape(
    rf"(?:best of these {N}|(next best)): {WISHED}, with device\.damping = {N}(?:; margins: time_constant {N} %)?",
    "design",
)
def best_design(run, count, following, wall, seconds, damping, margin):
    """No wall is printed beyond the closed form, and no time below it, with the damping of five digits that is printed."""
    dampings = [damping * (1 + FIFTH_DIGIT), damping * (1 - FIFTH_DIGIT)]
    truth = max(stiffest(run.case, each) for each in dampings)
    assert wall <= truth * (1 + DIGITS), (wall, truth)
    assert wall >= truth * (1 - 4 * FIFTH_DIGIT), (wall, truth)
    if seconds is not None:
        assert seconds >= min(slowest(run.case, each) for each in dampings) * (1 - 1e-6)
        assert seconds <= 2.0
        assert seconds <= max(slowest(run.case, each) for each in dampings) * (1 + PROVED)
    assert count is None or count == run.facts["proved"], count
    return margin is None or shared(margin, seconds)


def shared(margin, seconds):
    """Whether a margin is the share to a bound of 2 s, rounded down to three digits."""
    return -1e-9 <= 100 * (1 - seconds / 2.0) - margin <= 0.1


@shape(rf"the spec's own design: {WISHED}", "design")
def own_design(run, wall, seconds):
    """Of the combinations that the search looks at, as it stands beside what these gave."""
    damping = run.case.tables["device"]["damping"]
    few = listed_masses(run)
    truth = stiffest(run.case, damping, few)
    assert wall <= truth * (1 + DIGITS), (wall, truth)
    assert wall >= truth * (1 - PROVED), (wall, truth)
    return seconds is None or 1 - 1e-6 <= seconds / slowest(run.case, damping, few) <= 1 + PROVED


@shape(rf"margins to the bounds: time_constant {N} %; z_width decides(?:, held back by the bound of time_constant)?", "design")
def to_the_bounds(run, share):
    best = run.rows[0]["time_constant"]
    return shared(share, best)


@shape(r"as specs: (\S+)", "design")
def kept_as(run, name):
    return Path("t", name).exists()


@shape(r"z_width decides|next best: none was found .*|\s*device\.damping lies near an end .*", "design")
def of_design(run):
    return True
