"""Loops that are stable whatever some numbers are, and in whatever order frames follow each
other."""
