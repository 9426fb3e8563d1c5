"""The prover: columns of stable intervals in ball arithmetic (python-flint), for those that
doubles leave in doubt."""
