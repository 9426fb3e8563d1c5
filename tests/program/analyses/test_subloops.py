"""Loops in one spec that nothing connects are searched by themselves."""

import numpy as np
import pytest

import wavesweep
from wavesweep.engine._search.subloops import subloops
from wavesweep.engine._stability.intervals import Intervals, common
from wavesweep.engine.errors import UsageError
from wavesweep.program.spec import load


def joints(gain="p*hb.y"):
    """Two joints under a proportional gain."""
    blocks, wires = {}, {}
    for name in ("a", "b"):
        blocks |= {name: {"type": "mass", "mass": 0.1, "damping": 0.5}, f"h{name}": {"type": "hold", "every": 4}}
        wires |= {f"h{name}.u": f"{name}.x"}
    wires |= {"a.f": "hand - p*ha.y", "b.f": f"0.5*hand - {gain}"}
    ports = {"hand": {"force": "hand", "displacement": "a.x"}}
    return {"rates": {"tick_hz": 1000}, "numbers": {"p": 1.0}, "block": blocks, "wire": wires, "ports": ports}


def test_parts_are_of_blocks_that_act_on_one_another():
    both = ["a", "ha"], ["b", "hb"]
    for gain in ("p*hb.y", "p*hb.y + 0.001*a.v"):
        one, other = subloops(load(joints(gain=gain)).drawing)
        assert ([block.name for block in one.blocks], [block.name for block in other.blocks]) == both
        assert [signal for port, terms in other.wires for signal, _ in terms] == ["b.x", "hb.y"]
        assert (one.hand, other.hand) == (None, None)
    tables = joints(gain="p*hb.y + 0.001*a.v")
    tables["wire"]["a.f"] += " - 0.001*hb.y"
    assert len(subloops(load(tables).drawing)) == 1


def test_blocks_that_come_to_rest_by_themselves_are_in_no_part():
    """But for those of a loop: a sum that reads what it gives does not come to rest."""
    tables = joints()
    tables["block"] |= {"seen": {"type": "butterworth", "order": 2, "cutoff_hz": 50.0}, "ring": {"type": "delay", "steps": 2}}
    tables["wire"] |= {"seen.u": "a.x", "ring.u": "0.5*ring.y + b.x"}
    names = [[block.name for block in part.blocks] for part in subloops(load(tables).drawing)]
    assert names == [["a", "ha"], ["b", "hb"], ["ring"]]
    del tables["block"]["ring"], tables["wire"]["ring.u"]
    for name in ("a", "ha", "b", "hb"):
        del tables["block"][name]
    tables = {"rates": tables["rates"], "numbers": {"g": 2.0}, "block": tables["block"], "wire": {"seen.u": "g*hand"}}
    tables["ports"] = {"hand": {"force": "hand", "displacement": "seen.y"}}
    assert len(subloops(load(tables).drawing)) == 1


def test_a_part_in_doubt_leaves_no_doubt_where_others_are_never_stable():
    def intervals(low, high, doubt=0):
        known = np.isfinite(low)
        each = {"column": [0], "index": [0 if known else -1], "count": [int(known)], "low": [low], "high": [high]}
        each |= {"low_omega": [0.0], "high_omega": [0.0], "doubt": [doubt], "residual": [0.0]}
        each |= {"low_cause": [0], "high_cause": [0], "argument": [1]}
        return Intervals(**{name: np.array(value) for name, value in each.items()})

    none, one, two, unknown = intervals(np.nan, np.nan), intervals(0.0, 1.0), intervals(2.0, 3.0), intervals(0.5, 9.0, 4)
    within, seen = (0.5, 1.0), (0.5, 9.0)
    cases = [((none, unknown), 0, None), ((one, two, unknown), 0, None), ((one, unknown), 4, within), ((unknown,) * 2, 4, seen)]
    for parts, doubt, ends in cases:
        found = common(parts)
        assert (found.doubt.tolist(), found.count.tolist()) == ([doubt], [int(ends is not None)])
        assert ends is None or (found.low[0], found.high[0]) == ends


def test_values_at_which_nothing_leads_from_part_to_part_are_refused():
    tables = joints()
    tables["wire"]["b.f"] += " + a.v/(p - 100)"
    with pytest.raises(UsageError, match="a value without a loop"):
        wavesweep.compile(tables).stable_intervals("p", (0.0, 2000.0))
