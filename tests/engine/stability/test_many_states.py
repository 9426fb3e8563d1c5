"""Loops of more states than a polynomial has digits for: their arcs of the circle, and the forms in which they are sampled."""

import mpmath
import numpy as np
import pytest

import wavesweep
from wavesweep.engine._monodromy import resolvent
from wavesweep.engine._monodromy.resolvent import DelayLines, TriangularForm
from wavesweep.engine._search.open_loops import open_loops
from wavesweep.engine._stability import arcs, regions
from wavesweep.engine._state_space import StateSpace
from wavesweep.engine.loop import Loops
from wavesweep.program.sweep.grid import own_loop


def drawn_chain(masses, damping=0.2, delay=0):
    """Masses in a row, of which the first is on a spring K that is read once in 20 ticks, perhaps late."""
    near = {i: [j for j in (i - 1, i + 1) if 0 <= j < masses] for i in range(masses)}
    wires = {f"m{i}.f": " ".join(f"-50*(m{i}.x-m{j}.x)-{damping}*(m{i}.v-m{j}.v)" for j in near[i]) for i in range(masses)}
    blocks = {f"m{i}": {"type": "mass", "mass": 0.1, "damping": 0.5} for i in range(masses)}
    read = "d.y" if delay else "h.y"
    late = {"d": {"type": "delay", "steps": delay, "every": 20}} if delay else {}
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 20.0},
        "block": blocks | {"h": {"type": "hold", "every": 20}} | late,
        "wire": wires | {"h.u": "m0.x", "m0.f": wires["m0.f"] + f" - K*{read}"} | ({"d.u": "h.y"} if delay else {}),
    }


def cut_of(tables):
    loops: Loops = own_loop(wavesweep.compile(tables).spec)
    cut = open_loops(loops, "K").cut
    return cut if cut.batch else cut.at(np.newaxis)


@pytest.mark.parametrize(
    ("masses", "damping", "delay"), [(10, 0.2, 0), (12, 0.02, 0), (14, 2.0, 4), (30, 0.2, 0), (40, 0.2, 6)]
)
def test_loops_of_20_states_and_more_are_certified_in_doubles(masses, damping, delay):
    """And their ends are where the eigenvalues of the loop with the number in place change sides."""
    tables = drawn_chain(masses, damping, delay)
    table = wavesweep.compile(tables).stable_intervals("K", (1, 1000))
    cut = cut_of(tables)
    assert len(table) == 1
    assert table.certified.all()
    assert table.low[0] == 1.0
    ends = table.high[0] * np.array([1 - 1e-7, 1 + 1e-7])
    radii = np.abs(1 + np.linalg.eigvals(cut.at((0, None)).closed(ends, np.zeros(2)))).max(-1)
    assert radii[0] < 1 < radii[1]


def random_system(seed, n, rows=1):
    """A loop with lightly damped and some equal poles."""
    random = np.random.default_rng(seed)
    z = (1 - 10.0 ** random.uniform(-4, -1, n // 2)) * np.exp(1j * random.uniform(0.01, 3, n // 2))
    z[1] = z[0] + seed % 2 * 1e-6
    E = np.zeros((n, n))
    for k, value in enumerate(z):
        E[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[value.real, value.imag], [-value.imag, value.real]]
    E += np.triu(random.normal(size=(n, n)), 2) / 5
    change = np.linalg.qr(random.normal(size=(n, n)))[0] * 2.0 ** random.integers(-9, 9, n)
    return StateSpace(
        np.linalg.solve(change, E @ change)[None] - np.eye(n),
        random.normal(size=(1, n, 1)),
        random.normal(size=(1, rows, n)),
        random.normal(size=(1, rows, 1)),
    )


@pytest.mark.parametrize("close_to", [0.0, np.inf])
@pytest.mark.parametrize(("seed", "late"), [(0, 0), (1, 1000), (2, 0), (3, 999)])
def test_the_boundary_in_a_form_is_within_its_errors(monkeypatch, seed, late, close_to):
    """Against 60 digits, in eigenvectors and in those of Schur, at and next to lightly damped and equal poles, also if late."""
    opened = random_system(seed, 8, rows=2)
    monkeypatch.setattr(resolvent, "MODAL_ERROR", close_to)
    form = TriangularForm.of(*opened[:3])
    assert form.diagonal == (close_to > 0)
    angles = np.abs(np.angle(1 + np.linalg.eigvals(opened[0][0])))
    theta = np.concatenate([np.linspace(0.05, 3.1, 5), angles[::2] * (1 + 1e-6)])[None]
    assert_within_errors(opened, form, form.system(opened), theta, late, fixed=0.3 if late == 999 else None)


@pytest.mark.parametrize(("late", "fixed"), [(0, None), (1, None), (24, -2.5), (999, None), (1000, None), (1000, 0.7)])
def test_the_boundary_along_delay_lines_is_within_its_errors(late, fixed):
    """`value` and `beyond` of `_boundary`, down to the ends of the circle, and at angles at which late numbers turn many times;
    of the line of ten states the fourth is read as well."""
    # Less identity: state 0 has its pole at 0.99, state 1 adds it up (a pole at 1), and 2 to 11 are the line.
    E = np.diag([1.0] * 11, -1) - np.eye(12)
    E[:2, :2] = [[-0.01, 0.0], [0.02, 0.0]]
    rows = np.zeros((2, 12))
    rows[:, [0, 1, 5, 11]] = [[0.0, 0.1, 0.0, 0.3], [0.4, 0.0, 0.7, -0.2]]
    B = np.eye(12)[:, :1] * 0.5
    opened = StateSpace(E[None], B[None], rows[None], np.array([[[0.2], [-0.1]]]))
    theta = np.concatenate([[1e-7, 1e-3], np.linspace(0.05, 3.1, 9), [np.pi - 1e-3, np.pi - 1e-7]])[None]
    lines, system = DelayLines.of(opened.E).condensed(opened)
    assert lines.steps.tolist() == [4, 6]
    assert_within_errors(opened, lines, system, theta, late, fixed)


def assert_within_errors(opened, form, system, theta, frames, fixed):
    """Against 60 digits; system: the opened loop in the states of the form. fixed: a number of the second row of C, or None."""
    late = frames and arcs._Late(frames, None if fixed is None else np.full((1, 1), fixed))
    found = arcs._boundary(StateSpace(*(matrix[:, None] for matrix in system)), form, theta, 2.0, np.zeros(1, int), late)
    eps = np.finfo(float).eps
    with mpmath.workdps(60):
        E, B, C, D = (mpmath.matrix(matrix[0].tolist()) for matrix in opened)
        for at, angle in enumerate(theta[0]):
            z = mpmath.expj(float(angle))
            H, *other = (C * mpmath.lu_solve((z - 1) * mpmath.eye(E.rows) - E, B) + D) / z**frames
            unit = 1 if fixed is None else 1 - fixed * other[0]
            value = (unit / H).imag * abs(H) ** 2 / mpmath.sin(float(angle))
            beyond = abs(unit) ** 2 - 4 * abs(H) ** 2
            assert abs(value - float(found.value[0, at])) <= eps * found.value_off[0, at]
            assert abs(beyond - float(found.beyond[0, at])) <= eps * found.beyond_off[0, at]


def late_lag(ticks, pole, sign):
    """A lag 1/(s - pole), or an integrator, that K times its own late value acts on."""
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 1.0},
        "block": {"lag": {"type": "tf", "num": [1.0], "den": [1.0, -pole]}, "late": {"type": "delay", "steps": ticks}},
        "wire": {"late.u": "lag.y", "lag.u": f"{sign}K*late.y"},
    }


@pytest.mark.parametrize(
    ("pole", "sign", "intervals"),
    [(-0.5, "-", 1), (-0.5, "", 1), (0.8, "-", 1), (12.0, "-", 0), (0.0, "-", 1), (0.0, "", 0)],
)
def test_counts_from_0_through_a_long_delay_are_those_of_all_eigenvalues(monkeypatch, pole, sign, intervals):
    """Nyquist's criterion, of loops that without the number are stable, are not, and drift; no closed loop is counted."""
    counted = []
    count_outside = regions.count_outside
    monkeypatch.setattr(regions, "count_outside", lambda E, dE: counted.append(E) or count_outside(E, dE))
    table = wavesweep.compile(late_lag(110, pole, sign)).stable_intervals("K", (0, 40))
    assert len(counted) == 1
    assert table.certified.all()
    assert table.intervals[0] == intervals
    lag = np.exp(pole * 1e-3)
    gain = (lag - 1) / pole if pole else 1e-3
    for K in np.append(np.linspace(0.05, 39, 8), 0.999 * table.high[:intervals]):
        frame = np.eye(111, k=-1)
        frame[0, 0] = lag
        frame[0, 110] = -K * gain if sign else K * gain
        stable = np.abs(np.linalg.eigvals(frame)).max() < 1
        assert stable == ((table.low < K) & (table.high > K)).any(), K
