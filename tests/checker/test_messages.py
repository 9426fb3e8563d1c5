"""Messages that are late or lost: which a receiver may have, and loops whose limits are known in closed form."""

from contextlib import nullcontext
from fractions import Fraction

import numpy as np
import pytest
from support.forms import form_of, matrix_of
from support.proofs import checked

from wavesweep.checker import balls, file
from wavesweep.checker.reader import for_all
from wavesweep.engine._switched.norms import find_norms

TANK = """
rates.tick_hz = 10
numbers.k = 1.0
[block]
tank = {{ type = "ss", inputs = ["u"], A = [[0]], B = [[1]], C = [[1]] }}
net = {{ type = "channel", {messages} }}
[wire]
"tank.u" = "net.y"
"net.u" = "-k*tank.y"
"""


def family_of(spec: str, value: str, number: str = "k") -> file.Family:
    return file.family_of(file.spec_of(spec.encode()), file.Claim("for all", {number: Fraction(value)}))


def simulated(every: int, phase: int, late: int, lost: int, ticks: int) -> set[tuple[int, ...]]:
    """All that a receiver can have in so many ticks, by trying every delay and loss of every message: h(t) counted from 0.

    Message j is sent in tick phase + every j and comes `late` ticks later at most, or never; not more than `lost` in a row do.
    """
    runs = range(phase, ticks, every)
    fates: list[list[int | None]] = [[]]
    for _ in runs:
        fates = [
            [*fate, new] for fate in fates for new in (*range(late + 1), None) if new is not None or _in_a_row(fate) < lost
        ]
    found = set()
    for fate in fates:
        has = []
        for tick in range(ticks):
            come = [
                j for j, (sent, delay) in enumerate(zip(runs, fate, strict=True)) if delay is not None and sent + delay <= tick
            ]
            has.append(max(come, default=-1))
        found.add(tuple(has))
    return found


def _in_a_row(fate) -> int:
    count = 0
    for each in reversed(fate):
        if each is not None:
            break
        count += 1
    return count


@pytest.mark.parametrize(
    ("every", "phase", "late", "lost", "ticks"),
    [
        (1, 0, 0, 2, 6),
        (1, 0, 1, 0, 6),
        (1, 0, 2, 0, 5),
        (1, 0, 1, 1, 5),
        (2, 0, 1, 0, 8),
        (2, 1, 3, 1, 8),
        (3, 1, 2, 1, 9),
        (2, 0, 5, 0, 8),
    ],
)
def test_a_receiver_may_have_what_some_delays_and_losses_give(every, phase, late, lost, ticks):
    """The walk over states of messages gives each sequence, and no other, as trying all fates of messages does."""
    keys = f"every = {every}, phase = {phase}, late = {late}, lost = {lost}"
    family = family_of(TANK.format(messages=keys), "1")
    sequences = set()
    todo: list[tuple] = [(family.start, 0, ())]
    while todo:
        state, tick, before = todo.pop()
        if tick >= ticks:
            sequences.add(before[:ticks])
            continue
        for letter, (_, following, _) in family.moves[state].items():
            place, _, _, back = letter.replace(":", "").split()
            cut = tick + (int(place) - tick) % every
            later = int(next(iter(family.moves[following])).split(":")[0])
            until = cut + ((later - int(place)) % every or every)
            now = max((cut - phase) // every - int(back), -1)
            has = [*before, *[-1] * (cut - len(before))]
            todo.append((following, until, (*has, *[now] * (until - len(has)))))
    assert sequences == simulated(every, phase, late, lost, ticks)


def proof_of(spec: str, value: str, number: str = "k") -> list[dict]:
    """A claim at a value with the forms that are found of its automaton, nothing if none are."""
    family = family_of(spec, value, number)
    point = balls.Cell({})
    letters = sorted(family.frames.words)
    follows = np.zeros((len(letters), len(letters)), dtype=bool)
    for moves in family.moves.values():
        for letter, (_, following, _) in moves.items():
            for then in family.moves[following]:
                follows[letters.index(letter), letters.index(then)] = True
    A = np.array([[[x / balls.ONE for x in row] for row in family.matrix(each, point).parts[()]] for each in letters])
    centre, factor = find_norms(1.0001 * A, follows)
    if factor < 1:
        return []
    graph = centre.norms.graph
    forms = centre.norms.P / abs(centre.norms.P).max()
    nodes = [{"L": [[f"{x:.15g}" for x in row] for row in np.linalg.cholesky(P).T]} for P in forms]
    places = zip(graph.source.tolist(), graph.symbol.tolist(), graph.target.tolist(), strict=True)
    edges = [[source, letters[symbol], target] for source, symbol, target in places]
    first = family.moves[family.start].keys()
    start = next(node for node in range(len(nodes)) if first <= {letter for source, letter, _ in edges if source == node})
    cell = {"nodes": nodes, "edges": edges, "start": start}
    return [{"claim": "for all", "numbers": {number: value}, "states": family.states}, cell]


@pytest.mark.parametrize("lost", [1, 2, 3])
def test_losses_in_a_row_leave_two_over_one_more_of_them(lost, tmp_path):
    """x' = -k x, held over steps of 0.1 s: the worst is a constant step of (lost + 1) 0.1 s, k < 20/(lost + 1)."""
    spec = TANK.format(messages=f"lost = {lost}")
    limit = 20 / (lost + 1)
    lines = proof_of(spec, f"{0.99 * limit:.6g}")
    assert checked(tmp_path, spec, lines)[0] == 0
    further = [lines[0] | {"numbers": {"k": f"{1.01 * limit:.6g}"}}, lines[1]]
    assert checked(tmp_path, spec, further)[0] == 1
    code, words = checked(tmp_path, TANK.format(messages=f"lost = {lost + 1}"), lines)
    assert code == 1
    assert f"the frame 0: net has {lost + 1} may come" in words


def test_states_of_messages_are_as_many_as_are_told(monkeypatch):
    """Of a receiver that lacks up to three messages in a row: four states."""
    for most, wrong in ((4, False), (3, True)):
        monkeypatch.setattr(for_all, "MOST_STATES", most)
        with pytest.raises(file.Unreadable, match="more than 3 states") if wrong else nullcontext():
            assert len(family_of(TANK.format(messages="lost = 3"), "1").moves) == most


def test_a_tick_of_lateness_has_another_proof(tmp_path):
    """Each message 0 or 1 tick late: nothing up to 11 ticks long is unstable below k T = 0.99; 0.9 is proved."""
    spec = TANK.format(messages="late = 1")
    lines = proof_of(spec, "9")
    assert checked(tmp_path, spec, lines)[0] == 0
    for other in ("late = 2", "late = 1, lost = 1"):
        assert checked(tmp_path, TANK.format(messages=other), lines)[0] != 0


BEHIND = """
rates.tick_hz = 100
numbers.s = 15.0
[block]
x = { type = "mass", mass = 2, damping = 1.68 }
ca = { type = "channel", every = 7, lost = 1 }
z = { type = "delay", seconds = 0.05 }
[wire]
"ca.u" = "-s*x.x"
"z.u" = "ca.y"
"x.f" = "z.y"
"""
WORD = ["0: ca gets 0", "0: ca has 1"]


@pytest.mark.parametrize(("s", "code"), [("14.2969", 0), ("14.296", 1)])
def test_a_dead_time_behind_losses_acts_as_late_as_it_says(s, code, tmp_path):
    """Every second message lost is unstable from 14.2968 on, as a march of the same pattern says."""
    claim = file.Claim("refuted", {"s": Fraction(s)}, outside=1, word=WORD)
    family = file.family_of(file.spec_of(BEHIND.encode()), claim)
    cell, outside = form_of(matrix_of(family))
    line = {"claim": "refuted", "numbers": {"s": s}, "outside": max(outside, 1), "word": WORD, "states": family.states}
    assert checked(tmp_path, BEHIND, [line, cell])[0] == code
