"""Codes of the reasons of doubt, which records hold in place of their words, and what is small enough to leave none."""

from wavesweep.engine.doubts import MEANINGS

FELT_ALIKE = 1e-9  # relative difference of stiffnesses felt, below which none of them is the larger one
SPARED = 1e-6  # relative error of a response up to which a row has no doubt

NONE, ROUNDING, COUNTS, CROWDED, SEARCH, OVERFLOW, UNSTABLE, DEFECTIVE, FAST, CONTRADICTION = range(len(MEANINGS))
