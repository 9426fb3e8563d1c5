"""Loops with all of their numbers in a box: enclosed as polynomials of these, with a bound on
all that is left out."""
