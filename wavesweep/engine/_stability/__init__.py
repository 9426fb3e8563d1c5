"""Stable intervals, with a certificate: exactly along a number that is a scalar gain of the
frame, else from eigenvalues."""
