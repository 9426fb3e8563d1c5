"""The prover: columns of stable intervals in ball arithmetic (python-flint), for those that doubles leave in doubt."""

from wavesweep.prove.columns import WAYS, Proof, prove_column
from wavesweep.prove.polynomials import Budget

__all__ = ["WAYS", "Budget", "Proof", "prove_column"]
