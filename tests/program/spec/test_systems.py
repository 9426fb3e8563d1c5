"""Blocks of nested tables may be systems of python-control and scipy.signal: they are what a spec would write."""

import control
import numpy as np
import pytest
from scipy import signal

import wavesweep
from wavesweep.engine import StateSpaceBlock
from wavesweep.engine.errors import UsageError

WRITTEN = {
    "plant": {"type": "tf", "num": [20.0], "den": [1.0, 20.0, 0.0]},
    "law": {"type": "ss", "A": [[0.5]], "B": [[1.0]], "C": [[0.2]], "D": [[0.3]], "discrete": True, "every": 20},
}
LAW = ([[0.5]], [[1.0]], [[0.2]], [[0.3]])


def tables(rates=1000, **blocks):
    return {
        "rates": {"tick_hz": rates},
        "numbers": {"k": 1.0, "m": 1.0},
        "block": {"late": {"type": "delay", "steps": 3}} | WRITTEN | blocks,
        "wire": {"plant.u": "late.y", "law.u": "-m*plant.y", "late.u": "k*law.y"},
        "sweep": {"along": "k", "k": {"start": 0, "stop": 500}},
        "for_all": {"m": {"start": 1, "stop": 1.1}},
    }


@pytest.mark.asks("for_all")
@pytest.mark.parametrize(
    "blocks",
    [
        {"plant": control.tf([20], [1, 20, 0]), "law": control.ss(*LAW, 0.02)},
        {"plant": signal.TransferFunction([20], [1, 20, 0]), "law": signal.StateSpace(*LAW, dt=0.02)},
        {"plant": signal.ZerosPolesGain([], [0, -20], 20)},
        {"law": StateSpaceBlock(*map(np.array, LAW), every=20)},
    ],
)
def test_a_system_is_the_block_that_a_spec_would_write(blocks):
    written, given = (wavesweep.compile(tables(**some)).spec.tables() for some in ({}, blocks))
    assert given == written
    assert given["for_all"]


@pytest.mark.parametrize(
    ("rates", "law", "said"),
    [
        (1000, control.ss(*LAW, 0.0213), r"block law: expected a sample time of whole ticks of 0\.001 s"),
        (1000, control.ss(*LAW, None), "block law: expected a system that says its time"),
        (None, control.ss(*LAW, 0.02), r"rates\.tick_hz: expected a number beside blocks that are systems"),
        (1000, object(), "block law: expected a StateSpaceBlock, a system of .*, found object"),
        (1000, 3, r"block\.law: expected a table, found 3"),
    ],
)
def test_what_is_no_block_is_refused(rates, law, said):
    with pytest.raises((UsageError, wavesweep.SpecError), match=said):
        wavesweep.compile(tables(rates, law=law))
