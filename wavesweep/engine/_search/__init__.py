"""Searches for the stable intervals of loops along a number."""
