"""The prover: columns of stable intervals in ball arithmetic (python-flint), for those that doubles leave in doubt."""

from wavesweep.prove.columns import WAYS, Proof, prove_column, proved_intervals

__all__ = ["WAYS", "Proof", "prove_column", "proved_intervals"]
