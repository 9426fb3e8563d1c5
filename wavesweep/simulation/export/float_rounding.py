"""What rounding to floats does in a loop that is closed over a controller in single precision.

A sum of n products in floats is off by at most (1 + u)^(n + 2) - 1 times the sum of the sizes of
its terms, u = 2^-24, with the rounding of signals and factors, and (1 + u)^n - 1 if all factors
are 1 (Higham, Accuracy and Stability of Numerical Algorithms, 2002, section 3.1). What is off
enters the loop as a signal from outside that is added to the sum. So it moves what the controller
gives by at most the sum over all ticks since, and over all sums of a tick, of the size of the
response times that of the error.

Errors are taken so large that they cover those of terms that are moved by them, so what is said
holds at each tick if it held before. Let s be what the numbers at the beginning of a frame are
moved by within N frames, and P the map of these frames. If |P| s <= s/2, they are moved by at most
2 s in all, as S <= s + |P| S. A product that is below the range of floats is off by half of the
least float above 0, and what leaves the range is refused. An integral keeps its value in floats
while it is to change by less than half of the way to the next float below.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.program.number_words import rounded_down, rounded_up
from wavesweep.program.spec import Spec
from wavesweep.simulation.experiment import refuse_what_makes_no_loop
from wavesweep.simulation.export.controller import as_drawn, controller_of, with_late_device
from wavesweep.simulation.export.repeated_experiment import drawing_of, loop_with, steps_of
from wavesweep.simulation.export.single import refuse_decisions
from wavesweep.simulation.from_spec import effects_of, hand_force
from wavesweep.simulation.keys import entry_of
from wavesweep.simulation.running_blocks import DEPTH, FORCE, SPEED
from wavesweep.simulation.tick_sums import Program, TickSums

UNIT = 2.0**-24  # relative, what rounding to a float moves a number by at most
LEAST, MOST = 2.0**-126, 2.0**127  # sizes of floats of all digits, of the largest one half
MOST_WORK = 2e9  # multiplications for the map of a frame
SLOW = "export: the loop settles too slowly, or has too many ticks and states, for bounds on floats"
UNSEEN = 1e-9  # of the circle: a mode closer to it drifts; of the largest row: none of it is seen


class FloatRounding(NamedTuple):
    """moves: by its port, by how much rounding moves what the controller gives there at most, and
    its largest value in the run. stalls: by its block, the input below which an integral keeps its
    largest value of the run."""

    moves: dict[str, tuple[float, float]]
    stalls: dict[str, float]


class _TickMap(NamedTuple):
    """A kind of tick, of the numbers z in their places: `z' = A z + E e`, the outputs are
    `C z + D e`, e being what the sums are off by. terms: rows of z, of each term of each sum;
    share: of the term, what its sum is off by through it."""

    A: np.ndarray
    E: np.ndarray
    C: np.ndarray
    D: np.ndarray
    terms: np.ndarray
    share: np.ndarray

    @property
    def still(self) -> np.ndarray:
        """Which numbers keep what they were, whatever is rounded, as inputs do."""
        return (np.eye(len(self.A)) == self.A).all(1) & ~self.E.any(1)

    def off(self, sizes: np.ndarray) -> np.ndarray:
        """What the sums are off by at most, with terms of these sizes."""
        # The least float above 0 is 2^-149.
        return self.share @ sizes + (2.0**-149) * (self.share > 0).sum(1)

    def among(self, moving: np.ndarray) -> _TickMap:
        """The map of what some of the numbers are moved by, if the others are not."""
        A = self.A[np.ix_(moving, moving)]
        terms = self.terms[:, moving]
        return _TickMap(A, self.E[moving], self.C[:, moving], self.D, terms, self.share)

    @property
    def bears(self) -> np.ndarray:
        """Rows of what bears on outputs and on what is rounded."""
        return np.concatenate([self.C, self.terms[self.share.any(0)]])


@np.errstate(all="ignore")  # of a loop that is not stable, which settles too slowly
def float_rounding(spec: Spec) -> FloatRounding:
    """Return what floats do to the controller of a spec in the run of its [simulate] table.

    Accuracy: a bound for all that is rounded, computed in doubles. Errors: UsageError as for
    `exported`, for a run in which limits are reached, or a loop that settles too slowly for
    MOST_WORK.
    """
    spec = spec.asking("simulate")
    refuse_what_makes_no_loop(spec)
    steps = steps_of(spec)
    effects = effects_of(spec)
    loop = loop_with(spec, drawing_of(spec, amplifier=True), spec.values, None)
    linear = with_late_device(loop_with(spec, drawing_of(spec), spec.values, None))
    loses = bool(effects.late or effects.dropped or loop.channels or steps)
    controller = controller_of(linear, loses)
    refuse_decisions(controller)
    blocks = [replace(each, plant=each.plant or each.type == "dead time") for each in loop.blocks]
    exact = {block.name for block in blocks if block.plant}
    ticks = TickSums(replace(loop, blocks=tuple(blocks)))
    programs = [ticks.program(k, frozenset(), touching=True) for k in range(loop.frame)]
    entry = ticks.place(entry_of(spec) or loop.hand)
    outputs = [ticks.place(name) for name in controller.outputs]
    names = [*ticks.places]
    rounded = [name in controller.outputs or name.rpartition(".")[0] not in exact for name in names]
    places = [ticks.place(name) for name in (DEPTH, SPEED, FORCE)]
    kinds = {id(program): program for program in programs}
    maps = {key: _map_of(each, rounded, outputs, places) for key, each in kinds.items()}
    in_turn = [maps[id(program)] for program in programs]
    z = _run(in_turn, len(rounded), entry, hand_force(spec).force)
    largest = np.abs(z).max(0, initial=0.0)
    terms = []
    for k, tick in enumerate(in_turn):
        terms.append(np.abs(z[k :: len(in_turn)] @ tick.terms.T).max(0, initial=0.0))
    moving = ~np.logical_and.reduce([tick.still for tick in maps.values()])
    limited = sorted({place for program in kinds.values() for place in program.limits})
    in_turn = [maps[id(program)].among(moving) for program in programs]
    errors, moved = _errors(in_turn, terms, np.eye(len(names))[np.ix_(limited, moving)])
    most = np.zeros(len(names))
    most[moving] = moved.max(0)
    _refuse_range(kinds.values(), rounded, largest + most, errors)
    _refuse_limits(kinds.values(), z, most, names)
    shown = _moved(in_turn, errors, moved)
    moves = {}
    for place, by in zip(outputs, shown, strict=True):
        moves[names[place].removesuffix(" besides")] = float(by), float(largest[place])
    return FloatRounding(moves, _stalls(kinds.values(), names, largest))


def floats_in_words(spec: Spec) -> str:
    """What floats do to the controller of a spec, in a line."""
    try:
        rounding = float_rounding(spec)
    except WavesweepError as error:
        return f"floats: no bound on what they move: {str(error).removeprefix('export: ')}"
    said = []
    for port, (by, largest) in rounding.moves.items():
        said.append(
            f"{as_drawn(port)} by at most {rounded_up(by, 3)} (its largest is {largest:.4g})"
        )
    stalled = []
    for block, error in rounding.stalls.items():
        least = rounded_down(error, 2)
        stalled.append(
            f"; at its largest, the integral of {block} stalls below {least} of {block}.u"
        )
    return f"floats: in the run of [simulate] rounding moves {', '.join(said)}{''.join(stalled)}"


def _sums_of(program: Program, places) -> list[tuple[tuple, float]]:
    """The sums of a program in their order, and how much worse each is rounded than a plain sum: that
    of the wall's force divides by `1 - K yields - B slows`."""
    sums = [(line, 1.0) for line in program.first]
    if program.wall:
        K, B, yields, slows, *_ = program.wall
        depth, speed, force = places
        rest = 1.0 - K * yields - B * slows
        # Of the divisor, whose terms may cancel.
        worse = 1.0 + 4.0 * (1.0 + abs(K * yields) + abs(B * slows)) / abs(rest)
        sums.append(((force, ((K / rest, depth), (B / rest, speed))), worse))
    return sums + [(line, 1.0) for line in program.second]


def _map_of(program: Program, rounded: Sequence[bool], outputs, places) -> _TickMap:
    """The map of a program; rounded: whether the sum in each place is. places: of the wall's
    depth, speed and force."""
    sums = _sums_of(program, places)
    n = len(rounded)
    count = len(sums) + len(program.keeps)
    now = np.eye(n, n + count)
    share = []
    terms = []

    def summed(line, worse):
        """What a sum is, with its error."""
        target, products = line
        total = np.zeros(now.shape[1])
        for factor, source in products:
            total += factor * now[source]
            terms.append(now[source, :n].copy())
        share.append([])
        for factor, _ in products:
            often = len(products) + 2 * (abs(factor) != 1)
            off = (1 + UNIT) ** often - 1
            share[-1].append(rounded[target] * worse * off * abs(factor))
        total[n + len(share) - 1] += 1.0
        return total

    for line, worse in sums:
        now[line[0]] = summed(line, worse)
    shown = now[outputs]
    totals = [summed(line, 1.0) for line in program.keeps]
    for (target, _), total in zip(program.keeps, totals, strict=True):
        now[target] = total
    for source, first, last in program.moves:
        now[first + 1 : last] = now[first : last - 1].copy()
        now[first] = now[source]
    of_terms = np.zeros((count, len(terms)))
    column = 0
    for row, shares in zip(of_terms, share, strict=True):
        row[column : column + len(shares)] = shares
        column += len(shares)
    terms = np.array(terms).reshape(-1, n)
    return _TickMap(now[:, :n], now[:, n:], shown[:, :n], shown[:, n:], terms, of_terms)


def _run(in_turn: Sequence[_TickMap], places: int, entry: int, record: np.ndarray) -> np.ndarray:
    """The numbers at the beginning of each tick of a run from rest."""
    z = np.zeros((len(record) + 1, places))
    for k, value in enumerate(record):
        z[k, entry] = value
        z[k + 1] = in_turn[k % len(in_turn)].A @ z[k]
    return z


def _errors(
    in_turn: Sequence[_TickMap], terms: Sequence[np.ndarray], limited: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray]:
    """What the sums of each tick of a frame are off by at most, and by how much that moves the
    numbers at the beginning of its ticks, a row each, but for a drift that bears on nothing;
    terms: their sizes in the run; limited: rows of numbers with limits."""
    n = len(in_turn[0].A)
    if len(in_turn) * n**3 > MOST_WORK:
        raise UsageError(SLOW)
    frame = np.eye(n)
    bears = []
    for tick in in_turn:
        bears += [tick.bears @ frame, limited @ frame]
        frame = tick.A @ frame
    settling = _without_drift(frame, np.concatenate(bears))
    needed = [tick.off(size) for tick, size in zip(in_turn, terms, strict=True)]
    # One or two rounds of errors cover what they move, or none do.
    for _ in range(4):
        # Of the errors of a run, with room for those of the same run in floats.
        errors = [1.01 * bound for bound in needed]
        moved = [_at_frames(in_turn, errors, settling)]
        needed = []
        for tick, size, error in zip(in_turn, terms, errors, strict=True):
            needed.append(tick.off(size + np.abs(tick.terms) @ moved[-1]))
            moved.append(np.abs(tick.A) @ moved[-1] + np.abs(tick.E) @ error)
        if all((more <= error).all() for more, error in zip(needed, errors, strict=True)):
            return errors, np.array(moved[:-1])
    raise UsageError(
        "export: expected rounding that moves its own errors by less than 1 % for bounds on floats"
    )


def _without_drift(frame: np.ndarray, bears: np.ndarray) -> np.ndarray:
    """The projection along the modes of a frame that do not settle, none of which may bear on
    these rows, as the angle under a loop of speed does not."""
    from scipy.linalg import schur

    _, right, drifts = schur(frame, sort=_drifts)
    if not drifts:
        return np.eye(len(frame))
    right = right[:, :drifts]
    if np.abs(bears @ right).max(initial=0.0) > UNSEEN * np.abs(bears).max():
        raise UsageError(SLOW)
    basis = schur(frame.T, sort=_drifts)[1][:, :drifts]
    return np.eye(len(frame)) - right @ np.linalg.solve(basis.T @ right, basis.T)


def _drifts(real: float, imaginary: float) -> bool:
    return math.hypot(real, imaginary) > 1 - UNSEEN


def _at_frames(
    in_turn: Sequence[_TickMap], errors: Sequence[np.ndarray], settling: np.ndarray
) -> np.ndarray:
    """By how much errors of these sizes move the numbers at the beginning of a frame at most."""
    power = settling
    moved = np.zeros(len(power))
    for tick, error in zip(reversed(in_turn), reversed(errors), strict=True):
        moved += np.abs(power @ tick.E) @ error
        power = power @ tick.A
    # Doublings of frames until half is left: those of a pole at 1 - 1e-12.
    for _ in range(40):
        further = np.abs(power) @ moved
        if (further <= moved / 2).all():
            return 2 * moved
        moved = moved + further
        power = power @ power
    raise UsageError(SLOW)


def _moved(
    in_turn: Sequence[_TickMap], errors: Sequence[np.ndarray], sizes: np.ndarray
) -> np.ndarray:
    """By how much errors of these sizes move the outputs at most, in the worst tick of a frame;
    sizes: see `_errors`."""
    frame = len(in_turn)
    rows = np.array([tick.C for tick in in_turn])
    moved = np.array([np.abs(tick.D) @ error for tick, error in zip(in_turn, errors, strict=True)])
    ticks = 0
    while True:
        # Rows of tick k of the frame reach back to the same place of each frame before.
        for back in range(1, frame + 1):
            for k in range(frame):
                tick = in_turn[(k - back) % frame]
                moved[k] += np.abs(rows[k] @ tick.E) @ errors[(k - back) % frame]
                rows[k] = rows[k] @ tick.A
        ticks += frame * frame
        rest = np.einsum("kij,kj->ki", np.abs(rows), sizes)
        # Ticks that are looked at one by one, 2 s; and how small the bound of the rest is, of the sum
        # over all ticks, where it ends.
        if ticks >= 100_000 or (rest <= 1e-3 * moved).all():
            return (moved + rest).max(0)


def _refuse_range(
    programs: Iterable[Program],
    rounded: Sequence[bool],
    largest: np.ndarray,
    errors: Sequence[np.ndarray],
) -> None:
    """Refuse a controller whose factors or numbers leave the range of floats. errors: at least
    UNIT times the sizes of all terms of each sum."""
    factors = [1.0]
    for program in programs:
        for target, products in (*program.first, *program.second, *program.keeps):
            if rounded[target]:
                factors += [abs(factor) for factor, _ in products if factor]
    numbers = max(largest.max(), max(error.max(initial=0.0) for error in errors) / UNIT)
    for quantity, least, greatest in (
        ("factors", min(factors), max(factors)),
        ("numbers", LEAST, numbers),
    ):
        if not (least >= LEAST and greatest <= MOST):
            raise UsageError(
                f"export: expected {quantity} within the range of floats, {LEAST:.3g} to {MOST:.3g}, for bounds on "
                f"floats, found {greatest if greatest > MOST else least:.3g}"
            )


def _refuse_limits(
    programs: Iterable[Program], z: np.ndarray, moved: np.ndarray, names: Sequence[str]
) -> None:
    """Refuse a run in which the linear loop reaches a limit; moved: what rounding moves it by."""
    for program in programs:
        for place, (low, high) in program.limits.items():
            of_run = z[:, place]
            if not (low < of_run.min() - moved[place] and of_run.max() + moved[place] < high):
                raise UsageError(
                    f"export: expected a run within the limits of {names[place]} for bounds on floats, found one that reaches them"
                )


def _stalls(
    programs: Iterable[Program], names: Sequence[str], largest: np.ndarray
) -> dict[str, float]:
    """The inputs below which integrals keep their largest values."""
    found = {}
    for program in programs:
        for target, products in program.keeps:
            block, _, state = names[target].rpartition(".")
            factors = [factor for factor, source in products if names[source] == f"{block}.u"]
            if state == "sum" and factors and largest[target]:
                value = np.float32(largest[target])
                half = float(value - np.nextafter(value, np.float32(0))) / 2
                found[block] = half / abs(sum(factors))
    return found
