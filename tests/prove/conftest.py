"""Loops in the form in which the prover takes them."""

import numpy as np
import pytest

import wavesweep
from wavesweep.analyses.loops import drift_of
from wavesweep.prove import prove_column


@pytest.fixture(scope="session")
def prove():
    """A function: the proof of a spec along one of its numbers."""

    def proof(tables, number, span, values=None, **more):
        spec = wavesweep.compile(tables).spec
        path = spec.names.find(number).path
        flat = dict(spec.values) | {spec.names.find(name).path: value for name, value in (values or {}).items()}
        drift = drift_of(spec.drawing, flat | {path: np.array([1.0, 2.0])})
        return prove_column(spec.drawing, flat, path, span, len(drift.states) - len(drift.kept), **more)

    return proof
