"""Loops in the form in which the prover takes them."""

import numpy as np
import pytest

import wavesweep
from wavesweep.program.sweep.grid import loops_of
from wavesweep.prove.columns import prove_column


@pytest.fixture(scope="session")
def prove():
    """A function: the proof of a spec along one of its numbers."""

    def proof(tables, number, span, values=None, **more):
        spec = wavesweep.compile(tables).spec
        path = spec.names.find(number).path
        loop = loops_of(spec, dict(spec.values) | {spec.names.find(name).path: value for name, value in (values or {}).items()})
        drift = loop.changed({path: np.array([1.0, 2.0])}).drift()
        return prove_column(loop, path, span, drift, **more)

    return proof
