"""Slices that differ in a number of the wire that the axis is in: they share a loop, and give what each alone gives."""

from pathlib import Path

import numpy as np
import pytest

import wavesweep
from wavesweep.engine._search import one_gain, open_loops
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.program.analyses.interval_jobs import job_of, searches_of
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

RECIPES = Path(__file__).parents[3] / "sweeps" / "recipes"


def wave_line():
    return load(RECIPES / "controllers" / "pmw-lm.toml")


@pytest.fixture
def opened(monkeypatch):
    """Of each frame of loops that are open at the axis, whether they are open at a number beside it as well."""
    made, frame = [], open_loops.open_frame
    monkeypatch.setattr(
        open_loops, "open_frame", lambda *given, **how: made.append(open_loops.BESIDE in given[3]) or frame(*given, **how)
    )
    open_loops.remembered_loops.cache_clear()
    open_loops.remembered_slices.cache_clear()
    return made


def test_each_has_the_same_bits_whichever_others_there_are(opened):
    loop, values = wavesweep.compile(wave_line()), np.linspace(0.1, 14, 7).tolist()
    whole = loop.stable_intervals("K", (0, 20000), b=[15.0, 40.0], B=values)
    assert sum(opened) == 1
    for b, some in ((15.0, values[:2]), (40.0, values[3:4]), (15.0, values[2:])):
        part = loop.stable_intervals("K", (0, 20000), b=[b], B=some)
        mine = whole[(whole.b == b) & whole.B.isin(some)].reset_index(drop=True)
        for name in ("low", "high", "low_omega", "high_omega", "residual", "felt_low", "felt_high"):
            np.testing.assert_array_equal(part[name], mine[name])


def test_loops_are_connected_once_also_if_they_are_asked_again(opened):
    loop = wavesweep.compile(wave_line())
    loop.stable_intervals("K", (0, 20000), b=[15.0, 40.0], B=[2.0, 3.0])
    loop.stable_intervals("K", (0, 10000), b=[15.0, 40.0], B=[1.0])
    assert len(opened) == 1
    loop.stable_intervals("K", (0, 10000), b=[15.0, 41.0], B=[1.0])
    assert len(opened) == 2


def test_a_loop_is_opened_once_for_its_slices_with_a_wall_damping_and_without():
    """Also if another number, which a cut does not leave out, is 0 in some of the loops."""
    sweep = {"K_VE": {"start": 0, "stop": 20000}, "K_LM": [0.0, 10.0, 20.0], "B_VE": [0.0, 2.0]}
    job = job_of(load({"controller": {"kind": "pmw-lm"}, "sweep": sweep}))
    searches = searches_of(job, job.chunks[0]).searches
    groups = [group for search in searches for group in search.opened_groups()]
    assert sorted(members.tolist() for members, _ in groups) == [[0, 1], [2, 3, 4, 5]]
    assert [slices.opened.loops.second for _, slices in groups] == ["environment.B_VE"] * 2


def test_a_number_with_which_a_loop_of_direct_terms_has_no_solution_is_named():
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"p": 40.0, "q": 0.5},
        "block": {"m": {"type": "mass", "mass": 0.1, "damping": 0.2}, "g": {"type": "gain"}},
        "wire": {"g.u": "p*m.x + q*g.y", "m.f": "-g.y"},
    }
    loop = wavesweep.compile(tables)
    assert loop.stable_intervals("p", (0, 400), q=[0.5, 2.0]).certified.all()
    with pytest.raises(IllPosedLoopError, match=r"q = 1\.0: the loop of direct terms through g has no solution"):
        loop.stable_intervals("p", (0, 400), q=[0.5, 1.0, 2.0])


def test_loops_with_other_numbers_of_slices_go_together(opened):
    """A chunk may end within the slices of a loop."""
    spec, b, B = wave_line(), np.array([11.0, 11.0, 13.0, 12.0]), np.array([1.0, 2.0, 1.0, 3.0])
    loop = own_loop(spec)
    found = [
        open_loops.Opened.of(loop.changed({"numbers.b": b[some], "numbers.B": B[some]}), "K", len(some))
        for some in ([0, 1, 2, 3], [0], [1], [2], [3])
    ]
    whole, *each = (one_gain.of_cut(part, (0.0, 20000.0)) for part in found)
    assert opened == [True] * 4  # the slices [0] and [1] alone have one loop, which is remembered
    assert whole.column.tolist() == [0, 1, 2, 3]
    assert whole.high.tolist() == [float(part.high[0]) for part in each]
    assert whole.high.max() < 20000


def test_another_value_of_a_number_opens_one_loop_more(opened):
    """What a slice costs is known from the first one."""
    loop = wavesweep.compile(wave_line())
    loop.stable_intervals("K", (0, 20000), b=21.0)
    before = len(opened)
    loop.stable_intervals("K", (0, 20000), b=22.0)
    assert len(opened) == before + 1
