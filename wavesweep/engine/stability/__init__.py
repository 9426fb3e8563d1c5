"""Stable intervals, with a certificate: exactly along the wall's parameters, through eigenvalues along any other number."""
