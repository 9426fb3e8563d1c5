"""Proof files, which `wavesweep.checker` reads."""
