"""Gains and energies of lifted loops, which several capabilities ask about."""
