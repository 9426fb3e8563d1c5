"""Walls that push and never pull, marched: of controllers, with any curve of slopes from 0 to 1 in place of the linear wall."""

import re
from itertools import pairwise

import numpy as np
from meaning.machine import radius
from meaning.members import ControllerFrames, Frame, asked_of, read_refuter, with_numbers
from meaning.required import Found

from wavesweep.checker.reader.loops import form

RUN = 600  # frames, after which a motion is looked at
LONG = 8000  # frames, if it does not seem to come to rest
QUIET = 1e-6  # of the largest force: its changes at rest


class WallFrames(ControllerFrames):
    """Frames whose wall's force is an input: memory after a frame is `A m + b F`, and the curve reads `c m + d F`."""

    def __init__(self, tables, asked):
        super().__init__(tables, asked, self.with_wall_open)
        self.open: dict = {}

    @staticmethod
    def with_wall_open(instant):
        """The force as an input, and the hand's push as a memory that stays."""
        if "slow F" in instant.equations:
            instant.equations["slow y"] = instant.equations["slow F"]
            instant.equations["slow F"] = form((1, "@F"))
        instant.writes["@hand"] = {"@hand": 1}
        return instant

    def of_frame(self, frame, before):
        key = frame, before
        if key not in self.open:
            places = self.walk.machine.memory
            A = self.frame(frame, before)
            kind = self.sample(frame, before)
            _, _, Y, _, variables = self.walk.machine.solved[kind]
            row = Y[variables["slow y"]]
            force = places["@F"]
            self.open[key] = A, A[:, force], np.delete(row, force), row[force]
        A, b, c, d = self.open[key]
        return A, b, np.insert(c, self.walk.machine.memory["@F"], 0.0), d


def curve_of(points):
    """The force over what the curve reads, linear between points, level beyond the last one."""
    reads, forces = np.array(points).T

    def answer(rest, d):
        """F = phi(rest + d F), by halving."""
        if not d:
            return float(np.interp(rest, reads, forces))
        low, high = forces.min(), forces.max()
        for _ in range(60):
            middle = (low + high) / 2
            if np.interp(rest + d * middle, reads, forces) > middle:
                low = middle
            else:
                high = middle
        return float(middle)

    return answer


def walls(random, scale):
    """Some of the class: touched and left, with a limit of the force, one that softens, one that stiffens."""
    far = 1e6 * scale
    yield curve_of([(-far, 0), (0, 0), (far, far)])
    yield curve_of([(-far, 0), (0, 0), (scale, scale), (far, scale)])
    for _ in range(2):
        reads = np.concatenate([[0], np.cumsum(random.uniform(0, 2, 4) * scale)])
        slopes = random.choice((0.0, 1.0, random.uniform()), 4)
        forces = np.concatenate([[0], np.cumsum(slopes * np.diff(reads))])
        points = [(-far, 0.0), *zip(reads.tolist(), forces.tolist(), strict=True)]
        yield curve_of([*points, (far, points[-1][1] + (far - points[-1][0]))])


def keeps_moving(family, wall, word, random) -> bool:
    """Whether a motion from a random start, with a push, does not come to rest through a wall."""
    memory = random.normal(size=family.walk.size) * 1e-3
    memory[family.walk.machine.memory["@hand"]] = random.choice((0.0, 0.3, 2.0))
    forces = []
    for count in range(LONG):
        frame, before = word[count % len(word)], word[count % len(word) - 1]
        A, b, c, d = family.of_frame(frame, before)
        force = wall(float(c @ memory), d)
        memory[family.walk.machine.memory["@F"]] = 0.0
        memory = A @ memory + b * force
        forces.append(force)
        if not np.isfinite(force) or abs(force) > 1e9:
            return True
        if count + 1 in (RUN, LONG):
            moves = np.abs(np.diff(forces))
            third = len(moves) // 3
            earlier, last = moves[third : 2 * third].max(), moves[2 * third :].max()
            if last <= QUIET * max(np.abs(forces).max(), 1e-300) or last < 0.5 * earlier:
                return False
    return last > 0.999 * earlier  # the linear wall may decay by 1e-5 a frame


def judge_walls(tables: dict, at_end: dict, row: dict, random) -> list[Found]:
    """A row of contact: no motion through a wall goes on at its proved end, and what refutes it does.

    at_end: the spec just inside of the end.
    """
    asked = asked_of(tables)
    met = None
    for member in members_of(at_end, asked):
        family = WallFrames(member, asked)
        symbols = family.symbols()
        words = [(symbol,) for symbol in symbols] + [tuple(random.choice(np.array(symbols, object), 5)) for _ in range(3)]
        for word in words:
            for wall in walls(random, 1.0):
                if met is None and keeps_moving(family, wall, word, random):
                    met = word
    return [Found("proved through contact", met is None, met, (row["high"], row["counterexample"]))]


def members_of(tables, asked):
    points = [{}]
    for name, values in asked.listed.items():
        points = [{**point, name: value} for point in points for value in values]
    return [with_numbers(tables, point) for point in points]


def judge_refuting_wall(tables: dict, said: str, drift: int) -> Found:
    """What refutes at these numbers: the linear wall, none at all, or a motion that repeats, frame by frame."""
    asked = asked_of(tables)
    numbers, word = read_refuter(said.partition(" through ")[0].replace(" and a delay of ", " delay "))
    member = with_numbers(tables, numbers)
    if "no contact" in said:
        member = with_numbers(member, {"K_VE": 0.0, "B_VE": 0.0})
    length = re.search(r"in frames of (\d+) ticks?(?: and a delay of (\d+))?", said)
    family = ControllerFrames(member, asked)
    own = Frame(family.lengths[0], family.delays[0])
    if length:
        own = Frame(int(length[1]), int(length[2]) if length[2] else family.delays[0])
    pattern = tuple(Frame(f.ticks, own.delay if f.delay == "own" else f.delay) for f in word) if word and not length else (own,)
    if " through (" not in said:
        return Found("refuted through contact by a line", radius(family.march(pattern), drift) > 1 - 1e-9, said, pattern)
    points = np.array(re.findall(r"\(([-\d.e+]+), ([-\d.e+]+)\)", said), float)
    reads = steady_readings(WallFrames(member, asked), own, points[:, 1])
    order = np.argsort(reads)
    steps = [(reads[b] - reads[a], points[b, 1] - points[a, 1]) for a, b in pairwise(order)]
    size = np.abs(points[:, 1]).max()
    fits = all(-1e-9 * size <= rise <= run + 1e-9 * size for run, rise in steps)
    return Found("refuted through contact by a motion", fits, min(run - rise for run, rise in steps) / size, said)


def steady_readings(family, frame, forces):
    """What the curve reads in each frame where these forces repeat for ever, but for where the device rests."""
    places = family.walk.machine.memory
    A, b, c, d = family.of_frame(frame, frame)
    free = np.array([place for name, place in places.items() if name != "@F"])
    A, b, c = A[np.ix_(free, free)], b[free], c[free]
    whole, driven = np.eye(len(free)), np.zeros(len(free))
    for force in forces:
        whole, driven = A @ whole, A @ driven + b * force
    memory = np.linalg.lstsq(np.eye(len(free)) - whole, driven, rcond=1e-12)[0]
    found = []
    for force in forces:
        found.append(c @ memory + d * force)
        memory = A @ memory + b * force
    return np.array(found)
