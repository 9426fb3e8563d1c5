"""Margins of a loop that is broken at a signal, and its poles."""
